"""What users give is read or refused in words, however damaged; `make fuzz` reads many more."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz import harness
from tests.fuzz.apart import one_process
from tests.fuzz.harness import Target, fuzz, generator, write
from tests.fuzz.targets import targets
from workbench.errors import InputError

# Mutants of each kind of file, some seconds in all; FMUs take longest, which are tried and loaded.
COUNTS = {
    "case": 250,
    "german.csv": 50,
    "stamps.txt": 50,
    "indices.csv": 50,
    "midnight.csv": 50,
    "comments.csv.gz": 50,
    "workbook.xlsx": 100,
    "old.xls": 50,
    "records.json": 50,
    "timetable.mat": 50,
    "labview.tdms": 150,
    "structures.mat": 50,
    "new.mat": 50,
    "table.parquet": 50,
    "logger.mf4": 50,
    "gains": 250,
    "checkpoint": 500,
    "verdicts": 150,
    "monitor state": 200,
    "summary.json": 200,
    "system file": 250,
    "wheelset file": 50,
    "Modelica": 200,
    "FMU of FMI 2.0": 50,
    "FMU of FMI 3.0": 50,
}


@pytest.fixture(scope="module")
def known(tmp_path_factory) -> Iterator[dict[str, Target]]:
    with one_process():
        yield {target.name: target for target in targets(tmp_path_factory.mktemp("originals"))}


@pytest.mark.parametrize(("name", "count"), COUNTS.items())
def test_damaged_files_are_read_or_refused_in_words(name, count, known):
    report = fuzz(known[name], seed=1, numbers=range(count))
    assert [str(failure) for failure in report.failures] == []
    counts = report.outcomes[name]
    assert counts.total() == count
    # Mutants that are all refused, or all read, would try nothing.
    assert min(counts["accepted"], counts["refused"]) > count // 50


def test_every_kind_of_file_is_among_them(known):
    assert COUNTS.keys() == known.keys()


def test_originals_are_accepted(known, tmp_path):
    for target in known.values():
        write(target.original, tmp_path / target.name)
        assert target.impossible(target.read(tmp_path / target.name)) == ""


def test_the_same_seed_makes_the_same_mutants(known):
    for target in known.values():
        made = [
            target.change(target.original, generator(target.name, seed, 7)) for seed in (1, 1, 2)
        ]
        assert made[0] == made[1] != made[2]


# --- what the harness itself must not miss ---


def raises(_: Path) -> None:
    raise KeyError("start")


def refuses(folder: Path) -> None:
    raise InputError(where=str(folder), found="this", expected="that", remedy="mend it")


def hangs(_: Path) -> None:
    while True:
        try:
            sum(range(1000))
        except Exception:  # as readers do that call foreign code
            continue


def leaves(_: Path) -> None:
    tempfile.mkdtemp()


@pytest.mark.parametrize(
    ("read", "outcome", "reason"),
    [
        (lambda _: None, "accepted", ""),
        (refuses, "refused", ""),
        (raises, "KeyError", "KeyError: 'start'"),
        (hangs, "hang", "more than 0.2 s"),
        (leaves, "leaves files", "tmp"),
        (lambda _: "NaN", "impossible", "NaN"),
    ],
)
def test_what_a_reader_must_not_do_is_named(read, outcome, reason, tmp_path, monkeypatch):
    monkeypatch.setattr(harness, "LONGEST", 0.2)
    target = Target("toy", {"a": b"1"}, read, lambda value: value or "")
    report = fuzz(target, seed=3, numbers=range(5, 7), keep=tmp_path)
    assert report.outcomes == {"toy": {outcome: 2}}
    assert [reason in failure.message for failure in report.failures] == [True] * (
        2 if reason else 0
    )
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert kept == (["toy-3-5", "toy-3-6"] if reason else [])
    for folder in tmp_path.iterdir():
        assert "seed 3, number" in (folder / "said.txt").read_text()
        assert (folder / "a").exists()


def test_what_is_written_outside_is_seen(tmp_path):
    def changes(_: Path) -> None:
        (tmp_path / "made").mkdir()
        (tmp_path / "made" / "file").write_text("x")
        (tmp_path / "made" / "file").rename(tmp_path / "moved")

    report = fuzz(Target("toy", {"a": b"1"}, changes), seed=1, numbers=range(1))
    (failure,) = report.failures
    assert report.outcomes == {"toy": {"writes outside": 1}}
    for name in ("made", "made/file", "moved"):
        assert str(tmp_path / name) in failure.message.split(", ")
