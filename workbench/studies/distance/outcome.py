"""The distance of a stop as a value: sentences, numbers, tables, a figure."""

import math
from dataclasses import asdict, dataclass
from html import escape
from typing import TYPE_CHECKING, Any, Self
from warnings import warn

import numpy as np

from workbench.arrays import Vector
from workbench.pages.figures import LIGHT, styled
from workbench.studies.distance.forecast import stopping_of
from workbench.studies.distance.rare_events import PlainSampling, Tail, plain_runs
from workbench.studies.distance.recorded import RecordedStop, Stop
from workbench.studies.distance.standard import (
    NominalRate,
    StopConditions,
    equivalent_rate,
    nominal_rate,
    percentage,
    stopping_distance,
)
from workbench.system.stopping import SPEED, AskedQuantity
from workbench.system.system import System
from workbench.system.units import si_factor

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)
_BAND = 0.95
MOST_NAMED = 60  # past stops that have names below the figure
_SEEN = 0.1  # share of the range of past stops by which one may be beyond it, and is near


@dataclass(frozen=True, eq=False)
class Forecast:
    """Distribution of a distance."""

    distances: Vector  # (n,) drawn, least first [m]
    certain: Vector  # (n,) the same if the machine and its model were known [m]
    outside: float  # share outside the validity range of the model

    def quantile(self, share: float) -> float:
        """Distance that so many stops do not exceed [m]."""
        return float(np.quantile(self.distances, share))

    @property
    def band(self) -> tuple[float, float]:
        """In which 95 % are [m]."""
        return self.quantile(0.5 - 0.5 * _BAND), self.quantile(0.5 + 0.5 * _BAND)

    @property
    def width(self) -> float:
        """Of the band, over that of a machine that is known."""
        low, high = np.quantile(self.certain, [0.5 - 0.5 * _BAND, 0.5 + 0.5 * _BAND])
        return float((self.band[1] - self.band[0]) / (high - low))


@dataclass(frozen=True)
class NominalStop:
    """A stop as it would be under nominal conditions."""

    speed: float  # nominal [m/s]
    rate: float  # equivalent deceleration [m/s2]; distance [m]
    distance: float
    rating: float | None  # percentage, None where the system has no constants for this speed


@dataclass(frozen=True, eq=False)
class PastStop:
    """A stop that was made, and what the others predict of it."""

    recorded: RecordedStop
    model: float  # distance that the model says, as fitted to it [m]
    forecast: Forecast  # by the other stops

    @property
    def held(self) -> bool:
        """Whether the band of the others holds its distance."""
        low, high = self.forecast.band
        return low <= self.recorded.distance <= high


@dataclass(frozen=True)
class SafetyLevel:
    """A deceleration that all but one stop in so many reach."""

    decade: int  # of that number
    ratio: float  # of it to the nominal one
    # low, high: between which it is, 95 %
    low: float
    high: float
    variation: float  # coefficient of variation of the probability
    plain_stops: float  # of plain sampling that tell as much
    plain_hours: float  # processor time


@dataclass(frozen=True)
class Safety:
    """Decelerations that are reached with all but a small probability."""

    levels: tuple[SafetyLevel, ...]  # by decade
    nominal: float  # equivalent deceleration of the model of the data sheet it [m/s2]
    stops: int  # that were drawn
    spent: float  # processor time of each [s]

    @classmethod
    def of(cls, tail: Tail, decades: int, nominal: NominalRate, spent: float) -> Self:
        """From the lower tail of minus the logarithm of the distance."""
        levels = []
        for decade in range(1, decades + 1):
            quantile = tail.quantile(decade)
            plain = plain_runs(quantile.probability, quantile.variation)
            level = SafetyLevel(
                decade=decade,
                ratio=nominal.ratio(quantile.value),
                low=nominal.ratio(quantile.low),
                high=nominal.ratio(quantile.high),
                variation=quantile.variation,
                plain_stops=plain,
                plain_hours=plain * spent / 3600.0,
            )
            levels.append(level)
        return cls(tuple(levels), nominal.rate, tail.evaluations, spent)

    def lines(self) -> list[str]:
        """Table of the levels, for people."""
        lines = [
            f"deceleration over the nominal one, {self.nominal:.3f} m/s2, that all but one stop in "
            f"so many reach; {self.stops} stops drawn, {1e3 * self.spent:.2g} ms each:",
            "  one in     ratio    95 %               variation   by plain sampling",
        ]
        for level in self.levels:
            lines.append(
                f"  1e{level.decade:<6} {level.ratio:7.4f}    {level.low:.4f} to {level.high:.4f}"
                f"   {level.variation:8.3f}    {level.plain_stops:.1e} stops, "
                f"{level.plain_hours:.1e} h"
            )
        return lines


@dataclass(frozen=True, eq=False)
class Distance:
    """What past stops say of one that is asked for.

    Attributes
    ----------
    ahead : its distribution.
    nominal : distance of the model of the data sheet it [m].
    past : stops that were made.
    safety : None where it was not asked for, or interrupted early.
    plain : the same by plain samples; None where they were not asked for.
    interrupted : whether runs are missing.
    warned : what the FMU warned of in one of the stops; empty: nothing.
    """

    system: System
    stop: Stop
    ahead: Forecast
    nominal: float
    past: tuple[PastStop, ...]
    safety: Safety | None
    plain: PlainSampling | None
    interrupted: bool
    warned: str = ""

    @property
    def valid(self) -> list[PastStop]:
        """Past stops within the validity range of the model."""
        return [stop for stop in self.past if not stop.recorded.outside]

    @property
    def claimed(self) -> list[PastStop]:
        """Deprecated name of `valid`."""
        warn("claimed is now called valid", DeprecationWarning, stacklevel=2)
        return self.valid

    @property
    def response(self) -> float:
        """Equivalent response time [s]."""
        return stopping_of(self.system).response

    def rate(self, distance: float) -> float:
        """Equivalent deceleration by which the stop has a distance [m/s2]."""
        return equivalent_rate(self.stop.asked[SPEED], self.response, distance)

    def corrected(self, stop: RecordedStop) -> NominalStop | None:
        """A past stop under nominal conditions; None where no nominal speed is near."""
        stopping = stopping_of(self.system)
        nominal, asked = stopping.nominal, stop.stop.asked
        if nominal is None:
            return None
        speed = min(nominal.speeds, key=lambda v: abs(v - asked[SPEED]))
        if abs(speed - asked[SPEED]) > nominal.within * speed:
            return None
        conditions = StopConditions(
            mass=float(nominal.mass(asked)),
            rotating=float(nominal.rotating(self.system.values)),
            resistance=stop.resistance,
        )
        rate = equivalent_rate(asked[SPEED], stopping.response, stop.distance)
        rate = nominal_rate(rate, conditions, nominal.reference)
        distance = stopping_distance(speed, stopping.response, rate)
        constants = None
        if stopping.rating is not None:
            known = stopping.rating.constants.items()
            constants = next((c for v, c in known if math.isclose(v, speed)), None)
        rating = None if constants is None else percentage(distance, constants)
        return NominalStop(speed, rate, distance, rating)

    @property
    def warnings(self) -> list[str]:
        """What the data do not carry."""
        count = len(self.valid)
        warnings = [self.warned] * bool(self.warned)
        if self.safety is not None:
            warnings.append(
                f"{count} stops show what happens once in {count + 1}; levels beyond that follow "
                "from tolerances and from the forms of their distributions, which no stop has shown"
            )
        for asked in stopping_of(self.system).asked:
            seen = [stop.recorded.stop.asked[asked.name] for stop in self.valid]
            near = _SEEN * (max(seen) - min(seen))
            value = self.stop.asked[asked.name]
            if not min(seen) - near <= value <= max(seen) + near:
                low, high, here = (
                    _format_quantity(v, asked) for v in (min(seen), max(seen), value)
                )
                warnings.append(
                    f"{asked.label} {here} is beyond that of past stops, {low} to {high}"
                )
        for name, condition in self.stop.conditions.items():
            if not any(stop.recorded.stop.conditions[name] == condition for stop in self.valid):
                label = f"{self.system.condition(name).label} {condition}"
                warnings.append(f"no past stop that the model claims was made with {label}")
        if self.ahead.outside > 0.0:
            reasons = ", ".join(exclusion.reason for exclusion in stopping_of(self.system).outside)
            warnings.append(
                f"{self.ahead.outside:.1%} of the stops drawn are beyond what the model claims "
                f"({reasons}): their distances are no prediction"
            )
        return warnings

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        low, high = self.ahead.band
        middle = self.ahead.quantile(0.5)
        speed = next(q for q in stopping_of(self.system).asked if q.name == SPEED)
        start = ", ".join([_format_quantity(self.stop.asked[SPEED], speed), *self._conditions])
        return (
            f"From {start}: {middle:.1f} m, 95 %: {low:.1f} to {high:.1f} m; deceleration "
            f"{self.rate(middle):.3f} m/s2 after {self.response:.2f} s."
        )

    @property
    def _conditions(self) -> list[str]:
        return [f"{self.system.condition(k).label} {v}" for k, v in self.stop.conditions.items()]

    def summary(self) -> str:
        """The answer, what it rests on, and what it does not carry, for people."""
        lines = [self.sentence]
        quantities = [
            f"{quantity.label} {_format_quantity(self.stop.asked[quantity.name], quantity)}"
            for quantity in stopping_of(self.system).asked
        ]
        lines.append(f"asked for: {', '.join([*quantities, *self._conditions])}")
        held = sum(stop.held for stop in self.valid)
        widths = [stop.forecast.width for stop in self.valid]
        lines.append(
            f"{held} of {len(self.valid)} past stops are in the 95 % band that the others "
            f"predict, which is {np.median(widths):.2f} times as wide (at most {max(widths):.2f}) "
            "as if the machine were known"
        )
        away = len(self.past) - len(self.valid)
        if away:
            reasons = sorted({r for stop in self.past for r in stop.recorded.outside})
            lines.append(f"{away} are beyond what the model claims: {', '.join(reasons)}")
        if self.safety is not None:
            lines += ["", *self.safety.lines()]
        if self.plain is not None:
            lines += self.plain.lines()
        lines += [f"warning: {warning}" for warning in self.warnings]
        return "\n".join(lines)

    def to_frame(self) -> "pd.DataFrame":
        """Past stops: measured, corrected, and as the others predict them."""
        import pandas as pd

        rating = stopping_of(self.system).rating
        rows = []
        for stop in self.past:
            recorded, corrected = stop.recorded, self.corrected(stop.recorded)
            low, high = stop.forecast.band
            speed = recorded.stop.asked[SPEED]
            rows.append(
                {
                    "stop": recorded.stop.name,
                    "command [s]": recorded.command,
                    "speed [m/s]": speed,
                    "distance [m]": recorded.distance,
                    "deceleration [m/s2]": equivalent_rate(speed, self.response, recorded.distance),
                    "model [m]": stop.model,
                    "predicted [m]": stop.forecast.quantile(0.5),
                    "low [m]": low,
                    "high [m]": high,
                    "width": stop.forecast.width,
                    "held": stop.held,
                    "outside": ", ".join(recorded.outside),
                    "nominal_speed [m/s]": corrected.speed if corrected else np.nan,
                    "nominal_deceleration [m/s2]": corrected.rate if corrected else np.nan,
                    "nominal_distance [m]": corrected.distance if corrected else np.nan,
                }
            )
            if rating is not None:
                percent = corrected.rating if corrected else None
                rows[-1]["rating [%]"] = np.nan if percent is None else percent
        return pd.DataFrame(rows)

    def quantiles(self) -> "pd.DataFrame":
        """Of the distance and of the deceleration of the stop that is asked for."""
        import pandas as pd

        distances = [self.ahead.quantile(share) for share in QUANTILES]
        return pd.DataFrame(
            {
                "share": QUANTILES,
                "distance [m]": distances,
                "deceleration [m/s2]": [self.rate(distance) for distance in distances],
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; the keys of the first level are a contract."""
        frame = self.to_frame()
        return {
            "sentence": self.sentence,
            "asked": dict(self.stop.asked),
            "conditions": dict(self.stop.conditions),
            "distance": {f"{share:g}": self.ahead.quantile(share) for share in QUANTILES},
            "deceleration": self.rate(self.ahead.quantile(0.5)),
            "response": self.response,
            "nominal": {"distance": self.nominal, "deceleration": self.rate(self.nominal)},
            "outside": self.ahead.outside,
            "width": self.ahead.width,
            "safety": None
            if self.safety is None
            else [asdict(level) for level in self.safety.levels],
            "plain": None if self.plain is None else asdict(self.plain),
            "stops": frame.astype(object).where(frame.notna(), None).to_dict("records"),
            "held": {"of": len(self.valid), "stops": sum(stop.held for stop in self.valid)},
            "warnings": self.warnings,
            "interrupted": self.interrupted,
        }

    def plot(self) -> "Figure":
        """Figure of the distribution, of past stops beside predictions, and of the safety level."""
        return distance_figure(self)

    def _repr_html_(self) -> str:
        """The answer and its quantiles, for notebooks."""
        return f"<p>{escape(self.sentence)}</p>{self.quantiles().to_html(index=False)}"


def _format_quantity(value: float, asked: AskedQuantity) -> str:
    unit = f" {asked.shown}" * (asked.shown != "1")
    return f"{value / si_factor(asked.shown, asked.unit, asked.name):.4g}{unit}"


def distance_figure(result: Distance) -> "Figure":
    """Draw the distribution with its quantiles, past stops with their bands, the safety level."""
    rows = 2 if result.safety is None else 3
    with styled(9.0, 0.5 + 2.9 * rows) as sheet:
        panels = sheet.subplots(rows)
        _draw_distribution(panels[0], result)
        _draw_past(panels[1], result.past)
        if result.safety is not None:
            _draw_levels(panels[2], result.safety)
    return sheet


def _draw_distribution(axes: "Axes", result: Distance) -> None:
    distances = result.ahead.distances
    axes.hist(distances, bins=60, density=True, color=LIGHT["raw"], alpha=0.5)
    top = axes.get_ylim()[1]
    for share in QUANTILES:
        at = result.ahead.quantile(share)
        axes.axvline(at, color=LIGHT["2"], linewidth=1.5 if share == 0.5 else 0.8)
        axes.text(at, top, f" {100 * share:g} %", fontsize=7, rotation=90, va="top", ha="right")
    axes.axvline(result.nominal, color=LIGHT["1"], linestyle="--", label="model of the data sheet")
    axes.legend(fontsize=7, frameon=False)
    axes.set(title=result.sentence, xlabel="distance [m]", ylabel="density [1/m]")
    axes.title.set_fontsize(9)


def _draw_past(axes: "Axes", past: tuple[PastStop, ...]) -> None:
    """Each stop and its band, over the middle of what the others predict."""
    middle = np.array([stop.forecast.quantile(0.5) for stop in past])
    low, high = np.array([stop.forecast.band for stop in past]).T / middle
    measured = np.array([stop.recorded.distance for stop in past]) / middle
    valid = np.array([not stop.recorded.outside for stop in past])
    place = np.arange(len(past))
    axes.vlines(place, low, high, color=LIGHT["2"], linewidth=4.0, alpha=0.35, label="95 %")
    axes.plot(place[valid], measured[valid], "o", color=LIGHT["measured"], markersize=4)
    (outside,) = axes.plot(place[~valid], measured[~valid], "x", color=LIGHT["1"], markersize=5)
    outside.set_label("beyond what the model claims")
    axes.legend(fontsize=7, frameon=False)
    axes.set(title="past stops, each over what the others predict", ylabel="distance, of predicted")
    names = [stop.recorded.stop.name for stop in past] if len(past) <= MOST_NAMED else []
    axes.set_xticks(place[: len(names)], names, rotation=90 if len(past) > 8 else 15, fontsize=6)


def _draw_levels(axes: "Axes", safety: Safety) -> None:
    decades = np.array([level.decade for level in safety.levels])
    ratio, low, high = np.array([(level.ratio, level.low, level.high) for level in safety.levels]).T
    reach = np.maximum(0.0, [ratio - low, high - ratio])
    axes.errorbar(decades, ratio, reach, color=LIGHT["2"], marker="o", markersize=4, capsize=3)
    axes.set(
        title=f"deceleration over the nominal one, {safety.nominal:.3f} m/s2, that all but one "
        "stop in so many reach",
        xlabel="one stop in",
        ylabel="ratio",
    )
    axes.title.set_fontsize(9)
    axes.set_xticks(decades, [f"1e{k}" for k in decades])
