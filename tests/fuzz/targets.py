"""What is fuzzed: every kind of file that a user may give, with the reader that takes it."""

import gzip
import io
import json
import re
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random

import numpy as np

from tests.case_folders import LINES, TOML
from tests.fuzz.harness import Target
from tests.fuzz.mutations import BYTES, SMALL, Files, change_one, mutate, zipped
from tests.recorder_files import FORMATS, recorded
from workbench.cli.next import _read_rivals
from workbench.diagnosis.inference.quadratic import Quadratic, RecordingSystem
from workbench.diagnosis.inference.rivals import Rival, Rivals
from workbench.models.description import Description, read_description
from workbench.models.fmu import FMU
from workbench.models.modelica import check, read_library
from workbench.observers.gains import Gains, read_gains
from workbench.recordings.case import Case, read_case, read_file
from workbench.recordings.channels import NamedChannel, RecordingOptions
from workbench.runtime import resources
from workbench.studies.monitoring.estimate import RecordingEstimate
from workbench.studies.monitoring.state import RecordingResult, open_state
from workbench.studies.power.journal import Journal, SetVerdict
from workbench.studies.power.planting import Planting
from workbench.system.reader import read_system
from workbench.system.registry import load_system, open_model
from workbench.system.system import System
from workbench.system.template import write_system
from workbench.tuning import tunable
from workbench.tuning.checkpoint import Checkpoint, Generation, Population, load, save

IDENTITY = "of one search"
DESCRIPTION = "modelDescription.xml"
# What this machine may load, and what describes it.
_ENTRIES = rf"{DESCRIPTION}|binaries/(linux64|x86_64-linux)/"
_NAMES = (
    *("../out.txt", "/tmp/out.txt", "a\\b", "C:/a", "resources/" + "a" * 300),
    *("binaries/linux64/", ""),
)


def targets(folder: Path) -> tuple[Target, ...]:
    """All targets; a folder is for what their originals are written by."""
    system = load_system("wheelset")
    tank = {path.name: path.read_bytes() for path in write_system(folder / "tank") if path.suffix}
    return (
        _case(system),
        *_of_recorders(folder, system),
        _gains(system),
        _checkpoint(folder / "checkpoint.json"),
        _journal(folder / "sets.jsonl"),
        _state(folder / "state.sqlite"),
        _summary(),
        _system("system file", tank["system.toml"]),
        _system("wheelset file", _with_fmus(system)),
        Target("Modelica", {"Lib.mo": tank["package.mo"]}, _read_modelica),
        _fmu("FMU of FMI 2.0", resources.fmus() / "fmi2" / "MinimalObserver.fmu"),
        _fmu("FMU of FMI 3.0", resources.fmus() / "fmi3" / "MinimalObserver.fmu"),
    )


# --- recordings ---


def _case(system: System) -> Target:
    return Target(
        "case",
        {"case.toml": TOML.encode(), "measured.csv": "\n".join([*LINES, ""]).encode()},
        lambda folder: read_case(folder, system),
        _impossible_case,
    )


def _impossible_case(case: Case) -> str:
    """What no recording can be, whatever the machine."""
    if not (np.diff(case.time) > 0.0).all():
        return "time that does not increase"
    for name, values in case.signals.items():
        if values.shape != case.time.shape or not np.isfinite(values).all():
            return f"{name} of another length, or not finite"
    numbers = [value for value in case.conditions.values() if isinstance(value, float)]
    return "" if np.isfinite(numbers).all() else "a condition that is not finite"


def _of_recorders(folder: Path, system: System) -> Iterator[Target]:
    """Files as recorders left them, with conditions and channels that a user has named."""
    stop = read_case(resources.cases() / "01_dry_80_1.5", system).part(slice(None, None, 40))
    changes = {".csv": change_one, ".txt": change_one, ".gz": _packed, ".xlsx": _workbook}
    for name, write in FORMATS.items():
        write(folder / name, recorded(stop, system))
        named = _CHANNELS_OF_MATLAB if name.endswith(".mat") else _CHANNELS
        options = RecordingOptions(
            conditions={"wheel_rail": "dry", "discs": ["dry"] * 3},
            columns={signal: NamedChannel(channel) for signal, channel in named.items()},
            step=0.2 if name == "indices.csv" else None,
        )
        yield Target(
            name,
            {name: (folder / name).read_bytes()},
            partial(_read_recorded, name, system, options),
            _impossible_case,
            changes.get(Path(name).suffix, _recording),
        )


_CHANNELS = {
    **{"pB": "Bremsdruck", "tauR": "Antriebsmoment", "omegaW": "v_Rad", "omegaR": "v_Rolle"},
    "Fx": "Längskraft",
}
_CHANNELS_OF_MATLAB = {**_CHANNELS, "Fx": "Laengskraft", "time": "Zeit"}


def _read_recorded(name: str, system: System, options: RecordingOptions, folder: Path) -> Case:
    return read_file(folder / name, system, options)


def _recording(files: Files, random: Random) -> tuple[Files, str]:
    """A mutant of a recorder's file of bytes."""
    ((name, content),) = files.items()
    changed, mutation = mutate(content, random, BYTES)
    return {name: changed[:SMALL]}, mutation


def _packed(files: Files, random: Random) -> tuple[Files, str]:
    """A mutant of a packed file, or of what is in it."""
    if random.random() < 0.3:
        return _recording(files, random)
    ((name, content),) = files.items()
    changed, mutation = mutate(gzip.decompress(content), random)
    return {name: gzip.compress(changed[:SMALL], mtime=0)}, f"in it: {mutation}"


def _workbook(files: Files, random: Random) -> tuple[Files, str]:
    """A mutant of a workbook, which is an archive of texts."""
    ((name, content),) = files.items()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    texts = [entry for entry in entries if entry.startswith("xl/")]
    changed, mutation = _archive(entries, random.choice(texts), random)
    return {name: changed}, mutation


# --- what the workbench writes and reads again ---


def _gains(system: System) -> Target:
    name = "disturbance_observer"
    with open_model(system) as model:
        reasoned = {name: tunable(system, name).default_gains(model, system)}
    source = (
        Path(__file__).parents[2] / "workbench" / "machines" / "wheelset" / "gains" / f"{name}.toml"
    )

    def impossible(gains: Gains) -> str:
        finite = np.isfinite(gains.values).all() and gains.names == reasoned[name].names
        return "" if finite else "gains that are not finite, or others"

    return Target(
        "gains",
        {"gains.toml": source.read_bytes()},
        lambda folder: read_gains(folder / "gains.toml", reasoned),
        impossible,
    )


def _checkpoint(path: Path) -> Target:
    draw = np.random.default_rng(1)
    population = Population(draw.random((6, 3)), np.sort(draw.random(6)), draw.random((6, 2)))
    history = tuple(
        Generation(0.1, "one", "other", 0.2, 6, 100, 200, {"one": 1}, 0, 1.5) for _ in range(3)
    )
    save(Checkpoint(IDENTITY, population, False, history), path)

    def impossible(checkpoint: Checkpoint | None) -> str:
        same = checkpoint is not None and all(
            np.array_equal(values, getattr(population, name))
            for name, values in vars(checkpoint.population).items()
        )
        return "" if same else "other candidates than were saved"

    return Target(
        "checkpoint",
        {"checkpoint.json": path.read_bytes()},
        lambda folder: load(folder / "checkpoint.json", IDENTITY),
        impossible,
    )


def _journal(path: Path) -> Target:
    identity = {"seed": 1, "code": "of one run"}
    journal = Journal(path, identity, resume=False)
    for seed in range(4):
        planting = Planting("single", seed, 2.0, {"fade": 0.1}, ("BrakeFade",))
        journal.append(SetVerdict(planting, "nothing", (), None, None, 1.5))
    written = journal.results

    def impossible(journal: Journal) -> str:
        # Lines that are damaged are left out, but nothing else is read, and nothing twice.
        plantings = [result.planting for result in journal.results]
        once = all(plantings.count(planting) == 1 for planting in plantings)
        known = all(result in written for result in journal.results)
        return "" if once and known else "other verdicts than were written"

    return Target(
        "verdicts",
        {"sets.jsonl": path.read_bytes()},
        lambda folder: Journal(folder / "sets.jsonl", identity, resume=True),
        impossible,
    )


def _state(path: Path) -> Target:
    estimate = RecordingEstimate(np.array([1.5, 2.5]), np.diag([0.1, 0.2]), np.array([3.0]), 20.0)
    written = [
        RecordingResult(name, f"hash of {name}", "2024-03-01T10:00:00", estimate, "")
        for name in ("01", "02", "03")
    ]
    with open_state(path, {"model": "one"}, (2, 1)) as state:
        for result in written:
            state.add(result)

    def read(folder: Path) -> list[RecordingResult]:
        with open_state(folder / "state.sqlite", {"model": "one"}, (2, 1)) as state:
            return state.all()

    def impossible(results: list[RecordingResult]) -> str:
        same = all(
            np.array_equal(result.estimate.covariance, estimate.covariance)
            for result in results
            if result.estimate is not None
        )
        known = all(result.estimate is not None or result.refusal for result in results)
        return "" if same and known else "another estimate than was kept, or none without a reason"

    return Target("monitor state", {"state.sqlite": path.read_bytes()}, read, impossible)


def _summary() -> Target:
    recording = RecordingSystem(
        np.array([0.5, -0.25, 0.125]),
        np.array([[1.0, 0.5], [0.5, 2.0], [0.25, 0.0]]),
        np.array([[1.0], [0.0], [0.5]]),
        np.array([0.5]),
        np.array([3.0]),
        1,
    )
    prior = Quadratic(np.diag([1.0, 2.0]), np.array([0.5, 0.25]), 1.5, 0)
    sizes, levels = {("Fade", "size"): 0.5}, {("muWR", "dry"): 0.25}
    rival = Rival(("Fade",), sizes, levels, (recording,), prior, 100.0)
    rivals = Rivals((rival,), ("Fade", "Lag"), {"mu": 0.5}, ("omegaW",), np.array([1.5]))
    content = {"verdict": "found", "provenance": {"system": "wheelset"}, "rivals": rivals.to_dict()}

    def impossible(summary: tuple[str, Rivals]) -> str:
        whole = [
            array
            for model in summary[1].models
            for part in (model.prior, *model.recordings)
            for array in vars(part).values()
            if isinstance(array, np.ndarray)
        ]
        return "" if all(not np.isnan(array).any() for array in whole) else "no numbers"

    return Target(
        "summary.json",
        {"summary.json": json.dumps(content, indent=1).encode()},
        lambda folder: _read_rivals(folder / "summary.json"),
        impossible,
    )


# --- machines and models ---


def _system(name: str, content: bytes) -> Target:
    return Target(
        name, {"system.toml": content}, lambda folder: read_system(folder / "system.toml")
    )


def _with_fmus(system: System) -> bytes:
    """The file of a system for any folder: its FMUs where they are."""
    return system.source.read_text().replace("../../fmus", resources.fmus().as_posix()).encode()


def _read_modelica(folder: Path) -> None:
    check(read_library(folder / "Lib.mo"))


def _fmu(name: str, path: Path) -> Target:
    """An archive; binaries may be damaged, but only sound ones are loaded."""
    with zipfile.ZipFile(path) as archive:
        entries = {n: archive.read(n) for n in archive.namelist() if re.match(_ENTRIES, n)}
    change = partial(_changed_fmu, entries=entries)
    return Target(name, {"model.fmu": zipped(entries)}, _read_fmu, change=change)


def _changed_fmu(_: Files, random: Random, *, entries: Files) -> tuple[Files, str]:
    content, mutation = _archive(entries, DESCRIPTION, random)
    return {"model.fmu": content}, mutation


def _archive(entries: Files, text: str, random: Random) -> tuple[bytes, str]:
    """A mutant of a text in it, of what entries are named and hold, or of the archive itself."""
    changed, change = dict(entries), random.choice(("text", "names", "bytes"))
    if change == "text":
        changed[text], mutation = mutate(entries[text], random)
        return zipped(changed), f"{text}: {mutation}"
    if change == "names":
        old, new = random.choice(list(entries)), random.choice(_NAMES)
        content = changed.pop(old) if random.random() < 0.5 else b"x" * random.choice((0, 9, 10**6))
        changed[new or old.upper()] = content
        return zipped(changed), f"{change}: {old} is {new}"
    packed, mutation = mutate(zipped(entries), random, BYTES)
    return packed, f"{change}: {mutation}"


def _read_fmu(folder: Path) -> Description:
    """Describe an FMU and load it; what CRC errors let pass is what the project built."""
    path = folder / "model.fmu"
    description = read_description(path)
    with FMU(path):
        return description
