"""The commands of the command line, one module each."""

from workbench.commands.fmu import add_fmu
from workbench.commands.observability import add_observability
from workbench.commands.rig import add_rig
from workbench.commands.simulate import add_simulate

__all__ = ["add_fmu", "add_observability", "add_rig", "add_simulate"]
