"""What none beats in both cost and error, against every pair compared."""

from __future__ import annotations

import numpy as np

from dsl_core.solve.front import front


def test_the_front_is_what_no_other_point_beats() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        points = [(float(a), float(b)) for a, b in rng.integers(0, 6, (9, 2))]
        kept = front(points)
        assert [points[i] for i in kept] == sorted(
            {p for p in points if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)}
        )


def test_of_equal_points_the_first_is_kept() -> None:
    assert front([(1.0, 1.0), (1.0, 1.0), (2.0, 1.0)]) == [0]
    assert front([]) == []
