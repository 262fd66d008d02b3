"""What a diagnosis of recordings finds between two effects, for tests of predictions of it."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.case import Case
from workbench.diagnosis import build_everything, choose, read_effects
from workbench.diagnosis.evidence import Simulations
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.search import Fitted, beyond, examine, extended, fitted
from workbench.modelica import read_library
from workbench.system import OBSERVER, System


def parted(of: System, recordings: Sequence[Case], true: str, other: str) -> float:
    """Distance of two effects, each fitted alone [standard deviations]; 0: the other is nearer."""
    library = read_library(of.library)
    effects = choose([true, other], read_effects(library, of.models[OBSERVER].name))
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        build_everything(of, library, effects, everything)
        with Simulations(everything, of, {}, recordings, 1) as simulations:
            fit = Fit(simulations, effects)
            base = fitted(fit, fit.at(fit.unknowns.start()), ())
            base, trial = examine(fit, base, effects, lambda _: None)
            fits: dict[str, Fitted] = {}
            for score in trial.scores():
                if score.effect.name not in fits:
                    one = extended(fit, base, score)
                    assert one is not None
                    fits[score.effect.name] = one
            return float(np.sqrt(max(0.0, beyond(fits[other], fits[true]))))
