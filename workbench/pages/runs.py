"""Runs in a folder, by what they say of themselves, and two of them side by side."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from workbench.errors import InputError
from workbench.pages.answer import SUMMARIES, Measure, finite
from workbench.recordings.channels import listed
from workbench.runtime.files import parse_table, read_text

Verdict = Literal["better", "worse", "changed", "unclear", "unchanged", "gone", "new"]
_ANEW = "make the results anew with this version"


@dataclass(frozen=True)
class RunRecord:
    """One run, as its summary tells it."""

    folder: Path
    place: str  # of its folder in the one that was asked for
    summary: str
    run: Mapping[str, Any]  # see `provenance.run_of`
    sentence: str
    # headline, details: numbers by what they are
    headline: Mapping[str, Measure]
    details: Mapping[str, Measure]
    files: Mapping[str, int]  # beside the summary and below, by suffix: how many
    provenance: Mapping[str, Any]  # all that made it

    @property
    def commit(self) -> str:
        """Commit of the workbench, shortened as git does."""
        commit = self.run["commit"]
        return "" if commit is None else commit[:9] + "-dirty" * commit.endswith("-dirty")

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers and texts."""
        return {
            "folder": str(self.folder),
            "summary": self.summary,
            "run": dict(self.run),
            "sentence": self.sentence,
            "headline": {name: vars(measure) for name, measure in self.headline.items()},
            "files": dict(self.files),
        }


@dataclass(frozen=True)
class Change:
    """One number before and after."""

    name: str
    # before, after: None where there is none
    before: Measure | None
    after: Measure | None
    # "unchanged" where both are the same in four digits; "unclear" where the 95 % intervals of both
    # overlap; "changed" where neither way is better
    verdict: Verdict

    @property
    def unit(self) -> str:
        """Unit of both."""
        return (self.after or self.before or Measure(None, "1")).unit

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers and texts."""
        ends = {"before": self.before, "after": self.after}
        values = {key: None if end is None else vars(end) for key, end in ends.items()}
        return {"name": self.name, "unit": self.unit, "verdict": self.verdict, **values}


def read_runs(folder: Path, warn: Callable[[InputError], None] | None = None) -> list[RunRecord]:
    """All runs in a folder and below, by their place.

    Parameters
    ----------
    warn : told of a summary that cannot be read, where others can; by default that is an error.
    """
    if not folder.is_dir():
        raise InputError(
            where=str(folder),
            found="a file" if folder.exists() else "no such folder",
            expected="a folder of results, such as results/simulate",
            remedy="correct the path",
        )
    paths = sorted(path for name in SUMMARIES for path in folder.rglob(name))
    runs, wrong = [], []
    for path in paths:
        try:
            runs.append(_read(path, folder))
        except InputError as problem:
            wrong.append(problem)
    if wrong and (warn is None or not runs):
        raise wrong[0]
    if warn is not None:
        for refusal in wrong:
            warn(refusal)
    if not runs:
        raise InputError(
            where=str(folder),
            found=f"none of {', '.join(SUMMARIES)}",
            expected="what a command wrote with --out",
            remedy="name a folder of results",
        )
    return runs


def _read(path: Path, folder: Path) -> RunRecord:
    try:
        content = parse_table(read_text(path, _ANEW))
        run, answer = content["provenance"]["run"], content["answer"]
        headline, details = (
            {
                name: Measure(**dict(map(_known, measure.items())))
                for name, measure in answer[key].items()
            }
            for key in ("headline", "details")
        )
        _check(run, [*headline.values(), *details.values()])
        return RunRecord(
            folder=path.parent,
            place=path.parent.relative_to(folder).as_posix(),
            summary=path.name,
            run=run,
            sentence=str(answer["sentence"]),
            headline=headline,
            details=details,
            files=_files(path.parent),
            provenance=content["provenance"],
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            where=str(path),
            found="a summary that does not say what made it and what it found",
            expected="one of this version",
            remedy=_ANEW,
        ) from None


def _known(entry: tuple[str, Any]) -> tuple[str, Any]:
    """An entry of a measure; of a number that is infinite or NaN, that it could not be had."""
    key, value = entry
    return key, finite(value) if isinstance(value, float) else value


def _check(run: Mapping[str, Any], measures: list[Measure]) -> None:
    texts = [run[key] for key in ("command", "date", "workbench", "system")]
    texts += [] if run["commit"] is None else [run["commit"]]
    data = dict(run["data"])
    numbers = [end for measure in measures for end in (measure.value, measure.low, measure.high)]
    if (
        not all(isinstance(text, str) for text in (*texts, *data))
        or not all(end is None or isinstance(end, int | float) for end in numbers)
        or not all(isinstance(measure.unit, str) for measure in measures)
    ):
        raise TypeError


def _files(folder: Path) -> dict[str, int]:
    counts: dict[str, int] = {}
    for path in sorted(folder.iterdir()):
        if path.is_file():
            suffix = path.suffix.removeprefix(".") or path.name
            counts[suffix] = counts.get(suffix, 0) + 1
    return counts


def compare_runs(before: RunRecord, after: RunRecord) -> list[Change]:
    """All numbers of two runs of one command: the headline, then the details.

    Raises
    ------
    InputError
        If they are of different commands.
    """
    if before.run["command"] != after.run["command"] or before.summary != after.summary:
        raise InputError(
            where=str(after.folder),
            found=f"a run of '{after.run['command']}' ({after.summary})",
            expected=f"one of '{before.run['command']}' ({before.summary}), as {before.folder}",
            remedy="compare two runs of the same command",
        )
    changes = []
    for key in ("headline", "details"):
        old, new = getattr(before, key), getattr(after, key)
        for name in dict.fromkeys((*old, *new)):
            first, last = old.get(name), new.get(name)
            if first is None or last is None or first.unit == last.unit:
                changes.append(Change(name, first, last, _verdict(first, last)))
            else:
                changes += [Change(name, first, None, "gone"), Change(name, None, last, "new")]
    return changes


def _verdict(before: Measure | None, after: Measure | None) -> Verdict:
    first, last = (None if end is None else end.value for end in (before, after))
    if last is None or after is None:
        return "unchanged" if first is None and before is not None else "gone"
    if first is None or before is None:
        return "new"
    if f"{first:.4g}" == f"{last:.4g}":
        return "unchanged"
    if _overlap(before, after):
        return "unclear"
    if not after.better:
        return "changed"
    return "better" if (last < first) == (after.better == "lower") else "worse"


def _overlap(measure: Measure, other: Measure) -> bool:
    if measure.low is None or measure.high is None or other.low is None or other.high is None:
        return False
    return measure.low <= other.high and other.low <= measure.high


def differences(before: RunRecord, after: RunRecord) -> list[str]:
    """What else is not the same, so that a change may come from it."""
    lines = []
    for key, text in (("system", "system"), ("workbench", "version"), ("commit", "commit")):
        if before.run[key] != after.run[key]:
            lines.append(f"{text}: {before.run[key]} and {after.run[key]}")
    old, new = dict(before.run["data"]), dict(after.run["data"])
    for text, names in (
        ("recordings only in the first", [name for name in old if name not in new]),
        ("recordings only in the second", [name for name in new if name not in old]),
        (
            "recordings with other content",
            [name for name in old if name in new and old[name] != new[name]],
        ),
    ):
        if names:
            lines.append(f"{text}: {listed(names)}")
    settings = dict(_leaves(before.provenance)), dict(_leaves(after.provenance))
    names = [
        name
        for name in dict.fromkeys((*settings[0], *settings[1]))
        if settings[0].get(name) != settings[1].get(name)
    ]
    if names:
        lines.append(f"settings: {listed(names)}")
    return lines


def _leaves(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Single values of nested tables, without what is told by itself."""
    if not isinstance(content, Mapping):
        yield path, content
        return
    for key, entry in content.items():
        if path or key not in ("run", "workbench", "commit", "meanings"):
            yield from _leaves(entry, f"{path}.{key}" if path else key)


def format_runs(runs: list[RunRecord]) -> str:
    """What a folder holds, for people."""
    return "\n\n".join("\n".join(_lines(run)) for run in runs)


def _lines(run: RunRecord) -> Iterator[str]:
    date = str(run.run["date"]).replace("T", " ").replace("+00:00", " UTC")
    version = f"workbench {run.run['workbench']}" + f" ({run.commit})" * bool(run.commit)
    count = len(run.run["data"])
    data = f", {count} recording{'s' * (count != 1)}" if count else ""
    yield f"{run.folder}: {run.run['command']}, {date}, {version}, {run.run['system']}{data}"
    yield f"  {run.sentence}"
    width = max(map(len, run.headline), default=0)
    for name, measure in run.headline.items():
        yield f"  {name:<{width}}  {_value(measure)}"
    files = ", ".join(f"{count} {suffix}" for suffix, count in run.files.items())
    yield f"  files: {files}"


def format_changes(before: RunRecord, after: RunRecord, changes: list[Change]) -> str:
    """Two runs side by side, for people: what got worse first, numbers of one unit together."""
    lines = [f"{before.run['command']}: {before.folder} -> {after.folder}"]
    lines += [f"not the same, {difference}" for difference in differences(before, after)]
    order: tuple[Verdict, ...] = ("worse", "better", "changed", "unclear", "gone", "new")
    shown = [change for change in changes if change.verdict != "unchanged"]
    shown.sort(key=lambda row: (order.index(row.verdict), row.unit))
    width = max((len(change.name) for change in shown), default=0)
    for row in shown:
        ends = " -> ".join(
            "none" if end is None else _value(end) for end in (row.before, row.after)
        )
        lines.append(f"{row.verdict:<8} {row.name:<{width}}  {ends}{_relative(row)}")
    counts = {verdict: sum(change.verdict == verdict for change in changes) for verdict in order}
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    same = sum(change.verdict == "unchanged" for change in changes)
    lines.append(
        f"of {len(changes)} numbers: " + ", ".join(filter(None, (summary, f"{same} unchanged")))
    )
    if counts["unclear"]:
        lines.append("unclear: the 95 % intervals of both overlap")
    return "\n".join(lines)


def _relative(change: Change) -> str:
    if (
        change.before is None
        or change.after is None
        or not change.before.value
        or change.after.value is None
    ):
        return ""
    return f" ({100.0 * (change.after.value / change.before.value - 1.0):+.1f} %)"


def _value(measure: Measure) -> str:
    if measure.value is None:
        return "none"
    unit = "" if measure.unit == "1" else f" {measure.unit}"
    interval = ""
    if measure.low is not None and measure.high is not None:
        interval = f" ({measure.low:.4g} to {measure.high:.4g})"
    return f"{measure.value:.4g}{interval}{unit}"
