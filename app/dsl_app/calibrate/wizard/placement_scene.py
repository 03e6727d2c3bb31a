"""A placement as a small scene: the corners of the target, what is in the beam, and all of it in words.

Sizes are those of common targets in front of the published rig's camera; a drawing of them tells a person
what to do and is not a measurement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dsl_core.model.placement import Placement

#: Width over height of the camera's picture, its focal length in widths, and where its axis meets it.
PICTURE_ASPECT, FOCAL_WIDTHS, AXIS = 890 / 580, 1.98, (0.482, 0.508)
DEFAULT_DEPTH_MM = 700.0
#: Half width and height of a Spectralon and of the classic chart with its frame, mm.
SPECTRALON_HALF_MM, CHART_HALF_MM = (170.0, 150.0), (161.0, 109.0)
#: Distance between patches of the chart and their side, mm; white rim of a printed board, mm.
PATCH_PITCH_MM, PATCH_MM, BOARD_RIM_MM = 52.0, 44.0, 10.0
#: The 24 patches in sRGB, in reading order.
CHART_COLOURS = (
    "#735244", "#c29682", "#627a9d", "#576c43", "#8580b1", "#67bdaa",
    "#d67e2c", "#505ba6", "#c15a63", "#5e3c6c", "#9dbc40", "#e0a32e",
    "#383d96", "#469449", "#af363c", "#e7c71f", "#bb5695", "#0885a1",
    "#f3f3f2", "#c8c8c8", "#a0a0a0", "#7a7a79", "#555555", "#343434",
)  # fmt: skip
NAMES = {
    "as it is": "target as it is",
    "nothing": "nothing",
    "board": "printed board",
    "spectralon": "white target",
    "color-checker": "Color Checker",
}

Point = tuple[float, float]
Point3 = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """A rectangle of a target in its own plane, mm, and its colour (``#rrggbb``)."""

    left_mm: float
    top_mm: float
    right_mm: float
    bottom_mm: float
    colour: str

    @property
    def corners(self) -> tuple[Point, ...]:
        """Its four corners, clockwise from the upper left."""
        return (
            (self.left_mm, self.top_mm),
            (self.right_mm, self.top_mm),
            (self.right_mm, self.bottom_mm),
            (self.left_mm, self.bottom_mm),
        )


@dataclass(frozen=True)
class Face:
    """A flat target in front of the camera: place of its middle (mm), angles (degrees), half sizes (mm)."""

    target: str
    middle_mm: Point3
    tilt_x_deg: float
    tilt_y_deg: float
    roll_deg: float
    half_mm: Point
    squares: tuple[int, int] = (0, 0)

    @classmethod
    def of(cls, placement: Placement) -> Face | None:
        """The target of a placement; None where nothing particular is to be placed."""
        if placement.target in ("as it is", "nothing"):
            return None
        options = placement.options
        half, squares = SPECTRALON_HALF_MM, (0, 0)
        if placement.target == "color-checker":
            half = CHART_HALF_MM
        elif placement.target == "board":
            squares = (int(number(options, "columns", 11)) + 1, int(number(options, "rows", 7)) + 1)
            side = number(options, "square_mm", 20.0)
            half = (squares[0] * side / 2 + BOARD_RIM_MM, squares[1] * side / 2 + BOARD_RIM_MM)
        return cls(
            placement.target,
            (number(options, "x_mm"), number(options, "y_mm"), number(options, "depth_mm", DEFAULT_DEPTH_MM)),
            number(options, "tilt_x_deg"),
            number(options, "tilt_y_deg"),
            number(options, "roll_deg"),
            half,
            squares,
        )

    def at(self, across_mm: float, down_mm: float) -> Point3:
        """A point of the target's plane in camera coordinates, mm."""
        a, b, c = (math.radians(angle) for angle in (self.tilt_x_deg, self.tilt_y_deg, self.roll_deg))
        u = math.cos(c) * across_mm - math.sin(c) * down_mm
        v = math.sin(c) * across_mm + math.cos(c) * down_mm
        x, y, z = self.middle_mm
        return (
            x + u * math.cos(b) - v * math.sin(a) * math.sin(b),
            y + v * math.cos(a),
            z + u * math.sin(b) + v * math.sin(a) * math.cos(b),
        )

    def in_picture(self, across_mm: float, down_mm: float) -> Point:
        """Where the camera sees it: shares of the picture's width and height, 0 to 1 within it."""
        x, y, z = self.at(across_mm, down_mm)
        return AXIS[0] + FOCAL_WIDTHS * x / z, AXIS[1] + FOCAL_WIDTHS * PICTURE_ASPECT * y / z

    @property
    def found_half_mm(self) -> Point | None:
        """Half sizes between the points that a look finds: outermost corners of squares or of patches."""
        if self.target == "board":
            side = 2 * (self.half_mm[0] - BOARD_RIM_MM) / self.squares[0]
            return (self.squares[0] / 2 - 1) * side, (self.squares[1] / 2 - 1) * side
        if self.target == "color-checker":
            return 2.5 * PATCH_PITCH_MM + PATCH_MM / 2, 1.5 * PATCH_PITCH_MM + PATCH_MM / 2
        return None

    @property
    def sheet(self) -> Part:
        """All of it."""
        (half_x, half_y) = self.half_mm
        dark = self.target == "color-checker"
        return Part(-half_x, -half_y, half_x, half_y, "#1c1c1e" if dark else "#f4f3ee")

    def parts(self) -> Iterator[Part]:
        """What is printed on it: black squares, or coloured patches."""
        if self.target == "board":
            side = 2 * (self.half_mm[0] - BOARD_RIM_MM) / self.squares[0]
            left, top = (BOARD_RIM_MM - half for half in self.half_mm)
            for row in range(self.squares[1]):
                for column in range(row % 2, self.squares[0], 2):
                    x, y = left + column * side, top + row * side
                    yield Part(x, y, x + side, y + side, "#1c1c1e")
        elif self.target == "color-checker":
            for index, colour in enumerate(CHART_COLOURS):
                x = (index % 6 - 2.5) * PATCH_PITCH_MM
                y = (index // 6 - 1.5) * PATCH_PITCH_MM
                yield Part(x - PATCH_MM / 2, y - PATCH_MM / 2, x + PATCH_MM / 2, y + PATCH_MM / 2, colour)

    @property
    def distance_text(self) -> str:
        """Distance from the camera, in cm."""
        return f"{self.middle_mm[2] / 10:.1f}".removesuffix(".0") + " cm"

    @property
    def turns(self) -> tuple[str, ...]:
        """How it is turned, in words; empty for a target that faces the camera upright."""
        return tuple(
            f"{words} {abs(angle):.0f}°"
            for words, angle in (
                (f"{'lower' if self.tilt_x_deg > 0 else 'upper'} edge away by", self.tilt_x_deg),
                (f"{'right' if self.tilt_y_deg > 0 else 'left'} edge away by", self.tilt_y_deg),
                (f"turned {'clockwise' if self.roll_deg > 0 else 'anticlockwise'} by", self.roll_deg),
            )
            if abs(angle) >= 1
        )


def number(options: Mapping[str, float | str], name: str, default: float = 0.0) -> float:
    """An option as a number; the default if it is not a number."""
    try:
        return float(options.get(name, default))
    except ValueError:
        return default


def film_text(placement: Placement) -> str:
    """Whether the film is mounted, in short."""
    return "film on" if placement.film else "film off"


def in_words(placement: Placement) -> str:
    """The whole placement in sentences, for people who do not see the drawing."""
    face, name = Face.of(placement), NAMES[placement.target]
    if face is not None:
        how = ", ".join(face.turns) or "facing it"
        first = f"A {name} {face.distance_text} from the camera, {how}."
    elif placement.target == "nothing":
        first = "Nothing in front of the camera."
    else:
        first = "The target stays as it is."
    film = "The film is mounted in front of the projector." if placement.film else "The film is off."
    nm = placement.filter_nm
    last = "No filter is on the camera." if nm is None else f"A filter of {nm:g} nm is on the camera."
    return f"{first} {film} {last}"
