"""An archive that is damaged, or made to harm, is refused in words before anything is unpacked."""

import re
import shutil
import stat
import struct
import tempfile
import zipfile
from collections.abc import Callable
from copy import copy
from pathlib import Path
from random import Random

import pytest

from workbench.__main__ import main
from workbench.errors import FMUError, InputError
from workbench.models.archive import unpack
from workbench.models.fmu import FMU

from .edits import edits
from .hostile_fmus import XML, rewritten
from .processes import ROOT

OWN = ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"
LIBRARY = "binaries/linux64/MinimalObserver.so"


@pytest.fixture(autouse=True)
def places(tmp_path, monkeypatch) -> Path:
    """A folder of temporary files of its own."""
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


# --- entries ---


def with_entry(path: Path, entry: zipfile.ZipInfo, content: bytes = b"x") -> Path:
    """Copy of an FMU with one more entry."""
    shutil.copy(OWN, path)
    with zipfile.ZipFile(path, "a") as archive:
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, content)
    return path


@pytest.mark.parametrize(
    "name",
    [
        "../outside",
        "resources/../../outside",
        "/etc/outside",
        "C:/outside",
        "resources\\outside",
        "resources/./here",
        "resources//here",
        "resources/new\nline",
        "resources/zero\0byte",
    ],
)
def test_a_name_that_leads_elsewhere_is_refused(name, tmp_path):
    path = with_entry(tmp_path / "evil.fmu", zipfile.ZipInfo("0" * len(name)))
    raw = path.read_bytes().replace(b"0" * len(name), name.encode())  # zipfile would mend it
    path.write_bytes(raw)
    with pytest.raises(InputError, match=r"an archive with the name '.*names inside the FMU"):
        FMU(path)
    assert not (tmp_path / "outside").exists()


@pytest.mark.parametrize("file_type", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR])
def test_a_link_or_device_is_refused(file_type, tmp_path):
    entry = zipfile.ZipInfo("resources/link")
    entry.external_attr = (file_type | 0o777) << 16
    with pytest.raises(InputError, match="'resources/link', which is a link or a device"):
        FMU(with_entry(tmp_path / "evil.fmu", entry, b"/etc/passwd"))


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", [LIBRARY, XML])
def test_a_name_that_stands_twice_is_refused(name, tmp_path):
    with pytest.raises(InputError, match=f"the name '{re.escape(name)}' twice"):
        FMU(with_entry(tmp_path / "evil.fmu", zipfile.ZipInfo(name)))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_what_nothing_is_taken_from_may_stand_twice(tmp_path):
    """Exporters write folders and documentation twice."""
    path = tmp_path / "twice.fmu"
    with_entry(path, zipfile.ZipInfo("extra/"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(zipfile.ZipInfo("extra/"), b"")
        archive.writestr("extra/a.xml", b"")
        archive.writestr("extra/a.xml", b"")
    with FMU(path) as fmu:
        fmu.start({})


def test_a_file_that_is_a_folder_too_is_refused(tmp_path):
    with pytest.raises(InputError, match="as a file and as a folder"):
        FMU(with_entry(tmp_path / "evil.fmu", zipfile.ZipInfo(f"{XML}/inside")))


def test_an_archive_that_unpacks_to_much_more_is_refused_at_once(tmp_path, places):
    path = tmp_path / "bomb.fmu"
    with_entry(path, zipfile.ZipInfo("resources/zeros"), bytes(64 << 20))
    assert path.stat().st_size < 1 << 20
    with pytest.raises(InputError, match=r"which unpacks to \d+ times its size"):
        FMU(path)
    assert list(places.iterdir()) == []


@pytest.mark.parametrize(("count", "size"), [(60, 15 << 20), (2000, 1 << 19)])
def test_many_files_that_unpack_to_much_more_together_are_refused(count, size, tmp_path):
    path = tmp_path / "bomb.fmu"
    with path.open("wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/0000", bytes(size))
        file.flush()
        packed = path.read_bytes()  # once: to pack each of them took 15 s
        for number in range(1, count):
            other = copy(archive.infolist()[0])
            other.filename = other.orig_filename = f"resources/{number:04}"
            other.header_offset = file.tell()
            file.write(packed.replace(b"resources/0000", other.filename.encode()))
            archive.filelist.append(other)
        archive.start_dir = file.tell()
    assert path.stat().st_size > count * len(packed)
    with pytest.raises(InputError, match=r"an archive with \d+ MB, which is \d+ times its size"):
        FMU(path)


def test_entries_that_share_their_bytes_are_judged_by_what_the_file_has(tmp_path):
    """Each unpacks to little of its own size, and a small file to a lot."""
    path = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "resources/0", Random(1).randbytes(1 << 14) * (1 << 9)
        )  # 8 MB, packed 20:1
        for number in range(1, 100):
            other = copy(archive.infolist()[0])
            other.filename = other.orig_filename = f"resources/{number}"
            archive.filelist.append(other)
    with pytest.raises(InputError, match=r"an archive with 800 MB, which is \d+ times its size"):
        FMU(path)


def test_a_size_that_is_not_the_true_one_is_refused(tmp_path, places):
    """Where the list of contents says less than is there, no more is unpacked than it says."""
    path = with_entry(tmp_path / "liar.fmu", zipfile.ZipInfo("resources/zeros"), bytes(1 << 20))
    with zipfile.ZipFile(path) as archive:
        entry, contents = archive.getinfo("resources/zeros"), archive.start_dir
    written = bytearray(path.read_bytes())
    listed = written.rindex(entry.filename.encode(), contents) - 46  # its entry in the contents
    for place in (entry.header_offset + 22, listed + 24):  # sizes, APPNOTE.TXT 4.3.7 and 4.3.12
        assert struct.unpack_from("<I", written, place) == (1 << 20,)
        struct.pack_into("<I", written, place, 100)
    path.write_bytes(written)
    with pytest.raises(InputError, match=r"no FMU \(Bad CRC-32"):
        FMU(path)
    assert list(places.iterdir()) == []


def test_a_list_of_contents_that_says_it_begins_later_is_refused(tmp_path):
    """Of a file that lost bytes in the middle; all entries seem to begin as much earlier."""
    raw = bytearray(OWN.read_bytes())
    (begin,) = struct.unpack_from("<L", raw, len(raw) - 6)  # the last of it, but for no comment
    struct.pack_into("<L", raw, len(raw) - 6, begin + 1000)
    path = tmp_path / "evil.fmu"
    path.write_bytes(raw)
    with pytest.raises(InputError, match="begins before it"):
        FMU(path)


def test_many_files_are_refused(tmp_path):
    path = tmp_path / "many.fmu"
    shutil.copy(OWN, path)
    with zipfile.ZipFile(path, "a") as archive:
        for number in range(10_001):
            archive.writestr(f"resources/{number}", b"")
        files = len(archive.infolist())
    with pytest.raises(InputError, match=f"{files} files; expected 10000 at most"):
        FMU(path)


def test_only_what_runs_here_is_unpacked(tmp_path):
    path = with_entry(tmp_path / "own.fmu", zipfile.ZipInfo("resources/table.txt"))
    unpack(path, tmp_path / "in", "binaries/linux64")
    files = {p.relative_to(tmp_path / "in").as_posix() for p in (tmp_path / "in").rglob("*.*")}
    assert files == {XML, LIBRARY, "resources/table.txt"}


@pytest.mark.parametrize("place", ["file", "file/inside"])
def test_where_nothing_can_be_unpacked_no_folder_of_our_own_is_named(place, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="no way to unpack it for this run") as refused:
        unpack(OWN, tmp_path / place, "binaries/linux64")
    assert str(tmp_path) not in str(refused.value)
    assert "room for 1 MB" in str(refused.value)


# --- content ---


def cut(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def emptied(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(b"")


def halved(folder: Path) -> None:
    whole = (folder / LIBRARY).read_bytes()
    (folder / LIBRARY).write_bytes(whole[: len(whole) // 2])


def another(folder: Path) -> None:
    """A library of this machine that is none of FMI."""
    shutil.copy(next(Path("/lib").glob("*/libm.so.6"), "/lib64/libm.so.6"), folder / LIBRARY)


def foreign(folder: Path) -> None:
    shutil.rmtree(folder / "binaries" / "linux64")


def foreign_inside(folder: Path) -> None:
    shutil.copy(folder / "binaries" / "win64" / "MinimalObserver.dll", folder / LIBRARY)


def edited(old: str, new: str) -> Callable[[Path], None]:
    return edits(XML, (old, new), count=1)


DAMAGES: dict[str, tuple[Callable[[Path], None], str]] = {
    "no description": (cut(XML), "it holds no modelDescription.xml"),
    "no XML": (emptied(XML), "no FMU"),
    "document type": (edited("<fmiModel", "<!DOCTYPE a><fmiModel"), "declares a document type"),
    "foreign platform": (foreign, r"binaries for .*expected a binary for this machine"),
    "foreign binary": (foreign_inside, r"a binary that cannot be loaded \(binaries/"),
    "no binary": (cut(LIBRARY), "binaries for |no file binaries/linux64"),
    "empty binary": (emptied(LIBRARY), "an empty file binaries/linux64"),
    "half a binary": (halved, "a binary that cannot be loaded|crashed with SIG"),
    "another library": (another, "a binary that cannot be loaded|a binary without the function"),
    "identifier elsewhere": (
        edited('modelIdentifier="', 'modelIdentifier="../../../'),
        r"the modelIdentifier '\.\./",
    ),
    "no identifier": (edited('modelIdentifier="MinimalObserver"', ""), "the modelIdentifier ''"),
    "no GUID": (edited('guid="', 'was="'), "an empty guid or"),
    "wrong GUID": (edited('guid="{', 'guid="{0'), "instantiat"),
    "text for a number": (edited('start="0.0"', 'start="many"'), r"start value of '\w+' = 'many'"),
    "NaN": (edited('start="0.0"', 'start="nan"'), r"start value of '\w+' = 'nan'"),
    "endless start": (edited('start="0.0"', 'start="1e999"'), r"start value of '\w+' = '1e999'"),
    "reference below zero": (
        edited('valueReference="1"', 'valueReference="-1"'),
        "valueReference = '-1'",
    ),
    "reference too large": (
        edited('valueReference="1"', 'valueReference="4294967296"'),
        "reference 4294967296",
    ),
    "reference of 5000 digits": (
        edited('valueReference="1"', f'valueReference="{"9" * 5000}"'),
        "found what FMI does not allow",
    ),
    "index of nothing": (
        edited('derivative="1"', 'derivative="0"'),
        "model variable index 0 which",
    ),
    "dependency from the end": (edited('dependencies="', 'dependencies="-1 '), "ies = '-1' of an"),
    "dependency on nothing": (edited('dependencies="', 'dependencies="0 '), "ies = '0' of an"),
    "number of Python": (edited('valueReference="1"', 'valueReference="1_0"'), "nce = '1_0' of an"),
    "start of Python": (edited('start="0.0"', 'start="1_0"'), r"start value of '\w+' = '1_0'"),
    "other digits": (edited('start="0.0"', 'start="\u0663"'), r"start value of '\w+' = '\u0663'"),
    "states of one reference": (
        edited('valueReference="1"', 'valueReference="0"'),
        "the states 'omegaW' and 'omegaR' with one value reference",
    ),
    "indicators without end": (
        edited('numberOfEventIndicators="0"', 'numberOfEventIndicators="4000000000"'),
        "4000000000 event indicators",
    ),
    "unknown variability": (
        edited('variability="tunable"', 'variability="-"'),
        "variability '-' of",
    ),
    "line within a name": (edited('name="tauR"', 'name="a&#10;error: b"'), r"'a\\nerror: b' of 10"),
    "name of a terminal": (edited('name="tauR"', 'name="a&#x9b;2J"'), r"'a\\x9b2J' of 4"),
    "name without end": (edited('name="tauR"', f'name="{"n" * 5000}"'), "of 5000 characters"),
    "index too large": (edited('derivative="', 'derivative="99'), "found what FMI does not allow"),
    "name twice": (edited('name="tauR"', 'name="pB"'), "two variables 'pB'"),
    "indicators below zero": (
        edited('numberOfEventIndicators="0"', 'numberOfEventIndicators="-1"'),
        "-1 event indicators",
    ),
    "unit without size": (edited('factor="1e-05"', 'factor="0"'), "factor 0 of a <DisplayUnit>"),
    "base unit without size": (edited('m="1" s="-1"', 'm="1" s="-1" factor="0"'), "<BaseUnit>"),
    "an output that is a parameter": (
        edited('causality="output"', 'causality="parameter"'),
        "a parameter '.*' among the outputs",
    ),
    "range from high to low": (
        edited('min="0.0" max="1.0" start="0.4"', 'min="2.0" max="1.0" start="0.4"'),
        r"the range of 'polach.A', from 2 to 1",
    ),
    "derivative of a parameter": (
        edited('unit="rad/s2" derivative="1"', 'unit="rad/s2" derivative="12"'),
        r"a derivative 'der\(omegaW\)' of 'rR', which is no state",
    ),
    "two derivatives of a state": (
        edited('unit="rad/s2" derivative="2"', 'unit="rad/s2" derivative="1"'),
        "two derivatives of 'omegaW'",
    ),
    "experiment without length": (
        edited('startTime="0" stopTime="40.0"', 'startTime="-1e308" stopTime="1e308"'),
        "an experiment from -1e.308 s to 1e.308 s, which has no length",
    ),
    "no name": (edited('name="tauR"', 'name=""'), "a variable without a name"),
}


@pytest.mark.skipif(not Path("/lib").is_dir(), reason="damages binaries of Linux")
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_fmu_is_refused_in_words(damage, tmp_path, places):
    change, message = DAMAGES[damage]
    path = rewritten(OWN, tmp_path / "damaged.fmu", change)
    before = Path.cwd()
    with pytest.raises((InputError, FMUError), match=message) as refused:
        FMU(path)
    assert len(str(refused.value)) < 1000
    assert list(places.iterdir()) == []
    assert Path.cwd() == before


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_refused(share, tmp_path):
    whole = OWN.read_bytes()
    path = tmp_path / "half.fmu"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match="no FMU"):
        FMU(path)


def test_a_damaged_byte_is_refused(tmp_path, places):
    with zipfile.ZipFile(OWN) as archive:
        begin = archive.getinfo(LIBRARY).header_offset
    whole = bytearray(OWN.read_bytes())
    whole[begin + 5000] ^= 0xFF
    path = tmp_path / "damaged.fmu"
    path.write_bytes(whole)
    with pytest.raises(InputError, match=r"no FMU \((Bad CRC-32|Error -3)"):
        FMU(path)
    assert list(places.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        ["fmu", "check"],
        ["simulate", str(ROOT / "cases" / "01_dry_80_1.5"), "--out", "out", "--fmu"],
        ["observability", str(ROOT / "cases" / "01_dry_80_1.5"), "--out", "out", "--fmu"],
        ["diagnose", str(ROOT / "cases"), "--out", "out", "--model"],
    ],
)
@pytest.mark.parametrize("damage", ["foreign binary", "text for a number"])
def test_every_command_refuses_it_in_words(damage, command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = rewritten(OWN, tmp_path / "damaged.fmu", DAMAGES[damage][0])
    assert main([*command, str(path), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert re.search(DAMAGES[damage][1], error)
    assert len(error.splitlines()) == 1
