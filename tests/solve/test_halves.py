"""Numbers of half precision, looked up by their bits."""

import numpy as np

from dsl_core.solve.halves import squares_of_halves


def test_every_half_is_found_by_its_bits() -> None:
    some = np.array([0.0, -1.5, 0.333, 6e-8, 65504.0, np.inf, np.nan], np.float16)
    found = squares_of_halves()[some.view(np.uint16)]
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, some.astype(np.float32) ** 2)
