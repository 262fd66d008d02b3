"""Signals that are late by themselves: which are named, and which are none."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from workbench.diagnosis import Outcome, Problem, catalogue, diagnose, read_effects
from workbench.diagnosis.data.clocks import late_signals
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference import timing
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Quadratic
from workbench.diagnosis.inference.thresholds import thresholds
from workbench.diagnosis.inference.timing import LateSignals, by_themselves
from workbench.diagnosis.run import build_everything
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.models.modelica import read_library
from workbench.runtime.engine import Engine
from workbench.system.registry import load_system

from .built import declare, machine
from .heater import cases

SAMPLE = 1e-3  # [s]


class Clocks:
    """A fit in which clocks are late by given times, each sure to a microsecond, against i."""

    reference = "i"
    decides = thresholds(10)
    least_skew = 0.1 * SAMPLE

    def __init__(self, skews: Mapping[str, float]) -> None:
        self.skews = skews
        self.own_clocks = tuple(
            SimpleNamespace(name=f"TimeSkew[{signal}]", size="skew", late=(signal,))
            for signal in skews
        )

    def beside(self, effects: object) -> "Clocks":
        return self

    def at(self, point: Any) -> Any:
        return point

    def linearise(self, lin: Any, active: Any) -> Any:
        return lin

    def quadratics(self, lin: Any) -> Any:
        shared = tuple((clock.name, clock.size) for clock in lin.active)
        N = 1e12 * np.eye(len(shared))
        total = Quadratic(N, np.zeros(len(shared)), 0.0, 0)
        return SimpleNamespace(shared=shared, total=lambda: total)


def inferred(skews: Mapping[str, float], monkeypatch: pytest.MonkeyPatch) -> LateSignals | None:
    """What is late, where nothing else was found and much is wrong without clocks."""
    fit = Clocks(skews)

    def model(left: float, active: Any = ()) -> Any:
        sizes = {(c.name, c.size): skews[c.late[0]] for c in active}
        errors = SimpleNamespace(
            variance_factors=np.ones(1),
            squares=np.ones(1),
            weighed=lambda factors: left,
            active=active,
        )
        return SimpleNamespace(linearised=errors, point=SimpleNamespace(sizes=sizes), active=active)

    monkeypatch.setattr(timing, "fitted", lambda fit, start, active, **given: model(0.0, active))
    monkeypatch.setattr(timing, "replace", lambda point, **changes: point)
    nominal = model(1e6)
    return by_themselves(fit, nominal, nominal, clean=False)


def test_one_late_signal_is_named_with_its_time(monkeypatch):
    """Six microseconds are a hundredth of a sample, however sure they are."""
    printed = inferred({"u": -6e-6, "w": 8e-3}, monkeypatch)
    assert printed.signals == ("w",)
    assert printed.skew == pytest.approx(8e-3)


def test_what_all_others_are_early_against_is_late(monkeypatch):
    printed = inferred({"u": -8e-3, "w": -8e-3}, monkeypatch)
    assert (printed.signals, printed.skew) == (("i",), pytest.approx(8e-3))


def test_signals_that_are_late_by_different_times_are_listed(monkeypatch):
    printed = inferred({"u": 3e-3, "v": -2e-3, "w": 8e-3, "x": 5e-3}, monkeypatch)
    assert printed.skews == {"u": 3e-3, "v": -2e-3, "w": 8e-3, "x": 5e-3}
    assert printed.signals == ("u", "v", "w", "x")


def test_clocks_that_are_right_are_no_cause(monkeypatch):
    assert inferred({"u": -6e-6, "w": 9e-5}, monkeypatch) is None


# --- a motor, written from its equations and simulated by SciPy ---

MOTOR, MOTOR_FILE = machine("motor")


@cache
def turned(seed: int) -> tuple[np.ndarray, ...]:
    """Voltage, current and speed at each millisecond of three seconds, without noise."""
    rng = np.random.default_rng(seed)
    x, courses = np.zeros(2), []
    spans = [300, *rng.integers(60, 400, 30)]
    for span, voltage in zip(spans, (0.0, *rng.uniform(-12.0, 12.0, 30)), strict=True):

        def rates(_: float, x: np.ndarray, voltage: float = voltage) -> list[float]:
            return [(voltage - 1.5 * x[0] - 0.08 * x[1]) / 8e-3, 0.08 * x[0] / 2e-4]

        at = np.arange(span + 1) * 1e-3
        run = solve_ivp(rates, (0.0, at[-1]), x, t_eval=at, rtol=1e-9, atol=1e-10)
        courses.append(np.vstack([np.full(span, voltage), run.y[:, :-1]]))
        x = run.y[:, -1]
    return tuple(np.concatenate(courses, axis=1)[:, :3000])


def recorded(late: Mapping[str, int], seed: int) -> pd.DataFrame:
    """A recording of the motor, signals late by so many milliseconds, held before."""
    names, rng = ("u", "i", "w"), np.random.default_rng(100 + seed)
    held = {
        name: np.concatenate([np.full(late.get(name, 0), values[0]), values])[: values.size]
        for name, values in zip(names, turned(seed), strict=True)
    }
    noise = {"u": 0.0, "i": 0.02, "w": 0.4}
    units = {"u": "V", "i": "A", "w": "rad/s"}
    return pd.DataFrame(
        {"time [s]": np.arange(3000) * 1e-3}
        | {f"{n} [{units[n]}]": v + noise[n] * rng.standard_normal(v.size) for n, v in held.items()}
    )


def diagnosis(
    late: Mapping[str, int], folder: Path, loggers: str = "", file: str = MOTOR_FILE
) -> Outcome:
    motor = folder / "motor"
    motor.mkdir()
    (motor / "package.mo").write_text(MOTOR)
    (motor / "system.toml").write_text(file + loggers)
    of = load_system(motor)
    library = read_library(of.library)
    recordings = cases(of, [recorded(late, seed) for seed in range(3)])
    return diagnose(Problem(of, recordings, library, catalogue(of, library)), Engine(out=folder))


def late_by() -> Iterator[Any]:
    """Each signal by each time; all but the hardest are long."""
    for signal, ms in itertools.product(("u", "i", "w"), (1, 2, 4, 8, 16)):
        marks = () if (signal, ms) in {("i", 16), ("w", 16)} else (pytest.mark.long,)
        yield pytest.param(signal, ms, marks=marks)


@pytest.mark.parametrize(("signal", "ms"), [*late_by()])
def test_one_late_signal_is_named_and_its_advice_leads_to_the_cause(signal, ms, tmp_path):
    """By a fraction of the motor's time constant, 5 ms, and by three of them.

    Without a logger its clock or, of the speed, its delay is named; with one the clock is a cause.
    """
    for name in ("as it was", "as advised"):
        (tmp_path / name).mkdir()
    outcome = diagnosis({signal: ms}, tmp_path / "as it was")
    late = outcome.diagnosis.late
    assert outcome.to_dict()["late"]["signals"] == (signal,)
    assert late.skew == pytest.approx(1e-3 * ms, abs=1e-4)  # a tenth of a sample
    assert f'add own = ["{signal}"] to [loggers]' in outcome.sentence
    advised = diagnosis({signal: ms}, tmp_path / "as advised", f'[loggers]\nown = ["{signal}"]\n')
    (cause,) = advised.diagnosis.causes
    assert cause.effect.name == "LoggerTimeSkew[own]"
    skew = cause.parameters["skew"]
    assert skew.low <= 1e-3 * ms <= skew.high


@pytest.mark.parametrize("signal", ["i", "w"])
def test_a_clock_that_explains_what_is_wrong_is_a_cause_from_the_least_time_on(signal, tmp_path):
    """One sample late, of which 0.6 matter; a cause beside others has to be twice as late."""
    file = MOTOR_FILE.replace("[diagnosis]", '[diagnosis]\nleast_skew = "0.6 ms"')
    late = diagnosis({signal: 1}, tmp_path, f'[loggers]\nown = ["{signal}"]\n', file)
    (cause,) = late.diagnosis.causes
    assert cause.effect.matters == pytest.approx(1.2e-3)
    assert cause.parameters["skew"].value == pytest.approx(1e-3, abs=1e-4)
    # Nothing leads this motion: an input that is moved would bend between other samples.
    assert late_signals(late.system)["LoggerTimeSkew[own].skew"] == {signal: 1.0}


def test_a_clock_tells_nothing_of_an_input_that_moves_nothing(tmp_path):
    """A thermometer in the workshop: its samples reach no output, whatever its clock says.

    Where a clock leaves the ends of a recording without input, other errors stand there, as many
    as before: their noise is no derivative.
    """
    library = MOTOR.replace(
        "    input Real u", '    input Real room(unit="K") "Room";\n    input Real u'
    )
    file = MOTOR_FILE + '[inputs.room]\nunit = "K"\nnoise = "0.1 K"\nscale = "5 K"\n'
    of = declare(tmp_path / "motor", library, file)
    frames = [recorded({}, seed) for seed in range(2)]
    rooms = [290.0 + np.random.default_rng(seed).standard_normal(3000) for seed in range(2)]
    recordings = cases(
        of, [f.assign(**{"room [K]": room}) for f, room in zip(frames, rooms, strict=True)]
    )
    effects, path = read_effects(read_library(of.library), "Observer"), tmp_path / "all.fmu"
    build_everything(of, read_library(of.library), effects, path)
    with ResidualModel(ModelSource(path, of, of.given), recordings) as simulations:
        alone = Fit(simulations, effects)
        fit = alone.beside(alone.own_clocks)
        for late in (0.0, 2.5e-3):
            sizes = {(clock.name, clock.size): late for clock in alone.own_clocks}
            lin = fit.linearise(
                fit.at(replace(fit.unknowns.start(), sizes=sizes)), alone.own_clocks
            )
            joint = fit.quadratics(lin)
            tells = dict(zip(joint.shared, np.diag(joint.total().N), strict=True))
            assert tells["TimeSkew[room]", "skew"] == 0.0
            assert tells["TimeSkew[u]", "skew"] > (1.0 / SAMPLE) ** 2


def test_signals_in_time_are_not_late(tmp_path):
    outcome = diagnosis({}, tmp_path, '[loggers]\nown = ["w"]\n')
    assert (outcome.diagnosis.verdict, outcome.diagnosis.late) == ("nothing", None)
