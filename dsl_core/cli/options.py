"""Options that several commands share, and how their text becomes records."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from dsl_core.errors import DeviceError, PlanError, StoreError
from dsl_core.words import readable

if TYPE_CHECKING:
    from dsl_core.model.plan import CapturePlan, SpectralSet
    from dsl_core.model.spectral import WavelengthGrid

T = TypeVar("T")
N = TypeVar("N", int, float)


def tab_rigs(incomplete: str) -> list[str]:
    """Names of rigs for the Tab key; quick, as no package is loaded."""
    from dsl_core.devices.registry import rig_names

    return [name for name in rig_names() if name.startswith(incomplete)]


def tab_calibrations(incomplete: str) -> list[str]:
    """Names in the library for the Tab key; where none fits, the shell offers files."""
    from dsl_core.io.calibration_library import CalibrationLibrary

    names = [name for name in CalibrationLibrary().names() if name.startswith(incomplete)]
    # Bash inserts what it gets as it is, other shells escape spaces themselves.
    in_bash = os.environ.get("_DSL_SCAN_COMPLETE") == "complete_bash"
    return [re.sub(r"([^\w.-])", r"\\\1", name) for name in names] if in_bash else names


def tab_codes(incomplete: str) -> list[str]:
    """Names of binary codes for the Tab key."""
    from dsl_core.model.presets import CODE_CHOICES

    return [choice.name for choice in CODE_CHOICES if choice.name.startswith(incomplete)]


def tab_plans(incomplete: str) -> list[str]:
    """Names of presets for the Tab key; where none fits, the shell offers files."""
    from dsl_core.model.presets import PRESETS

    return [preset.key for preset in PRESETS if preset.key.startswith(incomplete)]


def html_page(path: Path | None) -> Path | None:
    """The name of a page; raises `StoreError` for one that ends as another kind of file does."""
    from mimetypes import guess_type

    if path is not None and guess_type(path.name)[0] not in (None, "text/html"):
        raise StoreError(
            f"{path.name} is to be an HTML page, and its name ends in {path.suffix}. End it in .html."
        )
    return path


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]
Force = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
Report = Annotated[
    Path | None,
    typer.Option("--report", "-o", callback=html_page, help="Also write everything as an HTML page."),
]
RigName = Annotated[
    str,
    typer.Option("--rig", help="Name of a rig; 'dsl-scan rigs' lists them.", autocompletion=tab_rigs),
]
RigOptions = Annotated[
    list[str], typer.Option("--option", "-O", help="Option of the rig as key=value; may be repeated.")
]
Effects = Annotated[
    str | None,
    typer.Option(
        "--effects",
        help="What the twin renders: auto, all, none, usual, or names of effects separated by commas.",
    ),
]
Tolerance = Annotated[
    str | None,
    typer.Option("--tolerance", help="How far --effects auto may differ from all, like 1DN or 0.5sigma."),
]
CalibrationName = Annotated[
    str | None,
    typer.Option(
        "--calibration",
        help="A calibration: its library name, NAME@DATE, a rig's file or a campaign.",
        autocompletion=tab_calibrations,
    ),
]
OverrideCalibration = Annotated[
    bool,
    typer.Option(
        "--override-calibration", help="Use the calibration although camera or projector settings differ."
    ),
]
PlanSource = Annotated[
    str | None,
    typer.Option(
        "--plan",
        help="A file written by 'dsl-scan plan', or preview, comb, quick, coarse, balanced, columns or"
        " reference.",
        autocompletion=tab_plans,
    ),
]
Code = Annotated[
    str | None,
    typer.Option(
        "--code",
        help="Binary code: 'full' (columns and rows) or 'columns'; 'xor-04' and 'ensemble-04' for surfaces"
        " that light each other, 'xor-02' and 'ensemble-02' with stripes of 2 px; 'full-xor-04' with"
        " rows.",
        autocompletion=tab_codes,
    ),
]
Lines = Annotated[
    str | None, typer.Option("--lines", help="One line per frame, as WIDTHxSTEP in projector px, like 5x2.")
]
Comb = Annotated[
    str | None, typer.Option("--comb", help="Several lines per frame, as WIDTHxSTEPxPERIOD, like 5x2x106.")
]
Settings = Annotated[
    list[str],
    typer.Option("--setting", help="EXPOSURE_MS@LEVEL, like 166.7@0.2; repeat for a bracket, darkest first."),
]
Meter = Annotated[
    bool | None,
    typer.Option(
        "--match-exposure/--keep-exposure",
        help="Measure how bright the scene is first, and scale the exposures of the plan to it (usual, unless"
        " a file or --setting gives them).",
    ),
]
Sentinel = Annotated[
    bool | None,
    typer.Option(
        "--sentinels/--no-sentinels",
        help="Repeat a few old shots during the scan and at its end, to follow light and position (usual).",
    ),
]


@dataclass(frozen=True)
class PlanChoice:
    """The plan that the options of a command describe."""

    source: str | None = None
    code: str | None = None
    lines: str | None = None
    comb: str | None = None
    settings: Sequence[str] = ()
    sentinels: bool | None = None

    @property
    def is_written(self) -> bool:
        """Whether a file says exactly what to capture; any other plan is fitted to the rig."""
        return self.source is not None and not _is_preset(self.source)

    @property
    def is_exposed(self) -> bool:
        """Whether somebody chose exposures, in a file or by an option."""
        return self.is_written or bool(self.settings)

    def build(self) -> CapturePlan:
        """The plan; raises `PlanError` when the choices contradict each other or are impossible."""
        from dsl_core.model.plan import CUSTOM, CapturePlan
        from dsl_core.model.presets import preset_plan

        details = {
            "--code": self.code,
            "--lines": self.lines,
            "--comb": self.comb,
            "--setting": tuple(self.settings) or None,
            "--sentinels or --no-sentinels": self.sentinels,
        }
        given = [name for name, value in details.items() if value is not None]
        if self.source is not None:
            if given:
                raise PlanError(f"--plan gives the whole plan; leave out {', '.join(given)}, or --plan.")
            return plan_of(self.source)
        made = _checked("plan", lambda: CapturePlan.model_validate(self._fields()))
        return made if made == preset_plan(made.name) else made.model_copy(update={"name": CUSTOM})

    def _fields(self) -> dict[str, object]:
        from dsl_core.model.presets import CODE_CHOICES, code_of

        fields: dict[str, object] = {"sentinels": None if self.sentinels is False else {}}
        if self.code is not None:
            fields["code"] = code_of(self.code)
            if fields["code"] is None:
                names = ", ".join(choice.name for choice in CODE_CHOICES)
                raise PlanError(f"--code must be one of {names}, not {self.code!r}.")
        spectral = self._spectral()
        if spectral is not None:
            fields["spectral"] = spectral
        if self.settings:
            fields["settings"] = tuple(_setting(text) for text in self.settings)
            fields["code_settings"] = tuple(range(len(self.settings)))
        return fields

    def _spectral(self) -> SpectralSet | None:
        from dsl_core.model.plan import LineComb, ScanLines

        if self.lines is not None and self.comb is not None:
            raise PlanError("--lines and --comb cannot be combined; choose one.")
        if self.lines is not None:
            width, step = _lengths("--lines", self.lines, "WIDTHxSTEP")
            return _checked("--lines", lambda: ScanLines(width_px=width, step_px=step))
        if self.comb is not None:
            width, step, period = _lengths("--comb", self.comb, "WIDTHxSTEPxPERIOD")
            return _checked("--comb", lambda: LineComb(width_px=width, step_px=step, period_px=period))
        return None


def plan_of(source: str) -> CapturePlan:
    """The plan in a file, or of a preset where no file has that name; raises `PlanError`."""
    from dsl_core.io.plan_file import load_plan
    from dsl_core.model.presets import PRESETS, preset_plan

    path, preset = Path(source), preset_plan(source)
    if preset is not None and not path.exists():
        return preset
    if not path.suffix and not path.exists():
        known = ", ".join(preset.key for preset in PRESETS)
        raise PlanError(
            f"There is no plan {source!r}; give a file written by 'dsl-scan plan', or one of {known}."
        )
    return load_plan(path)


def _is_preset(source: str) -> bool:
    from dsl_core.model.presets import preset_plan

    return preset_plan(source) is not None and not Path(source).exists()


def parse_options(texts: Sequence[str]) -> dict[str, str]:
    """Options of a rig from texts like ``key=value``; raises `DeviceError`.

    >>> parse_options(["scene=plane", "size=112x72"])
    {'scene': 'plane', 'size': '112x72'}
    """
    options: dict[str, str] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not (key and sign):
            raise DeviceError(f"An option must be key=value, like scene=plane, not {text!r}.")
        if key in options:
            raise DeviceError(
                f"The option {key!r} is given twice: {options[key]!r} and {value!r}. Choose one."
            )
        options[key] = value
    return options


def with_effects(options: dict[str, str], effects: str | None, tolerance: str | None) -> dict[str, str]:
    """Options of a rig with those of effects; raises `DeviceError` where one is given both ways.

    >>> with_effects({"scene": "box"}, "auto", None)
    {'scene': 'box', 'effects': 'auto'}
    """
    given = {k: v for k, v in (("effects", effects), ("tolerance", tolerance)) if v is not None}
    twice = [key for key in given if key in options]
    if twice:
        raise DeviceError(f"Give {twice[0]} as --{twice[0]} or as --option {twice[0]}=..., not both.")
    return {**options, **given}


def parse_bands(text: str) -> WavelengthGrid:
    """Bands from ``START:STOP:STEP`` in nm; raises `PlanError`."""
    from dsl_core.model.spectral import WavelengthGrid

    start, stop, step = _parts("--bands", text, "START:STOP:STEP in nm, like 430:660:5", float, ":", 3)
    return _checked("--bands", lambda: WavelengthGrid(start_nm=start, stop_nm=stop, step_nm=step))


def parse_pixels(texts: Sequence[str]) -> list[tuple[int, int]]:
    """Pixels as (x, y) from texts like ``120,80``; raises `PlanError`.

    >>> parse_pixels(["120,80"])
    [(120, 80)]
    """
    wanted = "x,y in whole pixels, like 120,80"
    return [(x, y) for x, y in (_parts("--pixel", text, wanted, int, ",", 2) for text in texts)]


def parse_size(
    name: str, text: str, form: str = "WIDTHxHEIGHT", unit: str = "whole pixels"
) -> tuple[int, int]:
    """Width and height from ``890x580``, or what else the ``form`` says; raises `PlanError`."""
    width, height = _lengths(name, text, form, unit)
    return width, height


def parse_numbers(name: str, text: str) -> list[float]:
    """Finite numbers separated by commas; raises `PlanError`.

    >>> parse_numbers("--positions", "695.2, 707")
    [695.2, 707.0]
    """
    wanted = "numbers separated by commas, like 695.2,707,719"
    return _parts(name, text, wanted, float, ",", accept=math.isfinite)


def parse_region(name: str, text: str) -> tuple[int, int, int, int]:
    """Column, row, width and height from ``10,20,300,200``; raises `PlanError`."""
    x, y, width, height = _parts(name, text, "X,Y,WIDTH,HEIGHT in whole pixels", int, ",", 4)
    return x, y, width, height


def parse_span(name: str, text: str) -> tuple[float, float]:
    """Two wavelengths in nm from ``450:650``; raises `PlanError`."""
    low, high = _parts(name, text, "START:STOP in nm, like 450:650", float, ":", 2)
    return low, high


def parse_place(name: str, text: str) -> tuple[str, list[int]]:
    """A name and a pixel, or a rectangle, from ``leaf=120,80`` or ``leaf=120,80,10,10``; raises `PlanError`.

    >>> parse_place("--at", "leaf=120,80")
    ('leaf', [120, 80])
    """
    called, _, place = text.partition("=")
    wanted = "NAME=X,Y or NAME=X,Y,WIDTH,HEIGHT in whole pixels"
    numbers = _parts(name, place, wanted, int, ",") if called and place else []
    if len(numbers) not in (2, 4):
        raise PlanError(f"{name} must be {wanted}, not {text!r}.")
    return readable(called), numbers


def _lengths(name: str, text: str, form: str, unit: str = "whole pixels") -> list[int]:
    """Whole numbers separated by x, as many as their ``form`` has."""
    wanted = f"{form} in {unit} of at least 1"
    return _parts(name, text, wanted, int, "x", form.count("x") + 1, lambda length: length >= 1)


def _setting(text: str) -> dict[str, float]:
    exposure, level = _parts("--setting", text, "EXPOSURE_MS@LEVEL, like 166.7@0.2", float, "@", 2)
    return {"exposure_ms": exposure, "level": level}


def _parts(
    name: str,
    text: str,
    wanted: str,
    kind: type[N],
    separator: str,
    count: int = 0,
    accept: Callable[[N], bool] = lambda part: True,
) -> list[N]:
    """A text's numbers, ``count`` of them (0: any); raises `PlanError` that says what is ``wanted``."""
    try:
        parts = [kind(part) for part in text.lower().split(separator)]
    except ValueError:
        parts = []
    if not parts or count not in (0, len(parts)) or not all(map(accept, parts)):
        raise PlanError(f"{name} must be {wanted}, not {text!r}.")
    return parts


def _checked(name: str, make: Callable[[], T]) -> T:
    """What ``make`` makes; a value that its record refuses becomes a `PlanError`."""
    from pydantic import ValidationError

    from dsl_core.model.base import what_is_wrong

    try:
        return make()
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        gap = f" ({where})" if where else ""
        colon = ":" if first["type"] == "value_error" else ""
        raise PlanError(f"{name}{gap}{colon} {what_is_wrong(first)}. Change the value.") from error
