"""Compiled loops work where their machine code cannot be kept."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dsl_core.solve.compiled import compiled, compiled_for

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


def test_a_function_for_given_types_is_compiled_once_for_them_and_for_no_others() -> None:
    names: dict[str, Any] = {}
    exec(compile(_SOURCE, "<nowhere>", "exec"), names)
    total: Any = compiled_for("float64(float64[:])")(names["total"])
    values = np.arange(8.0)
    assert total(values) == 28.0
    assert total(values[::2]) == 12.0
    assert len(total.signatures) == 1
    with pytest.raises(TypeError, match="No matching definition"):
        total(np.array([1 + 2j]))
