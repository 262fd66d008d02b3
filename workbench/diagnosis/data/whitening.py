"""How large noise is in the means of blocks, by what is measured."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import nnls

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import Mask, deviation_of
from workbench.diagnosis.data.counting import CountedSamples, counts_in
from workbench.system.system import System

WEIGHTLESS = 1e6  # times its size, by which a silent channel may be wrong: 1e-12 of chi-squared
_NEAR = 5  # blocks, of which a jump and its ringing are one


def whitening(
    system: System,
    counted: CountedSamples,
    signals: tuple[str, ...],
    slopes: Matrix,
    ahead: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Inverse Cholesky factors of the covariance of block means, (b, c, c).

    Noise that grows with a signal is told from what does not by the differences of a channel;
    channels share the noise of their signals; the noise behind a structure is mostly its ringing,
    whose block means are taken as they are, in spans of restarts one by one.
    """
    clean, deviation, blocks = counted.clean, counted.deviation, counted.blocks
    spans = np.array([counted.spans[first:end].any() for first, end in blocks])
    size = blocks[:, 1] - blocks[:, 0]
    fixed = np.array([deviation[name] ** 2 for name in signals])
    covariance = np.tile(slopes * fixed @ slopes.T, (len(blocks), 1, 1))
    for c, row in enumerate(slopes):
        own = [name for name, slope in zip(signals, row, strict=True) if slope]
        channel = sum(slope * clean[name] for name, slope in zip(signals, row, strict=True))
        growing = [name for name in own if system.signals[name].relative_noise > 0.0]
        shared = np.delete(np.abs(slopes), c, axis=0).sum(axis=0) > 0.0
        mode = system.signals[own[0]].mode if len(own) == 1 else None
        if mode is not None:
            means = np.array([clean[own[0]][first:end].mean() for first, end in blocks])
            covariance[:, c, c] = size * deviation_of(means) ** 2
            late = 1.0 / (2.0 * np.pi * mode.frequency * system.comparison.block)
            ringing = np.maximum(covariance[:, c, c], size * _ringing(means, late))
            covariance[spans, c, c] = ringing[spans]
        elif growing:
            least = 1.01 * float(row[shared] ** 2 @ fixed[shared])
            covariance[:, c, c] = _growing(channel, clean[growing[0]], counted, least)
    # Predicted outputs are uncertain too, by what led them.
    predicted = np.array([ahead[first:end].mean(axis=0) for first, end in blocks])
    covariance += slopes @ predicted @ slopes.T
    # Channels share the noise of samples that both have.
    counts = counts_in(blocks, counted.measured(signals, slopes))
    size = np.maximum(1, np.maximum(counts[:, :, None], counts[:, None, :]))
    # A signal that rests within a step of its reading is wrong by the same in all samples.
    steps = np.array([system.signals[name].resolution ** 2 / 12.0 for name in signals])
    covariance = covariance / size + slopes * steps @ slopes.T
    scales = np.abs(slopes) @ [system.signals[name].scale for name in signals]
    for b, c in np.argwhere(counts == 0):
        covariance[b, c, :] = covariance[b, :, c] = 0.0
        covariance[b, c, c] = (WEIGHTLESS * scales[c]) ** 2
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _ringing(means: Vector, late: float) -> Vector:
    """Variance of block means by those beside them, (b,): what a structure adds as loads move.

    Of loads that jump, as of `deviation_of`, by second differences, but of the few that are near.
    Of loads that rise or fall, by how late the structure passes them on, which is known to its
    time constant at best.

    Parameters
    ----------
    late : that time constant, in blocks.
    """
    squares = np.zeros(means.size)
    squares[1:-1] = np.diff(means, 2) ** 2 / 6.0
    variance: Vector = uniform_filter1d(squares, _NEAR) + (late * np.gradient(means)) ** 2
    return variance


def _growing(channel: Vector, signal: Vector, counted: CountedSamples, least: float) -> Vector:
    """Variance of a channel's samples in each block, part of which grows with a signal, (b,)."""
    fixed, share = parts_of_noise(channel, signal, counted.usable)
    means = np.array([np.abs(signal[first:end]).mean() for first, end in counted.blocks])
    variance: Vector = np.maximum(fixed + share * means**2, least)
    return variance


def parts_of_noise(channel: Vector, signal: Vector, usable: Mask) -> tuple[float, float]:
    """Variance of a channel's noise that is fixed, and what grows over the square of a signal."""
    squares = np.diff(channel, 2) ** 2 / 6.0
    squares = np.minimum(squares, 9.0 * median_filter(squares, 201) / 0.455)
    counts = usable[1:-1]
    design = np.column_stack([np.ones(counts.sum()), signal[1:-1][counts] ** 2])
    (fixed, share), _ = nnls(design, squares[counts])
    return float(fixed), float(share)
