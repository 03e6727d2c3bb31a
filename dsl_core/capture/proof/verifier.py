"""Judges every picture of a scan as it comes, by what the pictures before it showed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.first_lines import judge_line
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.judging.later_pictures import LaterPictures
from dsl_core.capture.proof.late_colour import late_colour
from dsl_core.capture.proof.lines.bright_black import BrightBlack
from dsl_core.capture.proof.lines.hidden import HiddenParts
from dsl_core.capture.proof.lines.neighbours import LineNeighbours
from dsl_core.capture.proof.lines.passing_light import PassingLight
from dsl_core.capture.proof.raster import Counts
from dsl_core.capture.proof.row_copies import has_row_copies
from dsl_core.capture.proof.scene_check import SceneCheck
from dsl_core.capture.proof.sentinel import SentinelProof
from dsl_core.capture.proof.whole_scan import WholeScan
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import CapturePlan, GrayCode, Shot
from dsl_core.model.rig import Rig

#: Stripes of a Gray code that blur, scaling and trembling change while wider ones look right: so many pairs.
FINEST = 3


class FrameProof:
    """Judges the shots of a plan one after the other; coarse, and quick enough to keep up with any camera.

    Pictures that are found wrong are forgotten, so that those after them are judged by right ones only. Shots
    may be judged again when they were taken again, and in any order. ``scene`` compares pictures captured
    again with the first ones, and ``whole`` says what only all of them together show.
    """

    def __init__(
        self,
        plan: CapturePlan,
        calibration: Rig | None = None,
        bit_depth: int = 12,
        bayer: str = "RGGB",
        at_the_end: bool = False,
        knows_light: bool = True,
    ) -> None:
        """Without ``calibration``, camera and projector are taken to be usual ones.

        ``at_the_end``: nothing will be taken again, so the first code is judged once all of it is there.
        Without ``knows_light``, the calibration does not say how bright pictures are.
        """
        self._known = known = Known(plan, calibration, bit_depth, bayer, at_the_end, knows_light)
        self.scene, self.whole = SceneCheck(known), WholeScan(known)
        #: What the last picture said of the pairs of the first code, one by one.
        self.reviewed: list[Finding] = []
        self._later = LaterPictures(known)
        self._channels = known.raster.channels(known.bayer)
        self._sentinels = SentinelProof(known.noise, known.raster, self._channels)
        self._bright_black = BrightBlack(known.noise)
        self._hidden = HiddenParts(known.noise)
        self._passing = PassingLight(known)
        #: What the last picture said of lines before it that seem to have had light of their own.
        self.passed: Finding | None = None
        self._neighbours = LineNeighbours(known.noise, known.raster.shape[1])
        self._last: tuple[Shot, Counts] | None = None
        #: The picture that came for two patterns, for as long as it comes.
        self._repeated: Counts | None = None

    def judge(self, shot: Shot, pixels: NDArray[np.uint16]) -> Finding:
        """What the raw mosaic of a shot shows; remembers it for the shots after it, unless it is wrong."""
        if has_row_copies(pixels) and not self.whole.has_no_noise():
            return Finding(shot, Verdict.ROWS_TWICE, (shot,))
        return self.judge_raster(shot, self._known.raster.take(pixels))

    def judge_raster(self, shot: Shot, seen: Counts) -> Finding:
        """The same of what a `Raster` takes of a mosaic."""
        if shot.role in ("white", "code"):
            self._known.noise.find_end(seen, self._channels)
        found = self._unless_repeated(self._judge(shot, seen), seen)
        if shot.role == "spectral" and not found.is_wrong:
            wrong = self._unless_black_is_bright(found, seen) or self._unless_hidden(found, seen)
            # A doubt asks for a second picture.
            found = wrong or (found if self._known.at_the_end else self._with_doubt(found, seen))
        is_line = shot.role == "spectral" and not found.is_wrong
        self.passed = self._passing.judge(shot, seen) if is_line else None
        self._last = (shot, seen)
        self._known.remember(shot, seen, found.again, found.verdict is Verdict.RIGHT)
        return found

    def differ(self, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> bool:
        """Whether two pictures of one shot of lines, as raw mosaics, show different patterns."""
        raster = self._known.raster
        return self._neighbours.differ(raster.take(one), raster.take(other))

    def late_colour(self, shot: Shot, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> str:
        """The colour of a picture that shows the pattern before, unlike another one of its shot; or "".

        Both are raw mosaics.
        """
        known = self._known
        before, black = known.kept.get(shot.index - 1), known.black(shot)
        if before is None or black is None:
            return ""
        seen, wanted = known.raster.take(one), known.raster.take(other)
        return late_colour(seen, wanted, before, black, known.raster.channels(known.bayer), known.noise)

    def is_past(self, pixels: NDArray[np.uint16]) -> bool:
        """Whether the first of the lines `passed`, whose raw mosaic this is, has that light no longer."""
        return self._passing.is_past(self._known.raster.take(pixels))

    def is_alone(self, found: Finding) -> bool:
        """Whether nothing tells a line: neither its columns, which are not seen, nor lines before it."""
        is_line = found.shot.role == "spectral" and self._known.black(found.shot) is not None
        return is_line and found.verdict is Verdict.UNTOLD and self._neighbours.are_few

    def differ_at_first(self, shot: Shot, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> bool:
        """Whether two pictures of such a line, as raw mosaics, differ by more than noise and flicker."""
        known = self._known
        black = known.kept[known.blacks[shot.setting]]
        return self._neighbours.differ_at_first(known.raster.take(one), known.raster.take(other), black)

    def lines_before(self, shot: Shot) -> tuple[Shot, ...]:
        """Lines before a shot whose pictures were believed."""
        known = self._known
        before = known.shots[: shot.index]
        return tuple(each for each in before if each.role == "spectral" and each.index in known.kept)

    def believe_light(self, shot: Shot) -> None:
        """Take the light of a shot for usual from now on, though it was unlike the pictures before."""
        self._known.learned.steps.believe(shot)

    def is_told(self, shot: Shot) -> bool:
        """Whether a picture of the first code, which said nothing by itself, fits the others by now."""
        is_of_code = shot.setting == self._known.first and shot.role in ("code", "white", "black")
        return is_of_code and self._known.lit is not None

    @property
    def past(self) -> tuple[str, ...]:
        """What pictures that are no part of the scan, or no longer, have shown to be wrong, in sentences."""
        return tuple(each for each in (self._settled, self.scene.levels, self.scene.unsettled) if each)

    @property
    def unproven(self) -> str:
        """That no picture could be judged by the code, in a sentence; empty while that may still be."""
        known = self._known
        if known.first < max(known.plan.code_settings) or known.code is None or not known.code.says_nothing:
            return ""
        return (
            "Whether pictures show their patterns could not be told: at no setting with the code is white"
            " neither lost in noise nor saturated. Choose other exposures or levels."
        )

    @property
    def _settled(self) -> str:
        """That the light changed while the first code was captured, of which no frame shows it any more."""
        ratio = 1.0 if self._known.code is None else self._known.code.settled
        if ratio == 1:
            return ""
        return (
            f"The first pictures of the code had {ratio:.2f} times the light of those since, and were"
            " captured again. If the light was as calibrated at first, reflectances are off by as much: let"
            " the projector warm up for longer, keep the light of the room as it is, and switch automatic"
            " exposure and gain of the camera, and night mode of projector and computer, off."
        )

    def recall(self, shot: Shot, why: str) -> None:
        """Take over, from ``why`` an earlier run captured a shot again, what no frame shows any more."""
        if self._known.code is not None and shot.setting == self._known.first:
            self._known.code.recall(shot, why)

    @property
    def first_setting(self) -> int:
        """The setting whose code is judged by itself."""
        return self._known.first

    def are_finest(self, shots: Sequence[Shot]) -> bool:
        """Whether shots are of the finest `FINEST` pairs of a Gray code's columns or rows, and no others."""
        plan = self._known.plan
        if not isinstance(plan.code, GrayCode) or any(shot.role != "code" for shot in shots):
            return False
        columns, rows = plan.code_bits
        fine = {
            *range(columns - FINEST, columns),
            *range(max(columns, columns + rows - FINEST), columns + rows),
        }
        return bool(shots) and {shot.pattern // 2 for shot in shots} <= fine

    def is_at_first_level(self, shot: Shot) -> bool:
        """Whether a shot drives the projector at the level of the first code."""
        return shot.level == self._known.plan.settings[self._known.first].level

    @property
    def lacking_pairs(self) -> tuple[int, ...]:
        """Pairs of the first code that are not there or were found wrong."""
        return self._known.code.lacking if self._known.code is not None else ()

    def substitute(self, number: int, pair: tuple[Counts, Counts]) -> None:
        """Take a pair of another setting for one of the first code, for the columns alone."""
        if self._known.code is not None:
            self._known.code.substitute(number, pair)

    def _judge(self, shot: Shot, seen: Counts) -> Finding:
        known, before = self._known, self._last[1] if self._last is not None else None
        self.reviewed = []
        if known.leave_code(shot):
            self._later = LaterPictures(known)
        if shot.role == "sentinel":
            return self._judge_sentinel(shot, seen)
        if known.code is not None and shot.setting == known.first and shot.role != "spectral":
            found = known.code.add(shot, seen, before)
            self.reviewed = known.code.reviewed
            return found
        if known.lit is None:
            return Finding(shot, Verdict.UNTOLD)
        if shot.setting == known.first:
            return judge_line(known, shot, seen)
        return self._later.judge(shot, seen)

    def _judge_sentinel(self, shot: Shot, seen: Counts) -> Finding:
        known = self._known
        places = [shot.pattern, known.blacks[shot.setting], known.whites.get(shot.setting, -1)]
        before = known.plan.original(known.shots[shot.index - 1])
        old, black, white = (known.kept.get(place) for place in places)
        rivals = [self._later.expected.earlier(before), black, white]
        return self._sentinels.judge(shot, seen, old, black, [each for each in rivals if each is not None])

    def _unless_repeated(self, found: Finding, seen: Counts) -> Finding:
        """A finding, or that the picture is one that came before for another pattern."""
        shot, before, code = found.shot, self._last, self._known.code
        if before is not None and np.array_equal(seen, before[1]):
            if found.is_wrong:
                found = Finding(shot, Verdict.REPEATED, found.again)
            elif self._must_differ(before[0], shot) and seen.min() != seen.max():
                self._repeated = seen
        if self._repeated is not None and not found.is_wrong:
            if np.array_equal(seen, self._repeated):
                if code is not None and shot.setting == self._known.first:
                    code.forget(shot)
                return Finding(shot, Verdict.REPEATED, (shot,))
            self._repeated = None
        return found

    def _must_differ(self, before: Shot, shot: Shot) -> bool:
        """Whether two shots of the first code show patterns whose pictures cannot be equal, noise included.

        Once all pairs are there, they are judged together.
        """
        known = self._known
        ours = known.code is not None and shot.setting == known.first and not known.at_the_end
        return ours and before.index != shot.index and {before.role, shot.role} <= {"white", "black", "code"}

    def _unless_black_is_bright(self, found: Finding, seen: Counts) -> Finding | None:
        """That black and the first line have changed places, as this line and those before it show."""
        known, setting = self._known, found.shot.setting
        black = known.black(found.shot)
        if black is None or not self._bright_black.is_told(setting, seen, black):
            return None
        at = known.blacks[setting]
        again = tuple(each for each in known.shots[at : at + 2] if each.role != "sentinel")
        return Finding(found.shot, Verdict.OTHER, again, "black is brighter than the lines after it")

    def _unless_hidden(self, found: Finding, seen: Counts) -> Finding | None:
        """That something has come before a part of the scene or of its light."""
        shot, known = found.shot, self._known
        black = known.black(shot)
        if black is None or not self._hidden.is_hidden(shot.setting, seen, black):
            return None
        channels, columns = known.raster.channels(known.bayer), known.raster.shape[1]
        colours = self._hidden.colours(seen, black, channels, columns)
        if colours:
            named = " and ".join(COLOUR_NAMES[each] for each in colours)
            return Finding(shot, Verdict.COLOURS, (shot,), f"only {named}")
        return Finding(shot, Verdict.HIDDEN, (shot,))

    def _with_doubt(self, found: Finding, seen: Counts) -> Finding:
        """A finding on a line; doubtful if it cannot be told and is unlike its neighbours."""
        is_odd = self._neighbours.is_doubtful(found.shot.index, seen, self._known.black(found.shot))
        is_odd &= found.verdict is Verdict.UNTOLD
        return replace(found, is_doubtful=found.is_doubtful or is_odd)
