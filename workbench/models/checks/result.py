"""What is asked of an FMU, how the answer looks, and what is kept of it."""

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import InputError
from workbench.models.fmu_cache import cache_folder
from workbench.runtime.files import write_json


@dataclass(frozen=True)
class CheckResult:
    """What one check found.

    Attributes
    ----------
    passed : None if the check was not made, for the reason given.
    value, limit : measured, and the largest (of instances: the smallest) that passes, in `unit`.
    reason : of a failure or of what was not checked, for whom has to act on it.
    unknown : whether the check was begun and the FMU did not answer.
    """

    name: str
    passed: bool | None = None
    value: float | None = None
    limit: float | None = None
    unit: str = "1"
    reason: str = ""
    unknown: bool = False


def is_fit(findings: Iterable[CheckResult]) -> bool:
    """Say whether no check failed; see `CheckResult.unknown`, too."""
    return all(finding.passed is not False for finding in findings)


# One sample of a recording at 200 Hz: what takes longer cannot keep up with the rig.
SAMPLE = 5000.0

# The questions: findings without an answer. Bits are either the same or not, hence limits of 0.
START = CheckResult("start", limit=1, unit="instances")
# The step of an observer takes the model for smooth: it would pass over a jump.
EVENTS = CheckResult("smoothness", limit=0, unit="event indicators")
RESET = CheckResult("reset and replay", limit=0.0)
INJECTION = CheckResult("state injection", limit=0.0)
ROLLBACK = CheckResult("rollback", limit=0.0)
SERIALISATION = CheckResult("serialised rollback", limit=0.0)
ROLLBACK_CS = CheckResult("rollback in Co-Simulation", limit=0.0)
# Of an entry. Differences at the best of several steps agree to 1e-7; a wrong term is far above.
DERIVATIVES = CheckResult("directional derivatives", limit=1e-4)
# Of the range of a state: above any sensible tolerance, below what a sensor of speed resolves.
INTERFACES = CheckResult("Co-Simulation against Model Exchange", limit=1e-3)
INSTANCES = CheckResult("instantiations", unit="instances")
LOADS = CheckResult("loads of the library", unit="instances")
# Tuning starts a model 1e5 times: 1 MB in 1000 would fill 100 MB of each worker.
MEMORY = CheckResult("memory growth", limit=1.0, unit="MB per 1000")
TIME_GET = CheckResult("time of states and outputs", limit=SAMPLE, unit="us")
TIME_SET = CheckResult("time of inputs", limit=SAMPLE, unit="us")
TIME_DERIVATIVES = CheckResult("time of states and derivatives", limit=SAMPLE, unit="us")
TIME_STEP = CheckResult("time of states and step", limit=SAMPLE, unit="us")

# Every estimator sets states and steps by the Jacobian; none rolls back, so far. What makes many
# instances are tuning, fit and diagnosis, the last two of which simulate through events; what rolls
# back are other tools.
_OBSERVING = (START, EVENTS, RESET, INJECTION, DERIVATIVES)
_USES = {
    "open loop": (START, RESET),
    "observers on recordings": _OBSERVING,
    "tuning": (*_OBSERVING, INSTANCES, LOADS, MEMORY),
    "fit and diagnosis": (START, RESET, INJECTION, DERIVATIVES, INSTANCES, LOADS, MEMORY),
    "observers beside a running rig": (
        *_OBSERVING,
        TIME_GET,
        TIME_SET,
        TIME_DERIVATIVES,
        TIME_STEP,
    ),
    "tools that roll back": (START, ROLLBACK, SERIALISATION, ROLLBACK_CS),
    "tools that use its own solver": (START, INTERFACES),
}


def uses(findings: Iterable[CheckResult]) -> dict[str, list[str]]:
    """Uses of an FMU, each with the names of what failed that it rests on; none: it would do.

    Exported observers are made of Modelica classes, not of FMUs.
    """
    failed = {finding.name for finding in findings if finding.passed is False}
    return {
        use: [question.name for question in questions if question.name in failed]
        for use, questions in _USES.items()
    }


def _kept(sha256: str) -> Path:
    return cache_folder() / "findings" / f"{sha256}.json"


def remember_findings(sha256: str, failed: Iterable[CheckResult]) -> None:
    """Keep what failed in the check of an FMU, by the hash of its file."""
    reasons = {finding.name: finding.reason for finding in failed}
    with suppress(OSError, InputError):
        if reasons:
            _kept(sha256).parent.mkdir(parents=True, exist_ok=True)
            write_json(_kept(sha256), reasons)
        else:
            _kept(sha256).unlink(missing_ok=True)


def remembered_findings(sha256: str) -> Mapping[str, str]:
    """What failed in the last check of an FMU that observers rest on, with reasons."""
    try:
        reasons: dict[str, str] = json.loads(_kept(sha256).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    needed = {question.name for question in _OBSERVING}
    return {name: reason for name, reason in reasons.items() if name in needed}
