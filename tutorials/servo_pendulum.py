# %% [markdown]
# # A servo that swings a pendulum
#
# A small servo moves an arm with a weight. Its set point, supply voltage and position were
# recorded and published by Duclusaud and Passault (2026): four motions at four gains of its
# controller. `workbench prepare servo_pendulum` says where to get the data.
#
# Run `python tutorials/servo_pendulum.py DATA [OUT]`. Or open this file as a notebook, and write
# the folder of the data into the first cell.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import workbench as wb

DATA, OUT = Path(sys.argv[1]), Path((sys.argv[2:] or ["results/tutorials/servo_pendulum"])[0])

# %%
# The nominal model is a motor without friction, with its controller and the arm
# (modelica/ServoPendulum/Servo.mo). Torque constant, resistance, inertia and zero of this servo
# are unknown and fitted. The recordings at a gain of 200 are held out.
system = wb.load_system("servo_pendulum")
fitted, held_out = wb.prepare_cases("servo_pendulum", DATA, OUT / "cases")
outcome = wb.diagnose(system, fitted, held_out=held_out, out=OUT)

# %%
# Where is the simulation wrong? Without friction (red) the arm swings; the real one rests.
outcome.plot().savefig(OUT / "errors.png")

# %%
# The diagnosis names three effects: viscous friction; friction that grows with the load on the
# gear, most near standstill; and a supply whose voltage drops under current. Each has its size
# with a 95 % interval, and the indistinguishable effects if there are any. A Stribeck curve
# without the load is not named. The remaining error is far above the noise of the encoder, since
# friction laws are approximations.
print(outcome.summary())

# %%
# The extended model is Modelica: the nominal model with the fitted parameters, and classes of the
# library in its slots. Several friction torques add up.
print(outcome.extension.modelica.read_text())

# %%
# The gain on the recordings at the held-out gain: the mean absolute error falls from 125 to 29
# mrad. The slow motion improves least, because it depends on friction alone.
for error in outcome.errors:
    before, after = (1e3 * mean for mean in error.mean_absolute)
    fate = "held out" if error.held_out else "fitted"
    print(f"{error.recording}, {fate}: {before:.0f} mrad without, {after:.0f} mrad with the causes")

# %%
# The extended FMU runs in any tool, here in FMPy. The start values include the gain of the
# controller. Between two samples inputs are interpolated, and FMPy holds them over a step. So the
# steps are short.
case = held_out[0]
result = simulate_fmu(
    str(outcome.extension.fmu),
    fmi_type="CoSimulation",
    start_values=outcome.start_values(case.name),
    input=np.rec.fromarrays(
        [case.time, *case.u.T, 0 * case.time], names=["time", *case.inputs, "dtauF"]
    ),
    stop_time=case.time[-1],
    output_interval=2.5e-4,
    output=["reading"],
)
position = np.interp(case.time, result["time"], result["reading"])
error = np.mean(np.abs(case["position"] - position))

figure, axes = plt.subplots(layout="constrained")
axes.plot(case.time, case["position"], "k", label="measured")
axes.plot(case.time, position, label="extended model in FMPy")
axes.set(
    title=f"{case.name}, mean error {1e3 * error:.0f} mrad",
    xlabel="time [s]",
    ylabel="position [rad]",
)
figure.legend(loc="outside lower center", ncols=2)
figure.savefig(OUT / "fmpy.png")
