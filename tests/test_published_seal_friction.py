"""Published friction of two seals: read from each layout. What it says is in its tutorial."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.machines import published
from workbench.machines.published import seal_friction


def test_rate_of_a_steady_stroke_is_exact_between_uneven_samples():
    time = np.cumsum(np.random.default_rng(1).choice([0.01, 0.011, 0.3], 200, p=[0.6, 0.38, 0.02]))
    assert_allclose(seal_friction.rate(time, 3.0 - 12.5 * time), -12.5)


def test_rate_has_a_tenth_of_the_noise_of_differences():
    """Closed form: of n samples h apart, s/h*sqrt(12/(n^3 - n)), as of any line."""
    time = 0.01 * np.arange(5000)
    noise = 0.01 * np.random.default_rng(2).standard_normal(time.size)
    found = np.std(seal_friction.rate(time, noise)[5:-5])
    assert found == pytest.approx(0.01 / 0.01 * np.sqrt(12.0 / (11**3 - 11)), rel=0.05)
    assert found < 0.15 * np.std(np.diff(noise) / 0.01)


def test_both_layouts_give_the_same_recordings(tmp_path):
    """The publisher's are without a header, in ms, with voltages of the sensors in between."""
    theirs, ours = tmp_path / "theirs", tmp_path / "ours"
    (theirs / "results_pneumatic-actuator" / "data" / "friction").mkdir(parents=True)
    t = np.cumsum(np.random.default_rng(3).integers(9, 12, 60))
    for number, name in enumerate(seal_friction._PUBLISHED):
        s, p, F = 0.1 * np.arange(60.0), np.full(60, 1.0 + number), 50.0 + np.arange(60.0)
        lines = [
            f"{a:.3f}\t3.476\t0.5\t1.07\t{b}\t{c}\t{d}\r\n"
            for a, b, c, d in zip(t, s, p, F, strict=True)
        ]
        file = f"results_pneumatic-actuator/data/friction/{name}.csv"
        (theirs / file).write_text("".join(lines))
        (ours / "friction" / name).mkdir(parents=True)
        rows = [f"{a / 1e3},{b},{c},{d}\n" for a, b, c, d in zip(t, s, p, F, strict=True)]
        header = "time [s],stroke [mm],pressure [bar],force [N]\n"
        (ours / "friction" / name / "measured.csv").write_text("".join([header, *rows]))
    layouts = published.seal_friction.PUBLISHED.layouts
    first, second = layouts[0].read(theirs), layouts[1].read(ours)
    assert [one.name for one in first] == [one.name for one in second]
    assert [one.name for one in first if one.held_out] == ["NAPN_5bar", "O-ring_5bar"]
    for one, other in zip(first, second, strict=True):
        assert one.rows == other.rows == (15, 59)
        for column, values in one.columns.items():
            assert_allclose(values, other.columns[column], err_msg=column)
