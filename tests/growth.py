"""Cost of Kalman filters by the number of axles, on trains that are generated for it.

`python -m tests.growth 1 2 4` measures the block Kalman filter on trains of 1, 2 and 4 vehicles,
and the extended one up to `--ekf` of them, 8 unless it is said. Needs the extra [compiler].
"""

import argparse
import shutil
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.observers.estimators.block_filter.filter import BlockKalmanFilter
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.system.parts import EstimatedQuantity
from workbench.system.registry import load_system, open_model
from workbench.system.system import OBSERVER, System

from .built import build_here

_SAMPLES, _REPEATS = 300, 5
_PITCH = 0.16  # time in which a body pitches, as in TrainRig.Parts.Vehicle [s]
_SLOWING, _BEGIN = 0.9, 2.0  # of the stop [m/s2], and when its brakes are on [s]


def model_of(vehicles: int, *, pitching: bool) -> str:
    """Modelica of a train of so many vehicles, with a name for each signal, in `TrainRig`.

    Parameters
    ----------
    pitching : whether wheel loads shift by a deceleration of the train that has a state of its own,
        as bodies pitch, so that an axle depends on its own bogie and on the train; else at once, by
        the pads of all axles, as in `TwoVehicles`.
    """
    at_once = "braking = sum(tauB[i]/rA[i] for i in 1:n)/weight"
    shifting = f"{_PITCH}*der(braking) = -acceleration - braking" if pitching else at_once
    start = ", braking(start=0.0, fixed=true)" if pitching else ""
    bogies, axles, every = 2 * vehicles, 4 * vehicles, range(1, vehicles + 1)
    inputs = [f'pB{j}(unit="Pa")' for j in range(1, bogies + 1)]
    inputs += [f'mass{k}(unit="kg", start=48000.0)' for k in every]
    inputs += [f'slope{k}(unit="1")' for k in every]
    inputs += [f'dmuDC{i}(unit="1")' for i in range(1, axles + 1)]
    inputs += [f'dr{i}(unit="m")' for i in range(1, axles + 1)]
    inputs += ['curve(unit="1")', 'dbias(unit="m/s2")']
    states = [f'omega{i}(unit="rad/s", nominal=50.0' for i in range(1, axles + 1)]
    states += ['a(unit="m/s2", nominal=1.0', 'vTrain(unit="m/s", nominal=20.0']
    states = [f"{state}, start=0.0, fixed=true)" for state in states]
    outputs = ['slip(unit="m/s") = v - rA[1]*omega1', 'force(unit="N") = sum(Fx)']
    outputs += ['vGNSS(unit="m/s") = v']
    return "\n".join(
        [
            f'within TrainRig;\nmodel Longer "Train of {vehicles} vehicles"',
            f"  extends Train(final vehicles={vehicles}{start});",
            *(f"  input Real {variable};" for variable in inputs),
            *(f"  output Real {name};" for name in (*states, *outputs)),
            "equation",
            "  mu = ordinary;\n  acting = fill(units, n);\n  drag = zeros(n);\n  mu0 = muWR;",
            f"  {shifting};",
            "  uphill = sum(m[k]*slope[k] for k in 1:vehicles)/sum(m);",
            "  rest = A;\n  air = C;\n  curves = curve;\n  v = vTrain;",
            f"  pC = {_vector('pB', bogies)};\n  m = {_vector('mass', vehicles)};",
            f"  slope = {_vector('slope', vehicles)};\n  dmuDC = {_vector('dmuDC', axles)};",
            f"  rA = r + {_vector('dr', axles)};\n  omega = {_vector('omega', axles)};",
            *(f"  der(omega{i}) = rate[{i}];" for i in range(1, axles + 1)),
            "  der(vTrain) = acceleration;",
            "  der(a) = 6.283185307179586*5.0*(felt + dbias - a);\nend Longer;\n",
        ]
    )


def _vector(name: str, size: int) -> str:
    return "{" + ", ".join(f"{name}{i}" for i in range(1, size + 1)) + "}"


def build(vehicles: int, folder: Path, *, pitching: bool = True) -> System:
    """Compile such a train in a folder; returns its system, the usual one with more signals."""
    system = load_system("train")
    library = folder / "TrainRig"
    shutil.copytree(system.library.parents[1], folder, dirs_exist_ok=True)
    (library / "Longer.mo").write_text(model_of(vehicles, pitching=pitching))
    order = library / "package.order"
    order.write_text(f"{order.read_text()}Longer\n")
    fmu = folder / "Longer.fmu"
    build_here(library / "package.mo", "TrainRig.Longer", fmu)
    axles, every = range(1, 4 * vehicles + 1), range(1, vehicles + 1)
    given = {variable.name: variable for variable in system.inputs}
    pressures = [replace(given["pB1"], name=f"pB{j}") for j in range(1, 2 * vehicles + 1)]
    vehicle = [
        replace(given[f"{name}1"], name=f"{name}{k}") for name in ("mass", "slope") for k in every
    ]
    speed, accelerometer = system.outputs[0], system.outputs[-1]
    speeds = [replace(speed, name=f"omega{i}", reading=f"omega{i}") for i in axles]
    known = {quantity.name: quantity for quantity in system.estimated}

    def estimated(name: str) -> list[EstimatedQuantity]:
        first_axle = known[f"{name}[1]"]
        return [
            replace(first_axle, name=f"{name}[{i}]", correction=f"d{name}{i}", acts_on=f"omega{i}")
            for i in axles
        ]

    return replace(
        system,
        models={OBSERVER: replace(system.models[OBSERVER], path=fmu)},
        inputs=(*pressures, *vehicle, given["curve"]),
        outputs=(*speeds, accelerometer),
        intermittent=(),
        estimated=(*estimated("muDC"), *estimated("r"), known["bias"]),
        reported={"force": system.reported["force"]},
        states=(),
    )


def stop(system: System) -> tuple[Vector, Matrix, Matrix]:
    """Time, inputs and outputs of a stop at constant deceleration, with noise of sensors."""
    random, step = np.random.default_rng(1), system.sample_time
    t = step * np.arange(_SAMPLES, dtype=np.float64)
    v = 33.0 - _SLOWING * np.maximum(t - _BEGIN, 0.0)
    levels = {"pB": 2.2e5 * (t >= _BEGIN), "mass": 48e3 + 0.0 * t, "slope": 0.0 * t}
    levels |= {"omega": v / 0.46, "a": np.gradient(v, step), "curve": 0.0 * t}
    u = [levels[variable.name.rstrip("0123456789")] for variable in system.inputs]
    y = [levels[output.name.rstrip("0123456789")] for output in system.outputs]
    noise = [output.noise * random.standard_normal(t.size) for output in system.outputs]
    inputs: Matrix = np.column_stack(u)
    outputs: Matrix = np.column_stack(y) + np.column_stack(noise)
    return t, inputs, outputs


def time_filter(system: System, cls: type[ExtendedKalmanFilter]) -> float:
    """Processor time of a filter for a sample, the least of five runs [s]."""
    with open_model(system) as fmu:
        estimator, samples = cls.untuned(fmu, system), stop(system)
        estimator.run(*samples)
        spent = []
        for _ in range(_REPEATS):
            begin = time.process_time()
            estimator.run(*samples)
            spent.append((time.process_time() - begin) / _SAMPLES)
    return min(spent)


def report(sizes: Iterable[int], most: int) -> Iterable[str]:
    """A line for each number of vehicles and filter; the extended one up to `most` of them."""
    for vehicles in sizes:
        axles = 4 * vehicles
        with tempfile.TemporaryDirectory() as scratch:
            begin = time.monotonic()
            system = build(vehicles, Path(scratch))
            yield f"{axles:>3} axles, ready after {time.monotonic() - begin:.0f} s"
            for cls in (BlockKalmanFilter, ExtendedKalmanFilter):
                if cls is ExtendedKalmanFilter and vehicles > most:
                    continue
                spent = 1e6 * time_filter(system, cls)
                per_axle = f"{spent / axles:>6.2f} us an axle"
                yield f"  {cls.name:<5} {spent:>8.1f} us a sample, {per_axle}"


def main() -> None:
    """Print the report for numbers of vehicles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicles", type=int, nargs="+", help="number of vehicles of each train")
    parser.add_argument("--ekf", type=int, default=8, help="most of them for the extended filter")
    options = parser.parse_args()
    for line in report(options.vehicles, options.ekf):
        print(line, flush=True)


if __name__ == "__main__":
    main()
