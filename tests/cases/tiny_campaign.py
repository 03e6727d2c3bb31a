"""The smallest campaign in which every calibration reaches its limits, by the real command."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dsl_core.cli import main
from dsl_core.io.campaign_folder import CampaignFolder

ROOT = Path(__file__).parents[2]
OPTIONS = {"size": "112x72", "truth": "4"}
SETTINGS = (
    "geometry.board=" + '{"kind":"checkerboard","columns":7,"rows":5,"square_mm":30}',
    "geometry.poses=4",
    "bandpass.filters_nm=450:650:50",
    "bandpass.pixels=1500",
    "depth-stage.positions_mm=620,740,850",
    "depth-stage.filters_nm=450,640",
    "depth-stage.code_step_px=5",
    "depth-stage.chain=false",
)


def command_all(folder: Path) -> list[str]:
    """The command that calibrates everything in ``folder``."""
    options = [f"--option={name}={value}" for name, value in OPTIONS.items()]
    settings = [f"--set={setting}" for setting in SETTINGS]
    return ["calibrate", "all", str(folder), *options, *settings, "--yes", "--no-library"]


@dataclass(frozen=True)
class Ending:
    """How a command ended; ``err`` holds the sentence of a failure."""

    code: int
    out: str
    err: str


def give(*arguments: str) -> Ending:
    """Give a command in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(list(arguments))
    return Ending(code, out.getvalue(), err.getvalue())


def kill_at(folder: Path, begun: str, patience_s: float = 240.0) -> None:
    """Calibrate everything in a process of its own and kill it once the file ``begun`` is there."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "dsl_core", *command_all(folder)],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    limit = time.monotonic() + patience_s
    while not (folder / begun).exists():
        if process.poll() is not None or time.monotonic() > limit:
            process.kill()
            raise AssertionError(f"ended before {begun}: {process.communicate()[1].decode()[-2000:]}")
        time.sleep(0.02)
    process.kill()
    process.communicate()


def with_options(folder: Path, changed: Mapping[str, str]) -> None:
    """Let the rig of a campaign be another one from now on, or have a mishap."""
    campaign = CampaignFolder.open(folder)
    info = campaign.info.model_copy(update={"options": {**campaign.info.options, **changed}})
    CampaignFolder(folder, info).save()


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
