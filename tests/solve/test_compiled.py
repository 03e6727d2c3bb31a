"""Compiled loops work where their machine code cannot be kept."""

from collections.abc import Callable
from typing import Any

import numpy as np

from dsl_core.solve.compiled import compiled

#: As in a bundle or a container that only reads: numba finds no place for a function without a file.
_SOURCE = """
def total(values):
    found = 0.0
    for value in values:
        found += value
    return found
"""


def test_a_function_that_cannot_be_kept_is_compiled_all_the_same() -> None:
    names: dict[str, Any] = {}
    exec(compile(_SOURCE, "<nowhere>", "exec"), names)
    total: Callable[..., float] = compiled(names["total"])
    assert total(np.arange(4.0)) == 6.0
    assert np.isnan(total(np.array([1.0, np.nan])))
