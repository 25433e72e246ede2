"""Reading serialized ROS messages: CDR of ROS 2, and the encoding of ROS 1.

Both write the fields of a message one after the other. CDR starts with four bytes that tell the
byte order, aligns numbers to their size, and ends texts with a zero; ROS 1 does none of that, and
its headers have a sequence number.
"""

import contextlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from intervis.errors import DriveError

Encoding = Literal["cdr", "ros1"]

CDR_HEADER_BYTES = 4
LONGEST_NAME = 1000
"""Letters of the name of a frame or a field at most."""


class Cursor:
    """A place in serialized bytes, behind what was read.

    Parameters
    ----------
    content : bytes-like
        A message, or its start.
    encoding : Encoding

    Raises
    ------
    ValueError, struct.error
        By all methods, where the bytes do not hold what is asked for; see `decoding`.
    """

    def __init__(self, content: bytes | memoryview, encoding: Encoding) -> None:
        self._content = memoryview(content)
        self._is_cdr = encoding == "cdr"
        self._order = "<"
        self._place = 0
        if self._is_cdr:
            representation = bytes(self._content[:CDR_HEADER_BYTES])
            if representation[:2] not in (b"\0\0", b"\0\1") or len(representation) < 4:
                raise ValueError("the bytes are no CDR")
            self._order = "<" if representation[1] else ">"
            self._content = self._content[CDR_HEADER_BYTES:]

    def numbers(self, kinds: str) -> tuple[Any, ...]:
        """Numbers of one size, as `struct` names their kinds."""
        if self._is_cdr:
            size = struct.calcsize("=" + kinds[0])
            self._place += -self._place % size
        layout = self._order + kinds
        values = struct.unpack_from(layout, self._content, self._place)
        self._place += struct.calcsize(layout)
        return values

    def number(self, kind: str) -> int:
        """One whole number."""
        return int(self.numbers(kind)[0])

    def count(self, most: int) -> int:
        """The length of a sequence, not above `most`."""
        count = self.number("I")
        if count > most:
            raise ValueError(f"a sequence of {count}")
        return count

    def octets(self) -> memoryview:
        """A sequence of bytes, not copied."""
        size = self.number("I")
        octets = self._content[self._place : self._place + size]
        if len(octets) < size:
            raise ValueError(f"{size} bytes are declared, {len(octets)} are there")
        self._place += size
        return octets

    def text(self) -> str:
        """A name, without the zero at its end."""
        octets = bytes(self.octets())
        if len(octets) > LONGEST_NAME:
            raise ValueError("a name is too long")
        return octets.removesuffix(b"\0").decode(errors="replace")

    def header(self) -> tuple[int, str]:
        """``std_msgs/Header``: stamp in nanoseconds, and the name of the frame."""
        if not self._is_cdr:
            self.number("I")  # the sequence number
        seconds, nanoseconds = self.numbers("I" * 2) if not self._is_cdr else self.numbers("iI")
        return seconds * 10**9 + nanoseconds, self.text()


@contextlib.contextmanager
def decoding(name: Path, kind: str, error: type[DriveError]) -> Iterator[None]:
    """Turn what `Cursor` raises into one sentence."""
    try:
        yield
    except (ValueError, struct.error) as reason:
        words = " ".join(str(reason).split())[:120]
        raise error(f"{name} holds a message that is no {kind}: {words}.") from None
