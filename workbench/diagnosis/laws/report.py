"""Files of a proposal: proposal.json, tables and a figure of the functions, the full diagnosis."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.diagnosis import Outcome
from workbench.diagnosis.laws import Proposal
from workbench.diagnosis.report import relate_diagnosis, write_diagnosis
from workbench.pages.figures import LIGHT, save_figure, styled
from workbench.recordings.csv import csv_text
from workbench.runtime.files import write_json, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROPOSED = "proposed"  # folder below that of the diagnosis
_SHOWN = 3


def write_proposal(
    proposal: Proposal,
    outcome: Outcome,
    provenance: Mapping[str, Any],
    diagnosis: Path,
) -> Path:
    """Write what was proposed; returns the page of the diagnosis with it, or proposal.json.

    proposal.json, laws.csv (where something may act, and on what it may depend, by evidence),
    functions.csv and the figure of the estimated functions; of a law that holds, all files of a
    diagnosis that has it beside the catalogue. Both pages have a link to the other.

    Parameters
    ----------
    outcome : without the proposal, as it was written to the folder `diagnosis`.
    """
    out = diagnosis / PROPOSED
    write_json(out / "proposal.json", {**proposal.to_dict(), "provenance": provenance})
    write_whole(out / "laws.csv", csv_text(proposal.to_frame()))
    if proposal.estimates:
        functions = proposal.functions()
        write_whole(out / "functions.csv", csv_text(functions))
        save_figure(functions_figure(proposal), [out / "functions.png", out / "functions.svg"])
    if not proposal.laws or proposal.outcome is None:
        written, text = out / "proposal.json", "No law that was proposed holds: what was tried"
    else:
        back = {"../index.html": "The diagnosis without what is proposed here"}
        written = write_diagnosis(proposal.outcome, provenance, out, back)
        text = "Proposed, not known physics: the diagnosis with a law for what is missing"
    relate_diagnosis(outcome, diagnosis, {written.relative_to(diagnosis).as_posix(): text})
    return written


def functions_figure(proposal: Proposal) -> "Figure":
    """Draw the likeliest functions with the 95 % bands of their shapes."""
    shown = [estimate for estimate in proposal.estimates if estimate.law.influence is not None][
        :_SHOWN
    ]
    table = proposal.functions()
    with styled(4.2 * max(1, len(shown)), 3.0, font_size=8) as sheet:
        for axes, fitted in zip(
            sheet.subplots(1, max(1, len(shown)), squeeze=False)[0], shown, strict=False
        ):
            law = fitted.law
            assert law.influence is not None
            own = table[
                (table.slot == law.place.slot.name)
                & (table.output == law.place.output.name)
                & (table.carrier == law.carrier.text)
                & (table.depends_on == law.influence.text)
            ]
            axes.fill_between(
                own.value, own.shape_low, own.shape_high, color=LIGHT["raw"], alpha=0.3
            )
            axes.plot(own.value, own.function, color=LIGHT["measured"])
            axes.axhline(0.0, color=LIGHT["raw"], linewidth=0.6)
            axes.set_xlabel(f"{law.influence.short} [{law.influence.unit or '?'}]")
            axes.set_ylabel(f"function [{law.carrier.unit or '?'}]")
            tied = "tied" if fitted in proposal.tied else f"{fitted.evidence:.0f} nat"
            axes.set_title(
                f"{law.carrier.text},\n{law.place.text} ({tied})", fontsize=7, loc="left"
            )
    return sheet
