"""Settings of calibrations in the words of the window. No Qt."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

#: Settings in words, where their keys do not say what they are.
TITLES = {
    "chain": "Correct the chain of light",
    "chart": "Reflectances of the chart",
    "code_step_px": "Step of the lines without filter (px)",
    "corners_px": "Corners of the chart by hand (px)",
    "depth_mm": "Distance of the target (mm)",
    "emission_folder": "Folder with spectra of the LEDs",
    "filter_step_px": "Step of the lines through a filter (px)",
    "filters_nm": "Centres of the filters (nm)",
    "fwhm_nm": "Width of the filters, where not measured (nm)",
    "grid": "Model columns from the data, too",
    "left_out": "Steps to leave out of the fit",
    "line_px": "Width of a line (px)",
    "long_ratio": "Second exposure, times the first",
    "pixels": "Camera pixels that are used",
    "poses": "Poses of the board",
    "positions_mm": "Positions of the stage (mm)",
    "ratio": "Second exposure, times the first",
    "readings": "Readings of each spectrum",
    "reflectance": "Reflectance of the target",
    "reflectance_file": "File with the target's reflectance",
    "reflectance_rel_std": "Uncertainty of that reflectance (share)",
    "stage_std_mm": "Uncertainty of the stage (mm)",
    "wanted_ms": "Exposures that scans will use (ms)",
}
#: Units that end names of settings, and how the window shows them.
_UNITS = {"nm": "nm", "mm": "mm", "ms": "ms", "px": "px", "deg": "°"}
#: Lengths of a printed board.
_SIZES = (("square_mm", "squares"), ("marker_mm", "markers"))


def setting_title(key: str) -> str:
    """The name of a setting as the window shows it.

    >>> setting_title("stage_std_mm"), setting_title("tilt_deg"), setting_title("board")
    ('Uncertainty of the stage (mm)', 'Tilt (°)', 'Board')
    """
    if key in TITLES:
        return TITLES[key]
    *words, last = key.split("_")
    if words and last in _UNITS:
        return f"{' '.join(words).capitalize()} ({_UNITS[last]})"
    return " ".join((*words, last)).capitalize()


def setting_words(key: str, text: str) -> str:
    """A setting with its value as a clause for people to read; ``text`` is as a campaign keeps it.

    >>> setting_words("positions_mm", "650,700"), setting_words("chain", "false")
    ('Positions of the stage: 650, 700 mm', 'Correct the chain of light: no')
    >>> setting_words("board", '{"kind":"checkerboard","columns":11,"rows":7,"square_mm":20.0}')
    'Board: 11 × 7 corners, squares of 20 mm'
    """
    title = setting_title(key)
    name, _, unit = title.removesuffix(")").partition(" (")
    if unit not in _UNITS.values():
        name, unit = title, ""
    return f"{name}: {_value_words(text)} {unit}".rstrip()


def _value_words(text: str) -> str:
    try:
        value = json.loads(text)
    except ValueError:
        return text.replace(",", ", ")
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return _board_words(value)
    return _list_words(value) if isinstance(value, list) else text


def _board_words(board: Mapping[str, Any]) -> str:
    """A printed board, counted as its kind is: a checkerboard in corners, one with markers in squares."""
    counted = "corners" if board.get("kind") == "checkerboard" else "squares with markers"
    size = f"{board.get('columns')} × {board.get('rows')} {counted}"
    parts = [
        f"{name} of {board[key]:g} mm" for key, name in _SIZES if isinstance(board.get(key), int | float)
    ]
    return ", ".join((size, *parts))


def _list_words(values: list[Any]) -> str:
    """Numbers one after the other; points in brackets."""
    return ", ".join(f"({_list_words(each)})" if isinstance(each, list) else str(each) for each in values)
