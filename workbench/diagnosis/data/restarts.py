"""Where a simulation is begun anew from what is measured, so that an error is that of one block.

A motion that runs away, as a wheel that slides, is predicted from one restart to the next only.
Source: H. G. Bock (1983), Recent advances in parameter identification techniques for O.D.E.:
multiple shooting, with all nodes at what is measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.data.cleaning import Mask, runs
from workbench.diagnosis.data.counting import CountedSamples
from workbench.diagnosis.data.whitening import parts_of_noise
from workbench.system.system import System


@dataclass(frozen=True, eq=False)
class Restarts:
    """Of one recording."""

    at: Mask  # (n,) whether states are set before a sample, by what the one before it reads
    noise: Mapping[str, Vector]  # (n,) standard deviation of a reading, by output; these are states
    uncertain: Mapping[str, float]  # relative standard deviation of parameters, by name


def restarts_of(system: System, counted: CountedSamples) -> Restarts | None:
    """Restarts before each block that would not count otherwise, or None if all would.

    Where such a span goes on without blocks, there are as many.
    """
    if not counted.spans.any():
        return None
    at = np.zeros(counted.spans.size, np.bool_)
    size = int(np.median(np.diff(counted.blocks)))
    for first, end in runs(~counted.usable):
        at[first:end:size] = counted.spans[first:end].any()
    for first, end in counted.blocks:
        at[first] = counted.spans[first:end].any()
    declared = [exclusion for exclusion in system.comparison.exclusions if exclusion.restarted]
    noise = {}
    for name in (name for declaration in declared for name in declaration.restarted):
        values, fixed, share = counted.clean[name], counted.deviation[name] ** 2, 0.0
        if system.signals[name].relative_noise > 0.0:
            fixed, share = parts_of_noise(values, values, counted.usable)
        noise[name] = np.sqrt(fixed + share * values**2)
    return Restarts(
        at=at,
        noise=noise,
        uncertain={
            name: share for declaration in declared for name, share in declaration.uncertain.items()
        },
    )
