"""What a diagnosis found, as a value: a sentence, numbers, a table, a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.diagnosis.certainty import Certainty
from workbench.diagnosis.counting import FAULTY, MISSING
from workbench.diagnosis.residuals import Dependence, Residuals
from workbench.diagnosis.rivals import Rivals
from workbench.diagnosis.sample_errors import Errors
from workbench.diagnosis.search import Step
from workbench.diagnosis.timing import Late
from workbench.diagnosis.trial import Prospect
from workbench.diagnosis.verdict import Cause, Diagnosis, Gain
from workbench.errors import InputError, closest
from workbench.lab import BAND, with_interval
from workbench.system import Channel, Signal, System
from workbench.units import si_factor

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MEASURE = (
    "root mean square of prediction errors, in means over {span}, on recordings that were held "
    "out, in units of the noise of such a mean; 1 is noise alone"
)


@dataclass(frozen=True)
class Extension:
    """The extended model: its source, its FMU, and how far its predictions are from the fit's.

    Attributes
    ----------
    difference : largest, in standard deviations of the noise of a sample mean.
    """

    modelica: Path
    fmu: Path
    difference: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A diagnosis and all that shows it.

    Attributes
    ----------
    system, cases : as diagnosed.
    residuals : of each recording, in their order.
    levels : calibrated values by parameter and choice of a condition, or by a sensor's delay:
        (value, unit).
    deviations : by recording and parameter, in standard deviations of its tolerance.
    set_aside : number of samples by recording and reason.
    observers : by observer and recording, error of the judged signal (rms over mean [1]) with the
        model before and after; empty where nothing was extended or it was not measured, and for
        effects that turn with a shaft, whose phase an observer does not know.
    errors : of the nominal and of the last model, by recording and channel.
    starts : see `start_values`, by recording.
    rivals : the model that was named, and those that these recordings do not tell from it; None
        unless a cause was found.
    certainty : how sure the sizes are, by fits of their own; None if that was not asked, no
        cause was found, or the search was interrupted.
    """

    system: System
    cases: tuple[Case, ...]
    diagnosis: Diagnosis
    residuals: Sequence[Residuals]
    dependences: Sequence[Dependence]
    levels: Mapping[tuple[str, str], tuple[float, str]]
    deviations: Mapping[str, Mapping[str, float]]
    set_aside: Mapping[str, Mapping[str, int]]
    observers: Mapping[str, Mapping[str, tuple[float, float]]]
    extension: Extension | None
    errors: tuple[Errors, ...]
    starts: Mapping[str, Mapping[str, float]]
    rivals: Rivals | None
    certainty: Certainty | None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What was compared."""
        return self.residuals[0].channels

    @property
    def missing(self) -> tuple[Signal, ...]:
        """What could be compared, if recordings had it."""
        judged = self.system.judged
        return tuple(one for one in judged if not any(one.name in case for case in self.cases))

    @property
    def turns(self) -> bool:
        """Whether a cause turns with a shaft, so that its errors do not last."""
        return any(cause.effect.order_locked for cause in self.diagnosis.causes)

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        found = self.diagnosis
        cost = "".join(
            f" Without a measured {one.label}, fewer effects can be told apart."
            for one in self.missing
        )
        if found.verdict == "nothing":
            return f"Nothing significant is missing: what remains is noise and tolerance.{cost}"
        if found.verdict == "unexplained":
            return f"{self._unexplained()}{cost}"
        names = []
        for cause in found.causes:
            label, one = next(iter(cause.parameters.items()))
            twins = f" (or {', '.join(cause.confusable_with)})" if cause.confusable_with else ""
            size = with_interval(one.value, one.low, one.high, one.unit)
            names.append(f"{cause.effect.text}: {cause.effect.name}{twins}, {label} {size}")
        assert found.gain is not None
        more = " The search was interrupted: more may be missing." if found.interrupted else ""
        return (
            f"The model lacks {'; and '.join(names)}; on held-out recordings its error falls from "
            f"{found.gain.before:.1f} to {found.gain.after:.1f} times the noise.{more}{cost}"
        )

    def _unexplained(self) -> str:
        partial, late = self.diagnosis.partial, self.diagnosis.late
        if late is not None:
            return f"Something is missing that clocks explain: {_late(late)}."
        part = f", though {' and '.join(partial)} would explain a part" * bool(partial)
        strongest = max(self.dependences, key=lambda one: one.after)
        goes = f"; it goes with {strongest.influence}" if strongest.after > 0.0 else ""
        return f"Something is missing that no effect of the catalogue explains{part}{goes}."

    def summary(self) -> str:
        """The verdict, its causes and what they rest on, for people."""
        lines = [self.sentence]
        for cause in self.diagnosis.causes:
            lines += ["", *_told(cause)]
        if self.certainty is not None:
            lines += ["", self.certainty.sentence]
        lines += ["", *self._sample_errors()]
        if self.extension is not None:
            lines += ["", f"extended model: {self.extension.modelica}, {self.extension.fmu}"]
        aside = sum(counts[FAULTY] + counts[MISSING] for counts in self.set_aside.values())
        if aside:
            lines.append(f"{aside} samples were missing or wrong, and set aside")
        return "\n".join(lines)

    def _sample_errors(self) -> list[str]:
        """Lines on the errors of both models, over all recordings that were fitted or not."""
        lines = ["errors of single samples, root mean square and mean absolute:"]
        for channel in self.channels:
            factor = si_factor(channel.shown, channel.unit, channel.name)
            for held_out in (False, True):
                own = [
                    e for e in self.errors if (e.channel, e.held_out) == (channel.name, held_out)
                ]
                if not own:
                    continue
                counts = [e.samples for e in own]
                squares = np.average(np.square([e.rms for e in own]), axis=0, weights=counts)
                means = np.average([e.mean_absolute for e in own], axis=0, weights=counts)
                ends = zip(np.sqrt(squares) / factor, means / factor, strict=True)
                before, after = (f"{rms:.3g} and {mean:.3g} {channel.shown}" for rms, mean in ends)
                change = f"{before}, now {after}" if self.diagnosis.best.active else before
                fate = "held out" if held_out else "fitted"
                lines.append(f"  {channel.label}, {len(own)} recordings {fate}: {change}")
        return lines

    def to_frame(self) -> pd.DataFrame:
        """Causes, strongest first, a row for each of their parameters."""
        rows = [
            {
                "effect": cause.effect.name,
                "parameter": name,
                "value": one.value,
                "low": one.low,
                "high": one.high,
                "unit": one.unit,
                "explained": cause.explained,
                "confusable_with": ", ".join(cause.confusable_with),
            }
            for cause in self.diagnosis.causes
            for name, one in cause.parameters.items()
        ]
        columns = ["effect", "parameter", "value", "low", "high", "unit", "explained"]
        return pd.DataFrame(rows, columns=[*columns, "confusable_with"])

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; the keys of the first level are a contract."""
        found = self.diagnosis
        return {
            "verdict": found.verdict,
            "sentence": self.sentence,
            "interrupted": found.interrupted,
            "doubts": {case.name: list(case.doubts) for case in self.cases if case.doubts},
            "causes": [_cause(cause) for cause in found.causes],
            "gain": None if found.gain is None else self._gain(found.gain),
            "model": _model(self.extension),
            "partial": list(found.partial),
            "late": None if found.late is None else asdict(found.late),
            "lasting_errors": self._lasting_errors(),
            "dependences": [asdict(one) for one in self.dependences],
            "confusability": {"effects": list(found.names), "cosines": found.cosines.tolist()},
            "candidates": [_candidate(score) for score in found.scores],
            "steps": [_step(step) for step in found.steps],
            "not_visible": dict(found.not_visible),
            "levels": {
                f"{name} {choice}": {"value": value, "unit": unit}
                for (name, choice), (value, unit) in self.levels.items()
            },
            "deviations": {name: dict(row) for name, row in self.deviations.items()},
            "set_aside": {name: dict(counts) for name, counts in self.set_aside.items()},
            "channels": {one.name: one.unit for one in self.channels},
            "errors": [asdict(one) for one in self.errors],
            "start_values": {name: dict(values) for name, values in self.starts.items()},
            "observers": {
                name: {
                    recording: {"before": _known(before), "after": _known(after)}
                    for recording, (before, after) in errors.items()
                }
                for name, errors in self.observers.items()
            },
            "rivals": None if self.rivals is None else self.rivals.to_dict(),
            "certainty": None if self.certainty is None else self.certainty.to_dict(),
            "cases": [case.name for case in self.cases],
        }

    def start_values(self, recording: str) -> dict[str, float]:
        """What the last model has to start with in order to simulate a recording, in any tool.

        Parameters
        ----------
        recording : name of one that was fitted or held out.

        Returns
        -------
        values : states at the start, and parameters that differ between recordings, by name of the
            FMU's variables, in their units (SI); those that its FMU has anyway are left out.

        Raises
        ------
        InputError
            If there is no such recording.
        """
        if recording not in self.starts:
            raise InputError(
                where=f"recording '{recording}'",
                found=f"no recording of this name{closest(recording, self.starts)}",
                expected=f"one of {', '.join(self.starts)}",
                remedy="correct the name",
            )
        return dict(self.starts[recording])

    def plot(self, recording: str = "") -> "Figure":
        """Figure of the prediction errors of a recording, before and after.

        Parameters
        ----------
        recording : its name; by default the one that shows best what was found.

        Raises
        ------
        InputError
            If there is no such recording.
        """
        from workbench.report.diagnosis_figures import recording_figures, shown_first
        from workbench.report.figures import sheet

        return sheet(shown_first(recording_figures(self), recording))

    def _repr_html_(self) -> str:
        """The verdict and the table of causes, for notebooks."""
        table = self.to_frame()
        return f"<p>{escape(self.sentence)}</p>" + (
            table.to_html(index=False) if len(table) else ""
        )

    def _gain(self, gain: Gain) -> dict[str, Any]:
        compare = self.system.comparison
        return {
            "measure": _MEASURE.format(
                span=duration(compare.block if self.turns else compare.lasting)
            ),
            "before": gain.before,
            "after": gain.after,
            "low": gain.low,
            "high": gain.high,
            "recordings": {
                name: {"before": before, "after": after}
                for name, (before, after) in gain.recordings.items()
            },
        }

    def _lasting_errors(self) -> dict[str, dict[str, float]]:
        before, after = (
            one.linearised.inflation for one in (self.diagnosis.base, self.diagnosis.best)
        )
        return {
            channel.name: {"before": float(b), "after": float(a)}
            for channel, b, a in zip(self.channels, before, after, strict=True)
        }


def _late(late: Late) -> str:
    """Signals that are late, and what to do, for people."""
    if not late.signals:
        return "several signals are late by different times; say in [loggers] which share a logger"
    reach = BAND * late.sigma
    size = with_interval(late.skew, late.skew - reach, late.skew + reach, "s")
    signals = " and ".join(late.signals)
    return (
        f"{signals} late by {size} against the others, which no logger of the system file has alone"
    )


def duration(seconds: float) -> str:
    """A time for people.

    >>> duration(0.05), duration(1.0), duration(300.0)
    ('50 ms', '1 s', '300 s')
    """
    return f"{1e3 * seconds:g} ms" if seconds < 0.5 else f"{seconds:g} s"


def _told(cause: Cause) -> list[str]:
    """Lines on a cause."""
    lines = [f"{cause.effect.name}: {cause.effect.text}"]
    lines += [
        f"  {name} = {with_interval(one.value, one.low, one.high, one.unit)}"
        for name, one in cause.parameters.items()
    ]
    lines.append(f"  explains {cause.explained:.1%} of what can be, on held-out recordings")
    if cause.confusable_with:
        lines.append(
            f"  cannot be told from {', '.join(cause.confusable_with)} in these data; "
            f"what would: {cause.effect.separation}"
        )
    return lines


def _known(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return value if np.isfinite(value) else None


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.effect.name,
        "text": cause.effect.text,
        "parameters": {
            name: {"value": one.value, "low": one.low, "high": one.high, "unit": one.unit}
            for name, one in cause.parameters.items()
        },
        "phases": None if cause.phases is None else [float(phase) for phase in cause.phases],
        "confusable_with": list(cause.confusable_with),
        "explained": cause.explained,
        "separation": cause.effect.separation,
    }


def _model(extension: Extension | None) -> dict[str, Any]:
    return {
        "modelica": None if extension is None else str(extension.modelica),
        "fmu": None if extension is None else str(extension.fmu),
        "difference_from_fit": None if extension is None else extension.difference,
    }


def _candidate(score: Prospect) -> dict[str, Any]:
    return {
        "effect": score.effect.name,
        "shape": dict(score.shape),
        "size": score.size,
        "sigma": _known(score.sigma),
        "unit": score.units[score.effect.size],
        "shape_units": {name: score.units[name] for name in score.shape},
        "gain": score.gain,
        "held_out": float(score.held_out.sum()),
    }


def _step(step: Step) -> dict[str, Any]:
    return {
        "before": step.before.misfit,
        "rivals": [
            {"effect": rival.active[-1].name, "misfit": rival.misfit} for rival in step.rivals
        ],
    }
