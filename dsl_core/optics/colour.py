"""From reflectance spectra to colours seen under daylight."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any


@cache
def colour_library() -> Any:
    """The colour-science package, imported late (seconds) and without its notice about optional parts."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="colour")
        import colour
    return colour
