"""Files of recorders, read as they are: which channels they hold, with names, units and times.

Each format is one module, and what it needs beyond the workbench is in the extra `files`. What a
channel means for a machine is not known here.
"""

import gzip
import hashlib
import io
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from importlib import import_module
from pathlib import Path

from workbench.errors import InputError
from workbench.recordings.formats.contents import Contents, FileChannel, Group, RecordedFile
from workbench.recordings.formats.json_text import is_json
from workbench.recordings.formats.json_text import read as read_as_json
from workbench.recordings.formats.line_protocol import is_line_protocol
from workbench.recordings.formats.line_protocol import read as read_lines_of_influx
from workbench.recordings.formats.tables.parts import by_tag
from workbench.recordings.formats.text import read as read_as_text
from workbench.runtime.files import read_bytes
from workbench.runtime.pool import Pool
from workbench.runtime.resources import installing
from workbench.runtime.supervision import limited_memory

__all__ = ["FileChannel", "Group", "RecordedFile", "is_other_format", "read_recorded_file"]

_Reader = Callable[[Path, bytes], Contents]
_OF_THE_FILE = (UserWarning, RuntimeWarning)
_MOST = 4 << 30  # [byte] unpacked: an hour of a hundred channels at 1 kHz
# Packages that read a format, by the module here and its function, and what people call its files.
_PACKAGES = {
    "workbooks.read_excel": ("openpyxl", "an Excel workbook"),
    "workbooks.read_excel_97": ("xlrd", "a workbook of Excel 97 to 2003 (.xls)"),
    "workbooks.read_others": ("python_calamine", "a workbook (.ods, .xlsb)"),
    "parquet": ("pyarrow", "a Parquet or Arrow file"),
    "matlab5": ("scipy", "a MAT file"),
    "hdf5.read_netcdf": ("scipy", "a NetCDF file"),
    "arrays.read_npz": ("numpy", "arrays of NumPy (.npz)"),
    "hdf5": ("h5py", "a MAT 7.3 or HDF5 file"),
    "mdf": ("asammdf", "an MDF file"),
    "tdms": ("nptdms", "a TDMS file"),
}
# Their libraries hand what a file says to compiled code, which may end the process or never return.
_NATIVE = frozenset(
    {"hdf5", "hdf5.read_netcdf", "matlab5", "mdf", "parquet", "workbooks.read_others"}
)
_MAT_4 = struct.Struct("<5i")  # type, rows, columns, imaginary, length of the name
_START, _RATE = 10.0, 1e6  # [s] and [byte/s], a twentieth of what they read on a busy machine
_ROOM = 1 << 30  # [byte] beside a hundred times what a file has, of compressed samples
_MESSAGES = "a trace of bus messages{}, whose signals are not decoded"
_UNREAD = {  # how files begin that are told, and not read
    b"\x93NUMPY": "an array of NumPy (.npy)",
    **{b"\x80" + bytes([k]): "an object of Python (pickle)" for k in range(2, 6)},
    b"SQLite format 3": "a database of SQLite",
    b"BZh": "a file packed by bzip2",
    b"\xfd7zXZ": "a file packed by xz",
    b"\x28\xb5\x2f\xfd": "a file packed by zstd",
    b"7z\xbc\xaf": "an archive (.7z)",
    b"Rar!": "an archive (.rar)",
    b"%PDF": "a PDF",
    b"{\\rtf": "a document (.rtf)",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"IGOR": "text of Igor Pro (.itx)",
    b"#ROSBAG": "a bag of ROS",
    b"\x89MCAP": "a bag of ROS 2 (.mcap)",
    b"|CF,2": "a file of imc FAMOS (.raw, .dat)",
    b"\xffBIOSEMI": "a file of BDF",
    b"DIAEXTENDED": "a header of DIAdem (.dat), whose samples are in another file",
    b"<": "text of HTML or XML",
}
_UNREAD_WITHIN = {  # what stands near the begin of others
    b"usi:tdm": "a header of DIAdem (.tdm), whose samples are in another file",
    b"<sie": "a file of SoMat (.sie)",
    b"No. Variables:": "results of SPICE (.raw)",
    "No. Variables:".encode("utf-16-le"): "results of SPICE (.raw)",
    b"FROM stdin": "a dump of a database (SQL)",
    b"INSERT INTO": "a dump of a database (SQL)",
    b"CREATE TABLE": "a dump of a database (SQL)",
    b"$FILEVERSION=": _MESSAGES.format(" (.trc)"),
    b"internal events logged": _MESSAGES.format(" (.asc)"),
}
_HDF5 = b"\x89HDF\r\n\x1a\n"
_FORMS = {  # of the begin of others
    re.compile(rb"RIFF....WAVE", re.S): "sound (.wav), whose samples have no unit",
    re.compile(rb"0 {7}.{160}\d\d\.\d\d\.\d\d", re.S): "a file of EDF",
    re.compile(rb".{257}ustar", re.S): "an archive (.tar)",
    re.compile(rb"\s*-1\s*\n +(15|18|55|58b?|151|164|2411|2414)\s"): "a universal file (.uff)",
    re.compile(rb"LOGG.\0\0\0", re.S): _MESSAGES.format(" (.blf)"),
    re.compile(rb"\(\d+\.\d+\) \w+ [0-9A-Fa-f]+#"): _MESSAGES.format(" (candump)"),
}
_BEGINS = {  # how files begin, whatever their ending
    b"CDF\x01": "hdf5.read_netcdf",
    b"CDF\x02": "hdf5.read_netcdf",
    b"PAR1": "parquet",
    b"ARROW1": "parquet",
    b"\xff\xff\xff\xff": "parquet",
    b"MDF     ": "mdf",
    b"UnFinMF ": "mdf",
    b"TDSm": "tdms",
    b"MATLAB 5.0 MAT-file": "matlab5",
    b"MATLAB 7.3 MAT-file": "hdf5",
    _HDF5: "hdf5",
    b"PK\x03\x04": "workbooks.read_excel",
    b"\xd0\xcf\x11\xe0": "workbooks.read_excel_97",
}


def is_other_format(path: Path) -> bool:
    """Whether a file is read here by its ending; a CSV may be the workbench's own."""
    return path.suffix.lower() != ".csv"


def read_recorded_file(path: Path) -> RecordedFile:
    """Read a file of a recorder."""
    raw = read_bytes(path, "correct the path")
    if not raw:
        raise _without_samples(path, "an empty file")
    sha256 = hashlib.sha256(raw).hexdigest()
    packed = raw.startswith(b"\x1f\x8b")
    if packed:
        raw = _unpack(path, raw)
    words, groups, notes, doubts = _reader(path, raw)(path, raw)
    groups = [own for group in groups for own in by_tag(group)]
    if not any(group.channels for group in groups):
        raise _without_samples(path, f"{words} without a channel of numbers")
    return RecordedFile(
        path, words + ", gzip" * packed, tuple(groups), tuple(notes), sha256, doubts
    )


def _without_samples(path: Path, found: str) -> InputError:
    return InputError(
        where=str(path),
        found=found,
        expected="a recording",
        remedy="export it again, with its samples",
    )


def _unpack(path: Path, raw: bytes) -> bytes:
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(raw)) as stream:
            unpacked = stream.read(_MOST + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(
            where=str(path),
            found=f"a damaged gzip file ({error})",
            expected="a whole one",
            remedy="copy or pack it again",
        ) from None
    if len(unpacked) > _MOST:
        raise InputError(
            where=str(path),
            found=f"more than {_MOST >> 30} GB, unpacked",
            expected="a recording that fits into memory",
            remedy="cut it into several files",
        )
    return unpacked


def _reader(path: Path, raw: bytes) -> _Reader:
    """The reader of a format, by how the file begins."""
    module = next((name for start, name in _BEGINS.items() if raw.startswith(start)), "")
    module = "hdf5" if raw[512:520] == _HDF5 else module  # behind a header of MATLAB
    module = module or "matlab5" * _is_mat_4(raw)
    if module == "workbooks.read_excel" and (
        b"xl/workbook.bin" in raw or b"opendocument.spread" in raw[:200]
    ):
        module = "workbooks.read_others"
    if module == "workbooks.read_excel" and b".npy" in raw[:2000]:
        module = "arrays.read_npz"
    _refuse_unread(path, raw, is_workbook=module == "workbooks.read_excel")
    if not module:
        if is_json(raw):
            return partial(_read_whole, read_as_json, "JSON")
        return read_lines_of_influx if is_line_protocol(raw) else read_as_text
    package, called = _PACKAGES[module]
    try:
        import_module(package)
    except ImportError:
        raise InputError(
            where=str(path),
            found=f"{called}, which the package '{package}' reads, and that is not installed",
            expected="the extra [files], which reads such files",
            remedy=installing("files"),
        ) from None
    reader = partial(_in_own_process if module in _NATIVE else _here, module)
    return partial(_read_whole, reader, called)


def _refuse_unread(path: Path, raw: bytes, *, is_workbook: bool) -> None:
    """Refuse formats that are known, and that nobody reads here."""
    begin = raw[:2000].lstrip(b"\xef\xbb\xbf \r\n\t")
    format_name = next(
        (format_name for start, format_name in _UNREAD.items() if begin.startswith(start)), ""
    )
    format_name = next((words for form, words in _FORMS.items() if form.match(raw)), format_name)
    within = (words for text, words in _UNREAD_WITHIN.items() if text in begin)
    format_name = next(within, format_name)
    if is_workbook and b"[Content_Types].xml" not in raw and zipfile.is_zipfile(io.BytesIO(raw)):
        format_name = "an archive (.zip)"
    if format_name:
        raise InputError(
            where=str(path),
            found=format_name,
            expected="a recording as CSV, JSON, .xlsx, .xls, .xlsb, .ods, .mat, .h5, .npz, "
            ".parquet, .feather, .tdms or .mf4",
            remedy="unpack it, or export it as CSV in the program that wrote it. One column holds "
            "times, the others a signal each, and the first row names with units",
        )


def _is_mat_4(raw: bytes) -> bool:
    """Whether a file begins as MAT files of version 4 do: with what its first matrix is."""
    if len(raw) <= _MAT_4.size:
        return False
    code, rows, columns, imaginary, length = _MAT_4.unpack_from(raw)
    name = raw[_MAT_4.size : _MAT_4.size + length] if 1 < length < 64 else b""
    known = 0 <= code < 100 and code // 10 in range(6) and code % 10 in range(3)
    named = name[:1].isalpha() and name[-1:] == b"\0" and name.isascii()
    return known and rows >= 0 and columns >= 0 and imaginary in (0, 1) and named


def _here(module: str, path: Path, raw: bytes) -> Contents:
    module, _, reader = module.partition(".")
    read = getattr(import_module(f"workbench.recordings.formats.{module}"), reader or "read")
    # Some print what puzzles them, where results are expected.
    with (
        redirect_stdout(io.StringIO()),
        warnings.catch_warnings(record=True, action="always") as warned,
    ):
        contents: Contents = read(path, raw)
    # What libraries warn of is about the file, or is about themselves.
    notes = [
        str(warning.message)[:200]
        for warning in warned
        if issubclass(warning.category, _OF_THE_FILE)
    ]
    return contents._replace(notes=[*contents.notes, *dict.fromkeys(notes)])


def _in_own_process(module: str, path: Path, raw: bytes) -> Contents:
    """Read a file in a process of its own."""
    with Pool(1, _loaded, module, limit=_START + len(raw) / _RATE) as pool:
        return pool.submit(_read_limited, path, raw).result()


@contextmanager
def _loaded(module: str) -> Iterator[str]:
    """A module whose library is loaded, which may take longer than to read a file."""
    import_module(f"workbench.recordings.formats.{module.partition('.')[0]}")
    yield module


def _read_limited(module: str, path: Path, raw: bytes) -> Contents:
    """Read a file in a process of its own, whose memory a damaged length cannot exhaust."""
    with limited_memory(_ROOM + 100 * len(raw)):
        return _here(module, path, raw)


def _read_whole(reader: _Reader, called: str, path: Path, raw: bytes) -> Contents:
    """What a library reads of a file, if it is whole."""
    try:
        return reader(path, raw)
    except InputError:
        raise
    except Exception as error:  # libraries stumble over damaged files in dozens of ways
        raise InputError(
            where=str(path),
            found=f"{called} that cannot be read ({type(error).__name__}: {error})",
            expected="a whole file, as the logger wrote it",
            remedy="copy or export it again",
        ) from None
