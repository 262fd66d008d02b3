"""What is asked of a diagnosis: a system, recordings of it, and effects that may be missing.

A system with a Modelica library has the effects of the library. One whose model is an FMU alone has
its parameters and the errors of its sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from workbench.diagnosis.data.clocks import clocks, delays
from workbench.diagnosis.data.gaps import begins, described, gaps, parted
from workbench.diagnosis.effects.candidates import candidates, considered, with_starts
from workbench.diagnosis.effects.catalogue import Effect, choose, read_effects
from workbench.errors import InputError
from workbench.models.fmu import FMU, CoSimulation
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
    doubt: str = ""  # of gaps after which recordings go on with an error

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

    def in_parts(self) -> "Problem":
        """The same with recordings that begin anew after each gap that matters, or a doubt of it.

        See `gaps`.
        """
        every = [*self.cases, *self.held_out]
        moved = {case.name: found for case in every if (found := gaps(case, self.system))}
        if not moved:
            return self
        with open_model(self.system) as model:
            unknown, start_time = self._unknown_after_gaps(model), model.start_time
        names, parts, doubts = {case.name for case in every}, dict[str, list[Case]](), []
        for case in every:
            own = moved.get(case.name, {})
            anew = [] if unknown else begins(case, self.system, own)
            parts[case.name] = list(parted(case, anew, names, start_time))
            doubts += [described(case, end, own[end]) for end in own if end not in anew]
        remedy = unknown or "Leave out what follows, or record it anew"
        return replace(
            self,
            cases=[part for case in self.cases for part in parts[case.name]],
            held_out=[part for case in self.held_out for part in parts[case.name]],
            doubt=f"{'; '.join(doubts)}: what follows begins with an error. {remedy}"
            if doubts
            else "",
        )

    def _unknown_after_gaps(self, model: FMU) -> str:
        """Say what to do if a recording cannot begin anew after a gap; empty if it can.

        Where a state begins must be measured or fitted, and nothing else may last through a gap.
        """
        system, compare = self.system, self.system.comparison
        known = system if self.library is not None else with_starts(system, model)
        seen = {*system.signals, *(name for name, spread in known.spreads.items() if spread)}
        hidden = [name for name in model.states if name not in seen]
        events = isinstance(model, CoSimulation) or model.description.event_indicators
        if events or compare.begins is not None or compare.rests:
            return "Leave out what follows, or record it anew"
        if hidden:
            names = " and ".join(hidden)
            return f"State how far {names} may be off after it, [states.NAME] spread"
        return ""

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
    chosen = choose(effects, catalogue(system, library))
    return Problem(system, cases, library, chosen, held_out).in_parts()
