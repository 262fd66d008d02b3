"""Systems by name or file, and their models."""

from pathlib import Path

from workbench.errors import InputError, closest
from workbench.fmu import FMU
from workbench.installed import FILE, system_files
from workbench.system import OBSERVER, System
from workbench.system_file import read_system


def load_system(which: str | Path) -> System:
    """Read a system by its name, its file, or the folder that holds its file.

    Raises
    ------
    InputError
        If there is none of this name, or its file has a mistake.
    """
    known, path = system_files(), Path(which)
    if str(which) in known:
        return read_system(known[str(which)])
    if path.is_dir():
        path /= FILE
    if not path.is_file():
        raise InputError(
            where=f"system '{which}'",
            found=f"no such file, and no system of this name{closest(str(which), known)}",
            expected=f"a system file, or one of {', '.join(known)}",
            remedy="correct the name or path; 'workbench systems' lists what is installed",
        )
    return read_system(path)


def model_path(system: System, role: str) -> Path:
    """The FMU of a role.

    Raises
    ------
    InputError
        If the system has no model in this role, or it is not built.
    """
    model = system.models.get(role)
    if model is None or model.path is None:
        raise InputError(
            where=f"{system.source}, [models] {role}",
            found="no such model" if model is None else "a model without an FMU",
            expected=f"an FMU in the role '{role}'",
            remedy=f'write {role} = {{ class = "NAME", fmu = "FILE" }}',
        )
    return model.path


def open_model(system: System, role: str = OBSERVER) -> FMU:
    """Open the model of a role, with the parameters of this machine that it has.

    Raises
    ------
    InputError
        If its file is no FMU.
    """
    path = system.model(role).path
    assert path is not None
    fmu = FMU(path, system.names)
    given = {name: value for name, value in system.given.items() if name in fmu.parameters}
    if given:
        fmu.close()
        fmu = FMU(path, system.names, given)
    return fmu
