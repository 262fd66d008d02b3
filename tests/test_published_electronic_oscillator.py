"""A published oscillating circuit is read, and its stiffening spring is named."""

import numpy as np
from numpy.testing import assert_allclose

from workbench.api import diagnose
from workbench.machines.published.electronic_oscillator import PUBLISHED, sharpened
from workbench.recordings.case import read_cases
from workbench.system.registry import load_system


def test_lines_between_sharpened_samples_swing_as_the_signal_does():
    """Closed form: of the lines the first harmonic is the signal, at 9 samples a period."""
    n, cycles, fine = 900, 100, 64
    signal = np.sin(2.0 * np.pi * cycles * np.arange(n) / n)
    samples = np.append(sharpened(signal), sharpened(signal)[0])
    at = np.arange(n * fine) / fine
    lines = np.interp(at, np.arange(n + 1), samples)
    wave = np.exp(-2j * np.pi * cycles * at / n)
    # Sampled lines instead of lines: of order (cycles/(n fine))^2.
    assert_allclose(2.0 * np.mean(lines * wave), -1j, atol=1e-4)


def test_the_arrow_is_held_out_and_realisations_follow_it(tmp_path):
    rng = np.random.default_rng(1)
    rows = [f"{u:.6f},{y:.6f}," for u, y in 0.1 * rng.standard_normal((70000, 2))]
    (tmp_path / "SNLS80mV.csv").write_text("\n".join(['"V1","V2",', *rows]) + "\n")
    read = PUBLISHED.layouts[0].read(tmp_path)
    assert [one.name for one in read if one.held_out] == ["arrow"]
    assert [one.rows for one in read] == [
        *((40420, 49119), (49120, 57819), (57820, 66519)),
        (0, 40399),
    ]


def test_the_stiffening_spring_alone_is_named(published_cases, tmp_path):
    """Of 7.3 mV it leaves the 0.3 mV of cards and circuit."""
    cases = published_cases("electronic_oscillator", "electronic_oscillator")
    system = load_system("electronic_oscillator")
    fitted = read_cases([cases / f"multisine_{number}" for number in (1, 2, 3)], system)
    outcome = diagnose(system, fitted, out=tmp_path, workers=1, report=lambda line: None)
    assert [cause.effect.name for cause in outcome.diagnosis.causes] == ["CubicSpring"]
    before, after = np.sqrt(np.mean([np.square(error.rms) for error in outcome.errors], axis=0))
    assert before > 7e-3
    assert after < 3.5e-4
