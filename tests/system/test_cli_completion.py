"""The Tab key completes commands, options, and names of rigs, calibrations and formats; files elsewhere."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from dsl_core.cli import main

CASES = [
    (("reco",), ["reconstruct"]),
    (("calibrations", "re"), ["restore"]),
    (("scan", "a.dsl", "--cal"), ["--calibration"]),
    (("scan", "a.dsl", "--rig", "t"), ["twin"]),
    (("resume", "a.dsl", "--rig", "re"), ["replay"]),
    (("plan", "a.json", "--code", "full-e"), ["full-ensemble-04", "full-ensemble-02"]),
    (("scan", "a.dsl", "--plan", "pre"), ["preview"]),
    (("export", "a.zarr", "ti"), ["tiff"]),
]


@pytest.fixture(autouse=True)
def _library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A library with one name that has a space; a profile of this computer would be listed as a rig."""
    home = tmp_path / "home"
    (home / "calibrations" / "room 12" / "versions").mkdir(parents=True)
    (home / "calibrations" / "room 12" / "versions" / "20260101T000000Z.json").write_text("{}")
    monkeypatch.setenv("DSL_SCAN_HOME", str(home))


def offered(
    shell: str, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> str:
    """What the program answers when a shell asks it how the last of these words may go on."""
    line = ["dsl-scan", *words]
    monkeypatch.setenv("_DSL_SCAN_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("COMP_WORDS", "\n".join(line))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", " ".join(line))
    capsys.readouterr()
    assert main([]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(("words", "wanted"), CASES, ids=lambda value: value[-1])
def test_bash_and_zsh_are_offered_what_fits(
    words: tuple[str, ...],
    wanted: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert offered("bash", words, monkeypatch, capsys).split() == wanted
    for_zsh = offered("zsh", words, monkeypatch, capsys)
    assert all(f'"{name}"' in for_zsh for name in wanted)
    assert for_zsh.count("\n") == len(wanted)


def test_a_name_with_a_space_is_one_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for words in (("calibrations", "show", "ro"), ("scan", "a.dsl", "--calibration", "ro")):
        assert offered("bash", words, monkeypatch, capsys) == "room\\ 12\n"
        assert '"room 12"' in offered("zsh", words, monkeypatch, capsys)


@pytest.mark.parametrize("words", [("info", "sm"), ("reconstruct", ""), ("scan", "a.dsl", "--plan", "sm")])
def test_where_a_file_belongs_the_shell_is_left_to_offer_files(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert offered("bash", words, monkeypatch, capsys).strip() == ""
    assert "_files" in offered("zsh", words, monkeypatch, capsys)


def test_bash_asks_the_program_and_offers_files_where_it_knows_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bash = shutil.which("bash")
    if bash is None or os.name == "nt":
        pytest.skip("there is no bash")
    monkeypatch.setenv("_DSL_SCAN_COMPLETE", "source_bash")
    assert main([]) == 0
    program = tmp_path / "dsl-scan"
    program.write_text('#!/bin/sh\necho "$_DSL_SCAN_COMPLETE $COMP_CWORD"\n')
    program.chmod(0o755)
    script = capsys.readouterr().out + (
        "\ncomplete -p dsl-scan; COMP_WORDS=(dsl-scan info sm); COMP_CWORD=2; _dsl_scan_completion dsl-scan;"
        ' printf "%s\\n" "${COMPREPLY[@]}"'
    )
    env = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    command = [bash, "--norc", "-c", script]
    answer = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    assert answer.stdout.splitlines() == [
        "complete -o default -F _dsl_scan_completion dsl-scan",
        "complete_bash 2",
    ]
