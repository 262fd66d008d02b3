"""What a system is made of: models, signals, quantities, and what counts."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.system.expression import Expression


@dataclass(frozen=True)
class Model:
    """Modelica class of a role, without its library, and its FMU; None: it is yet to be built."""

    name: str
    path: Path | None


@dataclass(frozen=True)
class Mode:
    """A structure between a quantity and the sensor that reads it: one mode of vibration.

    Attributes
    ----------
    frequency : [Hz].
    damping : ratio [1].
    late : standard deviation of a delay beyond that of the mode, by filters of an amplifier [s].
    """

    frequency: float
    damping: float
    late: float


@dataclass(frozen=True)
class Signal:
    """A measured signal.

    Attributes
    ----------
    name : in recordings and of the model's variable.
    unit : SI, of the model's variable and of all values.
    label : what it is, for people.
    shown : unit in figures.
    noise, relative_noise : standard deviation of one sample [unit], plus this share of its size;
        an input without noise is exactly known.
    relative_error : share of its size by which a filter lets it be wrong, beyond noise [1].
    scale : typical size [unit].
    scale_error : share by which its scale may be wrong, which gains must bear [1].
    reading : output of the model that says what the sensor reads, imperfections included.
    mode : between the quantity and its sensor, or None.
    smoothed : [s] windows of a parabola and of a line that take the noise from an input where it
        allows that, before it drives a model; empty: it is taken as it is.
    held : whether an input stays as it was sampled until the next sample; else it goes there.
    resolution : step in which it is read, 0 where that is not known [unit].
    limits : between which its sensor reads; what reaches them is saturated [unit].
    plausible, possible : least and largest sample that is likely, and that is possible [unit].
    called : names that recorders give it, beside its own and its label.
    recorded_as : what recorders have in its place, a formula of it; None: nothing else.
    """

    name: str
    unit: str
    label: str
    shown: str
    noise: float
    relative_noise: float
    relative_error: float
    scale: float
    scale_error: float
    reading: str
    mode: Mode | None
    smoothed: tuple[float, ...]
    held: bool
    resolution: float
    limits: tuple[float, float]
    plausible: tuple[float, float]
    possible: tuple[float, float]
    called: tuple[str, ...]
    recorded_as: "DerivedSignal | None"

    def deviation(self, values: Any) -> Any:
        """Standard deviation of samples of these values [unit]."""
        return self.noise + self.relative_noise * np.abs(values)

    @property
    def exact(self) -> bool:
        """Whether it is known without an error, as a command is."""
        return self.noise == 0.0 and self.relative_noise == 0.0 and self.resolution == 0.0

    @property
    def noise_at_scale(self) -> float:
        """Standard deviation of a sample of typical size [unit]."""
        return self.noise + self.relative_noise * self.scale


@dataclass(frozen=True)
class DerivedSignal:
    """A signal made of measured ones and of parameters.

    Attributes
    ----------
    formula : in SI units.
    """

    name: str
    unit: str
    label: str
    formula: Expression


@dataclass(frozen=True)
class EstimatedQuantity:
    """A quantity that observers estimate: a parameter of the model, which an input corrects.

    Attributes
    ----------
    name : of the parameter.
    correction : of the input that is added to it.
    label : what it is, for people.
    unit : SI.
    low, high : range that estimates are kept in [unit].
    prior : range before a measurement, of which any value is as likely [unit].
    walk : how fast it may move, random walk [unit/sqrt(s)].
    start : where filters begin, NaN: at its nominal value [unit].
    spread : standard deviation of what is known of it at the start [unit].
    relative_error : share of it by which the model lets an estimate be wrong [1].
    scatter : standard deviation from recording to recording, of a sound machine [unit].
    memory : time in which a deviation is forgotten [s].
    useful : standard deviation from which on an estimate serves [unit].
    acts_on : state whose rate shows its effect, or output that shows it at once; a correction is in
        proportion to that. Empty: none.
    claimed : conditions in which it may be claimed, by name; elsewhere it stands in for something
        that the model has not.
    watched : whether it is a quantity of the machine, which is followed over its recordings; else
        of a recording, which tells it only together with what is known before.
    """

    name: str
    correction: str
    label: str
    unit: str
    low: float
    high: float
    prior: tuple[float, float]
    walk: float
    start: float
    spread: float
    relative_error: float
    scatter: float
    memory: float
    useful: float
    acts_on: str
    claimed: Mapping[str, str]
    watched: bool


@dataclass(frozen=True)
class Threshold:
    """Where a signal is above or below a level, in absolute value [its unit]."""

    signal: str
    level: float


@dataclass(frozen=True)
class Tolerance:
    """By how much two values that tell the same may differ.

    Attributes
    ----------
    likely, possible : largest difference that is likely, and that is possible, as a share of the
        larger of the two [1].
    slack : difference that means nothing, and size of both below which they are not compared.
    """

    likely: float
    possible: float
    slack: float


@dataclass(frozen=True)
class RecordingSplit:
    """Which parts of a long recording are recordings of their own.

    Attributes
    ----------
    begins : where a signal rises above a level, while the other is above its own.
    ends : where the other falls below its level.
    released : time for which the first may be below its level before the part is given up [s].
    before, after : time that is kept around a part [s].
    """

    begins: Threshold
    ends: Threshold
    released: float
    before: float
    after: float


@dataclass(frozen=True)
class Store:
    """What a flow in and a flow out differ by is stored.

    Attributes
    ----------
    formula : what is stored [unit of the flows times s].
    over : time over which the flows are averaged [s].
    """

    formula: Expression
    over: float


@dataclass(frozen=True)
class Redundancy:
    """Two formulas of measured signals that agree while a third signal is small, or is large.

    Attributes
    ----------
    reason : why they agree, for people.
    unit : of both.
    store : what their difference is stored in; None: they agree in each sample.
    while_below, while_above : the signal and its level; None: always.
    """

    reason: str
    formula: Expression
    other: Expression
    unit: str
    tolerance: Tolerance
    store: Store | None
    while_below: Threshold | None
    while_above: Threshold | None


@dataclass(frozen=True)
class Sampling:
    """Times between samples [s]; infinite where nothing is known of them.

    Attributes
    ----------
    slowest : up to which estimates are what they are at usual rates.
    gap, largest_gap : longest that is likely, and that is possible, in one recording.
    """

    slowest: float
    gap: float
    largest_gap: float


@dataclass(frozen=True)
class FeedbackFading:
    """Feedback fades out where a signal is small against `half`, at which half is left [unit]."""

    signal: str
    half: float


@dataclass(frozen=True)
class RollingStates:
    """Two states in a fixed ratio while an output is zero, which saturates: one follows the other.

    Attributes
    ----------
    follower, leader : states.
    zero : output of the model that is zero while the follower rolls along.
    """

    follower: str
    leader: str
    zero: str


@dataclass(frozen=True)
class OperatingPoint:
    """Where a model is linearised: inputs given, some states held, all others at rest.

    Attributes
    ----------
    inputs : by name [SI]; others are zero.
    held : formulas of states, in parameters of the model.
    quantities : estimated quantities that are not nominal, by name.
    """

    inputs: Mapping[str, float]
    held: Mapping[str, Expression]
    quantities: Mapping[str, float]


@dataclass(frozen=True)
class Objective:
    """By what estimators are judged and tuned.

    Attributes
    ----------
    signal : whose error counts.
    weights : of the mean absolute deviation by signal [1/unit].
    bandwidth : below which deviations count [Hz].
    begins, ends : of the time that is judged: from the first sample above to the last one above.
    when : what that time is, for people.
    """

    signal: str
    weights: Mapping[str, float]
    bandwidth: float
    begins: Threshold | None
    ends: Threshold | None
    when: str


@dataclass(frozen=True)
class StepTracking:
    """What tuned gains must do: find a step of a quantity within a time, but for a share."""

    quantity: str
    within: float
    left: float


@dataclass(frozen=True)
class View:
    """What one panel of a figure shows: measured or estimated signals on one axis.

    Attributes
    ----------
    title, note : before and after the unit.
    low, high : of the axis in the shown unit; None: what the signals need.
    """

    title: str
    note: str
    signals: tuple[str, ...]
    height: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Export:
    """Estimators that the library has as Modelica classes, for FMUs that run without Python.

    Attributes
    ----------
    classes : by estimator, without the library's name.
    start : of the reference model, beside which a package sets them.
    """

    classes: Mapping[str, str]
    start: OperatingPoint


FIRST, LARGEST = "first", "largest"  # of the values along a recording


@dataclass(frozen=True)
class Agreement:
    """What a recording says of a condition.

    Attributes
    ----------
    formula : of measured signals, in the unit of the condition.
    place : FIRST or LARGEST, which of its values tells the condition.
    """

    formula: Expression
    place: str
    tolerance: Tolerance


@dataclass(frozen=True)
class Condition:
    """What was set before a recording, and what it means.

    Attributes
    ----------
    unit : SI of a quantity; empty for a word or a whole number.
    least : smallest quantity; `exclusive`: above it.
    choices : words or whole numbers that it may be.
    count : of entries, where it is a list; 0: no list.
    sets : parameter of the model that a quantity is, and that is as usual where nobody says;
        empty: none.
    parameters : of the model by choice, which it sets.
    told : whether estimators are told what it sets.
    lasts : mean time until another choice takes its place, under way; infinite: never [s].
    sign : whether it is the sign of the recording's signals.
    label : for people.
    agrees : what the recording says of it, or None.
    """

    name: str
    label: str
    unit: str
    least: float
    exclusive: bool
    choices: tuple[str | int, ...]
    count: int
    sets: str
    parameters: Mapping[str, Mapping[str, float]]
    told: bool
    lasts: float
    sign: bool
    agrees: Agreement | None

    def means(self, said: object) -> Mapping[str, float]:
        """Parameters of the model that it sets where it is this, SI; none where nobody knows."""
        if self.sets and isinstance(said, float):
            return {self.sets: said}
        return self.parameters.get(str(said), {})
