"""Laws that are proposed for a cause that the catalogue lacks: each effect left out in turn."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis import Outcome, Problem, diagnose, given_values
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.laws import Proposal, needs_law, propose
from workbench.diagnosis.laws.scan import watching
from workbench.diagnosis.laws.writing import extended_library
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.recordings.case import read_cases
from workbench.runtime.engine import Engine, StepReporter
from workbench.studies.power.planting import Group, Planting
from workbench.studies.power.run import PowerStudy
from workbench.studies.power.statistics import share

_WORTH = 0.8  # of what the true form gains
_NEAR = 0.15  # of the range of what a cause does

SHARES = {
    "right_slot": "sets with the right slot, of those whose cause nothing else explains",
    "gain": "laws that gain four fifths of what the true form gains",
    "function": "laws within 15 % of the range of what the cause does, on recordings anew",
    "outside": "of them, sets whose cause is in no catalogue",
    "clean": "sets without a cause for which something is proposed",
}
"""Shares of `summarise_left_out`, by what they count."""


@dataclass
class LeftOutRow:
    """A set whose cause is left out of the catalogue, as left_out.json has it."""

    rig: str  # options that make the set
    left_out: list[str]  # effects that the catalogue lacks
    # verdict, named, late: of the diagnosis without them: causes, and signals that are late
    verdict: str = "failed"
    named: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    asked: bool = False  # whether it asks for a law
    # laws, slots: that are proposed, and slots of all laws that are as good
    laws: list[str] = field(default_factory=list)
    slots: list[str] = field(default_factory=list)
    slot_right: bool | None = None  # whether the cause acts in one of them; None without a cause
    # before, after, after_with_it: held-out errors, without and with the law, with the true cause
    before: float | None = None
    after: float | None = None
    after_with_it: float | None = None
    function_error: float | None = None  # see `function_error`
    error: str = ""  # why it failed


def summarise_left_out(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Count shares, see `SHARES`; a set that other effects or clocks explain asks for no law."""
    asked = [row for row in rows if row["asked"] and row["slot_right"] is not None]
    known = [row for row in asked if row["laws"] and row["after_with_it"] is not None]
    clean = [row for row in rows if row["slot_right"] is None and not row["left_out"]]
    return {
        "right_slot": share(row["slot_right"] for row in asked),
        "outside": share(row["slot_right"] for row in asked if not row["left_out"]),
        "gain": share(
            row["before"] - row["after"] >= _WORTH * (row["before"] - row["after_with_it"])
            for row in known
        ),
        "function": share(
            row["function_error"] <= _NEAR for row in known if row["function_error"] is not None
        ),
        "clean": share(bool(row["laws"]) for row in clean),
    }


def propose_left_out(
    groups: Sequence[Group], study: PowerStudy, engine: Engine
) -> tuple[list[dict[str, Any]], bool]:
    """Make sets with one cause each, and diagnose them with a catalogue that lacks it.

    Parameters
    ----------
    groups : as planned; of each the first set is made, if it has one cause or none.

    Returns
    -------
    rows : one for each set, see `LeftOutRow`.
    interrupted : whether Ctrl-C ended the run; what was finished is in the rows.

    Raises
    ------
    InputError
        If the model is an FMU alone.
    """
    _ = study.problem.modelica  # in whose equations laws are sought
    sets = [group[0] for group in groups if group[0].kind != "pair"]
    rows: list[dict[str, Any]] = []
    progress = StepReporter(engine.report, len(sets))
    try:
        for planting in sets:
            rows.append(asdict(_row(planting, study, engine.workers)))
            laws = ", ".join(rows[-1]["laws"]) or f"{rows[-1]['verdict']}, nothing proposed"
            progress.step(f"{planting.options}: {laws}")
    except KeyboardInterrupt:
        return rows, True
    return rows, False


def _row(planting: Planting, study: PowerStudy, workers: int) -> LeftOutRow:
    system, rig, effects = study.system, study.rig, study.effects
    planted = [effect for effect in effects if effect.name in planting.effects]
    others = [effect for effect in effects if effect not in planted]
    acting = {slot for effect in planted for slot in effect.slots}
    acting |= {
        plantable.slot
        for plantable in rig.plantables
        if plantable.name in planting.gains and plantable.slot
    }
    row = LeftOutRow(planting.options, [effect.name for effect in planted])
    try:
        with tempfile.TemporaryDirectory() as folder:
            recordings, out, new = (Path(folder) / name for name in ("recordings", "out", "new"))
            simulated = rig.simulate(planting.seed, planting.gains)
            rig.write(simulated, planting.gains, recordings)
            cases = read_cases([recordings], system)
            engine = Engine(workers, out=out)
            problem = replace(study.problem, cases=cases, effects=others)
            before = diagnose(problem, engine)
            row.verdict = before.diagnosis.verdict
            row.named = [cause.effect.name for cause in before.diagnosis.causes]
            late = before.diagnosis.late
            row.late = [] if late is None else list(late.signals)
            row.asked = needs_law(before)
            if row.asked:
                proposal = propose(before, problem, engine)
                if proposal.laws:
                    laws = [form.law for form in proposal.forms.values()]
                    row.laws = [proposal.text_of(law) for law in proposal.laws]
                    row.slots = list(dict.fromkeys(law.place.slot.name for law in laws))
                    if proposal.outcome and (gain := proposal.outcome.diagnosis.gain):
                        row.before, row.after = gain.before, gain.after
                if planted and proposal.laws:
                    known = diagnose(replace(problem, effects=effects), engine)
                    gain = known.diagnosis.gain
                    row.after_with_it = None if gain is None else gain.after
                    rig.write(rig.simulate(planting.seed + 1, planting.gains), planting.gains, new)
                    fresh = read_cases([new], system)
                    row.function_error = function_error(
                        replace(problem, cases=fresh), known, proposal, planted[0]
                    )
    except Exception as error:  # one set must not end a run of hours; it is counted
        row.error = repr(error)
    if acting:
        row.slot_right = bool(acting & {*row.slots})
    return row


def function_error(
    problem: Problem, known: Outcome, proposal: Proposal, effect: Effect
) -> float | None:
    """Error of the first proposed law, over the range of what the true cause does.

    Both are outputs of their slot, along recordings that neither was fitted to, as each was fitted
    with the levels beside it.

    Parameters
    ----------
    problem : whose recordings were not fitted.
    known : of the diagnosis with the true cause in its catalogue.
    effect : that cause, of the library.

    Returns
    -------
    error : root mean square over range; None where the law acts elsewhere, the true cause was not
        found, or phases are free in each recording.
    """
    if not proposal.laws or proposal.outcome is None:
        return None
    law = proposal.forms[proposal.laws[0].effect.name].law
    true, proposed = known.diagnosis.best, proposal.outcome.diagnosis.best
    effects = list({e.name: e for e in (*true.active, *proposed.active)}.values())
    elsewhere = law.place.slot.name not in effect.slots or effect not in true.active
    if elsewhere or any(active.order_locked for active in effects):
        return None
    with tempfile.TemporaryDirectory() as folder:
        written = [proposal.forms[cause.effect.name].written for cause in proposal.laws]
        extended = extended_library(problem.modelica, written, Path(folder))
        path = Path(folder) / "Both.fmu"
        about = "With the law and the true cause"
        text = ExtendedModel(extended, problem.base, "Both", effects, about).source()
        output = f"{law.place.slot.name}.{law.place.output.name}"
        build(extended, "Both", watching(text, [output]), path, every_platform=False)
        both = ModelSource(path, problem.system, given_values(path, problem.system))
        with ResidualModel(both, problem.cases) as simulations:
            fit = Fit(simulations, effects)
            without, right, law_output = (
                _slot_output(simulations, fit, model)
                for model in (known.diagnosis.base, true, proposed)
            )
    return float(np.sqrt(np.mean((law_output - right) ** 2)) / np.ptp(right - without))


def _slot_output(simulations: ResidualModel, fit: Fit, fitted: FittedModel) -> Vector:
    """Output of the slot along all recordings, as a model was fitted, without random effects."""
    usual = np.zeros((fit.unknowns.count, fitted.point.deviations.shape[1]))
    point = replace(fitted.point, deviations=usual)
    tables = simulations.along(fit.unknowns.values(point), ["watched0"])
    return np.concatenate([table[:, 0] for table in tables])
