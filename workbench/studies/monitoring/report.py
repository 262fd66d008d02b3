"""Files of condition monitoring: summary.json, tables, a figure of the history, the page."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Vector
from workbench.pages.answer import Answer, Measure, recordings, with_answer
from workbench.pages.figures import LIGHT, CaseFigure, Curve, Panel, save_figure, styled
from workbench.pages.parts import (
    Definitions,
    Numbers,
    Page,
    Part,
    Strip,
    Table,
    tabulated,
    zoomable,
)
from workbench.pages.views import capital
from workbench.recordings.csv import csv_text
from workbench.runtime.files import write_json, write_whole
from workbench.studies.monitoring import MonitoringResult, Track
from workbench.system.units import BAND

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINT, _LEVEL, _CHANGED = "2", "measured", "7"
_ENTRY = re.compile(r"(.+)\[(\d+)\]")
_COLUMNS = 4  # of panels
_EXPLAINED = (
    "One point for each recording, with a band that holds 95 %; the level that it is compared "
    "with, red after a reported change. The shaded recordings are where the last change was, "
    "with 95 %. Each quantity is compared with its own past; one of several that are alike against "
    "the others."
)
_TERMS = {
    "Alarm": "A sum of how far estimates are off their past has passed a threshold, which a "
    "healthy machine passes at the stated rate of false alarms (Page 1954).",
    "Changed after": "The recording after which the change was most likely (Hinkley 1970).",
    "Against the others": "Less the mean of those that are alike: what moves all of them cancels.",
    "Standard error": "By the noise of the sensors and by the scatter that the past shows.",
}


def write_monitoring_page(result: MonitoringResult, summary: Mapping[str, Any], out: Path) -> Path:
    """Write the page into the folder; returns its path."""
    tracks = [track for track in result.tracks if np.isfinite(track.values).any()]
    tracks.sort(key=_order)
    figures = [_figure(track, result) for track in tracks] if len(result.names) > 1 else []
    changed = sum(bool(track.changes) for track in tracks)
    drawn = zoomable(figures, summary, out)
    shown, others = drawn[: max(changed, 1)], drawn[max(changed, 1) :]
    title = "What has changed" if changed else "The quantity that moved most; nothing has changed"
    parts = [Part("shown", title, [_EXPLAINED, *_strips(tracks, result), *shown])]
    if summary["alarms"]:
        parts.append(Part("alarms", "Alarms", [_alarms(summary["alarms"])], printed=True))
    parts.append(Part("quantities", "Quantities now", [_quantities(summary)], printed=True))
    if others:
        parts.append(Part("others", "Quantities as they were", others))
    if summary["work"]:
        parts.append(Part("work", "Work of friction", [_work(summary["work"])]))
    parts.append(Part("definitions", "Definitions", [Definitions(_TERMS)]))
    warnings = ["Interrupted: the same command goes on from here."] * result.interrupted
    warnings += [f"{name}: {warning}" for name, warning in result.warned.items()]
    warnings += [f"Not used: {name}: {why}" for name, why in result.refused.items()]
    warnings += [f"There twice: {name} is {other}." for name, other in result.again.items()]
    title = f"One machine over its recordings, {result.names[0]} to {result.names[-1]}"
    return Page(title, parts, warnings=warnings).write(summary, out / "index.html")


def _order(track: Track) -> tuple[float, float]:
    """Changed tracks first, as their alarms came; then those that were most off their past."""
    raised = track.changes[0].raised if track.changes else np.inf
    surprises = np.abs(track.surprises[np.isfinite(track.surprises)])
    return float(raised), -float(surprises.max(initial=0.0))


def _strips(tracks: Sequence[Track], result: MonitoringResult) -> list[Strip]:
    """Quantities that are entries of one array, in its order: which of them have changed."""
    arrays: dict[str, dict[int, Track]] = {}
    for track in tracks:
        if track.against and (entry := _ENTRY.fullmatch(track.name)):
            arrays.setdefault(entry[1], {})[int(entry[2])] = track
    strips = []
    for members in arrays.values():
        if changed := [member.label for member in members.values() if member.changes]:
            entries = tuple(
                (str(k), _change_text(member, result)) for k, member in sorted(members.items())
            )
            finding = capital(f"{', '.join(changed)}: changed; the others are as they were.")
            strips.append(Strip(finding, entries))
    return strips


def _change_text(track: Track, result: MonitoringResult) -> str:
    """By how much a quantity is off its first level; empty where it is not."""
    if not track.changes:
        return ""
    size = track.level[0] - track.changes[0].before[0]
    if nominal := abs(result.system.values.get(track.name, 0.0)):
        return f"{100.0 * size / nominal:+.1f} %"
    return f"{size:+.3g} {track.unit}".removesuffix(" 1")


def _figure(track: Track, result: MonitoringResult) -> CaseFigure:
    count = len(result.names)
    sound, changed = _levels(track, count)
    reach = BAND * track.scale * track.deviations
    curves = (Curve(_POINT, track.values, reach), Curve(_LEVEL, sound), Curve(_CHANGED, changed))
    low = float(np.nanmin(track.values - reach))
    high = float(np.nanmax(track.values + reach))
    room = 0.05 * (high - low) or 1.0
    label = capital(f"{track.label} {track.name}".replace("  ", " "))
    title = f"{label} [{track.unit}]".removesuffix(" [1]")
    finding, last = "It has not changed.", None
    if track.changes:
        first, last = track.changes[0], track.changes[-1]
        finding = (
            f"Changed by {_change_text(track, result)} after {result.names[first.last]}, reported "
            "at "
            f"{result.names[first.raised]}."
        )
    return CaseFigure(
        name=label + " against the others" * track.against,
        title=f"{np.isfinite(track.values).sum()} of {count} recordings tell it",
        finding=finding,
        time=np.arange(1.0, count + 1.0),
        window=None if last is None else (last.earliest + 1.0, min(last.latest + 2.0, count)),
        legend=((_POINT, "estimate"), (_LEVEL, "level"), (_CHANGED, "level after a change")),
        panels=(Panel(title, track.unit, low - room, high + room, 1.4, curves),),
        axis=("recording", ""),
    )


def _levels(track: Track, count: int) -> tuple[Vector, Vector]:
    """Level of each recording: before any change, and after one."""
    sound, changed = np.full(count, np.nan), np.full(count, np.nan)
    begin, kept = 0, sound
    for change in track.changes:
        kept[begin : change.last + 1] = change.before[0]
        begin, kept = change.last + 1, sound if change.returns else changed
    kept[begin:] = track.level[0]
    return sound, changed


def _alarms(alarms: Sequence[Mapping[str, Any]]) -> Table:
    def reach(alarm: Mapping[str, Any]) -> float:
        return float(BAND * alarm["standard_error"])

    def share(alarm: Mapping[str, Any]) -> float | None:
        value = alarm["share_of_nominal"]
        return None if value is None else 100.0 * value

    return tabulated(
        "alarm-table",
        "All alarms in their order: the recording at which each was reported.",
        alarms,
        [
            ("reported at", lambda alarm: str(alarm["told_at"]), ""),
            ("quantity", "quantity", ""),
            ("changed after", "changed_after", ""),
            ("with 95 %, after", lambda a: " to ".join({a["earliest"]: 0, a["latest"]: 0}), ""),
            (Numbers("change"), "change", "+.3g"),
            (Numbers("95 % from"), lambda alarm: alarm["change"] - reach(alarm), "+.3g"),
            (Numbers("to"), lambda alarm: alarm["change"] + reach(alarm), "+.3g"),
            (Numbers("of nominal [%]"), share, "+.1f"),
            ("unit", "unit", ""),
        ],
    )


def _quantities(summary: Mapping[str, Any]) -> Table:
    return tabulated(
        "quantity-table",
        "Mean level of each quantity since its last change.",
        [{"name": name, **quantity} for name, quantity in summary["quantities"].items()],
        [
            ("quantity", "name", ""),
            ("what it is", "label", ""),
            (Numbers("level"), "level", ".4g"),
            (Numbers("standard error"), "standard_error", ".4g"),
            (Numbers("trend", "by recording, since the last change"), "trend_by_recording", "+.2g"),
            ("unit", "unit", ""),
            (Numbers("reported in", "recordings that tell it"), "told_in", ".0f"),
        ],
    )


def _work(work: Mapping[str, Any]) -> Table:
    relative = Numbers("over the mean", "wear relative to the others, of one material")
    return tabulated(
        "work-table",
        "Friction work in all recordings together.",
        [{"name": name, **part} for name, part in work.items()],
        [
            ("where", "name", ""),
            ("what it is", "label", ""),
            (Numbers("work [MJ]"), lambda part: 1e-6 * part["work"], ".4g"),
            (relative, "of_the_mean", ".3f"),
        ],
    )


def write_monitoring(result: MonitoringResult, provenance: Mapping[str, Any], out: Path) -> Path:
    """Write all files; returns the page."""
    content = {**result.to_dict(), "provenance": provenance}
    summary = with_answer(monitoring_answer(content), content)
    write_json(out / "summary.json", summary)
    for name, frame in (
        ("estimates", result.to_frame()),
        ("alarms", result.alarms()),
        ("work", result.worked()),
    ):
        write_whole(out / f"{name}.csv", csv_text(frame, 8))
    save_figure(history_figure(result), [out / "history.png", out / "history.svg"])
    return write_monitoring_page(result, summary, out)


def history_figure(result: MonitoringResult) -> "Figure":
    """Draw each quantity over the recordings: estimates, levels, changes and alarms."""
    tracks = [track for track in result.tracks if np.isfinite(track.values).any()]
    rows = -(-len(tracks) // _COLUMNS)
    with styled(11.0, 0.8 + 1.5 * rows, font_size=8) as sheet:
        panels = list(sheet.subplots(rows, _COLUMNS, sharex=True, squeeze=False).flat)
        heights = _heights(tracks)
        for axes, track in zip(panels, tracks, strict=False):
            middle = float(np.nanmedian(track.values))
            _draw(axes, track, result)
            height = heights[track.against, track.unit]
            axes.set_ylim(middle - height, middle + height)
            axes.set_title(f"{track.label} [{track.unit}]".replace(" [1]", ""), fontsize=7)
        for axes in panels[len(tracks) :]:
            axes.set_visible(False)
        sheet.supxlabel(f"recording, {result.names[0]} to {result.names[-1]}")
        sheet.suptitle(
            "Estimates with 95 % bands, levels, changes (dashed, with 95 % range) and alarms (line)"
        )
    return sheet


def _heights(tracks: list[Track]) -> dict[tuple[bool, str], float]:
    """Half the range of panels by what they show: the same for all that are alike."""
    heights: dict[tuple[bool, str], float] = {}
    for track in tracks:
        away = np.nanmax(np.abs(track.values - np.nanmedian(track.values)) + _half(track))
        key = track.against, track.unit
        heights[key] = max(heights.get(key, 0.0), 1.1 * float(away))
    return heights


def _half(track: Track) -> Vector:
    """Half of the 95 % band of each estimate."""
    scale = float(np.sqrt(np.nan_to_num(track.scatter, nan=1.0)))
    half: Vector = BAND * scale * track.deviations
    return half


def _draw(axes: "Axes", track: Track, result: MonitoringResult) -> None:
    numbers = np.arange(1, len(result.names) + 1)
    axes.errorbar(
        numbers,
        track.values,
        _half(track),
        fmt=".",
        color=LIGHT[_POINT],
        ecolor=LIGHT["raw"],
        elinewidth=0.6,
        markersize=4,
    )
    begin = 0.5
    for change in track.changes:
        end = change.last + 1.5
        axes.hlines(change.before[0], begin, end, color=LIGHT[_LEVEL])
        axes.axvspan(change.earliest + 1.0, change.latest + 2.0, color=LIGHT[_CHANGED], alpha=0.12)
        axes.axvline(end, color=LIGHT[_CHANGED], linestyle="--", linewidth=0.8)
        axes.axvline(change.raised + 1.0, color=LIGHT[_CHANGED], linewidth=1.2)
        begin = end
    if np.isfinite(track.level[0]):
        axes.hlines(track.level[0], begin, numbers[-1] + 0.5, color=LIGHT[_LEVEL])


def monitoring_answer(summary: Mapping[str, Any]) -> Answer:
    """The answer of `monitor`."""
    count = recordings(summary["recordings"])
    headline = {"alarms": Measure(len(summary["alarms"]), "1", "lower")}
    details = {}
    for name, quantity in summary["quantities"].items():
        level, error, low, high = quantity["level"], quantity["standard_error"], None, None
        if level is not None and error is not None:
            low, high = level - BAND * error, level + BAND * error
        details[f"level of {name}"] = Measure(level, quantity["unit"], "", low, high)
    changes = "; ".join(summary["sentences"])
    sentence = f"{changes}." if changes else f"Nothing changed in {count}."
    return Answer(sentence, headline, details)
