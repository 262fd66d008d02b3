"""`fit` beside ModestPy, estim8 and lmfit: one FMU, one recording, one set of ranges, in one run.

    pip install 'observer-workbench[compiler]' modestpy==0.1.1 'pyDOE<1' \
        estim8==0.1.6 lmfit==1.3.4
    python docs/peers.py

A pendulum whose length and two losses are unknown; its recording is by SciPy, with noise of
10 mrad. ModestPy searches the ranges by its default methods, estim8 by differential evolution;
lmfit minimises residuals of FMPy's simulations, from the values of the model.
"""

import logging
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import fmpy
import lmfit
import numpy as np
import pandas as pd
from estim8.estimator import Estimator
from estim8.models import FmuModel
from modestpy import Estimation
from scipy.integrate import solve_ivp

import workbench as wb
from workbench.models.compiler import build

MODEL = """model Pendulum
  parameter Real l(unit="m", min=0.1, max=3) = 0.8 "Length";
  parameter Real d(unit="1/s", min=0, max=1) = 0.05 "Viscous loss";
  parameter Real q(unit="1/rad", min=0, max=0.5) = 0.01 "Quadratic loss";
  Real phi(unit="rad", start=2.0, fixed=true) "Angle";
  Real w(unit="rad/s", start=0, fixed=true) "Speed";
  output Real y(unit="rad") = phi "Angle, measured";
equation
  der(phi) = w;
  der(w) = -9.81/l*sin(phi) - d*w - q*w*abs(w);
end Pendulum;
"""
SYSTEM = """title = "Pendulum"
sample_time = "20 ms"
[models]
observer = { fmu = "Pendulum.fmu" }
[outputs.y]
unit = "rad"
noise = "10 mrad"
scale = "2 rad"
"""
TRUTH = {"l": 1.0, "d": 0.12, "q": 0.05}
START = {"l": 0.8, "d": 0.05, "q": 0.01}
RANGES = {"l": (0.1, 3.0), "d": (0.0, 1.0), "q": (0.0, 0.5)}
NOISE = 0.01  # [rad]
TIME = 0.02 * np.arange(501.0)  # [s]

Values = Mapping[str, float]  # of parameters, and standard errors of some under "NAME +-"


def record() -> np.ndarray:
    """The measured angle, (n,) rad."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        gravity = -9.81 / TRUTH["l"] * np.sin(x[0])
        return [x[1], gravity - (TRUTH["d"] + TRUTH["q"] * abs(x[1])) * x[1]]

    exact = solve_ivp(rates, (0.0, TIME[-1]), [2.0, 0.0], t_eval=TIME, rtol=1e-10, atol=1e-12)
    return exact.y[0] + NOISE * np.random.default_rng(3).standard_normal(TIME.size)


def simulate(fmu: Path, values: Values) -> np.ndarray:
    """The angle by FMPy, (n,) rad."""
    result = fmpy.simulate_fmu(
        str(fmu), stop_time=TIME[-1], output_interval=0.02, start_values=dict(values),
        relative_tolerance=1e-8, output=["y"], solver="CVode", fmi_type="ModelExchange",
    )  # fmt: skip
    return np.interp(TIME, result["time"], result["y"])


def by_workbench(fmu: Path, measured: np.ndarray) -> Values:
    """Fit three parameters and the start, with profile intervals."""
    (fmu.parent / "system.toml").write_text(SYSTEM)
    system = wb.load_system(fmu.parent)
    case = wb.case_from_frame(system, pd.DataFrame({"time [s]": TIME, "y [rad]": measured}))
    parameters = [
        wb.FittedParameter(name=name, range=limits, prior=(), by_recording=None)
        for name, limits in RANGES.items()
    ]
    fitted = wb.fit(system, [case], parameters, report=lambda line: None).values
    return {v.name: v.value for v in fitted} | {f"{v.name} +-": v.deviation for v in fitted}


def by_modestpy(fmu: Path, measured: np.ndarray) -> Values:
    """Fit by a genetic algorithm and pattern search."""
    pd.DataFrame.append = pd.DataFrame._append  # which it calls by its name in pandas 1
    index = pd.Index(TIME, name="time")
    ranges = {name: (START[name], *limits) for name, limits in RANGES.items()}
    ideal = pd.DataFrame({"y": measured}, index=index)
    session = Estimation(str(fmu.parent), str(fmu), pd.DataFrame(index=index), {}, ranges, ideal)
    return dict(session.estimate())


def by_estim8(fmu: Path, measured: np.ndarray) -> Values:
    """Fit by differential evolution."""
    # Nearer to the tolerance of the others than its own 1e-4.
    model = FmuModel(str(fmu), r_tol=1e-8)
    data = pd.DataFrame({"y": measured}, index=TIME)
    bounds = {name: list(limits) for name, limits in RANGES.items()}
    estimator = Estimator(model, bounds, data, t=[0.0, float(TIME[-1]), 0.02])
    values, _ = estimator.estimate("de", max_iter=1000)
    return dict(values)


def by_lmfit(fmu: Path, measured: np.ndarray) -> Values:
    """Fit by Levenberg and Marquardt, the start too."""
    parameters = lmfit.Parameters()
    for name, (low, high) in RANGES.items():
        parameters.add(name, START[name], min=low, max=high)
    parameters.add("phi", 2.0)  # the workbench fits the start of what is measured

    def residuals(p: lmfit.Parameters) -> np.ndarray:
        return (simulate(fmu, p.valuesdict()) - measured) / NOISE

    # A step of differences that an integration at 1e-8 bears.
    fitted = lmfit.minimize(residuals, parameters, epsfcn=1e-6, scale_covar=False).params
    errors = {f"{name} +-": fitted[name].stderr for name in fitted}
    return dict(fitted.valuesdict()) | errors


TOOLS: dict[str, Callable[[Path, np.ndarray], Values]] = {
    "workbench": by_workbench,
    "lmfit with FMPy": by_lmfit,
    "estim8": by_estim8,
    "ModestPy": by_modestpy,
}


def main() -> None:
    """Run all tools, and print a table."""
    logging.disable(logging.WARNING)
    measured = record()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # ModestPy and estim8 write where they are
        fmu = Path(folder, "Pendulum.fmu")
        Path(folder, "Pendulum.mo").write_text(MODEL)
        build(Path(folder, "Pendulum.mo"), "Pendulum", fmu)
        by_workbench(fmu, measured)  # compiled once for all machines
        rows, own = [], 0.0
        for name, tool in TOOLS.items():
            begin = time.perf_counter()
            values = tool(fmu, measured)
            seconds = time.perf_counter() - begin
            own = own or seconds
            starts = {key: value for key, value in values.items() if key in (*RANGES, "phi")}
            misfit = float(np.sum(((simulate(fmu, starts) - measured) / NOISE) ** 2))
            options = [
                f"{key} {values[key]:.4f}"
                + (f" ± {values[key + ' +-']:.4f}" if key + " +-" in values else "")
                for key in RANGES
            ]
            row = [name, f"{seconds:.2g} s", f"{seconds / own:.0f}", f"{misfit:.1f}"]
            rows.append(f"| {' | '.join(row)} | {', '.join(options)} |")
            print(rows[-1], flush=True)
    print("| tool | time | over the workbench | sum of squares | values |")
    print("| --- | --- | --- | --- | --- |", *rows, sep="\n")


if __name__ == "__main__":
    main()
