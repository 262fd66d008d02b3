"""What is asked of a diagnosis: a system, recordings of it, and effects that may be missing.

A system with a Modelica library has the effects of the library. One whose model is an FMU alone has
its parameters and the errors of its sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from workbench.diagnosis.data.clocks import clocks, delays
from workbench.diagnosis.effects.candidates import candidates, considered
from workbench.diagnosis.effects.catalogue import Effect, choose, read_effects
from workbench.errors import InputError
from workbench.models.modelica import Library, read_library
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System


def library_of(system: System) -> Library | None:
    """Read the library of a system; None if its model is an FMU alone."""
    return read_library(system.library) if system.library.is_file() else None


def catalogue(system: System, library: Library | None) -> tuple[Effect, ...]:
    """All that a diagnosis may find, and clocks of the system's loggers last.

    These are the effects of the library, or what may be wrong in an FMU alone.

    Raises
    ------
    InputError
        See `read_effects`.
    """
    if library is not None:
        return (*read_effects(library, system.models[OBSERVER].name), *clocks(system))
    with open_model(system) as model:
        alone = (*candidates(model, system), *delays(system))
    return (*considered(system, alone), *clocks(system))


@dataclass(frozen=True, eq=False)
class Problem:
    """What is asked of a diagnosis."""

    system: System  # whose observer model is diagnosed, or an extension of it: its values are kept
    # what is only there to judge by is compared if all of them have it. Of a single one, parts are
    # held out, since a cause is judged on what it was not fitted to.
    cases: Sequence[Case]
    # of the system, which holds the effects; None if its model is an FMU alone
    library: Library | None
    effects: Sequence[Effect]  # that are considered
    # recordings on which only the errors of both models are measured: all that is common is as
    # fitted to the others, only what differs between recordings is fitted
    held_out: Sequence[Case] = ()

    @property
    def modelica(self) -> Library:
        """The library, which a law or an extended Modelica model needs.

        Raises
        ------
        InputError
            If the model is an FMU alone.
        """
        if self.library is None:
            raise InputError(
                where=str(self.system.source),
                found=f"no Modelica library {self.system.library.name} beside it",
                expected="the library of the model, in whose equations a law is sought",
                remedy="put package.mo beside the system file; a diagnosis itself needs none",
            )
        return self.library

    @property
    def base(self) -> str:
        """Name of the model that is diagnosed."""
        return self.system.models[OBSERVER].name


def problem_of(
    system: System,
    cases: Sequence[Case] = (),
    effects: Sequence[str] = (),
    held_out: Sequence[Case] = (),
) -> Problem:
    """What is asked of recordings of a system: all that may be missing, or effects by name.

    Raises
    ------
    InputError
        See `catalogue` and `choose`.
    """
    library = library_of(system)
    return Problem(system, cases, library, choose(effects, catalogue(system, library)), held_out)
