"""The figures of `diagnose`: noise, lasting and turning errors, gaps, in residuals made by hand."""

import dataclasses

import numpy as np
from numpy.testing import assert_allclose

from workbench.diagnosis.outcome import FAST, lasting, lasting_blocks, recording_figure

from .diagnosis_pages import residuals

LASTING = 10  # blocks of 50 ms


def test_half_a_lasting_time_is_ten_blocks(system):
    assert lasting_blocks(system) == LASTING


def test_noise_alone_leaves_one_and_a_lasting_error_stands_out():
    before, after = lasting(residuals(gap=False), LASTING).noises()
    # 80 independent means: one standard deviation of their rms is 8 %.
    assert_allclose(after, 1.0, atol=0.3)
    # Ten sigma of a block, in means over ten blocks, for 70 % of the time.
    assert_allclose(before, 10.0 * np.sqrt(10.0 * 0.7), rtol=0.05)


def test_an_error_that_turns_with_the_wheel_is_shown_where_means_would_hide_it(dry_case, system):
    one = residuals(gap=False)
    turning = one.after + 5.0 * (-1.0) ** np.arange(len(one.after))[:, None]
    one = dataclasses.replace(one, before=turning)
    assert (lasting(one, LASTING).noises()[0] < 1.5).all()
    assert (lasting(one, FAST).noises()[0] > 4.5).all()
    figure = recording_figure(one, dry_case, system, "with X", FAST)
    assert "means over 50 ms" in figure.finding


def test_no_mean_and_no_line_bridges_what_was_set_aside(dry_case, system):
    one = residuals(gap=True)
    quiet, loud = one.block_time < 10.0, one.block_time > 15.0
    assert abs(lasting(one, LASTING).before[quiet]).max() < 3.0
    assert lasting(one, LASTING).before[loud].min() > 7.0
    figure = recording_figure(one, dry_case, system, "with X", LASTING)
    inside = (figure.time > 10.0) & (figure.time < 15.0)
    for panel in figure.panels:
        for curve in panel.curves:
            assert np.isnan(curve.values[inside]).all()
            assert np.isfinite(curve.values[~inside]).all()
