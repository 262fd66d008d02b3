"""Whether what is wrong is no more than what a Co-Simulation makes of its inputs.

One that takes no slopes of inputs holds them for a step. Of a straight line it gets the mean, and
what depends on an input at once is read half a step late: as much as a cause of that size.
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.simulation.residual_model import ResidualModel


@dataclass(frozen=True)
class Coupling:
    """What is no larger than the difference that a sample makes by which inputs act later."""

    inputs: tuple[str, ...]  # on straight lines, of which the FMU takes the mean of each step
    hold: str  # value of `held` by which they leave noise alone; empty: none


def coupling(simulations: ResidualModel, fit: Fit, base: FittedModel) -> Coupling | None:
    """Compare errors of the nominal model with what inputs make that act a sample later.

    That is from the sample before on, or until the next one. None if errors are larger in any
    channel, or if the FMU takes inputs as they are.
    """
    if not simulations.averaged:
        return None
    points = fit.unknowns.values(base.point)
    straight = simulations.predicted(points)
    ways: dict[str, bool | str] = {"true": True, '"before"': "before"}
    moves: dict[str, list[Matrix]] = {}
    for hold, held in ways.items():
        with simulations.held(dict.fromkeys(simulations.averaged, held)) as other:
            pairs = zip(simulations.recordings, other.predicted(points), straight, strict=True)
            moves[hold] = [own.whitened(run - line) for own, run, line in pairs]
    errors = [recording.errors for recording in base.linearised.residuals]
    blocks = np.sum([recording.blocks for recording in base.linearised.residuals], axis=0)
    noise = (1.0 + fit.decides.excess) * blocks
    apart = _squares([late - early for late, early in zip(*moves.values(), strict=True)])
    if np.any(_squares(errors) > noise + apart):
        return None
    left = {
        hold: _squares([own - move for own, move in zip(errors, moved, strict=True)])
        for hold, moved in moves.items()
    }
    able = [hold for hold, squares in left.items() if np.all(squares <= noise)]
    return Coupling(simulations.averaged, next(iter(able), ""))


def _squares(errors: list[Matrix]) -> Matrix:
    """Sum over all blocks (b, c), by channel."""
    squares: Matrix = np.sum([np.square(own).sum(axis=0) for own in errors], axis=0)
    return squares
