"""The tutorials as notebooks with their results: `make notebooks RECORDINGS=FOLDER`.

    python docs/notebooks.py FOLDER [NAME ...]

FOLDER holds the published recordings, a folder for each tutorial. What stands in a notebook is what
the script says: comments at the head of a cell are its text.
"""

import argparse
import os
import re
import tempfile
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

ROOT = Path(__file__).resolve().parents[1]
DATA = {
    "cascaded_tanks": "cascaded_tanks",
    "servo_pendulum": "servo_pendulum",
    "pneumatic_cylinder": "pneumatic_cylinder",
    "air_supply": "metro_air_supply",
}  # the folder of the recordings of each tutorial
_SAVED = re.compile(r"^( *)(.+\.plot\(\))\.savefig\(.+\)$", re.MULTILINE)
_LONGEST = 600  # seconds a cell; a tutorial takes a minute on two cores


def cells(path: Path) -> list[tuple[str, str]]:
    """Read a script with cells: the text and the code of each, either may be empty."""
    parts = []
    for cell in path.read_text(encoding="utf-8").split("# %%")[1:]:
        lines = cell.removeprefix(" [markdown]").strip().splitlines()
        code = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
        text = "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines[:code])
        parts.append((text, "\n".join(lines[code:]).strip()))
    return parts


def notebook(tutorial: str) -> NotebookNode:
    """Make the notebook of a tutorial, without results.

    A script takes the folder of its data from the command line. A notebook has none: its first cell
    of code says it. Figures that only a file has are shown.
    """
    folder = f"recordings/{DATA[tutorial]}"
    place = (
        f'%matplotlib inline\nimport sys\n\nsys.argv[1:] = ["{folder}"]  # the folder of the data'
    )
    parts = [new_code_cell(place)]
    for text, code in cells(ROOT / "tutorials" / f"{tutorial}.py"):
        if text:
            parts.append(new_markdown_cell(text))
        if code:
            parts.append(new_code_cell(_SAVED.sub(r"\1display(\2)", code)))
    parts.insert(1, parts.pop(0))  # below the title
    for number, part in enumerate(parts):
        part["id"] = f"{tutorial}-{number}"  # the same each time
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return new_notebook(cells=parts, metadata={"kernelspec": kernel})


def execute(book: NotebookNode, recordings: Path) -> None:
    """Run a notebook in a temporary folder, in which `recordings` is that of the user.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails, with what it said.
    """
    from nbclient import NotebookClient

    with tempfile.TemporaryDirectory() as folder:
        os.symlink(recordings.resolve(), Path(folder, "recordings"))
        client = NotebookClient(
            book,
            timeout=_LONGEST,
            record_timing=False,
            store_widget_state=False,
            resources={"metadata": {"path": folder}},
        )
        client.execute()


def main() -> None:
    """Write the notebooks that are named, or all."""
    options = argparse.ArgumentParser(description="Write the tutorials as executed notebooks.")
    options.add_argument("recordings", type=Path, metavar="FOLDER")
    options.add_argument("tutorials", nargs="*", metavar="NAME")
    chosen = options.parse_args()
    for tutorial in chosen.tutorials or DATA:
        book = notebook(tutorial)
        execute(book, chosen.recordings)
        nbformat.write(book, ROOT / "tutorials" / f"{tutorial}.ipynb")


if __name__ == "__main__":
    main()
