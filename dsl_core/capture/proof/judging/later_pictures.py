"""Pictures of later settings, judged by those of the first one, which showed the same patterns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.common_light import common_light
from dsl_core.capture.proof.judging.decision import decide, in_place
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.later_settings import LaterSettings
from dsl_core.capture.proof.lines.line_place import contests_of_sides, moved
from dsl_core.capture.proof.prediction import (
    APART,
    Expected,
    black_gained,
    brightness_of_picture,
    contest_of_pictures,
    contest_of_places,
)
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.plan import ScanLines, Shot


class LaterPictures:
    """Judges pictures of later settings one after the other, and learns how strong their light is."""

    def __init__(self, known: Known) -> None:
        """``known`` grows as pictures come."""
        self._known = known
        self.expected = LaterSettings(
            known.plan,
            known.first,
            known.calibration,
            known.noise,
            known.kept,
            self._black_gained,
            self._level_of_code,
        )

    def judge(self, shot: Shot, seen: Counts) -> Finding:
        """A finding by the picture of the first setting, with and without what black has gained since."""
        known = self._known
        before = known.learned.copy()
        found = self._judge(shot, seen)
        if not found.is_wrong or self.expected.gained(shot) == 0:
            return found
        # Only the judgement that is believed counts for what is usual.
        after, known.learned = known.learned, before
        other = self._judge(shot, seen, less_gained=False)
        if other.is_wrong:
            known.learned = after
            return found
        return other

    def _judge(self, shot: Shot, seen: Counts, less_gained: bool = True) -> Finding:
        known, later = self._known, self.expected
        wanted, white = later.expected(shot, shot, less_gained), later.white(shot, less_gained)
        dark = later.black(shot)
        if wanted is None or white is None or dark is None:
            return Finding(shot, Verdict.UNTOLD)
        black = dark.counts
        # Before its own black is there, only what is bright can be relied on.
        has_black = shot.role != "black" and known.black(shot) is not None
        least = None if has_black else np.float32(APART) * (white.counts - black)
        rivals = [
            (verdict, later.expected(rival, shot, less_gained)) for verdict, rival in known.rivals(shot)
        ]
        rivals += [(Verdict.DARK, dark), (Verdict.OTHER, white)]
        contests = {
            verdict: contest_of_pictures(seen, wanted, rival, black, least, known.noise, known.raster)
            for verdict, rival in rivals
            if rival is not None
        }
        is_judged = has_black or (known.calibration is not None and shot.role != "black")
        share = self._brightness(shot, seen, wanted, black) if is_judged else None
        first_of_role = not known.learned.usual.knows(shot)
        found = decide(shot, contests, share, known.learned)
        if shot.role == "spectral" and has_black:
            found = in_place(found, contests, self._places(shot, seen, wanted, black), known.learned)
        if found.verdict is Verdict.DISPLACED:
            return found
        if found.is_wrong:
            return self._with_doubtful(found)
        if shot.role == "spectral" and has_black and (more := self._common_light(shot, seen, wanted)):
            return self._lit_by_room(shot, more)
        if share is not None and first_of_role and not later.is_measured(shot):
            later.measure(shot, share)
            known.learned.usual.begin(shot)
        return found

    def _places(self, shot: Shot, seen: Counts, wanted: Expected, black: Floats) -> dict[int, Contest]:
        """Contests of a line's place with those next to it, from its picture at the first setting."""
        known = self._known
        lit, profile = known.lit, known.profile(shot)
        if lit is None or profile is None:
            return {}
        dark = black, self.expected.scale(shot)
        profile = np.float32(known.learned.usual.share(replace(shot, setting=known.first))) * profile
        return contests_of_sides(
            lambda side: contest_of_places(
                seen, wanted, lit, dark, (profile, moved(profile, side)), known.noise
            )
        )

    def _common_light(self, shot: Shot, seen: Counts, wanted: Expected) -> float:
        """What all pixels of a picture of several lines have more than before, DN; 0 if they have not."""
        known, profile = self._known, self._known.profile(shot)
        if known.lit is None or profile is None or isinstance(known.plan.spectral, ScanLines):
            return 0.0
        more = common_light(seen, wanted, known.lit, profile, known.noise.sensor.full_scale_dn)
        return 0.0 if more is None else known.learned.common.step(shot, more)

    def _lit_by_room(self, shot: Shot, more_dn: float) -> Finding:
        """That all of a picture has gained light; one with less may be right, and its first setting not."""
        old = self._known.shots[self._known.places[shot.role, shot.pattern]]
        again = (shot,) if more_dn > 0 else (old, shot)
        return Finding(shot, Verdict.OTHER, again, f"all of it has {more_dn:+.0f} DN against those before")

    def _level_of_code(self, shot: Shot) -> float:
        """Light of a picture of the first code over that of white; 1 for other shots."""
        code = self._known.code
        return 1.0 if code is None or shot.role != "code" else code.light.get(shot.pattern // 2, 1.0)

    def _black_gained(self, shot: Shot, seen: Counts) -> np.float32:
        """By how much black was more; 0 where many lines leave no pixel without their first orders."""
        known = self._known
        one_line = shot.role == "spectral" and isinstance(known.plan.spectral, ScanLines)
        wanted = known.profile(shot) if one_line else None
        if known.lit is None or wanted is None:
            return np.float32(0)
        return black_gained(seen, known.lit, wanted, known.noise)

    def _brightness(self, shot: Shot, seen: Counts, wanted: Expected, black: Floats) -> float | None:
        profile = self._known.profile(shot) if shot.role == "spectral" else None
        return brightness_of_picture(seen, wanted, black, self._known.noise, self._known.lit, profile)

    def _with_doubtful(self, found: Finding) -> Finding:
        """Take the picture that a wrong one was compared with again as well, where it may be that one."""
        known, contested = self._known, self._known.learned.contested
        old = known.places[found.shot.role, found.shot.pattern]
        is_doubtful = old in known.untold or found.shot.index in contested
        contested.add(found.shot.index)
        if found.shot.role != "spectral" or not is_doubtful:
            return found
        # The black picture just before may have changed places with it: at a setting of little light, nothing
        # tells black from a faint line.
        before = known.shots[old - 1]
        swapped = (before,) if before.role == "black" else ()
        return replace(found, again=(*swapped, known.shots[old], *found.again))
