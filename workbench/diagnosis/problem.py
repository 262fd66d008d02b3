"""What is asked of a diagnosis: a system, recordings of it, and effects that may be missing."""

from collections.abc import Sequence
from dataclasses import dataclass

from workbench.diagnosis.effects.catalogue import Effect
from workbench.models.modelica import Library
from workbench.recordings.case import Case
from workbench.system.system import OBSERVER, System


@dataclass(frozen=True, eq=False)
class Problem:
    """What is asked of a diagnosis.

    Attributes
    ----------
    system : whose observer model is diagnosed, or an extension of it: its values are kept.
    cases : what is only there to judge by is compared if all of them have it. Of a single one,
        parts are held out, since a cause is judged on what it was not fitted to.
    library : of the system, which holds the effects.
    effects : that are considered.
    held_out : recordings on which only the errors of both models are measured: all that is common
        is as fitted to the others, only what differs between recordings is fitted.
    """

    system: System
    cases: Sequence[Case]
    library: Library
    effects: Sequence[Effect]
    held_out: Sequence[Case] = ()

    @property
    def base(self) -> str:
        """Name of the model that is diagnosed."""
        return self.system.models[OBSERVER].name
