"""Files of a diagnosis: summary.json, data and, where asked for, pictures, beside the page."""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from workbench.diagnosis import Outcome, Residuals
from workbench.diagnosis.figures import (
    at_blocks,
    draw_confusability,
    draw_dependences,
    draw_gain,
    lasting,
    lasting_blocks,
)
from workbench.diagnosis.inference.best_estimate import bands, best_estimate
from workbench.diagnosis.page import write_diagnosis_page
from workbench.observers.report import write_estimates, write_numbers
from workbench.pages.answer import Answer, Measure, percentage, with_answer
from workbench.pages.figures import PICTURES, CaseFigure, draw_case
from workbench.recordings.csv import rows_text
from workbench.runtime.files import write_json, write_whole


def write_diagnosis(
    outcome: Outcome,
    provenance: Mapping[str, Any],
    out: Path,
    related: Mapping[str, str] | None = None,
    *,
    pictures: bool = False,
) -> Path:
    """Write summary.json and data, and the page that shows them; returns the page.

    Parameters
    ----------
    provenance : what was run.
    related : see `write_diagnosis_page`.
    pictures : whether figures of the page are written as files, too; those of an earlier
        diagnosis in the folder go.
    """
    figures = outcome.figures()
    best = best_estimate(outcome, figures[0].name)
    content = {
        **outcome.to_dict(),
        "smoothed": best and {"recording": best.case.name, "models": bands(best)},
        "provenance": provenance,
    }
    summary = with_answer(diagnosed(content), content)
    write_json(out / "summary.json", summary)
    for residual in outcome.residuals:
        _write_recording(residual, lasting_blocks(outcome.system), out / f"{residual.name}.csv")
    _write_tables(summary, out)
    if best is not None:
        write_estimates(best, out / "smoothed.csv")
    for name, draw in _drawings(outcome, summary, figures).items():
        paths = [out / f"{name}.{suffix}" for suffix in PICTURES]
        if pictures and draw is not None:
            draw(paths)
        else:
            for path in paths:
                path.unlink(missing_ok=True)
    return write_diagnosis_page(outcome.system, summary, figures, best, out, related)


def _drawings(
    outcome: Outcome, summary: Mapping[str, Any], figures: Sequence[CaseFigure]
) -> dict[str, Callable[[Sequence[Path]], None] | None]:
    """What draws each figure to some files, by its name; None: there is nothing to draw."""
    names, cosines = outcome.diagnosis.names, outcome.diagnosis.cosines
    effects = [cause["effect"] for cause in summary["causes"]]
    return {
        **{figure.name: partial(draw_case, figure) for figure in figures},
        "confusability": partial(draw_confusability, names, cosines, effects),
        "dependences": partial(draw_dependences, summary["dependences"]),
        "gain": summary["gain"] and partial(draw_gain, summary["gain"]),
    }


def relate_diagnosis(outcome: Outcome, out: Path, related: Mapping[str, str]) -> None:
    """Write the page of a diagnosis in `out` anew, with links; see `write_diagnosis_page`."""
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    figures = outcome.figures()
    best = best_estimate(outcome, figures[0].name)
    write_diagnosis_page(outcome.system, summary, figures, best, out, related)


def _write_recording(residuals: Residuals, span: int, path: Path) -> None:
    """Prediction errors and balances of a recording, at the middle of each block."""
    columns = {"time [s]": residuals.block_time}
    means = lasting(residuals, span)
    for c, channel in enumerate(residuals.channels):
        name = f"{channel.name} [{channel.unit}]"
        columns[f"before.{name}"] = residuals.before[:, c]
        columns[f"after.{name}"] = residuals.after[:, c]
        columns[f"sigma.{name}"] = residuals.sigma[:, c]
        columns[f"lasting_before.{name}"] = means.before[:, c]
        columns[f"lasting_after.{name}"] = means.after[:, c]
        columns[f"lasting_sigma.{name}"] = means.sigma[:, c]
    for balance, values in zip(residuals.balances, at_blocks(residuals).values(), strict=True):
        columns[f"residual.{balance.name} [{balance.unit}]"] = values
    write_numbers(columns, path, 6)


def _write_tables(summary: Mapping[str, Any], out: Path) -> None:
    nested = ("shape", "shape_units")
    rows = [
        {**candidate, **{k: json.dumps(candidate[k]) for k in nested}}
        for candidate in summary["candidates"]
    ]
    write_whole(out / "candidates.csv", rows_text(rows))
    write_whole(out / "dependences.csv", rows_text(summary["dependences"]))
    errors = [
        {
            **{key: error[key] for key in ("recording", "channel", "unit", "held_out", "samples")},
            **{
                f"{size}_{when}": error[size][i]
                for size in ("rms", "mean_absolute")
                for i, when in enumerate(("before", "after"))
            },
            "corrected": error["corrected"],
            **{f"free_run_{w}": error["free_run"][i] for i, w in enumerate(("before", "after"))},
        }
        for error in summary["errors"]
    ]
    write_whole(out / "errors.csv", rows_text(errors))
    names, cosines = summary["confusability"]["effects"], summary["confusability"]["cosines"]
    cells = [
        {"effect": name, **dict(zip(names, map(float, own), strict=True))}
        for name, own in zip(names, cosines, strict=True)
    ]
    write_whole(out / "confusability.csv", rows_text(cells))
    if (gain := summary["gain"]) is not None:
        rows = [{"recording": name, **recording} for name, recording in gain["recordings"].items()]
        total = {key: gain[key] for key in ("before", "after", "low", "high")}
        every = [*rows, {"recording": "all recordings", **total}]
        write_whole(out / "gain.csv", rows_text(every))


def diagnosed(summary: Mapping[str, Any]) -> Answer:
    """The answer of `diagnose`."""
    headline, details = {}, {}
    if (gain := summary["gain"]) is not None:
        low, high = gain["low"], gain["high"]
        headline["error in cross-validation, nominal"] = Measure(gain["before"], "1", "lower")
        headline["error in cross-validation, extended"] = Measure(
            gain["after"], "1", "lower", low, high
        )
    for cause in summary["causes"]:
        for name, parameter in cause["parameters"].items():
            headline[f"{cause['effect']}, {name}"] = Measure(
                parameter["value"], parameter["unit"], "", parameter["low"], parameter["high"]
            )
        headline[f"{cause['effect']}, explained"] = percentage(cause["explained"], "higher")
    for error in summary["errors"]:
        name = f"{error['recording']}: error of {error['channel']}"
        details[f"{name}, nominal"] = Measure(error["rms"][0], error["unit"], "lower")
        details[f"{name}, extended"] = Measure(error["rms"][1], error["unit"], "lower")
    return Answer(summary["sentence"], headline, details)
