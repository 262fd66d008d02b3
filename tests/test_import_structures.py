"""MAT files as people of identification, Simulink and Modelica tools write them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat

from workbench.recordings.formats import Group, read_recorded_file

TIME = np.arange(0.0, 60.0, 0.5)  # s
FLOW, LEVEL = 4.0 + np.sin(TIME), 900.0 + np.cos(TIME)


def column(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, 1)


def simulink(labels: tuple[str, str], times: np.ndarray = TIME) -> Mapping[str, Any]:
    signals = np.zeros(2, dtype=[("values", "O"), ("dimensions", "O"), ("label", "O")])
    for k, (label, values) in enumerate(zip(labels, (FLOW, LEVEL), strict=True)):
        signals[k] = (column(values), 1, label)
    return {"out": {"time": column(times), "signals": signals, "blockName": "m/Scope"}}


def group(path: Path, content: Mapping[str, Any], form: Literal["4", "5"] = "5") -> Group:
    savemat(path, dict(content), format=form)
    (found,) = read_recorded_file(path).groups
    return found


@pytest.mark.parametrize(
    ("content", "names", "form"),
    [
        (
            {"data": {"t": column(TIME), "u": column(FLOW), "y": column(LEVEL)}},
            ["t", "u", "y"],
            "5",
        ),
        ({"est": {"u": column(FLOW), "y": column(LEVEL), "Ts": 0.5}}, ["u", "y"], "5"),
        ({"time": TIME, "u": FLOW, "y": LEVEL}, ["time", "u", "y"], "4"),
        (simulink(("u", "y")), ["time", "u", "y"], "5"),
        (simulink(("", "")), ["time", "(1)", "(2)"], "5"),
        (simulink(("u", "y"), np.empty(0)), ["u", "y"], "5"),
    ],
    ids=["t, u, y", "u, y, Ts", "MAT 4", "Simulink", "without names", "without time"],
)
def test_all_signals_of_a_structure_are_channels(
    tmp_path: Path, content: Mapping[str, Any], names: list[str], form: Literal["4", "5"]
) -> None:
    found = group(tmp_path / "a.mat", content, form)
    assert [channel.name for channel in found.channels] == names
    u, y = found.channels[-2:]
    assert_allclose(u.values, FLOW)
    assert_allclose(y.values, LEVEL)
    assert np.isfinite(found.step) == ("est" in content)


def texts(rows: list[str], *, turned: bool) -> np.ndarray:
    width = max(map(len, rows))
    table = np.array([list(row.ljust(width)) for row in rows])
    return np.ascontiguousarray(table.T) if turned else table


@pytest.mark.parametrize("turned", [True, False], ids=["binTrans", "binNormal"])
def test_results_of_modelica_tools_are_recordings(tmp_path: Path, *, turned: bool) -> None:
    """Of two samples at an event the later one is kept; a parameter is no channel."""
    times = np.array([0.0, 1.0, 2.0, 2.0, 3.0])
    data = np.array([times, 10.0 * times, [0.0, 0.0, 0.0, 1.0, 1.0]])
    info = np.array([[0, 1, 0, -1], [2, 2, 0, -1], [2, -2, 0, -1], [1, 2, 0, 0], [2, 3, 0, -1]])
    kind = "binTrans" if turned else "binNormal"
    names = ["time", "tank.h", "mirror", "A", "valve"]
    about = ["Time in [s]", "Level [m|cm]", "Level turned [m]", "Area [m2]", "open"]
    content = {
        "Aclass": texts(["Atrajectory", "1.1", "", kind], turned=False),
        "name": texts(names, turned=turned),
        "description": texts(about, turned=turned),
        "dataInfo": (info.T if turned else info).astype(np.int32),
        "data_1": np.zeros((2, 2)),
        "data_2": data if turned else data.T,
    }
    savemat(tmp_path / "a.mat", content, format="4")
    recorded = read_recorded_file(tmp_path / "a.mat")
    (found,) = recorded.groups
    assert [(channel.name, channel.unit) for channel in found.channels] == [
        *(("time", "s"), ("tank.h", "m"), ("mirror", "m"), ("valve", ""))
    ]
    assert_allclose(found.channels[0].values, [0.0, 1.0, 2.0, 3.0])
    assert_allclose(found.channels[1].values, [0.0, 10.0, 20.0, 30.0])
    assert_allclose(found.channels[2].values, [0.0, -10.0, -20.0, -30.0])
    assert_allclose(found.channels[3].values, [0.0, 0.0, 1.0, 1.0])
    assert recorded.notes == (
        "1 samples before events were left out, of the times of those after",
        "1 parameters and constants were left out",
    )
