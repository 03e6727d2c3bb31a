"""Part of a Blosc chunk: the blocks that hold some bytes, as a smaller chunk that any Blosc decompresses.

A chunk is a header, where each block starts, and the blocks, each compressed by itself. Chunk format:
https://github.com/Blosc/c-blosc/blob/main/README_CHUNK_FORMAT.rst
"""

from __future__ import annotations

import struct

import numpy as np

from dsl_core.io.reading import FileParts

Bytes = bytes | FileParts
HEADER = struct.Struct("<BBBBIII")
_IS_COPY = 0x2


def blocks_of(chunk: Bytes, first: int, last: int) -> tuple[bytes, int]:
    """A chunk of the blocks of another one that hold its bytes ``first`` to ``last``.

    With it, where its own first byte is in the whole. Raises ``ValueError`` for one that is not as it says.
    """
    version, codec, flags, typesize, raw, block, size = HEADER.unpack(chunk[: HEADER.size])
    if size != len(chunk) or not 0 <= first < last <= raw or not block:
        raise ValueError("its header does not describe it")
    if flags & _IS_COPY:
        part = chunk[HEADER.size + first : HEADER.size + last]
        head = HEADER.pack(version, codec, flags, typesize, len(part), block, HEADER.size + len(part))
        return head + part, first
    count = -(-raw // block)
    starts = np.frombuffer(chunk[HEADER.size : HEADER.size + 4 * count], "<i4").astype(np.int64)
    if len(starts) < count:
        raise ValueError("its blocks are not where it says")
    low, high = first // block, -(-last // block)
    if low == count - 1:
        # A last block that is shorter than the others is only understood after one of them.
        low = max(low - 1, 0)
    # Several threads may have written the blocks in any order.
    order = np.sort(starts)
    ends = np.append(order, size)[np.searchsorted(order, starts, side="right")]
    if starts.min() < HEADER.size + 4 * count or ends.max() > size:
        raise ValueError("its blocks are not where it says")
    # Read in one go: they are side by side, or nearly so.
    from_byte = starts[low:high].min()
    held = chunk[from_byte : ends[low:high].max()]
    wanted = zip(starts[low:high] - from_byte, ends[low:high] - from_byte, strict=True)
    parts = [held[start:end] for start, end in wanted]
    lengths = np.cumsum([0, *map(len, parts)]) + HEADER.size + 4 * len(parts)
    bytes_here = min(high * block, raw) - low * block
    head = HEADER.pack(version, codec, flags, typesize, bytes_here, block, int(lengths[-1]))
    return b"".join([head, lengths[:-1].astype("<i4").tobytes(), *parts]), low * block
