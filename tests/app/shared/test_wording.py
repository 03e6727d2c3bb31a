"""No sentence of the window names an option of a command."""

from __future__ import annotations

import re

from dsl_app.shared.notify import sentence_of
from dsl_app.shared.widget_state import LabelState
from dsl_app.shared.widgets.forms import Banner, label, show_label
from dsl_app.shared.wording import MOST_CHARACTERS, PHRASES, in_window, short_name
from pytestqt.qtbot import QtBot

from dsl_core.errors import CalibrationError
from tests.architecture.words import texts_now

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+|'dsl-scan ")
#: What makes command lines, in the window's own box for them, and what is printed in a terminal.
COMMANDS = (
    "app/dsl_app/__main__.py",
    "app/dsl_app/compare/series/controller.py",
    "app/dsl_app/connection/state.py",
    "app/dsl_app/importing/captures/command_line.py",
    "app/dsl_app/importing/state.py",
    "app/dsl_app/results/reconstruct_again/state.py",
    "app/dsl_app/rig/projector_process.py",
    "app/dsl_app/scan/command_line.py",
    "app/dsl_app/scan/controller.py",
    "dsl_core/campaign/guide.py",
    "dsl_core/campaign/products.py",
    "dsl_core/cli/",
    "dsl_core/devices/drivers/screen.py",
    "dsl_core/workflows/batch/",
    "resources/",
    "README.md",
)
SENTENCE = (
    "The calibration is not for these devices. Set them back, or use it anyway with --override-calibration."
)


def test_no_sentence_of_the_window_names_an_option() -> None:
    found = [
        f"{each.path}:{each.line}: {each.text.strip()}"
        for each in texts_now()
        if not each.path.startswith(COMMANDS)
        and OPTION.search(in_window(each.text))
        and "var(--" not in each.text
    ]
    assert found == [], "say in dsl_app.shared.wording what to click instead"


def test_what_is_replaced_is_still_said_by_the_engine() -> None:
    said = "\n".join(each.text for each in texts_now() if each.path.startswith("dsl_core/"))
    assert [typed for typed, _ in PHRASES if typed not in said] == []


def test_errors_labels_and_banners_say_what_to_click(qtbot: QtBot) -> None:
    line, banner = label(""), Banner("Resume", "", None)
    qtbot.addWidget(line)
    qtbot.addWidget(banner)
    show_label(line, LabelState(SENTENCE))
    banner.say(SENTENCE)
    for text in (line.text(), banner.text, sentence_of(CalibrationError(SENTENCE))):
        assert text.endswith("or tick 'Use despite different settings'.")


def test_sizes_are_written_with_the_sign_of_the_window() -> None:
    assert in_window("7 x 5 corners, 640 x 360 px; x 3, a x b") == "7 × 5 corners, 640 × 360 px; x 3, a x b"
    assert sentence_of(CalibrationError("It is 64 x 48 px.")) == "It is 64 × 48 px."


def test_a_long_name_keeps_its_ends() -> None:
    name = "sample of the second day, third try, with the new film"
    short = short_name(name)
    assert len(short) <= MOST_CHARACTERS
    assert (short[:6], short[-8:]) == ("sample", "new film")
    assert short_name("scan-20261127-2113") == "scan-20261127-2113"
