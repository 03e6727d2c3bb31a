"""What belongs to no page: log, help, windows of text, toasts, tour, recovery, menus."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path

from dsl_app.importing.dialog import ImportDialog
from dsl_app.session.records import ResultsPart, Session
from dsl_app.session.store import SessionStore
from dsl_app.shell.actions import PAGES
from dsl_app.shell.tour import Tour
from PySide6.QtWidgets import QMenu

from tests.app.importing.published_folders import make_folders
from tests.screens.results_scenes import marked
from tests.screens.stage import Stage


def log(stage: Stage) -> None:
    """The log below a page."""
    stage.open()
    stage.connect()
    for level, text in (
        (logging.INFO, "Connected the twin of GS3-U3-32S4C."),
        (logging.WARNING, "Frame 17 arrived late and was captured again."),
        (logging.ERROR, "The camera does not answer. Check its cable and power."),
    ):
        logging.getLogger("dsl_core.capture").log(level, text)
    stage.window.do("show_log")
    stage.shoot()
    # The dock outlives the window in its settings only.
    stage.window.do("show_log")


def texts(stage: Stage) -> None:
    """Windows that only show text."""
    stage.open()
    for page in PAGES:
        stage.window.open_page(page.key)
        stage.window.do("help_page")
        stage.shoot(f"help-{page.key}")
        _close(stage)
    stage.window.open_page("scan")
    for key in ("shortcuts", "about", "show_command"):
        stage.window.do(key)
        stage.shoot(key.replace("_", "-"))
        _close(stage)


def _close(stage: Stage) -> None:
    for dialog in stage.dialogs:
        dialog.close()
    stage.settle()


def toasts(stage: Stage) -> None:
    """Messages of all kinds, each in front of those before it, and one that is too long for its place."""
    stage.open()
    tell = stage.window.toasts
    tell.tell("info", "Written: chart.ply, chart.csv.")
    stage.shoot("info")
    tell.tell("warning", "The settings could not be saved: No space left on device.")
    stage.shoot("warning")
    tell.tell("error", "The camera does not answer. Check its cable and power.", "Frame 17 of 129\nattempt 3")
    stage.shoot("error")
    tell.offer("New here? A tour of seven steps shows what is where.", {"Take the tour": lambda: None})
    stage.shoot("offer")
    tell.tell("error", " ".join(f"The file /lab/2026/scans/chart-{i}.zarr is damaged." for i in range(20)))
    stage.shoot("long")


def tour(stage: Stage) -> None:
    """Every step of the tour."""
    stage.open()
    stage.connect()
    stage.window.do("tour")
    made = stage.window.findChild(Tour)
    assert made is not None
    ended = list[bool]()
    made.ended.connect(lambda: ended.append(True))
    number = 0
    while not ended:
        number += 1
        stage.idle()
        stage.shoot(str(number))
        made.next.click()


def recovery(stage: Stage) -> None:
    """After a crash: what was open is offered, and comes back."""
    scans = stage.copied(stage.material.scans)
    part = ResultsPart(path=scans / "chart.zarr", view="view_depth", cursor=(60, 40))
    _crash(stage.folder / "home" / "sessions", Session(page="results", results=part))
    stage.open()
    stage.composition.session.start()
    stage.shoot()
    stage.press("Restore session")
    stage.wait(lambda: stage.window.page == "results")
    stage.idle()
    stage.shoot("opened")


def _crash(folder: Path, session: Session) -> None:
    """Leave the session of a program behind that is no more."""
    process = os.spawnlp(os.P_NOWAIT, "true", "true")
    os.waitpid(process, 0)
    assert not SessionStore(folder, lambda: session, process).save()


def take_in(stage: Stage) -> None:
    """Import: a folder with flaws, one that can be imported, a calibration, and one that is none of them."""
    folders = make_folders(stage.folder)
    lines = folders.scene / "ldr_exposure1"
    gone = lines / "capture_0002.png"
    kept = gone.read_bytes()
    gone.unlink()
    (lines / "capture_0004.png").rename(lines / "line 4.png")
    (lines / "white.png").write_bytes(kept)
    stage.open()
    stage.window.open_path(folders.scene)
    dialog = stage.dialog(ImportDialog)
    stage.shoot("flaws")
    gone.write_bytes(kept)
    stage.composition.importer.control.change(base=str(folders.own))
    stage.idle()
    stage.shoot("ready")
    for name, folder in (("calibration", folders.rig), ("nothing", folders.folder)):
        stage.composition.importer.look(folder)
        stage.idle()
        stage.shoot(name)
    stage.composition.importer.look(folders.scene)
    stage.idle()
    stage.press("Import", dialog)
    stage.wait(lambda: stage.window.page == "results", 60)
    stage.idle()
    stage.shoot("done")


def menus(stage: Stage) -> None:
    """Every menu, open over a result."""
    marked(stage)
    stage.window.parts.recent.add(stage.folder / "gone.zarr")
    for action in stage.window.menuBar().actions():
        menu = action.menu()
        assert isinstance(menu, QMenu)
        corner = stage.window.menuBar().actionGeometry(action).bottomLeft()
        menu.popup(stage.window.menuBar().mapToGlobal(corner))
        stage.shoot(action.text().replace("&", "").lower())
        menu.close()


SCENES: dict[str, Callable[[Stage], None]] = {
    "shell-log": log,
    "shell-text": texts,
    "shell-toasts": toasts,
    "shell-tour": tour,
    "shell-recovery": recovery,
    "shell-import": take_in,
    "shell-menu": menus,
}
