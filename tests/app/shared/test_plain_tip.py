from __future__ import annotations

import pytest
from dsl_app.shared.plain_tip import plain_tip
from PySide6.QtGui import Qt, QTextDocument


@pytest.mark.parametrize(
    "text",
    [
        "scans/leaf.zarr",
        "scans/<b>leaf</b>.zarr",
        "<img src='other.png'> & <table>",
        "a &lt; b",
        "first line\n<i>second line</i>",
        "less than 3 < 4",
    ],
)
def test_a_tooltip_shows_a_text_as_it_is(text: str) -> None:
    shown = QTextDocument()
    tip = plain_tip(text)
    if Qt.mightBeRichText(tip):
        shown.setHtml(tip)
    else:
        shown.setPlainText(tip)
    assert shown.toPlainText() == text
