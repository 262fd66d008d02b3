"""What a fit leaves for other tools: an SSV, an FMU with new defaults, a table of parameters."""

import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from workbench.errors import FMUError
from workbench.models.archive import DESCRIPTION, opened
from workbench.models.fmu import FMU
from workbench.runtime.files import replacing, write_whole

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
    """Write an FMU whose model description has other start values; all else stays as it is.

    Raises
    ------
    InputError
        If the source cannot be read.
    """
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
        with FMU(path) as fmu:
            fmu.start({})
            held = fmu.get(fmu.variables(list(values)))
    except FMUError:
        return False
    return all(abs(a - b) <= 1e-9 * abs(b) for a, b in zip(held, values.values(), strict=True))


def write_table(values: Mapping[str, tuple[float, str]], path: Path) -> None:
    """Write `[parameters]` for `system.toml`: values and units by name."""
    lines = [
        f'"{name}" = {value!r}' if unit == "1" else f'"{name}" = "{value:.10g} {unit}"'
        for name, (value, unit) in values.items()
    ]
    write_whole(path, "\n".join(["[parameters]", *lines]) + "\n")
