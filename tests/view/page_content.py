"""A double of the page's decoder: what a page stores, value by value."""

import base64
import json
import re
import struct
import zlib


def unpacked(block: bytes) -> dict[str, list[int]]:
    """The columns of a block, value by value."""
    content = zlib.decompress(block)
    (length,) = struct.unpack_from("<I", content)
    at, columns = 4 + length, {}
    for name, count, planes, by_difference, signed in json.loads(content[4:at]):
        values, last = [], 0
        for i in range(count):
            value = sum(content[at + plane * count + i] << 8 * plane for plane in range(planes))
            if signed:
                value = value // 2 if value % 2 == 0 else -(value + 1) // 2
            last = last + value if by_difference else value
            values.append(last)
        columns[name] = values
        at += planes * count
    assert at == len(content)
    return columns


def parts_of(text: str) -> tuple[dict, dict[str, bytes]]:
    """The JSON of a page, and its binary blocks."""
    content = re.search(r'<script type="application/json" id="page">(.*?)</script>', text, re.S)
    blocks = re.findall(r'<script type="text/plain" id="([a-z]+-\d+)">(.*?)</script>', text, re.S)
    return json.loads(content[1]), {name: base64.b64decode(data) for name, data in blocks}
