"""What may happen to a file, by chance alone: the same generator gives the same mutant."""

import io
import re
import zipfile
from collections.abc import Callable, Mapping
from random import Random

# What readers stumble over: no numbers, too large ones, signs of other formats, bytes of others.
TOKENS = (
    *(b"nan", b"inf", b"-inf", b"1e999", b"-0", b"1e50", b"0x10", b"1_000", b"1,5", b"9" * 5000),
    *(b"", b" ", b"\0", b"\xef\xbb\xbf", b"\xff\xfe", b"\xff", b"\x85", b"\r", b"\t", b"\n\n"),
    *(b'"', b"'", b'"""', b"#", b"=", b"[", b"]", b"[[", b"{", b"}", b"(", b")", b",", b";", b"."),
    *(b"true", b"null", b"{}", b"[]", b"-1", b"../", b"/etc/passwd", b"\\", b"%s", b"&x;", b"<"),
    *("\u0660\u221e\u200b".encode(), "\U0001f600".encode(), b"[" * 5000, b"a" * 100_000),
)
SMALL = 200_000  # bytes; a mutant of what is larger costs time and finds nothing more
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_]\w*")
Files = Mapping[str, bytes]  # by name
Mutation = Callable[[bytes, Random], bytes]


def _span(content: bytes, random: Random) -> tuple[int, int]:
    """Begin and end of a piece, most often a short one."""
    begin = random.randrange(len(content) + 1)
    return begin, min(len(content), begin + int(random.paretovariate(0.7)))


def flip(content: bytes, random: Random) -> bytes:
    """Change some bits."""
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 8))):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def cut(content: bytes, random: Random) -> bytes:
    """Leave a piece out."""
    begin, end = _span(content, random)
    return content[:begin] + content[end:]


def truncate(content: bytes, random: Random) -> bytes:
    """End early."""
    return content[: random.randrange(len(content) + 1)]


def repeat(content: bytes, random: Random) -> bytes:
    """Write a piece again somewhere."""
    begin, end = _span(content, random)
    place = random.randrange(len(content) + 1)
    return content[:place] + content[begin:end] * random.choice((1, 1, 2, 50)) + content[place:]


def insert(content: bytes, random: Random) -> bytes:
    """Write something strange somewhere."""
    place = random.randrange(len(content) + 1)
    return content[:place] + random.choice(TOKENS) + content[place:]


def replace_number(content: bytes, random: Random) -> bytes:
    """Write another number, or none, in the place of one."""
    matches = list(_NUMBER.finditer(content))
    if not matches:
        return insert(content, random)
    match = random.choice(matches)
    tens = b"%se%d" % (match[0].split(b"e")[0].split(b"E")[0], random.choice((-90, -9, 9, 90, 400)))
    other = random.choice((random.choice(TOKENS), tens, b"-" + match[0], random.choice(matches)[0]))
    return content[: match.start()] + other + content[match.end() :]


def replace_word(content: bytes, random: Random) -> bytes:
    """Write another word of the file, or none, in the place of one."""
    matches = list(_WORD.finditer(content))
    if not matches:
        return insert(content, random)
    match = random.choice(matches)
    other = random.choice((random.choice(TOKENS), random.choice(matches)[0]))
    return content[: match.start()] + other + content[match.end() :]


def lines(content: bytes, random: Random) -> bytes:
    """Leave out, repeat, swap or join lines."""
    parts = content.split(b"\n")
    at, other = random.randrange(len(parts)), random.randrange(len(parts))
    change = random.randrange(4)
    if change == 0:
        del parts[at]
    elif change == 1:
        parts.insert(other, parts[at])
    elif change == 2:
        parts[at], parts[other] = parts[other], parts[at]
    else:
        parts[at : at + 2] = [b"".join(parts[at : at + 2])]
    return b"\n".join(parts)


def encode(content: bytes, random: Random) -> bytes:
    """Write it as another program would."""
    text = content.decode(errors="replace")
    return random.choice(
        (
            text.encode("utf-16"),
            text.encode("utf-32"),
            text.replace("e", "\u00e9").encode("latin-1", errors="replace"),
            content.replace(b"\n", b"\r\n"),
            content.replace(b"\n", b"\r"),
            content.replace(b",", b";").replace(b".", b","),
            b"\xef\xbb\xbf" + content,
            b"",
            zipped({"file": content}),
        )
    )


TEXT: tuple[Mutation, ...] = (
    *(flip, cut, truncate, repeat, insert, insert, replace_number, replace_number),
    *(replace_word, replace_word, lines, encode),
)
BYTES: tuple[Mutation, ...] = (flip, cut, truncate, repeat, insert)


def mutate(content: bytes, random: Random, kinds: tuple[Mutation, ...] = TEXT) -> tuple[bytes, str]:
    """A mutant and the names of what happened to it: one thing most often, at times more."""
    names = []
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        mutation = random.choice(kinds)
        content = mutation(content, random)
        names.append(mutation.__name__)
    return content, "+".join(names)


def change_one(files: Files, random: Random) -> tuple[Files, str]:
    """A mutant of one of some files."""
    name = random.choice(list(files))
    content, mutation = mutate(files[name], random)
    return {**files, name: content[:SMALL]}, f"{name}: {mutation}"


def zipped(entries: Files) -> bytes:
    """An archive; its time is always the same."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return stream.getvalue()
