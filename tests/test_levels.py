"""What levels can stand for, and what wanders along a recording, by laws that are known.

A heated block loses heat to the room by two conductances that differ from block to block. A draught
adds to them, so that recordings of one block tell only the sum: what a draught is, is what they can
hardly be.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from workbench.arrays import Vector
from workbench.diagnosis import problem_of
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.score_test import ScoreTest
from workbench.diagnosis.inference.search import examine, fitted
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.diagnosis.run import with_effects
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.runtime.engine import silent
from workbench.system.parts import StateNoise
from workbench.system.system import System

from .built import declare, machine, machine_file
from .heater import NOISE, cases, diagnosed
from .heater import system as heated_block

G, SPREAD = 0.3, 0.015  # of both of the block's own conductances together [W/K]
HALVES = "".join(f"{key} = {{ spread = {SPREAD / 2**0.5 / (0.5 * G)} }}\n" for key in ("Ga", "Gb"))


def block(folder: Path, more: str) -> System:
    """The heater whose block has two conductances of its own, with more tables of its file."""
    folder.mkdir()
    own = f'  parameter Real Ga(unit="W/K") = {G / 2}, Gb(unit="W/K") = {G / 2};\n'
    library, file = machine("heater", sensor="")
    library = library.replace("  input Real P(", own + "  input Real P(")
    return declare(folder, library.replace("- loss.Q;", "- (Ga + Gb)*T - loss.Q;"), file + more)


def heated(
    powers: Vector, lost: Callable[[float], float], begin: float, rng: np.random.Generator
) -> pd.DataFrame:
    """Temperatures of a block that loses heat [W], by SciPy, each power held for a minute."""
    x, temperatures = np.full(2, begin), []
    for power in powers:

        def rates(_: float, x: Vector, power: float = power) -> list[float]:
            T, casing = x
            into = 2.0 * (T - casing)
            return [(power - into - lost(T)) / 100.0, (into - 0.5 * casing) / 200.0]

        run = solve_ivp(rates, (0.0, 60.0), x, t_eval=np.arange(61), rtol=1e-9, atol=1e-9)
        temperatures.append(run.y[0, :-1])
        x = run.y[:, -1]
    time = np.arange(60.0 * powers.size)
    measured = np.concatenate(temperatures) + NOISE * rng.standard_normal(time.size)
    return pd.DataFrame({"time [s]": time, "P [W]": np.repeat(powers, 60), "T [K]": measured})


def recorded(conductance: float, seed: int, share: float = 1.0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return heated(share * rng.uniform(10.0, 90.0, 12), lambda T: conductance * T, 0.0, rng)


def causes_of(frames: Sequence[pd.DataFrame], folder: Path) -> list[str]:
    of = block(folder / "block", f"[diagnosis.levels]\n{HALVES}")
    return [
        cause.effect.name for cause in diagnosed(of, cases(of, frames), folder).diagnosis.causes
    ]


def test_what_no_block_of_its_kind_has_is_a_cause(tmp_path):
    """Of 3.5 deviations, where 3.3 are asked for. Held-out recordings say nothing of it."""
    assert causes_of([recorded(G + 3.5 * SPREAD, seed) for seed in range(3)], tmp_path) == [
        "Draught"
    ]


def test_what_one_block_in_twenty_has_is_none(tmp_path):
    assert causes_of([recorded(G + 2.0 * SPREAD, seed) for seed in range(3)], tmp_path) == []


def test_what_a_single_recording_tells_is_none(tmp_path):
    """The others are of a block that is hardly heated."""
    frames = [recorded(G + 3.5 * SPREAD, seed, 1.0 if seed == 0 else 1e-3) for seed in range(3)]
    assert causes_of(frames, tmp_path) == []


def test_what_wanders_is_uncertain_by_as_much_as_it_moves_means(tmp_path):
    """At rest all power leaves: by the block itself, and by two conductances in series."""
    share, over, hold, power = 0.02, 30.0, 6000, 40.0
    wander = f'[diagnosis.wander]\nGc = {{ share = {share}, over = "{over} s" }}\n'
    n = np.arange(hold)
    noise = NOISE * np.random.default_rng(1).standard_normal(hold)

    def steady(casing: float) -> float:
        return power / (G + 1.0 / (1.0 / 2.0 + 1.0 / casing))

    frame = pd.DataFrame(
        {"time [s]": n.astype(float), "P [W]": power + 0.0 * n, "T [K]": steady(0.5) + noise}
    )
    variances = []
    for name, more in (("still", ""), ("wanders", wander)):
        of = block(tmp_path / name, more)
        _, path = with_effects(problem_of(of), tmp_path / name, silent)
        with ResidualModel(ModelSource(path, of, of.given), cases(of, [frame])) as simulations:
            variances.append(simulations.recordings[0].whitening[-1, 0, 0] ** -2)
            size = of.comparison.block
    moved = steady(0.5 * (1.0 + share)) - steady(0.5)
    # A mean over T of what is correlated over tau has the variance 2 tau/T; of blocks, block/T.
    assert_allclose(variances[1] - variances[0], moved**2 * 2.0 * over / size, rtol=1e-3)


def test_a_state_at_the_start_is_no_further_off_than_chance_makes_it(tmp_path):
    """A casing that is warm already, of which the file says that it is as the room within 1 K."""
    of = block(tmp_path / "block", "")
    known = replace(of, state_noise=(StateNoise("Tc", "Tc", walk=None, spread=1.0),))
    warm = recorded(G, 1).iloc[360:].reset_index(drop=True)
    warm["time [s]"] -= warm["time [s]"][0]
    asked, path = with_effects(problem_of(of), tmp_path, silent)
    effects = asked.effects
    steps = {}
    for name, system in (("free", of), ("known", known)):
        with ResidualModel(
            ModelSource(path, system, system.given), cases(system, [warm])
        ) as simulations:
            fit = Fit(simulations, effects)
            point = fit.stepped(
                fit.linearise(fit.at(fit.unknowns.start()), []), np.ones(1), {}
            ).point
            steps[name] = point.deviations[0, list(fit.unknowns.local).index("Tc")]
    assert steps["free"] * of.spreads["Tc"] > 2.0 * Thresholds.furthest
    assert steps["known"] == pytest.approx(Thresholds.furthest)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("[diagnosis]\nfalse_alarms = 1.0\n", "a share between 0 and 1"),
        ('[diagnosis.wander]\nGx = { share = 0.1, over = "1 s" }\n', "a parameter of the model"),
    ],
)
def test_a_wrong_rate_or_a_parameter_that_is_none_is_refused(more, message, tmp_path):
    with pytest.raises(InputError, match=message):
        block(tmp_path / "block", more)


def test_a_free_run_is_free_whatever_noise_an_input_declares(tmp_path):
    """Noise of the power makes outputs correct the run that is compared: its errors are smaller.

    A draught takes 0.1 W/K more; the same recordings, with a power that is exact and one that is
    declared to be wrong by 5 W. The nominal model has no level, so that it is one model.
    """
    frames = [recorded(0.1, seed) for seed in range(2)]
    free, corrected = [], []
    for name, noise in (("exact", "0 W"), ("noisy", "5 W")):
        folder = tmp_path / name
        library, file = machine("heater", sensor="")
        file = file.replace('noise = "0 W"', f'noise = "{noise}"')
        of = declare(folder, library, file.replace('[states]\nTc = { spread = "30 K" }\n', ""))
        outcome = diagnosed(of, cases(of, frames[:1]), folder, cases(of, frames)[1:])
        free.append([error.free_run[0] for error in outcome.errors])
        corrected.append([error.rms[0] for error in outcome.errors])
        correcting = {error.corrected for error in outcome.errors}
        assert correcting == ({""} if name == "exact" else {"measured outputs"})
        assert ("free run" in outcome.summary()) is (name == "noisy")
    assert corrected[0] == free[0]
    assert free[1] == pytest.approx(free[0], rel=0.05)  # the first value read is fitted again
    assert np.all(np.array(corrected[1]) < 0.5 * np.array(free[1]))


def test_a_level_that_hides_an_effect_is_said(tmp_path):
    """Losses half above their sheet: a draught has their signature, and is never found beside.

    The data tell the sum of both conductances of the block, of which one is a level here.
    """
    frames = [recorded(1.5 * G, seed) for seed in range(3)]
    own = "[diagnosis.tolerances]\nGa = 0.03\n\n[diagnosis.levels]\nGa = {}\n"
    of = block(tmp_path / "block", own)
    outcome = diagnosed(of, cases(of, frames), tmp_path)
    assert outcome.diagnosis.verdict == "nothing"
    (level,) = outcome.diagnosis.shifted
    assert (level.name, level.hides) == ("Ga", ("Draught",))
    assert level.value == pytest.approx(G, rel=0.03)
    assert "100% above its data sheet of 0.15 W/K" in level.text
    assert "Draught" in outcome.to_dict()["not_visible"]
    assert level.text in outcome.warnings
    assert level.text in outcome.summary()
    # As its sheet says, nothing is told of it, but still of what it hides.
    sound = diagnosed(of, cases(of, [recorded(G, seed) for seed in range(3)]), tmp_path)
    assert sound.warnings == []
    assert "Draught" in sound.to_dict()["not_visible"]


def test_a_level_of_known_spread_hides_what_shows_from_more_than_its_spread_on(tmp_path):
    """A draught is what it stands for; radiation, though nearly alike, shows by less than that."""
    for name, levels, hidden in (
        ("both", HALVES, set()),
        ("one", "Ga = { spread = 0.1 }\n", {"Draught"}),
        ("free", "Ga = {}\n", {"Draught", "Radiation"}),
    ):
        of = block(tmp_path / name, f"[diagnosis.levels]\n{levels}")
        outcome = diagnosed(of, cases(of, [recorded(G, seed) for seed in range(3)]), tmp_path)
        assert outcome.to_dict()["not_visible"].keys() == hidden
        assert outcome.warnings == []


def test_a_level_further_from_its_sheet_than_is_likely_is_said(tmp_path):
    """The sheet says a fifth less than there is from block to casing, give or take 5 %.

    Held to three times that, the level left errors for an effect to bend to, or for none.
    """
    library, file = machine("heater", sensor="")
    library = library.replace('K(unit="W/K") = 2.0', 'K(unit="W/K") = 1.6')
    of = declare(tmp_path, library, f"{file}[diagnosis.levels]\nK = {{ spread = 0.05 }}\n")
    outcome = diagnosed(of, cases(of, [recorded(0.0, seed) for seed in range(3)]), tmp_path)
    assert outcome.diagnosis.verdict == "nothing"
    (level,) = outcome.diagnosis.shifted
    assert (level.name, level.hides) == ("K", ())
    assert level.value == pytest.approx(2.0, rel=0.02)
    warning = "25% above its data sheet of 1.6 W/K, declared as ±5 % of it. Check the data sheet: "
    assert f"{warning}no effect explains it as this nuisance parameter does." in level.text
    assert level.text in outcome.warnings


# --- a law that stands for two ---


DRAUGHT, S = 0.3, 0.006  # planted [W/K], [W/K2]


def radiating(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    powers = rng.uniform(0.0, 90.0, 20)
    return heated(powers, lambda T: DRAUGHT * T + S * T * abs(T), 5.0, rng)


def test_a_law_that_stands_for_two_gives_way_to_them(tmp_path):
    """Heat goes by a draught, in proportion to the temperature, and by radiation, to its square.

    Either alone is no match for a law between the two; the recordings are solutions of the
    equations by SciPy, not of the compiled model.
    """
    block = heated_block(tmp_path / "block", effect=machine_file("heater/Convection.mo"))
    frames = [radiating(seed) for seed in range(3)]
    diagnosis = diagnosed(block, cases(block, frames), tmp_path).diagnosis
    assert "Convection" in [step.rivals[0].active[-1].name for step in diagnosis.steps]
    sizes = {cause.effect.name: cause.parameters for cause in diagnosis.causes}
    assert set(sizes) == {"Draught", "Radiation"}
    assert sizes["Draught"]["G"].low <= DRAUGHT <= sizes["Draught"]["G"].high
    assert sizes["Radiation"]["s"].low <= S <= sizes["Radiation"]["s"].high
    # Block means of noise keep their size; of some sixty a recording, four sigma are a third.
    assert diagnosis.gain.after == pytest.approx(1.0, abs=0.33)


def test_what_may_be_there_moves_what_was_found_as_far_as_a_fit_beside_it(tmp_path):
    """A draught is found; radiation, too little to be a cause, would take some of its size."""
    of = heated_block(tmp_path / "block")
    asked, path = with_effects(problem_of(of), tmp_path, silent)
    effects = asked.effects
    draught, radiation = effects
    moved, away = {}, {}
    for s in (0.0, S):
        rng = np.random.default_rng(1)
        powers = rng.uniform(0.0, 90.0, 20)
        frames = [heated(powers, lambda T, s=s: DRAUGHT * T + s * T * abs(T), 5.0, rng)]
        with ResidualModel(ModelSource(path, of, of.given), cases(of, frames)) as simulations:
            fit = Fit(simulations, effects)

            def size(*active: Effect, fit: Fit = fit) -> tuple[float, ScoreTest]:
                zero = {(effect.name, effect.size): 0.0 for effect in active}
                start = fit.at(replace(fit.unknowns.start(), sizes=zero))
                best, trial = examine(fit, fitted(fit, start, active), effects, lambda _: None)
                return best.point.sizes[draught.name, draught.size], trial

            (alone, trial), (beside, _) = size(draught), size(draught, radiation)
            moved[s] = trial.moved()[trial.joint.known.index((draught.name, draught.size))]
            away[s] = abs(beside - alone)
            nominal = fitted(fit, fit.at(fit.unknowns.start()), ())
            _, first = examine(fit, nominal, effects, lambda _: None)
    assert moved[0.0] == 0.0
    assert moved[S] == pytest.approx(away[S], rel=0.1)
    # Of one degree of freedom, by which the rate of false alarms is: no size is there for nothing.
    # Beside what was found, an effect must explain what it does not at a size that does not matter.
    for score in first.scores():
        assert score.gain == pytest.approx((score.size / score.sigma) ** 2, rel=1e-6)
    (score,) = trial.scores()
    assert score.gain < 0.99 * (score.size / score.sigma) ** 2
    # That, of any sign, is what a law that was found may lack.
    fall, unknowns = trial.lack_of_fit()
    assert (fall, unknowns) == (pytest.approx((score.size / score.sigma) ** 2, rel=1e-6), 1)


# --- a mass on a spring, which a road moves ---

UNEVEN = (0.02, 0.013, 0.008, 0.006)  # sizes of roads [m]


def driven(
    size: float,
    seed: Sequence[int],
    force: Callable[[float], float] = lambda travel: 2e4 * travel,
    rise: float = 0.0,
) -> pd.DataFrame:
    """Heights by SciPy, of a spring with this force [N] by its travel [m]."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(400)
    rates = np.arange(0.3, 6.0, 0.3)
    waves = np.sin(2.0 * np.pi * np.outer(t, rates) + rng.uniform(0.0, 2.0 * np.pi, rates.size))
    road = size * (waves @ (1.0 / (1.0 + rates**1.3))) * np.minimum(t / 0.2, 1.0)

    def change(time: float, x: Vector) -> list[float]:
        travel = np.interp(time, t, road) - x[0]
        return [x[1] + 5.0 * travel, force(travel) / 300.0]

    run = solve_ivp(change, (0.0, t[-1]), [0.0, rise], t_eval=t, rtol=1e-8, max_step=0.01)
    heights = run.y[0] + 1e-4 * rng.standard_normal(t.size)
    return pd.DataFrame({"time [s]": t, "r [m]": road, "z [m]": heights})


def test_a_cause_that_leaves_more_than_it_explains_is_none(tmp_path):
    """Play bends a law that stiffens to itself, by a size that goes with that of the road."""
    of = declare(tmp_path, *machine("car"))

    def force(travel: float) -> float:
        return float(2e4 * (travel - 1.5e-4 * np.tanh(travel / 2e-3)))

    frames = [driven(size, [1, k], force) for k, size in enumerate(UNEVEN)]
    diagnosis = diagnosed(of, cases(of, frames), tmp_path).diagnosis
    assert diagnosis.best.names == ("Progressive",)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.causes == ()


LOPSIDED = """
  model Lopsided "a spring that is stiffer one way"
    extends PartialSpring;
    parameter Real k2(unit="N/m2", min=0.0, max=1e6) = 0.0 "Square rate";
  equation
    actual = nominal + k2*s^2;
    annotation (__Workbench(effect(size="k2", matters=10.0, separation="large travels")));
  end Lopsided;

  model Observer"""


@pytest.mark.parametrize("k2", [0.0, -1500.0])
def test_a_cause_that_leaves_what_no_other_may_be_is_none(k2, tmp_path):
    """A spring that is softer one way, where the catalogue has a stiffer one alone.

    What is left hides in the noise of each block, and is more than the right half of the law
    explains: 42 of chi-squared by one unknown, beside 24.
    """
    library, file = machine("car")
    of = declare(tmp_path, library.replace("\n  model Observer", LOPSIDED), file)

    def force(travel: float) -> float:
        return 2e4 * travel + 7e4 * travel**3 + k2 * travel**2

    frames = [driven(size, [1, k], force) for k, size in enumerate(UNEVEN)]
    diagnosis = diagnosed(of, cases(of, frames), tmp_path).diagnosis
    assert diagnosis.best.names == ("Progressive",)
    assert diagnosis.verdict == ("unexplained" if k2 else "found")


@pytest.mark.parametrize(
    ("declared", "advice", "stiffness", "rise"),
    [
        ('spread = "0.2 mm/s"', r'spread = "[\d.]+ m/s" in \[states.y\]', 0.0, 0.05),
        ("k = 0.0005", r"k = 0.0\d+ in \[diagnosis.tolerances\]", 600.0, 0.0),
    ],
    ids=["starts", "tolerances"],
)
def test_what_is_declared_too_narrow_is_told_with_what_to_write(
    declared, advice, stiffness, rise, tmp_path
):
    """Masses that move already, or springs that differ; by the advice, nothing is missing."""
    library, file = machine("car")
    text = file.replace("20 mm/s", "0.2 mm/s") + "[diagnosis.tolerances]\nk = 0.0005\n"
    shares = zip(UNEVEN, (1.0, -1.0, 0.6, -0.8), strict=True)
    frames = [
        driven(size, [2, k], lambda x, k=2e4 + share * stiffness: k * x, rise=share * rise)
        for k, (size, share) in enumerate(shares)
    ]
    outcomes = []
    for name in ("narrow", "wide"):
        (tmp_path / name).mkdir()
        of = declare(tmp_path / name, library, text)
        outcomes.append(diagnosed(of, cases(of, frames), tmp_path / name))
        if name == "narrow":
            match = re.search(f"write ({advice})", outcomes[0].warnings[0])
            assert match is not None
            text = text.replace(declared, match[1].partition(" in ")[0])
    assert [outcome.diagnosis.verdict for outcome in outcomes] == ["unexplained", "nothing"]
