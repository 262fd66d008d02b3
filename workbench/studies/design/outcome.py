"""Which experiment to make next, as a value: a sentence, numbers, a table, a figure."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.diagnosis.inference.rivals import Rivals
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.studies.design.prediction import Prediction
from workbench.system.comparison import Channel
from workbench.system.system import System

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

PROPOSED = 3
_LEAST = 0.05  # standard deviations, which are told as 0.0


@dataclass(frozen=True, eq=False)
class RankedExperiment:
    """An experiment, and what it would tell."""

    text: str  # what to do, for people
    cost: float  # of it, in `unit`
    unit: str
    prediction: Prediction

    @property
    def measures(self) -> str:
        """What it would tell and cost, for people."""
        prediction, cost = self.prediction, f"cost {self.cost:.3g} {self.unit}"
        if len(prediction.pairwise) == 1:
            return f"precision gain {_ratio(prediction):.2g}, {cost}"
        several = 1 < len(prediction.groups) < len(prediction.pairwise)
        group = " or its group" if several else ""
        separation = f"separation {prediction.separation:.1f} standard deviations"
        if prediction.separation < _LEAST:
            separation = "no separation beside what the models leave unexplained"
        named = f"chance {prediction.right:.0%} that the right one{group} is then named"
        return f"{separation}, {named}, {cost}"

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts."""
        prediction = self.prediction
        return {
            "experiment": self.text,
            "groups": [list(group) for group in prediction.groups],
            "separation": prediction.separation,
            "chance": prediction.right,
            "separations": np.sqrt(np.maximum(0.0, prediction.pairwise)).tolist(),
            "deviation": {"before": prediction.precision[0], "after": prediction.precision[1]},
            "cost": {"value": self.cost, "unit": self.unit},
            "duration": float(prediction.case.time[-1] - prediction.case.time[0]),
            "inputs": {
                profile.input.name: {
                    "profile": profile.shape,
                    "levels": profile.levels,
                    "every": profile.period,
                }
                for profile in prediction.candidate.profiles
            },
            "conditions": {
                name: list(value) if isinstance(value, tuple) else value
                for name, value in prediction.case.conditions.items()
            },
            "settings": {
                name: setting.value
                for name, setting in prediction.candidate.settings.items()
                if name not in prediction.case.conditions
            },
        }


@dataclass(frozen=True, eq=False)
class NextStop:
    """Experiments, best first.

    Attributes
    ----------
    rivals : what they are to tell apart; of a single one, how large it is.
    channels : that are compared.
    tried : all experiments.
    sensors : the best one with a further sensor, by what that measures; of those that part more
        than any without.
    """

    system: System
    rivals: Rivals
    channels: tuple[Channel, ...]
    tried: tuple[RankedExperiment, ...]
    sensors: dict[str, RankedExperiment]

    @property
    def proposals(self) -> tuple[RankedExperiment, ...]:
        """The best ones."""
        return self.tried[:PROPOSED]

    @property
    def names(self) -> tuple[str, ...]:
        """The candidates, by their effects."""
        return tuple(" with ".join(model.effects) for model in self.rivals.models)

    @property
    def parts(self) -> bool:
        """Whether the best one likely discriminates any of the candidates."""
        return len(self.tried[0].prediction.groups) > 1

    @property
    def sentence(self) -> str:
        """The answer in one or two sentences."""
        best = self.tried[0]
        prediction = best.prediction
        if len(self.names) == 1:
            gain = f"by a factor of {_ratio(prediction):.2g}"
            return f"Next: {best.text}. It narrows the interval of {self.names[0]} {gain}."
        sentences = []
        if self.parts:
            sentences.append(
                f"Next: {best.text}. It discriminates {self._groups(prediction)} by "
                f"{prediction.separation:.1f} standard deviations."
            )
        for group in prediction.groups:
            if len(group) > 1:
                names = " and ".join(self.names[i] for i in group)
                sentences.append(
                    f"No experiment here likely discriminates {names}, "
                    f"whichever is true{self._drowned}."
                )
        for sensor, experiment in self.sensors.items():
            groups = self._groups(experiment.prediction)
            sentences.append(f"A sensor of {sensor} would part {groups}: {experiment.text}.")
        return " ".join(sentences)

    @property
    def _drowned(self) -> str:
        """Why differences do not show, where models leave far more than noise; else empty."""
        left = self.rivals.variance_factors
        if left.max() < Thresholds.wrong:
            return ""
        channel = self.channels[int(left.argmax())].label
        return (
            f": what they leave of {channel}, {np.sqrt(left.max()):.3g} times the noise, drowns "
            "their difference. Look for its cause first, with workbench diagnose ... --propose"
        )

    def _groups(self, prediction: Prediction) -> str:
        groups = (" or ".join(self.names[i] for i in group) for group in prediction.groups)
        return " from ".join(groups)

    def summary(self) -> str:
        """The answer and the best experiments, for people."""
        lines = [self.sentence]
        for number, proposal in enumerate(self.proposals, 1):
            lines += [f"{number}. {proposal.text}", f"   {proposal.measures}"]
        return "\n".join(lines)

    def to_frame(self) -> "pd.DataFrame":
        """All that were tried, best first."""
        import pandas as pd

        columns = ("experiment", "separation", "chance", "deviation_before", "deviation_after")
        rows = [
            (e.text, e.prediction.separation, e.prediction.right, *e.prediction.precision, e.cost)
            for e in self.tried
        ]
        return pd.DataFrame(rows, columns=[*columns, f"cost [{self.tried[0].unit}]"])

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and texts; the keys of the first level are a contract."""
        return {
            "sentence": self.sentence,
            "rivals": list(self.names),
            "parts": self.parts,
            "tried": [experiment.to_dict() for experiment in self.tried],
            "sensors": {name: sensor.to_dict() for name, sensor in self.sensors.items()},
        }

    def plot(self) -> "Figure":
        """Figure of the best experiments, and of what each candidate leaves of the first."""
        from workbench.studies.design.report import responses_figure

        return responses_figure(self)

    def _repr_html_(self) -> str:
        """The answer and the table of experiments, for notebooks."""
        return f"<p>{escape(self.sentence)}</p>{self.to_frame().to_html(index=False)}"


def _ratio(prediction: Prediction) -> float:
    return prediction.precision[0] / prediction.precision[1]


def rank(ranked: Sequence[Prediction]) -> list[Prediction]:
    """Best first: by pairs that are told apart, then by separation, then by precision."""

    def worth(prediction: Prediction) -> tuple[float, float, float]:
        return (
            float(np.round(prediction.chance.sum(), 2)),
            prediction.separation,
            _ratio(prediction),
        )

    return sorted(ranked, key=worth, reverse=True)
