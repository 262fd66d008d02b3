"""Stops of a train for tests: the train's own model, its sensors' noise, and pads that wear out."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from workbench.system.registry import open_model

from .systems import TRAIN

PADS = 0.30  # friction of sound ones, as in the library
_STEP, _COAST, _SPEED = 0.1, 15.0, 20.0  # s, s, m/s
_MASS = 48e3  # kg, of each vehicle

CASE = """\
title = "72 km/h"
{date}
[measurement]
file = "measured.csv"

[conditions]
rail = "dry"
"""


def write_stop(
    folder: Path, seed: int, pads: Mapping[int, float], date: str = "", *, pressure: float = 2.4e5
) -> None:
    """Write a stop; an axle has the friction of `pads`, or that of sound ones.

    As the data sheet has it, the friction of all axles varies by 2 % from stop to stop, and that of
    each by 0.7 %.
    """
    random = np.random.default_rng(seed)
    level = PADS * random.normal(1.0, 0.02)
    friction = {
        f"muDC[{i}]": level * pads.get(i, PADS) / PADS * random.normal(1.0, 0.007)
        for i in range(1, 9)
    }
    outputs = [output.name for output in TRAIN.outputs]
    rows = []
    with open_model(TRAIN) as model:
        model.start({**dict.fromkeys(outputs[:-1], _SPEED / 0.46), "vTrain": _SPEED}, friction)
        inputs = model.variables([variable.name for variable in TRAIN.inputs])
        states = [model.states.index(name) for name in outputs]
        u = np.array([0.0, 0.0, 0.0, 0.0, _MASS, _MASS, 0.0, 0.0, 0.0])
        for k in range(round((_COAST + 15.0) / _STEP)):
            braking = max(0.0, k * _STEP - _COAST)
            u[:4] = pressure * (1.0 - np.exp(-braking / 0.45))
            model.set(inputs, u)
            x = model.step(_STEP)
            rows.append([(k + 1) * _STEP, *u, *x[states]])
    units = {signal.name: signal.unit for signal in (*TRAIN.inputs, *TRAIN.outputs)}
    frame = pd.DataFrame(rows, columns=["time [s]", *(f"{n} [{u}]" for n, u in units.items())])
    for signal in (*TRAIN.inputs, *TRAIN.outputs):
        column = f"{signal.name} [{signal.unit}]"
        if signal.name not in ("curve", "slope1", "slope2"):
            frame[column] += signal.deviation(frame[column]) * random.standard_normal(len(frame))
    folder.mkdir(parents=True)
    (folder / "case.toml").write_text(CASE.format(date=date and f'date = "{date}"\n'))
    frame.to_csv(folder / "measured.csv", index=False, float_format="%.9g")
