"""What a diagnosis found, as a value: a sentence, numbers, a table, a figure."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.diagnosis.data.clocks import DELAY, held_otherwise
from workbench.diagnosis.data.counting import FAULTY, MISSING
from workbench.diagnosis.effects.candidates import LAG
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.figures import FAST, clearness, lasting_blocks, recording_figure
from workbench.diagnosis.inference.causes import Cause
from workbench.diagnosis.inference.certainty import Certainty
from workbench.diagnosis.inference.coupling import Coupling
from workbench.diagnosis.inference.nearest import NearestCandidate
from workbench.diagnosis.inference.nuisance import remedy
from workbench.diagnosis.inference.residuals import Dependence, Residuals
from workbench.diagnosis.inference.rivals import Rivals
from workbench.diagnosis.inference.sample_errors import Errors
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.diagnosis.inference.search import Step
from workbench.diagnosis.inference.timing import LateSignals
from workbench.diagnosis.inference.verdict import Diagnosis, Gain
from workbench.errors import require_known
from workbench.pages.figures import CaseFigure
from workbench.pages.views import duration
from workbench.recordings.case import Case
from workbench.system.comparison import Channel
from workbench.system.parts import Signal
from workbench.system.system import System
from workbench.system.units import BAND, si_factor, three_digits, with_interval, with_unit

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_MEASURE = (
    "root mean square of prediction errors, in means over {span}, in cross-validation: each "
    "recording predicted by a fit to the others, in units of the noise of such a mean; 1 is noise "
    "alone"
)

NOT_OF_A_MODEL = (  # why an extended model has no wrong sensors, and what follows
    "sensors and clocks are no part of a model. Correct recordings by them before you compare "
    "these with the extended model"
)


@dataclass(frozen=True)
class Extension:
    """The extended model: its source, its FMU, and how far its predictions are from the fit's."""

    modelica: Path | None  # None of an FMU alone, around which another FMU is built
    fmu: Path
    difference: float  # largest, in standard deviations of the noise of a sample mean

    @property
    def files(self) -> tuple[Path, ...]:
        """All of them."""
        return (self.fmu,) if self.modelica is None else (self.modelica, self.fmu)


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
    observers : by observer and recording, error of the scored signal (rms over mean [1]) with the
        model before and after; empty where nothing was extended or it was not measured, and for
        effects that turn with a shaft, whose phase an observer does not know.
    errors : of the nominal and of the last model, by recording and channel.
    starts : see `start_values`, by recording.
    rivals : the model that was named, and those that these recordings do not tell from it; None
        unless a cause was found.
    certainty : how sure the sizes are, by fits of their own; None if that was not asked, no
        cause was found, or the search was interrupted.
    one_law : what a single law is that explains as much as several causes with less; empty if none
        does, or there are not several.
    unsure : of a model that is simulated freely, shares by which derivatives may be wrong, by
        variable; None of any other.
    warned : what the FMU warned of; empty: nothing.
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
    one_law: str = ""
    unsure: Mapping[str, float] | None = None
    warned: str = ""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What was compared."""
        return self.residuals[0].channels

    @property
    def missing(self) -> tuple[Signal, ...]:
        """What could be compared, if recordings had it."""
        judged = self.system.reference_signals
        return tuple(
            signal for signal in judged if not any(signal.name in case for case in self.cases)
        )

    @property
    def turns(self) -> bool:
        """Whether a cause turns with a shaft, so that its errors do not last."""
        return any(cause.effect.order_locked for cause in self.diagnosis.causes)

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        diagnosis = self.diagnosis
        cost = "".join(
            f" Without a measured {signal.label}, fewer effects can be discriminated."
            for signal in self.missing
        )
        if self.unsure is not None:
            alone = not self.system.library.is_file()
            cost += " All figures are of free simulations of the FMU, which nothing corrects"
            cost += f"{'; terms beside its rates are no candidates' * alone}."
        if diagnosis.verdict == "nothing":
            return f"{self._nothing}{cost}"
        if diagnosis.verdict == "unexplained":
            return f"{self._unexplained()}{cost}"
        part = diagnosis.verdict == "partly explained"
        names = []
        for cause in diagnosis.causes:
            label, size = next(iter(cause.parameters.items()))
            twins = f" (or {', '.join(cause.confusable_with)})" if cause.confusable_with else ""
            names.append(f"{cause.effect.text}: {cause.effect.name}{twins}, {label} {size.text}")
        assert diagnosis.gain is not None
        more = " The search was interrupted: more may be missing." if diagnosis.interrupted else ""
        if part:
            sizes = [size for cause in diagnosis.causes for size in cause.parameters.values()]
            remainder = f"no effect of the catalogue explains the rest{self._goes}"
            if diagnosis.noise_alone and self._unsure:
                remainder = f"the size of {self._unsure} may be zero"
            if any(np.isfinite(size.beyond) for size in sizes):
                remainder = "a size beyond its bound explains more"
            more = f" This is a part: {remainder}."
        return (
            f"The model lacks {'; and '.join(names)}; in cross-validation {diagnosis.gain.text}"
            f"{self._held_out}."
            f"{more}{cost}"
        )

    @property
    def _unsure(self) -> str:
        """Causes whose sizes may be zero, by name."""
        return " and ".join(c.effect.name for c in self.diagnosis.causes if c.may_be_zero)

    @property
    def _held_out(self) -> str:
        """What the sentence says of recordings that were named as held out: nothing of none."""
        held_out = [error for error in self.errors if error.held_out]
        if not held_out:
            return ""
        count = len({error.recording for error in held_out})
        by_channel = {
            channel: self._rms([e for e in held_out if e.channel == channel.name])
            for channel in self.channels
        }
        # The channel that is most wrong of what the last model leaves there.
        channel = max(by_channel, key=lambda c: by_channel[c][0] / max(by_channel[c][1], 1e-300))
        factor = si_factor(channel.shown, channel.unit, channel.name)
        before, after = (three_digits(rms / factor) for rms in by_channel[channel])
        recordings = f"{count} held-out recording{'s' * (count > 1)}"
        change = f"from {before} to {after} {channel.shown}"
        return f", and on {recordings} that of {channel.label} {change}"

    @staticmethod
    def _rms(errors: Sequence[Errors]) -> tuple[float, float]:
        """Root mean square of samples of some recordings, of both models; 0 of none."""
        counts = [error.samples for error in errors]
        if not sum(counts):
            return 0.0, 0.0
        before, after = np.average(np.square([e.rms for e in errors]), axis=0, weights=counts)
        return float(np.sqrt(before)), float(np.sqrt(after))

    @property
    def warnings(self) -> list[str]:
        """What makes the answer doubtful, and what to do."""
        diagnosis = self.diagnosis
        limits = [
            f"{cause.effect.name}: {name} {size.text}."
            + f" If physics allows it, widen the bounds of {name} in {cause.effect.model}."
            * size.open
            for cause in diagnosis.causes
            for name, size in cause.parameters.items()
            if size.limit
        ]
        if self.one_law:
            limits.insert(
                0,
                f"One law explains as much as {' and '.join(diagnosis.best.names)} with less: "
                f"{self.one_law}. Ask for its form with --propose.",
            )
        named = {name for cause in diagnosis.causes for name in variables(cause.effect, "")}
        limits = [f"{self.warned}."] * bool(self.warned) + limits
        shifted = [
            *(level.text for level in diagnosis.shifted),
            *(
                f"Derivatives by {name} differ by {share:.0%} between steps of their difference, "
                "as events or the FMU's own solver make them rough: its interval may be wrong by "
                "as much."
                for name, share in (self.unsure or {}).items()
                if name in named
            ),
        ]
        shifted += [text for cause in diagnosis.causes if (text := _held(self.system, cause))]
        if diagnosis.differing is not None:
            shifted.insert(0, diagnosis.differing.text)
        if diagnosis.noise_alone or diagnosis.gain is None:
            return [*limits, *shifted]
        zero = f" That of {self._unsure} holds zero." if self._unsure else ""
        return [
            *limits,
            *shifted,
            f"What remains in cross-validation, {diagnosis.gain.after:.1f} times the noise, widens "
            f"the intervals: a law may be wrong in form.{zero}",
        ]

    @property
    def not_visible(self) -> dict[str, str]:
        """Why these recordings cannot show an effect, and what would, by its name."""
        diagnosis = self.diagnosis
        levels = {effect: name for name, effects in diagnosis.hidden.items() for effect in effects}
        hidden = {
            effect: f"the level {name} has the same signature; "
            + remedy(free=self.system.comparison.levels[name].free)
            if name
            else "the start of the one recording has the same signature; fit several recordings"
            for effect, name in levels.items()
        }
        by_starts = {
            effect: f"the start of {state} has the same signature; say how little it may differ "
            f"from the model's, [states.{state}] spread, or measure it, and diagnose again"
            for state, effects in diagnosis.hidden_by_starts.items()
            for effect in effects
        }
        return {**by_starts, **diagnosis.not_visible, **hidden}

    @property
    def next_steps(self) -> list[str]:
        """What to do about what remains unexplained."""
        if self.diagnosis.verdict not in ("unexplained", "partly explained"):
            return []
        if self.diagnosis.late is not None or self.diagnosis.coupling is not None:
            return []
        bound = any(
            "at its bound" in why for nearest in self.diagnosis.nearest for why in nearest.reasons
        )
        widen = ["widen the bounds of a parameter at its bound, if physics allows it"] * bound
        if (change := self._change) is not None:
            names = " and ".join(change.effects)
            widen.insert(0, f"if {names} may be so, correct {change.corrected}")
        if (slight := self._slight) is not None:
            name = slight.effects[0]
            widen.append(f"state a smaller size that matters for {name}, if it is worth reporting")
        if not self.system.library.is_file():
            return [
                *widen,
                "fit parameters that may be wrong, several at once: workbench fit ... --parameter "
                "NAME",
                "add what may be missing in the model's own tool, export the FMU, and diagnose "
                "again",
                "put the Modelica library of the model beside the system file, if you have it: "
                "effects of its own, and laws that --propose infers, act inside of its equations",
            ]
        return [
            "infer a law from these recordings: workbench diagnose ... --propose",
            *widen,
            "add an effect for it to the library, and diagnose again",
        ]

    @property
    def _nothing(self) -> str:
        if nearest := self.diagnosis.nearest:
            material, slight = (
                " or ".join(near.effects[0] for near in nearest if near.slight is small)
                for small in (False, True)
            )
            return (
                f"Nothing is missing for sure: {material} would explain errors beyond the noise, "
                f"but changes too small to matter{f', of {slight},' * bool(slight)} do as well."
            )
        return "Nothing significant is missing: what remains is noise and tolerance."

    def _unexplained(self) -> str:
        partial, late = self.diagnosis.partial, self.diagnosis.late
        if self.diagnosis.coupling is not None:
            return _coupled(self.diagnosis.coupling, self.system.sample_time)
        if late is not None:
            return _late(late)
        if (change := self._change) is not None:
            return (
                "Something is missing that no effect of the catalogue explains, but "
                f"{'one other change' if len(change.effects) == 1 else 'other changes'} would: "
                f"{change.change}."
            )
        if (slight := self._slight) is not None:
            names = " and ".join(slight.effects)
            return (
                f"Something is missing that {names} would explain, at a size less than what "
                f"matters{self._goes}."
            )
        part = f", though {' and '.join(partial)} would explain a part" * bool(partial)
        return f"Something is missing that no effect of the catalogue explains{part}{self._goes}."

    @property
    def _change(self) -> NearestCandidate | None:
        """Changes that explain as much, and not all of which an effect of the catalogue is."""
        return next((nearest for nearest in self.diagnosis.nearest if nearest.change), None)

    @property
    def _slight(self) -> NearestCandidate | None:
        """What explains everything at a size less than what matters."""
        return next((nearest for nearest in self.diagnosis.nearest if nearest.slight), None)

    @property
    def _goes(self) -> str:
        """What that goes with which remains."""
        strongest = max(self.dependences, key=lambda dependence: dependence.after)
        return f"; it goes with {strongest.influence}" if strongest.after > 0.0 else ""

    @property
    def without(self) -> list[str]:
        """Effects that were found and are not in the extended model: of sensors and clocks."""
        effects = [cause.effect for cause in self.diagnosis.causes]
        return [effect.name for effect in effects if effect.sensor or effect.late]

    def summary(self) -> str:
        """The verdict, its causes and what they rest on, for people."""
        lines = [self.sentence, *(f"doubt: {warning}" for warning in self.warnings)]
        if self.not_visible:
            lines += ["", "not visible by these recordings:"]
            lines += [f"  {effect}: {reason}" for effect, reason in self.not_visible.items()]
        for cause in self.diagnosis.causes:
            lines += ["", *_cause_lines(cause)]
        told = self.diagnosis.late is not None or self.diagnosis.coupling is not None
        unexplained = self.diagnosis.verdict == "unexplained"
        if (unexplained or self.diagnosis.nearest) and not told:
            lines += ["", "nearest candidates, in cross-validation:"]
            nearest = [candidate.text for candidate in self.diagnosis.nearest]
            lines += [f"  {text}" for text in nearest or ["none removes any of it"]]
        if self.next_steps:
            lines += ["", "what to do:", *(f"  {step}" for step in self.next_steps)]
        if self.certainty is not None:
            lines += ["", self.certainty.sentence]
        lines += ["", *self._sample_errors()]
        if self.extension is not None:
            part = " (a part of what is missing)" * (self.diagnosis.verdict == "partly explained")
            lines += ["", f"extended model{part}: {', '.join(map(str, self.extension.files))}"]
            if self.without:
                lines.append(f"  without {', '.join(self.without)}: {NOT_OF_A_MODEL}")
        aside = sum(counts[FAULTY] + counts[MISSING] for counts in self.set_aside.values())
        if aside:
            lines.append(f"{aside} samples were missing or wrong, and are excluded")
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
                before, after = (
                    f"{three_digits(rms)} and {three_digits(mean)} {channel.shown}"
                    for rms, mean in ends
                )
                change = f"{before}, now {after}" if self.diagnosis.best.active else before
                fate = "held out" if held_out else "fitted"
                run = f" ({own[0].corrected} correct the run)" if own[0].corrected else ""
                lines.append(f"  {channel.label}, {len(own)} recordings {fate}{run}: {change}")
                if own[0].corrected:
                    free = [self._free_run(own, i, channel, factor) for i in (0, 1)]
                    runs = ", now ".join(free if self.diagnosis.best.active else free[:1])
                    lines.append(f"    free run, root mean square: {runs}")
        return lines

    def _free_run(self, own: Sequence[Errors], model: int, channel: Channel, factor: float) -> str:
        """Error of free runs of one of the two models, over some recordings."""
        errors = [e.free_run[model] for e in own]
        if None in errors:
            return "none, the model cannot be simulated so far"
        squares = np.square(np.array(errors, float))
        rms = np.sqrt(np.average(squares, weights=[e.samples for e in own]))
        return f"{three_digits(rms / factor)} {channel.shown}"

    def to_frame(self) -> "pd.DataFrame":
        """Causes, strongest first, a row for each of their parameters."""
        import pandas as pd

        rows = [
            {
                "effect": cause.effect.name,
                "parameter": name,
                "value": parameter.value,
                "low": parameter.low,
                "high": parameter.high,
                "unit": parameter.unit,
                "explained": cause.explained,
                "confusable_with": ", ".join(cause.confusable_with),
            }
            for cause in self.diagnosis.causes
            for name, parameter in cause.parameters.items()
        ]
        columns = ["effect", "parameter", "value", "low", "high", "unit", "explained"]
        return pd.DataFrame(rows, columns=[*columns, "confusable_with"])

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; the keys of the first level are a contract."""
        diagnosis = self.diagnosis
        return {
            "verdict": diagnosis.verdict,
            "sentence": self.sentence,
            "interrupted": diagnosis.interrupted,
            "warnings": self.warnings,
            "doubts": {case.name: list(case.doubts) for case in self.cases if case.doubts},
            "causes": [_cause(cause) for cause in diagnosis.causes],
            "gain": None if diagnosis.gain is None else self._gain(diagnosis.gain),
            "model": self._model(),
            "partial": list(diagnosis.partial),
            "noise_alone": diagnosis.noise_alone,
            "nearest": [asdict(candidate) for candidate in diagnosis.nearest],
            "next_steps": self.next_steps,
            "late": None if diagnosis.late is None else asdict(diagnosis.late),
            "lasting_errors": self._lasting_errors(),
            "dependences": [asdict(dependence) for dependence in self.dependences],
            "confusability": {
                "effects": list(diagnosis.names),
                "cosines": diagnosis.cosines.tolist(),
            },
            "candidates": [_candidate(score) for score in diagnosis.scores],
            "steps": [_step(step) for step in diagnosis.steps],
            "not_visible": self.not_visible,
            "shifted_levels": [asdict(level) for level in diagnosis.shifted],
            "levels": {
                f"{name} {choice}": {"value": value, "unit": unit}
                for (name, choice), (value, unit) in self.levels.items()
            },
            "deviations": {name: dict(row) for name, row in self.deviations.items()},
            "set_aside": {name: dict(counts) for name, counts in self.set_aside.items()},
            "channels": {channel.name: channel.unit for channel in self.channels},
            "errors": [asdict(error) for error in self.errors],
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
        _require_recording(recording, self.starts)
        return dict(self.starts[recording])

    def figures(self) -> list[CaseFigure]:
        """Figures of all recordings, the one that shows best what was found first."""
        diagnosis = self.diagnosis
        added = [cause.effect.name for cause in diagnosis.causes] or diagnosis.partial
        extension = f"with {', '.join(added)}" if added else ""
        fast = diagnosis.gain is not None and diagnosis.gain.fast
        span = FAST if fast else lasting_blocks(self.system)
        pairs = list(zip(self.residuals, self.cases, strict=True))
        pairs.sort(key=lambda pair: -clearness(pair[0], span, bool(diagnosis.causes)))
        return [
            recording_figure(residuals, case, self.system, extension, span)
            for residuals, case in pairs
        ]

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
        from workbench.pages.figures import sheet

        figures = {figure.name: figure for figure in self.figures()}
        if recording:
            _require_recording(recording, figures)
        return sheet(figures[recording or next(iter(figures))])

    def _repr_html_(self) -> str:
        """The verdict and the table of causes, for notebooks."""
        table = self.to_frame()
        return f"<p>{escape(self.sentence)}</p>" + (
            table.to_html(index=False) if len(table) else ""
        )

    def _model(self) -> dict[str, Any]:
        extension = self.extension
        return {
            "partial": self.diagnosis.verdict == "partly explained",
            "modelica": str(extension.modelica) if extension and extension.modelica else None,
            "fmu": None if extension is None else str(extension.fmu),
            "difference_from_fit": None if extension is None else extension.difference,
            "without": [] if extension is None else self.without,
        }

    def _gain(self, gain: Gain) -> dict[str, Any]:
        compare = self.system.comparison
        return {
            "measure": _MEASURE.format(
                span=duration(compare.block if gain.fast else compare.lasting)
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
            model.linearised.variance_factors
            for model in (self.diagnosis.base, self.diagnosis.best)
        )
        return {
            channel.name: {"before": float(b), "after": float(a)}
            for channel, b, a in zip(self.channels, before, after, strict=True)
        }


def _held(system: System, cause: Cause) -> str:
    """How inputs that are held otherwise would explain a cause that is a delay or a lag."""
    names, size = {cause.effect.name, *cause.confusable_with}, cause.parameters[cause.effect.label]
    if cause.effect.size not in (DELAY, LAG):
        return ""
    keys = held_otherwise(system, names, size.value, size.low, size.high)
    writing = " and ".join(f"{key} in [inputs.{name}]" for name, key in keys.items())
    return (
        "Inputs that are held otherwise between samples, which are "
        f"{with_unit(system.sample_time, 's')} apart, explain {cause.effect.name} as well. If they "
        f"are, write {writing}, and diagnose again."
    ) * bool(keys)


def _coupled(coupling: Coupling, sample: float) -> str:
    """What a Co-Simulation makes of its inputs, and what to do, for people."""
    inputs = " and ".join(coupling.inputs)
    held = " and ".join(f"held = {coupling.hold} in [inputs.{name}]" for name in coupling.inputs)
    as_held = (
        f"Nothing is missing if inputs are held in the machine, too: if they are, write {held}, "
        "and diagnose again. "
    )
    return (
        "What is wrong is no more than this FMU makes of its inputs: as a Co-Simulation that takes "
        f"no slopes, it has the mean of {inputs} for each step of {with_unit(sample, 's')}, and "
        "what depends on them at once is half a step late. "
        f"{as_held * bool(coupling.hold)}Otherwise record at shorter steps, or export the model "
        "for Model Exchange."
    )


def _late(late: LateSignals) -> str:
    """Signals that are late, and what to do, for people."""
    if len({*late.skews.values()}) > 1:
        skews = ", ".join(f"{name} by {with_unit(skew, 's')}" for name, skew in late.skews.items())
        return (
            f"Signals are late by different times: {skews}. Say in [loggers] which signals share a "
            "logger, and diagnose again."
        )
    size, reach = abs(late.skew), BAND * late.sigma
    by = with_interval(size, size - reach, size + reach, "s")
    way = "late" if late.skew > 0.0 else "early"
    signals = " and ".join(late.signals)
    verb, has = ("is", "it") if len(late.signals) == 1 else ("are", "them")
    named = ", ".join(f'"{name}"' for name in late.signals)
    return (
        f"{signals} {verb} {way} by {by} against the other signals, and no logger of the system "
        f"file has {has} alone. If a logger of its own records {has}, add own = [{named}] to "
        "[loggers] and diagnose again; then this is a cause with its size."
    )


def _cause_lines(cause: Cause) -> list[str]:
    lines = [f"{cause.effect.name}: {cause.effect.text}"]
    lines += [
        f"  {name}: {p.text}" if p.limit else f"  {name} = {p.text}"
        for name, p in cause.parameters.items()
    ]
    if cause.explained >= 0.0005:
        lines.append(f"  explains {cause.explained:.1%} of what can be, in cross-validation")
    if cause.confusable_with:
        lines.append(
            f"  indistinguishable from {', '.join(cause.confusable_with)} in these data; "
            f"to discriminate: {cause.effect.separation}"
        )
    return lines


def _known(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return value if np.isfinite(value) else None


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.effect.name,
        "text": cause.effect.text,
        "parameters": {name: size.to_dict() for name, size in cause.parameters.items()},
        "phases": None if cause.phases is None else [float(phase) for phase in cause.phases],
        "confusable_with": list(cause.confusable_with),
        "explained": cause.explained,
        "separation": cause.effect.separation,
    }


def _candidate(score: CandidateScore) -> dict[str, Any]:
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


def _require_recording(name: str, known: Collection[str]) -> None:
    require_known([name], known, where=f"recording '{name}'", found="no recording of this name")
