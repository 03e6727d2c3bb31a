"""Figures and origins as tables for people say them: the digits that are known, no records of programs."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping

import numpy as np


def header_lines(origin: Mapping[str, str]) -> list[str]:
    r"""Lines of a table for people about its origin: what only programs read is left out.

    Options, which are a JSON object of plain texts, are written as words.

    >>> header_lines({"rig": "twin", "options": '{"scene": "leaf"}', "stage_costs": '[{"seconds": 3.2}]'})
    ['# rig: twin\n', '# options: scene leaf\n']
    """
    said = ((key, _in_words(value)) for key, value in origin.items())
    return [f"# {key}: {words}\n" for key, words in said if words]


_TO_QUOTE = re.compile(r'[#,"\r\n]')


def csv_line(cells: Iterable[object]) -> str:
    r"""A row of a table as CSV, whose cells with ``#`` are quoted too: no reader takes them for a comment.

    >>> csv_line(["sample #3", "#1f77b4", "a, b", 7, None])
    '"sample #3","#1f77b4","a, b",7,\r\n'
    """
    texts = ("" if cell is None else str(cell) for cell in cells)
    quoted = ('"' + text.replace('"', '""') + '"' if _TO_QUOTE.search(text) else text for text in texts)
    return ",".join(quoted) + "\r\n"


def _in_words(value: str) -> str:
    if not value.startswith(("{", "[")):
        return value
    try:
        read = json.loads(value)
    except ValueError:
        return value
    if not isinstance(read, dict) or not all(isinstance(each, str) for each in read.values()):
        return ""
    return ", ".join(f"{key} {each}" for key, each in read.items())


#: Digits of a figure without a deviation, of a deviation, and of a figure beyond the first of its deviation.
_ALONE, _OF_DEVIATION, _BEYOND = 7, 3, 2


def figure_text(value: float, std: float = float("nan")) -> str:
    """A figure with two digits more than its standard deviation has; empty for no answer.

    Never more than the seven digits that single precision holds.

    >>> figure_text(0.30000001192, 0.0042), figure_text(0.30000001192), figure_text(700.1234, 0.11)
    ('0.30000', '0.3', '700.123')
    """
    if not np.isfinite(value):
        return ""
    if value == 0 or not np.isfinite(std) or std <= 0:
        return np.format_float_positional(value, _ALONE, unique=False, fractional=False, trim="0")
    decimals = _BEYOND - math.floor(math.log10(std))
    most = _ALONE - 1 - math.floor(math.log10(abs(value)))
    # Of a value far below its deviation all decimals of the deviation are said.
    return f"{value:.{max(min(decimals, most), 0)}f}"


def deviation_text(std: float) -> str:
    """A standard deviation with three digits; empty for no answer.

    >>> deviation_text(0.0042371)
    '0.00424'
    """
    if not np.isfinite(std):
        return ""
    return np.format_float_positional(std, _OF_DEVIATION, unique=False, fractional=False, trim="0")
