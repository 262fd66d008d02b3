"""Results of a diagnosis: summary.json, the text for the terminal, data and figures, the page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from workbench.case import Case
from workbench.diagnosis import CATALOGUE, Cause, Outcome
from workbench.diagnosis.residuals import RESIDUALS
from workbench.diagnosis.samples import CHANNELS
from workbench.report.results import _write, write_summary

_MEASURE = (
    "root mean square of the prediction errors that last a second, on stops that were held out, "
    "in units of the noise; 1 is noise alone"
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
        "causes": [_cause(cause) for cause in found.causes],
        "gain": None
        if gain is None
        else {
            "measure": _MEASURE,
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
                "sigma": score.sigma,
                "gain": score.gain,
                "held_out": float(score.held_out.sum()),
            }
            for score in found.scores
        ],
        "not_visible": {effect.name: effect.hidden for effect in CATALOGUE if effect.hidden},
        "levels": {
            f"{name} {surface}": {"value": value, "unit": unit}
            for (name, surface), (value, unit) in outcome.levels.items()
        },
        "deviations": outcome.deviations,
        "set_aside": outcome.set_aside,
        "has_force": outcome.has_force,
        "cases": [case.name for case in cases],
        "provenance": provenance,
    }


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
        else (
            " Without a measured force, brake and drive are told apart by their course in time only."
        )
    )
    if found.verdict == "nothing":
        return f"Nothing significant is missing: what remains is noise and tolerance.{cost}"
    if found.verdict == "unexplained":
        strongest = next((one for one in outcome.dependences if one.after > 0.0), None)
        goes = f"; it goes with {strongest.influence}" if strongest else ""
        part = f", though {' and '.join(found.partial)} would explain a part" * bool(found.partial)
        return f"Something is missing that no effect of the catalogue explains{part}{goes}.{cost}"
    names = []
    for cause in found.causes:
        label, one = next(iter(cause.parameters.items()))
        twins = f" (or {', '.join(cause.confusable_with)})" if cause.confusable_with else ""
        unit = "" if one.unit == "1" else f" {one.unit}"
        names.append(f"{cause.effect.name}{twins}, {label} {one.value:.3g}{unit}")
    assert found.gain is not None
    return (
        f"The model lacks {'; and '.join(names)}: on held-out stops its error falls from "
        f"{found.gain.before:.1f} to {found.gain.after:.1f} times the noise.{cost}"
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


def write_diagnosis(outcome: Outcome, summary: Mapping[str, Any], out: Path) -> Path:
    """Write summary.json and the data of each stop; returns the file to read."""
    write_summary(summary, out / "summary.json")
    for one in outcome.residuals:
        columns = {"time [s]": one.block_time}
        for c, (channel, unit) in enumerate(zip(CHANNELS, _UNITS, strict=True)):
            if c < one.before.shape[1]:
                columns[f"before.{channel} [{unit}]"] = one.before[:, c]
                columns[f"after.{channel} [{unit}]"] = one.after[:, c]
                columns[f"sigma.{channel} [{unit}]"] = one.sigma[:, c]
        for name, unit in RESIDUALS.items():
            if name in one.values:
                known = np.isfinite(one.values[name])
                columns[f"residual.{name} [{unit}]"] = np.interp(
                    one.block_time, one.time[known], one.values[name][known]
                )
        text = pd.DataFrame(columns).to_csv(index=False, float_format="%.6g")
        _write(out / f"{one.name}.csv", text)
    return out / "summary.json"
