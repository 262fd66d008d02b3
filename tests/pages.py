"""The fenced blocks of a page of documentation, run one after the other as a reader would.

A comment before a block says otherwise: `<!-- long -->` leaves it to the long tests, `<!-- parsed:
REASON -->` asks only that its commands are ones that the command line knows. A block of text right
behind one that was run is what it prints, `...` standing for anything.
"""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import workbench.system.template
from workbench.cli.parser import command_line
from workbench.diagnosis import read_effects
from workbench.models.compiler import build, native
from workbench.models.modelica import read_library

from .processes import LONGEST

_FENCE = re.compile(
    r"(?:<!-- (?P<mark>long|parsed)(?:: [^>]+)? -->\n)?^```(?P<kind>\w*)\n(?P<code>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
_PACKAGE = Path(workbench.system.template.__file__).with_name("package.mo")
_CALL = re.compile(r'^(?:\w+="[^"]*" )*(?:python -m )?workbench (.*)$')


@dataclass(frozen=True)
class Block:
    """One fenced block; `mark` is "long", "parsed" or empty."""

    language: str
    code: str
    mark: str
    line: int


def blocks(page: Path) -> list[Block]:
    """All of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            match["kind"],
            match["code"],
            match["mark"] or "",
            text.count("\n", 0, match.start("code")),
        )
        for match in _FENCE.finditer(text)
    ]


def run_page(page: Path, folder: Path, root: Path, *, long: bool) -> None:
    """Run the blocks of a page in a folder that has what a checkout has."""
    for name in ("cases", "fmus", "modelica", "README.md"):
        (folder / name).symlink_to(root / name)
    programs = folder / "bin"
    programs.mkdir()
    for name, called in (("workbench", " -m workbench"), ("python", "")):
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}"{called} "$@"\n')
        (programs / name).chmod(0o755)
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "MPLBACKEND": "agg",
        "PYTHONWARNINGS": "ignore",
    }
    printed, before = None, ""
    for block in blocks(page):
        where = f"{page.name}, line {block.line}"
        if block.language == "text" and printed is not None:
            _compare(block.code, printed, where)
        printed = None
        if block.mark == "parsed" or (block.mark == "long" and not long):
            check_calls(block.code, where, root)
            if block.language == "python":
                compile(block.code, where, "exec")
        elif block.language == "sh":
            printed = _run(["bash", "-e", "-c", block.code], folder, environment, where)
        elif block.language == "python":
            # A reader goes on in the same session: what was printed before is left out.
            session = (
                f"import os, sys\n_out = sys.stdout\nsys.stdout = open(os.devnull, 'w')\n{before}"
            )
            session += f"\nsys.stdout = _out\n{block.code}"
            printed = _run([sys.executable, "-c", session], folder, environment, where)
            before += block.code
        elif block.language == "toml":
            tomllib.loads(block.code)
        elif block.language == "modelica":
            _model(block.code, folder, root, where)


def _run(command: Sequence[str], folder: Path, environment: dict[str, str], where: str) -> str:
    run = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=LONGEST,
    )
    assert run.returncode == 0, f"{where}: status {run.returncode}\n{run.stdout}\n{run.stderr}"
    return run.stdout


def _model(code: str, folder: Path, root: Path, where: str) -> None:
    """A library is compiled; anything else stands in the one that `workbench new` writes."""
    if code.startswith("package "):
        library = folder / "library" / "package.mo"
        library.parent.mkdir()
        library.write_text(code)
        name = code.split()[1]
        read_effects(read_library(library), "Observer")
        build(library, f"{name}.Observer", folder / "Observer.fmu", platforms=[native()])
    else:
        _compare(code, _PACKAGE.read_text(), where, whole=True)


def _compare(claimed: str, printed: str, where: str, *, whole: bool = False) -> None:
    output = " ".join(printed.split())
    for line in [claimed] if whole else claimed.splitlines():
        parts = [re.escape(" ".join(part.split())) for part in line.split("...")]
        assert re.search(".*".join(parts), output), f"{where}: '{line}' is not in\n{printed}"


def calls(code: str) -> Iterator[list[str]]:
    """Arguments of each call of the command line."""
    for line in code.replace("\\\n", " ").splitlines():
        if call := _CALL.match(line.strip()):
            words = shlex.split(call[1], comments=True)
            yield words[: words.index(">")] if ">" in words else words


def check_calls(code: str, where: str, root: Path) -> None:
    """Each call has options that are there, each target of make is one."""
    for words in calls(code):
        try:
            command_line("").parse_args(words)
        except SystemExit as refused:
            raise AssertionError(f"{where}: workbench {' '.join(words)}") from refused
    targets = set(re.findall(r"^([a-z-]+):", (root / "Makefile").read_text(), re.MULTILINE))
    for target in re.findall(r"^make ([a-z-]+)", code, re.MULTILINE):
        assert target in targets, f"{where}: make {target}"
