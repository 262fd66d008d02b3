"""What was proposed, as a value: sentences, tables, a figure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from workbench.diagnosis import Cause, Outcome
from workbench.proposing.forms import MARK, Candidate
from workbench.proposing.free import Estimate
from workbench.proposing.scan import Prospect
from workbench.system import System

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_QUANTILE = 1.96  # of a normal distribution, 95 %
_NONE = "No law is proposed"


@dataclass(frozen=True, eq=False)
class Proposal:
    """A law for what no effect explains, or why there is none.

    Attributes
    ----------
    prospects : of all laws as free functions about the nominal model, the likeliest first.
    estimates : those that were fitted in full, the likeliest first.
    tied : of them, those that these recordings do not tell from the first.
    forms : closed forms of these, by name of their class.
    outcome : of the diagnosis with them beside the catalogue; None if it was not made.
    """

    system: System
    prospects: tuple[Prospect, ...]
    estimates: tuple[Estimate, ...]
    tied: tuple[Estimate, ...]
    forms: Mapping[str, Candidate]
    outcome: Outcome | None

    @property
    def laws(self) -> tuple[Cause, ...]:
        """What was found of them, and holds on recordings that were held out."""
        if self.outcome is None or not self._supported(self.outcome):
            return ()
        return tuple(
            cause for cause in self.outcome.diagnosis.causes if cause.effect.name in self.forms
        )

    @staticmethod
    def _supported(outcome: Outcome) -> bool:
        """Whether errors fall on what was held out, also on recordings that were not fitted."""
        gain = outcome.diagnosis.gain
        held_out = [one for one in outcome.errors if one.held_out]
        before, after = (sum(one.samples * one.rms[i] ** 2 for one in held_out) for i in (0, 1))
        return gain is not None and gain.high < gain.before and (not held_out or after < before)

    @property
    def sentence(self) -> str:
        """The answer in a few sentences."""
        if not self.tied:
            return f"{_NONE}: no function of one quantity in one place explains what is missing."
        where = " or ".join(dict.fromkeys(one.law.text for one in self.tied))
        if not self.laws:
            return (
                f"{_NONE}: what is missing may be {where}, but no closed form of it holds on "
                "recordings that were held out."
            )
        assert self.outcome is not None
        assert self.outcome.diagnosis.gain is not None
        said = [
            f"{self.forms[cause.effect.name].text}"
            + f" (or {', '.join(cause.confusable_with)})" * bool(cause.confusable_with)
            for cause in self.laws
        ]
        known = [
            cause.effect.name
            for cause in self.outcome.diagnosis.causes
            if cause.effect.name not in self.forms
        ]
        beside = f", beside {' and '.join(known)}" * bool(known)
        gain = self.outcome.diagnosis.gain
        return (
            f"{MARK.capitalize()}: {'; and '.join(said)}{beside}. On held-out recordings the error "
            f"falls from {gain.before:.1f} to {gain.after:.1f} times the noise. As a free function "
            f"it is {where}."
        )

    def summary(self) -> str:
        """The answer and what it rests on, for people."""
        lines = [self.sentence]
        for cause in self.laws:
            lines += ["", f"{cause.effect.name}, {MARK}: {self.forms[cause.effect.name].text}"]
            lines += [
                f"  {name} = {one.value:.4g} {one.unit}, 95 %: {one.low:.4g} to {one.high:.4g}"
                for name, one in cause.parameters.items()
            ]
            lines.append(f"  explains {cause.explained:.1%} of what can be, on held-out recordings")
        if self.laws and self.outcome is not None and self.outcome.extension is not None:
            extension = self.outcome.extension
            lines += ["", f"extended model: {extension.modelica}, {extension.fmu}"]
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """Laws as free functions, the likeliest first; those fitted in full before the others."""
        fitted = {id(one.prospect): one for one in self.estimates}
        rows = []
        for one in (*(e.prospect for e in self.estimates), *self.prospects):
            if id(one) in fitted or one not in [e.prospect for e in self.estimates]:
                full = fitted.pop(id(one), None)
                law = one.law
                rows.append(
                    {
                        "slot": law.place.slot.name,
                        "output": law.place.output.name,
                        "carrier": law.carrier.text,
                        "depends_on": "" if law.influence is None else law.influence.text,
                        "log_evidence_nominal": one.smoothness.evidence,
                        "log_evidence": None if full is None else full.evidence,
                        "tied": full is not None and full in self.tied,
                    }
                )
        return pd.DataFrame(rows)

    def functions(self) -> pd.DataFrame:
        """Estimated functions with their 95 % bands, in SI units."""
        tables = []
        for one in self.estimates:
            if one.law.influence is None:
                continue
            values, function, sigma = one.function()
            tables.append(
                pd.DataFrame(
                    {
                        "slot": one.law.place.slot.name,
                        "output": one.law.place.output.name,
                        "carrier": one.law.carrier.text,
                        "depends_on": one.law.influence.text,
                        "unit": one.law.influence.unit,
                        "value": values,
                        "function_unit": one.law.carrier.unit,
                        "function": function,
                        "low": function - _QUANTILE * sigma,
                        "high": function + _QUANTILE * sigma,
                    }
                )
            )
        return pd.concat(tables) if tables else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        return {
            "sentence": self.sentence,
            "mark": MARK,
            "tied": [one.law.text for one in self.tied],
            "laws": [
                {
                    "class": cause.effect.name,
                    "slot": self.forms[cause.effect.name].law.place.slot.name,
                    "text": self.forms[cause.effect.name].text,
                    "parameters": {
                        name: {"value": p.value, "low": p.low, "high": p.high, "unit": p.unit}
                        for name, p in cause.parameters.items()
                    },
                    "confusable_with": list(cause.confusable_with),
                    "explained": cause.explained,
                }
                for cause in self.laws
            ],
        }

    def plot(self) -> "Figure":
        """Figure of the functions that were estimated, those that are tied first."""
        from workbench.report.proposal import functions_figure

        return functions_figure(self)
