"""Everything an impatient user does, as far as there is something to see."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from dsl_app.scan.state import Phase
from dsl_app.shell.actions import PAGES

from tests.screens.results_scenes import opened
from tests.screens.scan_scenes import PATIENT, planned_scan
from tests.screens.stage import Stage


def damaged_settings(stage: Stage) -> None:
    """Settings that cannot be read, and some that make no sense."""
    home = stage.folder / "home"
    home.mkdir()
    (home / "settings.json").write_text("{ cut off")
    stage.open()
    stage.shoot()


def damaged_session(stage: Stage) -> None:
    """A crash that also cut off what was kept for after it; a scan whose manifest is cut off."""
    sessions = stage.folder / "home" / "sessions"
    sessions.mkdir(parents=True)
    (sessions / "session-999999.json").write_text("{ cut off")
    scans = stage.copied(stage.material.scans)
    for manifest in (scans / "chart.dsl").glob("*.json"):
        manifest.write_text("{ cut off")
    stage.open()
    stage.composition.session.start()
    stage.window.open_path(scans / "chart.dsl")
    stage.shoot()


def wrong_file(stage: Stage) -> None:
    """Files that are nothing, are gone, or are damaged results."""
    stage.open()
    cat = stage.folder / "cat.jpeg"
    cat.write_bytes(b"\xff\xd8")
    broken = stage.copied(stage.material.scans) / "chart.zarr"
    for part in broken.rglob("c"):
        for chunk in part.rglob("*"):
            if chunk.is_file():
                chunk.write_bytes(b"?")
    for path in (cat, Path("/media/stick/gone.zarr"), broken):
        stage.window.open_path(path)
        stage.idle()
    stage.shoot()


def two_scans(stage: Stage) -> None:
    """A second scan, a calibration and the live view while one runs."""
    stage.open()
    scan = planned_scan(stage, PATIENT)
    stage.press("Start scan", scan.page)
    stage.wait(lambda: scan.state.status.value.done > 2)
    scan.controller.start()
    stage.composition.live.start()
    stage.window.do("live_demo")
    stage.settle()
    stage.shoot()
    stage.press("Cancel", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.STOPPED)


def full_disk(stage: Stage) -> None:
    """The disk fills up while a scan runs."""
    stage.open()
    scan = planned_scan(stage)
    stage.wait(lambda: not stage.window.parts.runner.active)

    def full(descriptor: int) -> None:
        if scan.state.status.value.done >= 12:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", full)
        stage.press("Start scan", scan.page)
        stage.wait(lambda: scan.state.phase.value is Phase.LOST)
    stage.shoot()


def small(stage: Stage) -> None:
    """Every page in the smallest window."""
    opened(stage)
    stage.window.resize(1024, 700)
    for page in PAGES:
        stage.window.open_page(page.key)
        stage.idle()
        stage.shoot(page.key)


SCENES: dict[str, Callable[[Stage], None]] = {
    "trouble-damaged-settings": damaged_settings,
    "trouble-damaged-session": damaged_session,
    "trouble-wrong-file": wrong_file,
    "trouble-two-scans": two_scans,
    "trouble-full-disk": full_disk,
    "trouble-small": small,
}
