"""Pictures of white lines, kept: a plan shows each line at every setting, with other light alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
#: Start and stop of a line, px; None for black.
Edges = tuple[float, float] | None
#: Room for the 320 lines of the published plan in a quarter of its picture; of more, the first are kept.
MOST_BYTES = 192 << 20


class KeptLines:
    """Pictures (rows, columns) by the edges of their line, as many as there is room for."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        """Of no line yet."""
        self._kept: dict[Edges, Floats] = {}
        self._left_bytes = most_bytes

    def of(self, line: Edges, render: Callable[[], Floats]) -> Floats:
        """The picture of a line, which is not to be changed; rendered unless it is kept."""
        found = self._kept.get(line)
        if found is None:
            found = render()
            if found.nbytes <= self._left_bytes:
                found.flags.writeable = False
                self._kept[line] = found
                self._left_bytes -= found.nbytes
        return found
