"""Experiments as a worker foresees them: recorded as rivals predict them, counted, compared."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from workbench.diagnosis.data.counting import CountedSamples, count
from workbench.diagnosis.data.motion import OpenModel, opened
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.rivals import Rival
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.diagnosis.inference.unknowns import ALL
from workbench.errors import InputError
from workbench.models.fmu import CoSimulation
from workbench.recordings.case import Case
from workbench.studies.design.candidates import Experiment
from workbench.studies.design.prediction import DesignProblem, Prediction, predicted
from workbench.studies.design.recorded import recorded
from workbench.system.comparison import Channel
from workbench.system.expression import Expression
from workbench.system.parts import Signal
from workbench.system.system import System


class ExperimentPredictor:
    """The model with all effects, at hand for one experiment after the other."""

    def __init__(self, asked: DesignProblem, model: CoSimulation, derived: OpenModel) -> None:
        self._asked, self._model, self._derived = asked, model, derived

    def predict_experiment(
        self, candidate: Experiment, number: int, sensor: Signal | None, in_full: bool
    ) -> Prediction | None:
        """What an experiment would tell; None where it would not count.

        Parameters
        ----------
        number : of the recording.
        sensor : that it has besides.
        in_full : see `predicted`.
        """
        asked = self._asked
        if sensor is not None:
            asked = replace(asked, system=with_sensor(asked.system, sensor))
        case = self._recorded(asked, candidate, asked.rivals.models[0], number)
        if not counts(case, asked.system):
            return None
        return predicted(asked, self._derived, candidate, case, in_full=in_full)

    def confirm(self, prediction: Prediction, number: int) -> Prediction | None:
        """The same with models fitted again in full; None where not all rivals claim it alike.

        They do where all stay within what the system claims, or leave it for the same reasons. What
        one of them alone takes out of the claims is foreseen by none.
        """
        asked = self._asked
        first = left_claims(prediction.case, asked.system)
        if first is None:
            return None
        for rival in asked.rivals.models[1:]:
            other = self._recorded(asked, prediction.candidate, rival, number)
            if left_claims(other, asked.system) != first:
                return None
        return predicted(asked, self._derived, prediction.candidate, prediction.case, in_full=True)

    def _recorded(
        self, asked: DesignProblem, candidate: Experiment, rival: Rival, number: int
    ) -> Case:
        """A recording of an experiment as a rival predicts it."""
        system, experiments = asked.system, asked.experiments
        added = {sensor.name for sensor in experiments.sensors}
        named = {*asked.rivals.signals, *added}
        judged = tuple(signal.name for signal in system.reference_signals if signal.name in named)
        values = _values(asked, candidate, rival)
        rest = (f"{number:03}", judged, number)
        return recorded(self._model, system, experiments, candidate, values, *rest)


@contextmanager
def open_predictor(asked: DesignProblem) -> Iterator[ExperimentPredictor]:
    """What a worker is prepared with."""
    with CoSimulation(asked.everything) as model, opened(asked.source) as derived:
        yield ExperimentPredictor(asked, model, derived)


def _values(asked: DesignProblem, candidate: Experiment, rival: Rival) -> dict[str, float]:
    """Parameters of a rival in an experiment."""
    system, rivals, effects = asked.system, asked.rivals, asked.effects
    values = dict(rivals.given)
    for condition in system.conditions:
        setting = candidate.settings.get(condition.name)
        usual = condition.choices[0] if condition.choices else ""
        values |= condition.means(setting.value if setting else usual)
    for (name, choice), level in rival.levels.items():
        if name in system.comparison.levels and choice in _choices(system, name, candidate):
            values[name] = level
    for (name, parameter), size in rival.sizes.items():
        part = "cosine" if parameter == "amplitude" else parameter
        if effects[name].late:
            continue  # a matter of its recording, not of the model
        for variable in variables(effects[name], part):
            start = rivals.given.get(variable, 0.0) if part in effects[name].sizes else 0.0
            values[variable] = start + size
    return values


def _choices(system: System, level: str, candidate: Experiment) -> set[str]:
    """What the level of a parameter may be called in an experiment."""
    by = system.comparison.levels[level].by
    if not by:
        return {ALL}
    setting = candidate.settings.get(by)
    if setting is None:
        return {str(system.condition(by).choices[0])}
    said = setting.value if isinstance(setting.value, tuple) else (setting.value,)
    return set(map(str, said))


def with_sensor(system: System, sensor: Signal) -> System:
    """The system with a further signal that is compared."""
    channel = Channel(
        sensor.name,
        sensor.unit,
        sensor.label,
        sensor.shown,
        Expression(sensor.name, f"{system.source}, [next.sensors.{sensor.name}]"),
    )
    compared = replace(system.comparison, channels=(*system.comparison.channels, channel))
    return replace(
        system, reference_signals=(*system.reference_signals, sensor), comparison=compared
    )


def counts(case: Case, system: System) -> bool:
    """Whether a recording has enough that counts."""
    return _counted(case, system, restarting=True) is not None


def left_claims(case: Case, system: System) -> set[str] | None:
    """Reasons why samples do not count, but for its end; None where too few do."""
    counted = _counted(case, system, restarting=False)
    if counted is None:
        return None
    reasons = [
        exclusion.reason for exclusion in system.comparison.exclusions if not exclusion.to_the_end
    ]
    return {reason for reason in reasons if counted.excluded[reason].any()}


def _counted(case: Case, system: System, *, restarting: bool) -> CountedSamples | None:
    try:
        return count(case, system, tuple(case.signals), SOUND, restarting=restarting)
    except InputError:
        return None
