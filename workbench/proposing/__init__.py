"""A law for what no effect explains: where it acts, what it depends on, and its form.

laws about the nominal model, by evidence -> free functions, fitted -> closed forms of the best
    -> diagnosis with these beside the catalogue, on recordings that were held out
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.case import Case
from workbench.diagnosis import Effect, Outcome, diagnose, read_effects
from workbench.diagnosis.search import Reporter
from workbench.diagnosis.thresholds import thresholds
from workbench.files import write_whole
from workbench.modelica import Library
from workbench.proposing.forms import Candidate, candidates
from workbench.proposing.free import Estimate, estimated
from workbench.proposing.outcome import Proposal
from workbench.proposing.scan import Prospect, Scan
from workbench.proposing.writing import PACKAGE, extended_library, package
from workbench.system import OBSERVER, System

__all__ = ["Proposal", "needs_law", "propose"]

_OF_PLACE = 2  # of one place, since about the nominal model a wrong place may fake anything
_TRIED = 6  # laws that are fitted in full, of the likeliest: it costs time only


def needs_law(before: Outcome) -> bool:
    """Whether a diagnosis leaves something to propose: unexplained, or explained by several."""
    found = before.diagnosis
    return found.verdict == "unexplained" or len(found.causes) > 1


def propose(
    before: Outcome,
    library: Library,
    effects: Sequence[Effect],
    out: Path,
    workers: int,
    report: Reporter,
    *,
    held_out: Sequence[Case] = (),
) -> Proposal:
    """Infer a law from recordings that no effect of a catalogue explains.

    Parameters
    ----------
    before : the diagnosis that left something unexplained, or that needed several effects: then a
        law is proposed only if it makes the description shorter.
    library, effects, held_out : as of that.
    out : folder of the extended model and of the generated classes.
    report : takes a line on what is being done.

    Raises
    ------
    InputError
        If the library cannot be compiled, or the model is none of this library.
    """
    system, cases = before.system, before.cases
    scan = Scan(system, library, cases, workers, report)
    able = _likeliest(scan.prospects)
    estimates = estimated(system, library, cases, workers, report, able) if able else []
    # Odds that chance turns at the rate of false alarms; and what splines owe to their form.
    decides = thresholds(len(scan.prospects), left=system.comparison.left)
    odds, near = 0.5 * decides.tied, 0.5 * (decides.tied + decides.form)
    tied = [one for one in estimates if estimates[0].evidence - one.evidence < near]
    if not tied or tied[0].evidence < odds:
        return Proposal(before, tuple(scan.prospects), tuple(estimates), (), {}, None)
    forms = {one.written.name: one for estimate in tied for one in _forms(estimate)}
    outcome = _diagnosed(
        system, cases, library, effects, forms, out, workers, report, held_out=held_out
    )
    return Proposal(before, tuple(scan.prospects), tuple(estimates), tuple(tied), forms, outcome)


def _likeliest(prospects: Sequence[Prospect]) -> list[Prospect]:
    """The best law of each place and of what it depends on, however it is carried."""
    best: dict[tuple[str, ...], Prospect] = {}
    for one in prospects:
        influence = one.law.influence
        if one.smoothness.evidence <= 0.0:
            continue
        factors = () if influence is None else tuple(part.name for part in influence.factors)
        kind = "" if influence is None or influence.kind in ("value", "size") else influence.kind
        best.setdefault((one.law.place.name, kind, *factors), one)
    of_place: dict[str, list[Prospect]] = {}
    for one in best.values():
        of_place.setdefault(one.law.place.name, []).append(one)
    kept = [one for every in of_place.values() for one in every[:_OF_PLACE]]
    return sorted(kept, key=lambda one: -one.smoothness.evidence)[:_TRIED]


def _forms(estimate: Estimate) -> list[Candidate]:
    """Closed forms of a law."""
    prospect = estimate.prospect
    # Of an output that is nominally zero, what it seems to be.
    scale = prospect.largest or float(np.abs(estimate.function()[1]).max())
    return list(candidates(prospect.law, prospect.knots, scale))


def _diagnosed(
    system: System,
    cases: Sequence[Case],
    library: Library,
    effects: Sequence[Effect],
    forms: dict[str, Candidate],
    out: Path,
    workers: int,
    report: Reporter,
    *,
    held_out: Sequence[Case],
) -> Outcome:
    """Diagnose with closed forms beside the catalogue; of equals what it has is named."""
    report(f"{len(forms)} closed forms beside {len(effects)} effects")
    with tempfile.TemporaryDirectory() as scratch:
        written = [one.written for one in forms.values()]
        extended = extended_library(library, written, Path(scratch))
        every = read_effects(extended, system.models[OBSERVER].name)
        # The likelier law first, and the simpler form: of equals the first is named.
        order = list(forms)
        own = sorted(
            (one for one in every if one.name in forms), key=lambda one: order.index(one.name)
        )
        outcome = diagnose(
            *(system, cases, extended, [*effects, *own], out, workers, report), held_out=held_out
        )
    if outcome.extension is not None:
        write_whole(
            outcome.extension.modelica.with_name(f"{PACKAGE}.mo"), package(library, written)
        )
    return outcome
