# %% [markdown]
# # A train that loses air
#
# The compressor of a metro train fills a reservoir, which supplies brakes, doors and suspension.
# The reservoir pressure, and a flag that is 0 while the compressor delivers, were recorded every
# 10 s and published as MetroPT-3. `workbench prepare air_supply` says where to get the data.
#
# Run `python tutorials/air_supply.py DATA [OUT]`. Or open this file as a notebook, and write the
# folder of `original.csv` into the first cell.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import workbench as wb

DATA, OUT = Path(sys.argv[1]), Path((sys.argv[2:] or ["results/tutorials/air_supply"])[0])

# %%
# The nominal model is a tight reservoir (modelica/AirSupply/Unit.mo). The delivery of the
# compressor is unknown and fitted. The recording is split into five cycles of the compressor:
# three are fitted, two are held out.
system = wb.load_system("air_supply")
fitted, held_out = wb.prepare_cases("air_supply", DATA, OUT / "cases")
outcome = wb.diagnose(system, fitted, held_out=held_out, out=OUT)

# %%
# Where is the simulation wrong? The error of the nominal model (red) decreases while the
# compressor rests. The measured pressure decreases, and nothing in the model takes air.
outcome.plot().savefig(OUT / "errors.png")

# %%
# The diagnosis finds a loss of air, whose size is known to about 13 %. These data cannot tell
# five candidates apart: a gap, a hole, the check valve, a leak of compressible flow, or a steady
# consumer. The pressure falls by less than a fifth in each cycle, which is too little. The
# summary says so, and what would discriminate between them. The remaining error is above the
# noise. The flag is known to 10 s, and the compressor raises the pressure by 0.2 bar in that
# time.
print(outcome.summary())

# %%
# The extended model is Modelica: the nominal model, with a class of the library in its slot.
print(outcome.extension.modelica.read_text())

# %%
# The gain on the held-out cycles: the error falls to a tenth or less. Only their initial pressure
# was fitted.
for error in outcome.errors:
    before, after = (1e-2 * rms for rms in error.rms)  # from Pa
    fate = "held out" if error.held_out else "fitted"
    print(f"{error.recording}, {fate}: {before:.0f} mbar without leak, {after:.0f} mbar with it")

# %%
# The extended FMU runs in any tool, here in FMPy. It needs only the flag and the initial
# pressure. Between two samples the flag is interpolated, and FMPy holds inputs over a step. So
# the steps are short.
case = held_out[0]
result = simulate_fmu(
    str(outcome.extension.fmu),
    fmi_type="CoSimulation",
    start_values=outcome.start_values(case.name),
    input=np.rec.fromarrays([case.time, case["COMP"], 0 * case.time], names="time, COMP, dloss"),
    stop_time=case.time[-1],
    output_interval=0.5,
    output=["reservoirReading"],
)
pressure = np.interp(case.time, result["time"], result["reservoirReading"])
error = np.sqrt(np.mean((case["reservoir"] - pressure) ** 2))

figure, axes = plt.subplots(layout="constrained")
axes.plot(case.time, 1e-5 * case["reservoir"], "k", label="measured")
axes.plot(case.time, 1e-5 * pressure, label="extended model in FMPy")
axes.set(
    title=f"{case.name}, error {1e-2 * error:.0f} mbar rms",
    xlabel="time [s]",
    ylabel="pressure of the reservoir [bar]",
)
figure.legend(loc="outside lower center", ncols=2)
figure.savefig(OUT / "fmpy.png")
