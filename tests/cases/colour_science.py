"""colour-science, an independent reference for colours and their tables."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any


@cache
def colour_library() -> Any:
    """The package, imported without its notice about optional parts."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r'\W*"[\w-]+" related API features are not available')
        import colour
    return colour
