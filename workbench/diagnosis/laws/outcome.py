"""What was proposed, as a value: sentences, tables, a figure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtr

from workbench.arrays import Vector
from workbench.diagnosis import Cause, Errors, Gain, Outcome
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.laws.forms import MARK, ClosedForm
from workbench.diagnosis.laws.free import FittedLaw
from workbench.diagnosis.laws.scan import LawScore
from workbench.system.units import BAND

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_CHANCE = 0.05  # that held-out recordings fare better with a law that is none
_WORTH = 0.1  # share of an error that a law removes at least
_NONE = "No law is proposed"


@dataclass(frozen=True, eq=False)
class Proposal:
    """A law for what no effect explains, or why there is none.

    Attributes
    ----------
    before : of the diagnosis without them.
    prospects : of all laws as free functions about the nominal model, the likeliest first.
    estimates : those that were fitted in full, the likeliest first.
    tied : of them, those that these recordings do not tell from the first.
    forms : of the closed forms of these the one that explains most, and those that are as good, by
        name of their class.
    outcome : of the diagnosis with them beside the catalogue; None if it was not made.
    """

    before: Outcome
    prospects: tuple[LawScore, ...]
    estimates: tuple[FittedLaw, ...]
    tied: tuple[FittedLaw, ...]
    forms: Mapping[str, ClosedForm]
    outcome: Outcome | None

    @property
    def laws(self) -> tuple[Cause, ...]:
        """What was found of them, and holds on recordings that were held out."""
        if self.outcome is None or not self._supported(self.outcome):
            return ()
        return tuple(
            cause for cause in self.outcome.diagnosis.causes if cause.effect.name in self.forms
        )

    def _supported(self, outcome: Outcome) -> bool:
        """Whether errors fall by what is worth a law, and, of what was explained, with less.

        On recordings that were never fitted those of a channel at least, and not those of all
        together; without such, of what is held out in turn, by a paired t-test of its mean squares.
        """
        gain = outcome.diagnosis.gain
        if gain is None or gain.after > (1.0 - _WORTH) * self._error_before(gain):
            return False
        held_out = [error for error in outcome.errors if error.held_out]
        if held_out and not _falls(held_out):
            return False
        if worse_everywhere(held_out, self.before.errors):
            return False
        if not held_out:
            before, after = np.square(list(gain.recordings.values())).T
            fall = before - after
            student = fall.mean() / fall.std(ddof=1) * np.sqrt(fall.size)
            if not stdtr(fall.size - 1, -student) < _CHANCE:
                return False
        if self.before.diagnosis.verdict == "unexplained":
            return True
        return description_length(outcome.diagnosis.best) < description_length(
            self.before.diagnosis.best
        )

    def _error_before(self, gain: Gain) -> float:
        """Error on what is held out in turn without a law, but with the causes it is beside."""
        before = self.before.diagnosis
        beside = len(before.causes) == 1 or before.verdict == "partly explained"
        return before.gain.after if before.gain and beside else gain.before

    @property
    def sentence(self) -> str:
        """The answer in a few sentences."""
        if not self.tied:
            return f"{_NONE}: no function of one quantity in one place explains what is missing."
        first = self.tied[0].law
        others = list(dict.fromkeys(law.law.short for law in self.tied[1:]))
        where = first.text + f" (or {', '.join(others)})" * bool(others)
        if not self.laws or self.outcome is None or (gain := self.outcome.diagnosis.gain) is None:
            why = "no closed form of it holds on recordings that it was not fitted to"
            if self.before.diagnosis.verdict == "found":
                why = "with none of its closed forms is the description shorter"
            return f"{_NONE}: what is missing may be {where}, but {why}."
        known = [
            cause.effect.name
            for cause in self.outcome.diagnosis.causes
            if cause.effect.name not in self.forms
        ]
        beside = f", beside {' and '.join(known)}" * bool(known)
        part = ", a part of what is missing" * (self.outcome.system.comparison.left == 1.0)
        errors = f"{self._error_before(gain):.1f} to {gain.after:.1f}"
        return (
            f"{MARK.capitalize()}{part}: {'; and '.join(map(self.text_of, self.laws))}{beside}. In "
            f"cross-validation the error falls from {errors} times the noise. As a "
            f"free function it is {where}."
        )

    def text_of(self, cause: Cause) -> str:
        """A law in a sentence, with those that are as good."""
        alike = [
            f"{form.law.short}, {form.form.text}"
            for name, form in self.forms.items()
            if name != cause.effect.name
        ]
        others = [*alike, *cause.confusable_with]
        return self.forms[cause.effect.name].text + f" (or {'; '.join(others)})" * bool(others)

    def summary(self) -> str:
        """The answer and what it rests on, for people."""
        lines = [self.sentence]
        for cause in self.laws:
            lines += ["", f"{cause.effect.name}, {MARK}: {self.forms[cause.effect.name].text}"]
            lines += [
                f"  {name}: {parameter.text}"
                if parameter.limit
                else f"  {name} = {parameter.value:.4g} {parameter.unit}, "
                f"95 %: {parameter.low:.4g} to {parameter.high:.4g}"
                for name, parameter in cause.parameters.items()
            ]
            lines.append(f"  explains {cause.explained:.1%} of what can be, in cross-validation")
        if self.laws and self.outcome is not None and self.outcome.extension is not None:
            extension = self.outcome.extension
            lines += ["", f"extended model: {extension.modelica}, {extension.fmu}"]
        return "\n".join(lines)

    def to_frame(self) -> "pd.DataFrame":
        """Laws as free functions, the likeliest first; those fitted in full before the others."""
        import pandas as pd

        fitted = {id(estimate.prospect): estimate for estimate in self.estimates}
        rows = []
        for prospect in (*(e.prospect for e in self.estimates), *self.prospects):
            if id(prospect) in fitted or prospect not in [e.prospect for e in self.estimates]:
                full = fitted.pop(id(prospect), None)
                law = prospect.law
                rows.append(
                    {
                        "slot": law.place.slot.name,
                        "output": law.place.output.name,
                        "carrier": law.carrier.text,
                        "depends_on": "" if law.influence is None else law.influence.text,
                        "log_evidence_nominal": prospect.smoothness.evidence,
                        "log_evidence": None if full is None else full.evidence,
                        "tied": full is not None and full in self.tied,
                    }
                )
        return pd.DataFrame(rows)

    def functions(self) -> "pd.DataFrame":
        """Estimated functions with their 95 % bands, and those of their shapes, in SI units."""
        import pandas as pd

        tables = []
        for estimate in self.estimates:
            if estimate.law.influence is None:
                continue
            values, function, sigma, shape = estimate.function()
            tables.append(
                pd.DataFrame(
                    {
                        "slot": estimate.law.place.slot.name,
                        "output": estimate.law.place.output.name,
                        "carrier": estimate.law.carrier.text,
                        "depends_on": estimate.law.influence.text,
                        "unit": estimate.law.influence.unit,
                        "value": values,
                        "function_unit": estimate.law.carrier.unit,
                        "function": function,
                        "low": function - BAND * sigma,
                        "high": function + BAND * sigma,
                        "shape_low": function - BAND * shape,
                        "shape_high": function + BAND * shape,
                    }
                )
            )
        return pd.concat(tables) if tables else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        return {
            "sentence": self.sentence,
            "mark": MARK,
            "tied": [law.law.text for law in self.tied],
            "alike": {name: form.text for name, form in self.forms.items()},
            "laws": [
                {
                    "class": cause.effect.name,
                    "slot": self.forms[cause.effect.name].law.place.slot.name,
                    "text": self.forms[cause.effect.name].text,
                    "parameters": {name: p.to_dict() for name, p in cause.parameters.items()},
                    "confusable_with": list(cause.confusable_with),
                    "explained": cause.explained,
                }
                for cause in self.laws
            ],
        }

    def plot(self) -> "Figure":
        """Figure of the functions that were estimated, those that are tied first."""
        from workbench.diagnosis.laws.report import functions_figure

        return functions_figure(self)


def worse_everywhere(errors: Sequence[Errors], earlier: Sequence[Errors]) -> bool:
    """Whether effects that were there before predict every held-out recording better."""
    known = {(e.recording, e.channel): e.rms[1] for e in earlier if e.held_out}
    pairs = [
        (error.rms[1], known[error.recording, error.channel])
        for error in errors
        if (error.recording, error.channel) in known
    ]
    return bool(pairs) and all(after > before for after, before in pairs)


def _falls(errors: Sequence[Errors]) -> bool:
    """Whether errors fall, in units of what they were, and those of a channel by what is worth it.

    Channels have units of their own.
    """
    squares: dict[str, Vector] = {}
    for error in errors:
        square = error.samples * np.square(error.rms)
        squares[error.channel] = squares.get(error.channel, np.zeros(2)) + square
    shares = np.array([after / before for before, after in squares.values() if before > 0.0])
    return bool(shares.size and shares.min() <= (1.0 - _WORTH) ** 2 and shares.mean() < 1.0)


def description_length(best: FittedModel) -> float:
    """What recordings and the sizes of causes take to be told [nat], up to a constant.

    Half the deviance, and half the logarithm of the number of means that last for each parameter.
    Source: J. Rissanen (1978), Automatica 14, 465-471; G. Schwarz (1978), Ann. Stat. 6, 461-464.
    """
    lin = best.linearised
    count = sum(recording.blocks.sum() for recording in lin.residuals) / lin.lasting
    return 0.5 * lin.deviance + 0.5 * len(best.point.sizes) * math.log(count)
