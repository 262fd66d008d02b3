"""Fit of effects to all recordings at once, with what differs between them by nature.

What differs between recordings has priors, and is eliminated one recording after the other. What is
left of a recording is a small quadratic form in the common unknowns, which sums and
leaves-one-out are made of.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.data.clocks import apparent_lags, greatest_skew, own_clocks, reference
from workbench.diagnosis.data.samples import standardised
from workbench.diagnosis.effects.candidates import own_bounds, parameters
from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.effects.extension import sizes_by_component, variables
from workbench.diagnosis.inference.linearized import (
    LinearizedPoint,
    Point,
    between,
    lasting,
    slowness,
)
from workbench.diagnosis.inference.quadratic import (
    Joint,
    Key,
    Quadratic,
    RecordingSystem,
    minimum,
    part_edges,
)
from workbench.diagnosis.inference.thresholds import Thresholds, of_system
from workbench.diagnosis.inference.unknowns import SENSOR, Unknowns
from workbench.diagnosis.simulation.prediction import Variation
from workbench.diagnosis.simulation.residual_model import Item, ResidualModel, Result
from workbench.diagnosis.simulation.simulator import FINEST, WhitenedResiduals
from workbench.errors import FMUError, InputError
from workbench.models.instance import EventError
from workbench.recordings.case import Case
from workbench.system.parts import Signal
from workbench.system.registry import open_model
from workbench.system.units import BAND

# A single recording is held out in tenths. R. Kohavi (1995), Proc. 14th IJCAI, 1137-1143.
_PARTS = 10
_HALVED = 4  # times: after that a step is given up
_ROUNDS = 8  # evaluations of a least chi-squared, at most
_WORTH = 1.0  # of chi-squared: what noise moves it by
# Times what derivatives promise that steps may gain, since laws bend: up to twice as much is seen.
_BENT = 3.0
_ROUNDED = 1e-9  # of a level that is held
# Of half of an interval, that half a step may move a size by. Steps are of second order: the size
# is off by 4/3 of that, and 94.2 of 100 intervals hold the truth in place of 95.
_MOVED = 0.1
_TURN = 0.5  # [rad] of a phase in one step, within which a sine is nearly straight

_LOCAL = ""  # in place of an effect, of what differs between recordings


class Fit:
    """Evidence and least squares of one set of recordings.

    Parameters
    ----------
    simulations : that give the evidence.
    effects : that may be asked for.
    decides : thresholds, those of the usual rate of false alarms if none are given.
    beside : other recordings of the machine, whose conditions say what it has too.

    Raises
    ------
    InputError
        If a single recording is too short for two parts, of which one is held out.
    """

    def __init__(
        self,
        simulations: ResidualModel,
        effects: Sequence[Effect],
        decides: Thresholds | None = None,
        beside: Sequence[Case] = (),
    ) -> None:
        self._simulations = simulations
        self._compare = simulations.system.comparison
        self.decides = decides or of_system(self._compare, len(effects))
        self.unknowns = Unknowns(simulations, effects, beside)
        self._hidden = slice(0)  # blocks that do not count
        # levels that are further from their sheet than what is declared of them lets be likely
        self.freed: frozenset[Key] = frozenset()
        if self.unknowns.count == 1 and not beside and self.parts < 2:
            recording, compare = simulations.recordings[0], self._compare
            raise InputError(
                where=recording.name,
                found=f"one recording, {compare.block * len(recording.blocks):.3g} s that count",
                expected=f"{2 * compare.lasting:g} s or more of one alone, because an effect is "
                "scored on a part it was not fitted to",
                remedy="give more recordings of this machine, or a longer one",
            )

    def without(self, part: int) -> "Fit":
        """The same without one part of a single recording."""
        other = copy(self)
        other._hidden = self.blocks_of(part)
        return other

    @property
    def reference(self) -> str:
        """The signal against which clocks of others are late."""
        return reference(self._simulations.system)

    @property
    def least_skew(self) -> float:
        """What the clock of a signal is late by at least to be late [s]."""
        return self._compare.least_skew

    @property
    def recorded(self) -> tuple[str, ...]:
        """Names of the inputs and signals that recordings have."""
        first = self._simulations.recordings[0]
        return (*first.inputs, *first.signals)

    @property
    def own_clocks(self) -> tuple[Effect, ...]:
        """A clock of each recorded signal but the reference, whatever the loggers."""
        clocks = own_clocks(self._simulations.system)
        return tuple(clock for clock in clocks if {*clock.late} <= {*self.recorded})

    def apparent_skews(self, point: Point) -> dict[Key, float]:
        """Lateness of `own_clocks` as it shows without derivatives [s], for a fit to begin with."""
        recordings = self._simulations.recordings
        sample = float(np.median(np.diff(recordings[0].time)))
        lags = apparent_lags(
            [recording.y for recording in recordings],
            self._simulations.predicted(self.unknowns.values(point)),
            round(greatest_skew(self._simulations.system) / sample),
        )
        late = dict(zip(recordings[0].signals, sample * lags, strict=True))
        # All outputs lag behind inputs, which have no lag of their own here.
        first = late.get(self.reference, 0.0)
        return {(c.name, c.size): float(late.get(c.late[0], 0.0) - first) for c in self.own_clocks}

    def beside(self, effects: Sequence[Effect]) -> "Fit":
        """The same with more effects that may be asked for."""
        other = copy(self)
        other.unknowns = copy(self.unknowns)
        other.unknowns.effects = {
            **self.unknowns.effects,
            **{effect.name: effect for effect in effects},
        }
        return other

    def changes(self) -> list[Effect]:
        """Changes that no effect is: of a parameter of the model, or an effect in one place alone.

        What turns with a shaft has a phase, which is no single change.
        """
        effects, simulations = self.unknowns.effects.values(), self._simulations
        sizes = {name for e in effects for part in e.sizes for name in variables(e, part)}
        with open_model(simulations.system) as model:
            own = list(parameters(model, simulations.system))
        return [
            *(e for e in own if e.name not in sizes and e.name in simulations.nominal),
            *(
                replace(e, name=f"{e.name}[{slot}]", slots=(slot,), text=f"{e.text}, {slot} alone")
                for e in effects
                if len(e.slots) > 1 and not e.order_locked
                for slot in e.slots
            ),
        ]

    @contextmanager
    def held(self, name: str, way: bool | str) -> Iterator["Fit"]:
        """The same with an input that is held otherwise between samples."""
        with self._simulations.held({name: way}) as simulations:
            yield Fit(simulations, list(self.unknowns.effects.values()), self.decides)

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """What drives the model."""
        return self._simulations.system.inputs

    def opened(self, effect: Effect, parameter: str, side: str) -> "Fit":
        """The same with a parameter that may pass its bound, "least" or "greatest"."""
        low, high = self.unknowns.bounds(effect, parameter)
        other = copy(self)
        other.unknowns = copy(self.unknowns)
        reach = (-np.inf, high) if side == "least" else (low, np.inf)
        other.unknowns.opened = {**self.unknowns.opened, (effect.name, parameter): reach}
        return other

    def blocks_of(self, part: int) -> slice:
        """Blocks of a part of a single recording."""
        edges = part_edges(len(self._simulations.recordings[0].blocks), self.parts)
        return slice(edges[part], edges[part + 1])

    def hide(self, lin: LinearizedPoint) -> LinearizedPoint:
        """The same, as if what is hidden from this fit had neither errors nor derivatives."""
        return replace(lin, residuals=tuple(self._shown(lin.residuals)))

    def _shown(self, residuals: Sequence[WhitenedResiduals]) -> Sequence[WhitenedResiduals]:
        if self._hidden == slice(0):
            return residuals
        (residual,) = residuals
        errors, jacobian = residual.errors.copy(), residual.jacobian.copy()
        errors[self._hidden] = 0.0
        jacobian[: errors.size].reshape(*errors.shape, -1)[self._hidden] = 0.0
        return (replace(residual, errors=errors, jacobian=jacobian),)

    @property
    def delays(self) -> tuple[Key, ...]:
        """Keys of the derivatives that cost no simulation."""
        return tuple((_LOCAL, name) for name in self.unknowns.modes)

    @property
    def lasting(self) -> int:
        """Blocks from which on an error is no noise."""
        return max(1, round(self._compare.lasting / self._compare.block))

    def at(self, point: Point) -> LinearizedPoint:
        """Gather errors at a point; of derivatives, only what costs no simulation."""
        residuals = self._shown(self._simulations.at(self.unknowns.values(point)))
        away = self._away(point)
        slow, excess = slowness(residuals, self.lasting), self.decides.excess
        return LinearizedPoint(
            point, self.delays, tuple(residuals), self.lasting, slow, away, excess
        )

    @property
    def free(self) -> bool:
        """Whether whole simulations are fitted, which nothing corrects."""
        return self._simulations.free

    def settle(
        self, lin: LinearizedPoint, active: Sequence[Effect], reaches: Mapping[Key, float]
    ) -> bool:
        """Take finer steps if a point needs them; whether it does, so that fits are made anew.

        Parameters
        ----------
        reaches : half of the interval of sizes, of which half a step may move them by a share.
        """
        if self.free:
            return False
        values, simulations = self.unknowns.values(lin.point), self._simulations
        if simulations.settle(values):
            return True
        lin = self.linearise(lin, active)
        joint, parts = self.quadratics(lin), simulations.simulated.parts
        at = [joint.shared.index(key) for key in reaches]
        most = _MOVED * np.array([*reaches.values()])
        coarse = minimum(joint.total())[at]
        while parts < FINEST:
            errors = [own.errors for own in simulations.in_steps(values, 2 * parts)]
            moved = tuple(
                replace(own, errors=finer) for own, finer in zip(lin.residuals, errors, strict=True)
            )
            fine = minimum(self.quadratics(replace(lin, residuals=moved)).total())[at]
            if np.all(np.abs(fine - coarse) <= most):
                break
            parts, coarse = 2 * parts, fine
        return simulations.take_steps(parts)

    @property
    def restarted(self) -> list[int]:
        """Recordings of which samples count where states are restarted, and a law is simplified."""
        residuals = self._simulations.recordings
        return [k for k, residual in enumerate(residuals) if residual.restarted.any()]

    def astray(self, lin: LinearizedPoint) -> list[int]:
        """Recordings in which errors last where states are restarted: another law holds there."""
        kept = []
        for k, (recording, residuals) in enumerate(
            zip(self._simulations.recordings, lin.residuals, strict=True)
        ):
            errors = residuals.errors[recording.restarted]
            if not len(errors):
                continue
            squares = lasting(errors, min(self.lasting, len(errors)))
            # Few means may be larger by chance than what is wrong of many.
            count = len(squares)
            if squares.mean(axis=0).max() > max(
                self.decides.wrong, self.decides.fall_of(count) / count
            ):
                kept.append(k)
        return kept

    def count_restarted(self, numbers: Collection[int], *, counting: bool) -> None:
        """See `ResidualModel.count_restarted`; what was fitted before has to be fitted anew."""
        self._simulations.count_restarted(numbers, counting=counting)

    def tried(self, point: Point) -> LinearizedPoint | None:
        """As `at`; None where the model cannot be evaluated: a tank that is more than empty.

        Raises
        ------
        EventError
            If an FMU alone passes an event, through which whole simulations go.
        """
        try:
            return self.at(point)
        except FMUError as error:
            if isinstance(error, EventError) and not self._simulations.system.library.is_file():
                raise
            return None

    def linearise(
        self,
        lin: LinearizedPoint,
        active: Sequence[Effect],
        candidates: Sequence[tuple[Effect, Mapping[str, float]]] = (),
    ) -> LinearizedPoint:
        """Add the derivatives that are not there yet.

        Parameters
        ----------
        active : effects that the point has.
        candidates : others, each with the shape it is tried with.
        """
        names = dict.fromkeys([*self._compare.levels, *self.unknowns.local])
        columns = {(_LOCAL, name): Variation((name,)) for name in names}
        for effect in active:
            for parameter in (*effect.sizes, *(name for name, _ in effect.shapes)):
                size = effect.matters if parameter in effect.sizes else 0.0
                columns[effect.name, parameter] = Variation(variables(effect, parameter), size=size)
        for effect, shape in candidates:
            setting = {
                name: value
                for parameter, value in shape.items()
                for name in variables(effect, parameter)
            }
            for parameter in effect.sizes:
                column = Variation(variables(effect, parameter), setting, effect.matters)
                columns[variant(effect, shape), parameter] = column
        missing = {key: column for key, column in columns.items() if key not in lin.keys}
        if not missing:
            return lin
        values = self.unknowns.values(lin.point)
        sizes = sizes_by_component(self.unknowns.effects.values())
        more = self._simulations.derivatives(values, list(missing.values()), sizes)
        return self.hide(lin.extended(missing, more))

    def by_held_starts(self, lin: LinearizedPoint) -> dict[str, list[Vector]]:
        """Weighed derivatives in each recording by starts that are not fitted, by state.

        A library says itself how its states begin.
        """
        with open_model(self._simulations.system) as model:
            fitted = {*self.unknowns.local, *self.recorded}
            held = [name for name in model.states if name not in fitted]
        if not held:
            return {}
        values = self.unknowns.values(lin.point)
        columns = self._simulations.derivatives(values, [Variation((name,)) for name in held])
        weighed = [
            _weights(lin, own)[:, None] * more
            for own, more in zip(lin.residuals, columns, strict=True)
        ]
        return {name: [more[:, j] for more in weighed] for j, name in enumerate(held)}

    def modulated(self, lin: LinearizedPoint, effect: Effect) -> tuple[LinearizedPoint, list[Key]]:
        """Add derivatives by the size of an effect as it goes with what it should not depend on.

        Returns
        -------
        lin : with them.
        keys : of them, one for each of `standardised`.
        """
        simulations = self._simulations
        courses = standardised(simulations.recordings)
        keys = [(effect.name, f"form {j}") for j in range(courses[0].shape[1])]
        column = Variation(variables(effect, effect.size), size=effect.matters)
        columns = [column] * len(keys)
        more = simulations.responses(self.unknowns.values(lin.point), columns, courses)
        return self.hide(lin.extended(keys, more)), keys

    def quadratics(self, lin: LinearizedPoint, extra: Sequence[Key] = ()) -> Joint:
        """Every stop over the common unknowns, local ones eliminated.

        Parameters
        ----------
        extra : columns of candidates that join the common unknowns as they are.
        """
        shared = [*lin.point.sizes, *lin.point.levels, *extra]
        systems = [self._system(lin, k, shared) for k in range(self.unknowns.count)]
        known = tuple(shared[: len(shared) - len(extra)])
        levels = tuple(lin.point.levels)
        return Joint(tuple(shared), known, levels, tuple(systems), self._prior(lin.point, shared))

    @property
    def tests(self) -> list[str]:
        """Names of what is held out in turn: recordings, or parts of a single one."""
        if self.unknowns.count > 1:
            return self.unknowns.names
        return [f"part {k} of {self.parts}" for k in range(1, self.parts + 1)]

    @property
    def parts(self) -> int:
        """Of a single recording, each long enough for an error that lasts."""
        return min(_PARTS, len(self._simulations.recordings[0].blocks) // self.lasting)

    def apart(self, lin: LinearizedPoint, extra: Sequence[Key] = ()) -> Joint:
        """As `quadratics`, in what is held out in turn."""
        return self.quadratics(lin, extra).apart(self.parts)

    def _system(self, lin: LinearizedPoint, k: int, shared: Sequence[Key]) -> RecordingSystem:
        point, case = lin.point, self._simulations.cases[k]
        residuals = lin.residuals[k]
        b, m = residuals.errors.shape
        q = residuals.rest.size
        weight = _weights(lin, residuals)
        at = {key: residuals.jacobian[:, j] * weight for j, key in enumerate(lin.keys)}
        J, P = np.zeros((b * m + q, len(shared))), []
        for j, key in enumerate(shared):
            if key in point.levels and key[1] == SENSOR:
                J[:, j] = at[_LOCAL, key[0]]
            elif key in point.levels:
                if key[1] == self.unknowns.choice(key[0], case):
                    J[:, j] = at[_LOCAL, key[0]] * self.unknowns.shared(point, key[0], k)
            elif key[1] == "amplitude":
                cosine, sine, phase = (
                    at[key[0], "cosine"],
                    at[key[0], "sine"],
                    point.phases[key[0]][k],
                )
                J[:, j] = np.cos(phase) * cosine + np.sin(phase) * sine
                P.append(point.sizes[key] * (np.cos(phase) * sine - np.sin(phase) * cosine))
            else:
                effect = self.unknowns.effects[key[0].partition(" ")[0]]
                J[:, j] = at[key] * float(self.unknowns.presence.at(effect, k))
        tolerances = [
            at[_LOCAL, name] * self.unknowns.spread(point, name, k, spread)
            for name, spread in self.unknowns.local.items()
        ]
        free = np.zeros((b * m + q, 0))
        local = np.column_stack([free, *tolerances, *P])
        furthest = np.repeat([self.decides.furthest, _TURN], [len(tolerances), len(P)])
        r, deviations = residuals.residual * weight, point.deviations[k]
        return RecordingSystem(r, J, local, deviations, furthest, m, rests=q)

    def _prior(self, point: Point, shared: Sequence[Key]) -> Quadratic:
        N, g, c = np.zeros((len(shared),) * 2), np.zeros(len(shared)), 0.0
        for effect in {name: self.unknowns.effects.get(name) for name, _ in point.sizes}.values():
            if effect is None or not len(effect.precision):
                continue
            at = [shared.index((effect.name, parameter)) for parameter in effect.sizes]
            z = np.array([point.sizes[effect.name, parameter] for parameter in effect.sizes])
            N[np.ix_(at, at)] = effect.precision
            g[at] = effect.precision @ z
            c += float(z @ effect.precision @ z)
        for j, key in enumerate(shared):
            if key not in point.levels:
                continue
            middle, sigma = self.unknowns.expected(key)
            if np.isfinite(sigma):
                away = (point.levels[key] - middle) / sigma
                N[j, j], g[j], c = 1.0 / sigma**2, away / sigma, c + away**2
        return Quadratic(N, g, c, 0)

    def refine(
        self,
        best: LinearizedPoint,
        active: Sequence[Effect],
        rounds: int,
        spread: Vector | None = None,
        held: Mapping[Key, float] = MappingProxyType({}),
        sought: float = np.inf,
    ) -> LinearizedPoint:
        """Gauss-Newton over all unknowns, with channels weighed by what is wrong with them.

        Parameters
        ----------
        best : where to begin.
        rounds : most evaluations; a step that made things worse is halved, which costs one.
        spread : (m,) for the first step, if not that of the point: an effect that has only just
            been put beside levels fitted without it makes all channels wrong.
        held : common unknowns that are not fitted, at these values.
        sought : deviance that is of use: a fit ends where steps no longer promise to come near it.

        Returns
        -------
        best : the best point that was met; derivatives may be missing.
        """
        best = self.linearise(best, active)
        expected, halved = self.stepped(best, best.spread if spread is None else spread, held), 0
        worse, point = self.decides.worse, expected.point

        def hopeless(fall: float) -> bool:
            """Whether steps that shrink as this one does, to the last one, lead nowhere near."""
            step = best.deviance - expected.deviance
            return step < fall and best.deviance - _BENT * step / (1.0 - step / fall) > sought

        for left in reversed(range(rounds)):
            tried = self.tried(point)
            fall = -np.inf if tried is None else best.deviance - tried.deviance
            better = fall > -worse
            if tried is not None and better:
                best = tried
            if abs(fall) < worse or halved == _HALVED:
                return replace(best, settled=True)
            if left == 0:
                break
            if not better:
                point, halved = between(best.point, point), halved + 1
                continue
            best = self.linearise(best, active)
            expected = self.stepped(best, best.spread, held)
            if hopeless(fall):
                break
            point, halved = expected.point, 0
        return best

    def least(
        self,
        best: LinearizedPoint,
        active: Sequence[Effect],
        variance_factors: Vector,
        right: float = np.inf,
    ) -> tuple[float, LinearizedPoint]:
        """Least chi-squared, tolerances included, and its point, where derivatives may be missing.

        Gauss-Newton; a worse step is halved. Two small falls end it: in a bent valley one may be.

        Parameters
        ----------
        best : where to begin.
        inflation : (m,) variance of what is wrong in each channel over that of white noise.
        right : what a right model leaves, if known; noise moves what is beyond by twice its root.
        """
        best, fall = (
            self.linearise(replace(best, variance_factors=variance_factors), active),
            np.inf,
        )
        least, point = self.quadratics(best).chi_squared, best.point
        for _ in range(_ROUNDS):
            best = self.linearise(best, active)
            point = (
                self.stepped(best, variance_factors, {}).point
                if fall > 0.0
                else between(best.point, point)
            )
            before, fall = abs(fall), -np.inf
            if (tried := self.tried(point)) is not None:
                tried = replace(tried, variance_factors=variance_factors)
                fall = least - self.quadratics(tried.derived_as(best)).chi_squared
                if fall > 0.0:
                    best, least = tried, least - fall
            if abs(fall) < _WORTH or max(before, abs(fall)) ** 2 < least - right:
                break
        return least, best

    def stepped(
        self, lin: LinearizedPoint, spread: Vector, held: Mapping[Key, float]
    ) -> LinearizedPoint:
        """Where derivatives have the best point, beside what is held at values of its own.

        Its errors are those that derivatives lead to.
        """
        joint, point = self.quadratics(replace(lin, variance_factors=spread)), lin.point
        at = np.array([{**point.sizes, **point.levels}[key] for key in joint.shared])
        reach = [
            (held[key], held[key]) if key in held else self._reach(point, key)
            for key in joint.shared
        ]
        low, high = np.array(reach).reshape(-1, 2).T
        count = len(self.unknowns.local)
        step, locals_ = joint.solve(low - at, high - at)
        sizes, levels = dict(point.sizes), dict(point.levels)
        for key, value, least, greatest in zip(joint.shared, at + step, low, high, strict=True):
            values = levels if key in levels else sizes
            values[key] = float(np.clip(value, least, greatest))  # of what rounding leaves
        changes = np.array(locals_[: self.unknowns.count])
        locked = enumerate(name for name, parameter in joint.shared if parameter == "amplitude")
        phases = {name: point.phases[name] + changes[:, count + j] for j, name in locked}
        new = Point(sizes, levels, point.deviations + changes[:, :count], phases)
        residuals = tuple(
            own.moved(system.J @ step + system.P @ local, spread)
            # Systems of other recordings may count beside those that are simulated.
            for own, system, local in zip(lin.residuals, joint.systems, locals_, strict=False)
        )
        return replace(lin, point=new, residuals=residuals, away=self._away(new))

    def _away(self, point: Point) -> float:
        """Chi-squared of levels and deviations against what tolerances say of them."""
        known = self._prior(point, [*point.sizes, *point.levels])
        return float(np.square(point.deviations).sum()) + known.c

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that fits, by item."""
        return self._simulations.together(job, items)

    def unlikely_levels(self, point: Point, *, clean: bool) -> frozenset[Key]:
        """Levels further from their sheet than 95 of 100 are, by what is declared of them.

        Parameters
        ----------
        clean : whether nothing is wrong with the fit: then only those that it holds.
        """
        far = (1.0 - _ROUNDED) * self.decides.furthest_level if clean else BAND
        expected = {key: self.unknowns.expected(key) for key in point.levels if key[1] != SENSOR}
        return frozenset(
            key
            for key, (middle, sigma) in expected.items()
            if key not in self.freed and abs(point.levels[key] - middle) > far * sigma
        )

    def _reach(self, point: Point, key: Key) -> tuple[float, float]:
        """Least and greatest value after a step of a common unknown.

        Within the bounds of its parameter, and not too unlikely; a shape changes by half at most.
        """
        if key in point.levels:
            middle, sigma = self.unknowns.expected(key)
            bounds = self._simulations.bounds.get(key[0], (-np.inf, np.inf))
            if key in self.freed:
                low, high = own_bounds(middle, bounds)
                return middle + low, middle + high
            reach = self.decides.furthest_level * sigma
            return max(bounds[0], middle - reach), min(bounds[1], middle + reach)
        effect, old = self.unknowns.effects[key[0]], point.sizes[key]
        parameter = effect.size if key[1] == "amplitude" else key[1]
        low, high = self.unknowns.bounds(effect, parameter)
        if parameter in effect.sizes:
            return low, high
        return max(low, 0.5 * old), min(high, 2.0 * old)


def _weights(lin: LinearizedPoint, residuals: WhitenedResiduals) -> Vector:
    """(b*m + q,) Over what is wrong with each channel; readings at rest as they are."""
    own = np.tile(1.0 / np.sqrt(lin.variance_factors), len(residuals.errors))
    return np.append(own, np.ones(residuals.rest.size))
