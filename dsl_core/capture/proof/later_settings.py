"""Pictures of a later setting, predicted from those of the first one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Expected, rescaled
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.capture.proof.recent import Recent
from dsl_core.model.plan import CapturePlan, Role, Shot
from dsl_core.model.rig import Rig

#: Projectors without a calibration are taken to have this gamma.
USUAL_GAMMA = 2.2


class LaterSettings:
    """Predicts pictures by how much stronger the light of their setting is than that of the first one.

    That follows from the plan, until the first pictures of a setting say it themselves.
    """

    def __init__(
        self,
        plan: CapturePlan,
        first: int,
        calibration: Rig | None,
        noise: Noise,
        kept: Mapping[int, Counts],
        gained: Callable[[Shot, Counts], np.float32] = lambda shot, seen: np.float32(0),
        level: Callable[[Shot], float] = lambda shot: 1.0,
    ) -> None:
        """``first`` is the setting whose code is judged by itself.

        ``kept`` are the right pictures so far by the index of their shot; others may change it.

        ``gained`` says by how much black was more than its picture when the one of a shot was taken, DN, and
        ``level`` what its light was over that of white.
        """
        self._plan, self._calibration, self._noise, self._kept = plan, calibration, noise, kept
        self._gained, self._level = gained, level
        self._first = first
        shots = tuple(plan.shots())
        self._places = {(s.role, s.pattern): s.index for s in shots if s.setting == self._first}
        self._blacks = {s.setting: s.index for s in shots if s.role == "black"}
        self._measured: dict[int, float] = {}
        self._rescaled = Recent[Expected]()
        self._as_floats = Recent[Floats]()

    def earlier(self, shot: Shot) -> Counts | None:
        """The picture of the same pattern at the first setting."""
        return self._kept.get(self._places.get((shot.role, shot.pattern), -1))

    def white(self, shot: Shot, less_gained: bool = True) -> Expected | None:
        """White at the setting of a shot; None while nothing is known of it."""
        return self.expected(_of_role("white", shot), shot, less_gained)

    def black(self, shot: Shot) -> Expected | None:
        """Black at the setting of a shot; None while nothing is known of it."""
        return self.expected(_of_role("black", shot), shot)

    def expected(self, pattern: Shot, shot: Shot, less_gained: bool = True) -> Expected | None:
        """The picture of a pattern at the setting of ``shot``; None while nothing is known of it.

        With ``less_gained``, what black had gained is taken off: first orders that reach all of a small
        object look like that, too.
        """
        pattern = self._plan.original(pattern)
        old, old_black = self.earlier(pattern), self.earlier(_of_role("black", shot))
        if old is None or old_black is None:
            return None
        black = self._black(shot, old_black)
        if pattern.role == "black":
            return Expected(black, self._noise.variance(old_black))
        return self._rescaled.get(
            pattern.index,
            (old, old_black, black, self._measured.get(shot.setting), less_gained),
            lambda: rescaled(
                old,
                old_black,
                black,
                self.scale(shot) / self._level(pattern),
                self._noise,
                self.gained(pattern) if less_gained else np.float32(0),
            ),
        )

    def gained(self, pattern: Shot) -> np.float32:
        """By how much black was more when the picture of a pattern was taken at the first setting, DN."""
        old = self.earlier(pattern)
        return np.float32(0) if old is None else self._gained(pattern, old)

    def is_measured(self, shot: Shot) -> bool:
        """Whether pictures have said how strong the light of a shot's setting is."""
        return shot.setting in self._measured

    def measure(self, shot: Shot, share: float) -> None:
        """Predict from now on as the picture of a shot says, by its light over its prediction."""
        self._measured[shot.setting] = self.scale(shot) * share

    def scale(self, shot: Shot) -> float:
        """How much stronger light is at the setting of a shot than at the first one."""
        if shot.setting in self._measured:
            return self._measured[shot.setting]
        first = self._plan.settings[self._first]
        if self._calibration is not None:
            radiance = self._calibration.projector_response.radiance
            dark = float(radiance(0.0))
            ratio = (float(radiance(shot.level)) - dark) / max(float(radiance(first.level)) - dark, 1e-9)
        else:
            ratio = (shot.level / first.level) ** USUAL_GAMMA
        return shot.exposure_ms / first.exposure_ms * ratio

    def _black(self, shot: Shot, old_black: Counts) -> Floats:
        """As taken, unless it is asked for that picture itself; else what the exposure makes of the first."""
        own = self._blacks[shot.setting]
        taken = self._kept.get(own) if own != shot.index else None
        if taken is not None:
            return self._as_floats.get(own, (taken,), lambda: taken.astype(np.float32))
        if self._calibration is None:  # nobody knows how much of it is light
            return old_black.astype(np.float32)
        level = np.float32(self._noise.sensor.black_level_dn)
        first = self._plan.settings[self._first]
        ratio = np.float32(shot.exposure_ms / first.exposure_ms)
        full = np.float32(self._noise.sensor.full_scale_dn)
        return np.asarray(np.minimum(level + ratio * (old_black.astype(np.float32) - level), full))


def _of_role(role: Role, shot: Shot) -> Shot:
    """White or black at the setting of a shot, whether or not the plan has it."""
    return replace(shot, index=-1, role=role, pattern=0)
