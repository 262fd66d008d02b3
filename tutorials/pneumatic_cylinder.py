# %% [markdown]
# # Seals that rub, and a chamber that leaks
#
# Zillen, Vallery and Smit (2021) printed pneumatic cylinders. They measured the force on a
# cylinder with two different seals at four pressures, and the pressure of closed chambers.
# `workbench prepare seal_friction` says where to get the data.
#
# Run `python tutorials/pneumatic_cylinder.py DATA [OUT]`. Or open this file as a notebook, and
# write the folder of the data into the first cell.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import workbench as wb

DATA, OUT = Path(sys.argv[1]), Path((sys.argv[2:] or ["results/tutorials/pneumatic_cylinder"])[0])

# %%
# The nominal model says force = pressure x area (modelica/SealFriction/Cylinder.mo), with an area
# that is known to some per cent. Each seal is a machine with a diagnosis of its own. Its
# recordings at 1, 3 and 7 bar are fitted, and that at 5 bar is held out.
system = wb.load_system("seal_friction")
fitted, held_out = wb.prepare_cases("seal_friction", DATA, OUT / "cases")
outcomes = {}
for seal in ("O-ring", "NAPN"):
    own, other = ([c for c in cases if c.name.startswith(seal)] for cases in (fitted, held_out))
    outcomes[seal] = wb.diagnose(system, own, held_out=other, out=OUT / seal)

# %%
# Where is the simulation wrong? The error changes with the direction of the stroke. For both
# seals the diagnosis names friction, a part that grows with the pressure, and a seal that is
# sheared before it slides. The size of each has a 95 % interval. For the second seal, the load
# cell or the pressure sensor has a wrong zero; these data cannot tell which. The remaining error,
# about a tenth of the friction, is above the noise. Grease and seals that are not round are not
# modelled.
for seal, outcome in outcomes.items():
    outcome.plot().savefig(OUT / f"errors_{seal}.png")
    print(f"\n{seal}\n{outcome.summary()}")

# %%
# The extended model of the O-ring is Modelica. The forces of several effects add up in the slot.
print(outcomes["O-ring"].extension.modelica.read_text())

# %%
# The gain on the held-out recording at 5 bar: the error falls from 6.6 and 9.0 N to 0.9 N. The
# extended FMU in FMPy shows it too, beside the measured force. The start values include the area
# of the piston. Between two samples inputs are interpolated, and FMPy holds them over a step. So
# the steps are short.
figure, plots = plt.subplots(2, layout="constrained")
errors = {}
for axes, (seal, outcome) in zip(plots, outcomes.items(), strict=True):
    (case,) = (case for case in held_out if case.name.startswith(seal))
    result = simulate_fmu(
        str(outcome.extension.fmu),
        fmi_type="CoSimulation",
        start_values=outcome.start_values(case.name),
        input=np.rec.fromarrays(
            [case.time, *case.u.T, 0 * case.time], names=["time", *case.inputs, "dfriction"]
        ),
        start_time=case.time[0],
        stop_time=case.time[-1],
        output_interval=1e-3,
        output=["FReading"],
    )
    force = np.interp(case.time, result["time"], result["FReading"])
    errors[seal] = np.sqrt(np.mean((case["F"] - force) ** 2))
    (rms,) = (e.rms for e in outcome.errors if e.held_out)
    print(f"{case.name}, held out: {rms[0]:.1f} N without friction, {rms[1]:.1f} N with it")
    axes.plot(case.time, case["F"], "k", label="measured")
    axes.plot(case.time, force, label="extended model in FMPy")
    axes.set(
        title=f"{case.name}, error {errors[seal]:.1f} N rms", xlabel="time [s]", ylabel="force [N]"
    )
figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
figure.savefig(OUT / "fmpy.png")

# %%
# The chambers need only a few lines. A printed chamber leaks in proportion to its pressure, or by
# a law that these data cannot tell from that. An aluminium chamber is tight. Data above 2 bar are
# fitted, data below are held out.
chamber = wb.load_system("leaking_chamber")
fitted, held_out = wb.prepare_cases("leaking_chamber", DATA, OUT / "chambers")
for name in ("Ultimaker_020", "Aluminium"):
    own, other = ([c for c in cases if c.name.startswith(name)] for cases in (fitted, held_out))
    outcomes[name] = wb.diagnose(chamber, own, held_out=other, out=OUT / name)
    print(f"\n{name}\n{outcomes[name].summary()}")
