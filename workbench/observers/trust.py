"""Whether a run may be believed: innovations, start and samples are tested, without the truth.

Where a filter's model, noise levels and start are right, its innovations are white, of mean zero,
and of the covariance S that it says. So are its residuals after each sample, (n, l), measured less
estimated outputs: they are R S^-1 times the innovations, where R is the noise of the samples.
Sources: Y. Bar-Shalom, X.-R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation, Wiley 2001, section 5.4; R. K. Mehra (1970), IEEE Trans. Autom. Control 15, 175-184.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr, chdtrc, chdtri, ndtr

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.observers import estimators_of
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.operating import shown_states, start_spreads
from workbench.observers.replay import replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import judged_window
from workbench.observers.trajectory import Trajectory
from workbench.pages.views import amount, rounded
from workbench.recordings.case import Case
from workbench.system.system import System

# A 95 % band of deviations that are too small by the root of this covers 93 %; of such that are
# too large by the root of the other, 97 %.
NARROW, WIDE = (1.960 / 1.812) ** 2, (1.960 / 2.170) ** 2
_OFF = 0.335  # deviations; a 95 % band of an estimate that is off by so many covers 93 %
# A 95 % band of deviations that are too small by the root of this misses more often than it holds.
_USELESS = (1.960 / 0.674) ** 2
_CHANCE = 1e-3  # of a recording in which a test contradicts what is right
_LAGS = 10  # that a test of whiteness looks at; Hyndman and Athanasopoulos (2021), section 5.4
_PASSED = np.log(20.0)  # time constants after which a twentieth is left of a motion
_APART = 20  # points of a trajectory from one where a model is linearised to the next
_CELSIUS = 273.15  # K
_FINE = 4  # steps in place of one, which then errs by a quarter of it, or less
# Samples that tell a variance to half a percent, the root of 2 / n. With more steps in place of
# each, a long recording would take more memory than all its estimates.
_TELLING = 100_000
# Shares of the open loop's error that are its steps'. From the first on they are said; from the
# second on steps make more of the error than the model does.
_NOTED, MOSTLY = 0.1, 0.5
TOO_COARSE = "samples are too far apart for the model's fastest time constant"


@dataclass(frozen=True)
class Contradiction:
    """A test of innovations that contradicts the bands of an estimator."""

    test: str  # "variance", "mean" or "whiteness"
    signal: str  # output whose innovations say so; empty for all together
    # variance of innovations over what the method says [1]; error of the output that stays, in
    # standard deviations of its estimate [1]; covariance of its errors in samples that follow each
    # other, over the variance that the method says [1]
    value: float
    narrow: bool  # whether bands are too narrow by it, else too wide
    reason: str = ""  # the likely one

    @property
    def excess(self) -> float:
        """Variance of errors over that which the method says [1]."""
        return {"mean": 1.0 + self.value**2, "whiteness": max(1.0 + self.value, 0.0)}.get(
            self.test, self.value
        )

    @property
    def useless(self) -> bool:
        """Whether 95 % bands miss more often than they hold."""
        return self.excess > _USELESS

    def __str__(self) -> str:
        if self.test == "variance":
            return f"innovations have {self.value:.1f} times the variance that it says"
        of = f"innovations of {self.signal}"
        if self.test == "mean":
            return f"{of} have a mean, of {abs(self.value):.1f} standard deviations of its estimate"
        way = "follow each other" if self.narrow else "turn from sample to sample"
        return f"{of} {way}: what they share is {self.value:.1f} times the variance that it says"


def tested_window(case: Case, system: System) -> slice:
    """Samples whose innovations are tested: those that are judged, all where none is.

    Without the first, which has no innovation.
    """
    window = judged_window(case, system)
    first, last = (window.start, window.stop) if window.stop > window.start else (0, case.time.size)
    return slice(max(first, 1), last)


def normalised_innovations(
    case: Case, run: Run, system: System, window: slice | None = None
) -> tuple[Vector, Vector]:
    """Normalised innovations squared of a run, (k,), and of how many outputs each is, (k,)."""
    window = tested_window(case, system) if window is None else window
    fed = [signal in run.columns for signal in (*case.outputs, *case.aids)]
    counts = np.isfinite(case.y[window][:, fed]).sum(axis=1)
    known = np.isfinite(run.nis[window]) & (counts > 0) & (run.ending is Ending.OK)
    return run.nis[window][known], counts[known]


def contradictions(case: Case, run: Run, system: System, known: str = "") -> list[Contradiction]:
    """Tests that contradict the bands of a run where it is judged, with likely reasons.

    Parameters
    ----------
    known : reason for bands that are too narrow, where the recording shows one by itself.
    """
    window = tested_window(case, system)
    results = _tests(case, run, system, window)
    if not results:
        return []
    later = _tests(case, run, system, slice((window.start + window.stop) // 2, window.stop))
    lasts = {test.narrow for test in later}
    follows = any(test.test == "whiteness" for test in results)
    return [
        replace(test, reason=likely_reason(test, known, test.narrow in lasts, follows))
        for test in results
    ]


def likely_reason(test: Contradiction, known: str, lasts: bool, follows: bool) -> str:
    """Why bands do not hold, most likely.

    Parameters
    ----------
    known : reason that the recording shows by itself; empty for none.
    lasts : whether later samples contradict the bands, too.
    follows : whether innovations follow from one sample to the next.
    """
    if known and test.narrow:
        return known
    if not lasts and test.narrow:
        return "the start is farther off than it is said to be: later samples contradict nothing"
    if not test.narrow:
        return (
            "walks are smaller than the system file says"
            if test.test == "whiteness"
            else "noise or walks are smaller than the system file says"
        )
    if test.test == "mean":
        return "the model lacks something that stays, or a sensor is off"
    if test.test == "whiteness" or follows:
        return (
            "the model lacks something, or what is estimated moves faster than its walk in the "
            "system file"
        )
    return "the noise of the sensors is larger than the system file says"


def _tests(case: Case, run: Run, system: System, window: slice) -> list[Contradiction]:
    """All tests on a piece of a run; none for a method without bands."""
    nis, counts = normalised_innovations(case, run, system, window)
    if not nis.size:
        return []
    fed = [name for name in (*case.outputs, *case.aids) if name in run.columns]
    estimator = estimators_of(system).get(run.estimator)
    if estimator is not None and estimator.offline:  # residuals of samples that it has seen before
        fed = []
    residuals = {name: (case[name] - run.signal(name))[window] for name in fed}
    deviations = {name: run.deviation(name)[window] for name in fed}
    return variance_test(nis, counts) + residual_tests(residuals, deviations)


def variance_test(nis: Vector, counts: Vector) -> list[Contradiction]:
    """Compare the normalised innovations squared, (n,), with chi-squared of so many outputs, (n,).

    Contradicted where chance makes such a sum once in a thousand recordings, and its mean is such
    that a 95 % band would cover less than 93 % or more than 97 %.
    """
    total, degrees = float(nis.sum()), float(counts.sum())
    if not degrees:
        return []
    ratio = total / degrees
    # Of two sides, each half of the chance.
    if ratio > NARROW and chdtrc(degrees, total) < 0.5 * _CHANCE:
        return [Contradiction("variance", "", ratio, True)]
    if ratio < WIDE and chdtr(degrees, total) < 0.5 * _CHANCE:
        return [Contradiction("variance", "", ratio, False)]
    return []


def residual_tests(
    residuals: Mapping[str, Vector], deviations: Mapping[str, Vector]
) -> list[Contradiction]:
    """Test residuals of each output for a mean and for what follows from one sample to another.

    Both tests norm by the residuals themselves, so that what the noise is called does not matter,
    nor that it changes: the mean by Student's ratio, whiteness by the portmanteau test of Box and
    Ljung in the form that allows for changing variances. Source: I. N. Lobato, J. C. Nankervis,
    N. E. Savin (2001), J. Business & Economic Statistics 19, 198-205.

    Contradicted where chance makes one of the tests so large once in a thousand recordings, and
    bands that hold 95 % by what the method says would cover less than 93 %, or more than 97 %.

    Parameters
    ----------
    residuals : (n,) by output, measured less estimated; NaN where not measured.
    deviations : (n,) by output, standard deviations of the estimate.
    """
    contradictions: list[Contradiction] = []
    chance = _CHANCE / max(2 * len(residuals), 1)  # of one of so many tests
    for name, values in residuals.items():
        known = np.isfinite(values) & np.isfinite(deviations[name])
        count = int(known.sum())
        if count <= 2 * _LAGS:
            continue
        r, variance = np.where(known, values, 0.0), float(np.mean(deviations[name][known] ** 2))
        scatter = float(r @ r)
        if not scatter > 0.0 or not variance > 0.0:
            continue  # taken as measured
        off = float(r.sum()) / count / np.sqrt(variance)
        if abs(off) > _OFF and 2.0 * ndtr(-abs(r.sum()) / np.sqrt(scatter)) < chance:
            contradictions.append(Contradiction("mean", name, off, True))
        r = np.where(known, r - r.sum() / count, 0.0)
        lags = range(1, _LAGS + 1)
        products = [r[lag:] * r[:-lag] for lag in lags]
        pairs = [max(int((known[lag:] & known[:-lag]).sum()), 1) for lag in lags]
        norms = np.array([max(float(p @ p), np.finfo(float).tiny) for p in products])
        sums = np.array([p.sum() for p in products])
        statistic = float(np.sum(sums**2 / norms * (count + 2) / (count - np.array(lags))))
        shared = (sums / pairs / variance)[np.argmax(np.abs(sums) / pairs)]
        large = shared > NARROW - 1.0 or shared < WIDE - 1.0
        if large and chdtrc(_LAGS, statistic) < chance:
            contradictions.append(
                Contradiction("whiteness", name, float(shared), bool(shared > 0.0))
            )
    return contradictions


def contradiction_lines(tested: Mapping[str, Mapping[str, Iterable[Contradiction]]]) -> list[str]:
    """What is said of bands that innovations contradict: by estimator, a sentence for each side."""
    cases: dict[tuple[str, bool], dict[str, Contradiction]] = {}
    for case, estimators in tested.items():
        for name, tests in estimators.items():
            for test in tests:
                worst = cases.setdefault((name, test.narrow), {})
                if case not in worst or _farther(test, worst[case]):
                    worst[case] = test
    lines = []
    for (name, narrow), worst in cases.items():
        case = next(iter(worst))
        for other, test in worst.items():
            case = other if _farther(test, worst[case]) else case
        count = f"{len(worst)} of {len(tested)} recordings, worst in {case}"
        lines.append(
            f"Bands of {name} are too {'narrow' if narrow else 'wide'} in "
            f"{count if len(tested) > 1 else case}: {worst[case]}. "
            f"Likely: {worst[case].reason}."
        )
    return lines


def _farther(test: Contradiction, other: Contradiction) -> bool:
    return test.excess > other.excess if test.narrow else test.excess < other.excess


def sampling_doubt(fmu: FMU, system: System, case: Case) -> tuple[str, str]:
    """Say why a Kalman filter errs between samples, in a sentence and as a reason; or nothing.

    It is run with some steps in place of each, between which nothing is measured. If its
    innovations then exceed what it says by less than half, that is why; or an input that is held
    otherwise, if they then do not.
    """
    case = case.part(_liveliest(case, system))
    estimator = ExtendedKalmanFilter.untuned(fmu, system)
    run = replay(case, estimator)
    excess = _excess(case, run, system)
    if not NARROW < excess < np.inf:
        return "", ""
    steps = estimator.run(*_finer(case, system))
    samples = slice(None, None, _FINE)
    nis = np.asarray(steps.nis)[samples]
    finer = replace(run, estimate=steps.values[samples], sigma=steps.sigma[samples], nis=nis)
    fine = _excess(case, finer, system)
    apart, after = f"samples {np.median(np.diff(case.time)):.3g} s apart", {}
    for signal in system.inputs:
        for held, other in signal.otherwise_held.items() if np.ptp(case[signal.name]) else ():
            inputs = tuple(other if s is signal else s for s in system.inputs)
            other_way = replace(system, inputs=inputs)
            again = replay(case, ExtendedKalmanFilter.untuned(fmu, other_way))
            after[signal.name, held] = _excess(case, again, other_way)
    (name, held), least = min(after.items(), key=lambda way: way[1], default=(("", ""), np.inf))
    if least < fine and least <= NARROW:
        return (
            f"{name} acts between {apart} as if it were held otherwise: with held = "
            f"{held} in [inputs.{name}], errors of a Kalman filter have {least:.1f} times "
            f"the variance that it says, and {excess:.1f} times without. Say how it acts"
        ), f"{name} is held otherwise between samples than the system file says"
    if fine - 1.0 >= 0.5 * (excess - 1.0):
        return "", ""
    rate = np.abs(np.linalg.eigvals(fmu.state_jacobian())).max(initial=0.0)
    fastest = ""
    # Longer ones show in no sample; of integrators there is none.
    if rate * np.ptp(case.time) > 1.0:
        fastest = f", whose fastest time constant is {1.0 / rate:.2g} s at their end"
    return (
        f"{apart} do not resolve the model{fastest}: with {_FINE} steps in place of each, errors "
        f"of a Kalman filter have {fine:.1f} times the variance that it says, and {excess:.1f} "
        "times without. Record more often"
    ), TOO_COARSE


def _excess(case: Case, run: Run, system: System) -> float:
    """Variance of a Kalman filter's errors over what it says, at least 1; infinite if it failed."""
    size = len(system.columns)
    estimate, sigma = run.estimate[:, :size], run.sigma[:, :size]
    if run.ending is not Ending.OK or not np.isfinite(estimate[-1]).any():
        return np.inf
    part = replace(run, columns=system.columns, estimate=estimate, sigma=sigma)
    tests = _tests(case, part, system, tested_window(case, system))
    return max((test.excess for test in tests if test.narrow), default=1.0)


def _liveliest(case: Case, system: System) -> slice:
    """The samples, as many as are looked at, in which outputs change most, over their noise."""
    if case.time.size <= _TELLING:
        return slice(0, case.time.size)
    noise = np.array([output.noise for output in system.outputs])
    changes = np.nansum((np.diff(case.y, axis=0) / np.where(noise > 0.0, noise, 1.0)) ** 2, axis=1)
    total = np.concatenate([[0.0], np.cumsum(changes)])
    first = int(np.argmax(total[_TELLING - 1 :] - total[: total.size - _TELLING + 1]))
    return slice(first, first + _TELLING)


def _finer(case: Case, system: System) -> tuple[Vector, Matrix, Matrix]:
    """Time [s], inputs, outputs with some steps in place of each; nothing is measured between."""
    share = np.tile(np.arange(1, _FINE + 1) / _FINE, case.time.size - 1)[:, None]
    before, after = (np.repeat(side, _FINE, axis=0) for side in (case.u[:-1], case.u[1:]))
    # A held input has its new value from the sample on, where the last of the steps ends.
    line = before + share * (after - before)
    between = np.where((system.holds > 0.0) & (share < 1.0), before, line)
    between = np.where(system.holds < 0.0, after, between)
    y = np.full((between.shape[0], case.y.shape[1]), np.nan)
    y[_FINE - 1 :: _FINE] = case.y[1:]
    steps = np.append(0.0, np.repeat(np.diff(case.time) / _FINE, _FINE))
    return np.cumsum(steps), np.vstack([case.u[:1], between]), np.vstack([case.y[:1], y])


def step_doubt(
    fmu: FMU, system: System, case: Case, run: Run, coarse: Sequence[str]
) -> tuple[float, str]:
    """Share of an open loop's error that one Euler step from sample to sample makes, in words, too.

    The open loop takes such steps where they are borne; estimators that have no others are named
    where they are not. A model with events is integrated otherwise.

    Parameters
    ----------
    run : of the open loop on the case.
    coarse : estimators with such steps.
    """
    if run.ending is not Ending.OK or not coarse:
        return 0.0, ""
    estimator = OpenLoop.untuned(fmu, system)
    estimator.set_conditions(case.conditions)
    fmu.begin_at(case.model_time)
    estimator.run(case.time, case.u, case.y)
    (step,) = estimator.steps
    if not step.accurate[0]:
        return 0.0, ""
    estimator.start(case.u[0], case.y[0])
    estimator.advance(np.zeros(1), case.u[:1], case.y[:1])
    step.allowed[:] = np.inf  # nothing ends Euler's steps
    values = estimator.advance(np.diff(case.time), case.u[1:], case.y[1:]).values
    share, sentence = 0.0, ""
    for output in system.outputs:
        column = list(system.columns).index(output.name)
        euler, measured = np.asarray(values)[:, column], case[output.name][1:]
        known = np.isfinite(measured)
        off = _rms(euler - run.estimate[1:, column])
        error = _rms((euler - measured)[known]) if known.any() else 0.0
        if off > _NOTED * output.noise_at_scale and off > max(_NOTED, share) * error > 0.0:
            share = min(off / error, 1.0)
            sentence = (
                f"{' and '.join(coarse)}: one step of first order from sample to sample "
                f"damps what swings: an open loop with it errs by {amount(off, output.unit)} rms "
                f"in {output.name}. Rely on open_loop and Kalman filters, or record more often"
            )
    return share, sentence


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def time_doubt(fmu: FMU, system: System, case: Case, path: Trajectory) -> str:
    """Say where samples and span of a recording are none for the model's time constants.

    From one sample to the next a twentieth is left of the slowest motion, or nothing moves by a
    twentieth of the fastest in all of it: another unit of the time, most likely.
    """
    inputs, moments = fmu.variables([s.name for s in system.inputs]), range(0, len(path.x), _APART)
    rates = []
    for k in moments:
        fmu.set_states(path.x[k])
        fmu.set(inputs, path.u[k, : len(system.inputs)])
        rates.append(np.abs(np.linalg.eigvals(fmu.state_jacobian())))
    step, span = float(np.median(np.diff(case.time))), float(case.time[-1] - case.time[0])
    slowest = float(np.min(rates, initial=np.inf))
    fastest = float(np.max(rates, initial=0.0))
    if np.isfinite(slowest) and step * slowest > _PASSED:
        return (
            f"samples {step:.3g} s apart show no motion of the model, whose slowest time constant "
            f"is {1.0 / slowest:.2g} s. Check the unit of the time, and sample_time"
        )
    if fastest > 0.0 and span * fastest < np.exp(-_PASSED):
        return (
            f"a recording of {span:.3g} s shows no motion of the model, whose fastest time "
            f"constant is {1.0 / fastest:.2g} s. Check the unit of the time"
        )
    return ""


def unit_doubt(fmu: FMU, system: System, case: Case) -> str:
    """Say which output is off the model by 1000 times, or the zeros of K and degC; or nothing.

    The model runs alone, from its own start, to y_m, (n,). In another unit, a y that is off it by
    much, is g(y), which leaves less than a quarter of the square of y_m; of temperatures, less than
    a quarter of what is between the zeros. Outputs with a start value are compared with that, see
    `recordings.plausibility`.
    """
    starts = {v.name: v.start for v in fmu.description.variables}
    known = {output.name: np.isfinite(case[output.name]) for output in system.outputs}
    compared = [
        output
        for output in system.outputs
        if starts.get(output.reading, "") is None and known[output.name].any()
    ]
    alone = OpenLoop.untuned(fmu, system)
    alone.set_conditions(case.conditions)
    fmu.begin_at(case.model_time)
    unmeasured = np.full_like(case.y, np.nan)
    try:
        alone.start(case.u[0], unmeasured[0])
        begins = fmu.get_typed(fmu.typed([output.reading for output in compared]))
        for output, begin in zip(tuple(compared), begins, strict=True):
            usual = float(np.median(case[output.name][known[output.name]]))
            near = abs(usual - begin) < 0.5 * _CELSIUS or output.unit != "K"
            if near and 0.03 * abs(begin) < abs(usual) < 30.0 * abs(begin):
                compared.remove(output)  # it begins in its unit: the model need not run
        values = alone.run(case.time, case.u, unmeasured).values if compared else unmeasured
    except FMUError:
        return ""
    for output in compared:
        column = np.asarray(values)[:, list(system.columns).index(output.name)]
        y, y_m = case[output.name][known[output.name]], column[known[output.name]]
        if not np.isfinite(y_m).all():
            continue
        off, most = _rms(y - y_m), 0.5 * _rms(y_m)
        others = [(1e3 * y, most, "0.001 times"), (1e-3 * y, most, "1000 times")]
        for zero, how in ((_CELSIUS, "below"), (-_CELSIUS, "above")):
            if output.unit == "K":
                others.append((y + zero, 0.25 * _CELSIUS, f"273.15 K {how}"))
        for other, limit, how in others:
            if _rms(other - y_m) < limit < 0.5 * off and off > 5.0 * output.noise_at_scale:
                return (
                    f"{output.name} is about {how} what the model says, which runs from "
                    f"{y_m.min():.4g} to {y_m.max():.4g} {output.unit} with these inputs, where "
                    f"{y.min():.4g} to {y.max():.4g} {output.unit} are recorded. Check the unit of "
                    "the column, and its scale in the system file"
                )
    return ""


def spread_doubt(fmu: FMU, system: System, case: Case) -> str:
    """What filters assume of the start of states whose size nothing says, in words.

    Of such a state no output shows the start, the model has neither a nominal value nor limits nor
    a start of more than 1, and `[states]` says nothing.
    """
    measured = {output.name: float(case[output.name][0]) for output in system.outputs}
    fmu.begin_at(case.model_time)
    fmu.start({})
    shown = shown_states(fmu, system, case.u[0], measured, measured.keys())
    variables = fmu.description.by_name
    assumed = [
        f"{name} by {rounded(spread)} {variables[name].unit or ''}".rstrip()
        for name, spread in zip(fmu.states, start_spreads(fmu, system), strict=True)
        if name not in {*measured, *shown, *system.spreads}
        and not variables[name].nominal
        and spread == 1.0
    ]
    if not assumed:
        return ""
    return (
        "nothing says how far from the model states may start; filters assume "
        f"{', '.join(assumed)} (a standard deviation). Say it in [states.NAME] spread, "
        "or as nominal value in the model"
    )


def start_doubt(fmu: FMU, system: System, case: Case) -> str:
    """Say which first sample contradicts the start of the model; empty if none does.

    Outputs that are states begin as they are measured. Of the others, what is not known of states
    and quantities, P, and the noise R of samples say how far they may be: C P C' + R.
    """
    others = [
        (output, float(case[output.name][0]))
        for output in system.outputs
        if output.name not in fmu.states and np.isfinite(case[output.name][0])
    ]
    if not others or not fmu.states:
        return ""
    estimator = OpenLoop.untuned(fmu, system)
    estimator.set_conditions(case.conditions)
    fmu.begin_at(case.model_time)
    estimator.start(case.u[0], case.y[0])
    inputs = [signal.name for signal in system.inputs]
    fmu.set(fmu.variables(inputs), case.u[0])
    outputs = fmu.variables([output.name for output, _ in others])
    by_states, by_quantities, by_inputs = (
        fmu.jacobian(outputs.references, fmu.variables(names))
        for names in (list(fmu.states), list(system.corrections), inputs)
    )
    measured = {output.name: output.noise_at_scale for output in system.outputs}
    known = [
        measured.get(name, spread)
        for name, spread in zip(fmu.states, start_spreads(fmu, system), strict=True)
    ]
    spreads = np.array([*known, *(quantity.spread for quantity in system.estimated)])
    spreads = np.append(spreads, [signal.noise_at_scale for signal in system.inputs])
    by_all = np.hstack([by_states, by_quantities, by_inputs]) * spreads
    says, reads = fmu.get(outputs).copy(), np.array([value for _, value in others])
    noise = np.array([output.deviation(value) for output, value in others])
    covariance = by_all @ by_all.T + np.diag(noise**2)
    off = reads - says
    if not off @ np.linalg.solve(covariance, off) > chdtri(off.size, _CHANCE):
        return ""
    deviations = np.sqrt(covariance.diagonal())
    worst = int(np.abs(off / deviations).argmax())
    output = others[worst][0]
    return (
        f"the first sample of {output.name} is {reads[worst]:.4g} {output.unit}, where the model "
        f"starts at {says[worst]:.4g} with a standard deviation of {deviations[worst]:.2g}. Check "
        "unit and zero of the column; or start the model elsewhere, by a condition that sets its "
        "parameters, or say in [states] spread how little is known of its start"
    )
