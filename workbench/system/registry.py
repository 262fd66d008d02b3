"""Systems by name or file, and their models."""

from collections.abc import Mapping
from pathlib import Path

from workbench.errors import InputError
from workbench.models import fmu_cache
from workbench.models.description import read_description
from workbench.models.fmu import FMU, open_fmu
from workbench.models.modelica import read_library
from workbench.system.installed import system_path
from workbench.system.parts import Model
from workbench.system.reader import read_system, with_built
from workbench.system.system import OBSERVER, System


def load_system(
    which: str | Path, fmu: Path | None = None, names: Mapping[str, str] | None = None
) -> System:
    """Read a system by its name, its file, or the folder that holds its file.

    Parameters
    ----------
    fmu : of its observer, instead of that of its file.
    names : the FMU's names of variables by ours, beside those of its file.

    A model without an FMU is compiled from the system's library, once for each state of it; that
    needs the extra [compiler].
    """
    system = read_system(system_path(which), fmu, names)
    missing = {role: model for role, model in system.models.items() if model.path is None}
    if not missing:
        return system
    return with_built(system, {role: _build(system, model) for role, model in missing.items()})


def _build(system: System, model: Model) -> Path:
    """The FMU of a model for this machine, from where built ones are kept."""
    if not system.library.is_file():
        raise InputError(
            where=f"{system.source}, [models]",
            found=f"no FMU of {model.name}, and no library {system.library.name} beside the file",
            expected="an FMU, or the Modelica library that the model is compiled from",
            remedy='write fmu = "FILE", or put package.mo beside the system file',
        )
    library = read_library(system.library)
    name = f"{library.name}.{model.name}"

    def make(path: Path) -> None:
        from workbench.models import compiler  # an extra: everything else runs without it

        compiler.build(system.library, name, path, platforms=[compiler.native()])

    return fmu_cache.keep(fmu_cache.key(system.library, name), make)


def model_path(system: System, role: str) -> Path:
    """The FMU of a role."""
    model = system.models.get(role)
    if model is None or model.path is None:
        raise InputError(
            where=f"{system.source}, [models] {role}",
            found="no such model",
            expected=f"a model in the role '{role}'",
            remedy=f'write {role} = {{ class = "NAME" }}',
        )
    return model.path


def open_model(system: System, role: str = OBSERVER) -> FMU:
    """Open the model of a role, with the parameters of this machine that it has."""
    path = system.model(role).path
    assert path is not None
    return open_file(path, system)


def open_file(path: Path, system: System, given: Mapping[str, float] | None = None) -> FMU:
    """Open a model file as one of a system; Co-Simulation, where it has no more.

    Parameters
    ----------
    given : values of parameters; by default those of this machine that the model has.
    """
    if given is None:
        parameters = read_description(path).renamed(system.names).names("parameter")
        given = {name: value for name, value in system.given.items() if name in parameters}
    fmu = open_fmu(path, system.names, given)
    fmu.scales = {
        **{name: signal.scale for name, signal in system.signals.items()},
        **{quantity.correction: quantity.spread for quantity in system.estimated},
    }
    return fmu
