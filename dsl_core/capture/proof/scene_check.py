"""Whether devices and scene are as they were: pictures of the code, captured again, beside the first ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.contest import vote
from dsl_core.capture.proof.control import choose_pairs, edges_moved, is_same, is_unchanged
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.lasting.levels import at_half_level, doubt_of_levels
from dsl_core.capture.proof.lasting.settled_light import LEAST_CHANGE, change_of_light, unsettled_sentence
from dsl_core.model.plan import Shot
from dsl_core.patterns.images import pattern_image

#: Pixels say on average that a pattern is mirrored: 1 if all of them do.
MIRRORED = 0.5
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
        numbers = choose_pairs(known.code_pairs(), known.raster.shape, known.noise)
        return tuple(known.shots[known.places["code", 2 * number]] for number in numbers)

    def is_as_before(self, control: Shot, pixels: Mosaic) -> bool:
        """Whether a raw mosaic of the shot that `controls` named shows what it showed at first."""
        known = self._known
        return is_same(known.raster.take(pixels), known.kept[control.index], known.code_pairs(), known.noise)

    def repeats(
        self, shots: Sequence[Shot], before: Mapping[Shot, Mosaic], now: Mapping[Shot, Mosaic]
    ) -> bool:
        """Whether raw mosaics of whole pairs of the first code show the same ``before`` and ``now``."""
        known = self._known
        are_ours = all(shot.role == "code" and shot.setting == known.first for shot in shots)
        if not are_ours or not set(shots) <= before.keys() & now.keys():
            return False
        take = known.raster.take
        both = {shot.index: (take(before[shot]), take(now[shot])) for shot in shots}
        return all(is_same(seen, old, both, known.noise) for old, seen in both.values())

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
        """Whether it does in the same light and contrast; False where that of the first code is not known.

        So it is for other pictures than those of the code: white does not show that something moved.
        """
        known = self._known
        before = known.kept.get(control.index)
        first = known.shots[control.index]
        if before is None or first.role != "code" or first.setting != known.first:
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
        channels = known.raster.channels(known.bayer)
        return edges_moved(seen, before, known.code_pairs(), known.noise, known.raster.shape, channels)

    def whites(self) -> tuple[Shot, Shot, Shot] | None:
        """White of the first code, that at half its level, and black, by which `compare_whites` knows levels.

        None before they are there, and without a calibration.
        """
        known = self._known
        white = known.places.get(("white", 0), -1)
        if known.calibration is None or not known.knows_light or known.ends(known.first) is None:
            return None
        return known.shots[white], at_half_level(known.shots[white]), known.shots[known.places["black", 0]]

    def compare_whites(self, dim: Mosaic, now: tuple[Mosaic, Mosaic] | None = None) -> bool:
        """Whether a raw mosaic of white at half its level has the light that the calibration says.

        ``now`` are white at its full level and black of the same time, or else those of the scan count. What
        is wrong is kept as ``levels``.
        """
        known = self._known
        ends = known.ends(known.first)
        if known.calibration is None or ends is None:
            return True
        bright, black = ends if now is None else (known.raster.take(each) for each in now)
        self.levels = doubt_of_levels(
            bright,
            black,
            known.raster.take(dim),
            known.plan.settings[known.first].level,
            known.calibration.projector_response,
            known.raster.channels(known.bayer),
            known.noise,
        )
        return not self.levels

    def see_mixed(self, take: Callable[[Shot, bool], Mosaic]) -> str:
        """That the first black holds light of white that is gone once it is shown for longer; or "".

        All pictures then have something of those before them. ``take`` is that of `see_settled`, and what is
        found is kept as ``unsettled``. Raises what ``take`` raises.
        """
        known = self._known
        ends = known.ends(known.first)
        if self.unsettled or ends is None:
            return ""
        white, black = (known.shots[known.places[role, 0]] for role in ("white", "black"))
        full_dn = known.noise.sensor.full_scale_dn

        def change(mosaic: Mosaic) -> float:
            return change_of_light(known.raster.take(mosaic), ends, "black", full_dn)

        longer = change(take(black, True))
        if longer > -LEAST_CHANGE["black"]:
            return ""
        take(white, False)
        self.unsettled = unsettled_sentence("black", 0.0, longer, change(take(black, False)))
        return self.unsettled

    def see_settled(self, again: Shot, pixels: Mosaic, take: Callable[[Shot, bool], Mosaic]) -> None:
        """Where white or black, taken ``again`` as a sentinel, has changed, see if that is a habit.

        ``take`` captures a shot, shown for longer if it is told so. What that shows is kept as ``unsettled``.
        Raises what ``take`` raises.
        """
        known = self._known
        ends, role = known.ends(known.first), known.plan.original(again).role
        if self.unsettled or ends is None or role not in LEAST_CHANGE or again.setting != known.first:
            return

        def change(mosaic: Mosaic) -> float:
            return change_of_light(known.raster.take(mosaic), ends, role, known.noise.sensor.full_scale_dn)

        once = change(pixels)
        if abs(once) < LEAST_CHANGE[role]:
            return
        longer = change(take(again, True))
        take(known.shots[known.places["black" if role == "white" else "white", 0]], False)
        self.unsettled = unsettled_sentence(role, once, longer, change(take(again, False)))
