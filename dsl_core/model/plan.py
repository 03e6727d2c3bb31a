"""What to capture: pattern sets, settings and shots, as frozen data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Protocol, Self

from pydantic import Field, field_validator, model_validator

from dsl_core.model.base import Record
from dsl_core.model.captured_code import CapturedCode

#: More than any camera or projector has a side, and than anybody takes of one scene in a day.
MOST_PX, MOST_SHOTS = 65_535, 200_000


class GrayCode(Record):
    """Binary reflected Gray code, each bit followed by its inverse, then white, then black.

    With rows: the published 40 frames of a 640 x 360 projector (10 column and 9 row bits).
    Columns only: 22.
    """

    kind: Literal["gray"] = "gray"
    rows: bool = True


class XorCode(Record):
    """A Gray code combined by exclusive or with its own fine stripes of ``base_px``: none is coarse.

    As many frames as the Gray code, in its order. Light that surfaces send each other does not flip its bits,
    but it needs lens, projector and surface to keep fine stripes apart.
    """

    kind: Literal["xor"] = "xor"
    rows: bool = True
    base_px: Literal[2, 4] = 4


class EnsembleCode(Record):
    """Gray code, then XOR code, each with inverses, then white, then black: two opinions on every pixel.

    Where they agree the column is certain; where not, light arrives by another way than straight.
    """

    kind: Literal["ensemble"] = "ensemble"
    rows: bool = True
    base_px: Literal[2, 4] = 4


class NoCode(Record):
    """No binary code and no white frame: captures that need no depth, such as lines through a filter."""

    kind: Literal["none"] = "none"


class NoSpectral(Record):
    """No spectral patterns: captures that need no spectrum, such as a board under the binary code."""

    kind: Literal["none"] = "none"


class ScanLines(Record):
    """One white vertical line per frame: line ``i`` covers columns ``[step*i, step*i + width)``.

    ``sparse`` lines may leave columns dark between them: enough for what is smooth over the image, such as
    the film, but not for spectra.
    """

    kind: Literal["lines"] = "lines"
    width_px: int = Field(default=5, ge=1)
    step_px: int = Field(default=2, ge=1)
    sparse: bool = False


class LineComb(Record):
    """Several lines per frame, ``period_px`` apart, moved by ``step_px`` from frame to frame.

    ``shifts_px`` moves the combs of the red, green and blue LED apart: each frame then holds three combs of
    one colour each.
    """

    kind: Literal["comb"] = "comb"
    width_px: int = Field(default=5, ge=1)
    step_px: int = Field(default=2, ge=1)
    period_px: int = Field(default=106, ge=2)
    shifts_px: tuple[int, int, int] = (0, 0, 0)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.width_px >= self.period_px:
            raise ValueError("the lines of a comb must be narrower than its period")
        return self


class Columns(Record):
    """Any set of column profiles: ``levels[k][x][c]`` in 0..1 multiplies the setting's drive level."""

    kind: Literal["columns"] = "columns"
    levels: tuple[tuple[tuple[float, float, float], ...], ...]


BinaryCode = GrayCode | XorCode | EnsembleCode
CodeSet = Annotated[GrayCode | XorCode | EnsembleCode | CapturedCode | NoCode, Field(discriminator="kind")]
SpectralSet = Annotated[ScanLines | LineComb | Columns | NoSpectral, Field(discriminator="kind")]


#: The least drive level in thousandths that projectors show as light, drive 1 of 255.
LEAST_LEVEL = 0.002


class Setting(Record):
    """One camera and projector setting of an HDR bracket: exposure, and pattern drive level 0..1."""

    exposure_ms: float = Field(gt=0)
    level: float = Field(gt=0, le=1)

    @field_validator("level")
    @classmethod
    def _is_light(cls, level: float) -> float:
        if round(255 * level) == 0:
            raise ValueError(
                f"it rounds to drive 0 of 255, which is black; {LEAST_LEVEL} is the least that is light"
            )
        return level


class Sentinels(Record):
    """Rounds of old shots taken again, which show how light and position change during a scan.

    A round repeats white, black, a frame of the code and a line, all of the first setting that has the code.
    There are as many rounds as a plan has times ``every`` shots, at least one: evenly spaced, the last one at
    the end. Four shots a round and 80 between them cost 5 %.
    """

    every: int = Field(default=80, ge=8)


Role = Literal["code", "spectral", "white", "black", "sentinel"]
#: The bit of the columns that sentinels show: its stripes are narrow enough to tell a small motion.
_SENTINEL_BIT = 5


@dataclass(frozen=True)
class Shot:
    """One exposure of a plan.

    ``index`` counts all shots of the plan; ``pattern`` counts within the role's pattern set:
    ``code`` frames in the order of the code (white and black last, as roles of their own),
    ``spectral`` frames in the order of the set; a ``sentinel`` repeats the shot with index ``pattern``.
    ``setting`` is an index into the plan's settings.
    """

    index: int
    role: Role
    pattern: int
    setting: int
    exposure_ms: float
    level: float

    @property
    def number(self) -> int:
        """The frame as a person counts it, from 1."""
        return spoken_number(self.index)


def spoken_number(index: int) -> int:
    """What a person calls the frame, pattern or setting of an index: files count from 0, texts from 1."""
    return index + 1


class Sized(Protocol):
    """A lens or a device with so many pixels."""

    @property
    def width_px(self) -> int:
        """Columns."""

    @property
    def height_px(self) -> int:
        """Rows."""


#: Name of a plan of which somebody changed anything without giving it another.
CUSTOM = "custom plan"


class CapturePlan(Record):
    """Everything a scan will do, known before it starts.

    Shots run through the settings one after the other, code first, then the lines, so that
    exposure and drive level change once; ``sentinels`` come between them (none in plans
    of earlier versions).
    """

    schema_version: Literal[1] = 1
    name: str = "reference"
    camera_size_px: tuple[int, int] = (890, 580)
    projector_size_px: tuple[int, int] = (640, 360)
    code: CodeSet = GrayCode()
    spectral: SpectralSet = ScanLines()
    settings: tuple[Setting, ...] = (
        Setting(exposure_ms=500.0 / 3.0, level=0.2),
        Setting(exposure_ms=1000.0 / 3.0, level=0.8),
    )
    code_settings: tuple[int, ...] = (0, 1)
    sentinels: Sentinels | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        sizes = (*self.camera_size_px, *self.projector_size_px)
        if not all(0 < size <= MOST_PX for size in sizes):
            raise ValueError(f"images must have 1 to {MOST_PX} pixels a side")
        if not self.settings:
            raise ValueError("a plan needs at least one setting (exposure and level)")
        if not self.code_settings or any(not 0 <= i < len(self.settings) for i in self.code_settings):
            raise ValueError(
                f"code_settings {self.code_settings} must name settings 0 to {len(self.settings) - 1}"
            )
        if self._own_count > MOST_SHOTS:
            raise ValueError(f"the plan has {self._own_count} frames; at most {MOST_SHOTS} are possible")
        return self

    def sized(self, camera: Sized, projector: Sized) -> Self:
        """The same plan for the image sizes of a camera and a projector."""
        sizes = {
            "camera_size_px": (camera.width_px, camera.height_px),
            "projector_size_px": (projector.width_px, projector.height_px),
        }
        return self.model_copy(update=sizes)

    @property
    def code_bits(self) -> tuple[int, int]:
        """Column bits and row bits of our own codes (0 where they are not coded)."""
        if isinstance(self.code, NoCode | CapturedCode):
            return 0, 0
        width, height = self.projector_size_px
        return (width - 1).bit_length(), (height - 1).bit_length() if self.code.rows else 0

    @property
    def code_count(self) -> int:
        """Frames of the code without white and black."""
        if isinstance(self.code, CapturedCode):
            return self.code.frame_count
        codes = 2 if isinstance(self.code, EnsembleCode) else 1
        return 2 * codes * sum(self.code_bits)

    @property
    def spectral_count(self) -> int:
        """Frames of the spectral pattern set."""
        width = self.projector_size_px[0]
        match self.spectral:
            case ScanLines(width_px=w, step_px=s):
                return max((width - w) // s + 1, 1)
            case LineComb(step_px=s, period_px=p):
                return -(-p // s)
            case Columns(levels=levels):
                return len(levels)
            case NoSpectral():
                return 0

    def shots(self) -> Iterator[Shot]:
        """Every exposure, in the order it is taken."""
        rounds, taken, index = dict(self._rounds()), list[Shot](), 0
        for i, setting in enumerate(self.settings):
            for role, count in self._roles(i):
                for pattern in range(count):
                    shot = Shot(index, role, pattern, i, setting.exposure_ms, setting.level)
                    yield shot
                    taken.append(shot)
                    index += 1
                    for place in rounds.get(len(taken), ()):
                        yield replace(taken[place], index=index, role="sentinel", pattern=taken[place].index)
                        index += 1

    def original(self, shot: Shot) -> Shot:
        """The shot that a sentinel repeats; any other shot as it is."""
        if shot.role != "sentinel":
            return shot
        return next(each for each in self.shots() if each.index == shot.pattern)

    def references(self) -> dict[Role, Shot]:
        """White, black and a frame of the code, by which changes of light and position are told.

        They are of the first setting that has the code; empty in plans without a code.
        """
        if not self.code_count:
            return {}
        setting = min(self.code_settings)
        wanted: dict[Role, int] = {"white": 0, "black": 0, "code": self._sentinel_code}
        of_setting = {(each.role, each.pattern): each for each in self.shots() if each.setting == setting}
        return {role: of_setting[role, pattern] for role, pattern in wanted.items()}

    @property
    def _sentinel_code(self) -> int:
        """The frame of the code that shows a small motion; of a code from elsewhere, any frame."""
        bit = min(_SENTINEL_BIT, self.code_bits[0] - 1)
        return min(max(2 * bit, 0), self.code_count - 1) if self.code_count else 0

    def _rounds(self) -> Iterator[tuple[int, tuple[int, ...]]]:
        """After how many other shots each round of sentinels comes, and which of these it repeats."""
        if self.sentinels is None:
            return
        first = min(self.code_settings)
        before = sum(count for i in range(first) for _, count in self._roles(i))
        codes, total = self.code_count, self._own_count
        code = self._sentinel_code
        white, black, line = before + codes, before + codes + (codes > 0), before + codes + 1 + (codes > 0)
        rounds = max(total // self.sentinels.every, 1)
        for number in range(1, rounds + 1):
            after = -(-number * total // rounds)
            lines = min(after - line, self.spectral_count)
            places = [white, black, before + code] if codes else [black]
            places += [line + lines // 2] if lines > 0 else []
            yield after, tuple(place for place in places if place < after)

    def _roles(self, setting: int) -> list[tuple[Role, int]]:
        """Roles of a setting in the order they are taken, and how many shots each has."""
        lines: tuple[Role, int] = ("spectral", self.spectral_count)
        # Black is taken at every setting: it is what every other frame of that setting is measured from.
        if setting in self.code_settings and not isinstance(self.code, NoCode):
            return [("code", self.code_count), ("white", 1), ("black", 1), lines]
        return [("black", 1), lines]

    @property
    def shot_count(self) -> int:
        """Number of exposures."""
        return self._own_count + self.sentinel_count

    @property
    def sentinel_count(self) -> int:
        """How many of the exposures repeat an old shot."""
        return sum(len(places) for _, places in self._rounds())

    @property
    def _own_count(self) -> int:
        return sum(count for i in range(len(self.settings)) for _, count in self._roles(i))

    @property
    def raw_bytes(self) -> int:
        """Bytes of all raw mosaics before compression (16 bit a pixel)."""
        return 2 * self.camera_size_px[0] * self.camera_size_px[1] * self.shot_count

    def duration_s(self, latency_ms: float = 0.0) -> float:
        """Seconds the exposures and a latency per frame take together."""
        return sum(shot.exposure_ms + latency_ms for shot in self.shots()) / 1000.0


def describe_shot(shot: Shot) -> str:
    """Name a shot the way a person counts it.

    >>> describe_shot(Shot(44, "spectral", 3, 1, 10.0, 0.8))
    'frame 45 (spectral pattern 4, setting 2)'
    """
    which, setting = spoken_number(shot.pattern), f"setting {spoken_number(shot.setting)}"
    if shot.role == "sentinel":
        return f"frame {shot.number} (frame {which} again, {setting})"
    return f"frame {shot.number} ({shot.role} pattern {which}, {setting})"
