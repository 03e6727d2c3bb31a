from __future__ import annotations

import numpy as np

from dsl_core.model.result import Flag, gravest_flag


def test_the_gravest_flag_wins() -> None:
    flags = np.array([0, int(Flag.NO_LIGHT | Flag.POOR_FIT), int(Flag.POOR_FIT | Flag.NON_FINITE)], np.uint16)
    order = list(Flag)
    assert gravest_flag(flags).tolist() == [
        0,
        1 + order.index(Flag.NO_LIGHT),
        1 + order.index(Flag.NON_FINITE),
    ]
