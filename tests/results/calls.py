"""What is asked of the command line: small calls of every command, by part.

A part is a folder of its own; the name of a call is that of its results in it, which later calls
of the same part may read. `{cases}` are the recordings that come along, `{modelica}` the libraries,
`{fmus}` the built models, `{recordings}` those that are not part of the repository. One process
works on each, as progress has no order with more. What no command makes is made by a function,
which is given the folder of the part.
"""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path

Call = str | Callable[[Path], object]

CASES = Path(__file__).parents[2] / "cases"


def recorded(folder: Path) -> None:
    """Write a stop as a German recorder does: semicolons, decimal commas, names of its own."""
    _, *rows = (CASES / "01_dry_80_1.5" / "measured.csv").read_text().splitlines()
    head = "Zeit [s];Bremsdruck [bar];Antriebsmoment [N.m];v_Rad [rad/s];v_Rolle [rad/s];Fx [N]"
    own = [row.replace(",", ";").replace(".", ",") for row in rows[::4]]
    (folder / "stop.csv").write_text("\n".join([head, *own]) + "\n")


def changed_effect(folder: Path) -> None:
    """Let the tank's only effect be one that does not explain what its recordings show."""
    library = folder / "tank" / "package.mo"
    library.write_text(library.read_text().replace("nominal + k*h", "nominal + k*nominal"))


_MADE = {function.__name__: function for function in (recorded, changed_effect)}
_READ = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
PARTS: Mapping[str, Mapping[str, Call]] = {
    part: {name: _MADE.get(call.removeprefix("python "), call) for name, call in calls.items()}
    for part, calls in _READ.items()
}
