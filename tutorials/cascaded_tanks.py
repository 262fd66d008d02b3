# %% [markdown]
# # Two tanks that overflow
#
# A pump fills a tank, which runs out into a second one. The voltages of the pump and of the second
# tank's level were recorded and published (Schoukens et al. 2016); `workbench prepare cascaded_tanks`
# says where. Run it as `python tutorials/cascaded_tanks.py DATA [OUT]`.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import workbench as wb

DATA = Path(sys.argv[1])  # the folder with dataBenchmark.mat; in a notebook, write it here
OUT = Path(sys.argv[2] if len(sys.argv) > 2 else "results/tutorials/cascaded_tanks")

# %% The nominal model is Torricelli's law in both tanks, `modelica/CascadedTanks/Tanks.mo`. Three
# coefficients and the levels at the start are not known; they are fitted along with all else. Two
# records are published, one to fit a model to and one to try it on.
system = wb.load_system("cascaded_tanks")
fitted, held_out = wb.prepare_cases("cascaded_tanks", DATA, OUT / "cases")
found = wb.diagnose(system, fitted, held_out=held_out, out=OUT)

# %% Where the simulation is wrong. Red is the error of the nominal model at its best: up to 2 V, and
# longest after the pump ran high. The grey band is the noise: this is no noise.
found.plot().savefig(OUT / "errors.png")

# %% The diagnosis: each cause, its size with the interval that holds it at 95 %, what it cannot be told
# from in this one record, and which experiment would tell. First of all, the upper tank overflows, and
# a part of that falls into the lower one. The pump needs a volt before it delivers, or something that
# looks like it here.
print(found.summary())

# %% What remains is far above the noise of the sensor, and the summary says so: tubes, waves and
# spray are not in the catalogue. This is what the errors still go with most.
print(max(found.dependences, key=lambda one: one.after))

# %% The extended model is Modelica, as one would write it by hand: the nominal one, with its
# coefficients and with classes of the library in its slots.
print(found.extension.modelica.read_text())

# %% The gain, where it counts: on the record that nothing was fitted to but the levels at its start.
for one in found.errors:
    fate = "held out" if one.held_out else "fitted"
    print(f"{one.recording}, {fate}: {one.rms[0]:.2f} V without, {one.rms[1]:.2f} V with the causes")

# %% The extended FMU runs in any tool, here in FMPy, from the pump's voltage alone. The voltage is
# held between samples, which Co-Simulation with steps of 4 s does; the sensor ends at 10 V.
fig, axes = plt.subplots(len(held_out), squeeze=False, layout="constrained")
errors = {}
for case, ax in zip(held_out, axes.flat, strict=True):
    inputs = np.rec.fromarrays([case.time, case["pump"], 0 * case.time], names="time, pump, dk3")
    result = simulate_fmu(
        str(found.extension.fmu),
        fmi_type="CoSimulation",
        start_values=found.start_values(case.name),
        input=inputs,
        stop_time=case.time[-1],
        output_interval=4.0,
        output=["level2Reading"],
    )
    level = np.minimum(result["level2Reading"], 10.0)
    errors[case.name] = np.sqrt(np.mean((case["level2"] - level) ** 2))
    ax.plot(case.time, case["level2"], "k", label="measured")
    ax.plot(case.time, level, label=f"extended model in FMPy, {errors[case.name]:.2f} V rms")
    ax.set(title=case.name, xlabel="time [s]", ylabel="level of the lower tank [V]")
    ax.legend()
fig.savefig(OUT / "fmpy.png")
