"""The documentation is true: its examples run, its site builds without network, its schemas fit."""

import ast
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

import workbench as wb
from workbench.cli.parser import command_line, parsers
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.system.declaration import key_names
from workbench.system.reference import reference, tables
from workbench.system.system import System

from .pages import blocks, calls, check_calls, run_page
from .processes import python

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES.append(ROOT / "tutorials" / "README.md")
# Home-made words, and the term of docs/glossary.md in the place of each.
BANNED = {
    r"\btold\b": "report",
    r"\bplant(ed|ing)\b|\bplants? (an?|the|what|its)\b|\bto plant\b": "injected effect",
    r"\bvirtual (rig|train|stop)s?\b": "simulated rig",
    r"\bsound (machine|train|set|rig|recording|axle|one)s?\b": "healthy machine",
    r"\brecorders?\b": "logger, log file",
    r"\bcompanions?\b": "machine plug-in",
    r"\b(twin|rival)s?\b": "candidate",
    r"\blasting\b": "systematic error",
    r"\breasoned\b": "model-based gains",
    r"\bbeg[aiu]ns? elsewhere\b": "multi-start",
    r"\b(go|goes|going|went) together\b|\b(make|makes|made) up for\b": "correlation",
    r"\bjudg(e|es|ed|ing)\b": "score",
    r"\bclaimed\b": "validity range",
    r"\btimes as sure\b": "precision gain",
    r"\bwhat is left\b": "prediction error",
    r"\bset aside\b|\b(do|does|did) not count\b": "excluded sample",
    r"\blate clocks?\b|\bclocks? (that )?(is|are) late\b": "time offset of a logger",
    r"\bnext stop\b": "next experiment",
    r"\bhold(s|ing)? (the truth|what)\b": "coverage",
    r"\b(its|their|your) sheet\b|(?<!data )\bsheet's\b": "data sheet",
    r"\bconfin(e|es|ed|ing|ement)\b|\bvouch(es)?\b": "sandbox",
    r"\bby nature\b": "recording-to-recording variation",
    r"\bin words\b": "report",
}
LONGEST, MEAN, SHARE = 25, 18.0, 0.1  # words a sentence, of a page, and its share of longer ones
RUN = [
    page
    for page in PAGES
    if any(block.language in ("sh", "python", "modelica") for block in blocks(page))
]


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
def test_the_examples_of_a_page_run_and_print_what_it_says(page, tmp_path):
    run_page(page, tmp_path, ROOT, long=False)


@pytest.mark.long
@pytest.mark.parametrize(
    "page",
    [page for page in RUN if any(block.mark == "long" for block in blocks(page))],
    ids=lambda page: page.name,
)
def test_the_long_examples_of_a_page_run(page, tmp_path):
    run_page(page, tmp_path, ROOT, long=True)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_example_is_in_a_block_that_says_what_it_is(page):
    text = page.read_text()
    assert not re.findall(r"^    (?:python -m workbench|workbench|make|pip) .*", text, re.MULTILINE)
    assert {block.language for block in blocks(page)} <= {
        "sh",
        "python",
        "toml",
        "text",
        "modelica",
        "console",
    }
    for block in blocks(page):
        check_calls(block.code, page.name, ROOT)


def test_a_wrong_example_is_found(tmp_path):
    for name, block, match in (
        ("status", "```sh\nworkbench simulate nowhere\n```", "status 2"),
        ("print", "```sh\necho one\n```\n\n```text\ntwo\n```", "'two' is not in"),
        (
            "parse",
            "<!-- parsed: hours -->\n```sh\nworkbench power --sices 2\n```",
            "power --sices 2",
        ),
        ("make", "<!-- parsed: hours -->\n```sh\nmake powder\n```", "make powder"),
    ):
        page, folder = tmp_path / f"{name}.md", tmp_path / name
        page.write_text(block + "\n")
        folder.mkdir()
        with pytest.raises(AssertionError, match=match):
            run_page(page, folder, ROOT, long=False)


# --- the site ---


@pytest.fixture(scope="module")
def site(once) -> Path:
    """Built as `make docs` does, where no network can be reached."""

    def build(out: Path) -> Path:
        nowhere = {f"{kind}_proxy": "http://127.0.0.1:9" for kind in ("http", "https")}
        command = ("-m", "mkdocs", "build", "--strict", "--site-dir", str(out))
        run = python(*command, NO_MKDOCS_2_WARNING="1", **nowhere)
        assert run.returncode == 0, run.stderr
        return out

    return once("site", build)


def test_the_site_is_built_strictly_and_needs_no_network(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(
            r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)', page.read_text()
        )
        assert not loaded, page


def test_the_picture_of_the_readme_is_in_the_site(site):
    (source,) = re.findall(r'src="([^"]+\.svg)"', (site / "index.html").read_text())
    assert (site / source).is_file()


def test_the_reference_has_every_command_name_effect_and_threshold(site):
    commands = (site / "commands.html").read_text()
    for parser in parsers(command_line(""))[1:]:
        if parser.description is not None:
            assert f"{parser.prog}<" in commands
            for action in parser._actions:
                for option in action.option_strings[:1]:
                    assert option in commands
    python = (site / "python.html").read_text()
    assert all(f'id="{name.lower()}"' in python for name in wb.__all__)
    effects = (site / "effects-catalogue.html").read_text()
    assert "J. Topczewska et al. (2022)" in effects  # of the class BrakeFade
    thresholds = (site / "thresholds.html").read_text()
    assert all(f"<code>{name}</code>" in thresholds for name in ("significant", "fall", "twin"))
    assert Thresholds.__dataclass_fields__["form"].default == 40.0


def test_the_page_of_the_system_file_has_every_key_that_is_read(site):
    page = (site / "system-file.html").read_text()
    assert "keys of" not in page
    for table in tables(System).values():
        for name in key_names(table):
            assert re.search(rf"<code>([a-zA-Z_]+\.)*{name}</code>", page), (table, name)


def test_the_schema_of_case_files_takes_those_that_are_there_and_no_others(site):
    schema = json.loads((site / "schemas" / "wheelset.case.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for path in sorted((ROOT / "cases").glob("*/case.toml")):
        validator.validate(tomllib.loads(path.read_text()))
    good = tomllib.loads((ROOT / "cases" / "01_dry_80_1.5" / "case.toml").read_text())
    for key, value in (("wheel_rail", "icy"), ("initial_speed", 80), ("discs", ["dry"])):
        wrong = {**good, "conditions": {**good["conditions"], key: value}}
        assert not validator.is_valid(wrong), key
    assert not validator.is_valid({key: value for key, value in good.items() if key != "title"})


def test_the_citation_names_this_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"version: {version}\n" in citation
    assert "10.1177" not in citation  # the paper's text has no number that could be checked
    assert re.search(
        rf"^## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)",
        (ROOT / "CHANGELOG.md").read_text(),
        re.M,
    )


def test_the_readme_says_what_the_table_says():
    """The worst of each column, in the digits that the README has."""
    rows = re.findall(
        r"^\| \d\d_\S+ \| (.*) \|$", (ROOT / "docs" / "accuracy.md").read_text(), re.M
    )
    columns = zip(
        *([float(cell.removesuffix(" %")) for cell in row.split(" | ")] for row in rows),
        strict=True,
    )
    loop, inversion, *observers = map(max, columns)
    assert len(rows) == 14
    text = " ".join((ROOT / "README.md").read_text().split())
    assert f"open loop up to {loop:.0f} %, direct inversion up to {inversion:.1f} %" in text
    assert f"observers with fixed gains up to {max(observers[:2]):.1f} %" in text
    assert f"the Kalman filters up to {max(observers[2:]):.2f} %" in text


def test_answers_in_the_readme_are_those_of_pages_that_are_run():
    readme = ROOT / "README.md"
    printed = {
        line
        for page in RUN
        if page != readme
        for block in blocks(page)
        if block.language == "text"
        for line in block.code.split("\n")
    }
    answers = [block.code.strip() for block in blocks(readme) if block.language == "text"]
    assert len(answers) == 2
    assert set(answers) <= printed


def test_the_readme_says_of_machines_what_the_page_says():
    page, readme = (
        re.findall(r"^\| (.*) \|$", (ROOT / name).read_text(), re.M)
        for name in ("docs/evidence-machines.md", "README.md")
    )
    rows = [row.split(" | ") for row in readme if row.count(" | ") == 4][1:]
    assert len(rows) == 8
    for machine, published, *results in rows:
        (there,) = (row.split(" | ") for row in page if row.startswith(machine))
        assert there[2:] == results
        numbers, known = (re.findall(r"\d+(?:\.\d+)?", text) for text in (published, there[1]))
        assert numbers
        assert set(numbers) <= set(known)


def test_calls_are_read_as_a_shell_does():
    code = "workbench tune ekf \\\n  --budget 2  # quick\nworkbench doctor --json > doctor.json\n"
    assert list(calls(code)) == [["tune", "ekf", "--budget", "2"], ["doctor", "--json"]]


# --- plain English ---


def prose(page: Path) -> str:
    """Text of a page that people wrote as sentences, or of the cells of a tutorial."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        return "\n".join(line[2:] if line.startswith("#") else "" for line in text.splitlines())
    text = re.sub(
        r"<!-- (?:figures: )?(\w+) -->.*?<!-- (?:figures end|end of \1) -->", "", text, flags=re.S
    )
    text = re.sub(r"```.*?```|<!--.*?-->", "", text, flags=re.S)
    return re.sub(r"^ *\|.*$|^!\[.*$", "", text, flags=re.M)


def plain(text: str) -> str:
    """Text in which code is one word, and of a link its words remain."""
    return re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "X", text))


def sentences(text: str) -> list[str]:
    """Sentences of paragraphs and items of lists; headings are none."""
    parts = re.split(r"\n\s*\n|\n(?= *(?:[-*#]|\d+\.) )", plain(text))
    return [
        sentence
        for part in parts
        if not part.strip().startswith("#")
        for sentence in re.split(r"(?<=[.!?:])\s+(?=[A-Z*\[_\"])", " ".join(part.split()))
        if words(sentence) > 2
    ]


def words(sentence: str) -> int:
    return len(re.findall(r"[\w']+", sentence))


def home_made(text: str) -> list[str]:
    """Banned words of a text, each with the term in its place."""
    return [
        f"{match[0]!r}: {term}"
        for pattern, term in BANNED.items()
        for match in re.finditer(pattern, " ".join(plain(text).split()), re.IGNORECASE)
    ]


READ = [page for page in PAGES if page.name != "CONTRIBUTING.md"]
READ += [ROOT / "CHANGELOG.md", *sorted((ROOT / "tutorials").glob("*.py"))]


@pytest.mark.parametrize("page", READ, ids=lambda page: page.name)
def test_sentences_are_short_and_words_are_those_of_the_glossary(page):
    text = prose(page)
    lengths = [words(sentence) for sentence in sentences(text)]
    assert sum(lengths) <= MEAN * len(lengths)
    assert sum(n > LONGEST for n in lengths) <= max(1, SHARE * len(lengths))
    assert home_made(text) == []
    assert "python -m workbench" not in page.read_text(encoding="utf-8")


def test_help_and_the_reference_of_keys_are_read_as_pages_are():
    texts = [
        (parser.prog, text)
        for parser in parsers(command_line(""))
        for text in (parser.description, *(action.help for action in parser._actions))
        if text
    ]
    known = tables(System)
    texts += [(name, prose_of_keys(known[name])) for name in known]
    for where, text in texts:
        assert home_made(text) == [], where
        long = [sentence for sentence in sentences(text) if words(sentence) > LONGEST]
        assert long == [], where


def refusals(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each part of an InputError that a module raises; values are one word."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "InputError":
            for part in (part for keyword in node.keywords for part in ast.walk(keyword.value)):
                if isinstance(part, ast.JoinedStr):
                    values = (getattr(value, "value", "X") for value in part.values)
                    yield part.lineno, "".join(v if isinstance(v, str) else "X" for v in values)
                elif isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield part.lineno, part.value


def test_refusals_are_short_and_in_words_of_the_glossary():
    for path in sorted((ROOT / "workbench").rglob("*.py")):
        for line, text in refusals(path):
            where = f"{path.relative_to(ROOT)}, line {line}"
            assert home_made(text) == [], where
            assert max(map(words, sentences(text)), default=0) <= LONGEST, where


def prose_of_keys(table: type) -> str:
    """Meanings of the keys of a table of the system file, each a paragraph."""
    return "\n\n".join(re.findall(r"^\| .* \| ([^|]*) \|$", reference(table, ()), re.M))


def test_the_terms_in_place_of_home_made_words_are_in_the_glossary():
    terms = re.findall(r"^\| ([^|]+) \|", (ROOT / "docs" / "glossary.md").read_text(), re.M)
    assert set(BANNED.values()) <= set(terms)
    assert len(set(terms)) == len(terms)


def test_a_long_sentence_and_a_home_made_word_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# A sound machine\n\n| told | ```text\n\n- One is told.\n- " + 26 * "word " + "\n"
    )
    text = prose(page)
    assert [words(sentence) for sentence in sentences(text)] == [3, 26]
    assert home_made(text) == ["'told': report", "'sound machine': healthy machine"]
