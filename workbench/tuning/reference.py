"""What recordings are judged by where no sensor measures it: an estimate that knows all of them."""

from collections.abc import Sequence

from workbench.errors import InputError, closest
from workbench.observers import estimators_of
from workbench.observers.replay import observed
from workbench.observers.run import Ending
from workbench.recordings.case import Case
from workbench.system.system import System


def with_reference(cases: Sequence[Case], system: System, estimator: str) -> list[Case]:
    """Recordings with the estimate of what is judged in the place of its measurement.

    Machines in service lack sensors that a rig has. Measured outputs of the model stay.

    Parameters
    ----------
    estimator : name of one that knows whole recordings; any other would be judged by its like.

    Raises
    ------
    InputError
        If there is no such estimator, or it fails.
    """
    known = {name: kind for name, kind in estimators_of(system).items() if kind.offline}
    if estimator not in known:
        raise InputError(
            where=f"estimator '{estimator}' to judge by",
            found=f"none of this name that knows whole recordings{closest(estimator, known)}",
            expected=f"one of {', '.join(known)}",
            remedy="correct the name",
        )
    found = []
    for case in cases:
        run = observed(case, system, known[estimator])
        if run.ending is not Ending.OK:
            raise InputError(
                where=str(case.source),
                found=f"{estimator}: {run.ending.value} {run.message}".strip(),
                expected="an estimate to judge by",
                remedy="leave this case out of the tuning with --cases",
            )
        judged = [name for name in system.objective.weights if name not in case.outputs]
        found.append(case.with_signals({name: run.signal(name) for name in judged}))
    return found
