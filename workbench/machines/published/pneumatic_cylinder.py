"""What the sets of one publication on a pneumatic cylinder share: its source, how its files lie."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from workbench.arrays import Vector
from workbench.recordings.csv import read_columns
from workbench.recordings.datasets import FolderLayout, PublishedRecording

SOURCE = (
    "E. Zillen, H. Vallery, G. Smit, 3D printed pneumatic actuator (2021), Delft University of "
    "Technology, https://github.com/EvaZillen/3D-printed-pneumatic-actuator, commit 6e0bcb46"
)
LICENCE = "CC0 1.0"

Columns = Mapping[str, Vector]


def layouts(
    own: tuple[str, Callable[[Path], Columns]],
    folders: tuple[str, str, Sequence[str]],
    files: Mapping[str, Sequence[str]],
    recordings: Callable[[str, Columns, str], Sequence[PublishedRecording]],
) -> tuple[FolderLayout, ...]:
    """The publisher's own files, and folders with a `measured.csv` each, in a folder or beside.

    Parameters
    ----------
    own : folder of the publisher's files, and what reads the columns of one.
    folders : what that layout is called, the folder, and the columns of each file.
    files : SHA-256 of the publisher's file and of that in a folder, by name.
    recordings : of one file, by its name, its columns and its path.
    """
    theirs, columns_of = own
    title_of_folders, folder, names = folders

    def layout(title: str, path: str, which: int, read: Callable[[Path], Columns]) -> FolderLayout:
        paths = {name: path.format(name) for name in files}
        checksums = {paths[name]: sums[which] for name, sums in files.items()}
        return FolderLayout(title, checksums, partial(_read, paths, read, recordings))

    by_name = partial(_columns, names)
    return (
        layout("the publisher's own files", theirs + "/{}.csv", 0, columns_of),
        layout(title_of_folders, folder + "/{}/measured.csv", 1, by_name),
        layout(title_of_folders, "{}/measured.csv", 1, by_name),
    )


def _columns(names: Sequence[str], path: Path) -> Columns:
    return {name: column.values for name, column in read_columns(path, names).items()}


def _read(
    paths: Mapping[str, str],
    columns_of: Callable[[Path], Columns],
    recordings: Callable[[str, Columns, str], Sequence[PublishedRecording]],
    folder: Path,
) -> list[PublishedRecording]:
    return [
        recording
        for name, path in paths.items()
        for recording in recordings(name, columns_of(folder / path), path)
    ]
