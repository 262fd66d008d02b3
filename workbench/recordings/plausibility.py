"""Whether a recording can be what it says it is.

What is impossible is refused, what is unlikely becomes a doubt, and both say where. What can be
told of a machine stands in its system file: ranges, redundancies, conditions that the record shows,
and times between samples.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.description import Variable, read_description
from workbench.system.parts import FIRST, Condition, Redundancy, Signal
from workbench.system.system import OBSERVER, System
from workbench.system.units import si_factor

_FEW = 5  # samples that tell a value, whatever one or two of them read
_REPEATED = 0.2  # share of repeated samples from which on a signal is not noisy enough to tell
_FINE = 4.0  # steps of a signal in the standard deviation of its noise
_BY_CHANCE = 1e-3  # runs that noise alone makes in a recording
_BESIDE, _ALONE = 10, 3.0  # samples on each side, and times those that one among them stands out
_JUDGED = 50  # samples that say how a signal moves
_SHORT = 10  # samples that a loose contact or a lost word takes; machines that move so are slower
# Standard deviations that no noise reaches out and back, see `Soundness.spike` of a diagnosis.
_BEYOND = 8.0
_CONTRADICTS = 300.0  # times the usual step: the unit of the time is another one
_SET_ANEW = 100  # times all other steps together: the clock was set, or it is another recording
_TEN_YEARS = 3.15e8  # s, over which nobody records without a sample
_OTHER_UNITS = 60.0, 3600.0  # minutes and hours that are taken for seconds
_CELSIUS = 273.15  # K
_ALIKE = 0.05  # share by which a machine at its usual start is off that of its model
_ROUNDED = 1.0 + 1e-6  # times are written with some digits


@dataclass(frozen=True)
class Origin:
    """Where a recording stands."""

    name: str  # of the file or the table
    first_line: int | None  # of the first sample in a file, None without one
    columns: Mapping[str, str]  # name of each signal's column, and of "time"
    conditions: str  # where the conditions stand
    doubts: tuple[str, ...] = ()  # what its reader doubts already, in words

    def at(self, sample: int, signal: str) -> str:
        """Place of a sample."""
        line = f", line {sample + self.first_line}" if self.first_line is not None else ""
        return f"{self.name}{line}, column '{self.columns.get(signal, signal)}'"


@dataclass(frozen=True)
class _Finding:
    """Something that is unlikely, or impossible."""

    impossible: bool
    where: str
    found: str
    expected: str
    remedy: str

    def refusal(self) -> InputError:
        return InputError(
            where=self.where, found=self.found, expected=self.expected, remedy=self.remedy
        )


def doubts(
    time: Vector,
    signals: Mapping[str, Vector],
    conditions: Mapping[str, Any],
    system: System,
    origin: Origin,
) -> tuple[str, ...]:
    """What is unlikely in a recording, in words.

    Parameters
    ----------
    time : (n,) s, increasing.
    signals : (n,) each, SI.
    conditions : by name, SI.

    Raises
    ------
    InputError
        At what is impossible.
    """
    system = system.under(conditions)
    findings = list(_ranges(time, signals, system, origin))
    _refuse(findings)  # what is out of range has no use in formulas
    with np.errstate(all="ignore"):  # a formula may divide by a signal at rest
        for check in (
            _still(signals, system, origin),
            _sampling(time, system, origin),
            _redundancies(time, signals, system, origin),
            _conditions(signals, conditions, system, origin),
        ):
            findings += check
    _refuse(findings)
    # What contradicts a redundancy or a range is asked about once.
    findings = (
        findings
        or list(_jumps(time, signals, system, origin))
        or list(_sizes(signals, system, origin))
    )
    findings += _unfed(system)
    return (*origin.doubts, *(str(finding.refusal()) for finding in findings))


def _refuse(findings: list[_Finding]) -> None:
    for finding in findings:
        if finding.impossible:
            raise finding.refusal()


def _ranges(
    time: Vector, signals: Mapping[str, Vector], system: System, origin: Origin
) -> Iterator[_Finding]:
    """Samples out of their ranges; the first of each signal and range."""
    for name, values in signals.items():
        signal = system.signals[name]
        for impossible, (low, high) in ((True, signal.possible), (False, signal.plausible)):
            outside = np.flatnonzero((values < low) | (values > high))
            if not outside.size:
                continue
            first = int(outside[0])
            many = f", and {outside.size - 1} more such samples" if outside.size > 1 else ""
            limits = f"from {_value_text(signal, low)} to {_value_text(signal, high)}"
            yield _Finding(
                impossible,
                origin.at(first, name),
                f"{_value_text(signal, values[first])} at {time[first]:.9g} s{many}",
                f"what {'is possible' if impossible else 'is likely'}, {limits}",
                f"correct the values or the unit of the column; if they are right, widen "
                f"'{'possible' if impossible else 'plausible'}' of {name} in {system.source}",
            )
            break  # what is impossible is unlikely too


def _described(system: System) -> Sequence[Variable]:
    """Variables of the observer's model, by the system's names."""
    try:
        path = system.model(OBSERVER).path
        return [] if path is None else read_description(path).renamed(system.names).variables
    except (InputError, KeyError):  # whoever opens the model says what is wrong with it
        return []


def _unfed(system: System) -> Iterator[_Finding]:
    """Inputs of the observer's model that nothing feeds, and that do not rest at zero."""
    fed = {*system.signals, *system.corrections}
    for variable in _described(system):
        own = variable.causality == "input" and variable.name not in fed
        if not own or variable.array or variable.type == "Boolean":
            continue
        if variable.holds_number and (start := float(variable.start or 0.0)):
            theirs = system.names.get(variable.name, variable.name)
            yield _Finding(
                False,
                f"{system.source}, input '{theirs}' of the FMU",
                f"no signal that feeds it, so that it keeps {start:.6g}",
                "a recorded signal for each input of the FMU, unless it is constant",
                f"add [inputs.{theirs}], or go on if the value is right in these recordings",
            )


def _sizes(signals: Mapping[str, Vector], system: System, origin: Origin) -> Iterator[_Finding]:
    """Signals of a size, or with a first value, that another unit of the column would explain.

    Against `scale`, and against limits and start of the variable in the observer's model.
    """
    variables = {variable.name: variable for variable in _described(system)}
    for signal in (*system.inputs, *system.outputs):
        values = signals.get(signal.name, np.zeros(0))
        values = values[np.isfinite(values)]
        if not values.size or signal.scale <= 0.0:
            continue
        noise = 5.0 * float(signal.deviation(np.abs(values).max()))
        size = float(
            np.sort(np.abs(values))[-min(_FEW, values.size)]
        )  # whatever single samples are
        moves = float(np.median(np.abs(np.diff(values)))) if values.size > 1 else 0.0
        # Of a signal at rest the noise is left; in another unit, that is smaller too.
        faint = 0.0 < size < signal.scale / _CONTRADICTS and moves < signal.noise / _CONTRADICTS
        variable = variables.get(signal.name)
        finding = None
        if variable is not None and variable.holds_number:
            low, high = variable.limits
            outside = np.flatnonzero((values < low - noise) | (values > high + noise))
            begins = float(np.median(values[:_FEW]))
            known = variable.start is not None and variable.type != "Boolean"
            start = float(variable.start or 0.0) if known else np.nan
            unset = variable.causality == "input" and start == 0.0
            if not unset and (factor := _other_unit(begins, start, signal)):
                finding = (
                    f"{_value_text(signal, begins)} at the start, {factor} that of the model",
                    f"about {_value_text(signal, start)}",
                )
            elif outside.size >= _FEW:
                finding = (
                    f"{_value_text(signal, values[outside[0]])}, and {outside.size - 1} more such "
                    "samples",
                    f"what the model allows, from {_value_text(signal, low)} to "
                    f"{_value_text(signal, high)}",
                )
        if finding is None and (size > _CONTRADICTS * signal.scale or faint):
            finding = (
                f"values up to {_value_text(signal, size)}",
                f"values of the size of {_value_text(signal, signal.scale)}, as 'scale' of "
                f"{signal.name} says in {system.source}",
            )
        if finding is not None:
            yield _Finding(
                False,
                origin.at(0, signal.name),
                *finding,
                "check the unit of the column, and what it holds",
            )


def _other_unit(begins: float, expected: float, signal: Signal) -> str:
    """By what a first value is off the model's start, if another unit explains it; else empty."""
    if signal.unit == "K":
        for offset in (_CELSIUS, -_CELSIUS):
            # Nearer than a machine may be off by what is between the two zeros.
            if abs(begins + offset - expected) < 0.25 * _CELSIUS < 0.5 * abs(begins - expected):
                return f"{abs(offset)} K {'below' if offset > 0.0 else 'above'}"
    ratio = begins / expected if expected else 0.0
    for factor in (1e3, 1e5, *_OTHER_UNITS):
        for times in (factor, 1.0 / factor):
            if abs(ratio / times - 1.0) < _ALIKE:
                return f"{times:.4g} times"
    return ""


def _value_text(signal: Signal, value: float) -> str:
    """A value in the unit that people read."""
    return f"{value / si_factor(signal.shown, signal.unit, signal.name):.6g} {signal.shown}"


def _still(signals: Mapping[str, Vector], system: System, origin: Origin) -> Iterator[_Finding]:
    """Signals that never change although their noise alone would move them."""
    outputs = [output.name for output in system.outputs]
    for name, values in signals.items():
        signal = system.signals[name]
        values = values[np.isfinite(values)]  # an aid is missing elsewhere
        if signal.exact or not values.size or values.min() < values.max():
            continue
        yield _Finding(
            # Steps coarser than noise may hide it; an input may rest.
            name in outputs and signal.resolution <= signal.noise,
            origin.at(0, name),
            f"{_value_text(signal, values[0])} in all {values.size} samples",
            f"readings that scatter by {_value_text(signal, signal.deviation(values[0]))}, as the "
            "sensor's noise does",
            "check the sensor, and what its column holds",
        )


def _jumps(
    time: Vector, signals: Mapping[str, Vector], system: System, origin: Origin
) -> Iterator[_Finding]:
    """Samples, and runs of equal ones, that leave what is beside them and come back at once.

    Motion that does so again and again is the machine's: against what 99 of 100 samples do. A run
    of a noisy signal that is too long for chance is told, too, but for a sensor at rest or at an
    end of its range.
    """
    for name, values in signals.items():
        signal = system.signals[name]
        known = np.flatnonzero(np.isfinite(values))
        if signal.exact or known.size < _JUDGED:
            continue
        starts = np.flatnonzero(np.diff(values[known], prepend=np.inf))
        if starts.size < _JUDGED:
            continue
        read, lengths = values[known[starts]], np.diff(starts, append=known.size)
        before, after = read[1:-1] - read[:-2], read[1:-1] - read[2:]
        away = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
        noise = float(signal.deviation(np.median(np.abs(read))))
        limit = _BEYOND * max(noise, float(np.quantile(away, 0.99)))
        # A structure that rings at the end of a stop does so in several samples on end.
        padded, others = np.pad(away, _BESIDE), np.zeros(away.size)
        for shift in (*range(_BESIDE), *range(_BESIDE + 1, 2 * _BESIDE + 1)):
            np.maximum(others, padded[shift : shift + away.size], out=others)
        wrong = np.zeros(read.size, np.bool_)
        wrong[1:-1] = (away > limit) & (away > _ALONE * others)
        # Where a machine turns, its slopes lead to a peak; a wrong sample is off them as well.
        outwards = np.sign(before)
        wrong[2:-1] &= outwards[1:] * (before[1:] - before[:-1]) > limit
        wrong[1:-2] &= outwards[:-1] * (after[:-1] - after[1:]) > limit
        if any(output.name == name for output in system.outputs):  # an input may be a short pulse
            wrong |= _excursions(read, noise)
        # Of n samples that repeat with a chance p, n p^(k - 1) runs of k are expected.
        repeats = known.size - read.size - (lengths.max() - 1)
        chance = max(repeats, 1) / known.size
        step = np.abs(np.diff(read)).min()
        # Where steps are coarse, samples repeat as soon as the noise is less for a while.
        if chance < _REPEATED and max(signal.resolution, step) < noise / _FINE:
            shortest = 1.0 + np.log(_BY_CHANCE / known.size) / np.log(chance)
            inside = (read > read.min()) & (read < read.max()) & (read != 0.0)
            wrong |= (lengths > max(shortest, _JUDGED)) & inside
        if not wrong.any():
            continue
        first = int(np.flatnonzero(wrong)[0])
        sample = int(known[starts[first]])
        yield _Finding(
            False,
            origin.at(sample, name),
            f"{_value_text(signal, read[first])} at {time[sample]:.9g} s, beside "
            f"{_value_text(signal, read[first - 1 if first else 1])}, and "
            f"{int(lengths[wrong].sum()) - 1} more such samples",
            f"what noise and motion do, {_value_text(signal, limit)} out and back at most, and "
            f"no {_JUDGED} equal samples",
            "check the sensor; a diagnosis sets such samples aside, estimators do not",
        )


def _excursions(read: Vector, noise: float) -> NDArray[np.bool_]:
    """Samples between two steps, out and back, or before a first one or after a last, (n,).

    Both steps stand out of what the signal does beside them, and of 99 of 100 steps.
    """
    steps = np.abs(np.diff(read))
    large = np.flatnonzero(steps > _BEYOND * max(noise, float(np.quantile(steps, 0.99))))
    wrong = np.zeros(read.size, np.bool_)
    for out, back in pairwise([-1, *large, steps.size]):
        edges = [edge for edge in (out, back) if 0 <= edge < steps.size]
        rises = np.sign(read[np.array(edges, int) + 1] - read[edges])
        if back - out > (_SHORT if len(edges) == 2 else 1) or rises.sum() * (len(edges) - 1):
            continue
        beside = np.arange(max(edges[0] - _BESIDE, 0), min(edges[-1] + _BESIDE + 1, steps.size))
        others = steps[np.setdiff1d(beside, edges)].max()
        wrong[out + 1 : back + 1] = steps[edges].min() > _ALONE * others
    return wrong


def _sampling(time: Vector, system: System, origin: Origin) -> Iterator[_Finding]:
    """Too few samples in a second, or a gap between two of them."""
    steps, limits = np.diff(time), system.sampling
    usual, longest = float(np.median(steps)), int(steps.argmax())
    where = origin.at(longest + 1, "time")
    if steps[longest] > limits.gap and steps[longest] > 2.0 * usual:
        yield _Finding(
            bool(steps[longest] > limits.largest_gap),
            where,
            f"a gap of {steps[longest]:.6g} s after {time[longest]:.9g} s",
            f"samples of one recording, no more than {limits.gap:g} s apart",
            "write a case folder for each recording, if several stand in one file",
        )
    elif steps[longest] > _SET_ANEW * (time[-1] - time[0] - steps[longest]):
        yield _Finding(
            bool(steps[longest] > _TEN_YEARS),
            where,
            f"a gap of {steps[longest]:.6g} s after {time[longest]:.9g} s, more than {_SET_ANEW} "
            "times all other steps together",
            "samples of one clock, which was not set in between",
            "remove the samples before it, or give each part as a file of its own",
        )
    ratio = usual / system.sample_time
    if ratio > _CONTRADICTS or any(abs(ratio * 1e3**k - 1.0) < 0.2 for k in (1, 2, 3)):
        yield _Finding(
            True,
            origin.at(1, "time"),
            f"a sample every {usual:.6g} s, {ratio:.4g} times as far apart as in usual recordings",
            f"times in seconds, about {system.sample_time:g} s apart",
            f"correct the unit of the time; if it is right, correct sample_time in {system.source}",
        )
    elif any(abs(ratio * factor - 1.0) < 1e-3 for factor in _OTHER_UNITS):
        yield _Finding(
            False,
            origin.at(1, "time"),
            f"a sample every {usual:.6g} s, 1/{1.0 / ratio:.4g} of what is usual",
            f"times in seconds, about {system.sample_time:g} s apart",
            "correct the unit of the time, if it is minutes or hours",
        )
    elif usual > limits.slowest * _ROUNDED:
        yield _Finding(
            False,
            origin.at(1, "time"),
            f"a sample every {usual:.6g} s",
            f"one every {limits.slowest:g} s or more often; estimates are worse without",
            "record at a higher rate",
        )


def _redundancies(
    time: Vector, signals: Mapping[str, Vector], system: System, origin: Origin
) -> Iterator[_Finding]:
    """Signals that contradict each other while they ought to agree."""
    named: set[str] = set()  # of several that tell the same of one, the first
    for redundancy in system.redundancies:
        limits = redundancy.while_below, redundancy.while_above
        names = _compared_names(redundancy) | {limit.signal for limit in limits if limit}
        if redundancy.formula.text in named or not _has(names, signals, system):
            continue
        left, right = _sides(redundancy, time, signals, system)
        large = np.maximum(np.abs(left), np.abs(right))
        compared = large > redundancy.tolerance.slack
        for limit, side in zip(limits, (-1.0, 1.0), strict=True):
            if limit is not None:
                size = np.abs(system.signal(limit.signal, signals))
                compared &= side * size > side * limit.level
        chosen = np.flatnonzero(compared)
        if chosen.size < _FEW:
            continue
        shares = np.abs(left - right)[chosen] / large[chosen]
        share = float(np.median(shares))  # whatever single samples read
        if not share > redundancy.tolerance.likely:
            continue
        named.add(redundancy.formula.text)
        first = int(chosen[shares > redundancy.tolerance.likely][0])
        columns = [name for name in signals if name in _compared_names(redundancy)]
        told_by = [
            name for name in columns if redundancy.store is None or name in redundancy.formula.names
        ]
        where = f"at {time[first]:.9g} s"
        other = redundancy.other.text
        if redundancy.store is not None:
            other = f"{other}, with what {redundancy.store.formula.text} gains,"
            where = f"in the mean of {redundancy.store.over:g} s from {time[first]:.9g} s on"
        yield _Finding(
            share > redundancy.tolerance.possible,
            origin.at(first, told_by[-1] if told_by else "time"),
            f"{redundancy.formula.text} = {left[first]:.6g} {redundancy.unit} beside {other} = "
            f"{right[first]:.6g} {redundancy.unit} {where}, and by {share:.0%} apart in "
            f"half of {chosen.size} samples",
            f"the same within {redundancy.tolerance.likely:.0%}: {redundancy.reason}",
            f"check units, signs and columns of {', '.join(columns)}",
        )


def _compared_names(redundancy: Redundancy) -> Set[str]:
    """Names in the formulas that are compared."""
    stored: Set[str] = (
        redundancy.store.formula.names if redundancy.store is not None else frozenset()
    )
    return redundancy.formula.names | redundancy.other.names | stored


def _sides(
    redundancy: Redundancy, time: Vector, signals: Mapping[str, Vector], system: System
) -> tuple[Vector, Vector]:
    """Both sides of a redundancy from each sample on, (n,) each; NaN beyond the end."""
    left, right = (
        system.evaluate(formula, signals) for formula in (redundancy.formula, redundancy.other)
    )
    if redundancy.store is None:
        return left, right
    over = redundancy.store.over
    end = time + over

    def gained(values: Vector) -> Vector:
        later: Vector = np.interp(end, time, values, right=np.nan)
        return (later - values) / over

    def mean(values: Vector) -> Vector:
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
        return gained(np.append(0.0, np.cumsum(steps)))

    return mean(left), mean(right) + gained(system.evaluate(redundancy.store.formula, signals))


def _has(names: Set[str], signals: Mapping[str, Vector], system: System) -> bool:
    """Whether a recording has all of some signals; what only judges may be missing."""
    for signal in reversed(system.derived):  # each is made of those before it
        names |= signal.formula.names if signal.name in names else set()
    return not names & (system.signals.keys() - signals.keys())


def _conditions(
    signals: Mapping[str, Vector], conditions: Mapping[str, Any], system: System, origin: Origin
) -> Iterator[_Finding]:
    """Conditions that the record contradicts."""
    for condition in system.conditions:
        shown = shown_by(condition, signals, system)
        if (
            condition.agrees is None
            or shown is None
            or isinstance(conditions.get(condition.name, ""), str)
        ):
            continue  # nobody says it, or knows it any more
        at_start = condition.agrees.place == FIRST
        values = system.evaluate(condition.agrees.formula, signals)
        sample = 0 if at_start else int(np.argsort(values)[-min(_FEW, values.size)])
        stated = float(conditions[condition.name])
        tolerance, difference = condition.agrees.tolerance, abs(shown - stated)
        share = difference / max(abs(shown), abs(stated)) if difference > tolerance.slack else 0.0
        if not share > tolerance.likely:
            continue
        names = [name for name in signals if name in condition.agrees.formula.names]
        where = origin.at(sample, names[0]) if names else origin.name
        yield _Finding(
            share > condition.agrees.tolerance.possible,
            f"{origin.conditions} {condition.name}",
            f"{_condition_text(condition, stated)} where the record has "
            f"{condition.agrees.formula.text} = "
            f"{_condition_text(condition, shown)} "
            f"({where}{', at the start' if at_start else ', its largest'})",
            f"the same within {condition.agrees.tolerance.likely:.0%}",
            "correct the condition, or the unit or the sign of the column",
        )


def shown_by(condition: Condition, signals: Mapping[str, Vector], system: System) -> float | None:
    """What a recording shows of a condition [its unit]; None if it shows nothing.

    At the start this is the median of some samples; the largest value is one that is reached more
    than once.
    """
    if condition.agrees is None or not _has(condition.agrees.formula.names, signals, system):
        return None
    with np.errstate(all="ignore"):  # a formula may divide by a signal at rest
        values = system.evaluate(condition.agrees.formula, signals)
    few = min(_FEW, values.size)
    return float(
        np.median(values[:few]) if condition.agrees.place == FIRST else np.sort(values)[-few]
    )


def _condition_text(condition: Condition, value: float) -> str:
    return f"{value:.6g} {condition.unit}".rstrip()
