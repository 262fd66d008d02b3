# %% [markdown]
# # A train that loses air
#
# The compressor of a metro train fills a reservoir, from which brakes, doors and suspension live.
# Its pressure, and a flag that is 0 while the compressor delivers, were recorded every 10 s and
# published as MetroPT-3; `workbench prepare air_supply` says where. Run `python
# tutorials/air_supply.py DATA [OUT]`, or open this as a notebook and write the folder with
# `original.csv` into the first cell.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import workbench as wb

DATA, OUT = Path(sys.argv[1]), Path((sys.argv[2:] or ["results/tutorials/air_supply"])[0])

# %%
# The nominal model is a tight reservoir (modelica/AirSupply/Unit.mo). What the compressor
# delivers is not known, and fitted. The record is cut into five cycles of the compressor, three
# to fit to and two to try the result on.
system = wb.load_system("air_supply")
fitted, held_out = wb.prepare_cases("air_supply", DATA, OUT / "cases")
found = wb.diagnose(system, fitted, held_out=held_out, out=OUT)

# %%
# Where the simulation is wrong: the error of the nominal model (red) falls all along while the
# compressor rests. The pressure does, and nothing in the model takes air.
found.plot().savefig(OUT / "errors.png")

# %%
# The diagnosis: air is lost, and how much is known to some 13 %. By which of five ways, through a
# gap, a hole or the check valve, or to a consumer, these data cannot tell, since the pressure
# falls by less than a fifth in each cycle. The summary says so, and what would tell. What remains
# is above the noise: the flag is known to 10 s, in which the compressor raises the pressure by
# 0.2 bar.
print(found.summary())

# %%
# The extended model is Modelica: the nominal one with a class of the library in its slot.
print(found.extension.modelica.read_text())

# %%
# The gain, on the cycles to which nothing was fitted but the pressure at their start: to a tenth
# or less.
for one in found.errors:
    before, after = (1e-2 * rms for rms in one.rms)  # from Pa
    fate = "held out" if one.held_out else "fitted"
    print(f"{one.recording}, {fate}: {before:.0f} mbar without the leak, {after:.0f} mbar with it")

# %%
# The extended FMU runs in any tool, here in FMPy, and needs nothing but the flag and the pressure
# at the start. Between two readings the flag is a line, which FMPy holds over a step: so steps
# are short.
case = held_out[0]
result = simulate_fmu(
    str(found.extension.fmu),
    fmi_type="CoSimulation",
    start_values=found.start_values(case.name),
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
