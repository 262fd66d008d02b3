"""Free functions in place of what is missing, fitted in full: how a law looks."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis import given_values
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.search import FittedModel, fitted
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.laws.places import Law
from workbench.diagnosis.laws.scan import LawScore, effect_at
from workbench.diagnosis.laws.splines import COEFFICIENTS, smoothest
from workbench.diagnosis.laws.writing import LawClass, clock, extended_library, number, unit_of
from workbench.diagnosis.problem import Problem
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import FMUError, InputError
from workbench.models.modelica import Library
from workbench.runtime.engine import Engine

_ROUNDS = 2  # of fit and smoothness
_BEGUN = (1.0, 0.5, 0.25, 0.1)  # shares of a function that a fit begins with
_POINTS = 101  # of a function that is drawn


@dataclass(frozen=True)
class FreeFunction(Effect):
    """An effect that is a free function."""

    count: int = COEFFICIENTS  # of its coefficients
    # covariance of its coefficients beforehand, inverted
    inverse: Matrix = field(default_factory=lambda: np.zeros((0, 0)), compare=False)

    @property
    def sizes(self) -> tuple[str, ...]:
        """Coefficients."""
        return tuple(f"c{k}" for k in range(self.count))

    @property
    def precision(self) -> Matrix:
        """Inverse covariance of the coefficients beforehand."""
        return self.inverse


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law, fitted as a free function."""

    prospect: LawScore  # about what is known
    evidence: float  # log of the marginal likelihood over that of what is known
    # coefficients, posterior: of the function, (K,) and their covariance, (K, K); of what turns,
    # cosine and sine of each recording
    coefficients: Vector
    posterior: Matrix

    @property
    def law(self) -> Law:
        """Where it acts, and what it depends on."""
        return self.prospect.law

    def function(self) -> tuple[Vector, Vector, Vector, Vector]:
        """What it depends on, its function, deviations of that and of its shape; (n,) each.

        The shape is the function less its mean, which calibrated levels may take.
        """
        knots, influence = self.prospect.knots, self.law.influence
        if influence is not None and influence.turns:
            size = np.hypot(*self.coefficients.reshape(-1, 2).T)
            wave = np.cos(np.linspace(0.0, 2.0 * np.pi, _POINTS))
            sigma = np.full(_POINTS, np.sqrt(np.trace(self.posterior)) / size.size)
            return np.linspace(0.0, influence.span, _POINTS), size.mean() * wave, sigma, sigma
        if knots is None:
            sigma = np.sqrt(np.diag(self.posterior))
            return np.zeros(1), self.coefficients, sigma, np.zeros(1)
        values = np.linspace(knots.low, knots.high, _POINTS)
        basis = knots.basis(values)
        whole, shape = (
            np.sqrt(np.einsum("ij,jk,ik->i", functions, self.posterior, functions))
            for functions in (basis, basis - basis.mean(axis=0))
        )
        return values, basis @ self.coefficients, whole, shape


def _written(name: str, prospect: LawScore) -> LawClass:
    law, knots = prospect.law, prospect.knots
    about = f"Free function: {law.text}"
    if law.influence is None or knots is None:
        declared_ = f"parameter Real c0({unit_of(law.carrier.unit)}) = 0.0;"
        change = f"{law.carrier.expression}*c0"
        return LawClass(name, about, law.place, (declared_,), (), change)
    last, place = COEFFICIENTS - 3, law.place.own("x")
    declared, equations = clock(law.influence)
    terms = " + ".join(f"c{k}*({_bump(place, k - 1)})" for k in range(COEFFICIENTS))
    inside = f"({law.influence.expression} - ({number(knots.low)}))/{number(knots.step)}"
    return LawClass(
        name=name,
        about=about,
        place=law.place,
        declarations=(
            *(
                f"parameter Real c{k}({unit_of(law.carrier.unit)}) = 0.0;"
                for k in range(COEFFICIENTS)
            ),
            *declared,
            f'Real {place}(unit="1") "Place among the knots";',
        ),
        equations=(*equations, f"{place} = noEvent(max(0.0, min({number(last)}, {inside})));"),
        change=f"{law.carrier.expression}*({terms})",
    )


def _bump(place: str, knot: int) -> str:
    """Cubic B-spline about a knot, of a place among them."""
    away = f"abs({place} - ({number(knot)}))"
    return f"(noEvent(max(0.0, 2.0 - {away}))^3 - 4.0*noEvent(max(0.0, 1.0 - {away}))^3)/6.0"


def estimated(
    problem: Problem,
    prospects: Sequence[LawScore],
    about: FittedModel,
    engine: Engine,
    sought: float = np.inf,
) -> list[FittedLaw]:
    """Fit free functions in full, best first.

    What is large bends what the other quantities do, so that each function is fitted anew about
    where it led, with the smoothness that is likeliest there.

    Parameters
    ----------
    sought : deviance that is of use; see `Fit.refine`.
    """
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "Free.fmu"
        engine.report(f"compiling {len(prospects)} free functions")
        able = _compiled(problem, prospects, path, about.active)
        if not able:
            return []
        effects = _effects(problem.modelica, able)
        source = ModelSource(path, problem.system, given_values(path, problem.system))
        with ResidualModel(source, problem.cases, engine) as simulations:
            fit = Fit(simulations, [*about.active, *effects])
            engine.report("fitting free functions")
            job = partial(_estimate, simulations, anew(fit, about.point, about.active), sought)
            tried = fit.together(job, list(zip(effects, able, strict=True)))
    fits = [smoothness for smoothness in tried if smoothness is not None]
    return sorted(fits, key=lambda smoothness: -smoothness.evidence)


def _effects(library: Library, prospects: Sequence[LawScore]) -> list[FreeFunction]:
    return [
        FreeFunction(
            **vars(effect_at(f"Free{k}", library, prospect.law.place, "c0")),
            count=len(prospect.smoothness.coefficients),
        )
        for k, prospect in enumerate(prospects)
    ]


def _compiled(
    problem: Problem, prospects: Sequence[LawScore], path: Path, known: Sequence[Effect]
) -> list[LawScore]:
    """Build the FMU of free functions; returns those that it has.

    What a law depends on may depend on it: a loop that is not linear, which no FMU of ours solves.
    """
    name, about = "FreeFunctions", "With free functions"
    with tempfile.TemporaryDirectory() as scratch:
        written = [_written(f"Free{k}", prospect) for k, prospect in enumerate(prospects)]
        extended = extended_library(problem.modelica, written, Path(scratch))
        effects = [*known, *_effects(problem.modelica, prospects)]
        text = ExtendedModel(extended, problem.base, name, effects, about).source()
        try:
            build(extended, name, text, path, every_platform=False)
        except InputError:
            if len(prospects) == 1:
                return []
        else:
            return list(prospects)
    able = [prospect for prospect in prospects if _compiled(problem, [prospect], path, known)]
    return _compiled(problem, able, path, known) if able else []


def _estimate(
    simulations: ResidualModel,
    base: FittedModel,
    sought: float,
    item: tuple[FreeFunction, LawScore],
) -> FittedLaw | None:
    """Fit one function; None if it leads where the model has no solution, or is of no use."""
    try:
        return _fitted(simulations, base, sought, *item)
    except (FMUError, np.linalg.LinAlgError):
        return None


def _fitted(
    simulations: ResidualModel,
    base: FittedModel,
    sought: float,
    effect: FreeFunction,
    prospect: LawScore,
) -> FittedLaw | None:
    """The likelier of all rounds: smoothness about a point may promise what bends away from it."""
    smoothness, best = prospect.smoothness, base
    keys = [(effect.name, name) for name in effect.sizes]
    laws: list[FittedLaw] = []
    for _ in range(_ROUNDS):
        inverse: Matrix = np.asarray(np.linalg.inv(smoothness.covariance), np.float64)
        effect = replace(effect, inverse=inverse)
        active = (*base.active, effect)
        fit = Fit(simulations, active)
        start = _started(fit, best, keys, smoothness.coefficients)
        best = fitted(fit, start, active, spread=start.spread, sought=sought)
        if best.linearised.deviance > sought and not best.linearised.settled:
            break
        lin = fit.linearise(best.linearised, active)
        N, g = fit.quadratics(lin).reduced(keys)
        # Of the data alone, about no function: the prior is put in anew.
        now = np.array([best.point.sizes[key] for key in keys])
        N = N - effect.precision
        g = g - effect.precision @ now - N @ now
        gained = base.linearised.deviance - best.linearised.deviance
        spread = np.linalg.slogdet(np.eye(len(keys)) + N @ smoothness.covariance)[1]
        posterior: Matrix = np.asarray(np.linalg.inv(N + effect.precision), np.float64)
        laws.append(FittedLaw(prospect, 0.5 * (gained - float(spread)), now, posterior))
        smoothness = smoothest(N, g, most=prospect.most)
    return max(laws, key=lambda smoothness: smoothness.evidence, default=None)


def _started(
    fit: Fit, best: FittedModel, keys: Sequence[Key], coefficients: Vector
) -> LinearizedPoint:
    """Where a fit with a free function begins: as much of it as lowers the deviance."""
    before = best.linearised.deviance
    for share in _BEGUN:
        now = dict(zip(keys, map(float, share * coefficients), strict=True))
        tried = fit.tried(replace(best.point, sizes={**best.point.sizes, **now}))
        if tried is not None and tried.deviance < before:
            return tried
    none = dict.fromkeys(keys, 0.0)
    return fit.at(replace(best.point, sizes={**none, **best.point.sizes}))
