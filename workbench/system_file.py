"""Reader of `system.toml`: a machine becomes a `System`, checked against its model at the door."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from workbench.comparison_tables import read_comparison
from workbench.description import Description, read_description
from workbench.distance_tables import read_stopping
from workbench.errors import InputError
from workbench.experiment_tables import read_experiments
from workbench.recording_tables import read_cutting, read_loggers, read_redundancy, read_sampling
from workbench.system import OBSERVER, System
from workbench.system_check import check_model, check_references
from workbench.system_comparison import Comparison
from workbench.system_parts import Model, Objective, OperatingPoint, Signal
from workbench.system_tables import (
    GROUPS,
    positive,
    read_bands,
    read_condition_kinds,
    read_derived,
    read_estimated,
    read_export,
    read_fading,
    read_following,
    read_measured,
    read_model,
    read_objective,
    read_of_states,
    read_point,
    read_rolling,
    read_view,
    within,
)
from workbench.tables import Table, read_table


def read_system(path: Path) -> System:
    """Read a system file and check it against the FMU of its observer, if that is built.

    Raises
    ------
    InputError
        At the first problem: the file and key, what was found, what was expected, what to do.
    """
    file = read_table(path, "give a system file, or the name of an installed one", 'title = "..."')
    file.refuse_unknown(
        "name title companion reported models parameters inputs outputs judged aids derived "
        "estimated states feedback points conditions objective tuning diagnosis figures "
        "export shortest fewest sample_time cases sampling redundancies next cutting distance work "
        "loggers bands"
    )
    return _read(file, path, _models(file, path))


def with_built(system: System, paths: Mapping[str, Path]) -> System:
    """The same system, read again, with FMUs that were built for some roles.

    Raises
    ------
    InputError
        As `read_system`.
    """
    file = read_table(system.source, "keep the file while it is used", 'title = "..."')
    built = {
        role: replace(model, path=paths.get(role, model.path))
        for role, model in system.models.items()
    }
    return _read(file, system.source, built)


def _read(file: Table, path: Path, models: Mapping[str, Model]) -> System:
    system = _signals(file, path, models)
    model = models[OBSERVER].path
    system = _placed(file, with_model(system, OBSERVER, model))
    if model is not None:
        check_references(system, read_description(model))
    return system


def with_model(system: System, role: str, path: Path | None) -> System:
    """The same system with another FMU in a role, checked; its parameters are then those of it.

    Raises
    ------
    InputError
        If the FMU lacks a variable, or has it in another unit.
    """
    models = {**system.models, role: replace(system.model(role), path=path)}
    changed = replace(system, models=models)
    if role != OBSERVER or path is None:
        return changed
    description = read_description(path).renamed(system.names)
    check_model(changed, description)
    return replace(
        changed,
        values={**_values(description), **system.given},
        states=description.states if system.states is None else system.states,
    )


def _values(description: Description) -> dict[str, float]:
    return {v.name: float(v.start) for v in description.variables if v.real and v.start is not None}


def _models(file: Table, path: Path) -> dict[str, Model]:
    """Models by role."""
    roles = file.table("models").content
    models = {role: read_model(within(file, "models", role), path) for role in roles}
    if OBSERVER not in models:
        raise InputError(
            where=f"{path}, [models]",
            found=f"roles {', '.join(models) or 'none'}",
            expected=f"a model in the role '{OBSERVER}', which estimators run on",
            remedy=f'add {OBSERVER} = {{ class = "NAME" }}',
        )
    return models


def _measured(file: Table) -> dict[str, tuple[Signal, ...]]:
    """Measured signals by group."""
    groups = {group: read_measured(file, group) for group in GROUPS}
    if not groups["outputs"]:
        raise InputError(
            where=file.where,
            found="no [outputs]",
            expected="measured outputs, which correct the model",
            remedy="add a table [outputs.NAME] for each",
        )
    return groups


def _signals(file: Table, path: Path, models: Mapping[str, Model]) -> System:
    """The system without what its model must be known for."""
    fmu = models[OBSERVER].path
    description = read_description(fmu) if fmu is not None else None
    units = {v.name: v.unit or "1" for v in description.variables} if description else {}
    groups = _measured(file)
    # Units are known when the model is.
    parameters = file.table("parameters") if description else Table({}, "")
    states = file if description else Table({}, "")
    return System(
        name=file.text("name", path.resolve().parent.name),
        title=file.take("title", str),
        source=path,
        library=path.parent / "package.mo",
        models=models,
        names={},
        given={name: parameters.number(name, units.get(name, "1")) for name in parameters.content},
        values={},
        walks=read_of_states(states, "walk", units),
        spreads=read_of_states(states, "spread", units),
        inputs=groups["inputs"],
        outputs=groups["outputs"],
        judged=groups["judged"],
        aids=groups["aids"],
        derived=read_derived(file.table("derived")),
        estimated=read_estimated(file.table("estimated")),
        work=read_derived(file.table("work"), "W"),
        reported={name: units.get(name, "1") for name in file.texts("reported")},
        conditions=read_condition_kinds(file.table("conditions")),
        design=OperatingPoint({}, {}, {}),
        tested=OperatingPoint({}, {}, {}),
        objective=Objective("", {}, 0.0, None, None, ""),
        comparison=Comparison(
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (), None, None, None, {}, {}, {}, (), ()
        ),
        companion=file.text("companion", ""),
        shortest=file.number("shortest", "s", 0.0),
        fewest=round(file.number("fewest", "1", 20.0)),
        cases=path.parent / cases if (cases := file.text("cases", "")) else None,
        settles=file.table("points").number("settles", "s", 10.0),
        sample_time=file.number("sample_time", "s"),
        sampling=read_sampling(file.table("sampling")),
        loggers=read_loggers(
            file.table("loggers"), [n.name for own in groups.values() for n in own]
        ),
    )


def _placed(file: Table, system: System) -> System:
    """The system with all that names its signals."""
    feedback, tuning = file.table("feedback"), file.table("tuning")
    feedback.refuse_unknown("fades rolls learns")
    tuning.refuse_unknown("follows")
    points = file.table("points")
    points.refuse_unknown("settles design tested")
    design = read_point(points, "design", system)
    return replace(
        system,
        design=design,
        tested=read_point(points, "tested", system) if "tested" in points else design,
        objective=read_objective(file.table("objective"), system),
        comparison=read_comparison(file.table("diagnosis"), system),
        fading=read_fading(feedback.table("fades"), system) if "fades" in feedback else None,
        rolling=read_rolling(feedback.table("rolls")) if "rolls" in feedback else None,
        learns=positive(feedback, "learns"),
        bands=read_bands(file, system),
        following=read_following(tuning.table("follows")) if "follows" in tuning else None,
        panels=tuple(read_view(table, system) for table in file.tables("figures")),
        export=read_export(file.table("export"), system),
        redundancies=tuple(read_redundancy(table, system) for table in file.tables("redundancies")),
        experiments=read_experiments(file.table("next"), system) if "next" in file else None,
        cutting=read_cutting(file.table("cutting"), system) if "cutting" in file else None,
        stopping=read_stopping(file.table("distance"), system) if "distance" in file else None,
    )
