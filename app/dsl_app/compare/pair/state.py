"""Two results, or a result and its ground truth, side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.evented import Value
from dsl_app.shared.replaced import Stamp
from dsl_app.shared.spectrum import Pixel, number_text, number_with_std
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_app.shared.wording import short_name
from dsl_core.evaluation.summary import Truth
from dsl_core.evaluation.verdict import Verdict
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.scan.origin import rig_of_notes
from dsl_core.words import counted

Floats = NDArray[np.floating[Any]]


#: Why there is nothing to compare with, to write or to swap.
OPEN_A, OPEN_BOTH = "Open A first.", "Open A and B first."
TRUTH_IS_B = "The truth is always B: differences are those of a result from it."
#: Characters of the names of A and B beside the buttons that open them.
MOST_BESIDE = 20


class PairQuantity(Enum):
    """What the three pictures show."""

    DEPTH = "Depth"
    BAND = "Band"


@dataclass(frozen=True)
class Side:
    """A result with a name; ``truth`` is set when this side is the ground truth of a simulated scene.

    ``stamp`` is that of the result on disk when it was read.
    """

    name: str
    arrays: ResultArrays
    truth: Truth | None = None
    stamp: Stamp = None

    @property
    def is_simulated(self) -> bool:
        """Whether the simulated rig took it, which knows the truth."""
        origin = rig_of_notes(self.arrays.attributes)
        return origin is not None and origin[0] == "twin"

    def std(self, shown: PairQuantity, band: int, pixel: Pixel) -> float:
        """Standard deviation at a pixel; that of the truth is 0, NaN where a result states none."""
        name = "depth_std_mm" if shown is PairQuantity.DEPTH else "reflectance_std"
        if self.truth is not None:
            return 0.0
        if name not in self.arrays.arrays:
            return math.nan
        values = self.arrays.at(name, pixel)
        return float(values if shown is PairQuantity.DEPTH else values[band])


@dataclass(frozen=True)
class Pair:
    """Two sides of one size; differences are A minus B.

    ``bands`` pairs the bands of A and B that have the same wavelength; ``rows`` are the figures.
    """

    first: Side
    second: Side
    bands: tuple[tuple[int, int], ...]
    rows: tuple[Verdict, ...]

    def images(self, shown: PairQuantity, band: int) -> tuple[Floats, Floats] | None:
        """A and B as images (h, w); None where one of them lacks the quantity."""
        if shown is PairQuantity.DEPTH:
            return self.first.arrays["depth_mm"], self.second.arrays["depth_mm"]
        if not 0 <= band < len(self.bands):
            return None
        i, k = self.bands[band]
        return self.first.arrays["reflectance"][i], self.second.arrays["reflectance"][k]

    def stds(self, shown: PairQuantity, band: int, pixel: Pixel) -> tuple[float, float]:
        """Standard deviations of A and B at a pixel, as `Side.std` gives them."""
        i, k = (0, 0) if shown is PairQuantity.DEPTH else self.bands[band]
        return self.first.std(shown, i, pixel), self.second.std(shown, k, pixel)

    def mean_reflectance(self) -> tuple[Floats, Floats] | None:
        """Reflectance of A and B over their common bands, images (h, w); None where they have none.

        Bands that no pixel has in both are left out.
        """
        sums: list[Any] = [0.0, 0.0]
        count = 0
        for band in range(len(self.bands)):
            images = self.images(PairQuantity.BAND, band)
            assert images is not None
            if np.isfinite(images[0] - images[1]).any():
                sums = [
                    sum_ + np.asarray(image, np.float64) for sum_, image in zip(sums, images, strict=True)
                ]
                count += 1
        return (sums[0] / count, sums[1] / count) if count else None

    def nm(self, band: int) -> float:
        """Wavelength of a common band."""
        return float(self.first.arrays.wavelengths_nm[self.bands[band][0]])


class PairState:
    """Values that `PairController` sets and the page follows.

    ``busy`` says what is being read or compared (empty: nothing), ``trouble`` why two sides cannot be
    compared. ``at_hand`` is the result that the Results page shows.
    """

    def __init__(self) -> None:
        self.first: Value[Side | None] = Value(None)
        self.second: Value[Side | None] = Value(None)
        self.pair: Value[Pair | None] = Value(None)
        self.shown = Value(PairQuantity.DEPTH)
        self.band = Value(0)
        self.cursor: Value[Pixel | None] = Value(None)
        self.at_hand: Value[Path | None] = Value(None)
        self.busy = Value("")
        self.trouble = Value("")


@dataclass(frozen=True)
class PairDisplay:
    """What the panel of a pair shows, and which of its buttons can be used."""

    name_a: str
    name_b: str
    hint: LabelState
    open_first: ButtonState
    open_second: ButtonState
    at_hand: ButtonState
    truth: ButtonState
    swap: ButtonState
    report: ButtonState


def pair_display(state: PairState) -> PairDisplay:
    """What to show for a state."""
    first, second = state.first.value, state.second.value
    pair, busy = state.pair.value, state.busy.value
    name_a, name_b = ("–" if side is None else short_name(side.name, MOST_BESIDE) for side in (first, second))
    # Where the truth is known, it is what a single result is compared with.
    lacks_second = first is not None and second is None
    takes_truth = lacks_second and first is not None and first.is_simulated
    idle, has_truth = not busy, second is not None and second.truth is not None
    at_hand = _at_hand(state)
    hint = LabelState(f"{busy}…" if busy else "", "muted")
    return PairDisplay(
        name_a=f"A: {name_a}",
        name_b=f"B: {name_b}",
        hint=LabelState(state.trouble.value, "bad") if state.trouble.value else hint,
        open_first=ButtonState(is_enabled=idle, is_primary=first is None and not at_hand.is_visible),
        open_second=ButtonState(is_enabled=idle, is_primary=lacks_second and not takes_truth),
        at_hand=at_hand,
        truth=ButtonState(is_enabled=idle and first is not None, is_primary=takes_truth, why=OPEN_A),
        swap=ButtonState(
            is_enabled=idle and pair is not None and not has_truth,
            why=TRUTH_IS_B if has_truth else state.trouble.value or OPEN_BOTH,
        ),
        report=ButtonState(
            is_enabled=idle and pair is not None,
            is_primary=pair is not None,
            why=state.trouble.value or OPEN_BOTH,
        ),
    )


def side_texts(state: PairState) -> tuple[tuple[str, str], tuple[str, str]]:
    """Title and text of the places of A and B before both are there."""
    first, second = state.first.value, state.second.value
    if first is None:
        truth = ", or, if A is of the simulated rig, the true values of its scene."
    elif first.is_simulated:
        truth = ", or the true values of A's scene: choose Truth as B."
    else:
        truth = "."
    missing = (
        ("A: what you want to judge", "Choose Open A, or drop a result here (a folder NAME.zarr)."),
        ("B: what to compare it with", f"Another result of the same size in pixels{truth}"),
    )
    a, b = (
        text if side is None else (f"{letter}: {short_name(side.name)}", side_facts(side))
        for side, letter, text in zip((first, second), "AB", missing, strict=True)
    )
    return a, b


def side_facts(side: Side) -> str:
    """What a result is: its size, its bands and how much of it has a depth."""
    height, width = side.arrays.shape
    share = 100 * float(np.mean(np.isfinite(side.arrays["depth_mm"])))
    bands = counted(len(side.arrays.wavelengths_nm), "band")
    return f"{width} × {height} px, {bands}, {share:.0f} % of the pixels have a depth"


def _at_hand(state: PairState) -> ButtonState:
    """The button that takes the result of the Results page for a free side."""
    first, second, path = state.first.value, state.second.value, state.at_hand.value
    used = [side.arrays.path for side in (first, second) if side is not None]
    if path is None or path in used or len(used) == 2:
        return ButtonState(is_visible=False)
    side = "A" if first is None else "B"
    return ButtonState(
        is_enabled=not state.busy.value,
        is_primary=first is None,
        text=f"{short_name(path.stem, MOST_BESIDE)} as {side}",
        tip=f"Compare {path.stem}, which is open on the Results page",
    )


def cursor_text(state: PairState) -> str:
    """The values of both sides under the cursor and their difference, with standard deviations."""
    pair, pixel = state.pair.value, state.cursor.value
    images = None if pair is None else pair.images(state.shown.value, state.band.value)
    if pair is None or images is None:
        return ""
    if pixel is None:
        return "Point at a picture to compare values."
    a, b = (float(image[pixel[1], pixel[0]]) for image in images)
    std_a, std_b = pair.stds(state.shown.value, state.band.value, pixel)
    decimals, unit = (2, " mm") if state.shown.value is PairQuantity.DEPTH else (3, "")
    of_both = (("A", a, std_a), ("B", b, std_b), ("A − B", a - b, math.hypot(std_a, std_b)))
    values = "   ".join(
        f"{name} "
        + (
            number_with_std(value, std, decimals)
            if std > 0 and math.isfinite(value)
            else number_text(value, decimals)
        )
        for name, value, std in of_both
    )
    x_px, y_px = pair.first.arrays.in_picture(pixel)
    return f"column {x_px}, row {y_px}:   {values}{unit}"
