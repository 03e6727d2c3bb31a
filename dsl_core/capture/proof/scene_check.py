"""Whether devices and scene are as they were: pictures of the code, captured again, beside the first ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.control import choose_pairs, edges_moved, is_same, is_unchanged
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.lasting.levels import at_half_level, doubt_of_levels
from dsl_core.model.plan import Shot

#: Two more exposures cost little in plans of so many shots.
MANY_SHOTS = 100


class SceneCheck:
    """Names pictures to capture again, and compares them with what they showed at first."""

    def __init__(self, known: Known) -> None:
        """``known`` grows as pictures come."""
        self._known = known
        #: What white at half its level contradicts of the calibration, which no frame of the scan shows.
        self.levels = ""

    def controls(self) -> tuple[Shot, ...]:
        """Shots that show whether devices and scene are as they were; none before the first code."""
        known = self._known
        numbers = choose_pairs(known.code_pairs(), known.raster.shape)
        return tuple(known.shots[known.places["code", 2 * number]] for number in numbers)

    def is_as_before(self, control: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether a raw mosaic of the shot that `controls` named shows what it showed at first."""
        known = self._known
        return is_same(known.raster.take(pixels), known.kept[control.index], known.code_pairs(), known.noise)

    def shows_inverse(self, control: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether a raw mosaic of it shows what the inverse of its pattern showed at first."""
        known = self._known
        before = known.kept.get(known.places.get(("code", control.pattern ^ 1), -1))
        seen = known.raster.take(pixels)
        return before is not None and is_same(seen, before, known.code_pairs(), known.noise)

    def is_unchanged(self, control: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether it does in the same light and contrast; False where its first picture is not known.

        So it is for other pictures than those of the code: white does not show that something moved.
        """
        known = self._known
        before = known.kept.get(control.index)
        if before is None or known.shots[control.index].role != "code":
            return False
        return is_unchanged(known.raster.take(pixels), before, known.code_pairs(), known.noise)

    def first_pictures(self) -> tuple[Shot, ...]:
        """The pictures of the first code to look at again, once that is whole; none in plans without one.

        The very first one has an edge or two, which may fall between pixels, so that in plans of many shots
        the first pictures of the next pairs are among them.
        """
        known = self._known
        if known.lit is None:
            return ()
        patterns = (0, 2, 4) if len(known.shots) >= MANY_SHOTS else (0,)
        places = (known.places.get(("code", pattern), -1) for pattern in patterns)
        return tuple(known.shots[place] for place in places if place in known.kept)

    def code_after(self, first: Shot) -> tuple[Shot, ...]:
        """The shots of the first code, its white and its black that are captured after a shot."""
        known = self._known
        own = (each for each in known.shots if each.setting == known.first and each.role != "sentinel")
        return tuple(each for each in own if each.role != "spectral" and each.index > first.index)

    def is_displaced(self, first: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether a raw mosaic of one of the `first_pictures` shows its pattern elsewhere than at first."""
        known = self._known
        seen, before = known.raster.take(pixels), known.kept[first.index]
        return edges_moved(seen, before, known.code_pairs(), known.noise, known.raster.shape)

    def whites(self) -> tuple[Shot, Shot] | None:
        """White of the first code, and white at half its level, by which `compare_whites` knows the levels.

        None before that white is there, and without a calibration.
        """
        known = self._known
        white = known.places.get(("white", 0), -1)
        if known.calibration is None or not known.knows_light or known.ends(known.first) is None:
            return None
        return known.shots[white], at_half_level(known.shots[white])

    def compare_whites(self, dim: NDArray[np.uint16], white: NDArray[np.uint16] | None = None) -> bool:
        """Whether a raw mosaic of white at half its level has the light that the calibration says.

        ``white`` is one at its full level, or else that of the scan. What is wrong is kept as ``levels``.
        """
        known = self._known
        ends = known.ends(known.first)
        if known.calibration is None or ends is None:
            return True
        bright = ends[0] if white is None else known.raster.take(white)
        self.levels = doubt_of_levels(
            bright,
            ends[1],
            known.raster.take(dim),
            known.plan.settings[known.first].level,
            known.calibration.projector_response,
            known.raster.channels(known.bayer),
            known.noise,
        )
        return not self.levels
