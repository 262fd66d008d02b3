"""A law for what no effect explains: where it acts, what it depends on, and its form.

laws about what is known, by evidence -> free functions, fitted -> closed forms of the best
    -> diagnosis with these beside the catalogue, on recordings that were held out
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.diagnosis import (
    Effect,
    Outcome,
    Problem,
    build_everything,
    diagnose,
    given_values,
    read_effects,
)
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.causes import binding_bound
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel, Step, beyond, forward_selection
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.inference.thresholds import Thresholds, of_system
from workbench.diagnosis.inference.verdict import Diagnosis
from workbench.diagnosis.laws.forms import ClosedForm, candidates
from workbench.diagnosis.laws.free import FittedLaw, estimated
from workbench.diagnosis.laws.outcome import Proposal, description_length
from workbench.diagnosis.laws.places import Law
from workbench.diagnosis.laws.scan import LawScore, Scan
from workbench.diagnosis.laws.writing import PACKAGE, extended_library, package
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.models.modelica import Library
from workbench.runtime.engine import Engine
from workbench.runtime.files import write_whole

__all__ = ["Proposal", "compared_with_one_law", "needs_law", "one_law", "propose"]

_OF_PLACE = 2  # of one place, since about the nominal model a wrong place may fake anything
_OF_FORMS = 2  # closed forms: sizes of some are not sure beside their own shape
_BESIDE = 2  # laws that are fitted beside several causes: it costs time in each diagnosis
_WIDENED = 2  # times that bounds are widened, by ten each
_TRIED = 6  # laws that are fitted in full, of the likeliest: it costs time only


def needs_law(before: Outcome) -> bool:
    """Whether a diagnosis leaves a law to propose: something unexplained, or several causes."""
    diagnosis = before.diagnosis
    left = diagnosis.verdict == "unexplained" or len(diagnosis.causes) > 1 or _more(diagnosis)
    return diagnosis.late is None and left


def _more(diagnosis: Diagnosis) -> bool:
    """Whether errors last beside what was found: it explains most, and not all."""
    if diagnosis.verdict == "partly explained":
        return True
    lasting = float(diagnosis.best.linearised.variance_factors.max())
    return len(diagnosis.causes) == 1 and lasting >= Thresholds.wrong


def one_law(diagnosis: Diagnosis, problem: Problem, engine: Engine) -> str:
    """Ask whether one free law in a slot of several causes explains as much with less.

    By the description length of the causes, and the marginal likelihood of the law. Returns what
    the law is; empty if none does, or there are not several causes.
    """
    if len(diagnosis.causes) < 2 or diagnosis.interrupted or problem.library is None:
        return ""
    slots = {slot for cause in diagnosis.causes for slot in cause.effect.slots}
    able = _likeliest(Scan(problem, diagnosis.base, engine, slots).prospects)[:_BESIDE]
    less = description_length(diagnosis.base) - description_length(diagnosis.best)
    # What a law gains is half of what the deviance falls by, or less.
    sought = diagnosis.base.linearised.deviance - 2.0 * less
    laws = estimated(problem, able, diagnosis.base, engine, sought) if able else []
    return laws[0].law.text if laws and laws[0].evidence >= less else ""


def compared_with_one_law(outcome: Outcome, problem: Problem, engine: Engine) -> Outcome:
    """The outcome beside one law, see `one_law`, in place of which several causes are no answer.

    What explains a part stays one.
    """
    diagnosis = outcome.diagnosis
    if not (law := one_law(diagnosis, problem, engine)):
        return outcome
    if diagnosis.verdict != "found":
        return replace(outcome, one_law=law)
    for path in outcome.extension.files if outcome.extension is not None else ():
        path.unlink()
    return replace(
        outcome,
        diagnosis=diagnosis.outdone(law),
        one_law=law,
        extension=None,
        rivals=None,
        certainty=None,
        observers={},
    )


def propose(before: Outcome, problem: Problem, engine: Engine) -> Proposal:
    """Infer a law from recordings that no effect of a catalogue explains.

    Parameters
    ----------
    before : the diagnosis that left something unexplained, or that needed several effects: then a
        law is proposed only if it makes the description shorter. Where errors last beside a single
        cause, a law is sought beside that.
    problem : as it was asked of that.
    engine : whose folder takes the extended model and the generated classes.
    """
    about = before.diagnosis.best if _more(before.diagnosis) else before.diagnosis.base
    scan = Scan(problem, about, engine)
    estimates = _turning(scan.prospects)
    if not estimates:
        able = _likeliest(scan.prospects)
        fitted: dict[tuple[str, ...], FittedLaw] = {}
        for law in estimated(problem, able, about, engine) if able else ():
            fitted.setdefault(_called(law.law), law)
        estimates = list(fitted.values())
    # Odds that chance turns at the rate of false alarms; and what splines owe to their form.
    decides = of_system(problem.system.comparison, len(scan.prospects))
    odds, near = 0.5 * decides.tied, 0.5 * (decides.tied + decides.form)
    tied = [estimate for estimate in estimates if estimates[0].evidence - estimate.evidence < near]
    if not tied or tied[0].evidence < odds:
        return Proposal(before, tuple(scan.prospects), tuple(estimates), (), {}, None)
    forms: dict[str, ClosedForm] = {}
    for estimate in tied:
        prospect, largest = estimate.prospect, float(np.abs(estimate.function()[1]).max())
        # Of an output that is nominally zero, what it seems to be.
        known = prospect.largest or largest
        for form in candidates(prospect.law, prospect.knots, known, largest):
            forms[form.name] = form
    forms = _surviving(problem, forms, about, engine)
    estimated_laws = (tuple(scan.prospects), tuple(estimates), tuple(tied))
    proposal = Proposal(before, *estimated_laws, forms, None)
    # Beside what bends to the rest, a law may not be seen; alone it may explain a part.
    tolerant = replace(problem.system, comparison=replace(problem.system.comparison, left=1.0))
    ways = [problem, replace(problem, system=tolerant, effects=())]
    for way in ways if before.diagnosis.verdict == "unexplained" else ways[:1]:
        for name in list(forms)[:_OF_FORMS]:
            own = {name: forms[name], **forms}
            outcome = _diagnosed(way, own, engine)
            proposal = Proposal(before, *estimated_laws, own, outcome)
            if proposal.laws:
                return proposal
    return proposal


def _turning(prospects: Sequence[LawScore]) -> list[FittedLaw]:
    """Laws that begin anew with each period, if one is likelier than all others.

    They are small beside what they change, so that about what is known they are fitted well enough.
    """
    if not prospects or not _turns(prospects[0]):
        return []
    likeliest = [prospect for prospect in prospects if _turns(prospect)][:_TRIED]
    return [
        FittedLaw(
            law, law.smoothness.evidence, law.smoothness.coefficients, law.smoothness.posterior
        )
        for law in likeliest
        if law.smoothness.evidence > 0.0
    ]


def _turns(prospect: LawScore) -> bool:
    return prospect.law.influence is not None and prospect.law.influence.turns


def _likeliest(prospects: Sequence[LawScore]) -> list[LawScore]:
    """The best law of each place and of what it depends on, however it is carried.

    Of heat there are all, with every time constant: which is right, small changes about what is
    known hardly tell.
    """
    best: dict[tuple[str, ...], LawScore] = {}
    for prospect in prospects:
        influence = prospect.law.influence
        if prospect.smoothness.evidence <= 0.0 or _turns(prospect):
            continue
        factors = () if influence is None else tuple(part.name for part in influence.factors)
        kind = "" if influence is None or influence.kind in ("value", "size") else influence.kind
        best.setdefault((prospect.law.place.name, kind, *factors), prospect)
    of_place: dict[str, list[LawScore]] = {}
    for law in best.values():
        of_place.setdefault(law.law.place.name, []).append(law)
    kept = [law for every in of_place.values() for law in every[:_OF_PLACE]]
    first = sorted(kept, key=lambda law: -law.smoothness.evidence)[:_TRIED]
    wanted = {_called(law.law) for law in first}
    return [
        prospect
        for prospect in prospects
        if not _turns(prospect) and _called(prospect.law) in wanted
    ]


def _called(law: Law) -> tuple[str, ...]:
    """What a law is called; one of heat however it is carried, and lost."""
    if law.influence is None:
        return law.place.name, law.carrier.expression
    carrier = "" if law.influence.kind == "work" else law.carrier.expression
    return law.place.name, carrier, law.influence.name


def _surviving(
    problem: Problem,
    forms: Mapping[str, ClosedForm],
    about: FittedModel,
    engine: Engine,
    left: int = _WIDENED,
) -> dict[str, ClosedForm]:
    """The closed form with the shortest description, first, and those that are as good.

    They are found as causes are, by what they predict of recordings that they were not fitted to.
    Beside others each would be one of many: forms of one law are alike. Where the first is at a
    bound, bounds are widened so many times as are `left`.
    """
    system = problem.system
    engine.report(f"{len(forms)} closed forms, each alone")
    with tempfile.TemporaryDirectory() as scratch:
        extended, own = _as_effects(problem, forms, Path(scratch))
        path = Path(scratch) / "Forms.fmu"
        every = [*about.active, *own]
        build_everything(system, extended, every, path)
        steps: list[Step] = []
        source = ModelSource(path, system, given_values(path, system))
        with ResidualModel(source, problem.cases, engine) as simulations:
            decides = of_system(system.comparison, len(own))
            fit = Fit(simulations, every, replace(decides, most=len(about.active) + 1))
            forward_selection(
                fit, own, anew(fit, about.point, about.active), steps, (), engine.report
            )
            rivals = steps[0].rivals if steps else ()
            bound = {
                name
                for rival in rivals
                for name, parameter in rival.point.sizes
                if name in forms and binding_bound(fit, rival, rival.active[-1], parameter)
            }
    if not steps:
        return {}
    before = steps[0].before
    near = max(decides.form, decides.form_share * beyond(before, rivals[0]))
    alike = [rival for rival in rivals if beyond(rival, rivals[0]) < near]
    first, *others = [model.active[-1] for model in sorted(alike, key=description_length)]
    if first.name in bound and left:
        engine.report(f"{first.name} is at a bound, which is widened")
        wider = {name: form.widened if name in bound else form for name, form in forms.items()}
        return _surviving(problem, wider, about, engine, left - 1)
    return {effect.name: forms[effect.name] for effect in (first, *others)}


def _as_effects(
    problem: Problem, forms: Mapping[str, ClosedForm], folder: Path
) -> tuple[Library, list[Effect]]:
    """A library with closed forms, and these: the likelier law and the simpler form first."""
    extended = extended_library(problem.modelica, [form.written for form in forms.values()], folder)
    order = list(forms)
    own = [effect for effect in read_effects(extended, problem.base) if effect.name in forms]
    return extended, sorted(own, key=lambda effect: order.index(effect.name))


def _diagnosed(problem: Problem, forms: Mapping[str, ClosedForm], engine: Engine) -> Outcome:
    """Diagnose with the first closed form beside the catalogue; of equals, that has its name."""
    first = dict(list(forms.items())[:1])
    engine.report(f"{', '.join(first)} beside {len(problem.effects)} effects")
    with tempfile.TemporaryDirectory() as scratch:
        extended, own = _as_effects(problem, first, Path(scratch))
        effects = [*problem.effects, *own]
        outcome = diagnose(replace(problem, library=extended, effects=effects), engine)
    if outcome.extension is not None and outcome.extension.modelica is not None:
        text = package(problem.modelica, [form.written for form in forms.values()])
        write_whole(outcome.extension.modelica.with_name(f"{PACKAGE}.mo"), text)
    return outcome
