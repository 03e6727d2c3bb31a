"""How long the reconstruction of a scan will take, by what the last one took on this computer. No Qt."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.shared.notify import describe_seconds

#: Time that a pixel takes on two cores of a laptop, before one was computed here, µs.
USUAL_US_PER_PX = 80.0
#: What a picture of any size takes: a small one says little of the pace.
START_S = 3.0
#: A pace beyond these was disturbed, or is that of a scan without spectra, µs.
LEAST_US_PER_PX, MOST_US_PER_PX = 5.0, 20_000.0


class Pace:
    """Microseconds that a pixel takes; ``keep`` is told each pace that was measured, for later sessions."""

    def __init__(
        self, us_per_px: float = USUAL_US_PER_PX, keep: Callable[[float], object] = lambda _: None
    ) -> None:
        self._us_per_px, self._keep = us_per_px or USUAL_US_PER_PX, keep

    def expected_s(self, size_px: tuple[int, int]) -> float:
        """Seconds for a picture of a width and height.

        >>> round(Pace().expected_s((890, 580)))
        44
        """
        return START_S + 1e-6 * self._us_per_px * size_px[0] * size_px[1]

    def learn(self, size_px: tuple[int, int], seconds: float) -> None:
        """Take what a reconstruction took."""
        us_per_px = 1e6 * (seconds - START_S) / (size_px[0] * size_px[1])
        if LEAST_US_PER_PX <= us_per_px <= MOST_US_PER_PX:
            self._us_per_px = us_per_px
            self._keep(us_per_px)


def about(seconds: float) -> str:
    """A time that is only roughly known, in words.

    >>> about(4.0), about(44.0), about(155.0)
    ('a few seconds', 'about 40 s', 'about 3 min')
    """
    return "a few seconds" if seconds < 8 else f"about {describe_seconds(max(round(seconds, -1), 10))}"
