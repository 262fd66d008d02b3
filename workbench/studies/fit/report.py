"""Files of a fit: summary.json, the page, the table on the terminal, and what other tools read."""

import re
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from workbench.errors import FMUError
from workbench.models.archive import DESCRIPTION, opened
from workbench.models.description import read_description
from workbench.models.fmu import open_fmu
from workbench.models.fmu_cache import is_cached
from workbench.pages.answer import Answer, Measure, with_answer
from workbench.pages.figures import CaseFigure, Curve, Panel
from workbench.pages.parts import (
    Article,
    Cell,
    Definitions,
    Dot,
    Dots,
    Numbers,
    Page,
    Part,
    Table,
    number,
    zoomable,
)
from workbench.runtime.files import replacing, write_json, write_whole
from workbench.studies.fit.outcome import FitOutcome, FittedValue, RecordingFit, format_value
from workbench.system.registry import model_path
from workbench.system.system import OBSERVER, System
from workbench.system.units import si_factor

_LEGEND = (("measured", "measured"), ("0", "model with its own values"), ("2", "fitted model"))
_TERMS = {
    "Interval": "95 %. By profile likelihood: the value is held, all others are fitted anew, until "
    "the sum of squares rises by 3.84. By covariance: from the derivatives at the fit "
    "(Gauss-Newton), as if the model were linear there.",
    "Over noise": "Root mean square of the residuals over the noise that the system file says: 1 "
    "where the model explains all but noise.",
    "Not identified": "The recordings leave a combination of these values open: by the singular "
    "values of the residuals' derivatives, its 95 % interval reaches from zero to twice its size.",
    "Start": "Value of a state at the first sample. Where an output shows the state, its start is "
    "fitted to each recording.",
}


def format_fit(outcome: FitOutcome) -> str:
    """The table on the terminal: doubts first."""
    lines = ["Not to be relied on:"] * bool(outcome.doubts)
    lines += [f"  ! {doubt}" for doubt in outcome.doubts]
    for value in outcome.values:
        how = f", {value.method}" if value.method else ""
        lines.append(f"  {format_value(value)}{how}; before {value.nominal:.5g}")
    lines += [f"  correlated: {a} and {b}, {share:+.2f}" for a, b, share in outcome.correlations()]
    for fit in outcome.recordings:
        held = " (held out)" if fit.held_out else ""
        lines.append(
            f"  {fit.case.name}{held}: error {fit.error(fit.nominal):.3g} before, "
            f"{fit.error(fit.fitted):.3g} after, times the noise"
        )
    if outcome.evolved:
        lines.append(f"  starts disagreed; differential evolution {outcome.evolved}")
    return "\n".join(lines)


def write_fit(
    outcome: FitOutcome, system: System, provenance: Mapping[str, Any], out: Path
) -> tuple[Path, list[str]]:
    """Write all files of a fit; returns the page, and what is to be known of the files."""
    shared = {value.name: value for value in outcome.values if not value.recording}
    own = {system.names.get(name, name): value.value for name, value in shared.items()}
    notes = []
    if own:
        write_ssv(own, out / "parameters.ssv")
        write_table(
            {n: (v.value, v.unit) for n, v in shared.items() if not v.is_state},
            out / "parameters.toml",
        )
        model = model_path(system, OBSERVER)
        name = read_description(model).name if is_cached(model) else model.stem
        fmu = out / f"{name}_fitted.fmu"
        write_fmu(model, own, fmu)
        if not defaults_in_binary(fmu, own):
            notes.append(
                f"{fmu.name} states the fitted values, and its binary keeps its own: a tool that "
                "does not set start values needs parameters.ssv"
            )
    content = {**outcome.to_dict(), "notes": notes, "provenance": provenance}
    summary = with_answer(_answer(outcome), content)
    write_json(out / "summary.json", summary)
    return _write_page(outcome, system, summary, out), notes


def _answer(outcome: FitOutcome) -> Answer:
    """The answer of `fit`."""
    values = {
        value.label: Measure(value.value, value.unit, "", value.low, value.high)
        for value in outcome.values
    }
    errors = {
        f"{fit.case.name}: error over noise": Measure(fit.error(fit.fitted), "1", "lower")
        for fit in outcome.recordings
    }
    headline = {value.label: values[value.label] for value in outcome.values if not value.recording}
    details = {label: value for label, value in values.items() if label not in headline}
    return Answer(outcome.sentence(), headline, {**details, **errors})


def _write_page(outcome: FitOutcome, system: System, summary: Mapping[str, Any], out: Path) -> Path:
    figures = [_figure(fit, system) for fit in outcome.recordings]
    first, *others = zoomable(figures, summary, out)
    articles = [
        Article(f"recording-{k}", figure.name, [block])
        for k, (figure, block) in enumerate(zip(figures[1:], others, strict=True))
    ]
    parts = [
        Part("values", "Fitted values", [_values_table(outcome), *_intervals(outcome), first]),
        Part("recordings", "Recordings", [_errors_table(outcome), *articles], printed=True),
        Part("definitions", "Definitions", [Definitions(_TERMS)]),
    ]
    return Page("Fit of parameters", parts, warnings=list(outcome.doubts)).write(
        summary, out / "index.html"
    )


def _values_table(outcome: FitOutcome) -> Table:
    rows = []
    for value in outcome.values:
        interval = "not identified" if not value.identified else "n/a"
        if value.low is not None and value.high is not None:
            interval = f"{value.low:.5g} to {value.high:.5g}"
        cells = [number(value.nominal, ".5g"), number(value.value, ".5g"), Cell(interval)]
        rows.append([value.label, value.unit, *cells, value.method or "-"])
    columns = ["value", "unit", Numbers("before"), Numbers("fitted"), "95 % interval", "by"]
    return Table("value-table", "Values before and after the fit", columns, rows)


def _intervals(outcome: FitOutcome) -> Iterator[Dots]:
    """Intervals of parameters, over the values of the model."""

    def dot(value: FittedValue) -> Dot:
        low, high = (end / value.nominal for end in (value.low or 0.0, value.high or 0.0))
        return Dot(value.value / value.nominal, "2", min(low, high), max(low, high))

    shown = [v for v in outcome.values if not v.is_state and v.nominal and v.low is not None]
    if shown:
        rows = [(value.label, (dot(value),)) for value in shown]
        finding = "Fitted values with 95 % intervals, over the model's own"
        yield Dots(finding, "fitted over the model's own value", rows, (1.0, "model"))


def _errors_table(outcome: FitOutcome) -> Table:
    rows = []
    for fit in outcome.recordings:
        before, after = fit.errors(fit.nominal), fit.errors(fit.fitted)
        for k, name in enumerate(fit.case.outputs):
            noise = float(np.sqrt(np.nanmean(fit.sigma[:, k] ** 2)))
            held = "held out" if fit.held_out else "fitted"
            cells = [number(error, ".4g") for error in (before[name], after[name], noise)]
            rows.append([fit.case.name, held, name, *cells])
    titles = [Numbers("error before"), Numbers("error after"), Numbers("noise")]
    caption = "Root mean square of measured less simulated, in the unit of the output"
    return Table("error-table", caption, ["recording", "use", "output", *titles], rows)


def _figure(fit: RecordingFit, system: System) -> CaseFigure:
    """Measured beside both simulations."""
    panels = []
    for k, output in enumerate(system.outputs):
        factor = si_factor(output.shown, output.unit, output.name)
        curves = [
            Curve(style, values / factor, dashed=style == "0")
            for (style, _), values in zip(
                _LEGEND, (fit.case[output.name], fit.nominal[:, k], fit.fitted[:, k]), strict=True
            )
        ]
        known = np.concatenate([curve.values[np.isfinite(curve.values)] for curve in curves])
        low, high = float(known.min()), float(known.max())
        room = 0.05 * (high - low or 1.0)
        title = output.label if output.label == output.name else f"{output.name}: {output.label}"
        panels.append(Panel(title, output.shown, low - room, high + room, 1.0, tuple(curves)))
    held = ", held out" if fit.held_out else ""
    finding = (
        f"error {fit.error(fit.nominal):.3g} times the noise before, "
        f"{fit.error(fit.fitted):.3g} after{held}"
    )
    name, title = fit.case.name, fit.case.title
    return CaseFigure(name, title, finding, fit.case.time, None, _LEGEND, tuple(panels))


# --- what other tools read ---


_SSV = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" \
xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="fit">
  <ssv:Parameters>
{parameters}
  </ssv:Parameters>
</ssv:ParameterSet>
"""
_START = re.compile(rb'(\sstart\s*=\s*)(?:"[^"]*"|\'[^\']*\')')


def write_ssv(values: Mapping[str, float], path: Path) -> None:
    """Write values by the FMU's names as a parameter set of SSP 1.0, in the FMU's own units."""
    lines = [
        f'    <ssv:Parameter name={quoteattr(name)}><ssv:Real value="{value!r}"/></ssv:Parameter>'
        for name, value in values.items()
    ]
    write_whole(path, _SSV.format(parameters="\n".join(lines)))


def write_fmu(source: Path, values: Mapping[str, float], path: Path) -> None:
    """Write an FMU whose model description has other start values; all else stays as it is."""
    with (
        opened(source) as archive,
        replacing(path) as stream,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as copy,
    ):
        for entry in archive.infolist():
            content = archive.read(entry)
            if entry.filename == DESCRIPTION:
                content = _with_starts(content, values)
            copy.writestr(entry, content)


def _with_starts(xml: bytes, values: Mapping[str, float]) -> bytes:
    """A model description with other start values, each in its own place of the text."""
    parser, places = expat.ParserCreate(), dict[int, float]()
    owner: list[str] = []  # name of the variable that the parser is in, of FMI 2.0

    def begin(tag: str, attributes: Mapping[str, str]) -> None:
        name = attributes.get("name", "")
        if tag == "ScalarVariable":
            owner[:] = [name]
        elif owner and tag == "Real" and owner[0] in values:  # FMI 2.0
            places[parser.CurrentByteIndex] = values[owner[0]]
        elif tag in ("Float64", "Float32") and name in values and "valueReference" in attributes:
            places[parser.CurrentByteIndex] = values[name]

    def end(tag: str) -> None:
        if tag == "ScalarVariable":
            owner.clear()

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.Parse(xml, True)
    for place, value in sorted(places.items(), reverse=True):
        length = re.match(rb"<[\w:]+(\s+[\w:]+\s*=\s*(\"[^\"]*\"|'[^']*'))*", xml[place:])
        assert length is not None
        tag, number = length[0], repr(value).encode()
        changed = _START.sub(rb'\g<1>"' + number + b'"', tag)
        if changed == tag and not _START.search(tag):
            changed = tag + b' start="' + number + b'"'
        xml = xml[:place] + changed + xml[place + len(tag) :]
    return xml


def defaults_in_binary(path: Path, values: Mapping[str, float]) -> bool:
    """Whether an FMU starts with these values by itself: binaries may hold their own defaults."""
    try:
        with open_fmu(path) as fmu:
            fmu.start({})
            held = fmu.get_typed(fmu.typed(list(values)))
    except FMUError:
        return False
    # Float32 rounds to 6e-8.
    return all(abs(a - b) <= 1e-7 * abs(b) for a, b in zip(held, values.values(), strict=True))


def write_table(values: Mapping[str, tuple[float, str]], path: Path) -> None:
    """Write `[parameters]` for `system.toml`: values and units by name."""
    lines = [
        f'"{name}" = {value!r}' if unit == "1" else f'"{name}" = "{value:.10g} {unit}"'
        for name, (value, unit) in values.items()
    ]
    write_whole(path, "\n".join(["[parameters]", *lines]) + "\n")
