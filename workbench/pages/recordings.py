"""Figures of recordings on a page, and on pages of their own where one would be too large."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from workbench.pages.drawing import drawing
from workbench.pages.figures import CaseFigure
from workbench.pages.templates import rendered
from workbench.runtime.files import write_whole

_ROOM = 2_600_000  # [byte] of figures on a page, so that it stays below 3 MB and opens at once


def placed(
    figures: Sequence[CaseFigure], summary: Mapping[str, Any], folder: Path
) -> list[dict[str, Any]]:
    """Geometry of figures for a template, in their order.

    What does not fit the page any more is written to a page of its own in the folder, and is
    `elsewhere`; the first is always here.

    Parameters
    ----------
    summary : of which the page is.
    """
    room, drawn = _ROOM, []
    for number, figure in enumerate(figures):
        one = drawing(figure)
        room -= one["size"]
        if number and room < 0:
            one["elsewhere"] = f"{figure.name}.html"
            text = rendered("recording.html", summary, drawing={**one, "elsewhere": ""})
            write_whole(folder / one["elsewhere"], text)
        drawn.append(one)
    return drawn
