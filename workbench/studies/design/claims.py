"""Which samples of a recording that a model predicts would count, and why others would not."""

from workbench.diagnosis.data.counting import CountedSamples, count
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.system.system import System


def counts(case: Case, system: System) -> bool:
    """Whether a recording has enough that counts."""
    return _counted(case, system, restarting=True) is not None


def left_claims(case: Case, system: System) -> set[str] | None:
    """Reasons why samples do not count, but for its end; None where too few do."""
    counted = _counted(case, system, restarting=False)
    if counted is None:
        return None
    reasons = [
        exclusion.reason for exclusion in system.comparison.exclusions if not exclusion.to_the_end
    ]
    return {reason for reason in reasons if counted.excluded[reason].any()}


def _counted(case: Case, system: System, *, restarting: bool) -> CountedSamples | None:
    try:
        return count(case, system, tuple(case.signals), SOUND, restarting=restarting)
    except InputError:
        return None
