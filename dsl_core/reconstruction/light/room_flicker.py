"""Light of the room, or a black level, that differs from frame to frame, and what that adds to each of them.

Away from a line a picture holds black and the faint light of first orders, which changes slowly from frame to
frame. What a frame has more than its neighbours there is a multiple of that light where the projector
flickers, and the same in all pixels, or a multiple of what the room lights, where something else does. Taken
for a flicker of the projector, a single DN from the room makes much of a faint first order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import ScanLines, Shot
from dsl_core.optics.sensor import raw_variance
from dsl_core.optics.unlit import unlit_px
from dsl_core.reconstruction.hdr import setting_gains_ms
from dsl_core.reconstruction.light.frame_excess import Halo, Pictures, Places
from dsl_core.reconstruction.light.line_levels import AROUND, PIXELS, pitch_of
from dsl_core.reconstruction.light.line_levels import zone_px as zone_px_of
from dsl_core.reconstruction.light.neighbour_steps import Scan
from dsl_core.reconstruction.merge import Exposed, PickedLines
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.thinned import thinned

Floats = NDArray[np.float64]

#: Frames that are needed to tell anything.
FRAMES = 16
#: Pixels that decide whether others are looked at.
AT_FIRST = 3000
#: The rms of what frames have more has to be so many deviations of a single one, and this share of the noise
#: of a single pixel: less is hidden in it.
SIGMAS, OF_NOISE = 3.0, 0.05
#: Narrow bands that come and go leave less than this, which is taken off and not told.
LEAST_TOLD_DN = 0.2
#: Variance of black over a picture, relative to its noise, from which on it may be the room that is seen.
CONTRAST = 1.0
#: Share of what frames have more that unlit pixels must have as well.
AGREED = 0.5
#: What unlit pixels have in common may be off by, relative to a pixel's noise.
UNLIT_ERROR = 0.03
#: Sum of the squares of the shares by which a frame is interpolated.
_SQUARES = sum(share**2 for share in AROUND.values())


@dataclass(frozen=True)
class RoomFlicker:
    """What shots of lines have more than their black frame: ``dn`` in every pixel or a ``share`` of black.

    Both by index of the shot. ``rms_dn``, with its deviation, is that of the setting where it is most.
    """

    dn: Mapping[int, float]
    share: Mapping[int, float]
    rms_dn: float
    std_dn: float

    def exposed(self, before: Exposed) -> Exposed:
        """In what light shots were taken, besides what was known of it before."""
        dn, share = before.black_dn.copy(), before.black_share.copy()
        for known, found in ((dn, self.dn), (share, self.share)):
            for shot, more in found.items():
                known[shot] += more
        return replace(before, black_dn=dn, black_share=share)

    @property
    def finding(self) -> FitFinding:
        """What it says to a person."""
        return FitFinding.judged(
            "light",
            "flicker of the room",
            (self.rms_dn, self.std_dn),
            "DN",
            LEAST_TOLD_DN,
            f"The light of the room, or the black level, differed by {self.rms_dn:.2f} DN (rms) from frame to"
            " frame. The frames of lines are corrected for it.",
            "Keep the light of the room away, or use lamps that do not flicker.",
        )


@dataclass(frozen=True)
class _Found:
    """What frames have more (frames,) of something; the rms of it, and the deviation of that."""

    more: Floats
    rms: float
    rms_std: float


def room_flicker(
    scan: Scan, column: NDArray[np.integer], seen: PickedLines, before: Exposed | None
) -> RoomFlicker | None:
    """What frames of single lines have more than their neighbours; None where that does not matter.

    ``seen`` are the merged lines of some pixels, which decide whether to look any closer; ``column`` is the
    projector column of each pixel of the picture, negative where unknown.
    """
    lines = scan.plan.spectral
    if not isinstance(lines, ScanLines) or len(seen.radiance) < FRAMES:
        return None
    known = np.flatnonzero(np.isfinite(seen.std).all(0) & (column.ravel()[seen.pixels] >= 0))
    pixels = seen.pixels[thinned(known, PIXELS)]
    pixels = pixels[np.argsort(column.ravel()[pixels], kind="stable")]
    zone_px, unlit = zone_px_of(lines, pitch_of(column)), unlit_px(scan.rig, lines.width_px)

    def places_of(some: NDArray[np.intp]) -> Places:
        return Places(lines, column.ravel()[some].astype(np.float64), zone_px, unlit)

    # Most scans are steady, and few pixels are enough to say so.
    few = pixels[:: max(-(-len(pixels) // AT_FIRST), 1)]
    seen_by_few = seen.pick(few)
    merged = Pictures(
        seen_by_few.radiance.astype(np.float64),
        np.square(seen_by_few.std, dtype=np.float64),
        np.zeros(len(few)),
    )
    if _flicker(places_of(few), merged, np.ones((1, len(few))))[0] is None:
        return None
    places, picked = places_of(pixels), seen.pick(pixels)
    exposed = before or Exposed.as_planned(scan.plan.shot_count)
    gains_ms = setting_gains_ms(scan.plan.settings, scan.rig.projector_response)
    dn: dict[int, float] = {}
    share: dict[int, float] = {}
    most = (0.0, 0.0)
    for setting in range(len(scan.plan.settings)):
        shots = [
            next(shot for shot in scan.shots_of("spectral", pattern) if shot.setting == setting)
            for pattern in range(scan.plan.spectral_count)
        ]
        black = scan.source.read(next(s for s in scan.shots_of("black", 0) if s.setting == setting))
        dark = black.ravel()[pixels].astype(np.float64) - scan.rig.sensor.black_level_dn
        halo = Halo(gains_ms[setting] * picked.radiance.max(0), scan.rig.projector_response)
        of_setting = _of_setting(scan, shots, pixels, places, dark, exposed, halo)
        for kind, found, unit_dn in zip((dn, share), of_setting, (1.0, float(dark.mean())), strict=True):
            if found is not None:
                kind.update({shot.index: float(more) for shot, more in zip(shots, found.more, strict=True)})
                most = max(most, (found.rms * unit_dn, found.rms_std * unit_dn))
    return RoomFlicker(dn, share, *most) if dn or share else None


def _of_setting(
    scan: Scan,
    shots: list[Shot],
    pixels: NDArray[np.intp],
    places: Places,
    dark: Floats,
    exposed: Exposed,
    halo: Halo,
) -> tuple[_Found | None, _Found | None]:
    """What frames have more: DN in every pixel, and a share of ``dark``, black above its level."""
    sensor = scan.rig.sensor
    frames = np.empty((len(shots), len(pixels)))
    for row, shot in zip(frames, shots, strict=True):
        known = exposed.black_dn[shot.index] + exposed.black_share[shot.index] * dark
        row[:] = scan.source.read(shot).ravel()[pixels] - sensor.black_level_dn - known
    variance, noise = (np.asarray(raw_variance(sensor, each), np.float64) for each in (frames, dark))
    frames -= dark
    same = np.ones_like(dark)
    plain = Pictures(frames, variance, np.zeros_like(dark))
    if dark.var() - noise.mean() > CONTRAST * noise.mean():
        with_noise = Pictures(frames, variance, noise)
        both = _flicker(places, with_noise, np.stack([same, dark]), halo)
        if all(both):
            return both[0], both[1]
        if both[1] is not None:
            return None, _flicker(places, with_noise, dark[None], halo)[0]
    return _flicker(places, plain, same[None], halo)[0], None


def _flicker(
    places: Places, pictures: Pictures, shapes: Floats, halo: Halo | None = None
) -> list[_Found | None]:
    """What frames have more of ``shapes`` (n, P) than their neighbours; None where it is chance.

    With a ``halo``, pixels that no order reaches tell what neighbours have in common, and have to agree.
    """
    kept, steps, steps_std = pictures.beside_neighbours(places, shapes)
    if len(kept) < FRAMES // 2:
        return [None] * len(shapes)
    unlit = np.full((2, len(pictures.frames), len(shapes)), np.nan)
    if halo is not None:
        unlit = pictures.where_unlit(places, shapes, halo)
    return [
        _frames_from_steps(
            kept,
            steps[:, i],
            steps_std[:, i],
            unlit[0, :, i],
            unlit[1, :, i],
            _usual(pictures.variance, shape),
        )
        if halo is None or _agree(kept, steps[:, i], unlit[0, :, i])
        else None
        for i, shape in enumerate(shapes)
    ]


def _usual(variance: Floats, shape: Floats) -> float:
    """Noise of a single pixel in units of the shape."""
    return float(np.sqrt(np.median(variance))) / max(float(np.abs(shape).mean()), 1e-30)


def _frames_from_steps(
    kept: NDArray[np.intp], own: Floats, std: Floats, unlit: Floats, unlit_std: Floats, noise: float
) -> _Found | None:
    """What each frame has more, from what ``kept`` ones have more than their neighbours, and unlit pixels."""
    count, of_steps = len(unlit), float(np.median(own**2)) * STD_OF_MEDIAN_SIZE**2
    rms = np.sqrt(max(of_steps - float(np.median(std**2)), 0.0) / (1 + _SQUARES))
    if rms < max(SIGMAS * float(np.median(std)), OF_NOISE * noise):
        return None
    rows = np.zeros((len(kept), count))
    at = np.arange(len(kept))
    rows[at, kept] = 1.0
    for by, share in AROUND.items():
        rows[at, kept + by] = -share
    weight = 1 / std**2
    # Black flickered as well when its picture was taken, and all frames have that in common.
    usual = np.where(np.isnan(unlit), rms**-2, (unlit_std**2 + (UNLIT_ERROR * noise) ** 2) ** -1)
    normal = (rows.T * weight) @ rows + np.diag(usual)
    more = np.linalg.solve(normal, rows.T @ (weight * own) + usual * np.nan_to_num(unlit))
    return _Found(more, float(rms), float(2 * rms / np.sqrt(2 * len(kept))))


def _agree(kept: NDArray[np.intp], own: Floats, unlit: Floats) -> bool:
    """Whether pixels that no order reaches have as much more than in neighbouring frames as all others have.

    First orders that do not change slowly are in those others alone.
    """
    seen = unlit[kept] - np.sum([share * unlit[kept + by] for by, share in AROUND.items()], axis=0)
    both = np.isfinite(seen)
    return int(both.sum()) >= FRAMES // 2 and float(own[both] @ seen[both]) > AGREED * float(
        own[both] @ own[both]
    )
