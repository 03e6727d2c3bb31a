"""What the pictures of a scan have shown so far, with which the next ones are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.code.first_code import FirstCode
from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.judging.common_light import CommonLight
from dsl_core.capture.proof.judging.usual_votes import UsualVotes
from dsl_core.capture.proof.light_steps import LightSteps
from dsl_core.capture.proof.lines.line_place import LinePlaces
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit, line_profile
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.capture.proof.usual_light import UsualLight
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.conditions import colour_sites
from dsl_core.model.plan import CapturePlan, NoCode, Role, Shot
from dsl_core.model.rig import Rig
from dsl_core.optics.spectra import chain_response

#: Wavelengths that LEDs are compared at, nm.
_NM = np.arange(400.0, 701.0, 2.0)


@dataclass
class Learned:
    """What the pictures so far say of those to come, as far as it follows from their findings."""

    usual: UsualLight
    steps: LightSteps
    places: LinePlaces
    votes: UsualVotes
    common: CommonLight
    #: Shots of later settings that were found wrong before.
    contested: set[int]

    def copy(self) -> Learned:
        """Another one, which further pictures change alone."""
        return Learned(
            self.usual.copy(),
            self.steps.copy(),
            self.places.copy(),
            self.votes.copy(),
            self.common.copy(),
            self.contested.copy(),
        )


class Known:
    """A scan's plan and calibration, its right pictures so far, and what follows from them."""

    def __init__(
        self,
        plan: CapturePlan,
        calibration: Rig | None,
        bit_depth: int,
        bayer: str,
        at_the_end: bool,
        knows_light: bool,
    ) -> None:
        """The arguments are those of `FrameProof`."""
        self.plan, self.calibration = plan, calibration
        self.at_the_end, self.knows_light = at_the_end, knows_light
        self.shots = tuple(plan.shots())
        self.raster = Raster(plan.camera_size_px)
        self.noise = Noise.of(calibration.sensor if calibration else None, bit_depth)
        self.bayer = calibration.sensor.bayer if calibration else bayer
        #: Indices of the shots of black and of white by setting.
        self.blacks = {s.setting: s.index for s in self.shots if s.role == "black"}
        self.whites = {s.setting: s.index for s in self.shots if s.role == "white"}
        #: The right pictures by the index of their shot, and which of them said nothing by themselves.
        self.kept: dict[int, Counts] = {}
        self.untold: set[int] = set()
        self._profiles: dict[tuple[Role, int], Floats | None] = {}
        self._begin(min(plan.code_settings))

    def _begin(self, setting: int) -> None:
        #: The setting whose code is judged by itself, and indices of its shots by role and pattern.
        self.first = setting
        self.places = {(s.role, s.pattern): s.index for s in self.shots if s.setting == setting}
        self.learned = Learned(
            UsualLight(setting, self.knows_light and self.calibration is not None),
            LightSteps(),
            LinePlaces(),
            UsualVotes(),
            CommonLight(),
            set(),
        )
        self.code = self._first_code()

    def leave_code(self, shot: Shot) -> bool:
        """Judge the code of a shot's setting by itself from now on, where that of one before says nothing."""
        is_next = shot.role == "code" and shot.setting > self.first
        if self.code is None or not is_next or not self.code.says_nothing:
            return False
        self._begin(shot.setting)
        return True

    def _first_code(self) -> FirstCode | None:
        plan = self.plan
        # Codes of other programs are imported, complete or not: no frame can be taken again.
        if isinstance(plan.code, NoCode | CapturedCode):
            return None
        own = [s for s in self.shots if s.setting == self.first and s.role in ("code", "white", "black")]
        rises = None if self.calibration is None else self.calibration.pose.matrix[0, 0] > 0
        return FirstCode(plan, plan.code, own, self.raster, self.noise, self.bayer, rises, self.at_the_end)

    @property
    def lit(self) -> Lit | None:
        """The projector's columns that pixels see; None until the first code is there."""
        return None if self.code is None else self.code.lit

    def profile(self, shot: Shot) -> Floats | None:
        """The `line_profile` of a shot, which is a rival of its neighbours as well, at every setting."""
        shot = self.plan.original(shot)
        key = shot.role, shot.pattern
        if key not in self._profiles:
            self._profiles[key] = self._seen(line_profile(self.plan, shot))
        return self._profiles[key]

    def _seen(self, profile: Floats | None) -> Floats | None:
        """A `line_profile` as pixels see it: those of a monochrome camera see all LEDs together.

        None for a coloured picture to a monochrome camera that is not calibrated.
        """
        if profile is None or self.bayer != "MONO":
            return profile
        leds = profile.reshape(-1, 3)
        if self.calibration is None:
            # How bright each LED is to such a camera is not known yet; pictures of all alike need no share.
            return profile if (leds == leds[:, :1]).all() else None
        return np.repeat(leds @ _light_of_leds(self.calibration), 3)

    def rivals(self, shot: Shot) -> list[tuple[Verdict, Shot]]:
        """The shots whose pattern a picture most likely shows instead, and what that would be called."""
        found = []
        if shot.index + 1 < len(self.shots):
            found.append((Verdict.SWAPPED, self.shots[shot.index + 1]))
        if shot.index > 0:
            found.append((Verdict.LATE, self.shots[shot.index - 1]))
        return found

    def black(self, shot: Shot) -> Counts | None:
        """The black picture of a shot's setting, if it is there."""
        return self.kept.get(self.blacks[shot.setting])

    def ends(self, setting: int) -> tuple[Counts, Counts] | None:
        """White and black of a setting, if both are there."""
        own = [s for s in self.shots if s.setting == setting and s.role in ("white", "black")]
        kept = {shot.role: self.kept.get(shot.index) for shot in own}
        white, black = kept.get("white"), kept.get("black")
        return None if white is None or black is None else (white, black)

    def code_pairs(self) -> dict[int, tuple[Counts, Counts]]:
        """Pattern and inverse of the first code by the number of the pair, as far as both are there."""
        kept = {n: self.kept.get(at) for (role, n), at in self.places.items() if role == "code"}
        pairs = {n // 2: (one, kept.get(n + 1)) for n, one in kept.items() if n % 2 == 0}
        return {n: (one, other) for n, (one, other) in pairs.items() if one is not None and other is not None}

    def remember(self, shot: Shot, seen: Counts, again: tuple[Shot, ...], is_told: bool) -> None:
        """Keep a picture unless it is among those to take again, all of which are forgotten."""
        for wrong in again:
            self.kept.pop(wrong.index, None)
        if shot not in again:
            self.kept[shot.index] = seen
            (self.untold.discard if is_told else self.untold.add)(shot.index)


def _light_of_leds(rig: Rig) -> Floats:
    """What share of white each LED gives a monochrome camera, (3,)."""
    light = chain_response(rig, 0, _NM)[colour_sites("MONO")[0]].sum(1)
    return np.asarray(light / light.sum(), np.float32)
