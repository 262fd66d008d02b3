"""The commands of the command line, one module each."""

from workbench.commands.accuracy import add_accuracy
from workbench.commands.bench import add_bench
from workbench.commands.diagnose import add_diagnose
from workbench.commands.export import add_export
from workbench.commands.fmu import add_fmu
from workbench.commands.observability import add_observability
from workbench.commands.power import add_power
from workbench.commands.rig import add_rig
from workbench.commands.simulate import add_simulate
from workbench.commands.tune import add_tune

__all__ = [
    "add_accuracy",
    "add_bench",
    "add_diagnose",
    "add_export",
    "add_fmu",
    "add_observability",
    "add_power",
    "add_rig",
    "add_simulate",
    "add_tune",
]
