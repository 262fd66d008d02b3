"""An electro-mechanical positioning system (EMPS), a benchmark of system identification.

Protocol: of the publisher's scripts that simulate it. The closed loop runs freely from the
reference, and from the pulses that are added to the command; the first 50 ms do not count. The
record without pulses is fitted, that with pulses held out. Metric: root mean square error of the
command, by which the force is in proportion.
"""

from pathlib import Path

import numpy as np

from workbench.recordings.datasets import FolderLayout, PublishedRecording, PublishedSet

_STEP = 1e-3  # [s]
_FILES = {
    "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
    "DATA_EMPS_PULSES.mat": "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
}


def _recording(folder: Path, file: str) -> PublishedRecording:
    from scipy.io import loadmat  # takes its time, and nothing else needs it

    content = {name: np.ravel(value) for name, value in loadmat(folder / file).items()}
    goal = content["qg"]
    pulses = content.get("pulses_N")
    return PublishedRecording(
        name="motion" if pulses is None else "motion_with_pulses",
        title="Bang-bang accelerations" + ("" if pulses is None else ", and pulses of the command"),
        columns={
            "time [s]": _STEP * np.arange(goal.size, dtype=np.float64),
            "goal [m]": goal,
            "pulse [V]": np.zeros(goal.size) if pulses is None else pulses.astype(np.float64),
            "q [m]": content["qm"],
            "command [V]": content["vir"],
        },
        file=file,
        rows=(0, goal.size - 1),
        changed=("time is the number of the sample times 1 ms",),
        held_out=pulses is not None,
    )


def _read(folder: Path) -> list[PublishedRecording]:
    return [_recording(folder, file) for file in _FILES]


PUBLISHED = PublishedSet(
    title="A carriage on a ball screw: reference and position, and the command of its controller",
    source="A. Janot, M. Gautier, M. Brunot, data set and models of EMPS (2019), "
    "https://www.nonlinearbenchmark.org; also in https://github.com/forgi86/"
    "sysid-neural-continuous, examples/EMPS/data",
    licence="none stated; free for benchmarks",
    recordings="Two records of 24841 samples, 1 ms apart, under position control. Bang-bang "
    "accelerations of the reference are to be fitted; in the record that is held out pulses are "
    "added to the command, in volts.",
    layouts=(FolderLayout("the publisher's own files", _FILES, _read),),
)
