"""Results of a diagnosis: summary.json, the text for the terminal, data and figures, the page."""

import json
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.diagnosis import Cause, Outcome, Residuals
from workbench.diagnosis.residuals import RESIDUALS
from workbench.diagnosis.samples import CHANNELS
from workbench.files import write_json, write_whole
from workbench.report.diagnosis_figures import (
    FAST,
    LASTING,
    at_blocks,
    draw_confusability,
    draw_dependences,
    draw_gain,
    lasting,
    stop_figure,
)
from workbench.report.diagnosis_page import write_diagnosis_page
from workbench.report.figures import draw_case

_MEASURE = (
    "root mean square of prediction errors, in means over {span}, on stops that were held out, "
    "in units of the noise of such a mean; 1 is noise alone"
)
_UNITS = ("m/s", "rad/s", "N")


def summarise_diagnosis(
    outcome: Outcome, cases: Sequence[Case], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """The one source of numbers; the keys of the first level are a contract.

    Parameters
    ----------
    provenance : what was run.
    """
    found = outcome.diagnosis
    gain = found.gain
    extension = outcome.extension
    return {
        "verdict": found.verdict,
        "sentence": sentence(outcome),
        "interrupted": found.interrupted,
        "causes": [_cause(cause) for cause in found.causes],
        "gain": None
        if gain is None
        else {
            "measure": _MEASURE.format(span="50 ms" if _turns(outcome) else "a second"),
            "before": gain.before,
            "after": gain.after,
            "low": gain.low,
            "high": gain.high,
            "stops": {
                name: {"before": before, "after": after}
                for name, (before, after) in gain.stops.items()
            },
        },
        "model": {
            "modelica": None if extension is None else str(extension.modelica),
            "fmu": None if extension is None else str(extension.fmu),
            "difference_from_fit": None if extension is None else extension.difference,
        },
        "partial": list(found.partial),
        "lasting_errors": {
            channel: {"before": float(before), "after": float(after)}
            for channel, before, after in zip(
                CHANNELS,
                found.base.linearised.inflation,
                found.best.linearised.inflation,
                strict=False,
            )
        },
        "dependences": [
            {
                "channel": one.channel,
                "influence": one.influence,
                "before": one.before,
                "after": one.after,
            }
            for one in outcome.dependences
        ],
        "confusability": {"effects": list(found.names), "cosines": found.cosines.tolist()},
        "candidates": [
            {
                "effect": score.effect.name,
                "shape": dict(score.shape),
                "size": score.size,
                "sigma": _known(score.sigma),
                "unit": score.units[score.effect.size],
                "shape_units": {name: score.units[name] for name in score.shape},
                "gain": score.gain,
                "held_out": float(score.held_out.sum()),
            }
            for score in found.scores
        ],
        "steps": [
            {
                "before": step.before.misfit,
                "rivals": [
                    {"effect": rival.active[-1].name, "misfit": rival.misfit}
                    for rival in step.rivals
                ],
            }
            for step in found.steps
        ],
        "not_visible": dict(found.not_visible),
        "levels": {
            f"{name} {surface}": {"value": value, "unit": unit}
            for (name, surface), (value, unit) in outcome.levels.items()
        },
        "deviations": outcome.deviations,
        "set_aside": outcome.set_aside,
        "has_force": outcome.has_force,
        "observers": {
            name: {
                stop: {"before": _known(before), "after": _known(after)}
                for stop, (before, after) in by_stop.items()
            }
            for name, by_stop in outcome.observers.items()
        },
        "cases": [case.name for case in cases],
        "provenance": provenance,
    }


def _turns(outcome: Outcome) -> bool:
    """Whether a cause turns with the wheel, so that its errors do not last."""
    return any(cause.effect.order_locked for cause in outcome.diagnosis.causes)


def _known(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return value if np.isfinite(value) else None


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.effect.name,
        "text": cause.effect.text,
        "parameters": {
            name: {"value": one.value, "low": one.low, "high": one.high, "unit": one.unit}
            for name, one in cause.parameters.items()
        },
        "phases": None if cause.phases is None else [float(phase) for phase in cause.phases],
        "confusable_with": list(cause.confusable_with),
        "explained": cause.explained,
        "separation": cause.effect.separation,
    }


def sentence(outcome: Outcome) -> str:
    """The verdict in one sentence."""
    found = outcome.diagnosis
    cost = (
        ""
        if outcome.has_force
        else " Without a measured force, brake and drive differ only in their course in time."
    )
    if found.verdict == "nothing":
        return f"Nothing significant is missing: what remains is noise and tolerance.{cost}"
    if found.verdict == "unexplained":
        strongest = max(outcome.dependences, key=lambda one: one.after)
        goes = f"; it goes with {strongest.influence}" if strongest.after > 0.0 else ""
        part = f", though {' and '.join(found.partial)} would explain a part" * bool(found.partial)
        return f"Something is missing that no effect of the catalogue explains{part}{goes}.{cost}"
    names = []
    for cause in found.causes:
        label, one = next(iter(cause.parameters.items()))
        twins = f" (or {', '.join(cause.confusable_with)})" if cause.confusable_with else ""
        unit = "" if one.unit == "1" else f" {one.unit}"
        names.append(f"{cause.effect.name}{twins}, {label} {one.value:.3g}{unit}")
    assert found.gain is not None
    more = " The search was interrupted: more may be missing." if found.interrupted else ""
    return (
        f"The model lacks {'; and '.join(names)}: on held-out stops its error falls from "
        f"{found.gain.before:.1f} to {found.gain.after:.1f} times the noise.{more}{cost}"
    )


def format_diagnosis(summary: Mapping[str, Any]) -> str:
    """Text for the terminal."""
    lines = ["", summary["sentence"]]
    for cause in summary["causes"]:
        lines.append(f"\n{cause['effect']}: {cause['text']}")
        for name, one in cause["parameters"].items():
            lines.append(
                f"  {name} = {one['value']:.4g} {one['unit']}, "
                f"95 %: {one['low']:.4g} to {one['high']:.4g}"
            )
        lines.append(f"  explains {cause['explained']:.1%} of what can be, on held-out stops")
        if cause["confusable_with"]:
            lines.append(
                f"  cannot be told from {', '.join(cause['confusable_with'])} in these data; "
                f"what would: {cause['separation']}"
            )
    if summary["model"]["fmu"]:
        lines.append(f"\nextended model: {summary['model']['modelica']}, {summary['model']['fmu']}")
    aside = sum(
        counts["spike, dropout or saturation"] + counts["missing"]
        for counts in summary["set_aside"].values()
    )
    if aside:
        lines.append(f"{aside} samples were missing or wrong, and set aside")
    return "\n".join(lines)


def write_diagnosis(
    outcome: Outcome, cases: Sequence[Case], summary: Mapping[str, Any], out: Path, workers: int
) -> Path:
    """Write summary.json, data and figures, and the page that shows them; returns the page.

    Parameters
    ----------
    cases : as diagnosed, in the order of the outcome's residuals.
    summary : of this outcome.
    workers : processes that draw.
    """
    write_json(out / "summary.json", summary)
    effects = [cause["effect"] for cause in summary["causes"]]
    added = effects or summary["partial"]
    extension = f"with {', '.join(added)}" if added else ""
    span = FAST if _turns(outcome) else LASTING
    pairs = list(zip(outcome.residuals, cases, strict=True))
    pairs.sort(key=lambda pair: -_clearness(pair[0], span, bool(effects)))
    figures = [stop_figure(one, case, extension, span) for one, case in pairs]
    # Ctrl-C is this process's affair.
    ignored = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(workers, initializer=signal.signal, initargs=ignored) as pool:
        drawn = [pool.submit(draw_case, figure, _pictures(out, figure.name)) for figure in figures]
        names, cosines = outcome.diagnosis.names, outcome.diagnosis.cosines
        drawn += [
            pool.submit(
                draw_confusability, names, cosines, effects, _pictures(out, "confusability")
            ),
            pool.submit(draw_dependences, summary["dependences"], _pictures(out, "dependences")),
        ]
        if summary["gain"] is not None:
            drawn.append(pool.submit(draw_gain, summary["gain"], _pictures(out, "gain")))
        for one, _ in pairs:
            _write_stop(one, out / f"{one.name}.csv")
        _write_tables(summary, out)
        page = write_diagnosis_page(summary, figures, out)
        for picture in drawn:
            picture.result()
    return page


def _clearness(one: Residuals, span: int, found: bool) -> float:
    """How clearly a stop shows what was found, or else how wrong the nominal model is in it."""
    before, after = lasting(one, span).noises()
    return float(np.max(before**2 - after**2 if found else before**2))


def _pictures(out: Path, name: str) -> list[Path]:
    return [out / f"{name}.png", out / f"{name}.svg"]


def _write_stop(one: Residuals, path: Path) -> None:
    """Prediction errors and residuals of a stop, at the middle of each block of 50 ms."""
    columns = {"time [s]": one.block_time}
    means = lasting(one, LASTING)
    for c, (channel, unit) in enumerate(zip(CHANNELS, _UNITS, strict=True)):
        if c < one.before.shape[1]:
            columns[f"before.{channel} [{unit}]"] = one.before[:, c]
            columns[f"after.{channel} [{unit}]"] = one.after[:, c]
            columns[f"sigma.{channel} [{unit}]"] = one.sigma[:, c]
            columns[f"lasting_before.{channel} [{unit}]"] = means.before[:, c]
            columns[f"lasting_after.{channel} [{unit}]"] = means.after[:, c]
            columns[f"lasting_sigma.{channel} [{unit}]"] = means.sigma[:, c]
    for name, values in at_blocks(one).items():
        columns[f"residual.{name} [{RESIDUALS[name]}]"] = values
    write_whole(path, _csv(pd.DataFrame(columns)))


def _write_tables(summary: Mapping[str, Any], out: Path) -> None:
    """Data of the figures that show all stops."""
    nested = ("shape", "shape_units")
    rows = [{**one, **{k: json.dumps(one[k]) for k in nested}} for one in summary["candidates"]]
    write_whole(out / "candidates.csv", _csv(pd.DataFrame(rows)))
    write_whole(out / "dependences.csv", _csv(pd.DataFrame(summary["dependences"])))
    names, cosines = summary["confusability"]["effects"], summary["confusability"]["cosines"]
    cells = {"effect": names, **dict(zip(names, np.transpose(cosines), strict=True))}
    write_whole(out / "confusability.csv", _csv(pd.DataFrame(cells)))
    if (gain := summary["gain"]) is not None:
        rows = [{"stop": name, **one} for name, one in gain["stops"].items()]
        total = {key: gain[key] for key in ("before", "after", "low", "high")}
        write_whole(out / "gain.csv", _csv(pd.DataFrame([*rows, {"stop": "all stops", **total}])))


def _csv(table: pd.DataFrame) -> str:
    text: str = table.to_csv(index=False, float_format="%.6g")
    return text
