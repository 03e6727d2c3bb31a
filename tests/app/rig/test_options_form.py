"""Options of a rig as choices and as text."""

from __future__ import annotations

import shlex

import pytest
from dsl_app.connection.state import RigChoice
from dsl_app.rig.options_form import OptionsForm, SceneBox, parse_options
from pytestqt.qtbot import QtBot

SCENES = (("plane", "A white wall"), ("face", "A face"))


def _choose(box: SceneBox, name: str) -> None:
    box.fill()
    box.choose(name)
    box.activated.emit(box.currentIndex())


def test_choices_and_text_say_the_same(qtbot: QtBot) -> None:
    form, told = OptionsForm(lambda: SCENES), list[None]()
    qtbot.addWidget(form)
    form.chosen.connect(lambda: told.append(None))
    assert form.scene.currentData() == "color-checker"
    form.text.setText("seed=3 scene=plane size=64x48")
    assert form.scene.currentData() == "plane"
    assert form.size_px.currentText() == "64 × 48 px"
    assert told == [], "typing connects nothing"
    _choose(form.scene, "face")
    assert list(form.options) == [("scene", "face"), ("size", "64x48"), ("seed", "3")]
    assert form.text.text() == "seed=3", "what is chosen is not said twice"
    assert form.text.cursorPosition() == 0, "a long text shows its beginning"
    form.size_px.setCurrentIndex(0)
    form.size_px.activated.emit(0)
    assert list(form.options) == [("scene", "face"), ("seed", "3")]
    assert len(told) == 2


def test_all_scenes_are_listed_once_with_what_they_show(qtbot: QtBot) -> None:
    form = OptionsForm(lambda: SCENES)
    qtbot.addWidget(form)
    form.text.setText("scene=face")
    form.scene.fill()
    form.scene.fill()
    names = [form.scene.itemData(place) for place in range(form.scene.count())]
    assert sorted(names) == ["color-checker", "face", "plane"]
    assert form.scene.itemData(form.scene.findData("plane"), 3) == "A white wall"
    assert form.scene.currentData() == "face"


def test_other_rigs_have_no_scene(qtbot: QtBot) -> None:
    form = OptionsForm(lambda: SCENES)
    qtbot.addWidget(form)
    form.show_options((("scene", "face"),))
    form.set_rig("replay")
    assert not form.form.isRowVisible(form.scene)
    assert list(form.options) == []
    form.set_rig("twin")
    assert list(form.options) == [("scene", "face")]
    assert form.form.isRowVisible(form.scene)


@pytest.mark.parametrize(
    "value",
    [
        "/data/Max M/a b.dsl",
        r"C:\data\a b.dsl",
        r"C:\data\a.dsl",
        "/data/O'Brien/a b#1.dsl",
        '"b"',
        "",
    ],
)
def test_options_that_are_shown_are_read_back_whatever_they_contain(qtbot: QtBot, value: str) -> None:
    form = OptionsForm(lambda: SCENES)
    qtbot.addWidget(form)
    form.set_rig("replay")
    options = (("scan", value), ("realtime", "on"))
    form.show_options(options)
    assert form.options == options
    command = shlex.split(RigChoice("room 12", options).command)
    assert command == ["--rig", "room 12", "--option", f"scan={value}", "--option", "realtime=on"]


@pytest.mark.parametrize(
    ("typed", "value"),
    [
        ("scan='/a b.dsl'", "/a b.dsl"),
        ('scan="/a b.dsl"', "/a b.dsl"),
        ("'scan=/a b.dsl'", "/a b.dsl"),
        (r"scan=C:\a.dsl", r"C:\a.dsl"),
        ("scan=/O'Brien", "/O'Brien"),
        ("scan=a#1", "a#1"),
    ],
)
def test_quotes_hold_a_value_together(typed: str, value: str) -> None:
    assert parse_options(typed) == (("scan", value),)
