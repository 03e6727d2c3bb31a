"""What the twin offers: a record of its options, read from text and listed by ``dsl-scan rigs``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Annotated

from pydantic import BeforeValidator, Field, ValidationInfo

from dsl_core.errors import DeviceError
from dsl_core.model.base import Record
from dsl_core.simulation.effects.catalogue import Choice
from dsl_core.simulation.effects.depth_of_field import DepthOfField
from dsl_core.simulation.effects.tolerance import Tolerance
from dsl_core.simulation.foreign.variants import VARIANTS, Foreign
from dsl_core.simulation.rendered_scene import AMBIENT_DN_PER_MS


def number(name: str, value: object) -> float:
    """A number of at least 0 from text; raises `DeviceError`."""
    try:
        found = float(str(value))
    except ValueError:
        found = math.nan
    if not math.isfinite(found) or found < 0:
        raise DeviceError(f"The twin's option {name} must be a number of at least 0, not {value!r}.")
    return found


def _number(value: object, info: ValidationInfo) -> float:
    return number(str(info.field_name), value)


def _positive(value: object, info: ValidationInfo) -> float:
    found = number(str(info.field_name), value)
    if found == 0:
        raise DeviceError(f"The twin's option {info.field_name} must be above 0, not {value!r}.")
    return found


def _whole(value: object, info: ValidationInfo) -> int:
    found = number(str(info.field_name), value)
    if not found.is_integer():
        raise DeviceError(f"The twin's option {info.field_name} must be a whole number, not {value!r}.")
    return int(found)


def _switch(value: object, info: ValidationInfo) -> bool:
    if value not in ("on", "off"):
        raise DeviceError(f"The twin's option {info.field_name} must be 'on' or 'off', not {value!r}.")
    return value == "on"


def _device(value: object) -> str:
    if value not in ("cpu", "cuda"):
        raise DeviceError(f"The twin's option device must be 'cpu' or 'cuda', not {value!r}.")
    return str(value)


def _size(value: object) -> tuple[int, int] | None:
    if value == "":
        return None
    try:
        width, height = (int(part) for part in str(value).lower().split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise DeviceError(
            f"The twin's size must be like 890x580 (16 to 4096 pixels per side), not {value!r}."
        )
    return width, height


Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[float, BeforeValidator(_positive)]
Whole = Annotated[int, BeforeValidator(_whole)]
Switch = Annotated[bool, BeforeValidator(_switch)]


class TwinOptions(Record):
    """Options of the twin. All others are those of its scene, which ``dsl-scan scenes`` lists."""

    scene: str = Field(
        default="color-checker", description="scene in front of the camera; its options can be added"
    )
    size: Annotated[tuple[int, int] | None, BeforeValidator(_size)] = Field(
        default=None,
        description="width and height of the camera's image, such as 112x72; 890x580 if not given",
    )
    seed: Whole = Field(default=0, description="seed of the noise")
    noise: Switch = Field(default=True, description="noise of camera and spectroradiometer, on or off")
    sigma: Number = Field(
        default=0.0, description="additional Gaussian noise, of full scale; known to the calibration"
    )
    film: Switch = Field(default=True, description="diffraction film in front of the projector, on or off")
    device: Annotated[str, BeforeValidator(_device)] = Field(
        default="cpu", description="where pictures are computed: cpu or cuda"
    )
    realtime: Switch = Field(default=False, description="on: waits as long as real devices would")
    effects: str = Field(
        default="usual",
        description="effects of light: usual, all, none, names, or auto: what the scene calls for",
    )
    tolerance: str = Field(
        default="1DN", description="the most that auto may change a picture, such as 0.5sigma"
    )
    truth: Whole | None = Field(
        default=None,
        description="number of a rig drawn around the published one, whose calibration is unknown",
    )
    foreign: str = Field(
        default="",
        description="what the twin does and its solver does not assume: all, or some of "
        + "; ".join(f"{name} ({summary})" for name, summary in VARIANTS.items()),
    )
    led_cycle_hz: Number = Field(
        default=0.0, description="how often the LEDs flash in turn; 0: they shine steadily"
    )
    ambient_dn_per_ms: Number = Field(default=AMBIENT_DN_PER_MS, description="light of the room")
    defocus_px: Number = Field(default=0.0, description="blur of a camera that is out of focus")
    brightness: Positive = Field(
        default=1.0, description="light of the projector, relative to the published rig"
    )

    # What a person might do wrong, to try out how calibrations notice.
    wrong_filter_nm: Number | None = Field(
        default=None, description="filter in the beam, whichever was requested"
    )
    filter_tilt_deg: Number = Field(default=0.0, description="tilt of the filters")
    filter_off_nm: Number = Field(
        default=0.0, description="how much longer wavelengths than measured all filters pass"
    )
    bow_mm: Number = Field(default=0.0, description="how far diffusers bulge over 300 mm")
    stage_scale: Positive = Field(
        default=1.0, description="how far the stage moves from 700 mm, relative to what it reports"
    )
    chart_roll_deg: Number = Field(
        default=0.0, description="how much further a chart is turned than requested"
    )
    board_shift_mm: Number = Field(
        default=0.0, description="how far a board stands to the right of its place"
    )
    print_scale: Positive = Field(
        default=1.0, description="size of a printed board, relative to what it should be"
    )
    target_missing: Switch = Field(default=False, description="on: a wall instead of a board or a chart")

    @classmethod
    def of(cls, options: dict[str, str]) -> tuple[TwinOptions, dict[str, str]]:
        """The twin's options from text, and the others, which are the scene's; raises `DeviceError`.

        >>> TwinOptions.of({"noise": "off", "depth_mm": "650"})[1]
        {'depth_mm': '650'}
        """
        own = {name: text for name, text in options.items() if name in cls.model_fields}
        made = cls.model_validate(own)
        _ = made.choice, made.limit, made.foreigners  # a wrong text is told now
        return made, {name: text for name, text in options.items() if name not in own}

    @classmethod
    def meant(cls, names: Iterable[str]) -> str:
        """A question on names that are nearly those of options of the twin, with a space before it; or "".

        >>> TwinOptions.meant(["sizze", "depth_mm"])
        ' Did you mean size?'
        """
        near = [get_close_matches(name, cls.model_fields, n=1, cutoff=0.75) for name in names]
        found = [each[0] for each in near if each]
        return f" Did you mean {' and '.join(found)}?" if found else ""

    @property
    def choice(self) -> Choice:
        """The effects to render."""
        return Choice.of(self.effects)

    @property
    def foreigners(self) -> Foreign | None:
        """The foreign variants, drawn for the rig; None without any.

        Raises `DeviceError` where they are not rendered with the effects that are chosen.
        """
        found = Foreign.of(self.foreign, self.truth or 0)
        names = self.choice.names
        if found is not None and (names is None or DepthOfField.name in names):
            raise DeviceError(
                "Foreign variants are rendered without depth of field, but effects are"
                f" {self.effects!r}. Use usual, none, or names without {DepthOfField.name}."
            )
        return found

    @property
    def limit(self) -> Tolerance:
        """The tolerance of effects that the scene decides on."""
        return Tolerance.of(self.tolerance)
