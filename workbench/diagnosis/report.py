"""Files of a diagnosis: summary.json, data and figures, the page."""

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.diagnosis import Outcome, Residuals
from workbench.diagnosis.inference.best_estimate import bands, best_estimate
from workbench.diagnosis.outcome import (
    EXTENDED,
    NOMINAL,
    at_blocks,
    draw_confusability,
    draw_dependences,
    draw_gain,
    duration,
    estimate_figure,
    lasting,
    lasting_blocks,
    recording_figures,
)
from workbench.observers.report import write_estimates, write_numbers
from workbench.observers.simulation import CaseResult
from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.figures import CaseFigure, draw_case
from workbench.pages.measures import percentage
from workbench.pages.recordings import placed
from workbench.pages.templates import rendered
from workbench.pages.views import called, capital, named, per_shown, shown_unit
from workbench.runtime.files import write_json, write_whole
from workbench.runtime.pool import Pool
from workbench.system.system import System
from workbench.system.units import si_factor

_FLAGGED = 2.5  # standard deviations of a tolerance that deserve a look


_SIMILAR = 0.7  # cosine from which on a pair is worth a word


_PAIRS = 8  # that are put in words


_TOGETHER = 0.3  # correlation of errors that is worth a word: a tenth of the variance


_CLEAR = 0.05  # share of variance that is a dependence worth a word


_READ = 4  # of them that are put in words


_CELL, _NAMES = 24, 205  # of the matrix of similarities, room for names [px]


_DOTS = {"left": 250, "width": 620, "row": 24, "top": 34}  # of the figure of the gain [px]


def write_diagnosis_page(
    system: System,
    summary: Mapping[str, Any],
    figures: Sequence[CaseFigure],
    best: CaseResult | None,
    folder: Path,
    related: Mapping[str, str] | None = None,
) -> Path:
    """Write the page into the folder, beside the files of each figure; returns its path.

    Parameters
    ----------
    summary : as written to summary.json.
    figures : one for each recording, the one that shows most first.
    best : estimate of that one, see `best_estimate`.
    related : what a file says that belongs to this diagnosis, by its path from the folder.
    """
    more = [] if best is None else [estimate_figure(best)]
    drawings = placed([figures[0], *more, *figures[1:]], summary, folder)
    modelica = summary["model"]["modelica"]
    text = rendered(
        "diagnosis.html",
        summary,
        estimated=drawings.pop(1) if more else None,
        drawings=drawings,
        smoothed=_smoothed(system, summary["smoothed"]),
        found=[cause["effect"] for cause in summary["causes"]],
        dependences=_dependences(summary["dependences"]),
        channels=list(summary["lasting_errors"]),
        candidates=_candidates(summary),
        traded=_traded(summary),
        together=_TOGETHER,
        matrix=_matrix(summary),
        pairs=_pairs(summary["confusability"]),
        dots=None if summary["gain"] is None else _dots(summary["gain"]),
        errors=_errors(system, summary),
        styles={"nominal": NOMINAL, "extended": EXTENDED},
        flagged=_FLAGGED,
        words=_words(system, summary, figures),
        related=related or {},
        source=None if modelica is None else Path(modelica).read_text(),
        # What is written into the folder is linked from there.
        files={
            key: Path(summary["model"][key]).relative_to(folder).as_posix()
            for key in ("modelica", "fmu")
            if summary["model"][key] is not None
        },
    )
    path = folder / "index.html"
    write_whole(path, text)
    return path


def _errors(system: System, summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows on the errors of samples, in the units of figures; of both models if there are two."""
    shown = {channel.name: channel.shown for channel in system.comparison.channels}
    models = (0, 1) if summary["causes"] or summary["partial"] else (0,)
    rows = []
    for error in summary["errors"]:
        unit = shown[error["channel"]]
        factor = si_factor(unit, error["unit"], error["channel"])
        sizes = [error[size][i] / factor for i in models for size in ("rms", "mean_absolute")]
        rows.append({**error, "unit": unit, "sizes": sizes})
    return rows


def _smoothed(system: System, found: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Rows on the best estimates, by quantity, in the units of figures; a cell for each model."""
    models = [] if found is None else list(found["models"].values())
    rows = []
    for name in dict.fromkeys(name for model in models for name in model):
        unit = shown_unit(system, name)
        factor, cells = per_shown(system, name, unit), []
        for one in (model.get(name) for model in models):
            cells.append(one and {**one, **_with_band(one, factor)})
        rows.append({"name": f"{capital(named(system, name))} [{unit}]", "cells": cells})
    return rows


def _with_band(one: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """A mean and half of its band in another unit, in digits that tell the band."""
    value, half = one["value"] / factor, 0.5 * (one["high"] - one["low"]) / factor
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if half > 0.0 else 4
    return {"value": value, "text": f"{value:.{digits}f} ± {half:.{digits}f}"}


def _words(
    system: System, summary: Mapping[str, Any], figures: Sequence[CaseFigure]
) -> dict[str, Any]:
    """What the page calls signals, times and what is judged."""
    compare, objective = system.comparison, system.objective
    judged = [
        signal for signal in system.reference_signals if signal.name not in summary["channels"]
    ]
    leading = compare.leading
    return {
        "inputs": " and ".join(one.label for one in system.inputs),
        "led": "" if leading is None else " and ".join(called(system, n) for n in leading.together),
        "missing": capital(" and ".join(named(system, signal.name) for signal in judged)),
        "block": duration(compare.block),
        "shown": duration(lasting_blocks(system) * compare.block),
        "error": f"error of the {called(system, objective.signal)}, rms over mean "
        f"{objective.when}".rstrip(),
        # Balances stand below the errors of channels.
        "balances": figures[0].panels[-1].curves[0].style == "measured",
    }


def _dependences(table: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Shares by influence and channel, the strongest influence first, and their reading."""
    shares: dict[str, dict[str, Mapping[str, Any]]] = {}
    for one in sorted(table, key=lambda one: -max(one["before"], one["after"])):
        shares.setdefault(one["influence"], {})[one["channel"]] = one
    texts = {}
    for key in ("before", "after"):
        clear = sorted((one for one in table if one[key] > _CLEAR), key=lambda one: -one[key])
        texts[key] = [
            f"{one['channel']} with {one['influence']}, {100 * one[key]:.0f} %"
            for one in clear[:_READ]
        ]
    return {"shares": shares, **texts}


def _candidates(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The best variant of each effect, best first, and what became of it."""
    twins = {twin for cause in summary["causes"] for twin in cause["confusable_with"]}
    standing = {
        **dict.fromkeys(twins, "as good as the cause"),
        **dict.fromkeys(summary["partial"], "explains a part"),
        **{cause["effect"]: "cause" for cause in summary["causes"]},
    }
    best: dict[str, dict[str, Any]] = {}
    for candidate in summary["candidates"]:
        if candidate["effect"] not in best:
            best[candidate["effect"]] = {
                **candidate,
                "standing": standing.get(candidate["effect"], ""),
            }
    return list(best.values())


def _traded(summary: Mapping[str, Any]) -> dict[str, list[tuple[str, float]]]:
    """Unknowns whose errors go with that of a size, the closest first, by size."""
    found = summary["certainty"]
    if found is None:
        return {}
    rows = dict(zip(found["unknowns"], found["correlations"], strict=True))
    traded = {}
    for size in found["likelihood"]:
        others = [pair for pair in zip(rows, rows[size], strict=True) if pair[0] != size]
        others.sort(key=lambda pair: -abs(pair[1]))
        traded[size] = [pair for pair in others if abs(pair[1]) >= _TOGETHER][:_READ]
    return traded


def _matrix(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Cells of the matrix of similarities, in pixels."""
    names = summary["confusability"]["effects"]
    cosines = np.array(summary["confusability"]["cosines"]).reshape(len(names), len(names))
    rows = [
        {
            "name": name,
            "y": _NAMES + _CELL * i,
            "cells": [
                {
                    "x": _NAMES + _CELL * j,
                    "cosine": float(cosine),
                    "text": f"{100 * cosine:.0f}" if cosine >= _SIMILAR else "",
                }
                for j, cosine in enumerate(cosines[i])
            ],
        }
        for i, name in enumerate(names)
    ]
    return {"rows": rows, "cell": _CELL, "left": _NAMES, "size": _NAMES + _CELL * len(names) + 2}


def _pairs(confusability: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    """The most similar pairs."""
    names, cosines = confusability["effects"], confusability["cosines"]
    pairs = [
        (names[i], names[j], float(cosines[i][j]))
        for i in range(len(names))
        for j in range(i)
        if cosines[i][j] >= _SIMILAR
    ]
    return sorted(pairs, key=lambda pair: -pair[2])[:_PAIRS]


def _dots(gain: Mapping[str, Any]) -> dict[str, Any]:
    """Pairs of dots on a logarithmic axis, in pixels: the worst recording first, then all."""
    recordings = sorted(gain["recordings"].items(), key=lambda item: -item[1]["before"])
    values = [1.0, gain["low"], gain["high"], gain["before"], gain["after"]]
    values += [one[key] for _, one in recordings for key in ("before", "after")]
    low, high = np.log(min(values) / 1.15), np.log(max(values) * 1.15)
    left, width, row, top = _DOTS["left"], _DOTS["width"], _DOTS["row"], _DOTS["top"]

    def at(value: float) -> float:
        return float(left + width * (np.log(value) - low) / (high - low))

    rows = [
        {
            "name": name,
            "y": top + row * (k + 0.5),
            "before": at(one["before"]),
            "after": at(one["after"]),
        }
        for k, (name, one) in enumerate([*recordings, ("all recordings", gain)])
    ]
    powers = range(int(np.floor(low / np.log(10.0))), int(np.ceil(high / np.log(10.0))) + 1)
    marks = [factor * 10.0**power for power in powers for factor in (1, 2, 5)]
    return {
        **_DOTS,
        "recordings": recordings,
        "rows": rows,
        "interval": (at(gain["low"]), at(gain["high"])),
        "noise": at(1.0),
        "ticks": [(at(mark), f"{mark:g}") for mark in marks if low <= np.log(mark) <= high],
        "bottom": top + row * len(rows),
        "total": left + width + 40,
    }


def write_diagnosis(
    outcome: Outcome,
    provenance: Mapping[str, Any],
    out: Path,
    workers: int,
    related: Mapping[str, str] | None = None,
) -> Path:
    """Write summary.json, data and figures, and the page that shows them; returns the page.

    Parameters
    ----------
    provenance : what was run.
    workers : processes that draw.
    related : see `write_diagnosis_page`.
    """
    figures = recording_figures(outcome)
    with Pool(workers, nullcontext, None) as pool:

        def draw(drawing: Callable[..., None], *shown: Any, name: str) -> Future[None]:
            return pool.submit(_drawn, drawing, shown, [out / f"{name}.png", out / f"{name}.svg"])

        drawn = [draw(draw_case, figure, name=figure.name) for figure in figures]
        best = best_estimate(outcome, figures[0].name)
        content = {
            **outcome.to_dict(),
            "smoothed": best and {"recording": best.case.name, "models": bands(best)},
            "provenance": provenance,
        }
        summary = with_answer(diagnosed(content), content)
        write_json(out / "summary.json", summary)
        names, cosines = outcome.diagnosis.names, outcome.diagnosis.cosines
        effects = [cause["effect"] for cause in summary["causes"]]
        drawn += [
            draw(draw_confusability, names, cosines, effects, name="confusability"),
            draw(draw_dependences, summary["dependences"], name="dependences"),
        ]
        if summary["gain"] is not None:
            drawn.append(draw(draw_gain, summary["gain"], name="gain"))
        for residual in outcome.residuals:
            _write_recording(residual, lasting_blocks(outcome.system), out / f"{residual.name}.csv")
        _write_tables(summary, out)
        if best is not None:
            write_estimates(best, out / "smoothed.csv")
        page = write_diagnosis_page(outcome.system, summary, figures, best, out, related)
        for picture in drawn:
            picture.result()
    return page


def relate_diagnosis(outcome: Outcome, out: Path, related: Mapping[str, str]) -> None:
    """Write the page of a diagnosis in `out` anew, with links; see `write_diagnosis_page`."""
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    figures = recording_figures(outcome)
    best = best_estimate(outcome, figures[0].name)
    write_diagnosis_page(outcome.system, summary, figures, best, out, related)


def _drawn(
    _: None, drawing: Callable[..., None], shown: Sequence[Any], pictures: Sequence[Path]
) -> None:
    """Draw what is shown, in a worker."""
    drawing(*shown, pictures)


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
    write_numbers(pd.DataFrame(columns), path, 6)


def _write_tables(summary: Mapping[str, Any], out: Path) -> None:
    """Data of the figures that show all recordings."""
    nested = ("shape", "shape_units")
    rows = [
        {**candidate, **{k: json.dumps(candidate[k]) for k in nested}}
        for candidate in summary["candidates"]
    ]
    write_whole(out / "candidates.csv", _csv(pd.DataFrame(rows)))
    write_whole(out / "dependences.csv", _csv(pd.DataFrame(summary["dependences"])))
    errors = [
        {
            **{key: error[key] for key in ("recording", "channel", "unit", "held_out", "samples")},
            **{
                f"{size}_{when}": error[size][i]
                for size in ("rms", "mean_absolute")
                for i, when in enumerate(("before", "after"))
            },
        }
        for error in summary["errors"]
    ]
    write_whole(out / "errors.csv", _csv(pd.DataFrame(errors)))
    names, cosines = summary["confusability"]["effects"], summary["confusability"]["cosines"]
    cells = {"effect": names, **dict(zip(names, np.transpose(cosines), strict=True))}
    write_whole(out / "confusability.csv", _csv(pd.DataFrame(cells)))
    if (gain := summary["gain"]) is not None:
        rows = [{"recording": name, **recording} for name, recording in gain["recordings"].items()]
        total = {key: gain[key] for key in ("before", "after", "low", "high")}
        write_whole(
            out / "gain.csv", _csv(pd.DataFrame([*rows, {"recording": "all recordings", **total}]))
        )


def _csv(table: pd.DataFrame) -> str:
    text: str = table.to_csv(index=False, float_format="%.6g")
    return text


def diagnosed(summary: Mapping[str, Any]) -> Answer:
    """The answer of `diagnose`."""
    headline, details = {}, {}
    if (gain := summary["gain"]) is not None:
        low, high = gain["low"], gain["high"]
        headline["error on held-out recordings, nominal"] = Measure(gain["before"], "1", "lower")
        headline["error on held-out recordings, extended"] = Measure(
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
