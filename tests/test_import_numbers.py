"""Recorders' files that can be read in two ways: no number of them is taken in silence."""

from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.foreign import read_foreign

# --- names above samples ---


def table(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("header", "row", "match"),
    [
        ("time [s]\tinflow [l/s]\th [mm]", "{0}\t{0}.5\t3.{0}\t950.2", "3 names over 4 columns"),
        ("time [s]\tinflow [l/s]\th [mm]\t", "{0}\t{0}.5\t3.{0}\t950.2", "3 names over 4 columns"),
        ("time [s],inflow [l/s],h [mm]", "{0},3,5,95,2", "3 names over 5 columns"),
        ("Nr;time;h\ns;mm", "{0};{0}.5;950.2", "2 units below 3 names"),
    ],
    ids=["R without a name of rows", "the same by way of a spreadsheet", "commas", "units"],
)
def test_a_header_that_is_narrower_than_its_samples_is_refused(
    tmp_path: Path, header: str, row: str, match: str
) -> None:
    path = table(tmp_path / "a.csv", [header, *(row.format(i) for i in range(1, 60))])
    with pytest.raises(InputError, match=rf"above line \d: found {match}.*name every column"):
        read_foreign(path)


def test_columns_beyond_the_header_may_be_empty(tmp_path: Path) -> None:
    rows = [f"{i};{i}.5;;" for i in range(60)]
    (group,) = read_foreign(table(tmp_path / "a.csv", ["time [s];h [mm]", *rows])).groups
    assert [one.name for one in group.channels] == ["time", "h"]
