"""Whether an FMU can be let into a process at all: its calls are tried in one of their own.

An FMU is foreign code, which may end, stop or fill the process that calls it. One that was compiled
here is taken as it is; any other is tried before it is loaded, and remembered by its hash.
"""

import ctypes
import json
import os
import re
import secrets
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryFile
from typing import Any

from workbench.errors import FMUError, InputError, one_line
from workbench.models import fmu_cache, trial_calls
from workbench.models.archive import unpack
from workbench.models.description import CO_SIMULATION, MODEL_EXCHANGE, Description
from workbench.runtime.files import temporary_folder
from workbench.runtime.resources import fmus
from workbench.runtime.supervision import Limits, limit_memory, usual_limits


class ContainedError(FMUError):
    """An FMU ended the process it was tried in; the message says how, when and in which call."""


class NoAnswerError(FMUError):
    """An FMU did not answer in time, while it used little of the processor: nothing is known."""


try:
    from fmpy.logging import logging as _proxy

    # Formats what FMUs of FMI 2.0 log, as `printf` does. None on machines that FMPy has none for.
    PROXY: ctypes.CDLL | None = _proxy
except (ImportError, OSError):
    PROXY = None

_MOST_REPORTED = 16 << 20  # [byte]; the records of a trial take some 0.1 MB
_SPAN = 1000.0  # [s] of a walk through an FMU that names no end, beyond what delays mostly are
_GRACE = 5.0  # [s] beyond the limit, for the process that watches it to say so


def require_trial(description: Description, interface: str, folder: Path) -> None:
    """Try an FMU in a process of its own, unless it is known to be sound.

    Parameters
    ----------
    description : of the FMU.
    interface : MODEL_EXCHANGE or CO_SIMULATION.
    folder : that it is unpacked in.

    Raises
    ------
    InputError
        If its library cannot be loaded.
    ContainedError
        If it ends the process, or does not return from a call.
    NoAnswerError
        If it does not answer.
    FMUError
        If it answers a call with an error.
    """
    if built_here(description):
        return
    borne, limits = _marks(description, interface)[0], usual_limits()
    if not fmu_cache.is_known(borne) and (
        refused := run_trial(description, interface, folder, limits)
    ):
        raise FMUError(refused)
    limit_memory(limits.memory)


def unloadable(path: Path, error: str) -> InputError:
    """The refusal of a library for what the system says of it."""
    if missing := re.search(r"(\S+): cannot open shared object file", error):
        return InputError(
            where=str(path),
            found=f"a binary that needs {missing[1]}, which this machine does not have",
            expected="the libraries that the exporting tool linked it with",
            remedy="install that library, or export the model again for this machine",
        )
    return InputError(
        where=str(path),
        found=f"a binary that cannot be loaded ({error[:400]})",
        expected="one that this machine can load, with the functions of FMI",
        remedy="export the model again for this machine; see 'workbench fmu info'",
    )


def built_here(description: Description) -> bool:
    """Whether an FMU came with the workbench, or was compiled by it."""
    return description.sha256 in _packaged() or fmu_cache.is_known(description.sha256)


@contextmanager
def unpacked(description: Description, interface: str) -> Iterator[Path]:
    """Folder with what of an FMU runs here, for as long as the context lasts."""
    with temporary_folder() as scratch:
        folder = Path(scratch)
        unpack(description.path, folder, str(PurePosixPath(description.library(interface)).parent))
        yield folder


def derivatives_hold(description: Description) -> bool:
    """Whether an FMU that was tried has the directional derivatives that differences show."""
    return not fmu_cache.is_known(_marks(description, MODEL_EXCHANGE)[1])


def contradict_derivatives(description: Description) -> None:
    """Remember that an FMU has other directional derivatives than differences show."""
    fmu_cache.remember(_marks(description, MODEL_EXCHANGE)[1])


def remembers_steps(description: Description) -> bool:
    """Whether rates and outputs of an FMU that was tried follow from earlier steps, too."""
    return fmu_cache.is_known(_marks(description, MODEL_EXCHANGE)[2])


def _marks(description: Description, interface: str) -> tuple[str, str, str]:
    """Names under which an FMU is remembered.

    That bore its calls; whose directional derivatives are wrong; that remembers steps.
    """
    # Co-Simulation brings a solver, which Model Exchange does not run.
    suffix = "cs" if interface == CO_SIMULATION else "model-exchange"
    mark = description.sha256
    return f"{mark}-{suffix}", f"{mark}-differences", f"{mark}-memory"


@cache
def _packaged() -> frozenset[str]:
    """Hashes of the FMUs that come with the workbench."""
    manifest = json.loads((fmus() / "manifest.json").read_text(encoding="utf-8"))
    return frozenset(entry["sha256"] for entry in manifest["fmus"].values())


def run_trial(description: Description, interface: str, folder: Path, limits: Limits) -> str:
    """Try an FMU in a process of its own, and remember it if it bears that; see `require_trial`.

    Returns
    -------
    Which call the FMU refused that every observer makes, with what it logged; empty for none.
    """
    secret = secrets.token_hex(16)
    task = json.dumps({"secret": secret, **_task(description, interface, folder, limits)}).encode()
    with (
        TemporaryFile() as report,
        subprocess.Popen(
            [sys.executable, "-I", "-S", trial_calls.__file__],
            stdin=subprocess.PIPE,
            stdout=report,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            start_new_session=True,
        ) as process,
    ):
        with suppress(subprocess.TimeoutExpired):
            process.communicate(task, limits.answer + _GRACE)
        late = process.poll() is None
        process.kill()
        process.wait()
        report.seek(0)
        line, written = re.compile(secret.encode() + rb"(.*)\n"), report.read(_MOST_REPORTED)
        records: list[dict[str, Any]] = [json.loads(text) for text in line.findall(written)]
        foreign = line.sub(b"", written)
    end: dict[str, Any] = {"status": process.returncode, "used": 0.0, "late": late}
    if records and "status" in records[-1]:
        end = records.pop()
    last = records[-1] if records else {"call": "the start of its process"}
    where = description.path.name
    tried = (
        f"It was tried in a process of its own, with limits of {limits} "
        "(WORKBENCH_TRIAL changes them)"
    )
    if end["late"]:
        raise NoAnswerError(
            f"{where}: did not answer from {last['call']} within {limits.answer:g} s, of which it "
            f"used the processor for {end['used']:.1f} s, so that nothing is known of it; allow "
            f'more with WORKBENCH_TRIAL="answer={10 * limits.answer:g}"'
        )
    if last["call"] == "not loaded":
        error = last["error"].replace(f"{folder.resolve()}{os.sep}", "")
        raise unloadable(description.path, error)
    if end.get("traced"):
        raise ContainedError(
            f"{where}: had its process traced as a debugger does, which stops at each signal. "
            f"{tried}"
        )
    if last["call"] != "end" or end["status"]:
        call, used = last["call"], end["used"]
        at = f" in {call} after {used:.2f} s of processor time"
        raise ContainedError(
            f"{where}: {describe_end(end['status'], call, f'{used:.1f}', at)}. {tried}"
        )
    if foreign:
        raise ContainedError(
            f"{where}: wrote to a file that another had opened, which destroys results. {tried}"
        )
    if not last["rounds"]:
        raise ContainedError(
            f"{where}: changed how the processor rounds, for all that its process calculates. "
            f"{tried}"
        )
    borne, contradicted, remembers = _marks(description, interface)
    if last["contradicted"]:
        fmu_cache.remember(contradicted)
    if last["remembers"]:
        fmu_cache.remember(remembers)
    if not last["partly"]:
        fmu_cache.remember(borne)
    return f"{where}: {one_line(last['refused'])}. {tried}" if last["refused"] else ""


def describe_end(status: int, call: str, seconds: str, at: str = "") -> str:
    """Say how a process ended that called an FMU.

    Parameters
    ----------
    call : that it was in, as far as that is known.
    seconds : time of the processor that the call had.
    at : where the process ended, if that is known.
    """
    if os.name == "posix" and status == -signal.SIGXCPU:
        return f"did not return from {call} within {seconds} s of processor time"
    if status < 0:
        return f"crashed with {signal.Signals(-status).name}{at}"
    return f"ended the process with exit status {status}{at}"


def _task(description: Description, interface: str, folder: Path, limits: Limits) -> dict[str, Any]:
    """What `trial_calls` is asked to do."""
    offered = description.interfaces[interface]
    real = [v for v in description.variables if v.real]
    references = {v.name: v.reference for v in real}
    # Others may be set, and differentiated, in Event Mode alone.
    continuous = {v.name for v in real if v.variability == "continuous"}
    nominal = {v.name: v.nominal for v in description.variables}

    def known(names: tuple[str, ...]) -> list[int]:
        return [references[name] for name in names if name in continuous]

    exchange = interface == MODEL_EXCHANGE
    inputs, outputs = known(description.names("input")), known(description.names("output"))
    states, rates = known(description.states), known(description.rates)
    begin = [
        (v.reference, float(v.start))
        for v in real
        if v.start is not None and (v.causality == "input" or v.reference in states)
    ]
    resources = folder / "resources"
    wanted = [(rows, columns) for rows in (rates, outputs) for columns in (states, inputs)]
    return {
        "library": str((folder / description.library(interface)).resolve()),
        "resources": resources.as_uri() if description.version == "2.0" else f"{resources}{os.sep}",
        "version": description.version,
        "identifier": offered.identifier,
        "token": description.token,
        "exchange": exchange,
        "states": len(description.states),
        "nominal": [abs(nominal.get(name) or 1.0) for name in description.states],
        "reals": list(references.values()),
        "inputs": inputs,
        "outputs": outputs,
        "start": begin,
        "time": description.start or 0.0,
        "span": max((description.stop or 0.0) - (description.start or 0.0), 0.0) or _SPAN,
        "step": description.step or 1e-3,
        "any_step": offered.variable_steps or bool(description.step),
        "directional": [pair for pair in wanted if all(pair)]
        if exchange and offered.directional_derivatives
        else [],
        "saves": offered.saves_state,
        "indicators": description.event_indicators,
        "completed": offered.completed_steps,
        "proxy": None if PROXY is None else PROXY._name,
        "processor": limits.processor,
        "answer": limits.answer,
        "memory": limits.memory,
        "file": limits.file,
    }
