"""JSON that carries its own checksum as its last field, so that a flipped bit is never read as a value.

``{"a": 1, "checksum": "crc32:6d2f1c9e"}``: CRC-32 of everything before the field, line ends as in Unix. Files
without one, written by hand or by an earlier version, are read unchecked.
"""

from __future__ import annotations

import re
import zlib

_PARTS = (b'"checksum"', b'"crc32:')
#: The last field of an object, with the comma before it.
_TAIL = re.compile(rb',?\s*"checksum":\s?"crc32:([0-9a-f]{8})"\s*\}\s*\Z')
#: No tail is longer, whatever white space an editor puts in.
_LONGEST_TAIL = 120


class SealError(ValueError):
    """Why sealed text cannot be believed, as the end of a sentence."""


def seal(text: str) -> bytes:
    """The JSON of an object with its checksum, indented as the object is."""
    body = text.rstrip().removesuffix("}").rstrip()
    comma = "," if body != "{" else ""
    digits = f"{_crc(body.encode()):08x}"
    if "\n" in body:
        indent = re.search(r"\n( *)", body)
        assert indent is not None
        return f'{body}{comma}\n{indent[1]}"checksum": "crc32:{digits}"\n}}\n'.encode()
    return f'{body}{comma}"checksum":"crc32:{digits}"}}\n'.encode()


def unseal(data: bytes) -> bytes:
    """The JSON without its checksum; raises `SealError` when it does not match.

    Data without a checksum are returned as they are.
    """
    found = _tail(data)
    if found is None:
        if any(part in data[-_LONGEST_TAIL:] for part in _PARTS):
            raise SealError("its checksum is damaged")
        return data
    body = data[: len(data) - len(found[0])]
    if _crc(body) != int(found[1], 16):
        raise SealError("its content does not match its checksum")
    return body + b"}"


def is_sealed(data: bytes) -> bool:
    """Whether data end with a checksum."""
    return _tail(data) is not None


def _tail(data: bytes) -> re.Match[bytes] | None:
    return _TAIL.search(data[-_LONGEST_TAIL:])


def _crc(body: bytes) -> int:
    # Version control and editors change the ends of lines, which is no damage.
    return zlib.crc32(body.replace(b"\r\n", b"\n"))
