"""Is an FMU fit for observers? What its description promises is tried before it is trusted.

An observer sets states, rolls back, linearises and starts an FMU thousands of times, which ordinary
simulation never does, so faults there stay hidden. Each check runs in a process of its own: a
crash of the FMU is a finding, not the end. A check that rests on what another found missing is not
tried, so that a fault is named once, where it is.
"""

from workbench.models.checks.checks import check
from workbench.models.checks.result import (
    CheckResult,
    is_fit,
    remember_findings,
    remembered_findings,
    uses,
)

__all__ = ["CheckResult", "check", "is_fit", "remember_findings", "remembered_findings", "uses"]
