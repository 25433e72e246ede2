"""Seeded changes of files for fuzzing: blind ones of bytes, and ones that know text."""

import random
import re
import struct

BYTES = (0x00, 0x01, 0x0A, 0x20, 0x2D, 0x39, 0x7F, 0x80, 0xFE, 0xFF)
NUMBERS = (
    *(b"0", b"-1", b"1", b"255", b"256", b"65535", b"65536", b"2147483647", b"2147483648"),
    *(b"4294967295", b"9223372036854775807", b"9223372036854775808", b"99999999999999999999"),
    *(b"1e9", b"1e20", b"1e300", b"1e-300", b"1e400", b"-1e155", b"nan", b"inf", b"-inf", b"0x10"),
    *(b"1_000", b"1.5.2", b"+7", b"", b".", b"-", b"9" * 400, b"9" * 5000, b"1e" + b"9" * 50),
)
"""What a number of a text is replaced by."""

WORDS = (
    *(
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        b"\0",
        b"\r",
        b"\n\n",
        b"\t",
        b"#",
        b":",
        b'"',
        b"'",
        b"[" * 3000,
    ),
    *(
        b"list",
        b"ascii",
        b"binary",
        b"x",
        b"_",
        b"\x1b[31m",
        b"\xc3\xa9",
        b"\xed\xb2\x80",
        b"%s",
        b"{}",
    ),
)
INTEGERS = (0, 1, -1, 2**15, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1)
FLOATS = (0.0, -0.0, float("nan"), float("inf"), float("-inf"), 1e38, 1e-45, 1e308, -1e155, 5e-324)

NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?")
HEADER_BYTES = 600
"""The first bytes are changed more often: most decisions hang on them."""


def mutated(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """The content after one to four random changes.

    Parameters
    ----------
    content : bytes
    others : list of bytes
        Contents of other files, of which parts are put in.
    rng : random.Random
    """
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        content = rng.choice(MUTATORS)(content, others, rng)
    return content


def _place(content: bytes, rng: random.Random) -> int:
    end = min(len(content), HEADER_BYTES) if rng.random() < 0.5 else len(content)
    return rng.randrange(end + 1)


def _flip(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    place = _place(content, rng)
    if place == len(content):
        return content
    return content[:place] + bytes([content[place] ^ 1 << rng.randrange(8)]) + content[place + 1 :]


def _overwrite(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    place, length = _place(content, rng), rng.choice((1, 1, 2, 4, 16, 100))
    new = bytes(rng.choice(BYTES) for _ in range(length))
    return content[:place] + new + content[place + length :]


def _overwrite_number(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    order = rng.choice("<>")
    if rng.random() < 0.5:
        new = struct.pack(order + rng.choice("fd"), 0.0)
        kind = "f" if len(new) == 4 else "d"
        value = rng.choice(FLOATS)
        new = struct.pack(order + kind, value if kind == "d" or abs(value) < 3e38 else 1e38)
    else:
        kind, bits = rng.choice((("H", 16), ("I", 32), ("Q", 64)))
        new = struct.pack(order + kind, rng.choice(INTEGERS) % 2**bits)
    place = _place(content, rng)
    return content[:place] + new + content[place + len(new) :]


def _truncate(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    return content[: _place(content, rng)]


def _delete(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    place = _place(content, rng)
    return content[:place] + content[place + rng.choice((1, 1, 2, 4, 30)) :]


def _insert(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    place = _place(content, rng)
    new = rng.choice(WORDS) if rng.random() < 0.7 else rng.randbytes(rng.choice((1, 3, 40)))
    return content[:place] + new + content[place:]


def _repeat(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    place = _place(content, rng)
    part = content[place : place + rng.choice((1, 8, 60, 400))]
    return content[:place] + part * rng.choice((2, 3, 20)) + content[place:]


def _splice(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    other = rng.choice(others) if others else content
    start = _place(other, rng)
    part = other[start : start + rng.choice((4, 30, 300, len(other)))]
    place = _place(content, rng)
    return content[:place] + part + content[place + rng.choice((0, len(part))) :]


def _replace_number(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    found = [match.span() for match in NUMBER.finditer(content[: 20 * HEADER_BYTES])]
    if not found:
        return content
    start, stop = rng.choice(found[:60] if rng.random() < 0.7 else found)
    return content[:start] + rng.choice(NUMBERS) + content[stop:]


def _edit_lines(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    place = rng.randrange(min(len(lines), 40))
    other = rng.randrange(min(len(lines), 40))
    match rng.randrange(5):
        case 0:
            del lines[place]
        case 1:
            lines.insert(place, lines[other])
        case 2:
            lines[place], lines[other] = lines[other], lines[place]
        case 3:
            words = lines[place].split(b" ")
            rng.shuffle(words)
            lines[place] = b" ".join(words)
        case _:
            lines[place] = lines[place].swapcase()
    return b"\n".join(lines)


MUTATORS = (
    *(_flip, _overwrite, _overwrite_number, _truncate, _delete, _insert, _repeat, _splice),
    *(_replace_number, _replace_number, _edit_lines, _edit_lines),
)
