"""What pages show runs as written, and their tables are those of the code."""

from __future__ import annotations

import importlib
import re
import shlex
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from dsl_core.io.export import Format
from dsl_core.io.spectra.records import Format as SpectraFormat
from dsl_core.model.result import VARIABLES
from tests.cases.small_result import small_result

ROOT = Path(__file__).resolve().parents[2]
HELP = ROOT / "resources" / "help"
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def blocks(path: Path, language: str = "python") -> list[str]:
    """The code that a page shows in a language."""
    return re.findall(rf"```{language}\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["many_scans", "read_spectra"])
def test_a_notebook_runs_as_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first scan is that of the help on scripts, which another test runs; making the site runs all."""
    monkeypatch.chdir(tmp_path)
    path = ROOT / "examples" / f"{name}.py"
    with mpl.rc_context({"backend": "agg"}):
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), {"__name__": "notebook"})
    assert capsys.readouterr().out


@pytest.mark.parametrize("page", sorted(HELP.glob("*.md")), ids=lambda page: str(page.stem))
def test_a_help_page_ends_with_where_to_go_from_there(page: Path) -> None:
    heading = re.findall(r"^## (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)[-1]
    end = page.read_text(encoding="utf-8").rpartition("## ")[2]
    assert heading == "Next"
    assert re.search(r"\]\([\w-]+\.md", end)


def test_there_are_three_notebooks() -> None:
    assert len(EXAMPLES) == 3


def test_formats_of_the_help_page_work(tmp_path: Path) -> None:
    names: dict[str, Any] = {}
    for block in blocks(HELP / "adding-a-format.md"):
        exec(block, names)
    xyz, lab = names["XYZ"], names["LAB"]
    assert isinstance(xyz, Format)
    assert isinstance(lab, SpectraFormat)
    result = small_result()
    (written,) = xyz.write(result, tmp_path / "a.xyz")
    assert np.loadtxt(written).shape[1] == 3
    (tmp_path / "a.lab").write_text("OUR LAB\n400 0.1\n500 0.2\n")
    (spectrum,) = lab.read(tmp_path / "a.lab")
    assert lab.recognises(tmp_path / "a.lab", b"OUR LAB\n400")
    np.testing.assert_array_equal(spectrum.values, [0.1, 0.2])


def test_entry_points_of_the_help_page_are_those_that_are_read() -> None:
    from dsl_core.io import export
    from dsl_core.io.spectra import catalogue

    shown = "".join(blocks(HELP / "adding-a-format.md", "toml"))
    assert f'"{export.GROUP}"' in shown
    assert f'"{catalogue.GROUP}"' in shown


def test_the_specification_lists_every_variable_of_a_result() -> None:
    text = (HELP / "files.md").read_text(encoding="utf-8")
    for name, (axes, unit, words) in VARIABLES.items():
        assert f"| `{name}` | {', '.join(axes)} | {unit} | {words} |" in text


def test_the_python_of_the_readme_is_that_of_the_help_which_is_run() -> None:
    shown = blocks(ROOT / "README.md")
    assert shown
    assert set(shown) <= set(blocks(HELP / "scripting.md"))


@pytest.fixture(scope="module")
def program() -> Any:
    from typer.main import get_command

    from dsl_core.cli.run import app

    return get_command(app)


def test_the_readme_names_every_command_and_no_other(program: Any) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    named = re.findall(r"^\| `dsl-scan ([\w-]+)[^`]*` \|", text, re.MULTILINE)
    assert set(named) == set(program.commands)


def test_pip_takes_what_the_readme_installs(monkeypatch: pytest.MonkeyPatch) -> None:
    pip = importlib.import_module("pip._internal.req.constructors")
    monkeypatch.chdir(ROOT)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = [shlex.split(line) for line in re.findall(r"`pip install ([^`]+)`", text)]
    taken = [pip.install_req_from_line(what) for (what,) in shown]
    assert [each.extras for each in taken] == [{"gui"}, {"reconstruct"}, set()]
    assert {each.link.file_path for each in taken} == {str(ROOT)}


def test_pictures_of_the_readme_are_there_and_small() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    assert len(shown) == 3
    assert all((ROOT / name).stat().st_size < 300_000 for name in shown)


def commands(path: Path) -> list[str]:
    """What a page shows of the command, in blocks and in sentences, without what is remarked behind it."""
    text = path.read_text(encoding="utf-8").replace("\\\n", " ")
    plain = re.findall(r"^```(?:\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [line.split(" # ")[0].strip() for block in plain for line in block.splitlines()]
    told = [" ".join(part.split()) for part in re.findall(r"`(dsl-scan\s[^`]+)`", text)]
    return [line for line in (*lines, *told) if line.startswith("dsl-scan ")]


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted(HELP.glob("*.md"))], ids=lambda page: str(page.stem)
)
def test_commands_of_a_page_have_the_options_that_they_show(page: Path, program: Any) -> None:
    for line in commands(page):
        command = program
        words = shlex.split(line)[1:]
        while words and words[0] in getattr(command, "commands", {}):
            command, words = command.commands[words[0]], words[1:]
        context = command.context_class(command)
        _, left, _ = command.make_parser(context).parse_args(words)
        assert not left, f"{line}: {left} is not taken"
