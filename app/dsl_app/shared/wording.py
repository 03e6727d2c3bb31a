"""Sentences of the engine as the window says them: what to click instead of options to type. No Qt."""

from __future__ import annotations

import re

_OVERRIDE = "tick 'Use despite different settings'"
#: What the engine says to those who type commands, and what stands for it in the window.
PHRASES = (
    (
        "If you mean that rig, name it with --rig and --option.",
        "If you mean that rig, connect it on the Rig page.",
    ),
    ("Name it with --rig and --option.", "Connect its rig on the Rig page."),
    (
        "To continue it, name its rig with --rig, and with --option and --set what it was begun with.",
        "To continue it, connect its rig first, and then open it again.",
    ),
    ("Leave out --rig and --option, or begin", "Connect that rig, or begin"),
    ("Name one with --calibration FILE.", "Choose one."),
    ("Name one with --calibration to reconstruct depth.", "Choose one to reconstruct depth."),
    ("or use it anyway with --override-calibration.", f"or {_OVERRIDE}."),
    ("or use this one anyway with --override-calibration.", f"or {_OVERRIDE}."),
    (" Name a twin of the scene with --truth-rig twin and --option.", ""),
    (" Name a twin of it with --truth-rig twin and --option.", ""),
    ("or let 'dsl-scan import FOLDER --guess' write one.", "or import the folder without one."),
    (": name one with --set", ""),
    ("or write a new one with 'dsl-scan plan'.", "or save another one on the Scan page."),
    ("'dsl-scan design' writes one.", "Open another one."),
    ("'dsl-scan rigs' lists them.", "The form on the Rig page lists them."),
    (
        "it is a scan; 'dsl-scan reconstruct' makes a result of it",
        "it is a scan; open and reconstruct it first",
    ),
    (", such as by 'dsl-scan spectra --at'.", "."),
    ("or export the columns with 'dsl-scan export'.", "or export the columns."),
    ("For a published dataset use 'dsl-scan import'.", "For a published dataset use File, Import."),
    ("; they give the camera's lens (--camera-only).", "."),
    ("; give --projector", ""),
    ("Give its right size (--projector).", "Correct the projector's size."),
    ("give --unit-mm 1000", "set their unit to 1000 mm"),
    ("give --unit-mm", "set their unit"),
    ("Correct --camera-size, or calibrate with that size.", "Choose the calibration of these pictures."),
    ("Correct --projector, or calibrate with that size.", "Correct the projector's size."),
)
#: The same with what changes in the middle of them.
PATTERNS = (
    (r"'dsl-scan calibrate geometry .* --pictures' reads", "the calibration of the geometry reads"),
    (r'pip install "dsl-scan\[(\w+)\]"', r"the extra \1 of dsl-scan"),
)


#: Characters of a name that a heading has room for in the smallest window.
MOST_CHARACTERS = 32


def short_name(name: str, most: int = MOST_CHARACTERS) -> str:
    """A name of at most so many characters: a longer one loses its middle, as its end tells it from others.

    >>> short_name("sample of the second day, third try", 20)
    'sample of…third try'
    """
    if len(name) <= most:
        return name
    ahead = (most - 1) // 2
    return f"{name[:ahead].rstrip()}…{name[len(name) - (most - 1 - ahead) :].lstrip()}"


#: An "x" between two numbers, which terminals of all kinds show.
_TIMES = re.compile(r"(?<=\d) x (?=\d)")


def in_window(text: str) -> str:
    """A sentence without options of commands, and with the sign that the window writes between sizes.

    >>> in_window("The scan contains no calibration. Name one with --calibration FILE.")
    'The scan contains no calibration. Choose one.'
    >>> in_window("The board of 7 x 5 inner corners was not found.")
    'The board of 7 × 5 inner corners was not found.'
    >>> in_window('Needs pip install "dsl-scan[ocean]" (seabreeze)')
    'Needs the extra ocean of dsl-scan (seabreeze)'
    """
    text = _TIMES.sub(" × ", text)
    if "--" in text or "dsl-scan" in text:
        for typed, clicked in PHRASES:
            text = text.replace(typed, clicked)
        for pattern, clicked in PATTERNS:
            text = re.sub(pattern, clicked, text)
    return text
