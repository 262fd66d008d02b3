"""Pages of the site that say what the code says: a hook of MkDocs, see `mkdocs.yml`.

Commands are read from their parsers, the Python API from docstrings, effects from Modelica classes,
thresholds from the values that decide, schemas from system files. Nothing of it is committed.
"""

import argparse
import dataclasses
import inspect
import json
import re
import textwrap
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from notebooks import cells

import workbench
from workbench.cli.parser import command_line, parsers
from workbench.cli.schemas import case_schema, gains_schema, summaries, system_schema
from workbench.diagnosis import Effect, read_effects
from workbench.diagnosis.inference.thresholds import Soundness, Thresholds, thresholds
from workbench.models.modelica import Library, read_library
from workbench.system.comparison import RATE
from workbench.system.installed import system_files
from workbench.system.reference import reference, tables
from workbench.system.registry import load_system
from workbench.system.system import OBSERVER, System

_WIDE = 90  # characters of a line of code on a page
ROOT = Path(__file__).resolve().parents[1]
_WRITTEN = {"README.md": "index.md", "CHANGELOG.md": "changelog.md"}
_WRITTEN |= {"CONTRIBUTING.md": "contributing.md", "tutorials/README.md": "tutorials.md"}


def pages() -> dict[str, str]:
    """All generated pages, and files beside them, by their place in the site."""
    systems = [load_system(name) for name in system_files()]
    return {
        **{to: (ROOT / source).read_text(encoding="utf-8") for source, to in _WRITTEN.items()},
        **{f"tutorial-{path.stem}.md": tutorial(path) for path in _tutorials()},
        "commands.md": commands(),
        "python.md": python_api(),
        "effects-catalogue.md": catalogue(systems),
        "thresholds.md": decisions(),
        **{f"schemas/{name}": _json(schema) for name, schema in schemas(systems).items()},
        "case-file.md": case_files(systems),
        "formats.md": formats(systems),
    }


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages; called by MkDocs."""
    for place, content in pages().items():
        files.append(File.generated(config, place, content=content))
    for picture in (ROOT / "docs" / "pictures").glob("*.svg"):
        name = f"docs/pictures/{picture.name}"  # as the README names it
        files.append(File.generated(config, name, content=picture.read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put keys where they belong, and let links be right in the site; called by MkDocs."""
    markdown = with_keys(markdown)

    def moved(link: re.Match[str]) -> str:
        target, anchor = link[1], link[2] or ""
        name = re.sub(r"^(\.\./|docs/)+", "", target)
        known = {
            **_WRITTEN,
            **{f"{path.stem}.py": f"tutorial-{path.stem}.md" for path in _tutorials()},
        }
        name = known.get(name, name)
        return f"]({name}{anchor})"

    return re.sub(r"\]\(((?!https?:|#)[^)#\s]+\.(?:md|py))(#[^)]*)?\)", moved, markdown)


def with_keys(markdown: str) -> str:
    """A page with the keys of tables of a system file in the place of `<!-- keys of CLASS -->`."""
    known, mark = tables(System), r"<!-- keys of (\w+) -->"
    apart = [known[name] for name in re.findall(mark, markdown)]
    return re.sub(mark, lambda place: reference(known[place[1]], apart), markdown)


def _tutorials() -> list[Path]:
    return sorted((ROOT / "tutorials").glob("*.py"))


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2) + "\n"


def _cell(text: str) -> str:
    """Text as a cell of a table."""
    return " ".join(text.split()).replace("|", r"\|")


def tutorial(path: Path) -> str:
    """A script with cells as a page."""
    parts = []
    for text, code in cells(path):
        if text:
            parts.append(text)
        if code:
            parts.append(f"```python\n{code}\n```")
    return "\n\n".join(parts) + "\n"


# --- commands ---


def commands() -> str:
    """Every command with its options, from the parsers that read them."""
    text = ["# Commands", "", *textwrap.dedent(_COMMANDS).strip().splitlines()]
    for parser in parsers(command_line(""))[1:]:
        if parser.description is None:  # one that only has jobs
            continue
        text += ["", f"## {parser.prog}", "", _cell(parser.description), ""]
        text += ["| option | default | meaning |", "| --- | --- | --- |"]
        for action in parser._actions:
            if {"--help", "--json", "--quiet"} & set(action.option_strings):
                continue
            text.append(_option(parser, action))
        if parser.epilog:
            text += ["", "```console", textwrap.dedent(parser.epilog.partition("\n")[2]), "```"]
    return "\n".join(text) + "\n"


_COMMANDS = """
Every command takes `--json`, `--quiet` and `--help`, before its name or after it. With `--json`
standard output is one document: `command`, `status` (that of the process), `units` (by key of the
result; what is not named has a unit beside it, or 1), and either `result`, which is what the
command writes into its JSON file, or `error` with `where`, `found`, `expected` and `remedy`.
Progress goes to standard error; `--quiet` leaves it out, errors and warnings stay. Status: 0 done,
1 failed, 2 wrong input, 130 interrupted.
"""


def _option(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    formatter = parser._get_formatter()
    names = [f"`{name}`" for name in action.option_strings] or [
        f"`{action.metavar or action.dest}`"
    ]
    takes = ""
    if action.option_strings and action.nargs != 0:
        takes = f" {formatter._format_args(action, action.dest.upper())}"
        names[-1] = f"{names[-1][:-1]}{takes}`"
    meaning = formatter._expand_help(action) if action.help else ""
    meaning, default = re.subn(r" ?\(default: (.*?)\)$", "", meaning, flags=re.DOTALL)[0], ""
    if match := re.search(
        r"\(default: (.*)\)$", formatter._expand_help(action) if action.help else ""
    ):
        default = match[1]
    if "one per processor" in default:
        default = "one per processor"
    return f"| {', '.join(names)} | {_cell(default)} | {_cell(meaning)} |"


# --- Python ---


def python_api() -> str:
    """The public names, from their docstrings."""
    text = [
        "# Python",
        "",
        "`import workbench as wb`. Arrays are in SI units unless said otherwise.",
    ]
    public = {name: getattr(workbench, name) for name in workbench.__all__}
    for name, value in sorted(public.items(), key=lambda item: (inspect.isclass(item[1]), item[0])):
        text += [
            "",
            f"## {name}",
            "",
            f"```text\n{_signature(name, value)}\n```",
            "",
            _prose(value),
        ]
        if inspect.isclass(value):
            for member, inner in vars(value).items():
                function = inner.fget if isinstance(inner, property) else inner
                if member.startswith("_") or not inspect.isfunction(function):
                    continue
                heading = member if isinstance(inner, property) else _signature(member, function)
                text += [
                    "",
                    f"### {name}.{member}",
                    "",
                    f"```text\n{heading}\n```",
                    "",
                    _prose(function),
                ]
    return "\n".join(text) + "\n"


def _signature(name: str, public: Callable[..., Any]) -> str:
    if inspect.isclass(public) and issubclass(public, Exception):
        return name
    if typing.is_typeddict(public):
        return f"**{name}: {', '.join(typing.get_type_hints(public))}"
    signature = inspect.signature(public)
    whole = _short(f"{name}{signature}")
    if len(whole) <= _WIDE:
        return whole
    inside = [_short(str(part)) for part in signature.parameters.values()]
    only = inspect.Parameter.KEYWORD_ONLY
    keyword = [part.kind is only for part in signature.parameters.values()]
    if any(keyword):
        inside.insert(keyword.index(True), "*")
    returned = whole.rpartition(") -> ")[2] if ") -> " in whole else ""
    lines = "".join(f"    {part},\n" for part in inside)
    return f"{name}(\n{lines})" + f" -> {returned}" * bool(returned)


def _short(text: str) -> str:
    """Types without their modules."""
    plain = re.sub(r"\*<class '(?:\w+\.)*(\w+)'>", r"\1", text.replace("<factory>", "..."))
    return re.sub(r"\b[a-z_]+(?:\.[a-z_]+)*\.(?=[A-Z])", "", plain)


def _prose(public: Any) -> str:
    """A docstring in numpy style as Markdown."""
    lines = (inspect.getdoc(public) or "").splitlines()
    out: list[str] = []
    errors = False
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch(r"-{3,}", line):
            continue
        entry = re.match(r"^([\w, .*]+?) : (.*)", line)
        if re.fullmatch(r"-{3,}", below):
            out += ["", f"**{line}**", ""]
            errors = line in ("Raises", "Warns")
        elif errors and re.fullmatch(r"\w+", line):
            out.append(f"- `{line}`:")
        elif entry:
            out.append(f"- `{entry[1]}`: {entry[2]}")
        elif line.startswith(">>>"):
            out.append(f"    {line}")
        else:
            out.append(f"  {line.strip()}" if line.startswith("    ") else line)
    return "\n".join(out)


# --- effects ---


def catalogue(systems: list[System]) -> str:
    """Effects of every system that comes along, from their Modelica classes."""
    text = ["# Catalogue of effects", ""]
    text += [
        "What `workbench diagnose` knows of each machine. A size of zero is the nominal model."
    ]
    for system in systems:
        library = read_library(system.library)
        every = read_effects(library, system.models[OBSERVER].name)
        effects = [effect for effect in every if effect.place <= 1]  # one class in all its places
        text += ["", f"## {system.name}", "", f"{system.title}.", ""]
        text += ["| effect | what it is | size | matters from | experiment that discriminates it |"]
        text += ["| --- | --- | --- | --- | --- |"]
        for effect in effects:
            unit = _unit(library, effect)
            cells = (
                f"`{effect.class_name}`",
                f"{effect.text} (any of {effect.places})" if effect.places else effect.text,
                effect.label,
                f"{effect.matters:g} {unit}",
                effect.separation,
            )
            text.append(f"| {' | '.join(map(_cell, cells))} |")
        for effect in effects:
            text += ["", f"### {system.name}: {effect.class_name}", "", *_effect(library, effect)]
    return "\n".join(text) + "\n"


def _unit(library: Library, effect: Effect) -> str:
    unit = library.unit(library.components(effect.model)[effect.sizes[0]])
    return "" if unit == "1" else unit


def _effect(library: Library, effect: Effect) -> Iterator[str]:
    """Equations and documentation of a class, as they are written."""
    source = _source(library, effect.model)
    equations = re.search(r"^ *equation\n(.*?)(?=^ *annotation|^ *end )", source, re.S | re.M)
    extends = re.findall(r"^ *extends (.*?);", source, re.S | re.M)
    if equations:
        yield f"```modelica\n{textwrap.dedent(equations[1]).rstrip()}\n```"
    elif extends:
        bases = "\n".join(" ".join(extend.split()) for extend in extends)
        yield f"Law of the class that it extends:\n\n```modelica\n{bases}\n```"
    if info := re.search(r'info="<html>(.*?)</html>"', source, re.S):
        yield "\n" + re.sub(r"h4>", "h5>", info[1].replace('\\"', '"')).strip()
    if effect.hidden:
        yield f"\nRecordings cannot show it: {effect.hidden}."


def _source(library: Library, model: str) -> str:
    """The text of a class."""
    file = re.sub(r"(, line \d+|:\d+)$", "", library.find(model).where)
    text = Path(file).read_text(encoding="utf-8")
    name = model.rpartition(".")[2]
    return text[text.index(f"model {name} ") : text.index(f"end {name};")]


# --- thresholds ---


def decisions() -> str:
    """What every threshold is, and why."""
    usual = thresholds(28)
    text = ["# Thresholds of the diagnosis", ""]
    text += [
        f"Rate of false alarms: {RATE:g} of clean sets, unless a system says otherwise.",
        "For a catalogue of 28 effects:",
        "",
    ]
    for cls, value in ((Thresholds, usual), (Soundness, usual.samples)):
        meanings = dict(
            re.findall(r"^(\w+) : (.*?)(?=^\w+ :|\Z)", inspect.getdoc(cls) or "", re.S | re.M)
        )
        text += ["| threshold | value | meaning and reason |", "| --- | --- | --- |"]
        for field in dataclasses.fields(cls):
            if not dataclasses.is_dataclass(getattr(value, field.name)):
                number = f"{getattr(value, field.name):.4g}"
                text.append(f"| `{field.name}` | {number} | {_cell(meanings[field.name])} |")
        text.append("")
    return "\n".join([*text, _prose(thresholds)]) + "\n"


# --- file formats ---


def schemas(systems: list[System]) -> dict[str, dict[str, Any]]:
    """JSON Schema of every file that is read or written, by its name in the site."""
    return {
        "system.json": system_schema(),
        **{f"{system.name}.case.json": case_schema(system) for system in systems},
        **{f"{system.name}.gains.json": gains_schema(system) for system in systems},
        **{f"{name}.summary.json": schema for name, schema in summaries().items()},
    }


def formats(systems: list[System]) -> str:
    """All files with their schemas."""
    text = ["# File formats", "", *textwrap.dedent(_FORMATS).strip().splitlines(), ""]
    text += ["| file | written by | schema |", "| --- | --- | --- |"]
    link = "[{0}](schemas/{0})"
    text.append(f"| `system.toml` | people, `workbench new` | {link.format('system.json')} |")
    for system in systems:
        name = link.format(f"{system.name}.gains.json")
        text.append(f"| `gains.toml` of {system.name} | `workbench tune` | {name} |")
    files = {"thresholds": "power --thresholds", "sheet_error": "power --sheet-error"}
    for name in summaries():
        file = "summary" if name in ("simulate", "tune", "diagnose") else name
        made = f"workbench {files.get(name, name)}"
        text.append(f"| `{file}.json` | `{made}` | {link.format(f'{name}.summary.json')} |")
    return "\n".join(text) + "\n"


_FORMATS = """
JSON Schema (2020-12). `case.toml` has a schema for each machine: [case.toml](case-file.md). Objects
are closed: a file with another key is refused. Every summary begins with `answer`, the result in a
sentence and in numbers with units, and holds `provenance.run`, what made it; [runs](results.md) are
compared by them. In Python: `from workbench.cli.schemas import summaries`.
"""


def case_files(systems: list[System]) -> str:
    """What a `case.toml` of each system says, and its schema."""
    text = ["# case.toml", "", *textwrap.dedent(_CASE).strip().splitlines(), ""]
    text += ["| system | conditions | schema |", "| --- | --- | --- |"]
    for system in systems:
        conditions = ", ".join(f"`{c.name}`" for c in system.conditions) or "none"
        name = f"{system.name}.case.json"
        text.append(f"| `{system.name}` | {conditions} | [{name}](schemas/{name}) |")
    return "\n".join(text) + "\n"


_CASE = """
A recording is a folder with this file and a CSV, or a log file; see [Your
recordings](recordings.md) and [Recordings as they are](import.md). What is
asked for beyond `title` and `[measurement]` follows from the conditions of the
[system](system-file.md#conditions). Editors that know JSON Schema for TOML (such as Even Better
TOML) complete and check it with `#:schema FILE` in the first line:
"""
