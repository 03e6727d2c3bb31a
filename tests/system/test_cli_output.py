"""What a command says on a terminal goes where it belongs, and bars are not in its way."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsl_core.cli.output import Output


class Terminal(io.StringIO):
    """Pretends to be one."""

    def isatty(self) -> bool:
        return True


def test_addresses_keep_both_slashes_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(True)
    output.put(scans=[{"scan": Path("s3://bucket/x/a.dsl"), "result": Path("x") / "a.zarr"}])
    output.finish()
    told = {"scan": "s3://bucket/x/a.dsl", "result": str(Path("x") / "a.zarr")}
    assert json.loads(capsys.readouterr().out) == {"scans": [told]}


def test_bars_give_way_to_what_is_said_and_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))
    output = Output(False)
    with output.progress() as progress:
        for number in range(9):
            progress.report(f"step {number}", 1, 1)
        output.say("found")
        assert output.ask("Placed? ") == "yes\n"
        progress.report("fit", 1, 2)
    assert capsys.readouterr().out == "found\n"
    shown = terminal.getvalue()
    assert shown.index("step 0") < shown.index("Placed? ") < shown.index("fit")


def test_without_a_terminal_a_line_is_not_repeated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = iter(range(0, 1000, 10))
    monkeypatch.setattr("dsl_core.cli.output.time.monotonic", lambda: float(next(now_s)))
    with Output(False).progress() as progress:
        for done in (0, 0, 0, 1, 1, 0):
            progress.report("spectra", done, 2)
    assert capsys.readouterr().err.splitlines() == [
        f"spectra: {line}" for line in ("0 of 2 (0%)", "1 of 2 (50%)", "0 of 2 (0%)")
    ]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipe that breaks")
@pytest.mark.parametrize(("arguments", "code"), [(["scenes"], 0), (["info", "/no/such/scan"], 2)])
def test_a_reader_that_leaves_early_causes_no_traceback(arguments: list[str], code: int) -> None:
    ours, theirs = os.pipe()
    # Nobody reads: like "| head", but sure to have left before anything is printed.
    os.close(ours)
    found = subprocess.run(
        [sys.executable, "-u", "-m", "dsl_core", *arguments, "--json"],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        stdout=theirs,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
    os.close(theirs)
    assert "Traceback" not in found.stderr
    assert "BrokenPipe" not in found.stderr
    assert found.returncode == code


def _said(arguments: list[str], **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "dsl_core", *arguments],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment},
        capture_output=True,
        timeout=60,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither such a shell nor /dev/full")
@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("scenes >&-", 0),
        ("scenes 2>&-", 0),
        ("scenes --json <&- >&- 2>&-", 0),
        ("info absent 2>&-", 2),
        ("info absent --json >/dev/full", 2),
        ("info absent 2>/dev/full", 2),
        ("scenes --json >/dev/full", 2),
    ],
)
def test_streams_that_are_closed_or_full_change_no_exit_code(command: str, code: int) -> None:
    if "/dev/full" in command and not os.path.exists("/dev/full"):
        pytest.skip("This system has no /dev/full.")
    found = subprocess.run(
        ["sh", "-c", f"'{sys.executable}' -m dsl_core {command}"],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert found.returncode == code
    assert "Traceback" not in found.stderr
    assert "bug" not in found.stdout + found.stderr
    if command == "scenes --json >/dev/full":
        assert found.stderr.startswith("No space left on device.")


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_letters_that_a_pipe_cannot_take_are_replaced(encoding: str) -> None:
    found = _said(["effects"], PYTHONIOENCODING=encoding)
    assert (found.returncode, found.stderr) == (0, b"")
    # In Unicode, the letter sigma.
    assert "4095 DN, 3934 ?" in found.stdout.decode(encoding)
