"""Hard cases of the binary code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from dsl_core.model.plan import GrayCode
from tests.cases.code_frames import code_images, decode
from tests.stability.case import Case, Outcome
from tests.stability.double_double import Floats

SIZE_PX = (640, 2)
CODE = GrayCode(rows=False)
PIXELS = SIZE_PX[0]


def _images(dtype: torch.dtype) -> tuple[Floats, Floats]:
    """Patterns and inverses as pixels of every column see them, (pairs, columns), 0 or 1."""
    seen = code_images(CODE, SIZE_PX)[:-2, 0] / 255
    kind = np.float32 if dtype == torch.float32 else np.float64
    return seen[0::2].astype(kind), seen[1::2].astype(kind)


def judge(positive: Floats, inverse: Floats, std: Floats | float | None = None) -> Outcome:
    """Every column right, or undecided."""
    found = decode(positive, inverse, CODE, SIZE_PX)
    undecided, wrong = found.undecided, found.column != np.arange(PIXELS)
    if (wrong & ~undecided).any():
        return Outcome("wrong", f"{int((wrong & ~undecided).sum())} columns decided, but wrong")
    if (found.likely_column < 0).any() or (found.likely_column >= PIXELS).any():
        return Outcome("wrong", "a likely column outside the projector")
    if undecided.all():
        return Outcome("flagged", "undecided")
    share = f"{int(undecided.sum())} of {PIXELS} undecided"
    return Outcome("flagged" if undecided.any() else "right", share)


def _scaled(scale: float) -> Callable[[torch.dtype], Outcome]:
    def run(dtype: torch.dtype) -> Outcome:
        one, other = _images(dtype)
        return judge(one * one.dtype.type(scale), other * other.dtype.type(scale))

    return run


def _with(value: float, both: bool) -> Callable[[torch.dtype], Outcome]:
    """One pair of half of the pixels replaced by a value."""

    def run(dtype: torch.dtype) -> Outcome:
        one, other = _images(dtype)
        one[4, ::2] = value
        if both:
            other[4, ::2] = value
        with np.errstate(invalid="ignore"):
            return judge(one, other)

    return run


def _million(dtype: torch.dtype) -> Outcome:
    """A million pixels decode like their columns alone."""
    one, other = (np.tile(images, (1, 1600)) for images in _images(dtype))
    found = decode(one, other, CODE, SIZE_PX)
    same = bool((found.column == np.tile(np.arange(PIXELS), 1600)).all()) and not found.undecided.any()
    return Outcome("right" if same else "wrong", f"{found.column.size} pixels")


def _one(dtype: torch.dtype) -> Outcome:
    one, other = (images[:, 417:418] for images in _images(dtype))
    found = decode(one, other, CODE, SIZE_PX)
    return Outcome("right" if found.column.tolist() == [417] else "wrong", "one pixel")


CASES = (
    Case("scale 1e-6 of the code", "frames of a millionth", _scaled(1e-6), "right"),
    Case("scale 1e6 of the code", "frames of a million", _scaled(1e6), "right"),
    Case("denormal code", "frames of 1e-40", _scaled(1e-40), "right"),
    Case("black code", "no light in any frame", _scaled(0.0), "flagged", "undecided"),
    Case("code of NaN", "one pair of every other pixel", _with(np.nan, False), "flagged", "320 of 640"),
    Case("code of infinity", "saturated pattern and inverse", _with(np.inf, True), "flagged", "320 of 640"),
    Case("equal pair", "pattern and inverse alike", _with(0.5, True), "flagged", "320 of 640"),
    Case("a million pixels of code", "as each column alone", _million, "right"),
    Case("one pixel of code", "as among others", _one, "right"),
)
