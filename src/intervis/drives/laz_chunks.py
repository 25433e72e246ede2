"""The chunks of a LAZ file, checked before lazrs reads them.

A chunk of LAZ 1.4 points starts with one point as it is, the number of its points, and the sizes
of its layers. lazrs takes memory for these sizes, and ends the process where there is none: so they
are held against the size of the chunk. Source: laszip, format 3 of its items.
"""

import struct
from functools import lru_cache
from pathlib import Path

from intervis.drives.las_header import LasHeader
from intervis.drives.regular_file import open_regular
from intervis.errors import MissingExtraError, ScanError

LAYERED = 3
"""Kind of compression with layers."""

LAYERS_OF_ITEM = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of points, colours, colours with infrared, waves; extra bytes have one each."""

EXTRA_BYTES = 14


@lru_cache(maxsize=8)
def check_chunks(path: Path, header: LasHeader, size: int, time_ns: int) -> None:
    """Check the chunks of a compressed file.

    Parameters
    ----------
    path : Path
    header : LasHeader
    size, time_ns : int
        Of the file, so that a changed file is checked again.

    Raises
    ------
    ScanError
        A chunk lies outside of the file, or a layer outside of its chunk.
    MissingExtraError
        lazrs is not installed.
    """
    del time_ns
    try:
        import lazrs
    except ImportError:
        raise MissingExtraError("lazrs", "las", "Reading a LAZ file") from None
    kind = struct.unpack_from("<H", header.compression)[0]
    layers = _layers(path, header.compression) if kind == LAYERED else 0
    with open_regular(path) as file:
        file.seek(header.start)
        table = lazrs.read_chunk_table(file, lazrs.LazVlr(header.compression))
        place, points = header.start + 8, 0
        for chunk_points, chunk_bytes in table:
            points += chunk_points
            if place + chunk_bytes > size:
                raise ScanError(f"{path} has a damaged table of chunks: one lies outside of it.")
            if layers:
                file.seek(place + header.point_bytes)
                head = file.read(4 + 4 * layers)
                used = header.point_bytes + len(head)
                sizes = (
                    struct.unpack(f"<{layers}I", head[4:]) if len(head) > 4 * layers else (size,)
                )
                if used + sum(sizes) > chunk_bytes:
                    raise ScanError(f"{path} has a damaged chunk at {place}.")
            place += chunk_bytes
    if points < header.points:
        raise ScanError(f"{path} declares {header.points} points, its chunks hold {points}.")


def _layers(path: Path, record: bytes) -> int:
    """Number of the layers of a chunk, from the record of the compression."""
    layers = 0
    for nth in range(struct.unpack_from("<H", record, 32)[0]):
        item, width, _ = struct.unpack_from("<HHH", record, 34 + 6 * nth)
        if item not in LAYERS_OF_ITEM and item != EXTRA_BYTES:
            raise ScanError(f"{path} has points with parts of the unknown kind {item}.")
        layers += LAYERS_OF_ITEM.get(item, width)
    return layers
