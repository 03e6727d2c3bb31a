"""Whether devices and scene are as they were: pictures of the code, captured again, beside the first ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.contest import vote
from dsl_core.capture.proof.control import choose_pairs, edges_moved, is_same, is_unchanged
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.lasting.levels import at_half_level, doubt_of_levels
from dsl_core.model.plan import Shot
from dsl_core.patterns.images import pattern_image

#: Pixels say on average that a pattern is mirrored: 1 if all of them do.
MIRRORED = 0.5
#: What white may have of its first light, and of that shown for longer, as a share.
UNSETTLED = 0.03
#: Two more exposures cost little in plans of so many shots.
MANY_SHOTS = 100
Mosaic = NDArray[np.uint16]


class SceneCheck:
    """Names pictures to capture again, and compares them with what they showed at first."""

    def __init__(self, known: Known) -> None:
        """``known`` grows as pictures come."""
        self._known = known
        #: What white at half its level contradicts of the calibration, which no frame of the scan shows.
        self.levels = ""
        #: How white differs when it is shown for longer, which no frame of the scan shows either.
        self.unsettled = ""

    def controls(self) -> tuple[Shot, ...]:
        """Shots that show whether devices and scene are as they were; none before the first code."""
        known = self._known
        numbers = choose_pairs(known.code_pairs(), known.raster.shape)
        return tuple(known.shots[known.places["code", 2 * number]] for number in numbers)

    def is_as_before(self, control: Shot, pixels: Mosaic) -> bool:
        """Whether a raw mosaic of the shot that `controls` named shows what it showed at first."""
        known = self._known
        return is_same(known.raster.take(pixels), known.kept[control.index], known.code_pairs(), known.noise)

    def shows_mirrored(self, control: Shot, pixels: Mosaic) -> bool:
        """Whether a raw mosaic of it shows its pattern the other way round, by columns that pixels see."""
        lit, image = self._known.lit, pattern_image(self._known.plan, control)
        is_lit = image.reshape(*image.shape[:2], -1).max(2) > 0
        if lit is None or not (is_lit == is_lit[0]).all():
            return False
        column = lit.key // 3
        apart = is_lit[0][column] != is_lit[0][::-1][column]
        seen = self._known.raster.take(pixels)[lit.index[apart]].astype(np.float32)
        black, contrast = lit.black[apart], lit.contrast[apart]
        is_mirrored = black + contrast * is_lit[0][::-1][column[apart]]
        found = vote(seen, is_mirrored, black + contrast * is_lit[0][column[apart]])
        return found.is_told and found.mean > MIRRORED

    def is_unchanged(self, control: Shot, pixels: Mosaic) -> bool:
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

    def is_displaced(self, first: Shot, pixels: Mosaic) -> bool:
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

    def see_settled(self, white: Shot, pixels: Mosaic, take: Callable[[Shot, bool], Mosaic]) -> None:
        """Where ``white``, taken again as a sentinel, has other light than at first, see if it is a habit.

        ``take`` captures a shot, shown for longer if it is told so. Light that comes back while white stays,
        and is gone again after a dark picture, depends on the picture before; kept as ``unsettled``. Raises
        what ``take`` raises.
        """
        known = self._known
        first = known.plan.original(white)
        old, black = known.kept.get(first.index), known.black(first)
        if self.unsettled or first.role != "white" or old is None or black is None:
            return

        def light(mosaic: Mosaic) -> float:
            seen = known.raster.take(mosaic)
            sound = np.maximum(seen, old) < known.noise.sensor.full_scale_dn
            now, before = (float((each.astype(np.float64) - black)[sound].sum()) for each in (seen, old))
            return now / before if before > 0 else 1.0

        once = light(pixels)
        if abs(once - 1) < UNSETTLED:
            return
        longer = light(take(white, True))
        take(known.shots[known.blacks[first.setting]], False)
        again = light(take(white, False))
        if abs(longer - once) < UNSETTLED or abs(again - once) > abs(longer - once) / 3:
            return
        self.unsettled = (
            f"White, shown after a dark picture, has {once / longer:.2f} times the light that it has once it"
            " is shown for longer: projector, computer or camera mix pictures with those before them (noise"
            " reduction over time, blended frames, overdrive), or an iris follows them. Lines are off by"
            " about as much. Switch that off, and scan again."
        )
