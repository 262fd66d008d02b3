"""Where a law acts and what it depends on: all of them about what is known, by evidence."""

import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis import given_values
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import ExtendedModel, build, variables
from workbench.diagnosis.effects.slots import read_slots
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.laws.periods import Period, strongest_period
from workbench.diagnosis.laws.places import (
    Law,
    LawInfluence,
    Place,
    laws,
    places,
    turning,
    turning_laws,
)
from workbench.diagnosis.laws.splines import APART, COEFFICIENTS, Knots, Smoothness, smoothest
from workbench.diagnosis.laws.writing import PACKAGE, LawClass, extended_library, unit_of
from workbench.diagnosis.problem import Problem
from workbench.diagnosis.simulation.prediction import Variation
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.models.modelica import Library
from workbench.runtime.engine import Engine

_AT_ONCE = 100  # columns of derivatives: some ten megabytes
_SPAN = 0.25  # of what lasts, over which a rate is taken: it settles within that
_SEEN = 0.01  # share of the samples that are beyond the ends of a function
_BEGINS = 10.0  # of what lasts, that a beginning takes at most
_SIZE = "d"  # of a probe


@dataclass(frozen=True, eq=False)
class LawScore:
    """A law, as a free function about what is known."""

    law: Law
    knots: Knots | None  # where its function lives; None for a constant, and for what turns
    smoothness: Smoothness
    largest: float  # of the output of its place, without it

    @property
    def most(self) -> float:
        """What a law may change beforehand, see `_most`."""
        return _most(self.law, self.largest)


def _most(law: Law, largest: float) -> float:
    """What a law may change beforehand: an output by its own size, one that is zero by anything."""
    relative = law.carrier.expression != "1.0"
    return 1.0 if relative else largest or np.inf


def effect_at(name: str, library: Library, place: Place, size: str) -> Effect:
    """A generated class as an effect."""
    return Effect(
        name=name,
        model=f"{library.name}.{PACKAGE}.{name}",
        slots=(place.slot.name,),
        size=size,
        matters=1.0,
        text="",
        separation="",
    )


def _probe(place: Place) -> LawClass:
    size = place.own(_SIZE)
    declared = f"parameter Real {size}({unit_of(place.output.unit)}) = 0.0;"
    return LawClass(place.name, "Probe", place, (declared,), (), size)


class Scan:
    """All laws about what is known: the nominal model, or that with what was found.

    A law that is small acts as a parameter that is added to the output of its slot, and that
    changes in time as the law says along the motion without it; so one FMU serves all of them.

    Parameters
    ----------
    about : what is known, fitted.
    slots : where laws are sought, which do not begin anew; None: all laws, in all of them.
    """

    def __init__(
        self,
        problem: Problem,
        about: FittedModel,
        engine: Engine,
        slots: Collection[str] | None = None,
    ) -> None:
        system, library, base = problem.system, problem.modelica, problem.base
        self._lasting = system.comparison.lasting
        asked = [s for s in read_slots(library, base) if slots is None or s.name in slots]
        where = tuple(places(library, base, asked))
        if not where:
            self.prospects: list[LawScore] = []  # of all laws, the likeliest first
            return
        names = list(
            dict.fromkeys(
                f"{place.slot.name}.{name}"
                for place in where
                for name in (place.output.name, *(variable.name for variable in place.inputs))
            )
        )
        with tempfile.TemporaryDirectory() as scratch:
            extended = extended_library(library, map(_probe, where), Path(scratch))
            probes = [effect_at(place.name, library, place, place.own(_SIZE)) for place in where]
            effects = [*about.active, *probes]
            path = Path(scratch) / "Probes.fmu"
            text = ExtendedModel(extended, base, "Probes", effects, "With probes").source()
            engine.report(f"compiling probes in {len(where)} places")
            build(extended, "Probes", watching(text, names), path, every_platform=False)
            source = ModelSource(path, system, given_values(path, system))
            with ResidualModel(source, problem.cases, engine) as simulations:
                self._fit = Fit(simulations, effects)
                self._base = anew(self._fit, about.point, about.active)
                values = self._fit.unknowns.values(self._base.point)
                tables = simulations.along(values, [f"watched{k}" for k in range(len(names))])
                self._recordings = [
                    (recording.time, dict(zip(names, table.T, strict=True)))
                    for recording, table in zip(simulations.recordings, tables, strict=True)
                ]
                span = _SPAN * system.comparison.lasting
                every = [law for place in where for law in laws(place, self._recordings, span)]
                engine.report(f"{len(every)} laws in {len(where)} places")
                scores = self._judged(simulations, values, every)
                if slots is None:
                    scores += self._turning(simulations, values, where)
        self.prospects = sorted(scores, key=lambda prospect: -prospect.smoothness.evidence)

    def _judged(
        self,
        simulations: ResidualModel,
        values: Sequence[Mapping[str, float]],
        every: Sequence[Law],
    ) -> list[LawScore]:
        lin = self._base.linearised
        scores: list[LawScore] = []
        batch = max(1, _AT_ONCE // COEFFICIENTS)
        for first in range(0, len(every), batch):
            part = every[first : first + batch]
            bases = [self._basis(law) for law in part]
            columns = [
                Variation(
                    variables(self._fit.unknowns.effects[law.place.name], law.place.own(_SIZE))
                )
                for law, (_, basis) in zip(part, bases, strict=True)
                for _ in range(basis[0].shape[1])
            ]
            courses = [
                np.hstack([basis[k] for _, basis in bases]) for k in range(len(self._recordings))
            ]
            derivatives = simulations.responses(values, columns, courses)
            at = 0
            for law, (knots, basis) in zip(part, bases, strict=True):
                count = basis[0].shape[1]
                keys = [(law.place.name, f"c{k}") for k in range(count)]
                more = [derivative[:, at : at + count] for derivative in derivatives]
                joint = self._fit.quadratics(lin.extended(keys, more), keys)
                largest = self._largest(law.place)
                smoothness = smoothest(*joint.reduced(keys), most=_most(law, largest))
                scores.append(LawScore(law, knots, smoothness, largest))
                at += count
        return scores

    def _turning(
        self,
        simulations: ResidualModel,
        values: Sequence[Mapping[str, float]],
        where: Sequence[Place],
    ) -> list[LawScore]:
        """Laws that begin anew with the period that errors have most of, each phase its own.

        Of all periods that are told apart each is as likely beforehand.
        """
        periods: dict[tuple[str, LawInfluence], Period | None] = {}
        every: list[tuple[Law, Period]] = []
        for place in where:
            for influence in turning(place):
                # Time is the same everywhere.
                at = (place.slot.name if influence.factors else "", influence)
                if at not in periods:
                    periods[at] = self._period(simulations, place, influence)
                if (period := periods[at]) is not None:
                    own = replace(influence, span=period.length)
                    laws_ = turning_laws(place, self._recordings, own)
                    every += [(law, period) for law in laws_]
        if not every:
            return []
        waves = [self._waves(law, period) for law, period in every]
        columns = [
            Variation(variables(self._fit.unknowns.effects[law.place.name], law.place.own(_SIZE)))
            for law, _ in every
            for _ in range(2)
        ]
        courses = [np.hstack([wave[k] for wave in waves]) for k in range(len(self._recordings))]
        derivatives = simulations.responses(values, columns, courses)
        scores = []
        for n, (law, period) in enumerate(every):
            keys = [(law.place.name, f"c{k}") for k in range(2 * len(derivatives))]
            more = [np.zeros((len(derivative), len(keys))) for derivative in derivatives]
            for k, derivative in enumerate(derivatives):
                more[k][:, 2 * k : 2 * k + 2] = derivative[:, 2 * n : 2 * n + 2]
            joint = self._fit.quadratics(self._base.linearised.extended(keys, more), keys)
            largest = self._largest(law.place)
            likeliest = smoothest(*joint.reduced(keys), APART, _most(law, largest))
            evidence = likeliest.evidence - float(np.log(period.tried))
            likeliest = replace(likeliest, evidence=evidence)
            scores.append(LawScore(law, None, likeliest, largest))
        return scores

    def _period(
        self, simulations: ResidualModel, place: Place, influence: LawInfluence
    ) -> Period | None:
        """The period that errors have most of, along an influence."""
        middles = [
            recording.blocks.mean(axis=1).astype(int) for recording in simulations.recordings
        ]
        clocks = [
            influence.course(place, watched, time)[at]
            for (time, watched), at in zip(self._recordings, middles, strict=True)
        ]
        lin = self._base.linearised
        return strongest_period(
            [recording.errors for recording in lin.residuals], clocks, lin.lasting
        )

    def _waves(self, law: Law, period: Period) -> list[Matrix]:
        """Carrier times cosine and sine in each recording, (n, 2)."""
        assert law.influence is not None
        columns = []
        for time, watched in self._recordings:
            angle = 2.0 * np.pi / period.length * law.influence.course(law.place, watched, time)
            carrier = law.carrier.course(law.place, watched)
            columns.append(carrier[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
        return columns

    def _largest(self, place: Place) -> float:
        name = place.output.name
        return max(
            float(np.abs(place.at(recording, name)).max()) for _, recording in self._recordings
        )

    def _basis(self, law: Law) -> tuple[Knots | None, list[Matrix]]:
        """Columns of a law in each recording: carrier times basis functions."""
        carriers = [law.carrier.course(law.place, watched) for _, watched in self._recordings]
        if law.influence is None:
            return None, [carrier[:, None] for carrier in carriers]
        courses = [
            law.influence.course(law.place, watched, time) for time, watched in self._recordings
        ]
        low, high = 0.0, 1.0
        if law.influence.kind == "rate":  # which begins from anywhere
            low, high = 0.5 * _SEEN, 1.0 - 0.5 * _SEEN
        ends = np.quantile(np.concatenate(courses), (low, high))
        knots = Knots(float(ends[0]), float(ends[1]))
        if law.influence.kind == "since":  # what is slower is a function of time
            knots = Knots(0.0, min(knots.high, _BEGINS * self._lasting))
        return knots, [
            carrier[:, None] * knots.basis(course)
            for carrier, course in zip(carriers, courses, strict=True)
        ]


def watching(text: str, names: Sequence[str]) -> str:
    """A model with outputs for what is within its slots."""
    outputs = [f"  output Real watched{k} = {name};\n" for k, name in enumerate(names)]
    head, end, tail = text.rpartition("end ")
    return head + "".join(outputs) + end + tail
