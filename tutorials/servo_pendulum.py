# %% [markdown]
# # A servo that swings a pendulum
#
# A small servo moves an arm with a weight. What it was asked for, its supply voltage and its
# position were recorded and published by Duclusaud and Passault (2026): four motions at four
# gains of its controller; `workbench prepare servo_pendulum` says where. Run `python
# tutorials/servo_pendulum.py DATA [OUT]`, or open this as a notebook and write the folder of the
# data into the first cell.

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
# (modelica/ServoPendulum/Servo.mo). Torque constant, resistance, inertia and zero of this very
# servo are not known, and fitted. The records at a gain of 200 are there to try the result on.
system = wb.load_system("servo_pendulum")
fitted, held_out = wb.prepare_cases("servo_pendulum", DATA, OUT / "cases")
found = wb.diagnose(system, fitted, held_out=held_out, out=OUT)

# %%
# Where the simulation is wrong: without friction (red) the arm swings where the real one rests.
found.plot().savefig(OUT / "errors.png")

# %%
# The diagnosis: viscous friction; friction that grows with the load on the gear, the more so
# close to standstill; and a supply that gives way under current. Each has its size with an
# interval of 95 %, and its twins if these data have any. A Stribeck curve alone, without the
# load, is not named. What remains is far above the noise of the encoder: laws of friction are
# only so good.
print(found.summary())

# %%
# The extended model is Modelica: the nominal one with what was fitted, and with classes of the
# library in its slots. What several of them resist adds up.
print(found.extension.modelica.read_text())

# %%
# The result at the gain that nothing was fitted to, by the mean absolute error: from 125 to 29
# mrad. The slow motion improves least, because there friction is all that counts.
for one in found.errors:
    before, after = (1e3 * mean for mean in one.mean_absolute)
    fate = "held out" if one.held_out else "fitted"
    print(f"{one.recording}, {fate}: {before:.0f} mrad without, {after:.0f} mrad with the causes")

# %%
# The extended FMU runs in any tool, here in FMPy. The start values hold the gain of the
# controller, too. Between two samples inputs are lines, which FMPy holds over a step: so steps
# are short.
case = held_out[0]
result = simulate_fmu(
    str(found.extension.fmu),
    fmi_type="CoSimulation",
    start_values=found.start_values(case.name),
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
