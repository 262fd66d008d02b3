"""What a fit found: values, what cannot be identified, errors before and after."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from workbench.arrays import Matrix
from workbench.observers.trust import Contradiction, residual_tests, variance_test
from workbench.recordings.case import Case

if TYPE_CHECKING:
    import pandas as pd

Loss = Literal["linear", "soft_l1"]
LOSSES: tuple[Loss, ...] = ("linear", "soft_l1")
_SAME = 0.1  # by which exponents of a direction differ that are called a product or a ratio


@dataclass(frozen=True)
class FittedValue:
    """A fitted parameter, or the start of a state."""

    name: str
    recording: str  # that it belongs to; empty: all
    unit: str
    is_state: bool
    nominal: float  # of the model, or of what the first samples show
    value: float
    # low, high: of the 95 % interval; None where there is none
    low: float | None = None
    high: float | None = None
    deviation: float | None = None  # standard deviation; None where there is none
    method: str = ""  # of the interval, "profile" or "covariance"; empty without
    identified: bool = True  # whether the recordings tell it
    at_bound: bool = False  # whether it is at its bound, where it would go on

    @property
    def label(self) -> str:
        """The name, with what parts it from others of the same name."""
        start = f"start of {self.name}" if self.is_state else self.name
        return f"{start} in {self.recording}" if self.recording else start


@dataclass(frozen=True)
class Direction:
    """Unknowns that change together without an effect on the outputs."""

    parts: Mapping[str, float]  # relative change of each, by its label; 1 of the leading one
    # of the leading one, 1 is all of its size: standard deviation that the data leave
    spread: float
    shown: bool = True  # whether any output moves with it, however little

    def __str__(self) -> str:
        names = list(self.parts)
        if len(names) == 1:
            less = "outputs show it less than the errors that remain"
            return f"{names[0]}: {less if self.shown else 'no output shows it'}"
        moves = ", ".join(f"{name} {change:+.2g} %" for name, change in self.parts.items())
        if len(names) == 2 and abs(abs(min(self.parts.values(), key=abs)) - 1.0) < _SAME:
            first, second = self.parts.values()
            form = "product" if first * second < 0.0 else "ratio"
            sign = "*" if first * second < 0.0 else "/"
            term = f"{form} {names[0]}{sign}{names[1]}"
            return f"{' and '.join(names)}: only their {term} is identifiable"
        return f"{', '.join(names)}: they compensate each other ({moves})"


@dataclass(frozen=True, eq=False)
class RecordingFit:
    """A recording beside the model with its own and with fitted values."""

    case: Case
    counted: np.ndarray  # (n, l) samples that are compared
    sigma: Matrix  # (n, l) standard deviations of their noise
    # nominal, fitted: (n, l) simulated outputs; NaN where the model could not be simulated
    nominal: Matrix
    fitted: Matrix
    held_out: bool = False

    def residuals(self, simulated: Matrix) -> Matrix:
        """(n, l) measured less simulated; NaN where not compared."""
        measured = np.column_stack([self.case[name] for name in self.case.outputs])
        return np.where(self.counted, measured - simulated, np.nan)

    def error(self, simulated: Matrix) -> float:
        """Root mean square of all residuals over their noise."""
        return float(np.sqrt(np.nanmean((self.residuals(simulated) / self.sigma) ** 2)))

    def errors(self, simulated: Matrix) -> dict[str, float]:
        """Root mean square by output, in its unit."""
        squares = self.residuals(simulated) ** 2
        return {
            name: float(np.sqrt(np.nanmean(squares[:, k])))
            for k, name in enumerate(self.case.outputs)
        }

    def contradictions(self) -> list[Contradiction]:
        """Tests that contradict residuals that are the declared noise."""
        residuals = self.residuals(self.fitted)
        known = np.isfinite(residuals)
        squares = np.where(known, (residuals / self.sigma) ** 2, 0.0).sum(axis=1)
        counts = known.sum(axis=1)
        names = self.case.outputs
        return variance_test(squares[counts > 0], counts[counts > 0]) + residual_tests(
            {name: residuals[:, k] for k, name in enumerate(names)},
            {name: self.sigma[:, k] for k, name in enumerate(names)},
        )


def residual_doubts(fit: RecordingFit) -> Iterator[str]:
    """Why residuals of a recording contradict the fit, in words."""
    if np.isnan(fit.fitted).any():
        yield f"{fit.case.name}: the fitted model could not be simulated"
        return
    for test in fit.contradictions():
        of = f"{fit.case.name}: residuals"
        if test.test == "variance":
            if test.narrow:
                yield (
                    f"{of} have {test.value:.1f} times the variance of the declared noise: the "
                    "model lacks something, or the noise is larger; intervals are widened by it"
                )
        elif test.test == "mean":
            yield f"{of} of {test.signal} have a mean of {abs(test.value):.1f} times the noise"
        elif test.narrow:
            yield (
                f"{of} of {test.signal} follow each other: the model lacks something, and "
                "intervals are too narrow"
            )


@dataclass(frozen=True, eq=False)
class FitOutcome:
    """Fitted values, how sure they are, and what they are worth.

    Attributes
    ----------
    correlation : (p, p) of the values, in their order.
    directions : that cannot be identified.
    recordings : fitted ones, then those that were held out.
    doubts : why the values may not be relied on; empty: nothing speaks against them.
    costs : half the sum of squares, or of the loss, that each local fit reached.
    evolved : what differential evolution found; empty: it was not needed.
    """

    values: tuple[FittedValue, ...]
    correlation: Matrix
    directions: tuple[Direction, ...]
    recordings: tuple[RecordingFit, ...]
    doubts: tuple[str, ...]
    costs: tuple[float, ...]
    evolved: str
    loss: str
    interrupted: bool

    @property
    def reliable(self) -> bool:
        """Whether the values may be relied on."""
        return not self.doubts

    @property
    def is_contradicted(self) -> bool:
        """Whether residuals of a recording that was fitted contradict the model."""
        return any(any(residual_doubts(fit)) for fit in self.recordings if not fit.held_out)

    def __getitem__(self, label: str) -> FittedValue:
        """A value by its label."""
        return next(value for value in self.values if value.label == label)

    def to_frame(self) -> "pd.DataFrame":
        """A row for each value."""
        import pandas as pd

        return pd.DataFrame([{"label": value.label, **vars(value)} for value in self.values])

    def correlations(self) -> list[tuple[str, str, float]]:
        """Pairs of identified values with correlated errors, strongest first.

        From 0.9 on: alone, each would be known more than twice as well, 1/sqrt(1 - 0.9^2).
        """
        pairs = [
            (a.label, b.label, float(self.correlation[i, j]))
            for i, a in enumerate(self.values)
            for j, b in enumerate(self.values[:i])
            if a.identified and b.identified and abs(self.correlation[i, j]) >= 0.9
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))

    def sentence(self) -> str:
        """The result in a sentence."""
        shared = [value for value in self.values if not value.is_state]
        texts = [format_value(value) for value in (shared or self.values)[:4]]
        texts += [f"{len(shared) - 4} more"] * (len(shared) > 4)
        verdict = "Fitted" if self.reliable else "Fitted, not to be relied on"
        return f"{verdict}: {'; '.join(texts)}."

    def to_dict(self) -> dict[str, Any]:
        """As summary.json has it."""
        return {
            "sentence": self.sentence(),
            "reliable": self.reliable,
            "doubts": list(self.doubts),
            "values": {value.label: vars(value) for value in self.values},
            "correlation": self.correlation.tolist(),
            "not_identified": [
                {"text": str(direction), "parts": dict(direction.parts), "spread": direction.spread}
                for direction in self.directions
            ],
            "recordings": {
                fit.case.name: {
                    "held_out": fit.held_out,
                    "rms": {
                        name: {"nominal": before, "fitted": fit.errors(fit.fitted)[name]}
                        for name, before in fit.errors(fit.nominal).items()
                    },
                    "over_noise": {
                        "nominal": fit.error(fit.nominal),
                        "fitted": fit.error(fit.fitted),
                    },
                }
                for fit in self.recordings
            },
            "loss": self.loss,
            "costs": list(self.costs),
            "differential_evolution": self.evolved,
            "interrupted": self.interrupted,
        }


def format_value(value: FittedValue) -> str:
    """A value with its interval, as people read it."""
    unit = "" if value.unit == "1" else f" {value.unit}"
    text = f"{value.label} = {value.value:.5g}{unit}"
    if not value.identified:
        return f"{text} (not identified)"
    if value.low is None or value.high is None:
        return text
    return f"{text} (95 %: {value.low:.5g} to {value.high:.5g})"
