"""What has changed since a scan began, when its pictures no longer show what they should.

White, black and a frame of the code are captured once more and compared with the first ones: black tells the
light of the room, white the exposure and the light of the projector, and where both are in the picture and
the pattern is on the scene tells what moved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from dsl_core.capture.altered import alteration, ends_early
from dsl_core.capture.motion import Movement, moved_between
from dsl_core.capture.proof.again.room_again import said_of_room, said_of_slight_change
from dsl_core.capture.proof.again.white_tiles import (
    CAME_IN,
    light_of_tiles,
    said_of_light_up,
    said_of_places,
    said_of_shade,
)
from dsl_core.capture.proof.lasting.black_light import lit_black
from dsl_core.capture.proof.lasting.black_values import below_level
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.capture.put_back import ADVICE
from dsl_core.capture.sentinels import SensorWatch
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Sensor, colour_sites
from dsl_core.optics.seen_noise import DARKER

Mosaic = NDArray[np.uint16]

#: A factor of white that matters.
LEAST_LIGHT = 0.05
#: Factors of the colours of white that differ by this share of each other are no change of all light, where
#: each colour has had so much of it.
UNEVEN, LEAST_COLOUR = 0.1, 0.05
#: A colour has failed with less than this share of its light where others have kept theirs.
LOST = 0.3
#: With less light than this, as a share of what it was, white and black are the same picture.
NO_LIGHT = 0.02
#: Factors of white and of black that are this much alike have one cause: the exposure.
ALIKE = 0.1
#: What black is above its level has to exceed this to tell a factor, DN.
TELLING_DN = 2.0
#: Share of saturated pixels from which on black is no longer black.
SATURATED = 0.5
#: Share of full scale from which on a pixel is saturated.
FULL = 0.98
#: Width of what such a pixel takes with it, camera pixels: the colours of a mosaic repeat every other one.
BESIDE_PX = 5
#: Pixels needed to say anything, and the deviations that white exceeds black by in each.
FEWEST, LIT_SIGMAS = 12, 5.0
#: A frame of the code shows another pattern if its pixels differ by this share of white: noise makes less.
OTHER_PATTERN = 0.08
#: Stripes of the code are out of focus with less than this share of the contrast (squared) they had, and the
#: light they had but for so much of white's.
SOFTER, SAME_SHARE = 0.85, 0.03


@dataclass(frozen=True)
class References:
    """Raw mosaics (rows, columns), DN, of the shots of `CapturePlan.references` at one time."""

    white: Mosaic
    black: Mosaic
    code: Mosaic

    @property
    def pictures(self) -> tuple[Mosaic, Mosaic, Mosaic]:
        """All three, in this order."""
        return self.white, self.black, self.code


@dataclass(frozen=True)
class Explanation:
    """What has changed, and what to do, as sentences (empty if nothing has); whether something moved.

    ``is_as_at_first``: white, black and code were compared, and nothing has changed. ``is_of_all``: all of
    the picture has, alike, so that nothing stands before a part of it. ``is_slight``: a picture may be wrong
    for another reason. ``seen`` is what a wrong picture then is, as a clause, rather than what it looks like.
    """

    sentence: str = ""
    has_moved: bool = False
    is_as_at_first: bool = False
    is_of_all: bool = False
    is_slight: bool = False
    seen: str = ""


class Diagnosis:
    """Keeps the first pictures of the references of a plan, and compares them with later ones."""

    def __init__(self, plan: CapturePlan, sensor: SensorWatch) -> None:
        """Without white, black and code in the plan there is never anything to say.

        Its first frames say what those of a ``sensor`` that is not calibrated are worth.
        """
        self._sensor = sensor
        self._shots = plan.references()
        setting = min(plan.code_settings)
        pair = [s for s in plan.shots() if (s.role, s.setting) == ("code", setting) and s.pattern < 2]
        # Of codes of other programs, nobody knows what makes a pair.
        self._pair = [] if isinstance(plan.code, CapturedCode) else pair
        self._kept: dict[int, Mosaic] = {}

    def keep(self, shot: Shot, pixels: Mosaic) -> None:
        """Keep a picture that the scan believes, if it is one of a reference."""
        self._sensor.add(shot, pixels)
        if shot in self._shots.values() or shot in self._pair:
            self._kept[shot.index] = pixels

    def explain(self, take: Callable[[Shot], Mosaic]) -> Explanation:
        """What has changed, after capturing the references again.

        While the code is captured, its first pair stands in for them. Raises what ``take`` raises.
        """

        def kept(shot: Shot) -> Mosaic:
            return self._kept[shot.index]

        if self._shots and all(shot.index in self._kept for shot in self._shots.values()):
            before, now = (
                References(**{role: picture(shot) for role, shot in self._shots.items()})
                for picture in (kept, take)
            )
        elif self._pair and all(shot.index in self._kept for shot in self._pair):
            before, now = (_of_pair(*map(picture, self._pair)) for picture in (kept, take))
        else:
            return Explanation()
        return what_changed(before, now, self._sensor.given(before.black))

    def explain_picture(self, pixels: Mosaic) -> Explanation:
        """What a wrong picture, raw mosaic (rows, columns), shows by itself where references do not."""
        black = self._kept.get(self._shots["black"].index, pixels) if self._shots else pixels
        sensor = self._sensor.given(black)
        dark_dn = float(np.quantile(pixels, DARKER))
        low = below_level(f"Its darkest pixels are at {dark_dn:.0f} DN", dark_dn, sensor)
        if low:
            return Explanation(low, is_of_all=True, seen="it is darker than the camera's black level")
        ends = ends_early(pixels, sensor)
        return Explanation(ends, is_of_all=True, seen="its brightest pixels are cut off" if ends else "")


def _of_pair(one: Mosaic, other: Mosaic) -> References:
    """White and black as a pattern and its inverse show them."""
    return References(white=np.maximum(one, other), black=np.minimum(one, other), code=one)


@dataclass(frozen=True)
class _Lights:
    """White less black, at first and now (rows, columns), in pixels that neither saturates (``used``).

    ``lit`` are those with a good part of it, ``factor`` is how many times the light it is, ``darks`` how far
    black is above its level, DN, at first and now.
    """

    old: NDArray[np.float64]
    new: NDArray[np.float64]
    used: NDArray[np.bool_]
    lit: NDArray[np.bool_]
    factor: float
    darks: tuple[float, float]

    @property
    def is_other(self) -> bool:
        """Whether all light has changed by a factor that matters."""
        return abs(self.factor - 1) > LEAST_LIGHT

    @property
    def is_exposed_otherwise(self) -> bool:
        """Whether black has changed by the same factor."""
        before, now = self.darks
        return self.is_other and before > TELLING_DN and abs(now / before / self.factor - 1) < ALIKE


def what_changed(before: References, now: References, sensor: Sensor) -> Explanation:
    """What is different in later pictures."""
    if _is_black_bright(before, now, sensor):
        return Explanation(
            "Black saturates in most of the picture, and did not when the scan began: the projector or its"
            " computer inverts pictures, or another lamp shines on the scene. Set them as they were."
        )
    light = _lights(before, now, sensor)
    if light is None:
        return Explanation()
    if light.factor < NO_LIGHT:
        return Explanation(
            "White and black now look the same: the projector gives no light, something covers it or the"
            " lens, or the camera repeats a picture. Check projector and camera."
        )
    appeared = _appeared(before, now, sensor)
    if appeared:
        return Explanation(appeared)
    altered = alteration(before.pictures, now.pictures, sensor)
    if altered:
        return Explanation(altered, is_of_all=True)
    tiles = light_of_tiles(light.old, light.new, light.used)
    moved = moved_between((before.white, before.black), (now.white, now.black), sensor, is_pattern=False)
    shaded = said_of_shade(tiles, light.used.shape)
    if moved is None or not moved.is_sure:
        # Edges of what is bright move into tiles that are dark otherwise, and light them.
        shaded = shaded or said_of_light_up(tiles, light.used.shape)
    if shaded:
        return Explanation(shaded)
    return _of_light_or_motion(before, now, sensor, light, tiles, moved)


def _is_black_bright(before: References, now: References, sensor: Sensor) -> bool:
    full = FULL * sensor.full_scale_dn
    was_bright, is_bright = (float((each.black >= full).mean()) for each in (before, now))
    return was_bright < SATURATED <= is_bright


def _appeared(before: References, now: References, sensor: Sensor) -> str:
    """Whether black has become as bright as white somewhere."""
    size_px = now.black.shape[1], now.black.shape[0]
    raster, noise = Raster(size_px), Noise(sensor)
    channels = raster.channels(sensor.bayer)
    was, is_ = (
        lit_black(raster.take(each.white), raster.take(each.black), channels, noise, raster, size_px)
        for each in (before, now)
    )
    if is_ is None or was is not None or is_.is_in_stripes:
        return ""
    where = "columns {}-{}, rows {}-{} of the picture".format(*is_.columns, *is_.rows)
    return f"Since the scan began, black has become as bright as white in {where}: {CAME_IN}"


def _lights(before: References, now: References, sensor: Sensor) -> _Lights | None:
    """What white and black say of the light; None where too few pixels have any."""
    old, new = (each.white.astype(np.float64) - each.black for each in (before, now))
    # All of the picture but what is saturated: of bright pixels alone, a motion would dim many.
    full = FULL * sensor.full_scale_dn
    # Beside what was saturated, a motion shows one side of its edge and hides the other.
    used = (maximum_filter(before.white, BESIDE_PX) < full) & (now.white < full)
    noise = Noise(sensor)
    sigma = np.sqrt(noise.variance(before.white) + noise.variance(before.black))
    lit = used & (old > np.maximum(0.25 * np.percentile(old, 95), LIT_SIGMAS * sigma))
    if lit.sum() < FEWEST:
        return None
    was, is_ = (float(each.black.mean(dtype=np.float64)) - sensor.black_level_dn for each in (before, now))
    return _Lights(old, new, used, lit, float(new[used].sum() / old[used].sum()), (was, is_))


def _of_light_or_motion(
    before: References,
    now: References,
    sensor: Sensor,
    light: _Lights,
    tiles: NDArray[np.float64],
    moved: Movement | None,
) -> Explanation:
    """What lamps, exposure, room, focus and motion have changed, of pictures that show the same otherwise."""
    if moved is None and not light.is_other:
        moved = moved_between((before.code, before.black), (now.code, now.black), sensor, is_pattern=True)
    colours = _of_colours(light.old, light.new, light.used, sensor)
    is_uneven = max(colours) > (1 + UNEVEN) * min(colours)
    by_place = ""
    if light.is_other and not is_uneven and moved is None:
        by_place = said_of_places(tiles, light.factor)
    found = [_said_of_colours(colours) if is_uneven else by_place or _said_of_light(light)]
    white_dn, tells_room = float(light.old[light.lit].mean()), is_uneven or not light.is_exposed_otherwise
    found.append(said_of_room(light.darks, white_dn) if tells_room else "")
    is_soft = (moved is None or moved.is_pattern) and _has_softer_stripes(before, now, light.lit)
    if is_soft:
        found.append(
            "Stripes of the code are softer than when the scan began: projector or camera is out of focus, or"
            " something came onto a lens. Set the focus as it was."
        )
    elif moved is not None and not is_uneven:
        # Other colours look like motion where surfaces have colours.
        found.append(f"{moved.sentence} {ADVICE}")
    sentence = " ".join(filter(None, found))
    if not sentence and moved is None and _is_other_pattern(before, now, light.old, light.used):
        return Explanation(
            "White and black look as they did, and a frame of the code does not: the projector or its"
            " computer shows pictures elsewhere or in another size, or other pictures. Set mirroring,"
            " scaling, keystone and refresh rate as they were.",
            has_moved=True,
        )
    if not sentence and moved is None:
        slight = said_of_slight_change(before.black, now.black, white_dn)
        seen = "it differs from what it should show" if slight else ""
        return Explanation(slight, is_as_at_first=not slight, is_slight=bool(slight), seen=seen)
    is_of_all = is_uneven or (moved is None and light.is_other and not by_place)
    return Explanation(sentence, moved is not None or is_soft, not sentence, is_of_all)


def _said_of_colours(colours: tuple[float, ...]) -> str:
    """That colours of white have changed by different factors, and whether one of them has failed."""
    red, green, blue = colours
    lost = [name for name, share in zip(COLOUR_NAMES, colours, strict=True) if share < LOST]
    others = [share for share in colours if share >= LOST]
    if lost and others and max(abs(share - 1) for share in others) < LEAST_LIGHT:
        advice = (
            f"Look whether the projector still shines in {' and '.join(lost)}, and whether camera and"
            " cables pass it on."
        )
    else:
        advice = (
            "Switch white balance of the camera and night mode of the projector and of its computer off,"
            " and check the projector's colours and that the film is where it was."
        )
    return (
        f"The light of white is {red:.2f} times what it was when the scan began in red, {green:.2f} times"
        f" in green and {blue:.2f} times in blue. {advice}"
    )


def _said_of_light(light: _Lights) -> str:
    """That white has changed by a factor; that black has too says that it is the exposure."""
    if not light.is_other:
        return ""
    is_exposure = light.is_exposed_otherwise
    what = "exposure or gain of the camera" if is_exposure else "light of the projector or the exposure"
    return (
        f"The {what} is {light.factor:.2f} times what it was when the scan began. Switch automatic exposure"
        " and gain of the camera off, and check the lamp."
    )


def _is_other_pattern(
    before: References, now: References, white: NDArray[np.float64], used: NDArray[np.bool_]
) -> bool:
    """Whether the frame of the code differs, of pictures whose white, less black, is the same."""
    first, second = (each.code.astype(np.float64) - each.black for each in (before, now))
    return float(np.abs(second - first)[used].mean()) > OTHER_PATTERN * float(white[used].mean())


def _has_softer_stripes(before: References, now: References, lit: NDArray[np.bool_]) -> bool:
    """Whether a frame of the code is nearer to half of white, with as much light: a motion leaves both."""
    shares, contrasts = [], []
    for each in (before, now):
        white, code = (
            picture.astype(np.float64)[lit] - each.black[lit] for picture in (each.white, each.code)
        )
        shares.append(float(code.sum() / white.sum()))
        contrasts.append(float(np.square(2 * code - white).sum() / np.square(white).sum()))
    return contrasts[1] < SOFTER * contrasts[0] and abs(shares[1] - shares[0]) < SAME_SHARE


def _of_colours(
    old: NDArray[np.float64], new: NDArray[np.float64], used: NDArray[np.bool_], sensor: Sensor
) -> tuple[float, ...]:
    """White less black over what it was in red, green and blue; ones where a colour has little light."""
    rows, columns = np.indices(used.shape) % 2
    colour = np.array(colour_sites(sensor.bayer)).reshape(2, 2)[rows, columns]
    sums = [[float(light[used & (colour == each)].sum()) for light in (old, new)] for each in range(3)]
    total = sum(before for before, _ in sums)
    if min(before for before, _ in sums) < LEAST_COLOUR * total:
        return 1.0, 1.0, 1.0
    return tuple(max(now / before, 0.0) for before, now in sums)
