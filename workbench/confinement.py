"""A process that can neither write outside some folders nor reach a network, on Linux.

Landlock (Linux 5.13) takes the right to write, seccomp that to make sockets; both hold for this
process and all that it starts, and cannot be undone. Numbers are those of the kernel's headers
<linux/landlock.h>, <linux/seccomp.h>, <linux/filter.h>.
"""

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Sequence
from pathlib import Path

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # the same on every processor
_VERSION, _BENEATH = 1, 1
# Write a file; remove folders and files; make device, folder, file, socket, FIFO, block, link.
_WRITING = 1 << 1 | sum(1 << right for right in range(4, 13))
_LINK_ELSEWHERE, _TRUNCATE = 1 << 13, 1 << 14  # since versions 2 and 3
_TCP = 3  # bind and connect, since version 4
_OUTSIDE = 3  # abstract sockets and signals, since version 6
_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2  # of prctl

# Architecture as audit names it, and its system call `socket`.
_SOCKET = {"x86_64": (0xC000003E, 41), "aarch64": (0xC00000B7, 198)}
_IO_URING, _TAKE_DESCRIPTOR = 425, 438  # other ways to a socket: io_uring_setup, pidfd_getfd
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000
_X32 = 0x40000000  # bit of the numbers of a second interface on x86_64


def confine(folders: Sequence[Path]) -> str:
    """Confine this process, which must have one thread, and all that it starts.

    Parameters
    ----------
    folders : that may be written below.

    Returns
    -------
    What holds from now on, for people; it names what this system cannot do.
    """
    if sys.platform != "linux":
        return "in a process of its own; this system has no means to confine it further"
    libc = ctypes.CDLL(None, use_errno=True)
    writing = _confine_files(libc, folders)
    network = _confine_sockets(libc)
    places = ", ".join(map(str, folders))
    return (
        f"writing only below {places}" if writing else "writing NOT confined (no Landlock here)"
    ) + ("; no network" if network else "; network NOT confined (no seccomp filter here)")


def _confine_files(libc: ctypes.CDLL, folders: Sequence[Path]) -> bool:
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    rights = (
        _WRITING | (_LINK_ELSEWHERE if version >= 2 else 0) | (_TRUNCATE if version >= 3 else 0)
    )
    fields = [rights, *([_TCP] if version >= 4 else []), *([_OUTSIDE] if version >= 6 else [])]
    attributes = struct.pack(f"{len(fields)}Q", *fields)
    ruleset = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if ruleset < 0:
        return False
    of_files = rights & (1 << 1 | _TRUNCATE)
    for path, allowed in [*((one, rights) for one in folders), (Path(os.devnull), of_files)]:
        beneath = os.open(path, os.O_PATH)
        rule = struct.pack("=Qi", allowed, beneath)
        failed = libc.syscall(_ADD_RULE, ruleset, _BENEATH, rule, 0)
        os.close(beneath)
        if failed:
            raise OSError(ctypes.get_errno(), "no rule for Landlock", str(path))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = libc.syscall(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)
    return not failed


def _confine_sockets(libc: ctypes.CDLL) -> bool:
    """Refuse sockets but those between processes of this machine."""
    if platform.machine() not in _SOCKET:
        return False
    architecture, make = _SOCKET[platform.machine()]
    refuse = _REFUSE | errno.EACCES
    # Code, jumps if true and if false, constant. The data: number, architecture, ..., arguments.
    program = [
        (_LOAD, 0, 0, 4),
        (_EQUAL, 0, 8, architecture),
        (_LOAD, 0, 0, 0),
        (_AT_LEAST, 6, 0, _X32),
        (_EQUAL, 5, 0, _IO_URING),
        (_EQUAL, 4, 0, _TAKE_DESCRIPTOR),
        (_EQUAL, 0, 2, make),
        (_LOAD, 0, 0, 16),
        (_EQUAL, 0, 1, 1),  # AF_UNIX
        (_RETURN, 0, 0, _ALLOW),
        (_RETURN, 0, 0, refuse),
    ]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *one) for one in program))
    header = struct.pack("HxxxxxxP", len(program), ctypes.addressof(code))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = libc.prctl(_SECCOMP, _FILTER, header, 0, 0)
    return not failed
