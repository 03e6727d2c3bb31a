"""Judges every picture of a scan as it comes, by what the pictures before it showed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_sum import CodeSum, code_sum
from dsl_core.capture.proof.code.first_code import FirstCode
from dsl_core.capture.proof.colour_again import ColourAgain, colour_again
from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.control import choose_pairs, edges_moved, is_same, is_unchanged
from dsl_core.capture.proof.finding import Finding, Light, Verdict, displaced
from dsl_core.capture.proof.lasting.ends import sentences_of_ends
from dsl_core.capture.proof.lasting.pair_places import pair_places
from dsl_core.capture.proof.later_settings import LaterSettings
from dsl_core.capture.proof.light_steps import LightSteps
from dsl_core.capture.proof.lines.bright_black import BrightBlack
from dsl_core.capture.proof.lines.hidden import HiddenParts
from dsl_core.capture.proof.lines.line_place import LinePlaces, contests_of_sides, moved
from dsl_core.capture.proof.lines.line_shown import line_shown
from dsl_core.capture.proof.lines.line_sum import LineSum, line_sum
from dsl_core.capture.proof.lines.local_sum import LocalSum, local_sum
from dsl_core.capture.proof.lines.neighbours import LineNeighbours
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import (
    APART,
    Expected,
    black_gained,
    brightness_of_lines,
    brightness_of_picture,
    contest_of_lines,
    contest_of_pictures,
    contest_of_places,
    is_lit_elsewhere,
    is_over_white,
    line_profile,
)
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.capture.proof.row_copies import has_row_copies
from dsl_core.capture.proof.sentinel import SentinelProof
from dsl_core.capture.proof.usual_light import LEAST_LIGHT, UsualLight
from dsl_core.capture.proof.white_again import WhiteAgain, white_again
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, Role, ScanLines, Shot, describe_shot
from dsl_core.model.rig import Rig

#: Where several rivals won, the picture before is blamed if its votes are nearly as many (their mean), and
#: another place of the same line only if its are more.
NEARLY = 0.3
#: Where a line lights so few pixels, most may see an edge, and vote for nothing.
FEW_VOTES = 60
#: Stripes of a Gray code that blur, scaling and trembling change while wider ones look right: so many pairs.
FINEST = 3
#: Two more exposures cost little in plans of so many shots.
MANY_SHOTS = 100


@dataclass
class Learned:
    """What the pictures so far say of those to come, as far as it follows from their findings."""

    usual: UsualLight
    steps: LightSteps
    places: LinePlaces
    #: Shots of later settings that were found wrong before.
    contested: set[int]

    def copy(self) -> Learned:
        """Another one, which further pictures change alone."""
        return Learned(self.usual.copy(), self.steps.copy(), self.places.copy(), self.contested.copy())


class FrameProof:
    """Judges the shots of a plan one after the other; coarse, and quick enough to keep up with any camera.

    Pictures that are found wrong are forgotten, so that those after them are judged by right ones only. Shots
    may be judged again when they were taken again, and in any order.
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
        self._plan, self._calibration, self._knows_light = plan, calibration, knows_light
        self._shots = tuple(plan.shots())
        self._raster = Raster(plan.camera_size_px)
        self._noise = Noise.of(calibration.sensor if calibration else None, bit_depth)
        self._bayer = calibration.sensor.bayer if calibration else bayer
        self._first = min(plan.code_settings)
        self._places = {(s.role, s.pattern): s.index for s in self._shots if s.setting == self._first}
        self._blacks = {s.setting: s.index for s in self._shots if s.role == "black"}
        self._at_the_end = at_the_end
        self._code = self._first_code()
        self._sentinels = SentinelProof(self._noise, self._raster)
        self._kept: dict[int, Counts] = {}
        self._untold: set[int] = set()
        self._last: tuple[Shot, Counts] | None = None
        #: What the last picture said of the pairs of the first code, one by one.
        self.reviewed: list[Finding] = []
        self._learned = Learned(
            UsualLight(self._first, knows_light and calibration is not None),
            LightSteps(),
            LinePlaces(),
            set(),
        )
        self._later = LaterSettings(
            plan, calibration, self._noise, self._kept, self._black_gained, self._level_of_code
        )
        #: The picture that came for two patterns, for as long as it comes.
        self._repeated: Counts | None = None
        self._profiles: dict[tuple[Role, int], Floats | None] = {}
        self._bright_black = BrightBlack(self._noise)
        self._hidden = HiddenParts(self._noise)
        self._neighbours = LineNeighbours(self._noise, self._raster.shape[1])

    def _first_code(self) -> FirstCode | None:
        plan = self._plan
        # Codes of other programs are imported, complete or not: no frame can be taken again.
        if isinstance(plan.code, NoCode | CapturedCode):
            return None
        own = [s for s in self._shots if s.setting == self._first and s.role in ("code", "white", "black")]
        rises = None if self._calibration is None else self._calibration.pose.matrix[0, 0] > 0
        return FirstCode(
            plan, plan.code, own, self._raster, self._noise, self._bayer, rises, self._at_the_end
        )

    def judge(self, shot: Shot, pixels: NDArray[np.uint16]) -> Finding:
        """What the raw mosaic of a shot shows; remembers it for the shots after it, unless it is wrong."""
        if has_row_copies(pixels):
            return Finding(shot, Verdict.ROWS_TWICE, (shot,))
        return self.judge_raster(shot, self._raster.take(pixels))

    def judge_raster(self, shot: Shot, seen: Counts) -> Finding:
        """The same of what a `Raster` takes of a mosaic."""
        found = self._unless_repeated(self._judge(shot, seen), seen)
        if shot.role == "spectral" and not found.is_wrong:
            wrong = self._unless_black_is_bright(found, seen) or self._unless_hidden(found, seen)
            # A doubt asks for a second picture.
            found = wrong or (found if self._at_the_end else self._with_doubt(found, seen))
        self._remember(found, seen)
        return found

    def differ(self, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> bool:
        """Whether two pictures of one shot of lines, as raw mosaics, show different patterns."""
        return self._neighbours.differ(self._raster.take(one), self._raster.take(other))

    def is_alone(self, found: Finding) -> bool:
        """Whether nothing tells a line: neither its columns, which are not seen, nor lines before it."""
        is_line = found.shot.role == "spectral" and self._blacks[found.shot.setting] in self._kept
        return is_line and found.verdict is Verdict.UNTOLD and self._neighbours.are_few

    def differ_at_first(self, shot: Shot, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> bool:
        """Whether two pictures of such a line, as raw mosaics, differ by more than noise and flicker."""
        black = self._kept[self._blacks[shot.setting]]
        return self._neighbours.differ_at_first(self._raster.take(one), self._raster.take(other), black)

    def believe_light(self, shot: Shot) -> None:
        """Take the light of a shot for usual from now on, though it was unlike the pictures before."""
        self._learned.steps.believe(shot)

    def controls(self) -> tuple[Shot, ...]:
        """Shots that show whether devices and scene are as they were; none before the first code."""
        numbers = choose_pairs(self._code_pairs(), self._raster.shape)
        return tuple(self._shots[self._places["code", 2 * number]] for number in numbers)

    def is_told(self, shot: Shot) -> bool:
        """Whether a picture of the first code, which said nothing by itself, fits the others by now."""
        is_of_code = shot.setting == self._first and shot.role in ("code", "white", "black")
        return is_of_code and self._code is not None and self._code.lit is not None

    def is_as_before(self, control: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether a raw mosaic of the shot that `controls` named shows what it showed at first."""
        before = self._kept[control.index]
        return is_same(self._raster.take(pixels), before, self._code_pairs(), self._noise)

    def is_unchanged(self, control: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether it does in the same light and contrast; False where its first picture is not known.

        So it is for other pictures than those of the code: white does not show that something moved.
        """
        before = self._kept.get(control.index)
        if before is None or self._shots[control.index].role != "code":
            return False
        return is_unchanged(self._raster.take(pixels), before, self._code_pairs(), self._noise)

    def first_pictures(self) -> tuple[Shot, ...]:
        """The pictures of the first code to look at again, once that is whole; none in plans without one.

        The very first one has an edge or two, which may fall between pixels, so that in plans of many shots
        the first pictures of the next pairs are among them.
        """
        if self._code is None or self._code.lit is None:
            return ()
        patterns = (0, 2, 4) if len(self._shots) >= MANY_SHOTS else (0,)
        places = (self._places.get(("code", pattern), -1) for pattern in patterns)
        return tuple(self._shots[place] for place in places if place in self._kept)

    def code_after(self, first: Shot) -> tuple[Shot, ...]:
        """The shots of the first code, its white and its black that are captured after a shot."""
        own = (each for each in self._shots if each.setting == self._first and each.role != "sentinel")
        return tuple(each for each in own if each.role != "spectral" and each.index > first.index)

    def is_displaced(self, first: Shot, pixels: NDArray[np.uint16]) -> bool:
        """Whether a raw mosaic of one of the `first_pictures` shows its pattern elsewhere than at first."""
        seen, before = self._raster.take(pixels), self._kept[first.index]
        return edges_moved(seen, before, self._code_pairs(), self._noise, self._raster.shape)

    def line_sum(self) -> LineSum | None:
        """What all lines of the first setting are together; None while that says nothing."""
        lit = None if self._code is None else self._code.lit
        return None if lit is None else line_sum(self._plan, self._first, self._kept, lit, self._noise)

    def local_sums(self) -> list[LocalSum]:
        """Where lines of each setting do not add up to white though most of the picture does."""
        lit = None if self._code is None else self._code.lit
        if lit is None:
            return []
        settings = range(len(self._plan.settings))
        found = (local_sum(self._plan, n, self._kept, lit, self._noise, self._raster) for n in settings)
        return [each for each in found if each is not None]

    def white_again(self) -> WhiteAgain | None:
        """The white, captured again, that differs most from the first in a part of the picture."""
        return white_again(self._plan, self._kept, self._noise, self._raster)

    def lasting(self, with_colours: bool = True) -> list[str]:
        """Sentences on what was wrong from the first picture on, of the darkest setting that is there.

        Without ``with_colours``, those that a filter before the camera explains are left out.
        """
        found = [
            n for n in {s.setting for s in self._shots if s.role == "white"} if self._ends_of(n) is not None
        ]
        setting = min(found, key=lambda n: self._plan.settings[n].level, default=None)
        ends = None if setting is None else self._ends_of(setting)
        said: list[str] = []
        if ends is not None and setting is not None:
            channels = self._raster.channels(self._bayer)
            said = sentences_of_ends(
                *ends,
                self._plan,
                setting,
                self._calibration if self._knows_light else None,
                channels,
                self._noise,
                self._raster,
                with_colours,
            )
        return [each for each in (*said, self._pair_places()) if each]

    def _ends_of(self, setting: int) -> tuple[Counts, Counts] | None:
        """White and black of a setting, if both are there."""
        own = [s for s in self._shots if s.setting == setting and s.role in ("white", "black")]
        kept = {shot.role: self._kept.get(shot.index) for shot in own}
        white, black = kept.get("white"), kept.get("black")
        return None if white is None or black is None else (white, black)

    def _pair_places(self) -> str:
        lit, code = (None, None) if self._code is None else (self._code.lit, self._plan.code)
        if lit is None or code is None or isinstance(code, NoCode | CapturedCode):
            return ""
        found = pair_places(code, self._plan.projector_size_px, self._code_pairs(), lit)
        return "" if found is None else found.sentence

    def colour_again(self) -> ColourAgain | None:
        """The white, captured again, whose colour differs most from that of the first."""
        return colour_again(self._plan, self._kept, self._noise, self._raster.channels(self._bayer))

    @property
    def settled(self) -> str:
        """That the light changed while the first code was captured, of which no frame shows it any more."""
        ratio = 1.0 if self._code is None else self._code.settled
        if ratio == 1:
            return ""
        return (
            f"The first pictures of the code had {ratio:.2f} times the light of those since, and were"
            " captured again. If the light was as calibrated at first, reflectances are off by as much: let"
            " the projector warm up for longer, and switch automatic exposure and gain of the camera, and"
            " night mode of projector and computer, off."
        )

    def recall(self, shot: Shot, why: str) -> None:
        """Take over, from ``why`` an earlier run captured a shot again, what no frame shows any more."""
        if self._code is not None and shot.setting == self._first:
            self._code.recall(shot, why)

    def code_sum(self) -> CodeSum | None:
        """What patterns and inverses of the first code are together; None while that says nothing."""
        lit = None if self._code is None else self._code.lit
        ends = [self._kept.get(self._places.get((role, 0), -1)) for role in ("white", "black")]
        if lit is None or ends[0] is None or ends[1] is None:
            return None
        return code_sum(self._code_pairs(), (ends[0], ends[1]), lit, self._noise)

    @property
    def first_setting(self) -> int:
        """The setting whose code is judged by itself."""
        return self._first

    def are_finest(self, shots: Sequence[Shot]) -> bool:
        """Whether shots are of the finest `FINEST` pairs of a Gray code's columns or rows, and no others."""
        if not isinstance(self._plan.code, GrayCode) or any(shot.role != "code" for shot in shots):
            return False
        columns, rows = self._plan.code_bits
        fine = {
            *range(columns - FINEST, columns),
            *range(max(columns, columns + rows - FINEST), columns + rows),
        }
        return bool(shots) and {shot.pattern // 2 for shot in shots} <= fine

    def is_at_first_level(self, shot: Shot) -> bool:
        """Whether a shot drives the projector at the level of the first code."""
        return shot.level == self._plan.settings[self._first].level

    @property
    def lacking_pairs(self) -> tuple[int, ...]:
        """Pairs of the first code that are not there or were found wrong."""
        return self._code.lacking if self._code is not None else ()

    def substitute(self, number: int, pair: tuple[Counts, Counts]) -> None:
        """Take a pair of another setting for one of the first code, for the columns alone."""
        if self._code is not None:
            self._code.substitute(number, pair)

    def _code_pairs(self) -> dict[int, tuple[Counts, Counts]]:
        """Pattern and inverse of the first code by the number of the pair, as far as both are there."""
        kept = {n: self._kept.get(at) for (role, n), at in self._places.items() if role == "code"}
        pairs = {n // 2: (one, kept.get(n + 1)) for n, one in kept.items() if n % 2 == 0}
        return {n: (one, other) for n, (one, other) in pairs.items() if one is not None and other is not None}

    # What every picture is asked -------------------------------------------------------------------------

    def _unless_repeated(self, found: Finding, seen: Counts) -> Finding:
        """A finding, or that the picture is one that came before for another pattern."""
        shot, before = found.shot, self._last
        if before is not None and np.array_equal(seen, before[1]):
            if found.is_wrong:
                found = Finding(shot, Verdict.REPEATED, found.again)
            elif self._must_differ(before[0], shot) and seen.min() != seen.max():
                self._repeated = seen
        if self._repeated is not None and not found.is_wrong:
            if np.array_equal(seen, self._repeated):
                if self._code is not None and shot.setting == self._first:
                    self._code.forget(shot)
                return Finding(shot, Verdict.REPEATED, (shot,))
            self._repeated = None
        return found

    def _must_differ(self, before: Shot, shot: Shot) -> bool:
        """Whether two shots of the first code show patterns whose pictures cannot be equal, noise included.

        Once all pairs are there, they are judged together.
        """
        ours = self._code is not None and shot.setting == self._first and not self._at_the_end
        return ours and before.index != shot.index and {before.role, shot.role} <= {"white", "black", "code"}

    def _unless_black_is_bright(self, found: Finding, seen: Counts) -> Finding | None:
        """That black and the first line have changed places, as this line and those before it show."""
        at = self._blacks[found.shot.setting]
        black = self._kept.get(at)
        if black is None or not self._bright_black.is_told(found.shot.setting, seen, black):
            return None
        again = tuple(each for each in self._shots[at : at + 2] if each.role != "sentinel")
        return Finding(found.shot, Verdict.OTHER, again, "black is brighter than the lines after it")

    def _unless_hidden(self, found: Finding, seen: Counts) -> Finding | None:
        """That something has come before a part of the scene or of its light."""
        shot = found.shot
        black = self._kept.get(self._blacks[shot.setting])
        if black is None or not self._hidden.is_hidden(shot.setting, seen, black):
            return None
        channels, columns = self._raster.channels(self._bayer), self._raster.shape[1]
        colours = self._hidden.colours(seen, black, channels, columns)
        if colours:
            named = " and ".join(COLOUR_NAMES[each] for each in colours)
            return Finding(shot, Verdict.COLOURS, (shot,), f"only {named}")
        return Finding(shot, Verdict.HIDDEN, (shot,))

    def _with_doubt(self, found: Finding, seen: Counts) -> Finding:
        """A finding on a line; doubtful if it cannot be told and is unlike its neighbours."""
        black = self._kept.get(self._blacks[found.shot.setting])
        is_odd = self._neighbours.is_doubtful(found.shot.index, seen, black)
        is_odd &= found.verdict is Verdict.UNTOLD
        return replace(found, is_doubtful=found.is_doubtful or is_odd)

    def _remember(self, found: Finding, seen: Counts) -> None:
        """Keep a picture unless it is wrong, and forget those that it has shown to be wrong."""
        shot = found.shot
        self._last = (shot, seen)
        for wrong in found.again:
            self._kept.pop(wrong.index, None)
        if shot not in found.again:
            self._kept[shot.index] = seen
            (self._untold.discard if found.verdict is Verdict.RIGHT else self._untold.add)(shot.index)

    def _judge(self, shot: Shot, seen: Counts) -> Finding:
        before = self._last[1] if self._last is not None else None
        self.reviewed = []
        if shot.role == "sentinel":
            return self._judge_sentinel(shot, seen)
        if self._code is not None and shot.setting == self._first and shot.role != "spectral":
            found = self._code.add(shot, seen, before)
            self.reviewed = self._code.reviewed
            return found
        if self._code is None or self._code.lit is None:
            return Finding(shot, Verdict.UNTOLD)
        if shot.setting == self._first:
            return self._judge_lines(shot, seen)
        return self._judge_again(shot, seen)

    def _judge_sentinel(self, shot: Shot, seen: Counts) -> Finding:
        places = [shot.pattern, self._blacks[self._first], self._places.get(("white", 0), -1)]
        before = self._plan.original(self._shots[shot.index - 1])
        old, black, white = (self._kept.get(place) for place in places)
        rivals = [self._later.earlier(before), black, white]
        return self._sentinels.judge(shot, seen, old, black, [each for each in rivals if each is not None])

    # The lines of the first setting: columns, white and black are known ------------------------------

    def _judge_lines(self, shot: Shot, seen: Counts) -> Finding:
        assert self._code is not None
        lit, wanted = self._code.lit, self._profile(shot)
        if lit is None or wanted is None:
            return Finding(shot, Verdict.UNTOLD)
        share = brightness_of_lines(seen, lit, wanted, self._noise)
        usual = np.float32(self._learned.usual.share(shot))
        rivals = [(verdict, self._profile(rival)) for verdict, rival in self._rivals(shot)]
        rivals += [(Verdict.DARK, np.zeros_like(wanted)), (Verdict.OTHER, np.ones_like(wanted))]
        contests = {
            verdict: contest_of_lines(seen, lit, usual * wanted, usual * rival)
            for verdict, rival in rivals
            if rival is not None
        }
        found = self._decide(shot, contests, share, lambda: self._line_shown(seen, shot))
        if not found.is_wrong and is_lit_elsewhere(seen, lit, wanted):
            return Finding(shot, Verdict.OTHER, (shot,), "it is bright where it should be dark")
        if not found.is_wrong and is_over_white(seen, lit, wanted):
            return Finding(shot, Verdict.OTHER, (shot,), "a part of it is brighter than white")
        wanted = usual * wanted
        places = contests_of_sides(lambda side: contest_of_lines(seen, lit, wanted, moved(wanted, side)))
        return self._in_place(found, contests, places)

    def _in_place(
        self, found: Finding, rivals: Mapping[Verdict, Contest], places: Mapping[int, Contest]
    ) -> Finding:
        """A finding on a line, or that lines are out of their place since some shot.

        ``places`` are contests of the right place with those so many columns away. A line next to its place
        may seem dark, or like the next one, but is more like itself out of place than like any of the
        ``rivals``.
        """
        best = min((each.mean for each in rivals.values() if each.is_told), default=1.0)
        if found.is_wrong and min((each.mean for each in places.values()), default=1.0) > best - NEARLY:
            return found
        told = self._learned.places.judge(found.shot, places, found.is_wrong)
        return found if told is None else displaced(found.shot, told[1], told[0])

    def _profile(self, shot: Shot) -> Floats | None:
        """The `line_profile` of a shot, which is a rival of its neighbours as well, at every setting."""
        shot = self._plan.original(shot)
        key = shot.role, shot.pattern
        if key not in self._profiles:
            self._profiles[key] = line_profile(self._plan, shot)
        return self._profiles[key]

    def _rivals(self, shot: Shot) -> list[tuple[Verdict, Shot]]:
        """The shots whose pattern a picture most likely shows instead."""
        found = []
        if shot.index + 1 < len(self._shots):
            found.append((Verdict.SWAPPED, self._shots[shot.index + 1]))
        if shot.index > 0:
            found.append((Verdict.LATE, self._shots[shot.index - 1]))
        return found

    def _line_shown(self, seen: Counts, shot: Shot) -> Shot | None:
        """The shot of the same setting whose line it is that a picture shows."""
        lit = self._code.lit if self._code is not None else None
        if lit is None:
            return None
        own = [s for s in self._shots if s.setting == shot.setting and s.role != "sentinel"]
        lines = ((each, profile) for each in own if (profile := self._profile(each)) is not None)
        return line_shown(seen, lit, lines, self._plan.projector_size_px[0])

    # Later settings: the same pictures were taken before ------------------------------------------------

    def _judge_again(self, shot: Shot, seen: Counts) -> Finding:
        """A finding by the picture of the first setting, with and without what black has gained since."""
        before = self._learned.copy()
        found = self._judge_later(shot, seen)
        if not found.is_wrong or self._later.gained(shot) == 0:
            return found
        # Only the judgement that is believed counts for what is usual.
        after, self._learned = self._learned, before
        other = self._judge_later(shot, seen, less_gained=False)
        if other.is_wrong:
            self._learned = after
            return found
        return other

    def _judge_later(self, shot: Shot, seen: Counts, less_gained: bool = True) -> Finding:
        later = self._later
        wanted, white = later.expected(shot, shot, less_gained), later.white(shot, less_gained)
        dark = later.black(shot)
        if wanted is None or white is None or dark is None:
            return Finding(shot, Verdict.UNTOLD)
        black = dark.counts
        # Before its own black is there, only what is bright can be relied on.
        has_black = shot.role != "black" and self._blacks[shot.setting] in self._kept
        least = None if has_black else np.float32(APART) * (white.counts - black)
        rivals = [
            (verdict, later.expected(rival, shot, less_gained)) for verdict, rival in self._rivals(shot)
        ]
        rivals += [(Verdict.DARK, dark), (Verdict.OTHER, white)]
        contests = {
            verdict: contest_of_pictures(seen, wanted, rival, black, least, self._noise, self._raster)
            for verdict, rival in rivals
            if rival is not None
        }
        is_judged = has_black or (self._calibration is not None and shot.role != "black")
        share = self._brightness_again(shot, seen, wanted, black) if is_judged else None
        first_of_role = not self._learned.usual.knows(shot)
        found = self._decide(shot, contests, share, lambda: None)
        if shot.role == "spectral" and has_black:
            found = self._in_place(found, contests, self._places_again(shot, seen, wanted, black))
        if found.verdict is Verdict.DISPLACED:
            return found
        if found.is_wrong:
            return self._with_doubtful(found)
        if share is not None and first_of_role and not later.is_measured(shot):
            later.measure(shot, share)
            self._learned.usual.begin(shot)
        return found

    def _places_again(self, shot: Shot, seen: Counts, wanted: Expected, black: Floats) -> dict[int, Contest]:
        """Contests of a line's place with those next to it, from its picture at the first setting."""
        lit = self._code.lit if self._code is not None else None
        profile = self._profile(shot)
        if lit is None or profile is None:
            return {}
        dark = black, self._later.scale(shot)
        profile = np.float32(self._learned.usual.share(replace(shot, setting=self._first))) * profile
        return contests_of_sides(
            lambda side: contest_of_places(
                seen, wanted, lit, dark, (profile, moved(profile, side)), self._noise
            )
        )

    def _level_of_code(self, shot: Shot) -> float:
        """Light of a picture of the first code over that of white; 1 for other shots."""
        if self._code is None or shot.role != "code":
            return 1.0
        return self._code.light.get(shot.pattern // 2, 1.0)

    def _black_gained(self, shot: Shot, seen: Counts) -> np.float32:
        """By how much black was more; 0 where many lines leave no pixel without their first orders."""
        lit = self._code.lit if self._code is not None else None
        one_line = shot.role == "spectral" and isinstance(self._plan.spectral, ScanLines)
        wanted = self._profile(shot) if one_line else None
        return (
            np.float32(0) if lit is None or wanted is None else black_gained(seen, lit, wanted, self._noise)
        )

    def _brightness_again(self, shot: Shot, seen: Counts, wanted: Expected, black: Floats) -> float | None:
        lit = self._code.lit if self._code is not None else None
        profile = self._profile(shot) if shot.role == "spectral" else None
        return brightness_of_picture(seen, wanted, black, self._noise, lit, profile)

    def _with_doubtful(self, found: Finding) -> Finding:
        """Take the picture that a wrong one was compared with again as well, where it may be that one."""
        old = self._places[found.shot.role, found.shot.pattern]
        is_doubtful = old in self._untold or found.shot.index in self._learned.contested
        self._learned.contested.add(found.shot.index)
        if found.shot.role != "spectral" or not is_doubtful:
            return found
        # The black picture just before may have changed places with it: at a setting of little light, nothing
        # tells black from a faint line.
        before = self._shots[old - 1]
        swapped = (before,) if before.role == "black" else ()
        return replace(found, again=(*swapped, self._shots[old], *found.again))

    # What it all says -------------------------------------------------------------------------------------

    def _decide(
        self,
        shot: Shot,
        contests: dict[Verdict, Contest],
        share: float | None,
        name: Callable[[], Shot | None],
    ) -> Finding:
        told = {verdict: contest for verdict, contest in contests.items() if contest.is_told}
        lost = {verdict: contest for verdict, contest in told.items() if contest.is_lost}
        ratio = None if share is None else share / self._learned.usual.share(shot)
        if set(lost) == {Verdict.DARK} and ratio is not None and ratio > LEAST_LIGHT:
            return Finding(shot, Verdict.EXPOSURE, (shot,), f"{ratio:.2g} times what was expected")
        if lost:
            shown = name()
            if shown == shot and all(
                each.count < FEW_VOTES and each.mean > -NEARLY for each in lost.values()
            ):
                return Finding(shot, Verdict.UNTOLD, is_doubtful=True)
            return self._named(shot, lost, shown)
        if any(contest.is_torn for contest in told.values()):
            return Finding(shot, Verdict.TORN, (shot,))
        found = self._learned.usual.judge(shot, share)
        if found.is_wrong:
            return found
        light = self._learned.steps.judge(shot, share, contests.get(Verdict.DARK))
        is_frayed = any(contest.is_doubtful for contest in told.values())
        if Verdict.LATE in told:
            return replace(found, is_doubtful=is_frayed or light is Light.STEP, light=light)
        # That a picture is neither white nor black does not say that it is the one wanted.
        return Finding(shot, Verdict.UNTOLD, is_doubtful=light is Light.STEP, light=light)

    def _named(self, shot: Shot, lost: dict[Verdict, Contest], shown: Shot | None) -> Finding:
        """What a picture shows that is not the one wanted, from the rivals that won and the line it shows."""
        if shown is not None and shown != shot:
            near = {-1: Verdict.LATE, 1: Verdict.SWAPPED}
            verdict = near.get(shown.index - shot.index, Verdict.OTHER)
            return Finding(shot, verdict, (shot,), f"that of {describe_shot(shown)}")
        worst = min(lost, key=lambda verdict: lost[verdict].mean)
        if Verdict.LATE in lost and lost[Verdict.LATE].mean < lost[worst].mean + NEARLY:
            worst = Verdict.LATE
        return Finding(shot, worst, (shot,))
