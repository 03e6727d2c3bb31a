"""Whether the parts of a PNG fit in it: decoders reserve the memory that a part declares, then read it."""

from __future__ import annotations

from dsl_core.io.reading import FileParts

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def declares_too_much(png: bytes | FileParts) -> bool:
    """Whether a part says that it is longer than the rest of the file (specification, 5.3) in a PNG."""
    if png[: len(SIGNATURE)] != SIGNATURE:
        return False
    at = len(SIGNATURE)
    while at + 8 <= len(png):
        at += 12 + int.from_bytes(png[at : at + 4], "big")
    return at > len(png)
