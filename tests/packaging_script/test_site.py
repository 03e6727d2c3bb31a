"""The pages of the site: gathered from where their texts are, each in the list, each link to a page."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import dsl_core as dsl

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def site(tmp_path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_site", ROOT / "packaging" / "site" / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.PAGES = tmp_path / "pages"  # type: ignore[attr-defined]
    module.gather()
    return module


def listed(entries: list[Any]) -> set[str]:
    """Every page of a list of pages."""
    found: set[str] = set()
    for entry in entries:
        if isinstance(entry, str):
            found.add(entry)
        else:
            for below in entry.values():
                found |= {below} if isinstance(below, str) else listed(below)
    return found


def test_every_page_is_in_the_list_and_every_link_is_a_page(site: ModuleType) -> None:
    pages = site.PAGES
    made = {
        path.relative_to(pages).as_posix(): path.read_text(encoding="utf-8") for path in pages.rglob("*.md")
    }
    assert set(made) == listed(site.navigation())
    wrong = [
        (name, target)
        for name, text in made.items()
        for target in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
        if not (pages / name).parent.joinpath(target).exists()
    ]
    assert wrong == []


def test_what_describes_itself_is_complete(site: ModuleType) -> None:
    python = (site.PAGES / "reference" / "python.md").read_text(encoding="utf-8")
    assert all(f"::: dsl_core.{name}\n" in python for name in dsl.__all__ if not name.startswith("__"))
    commands = (site.PAGES / "reference" / "commands.md").read_text(encoding="utf-8")
    for words in (
        "## scan\n",
        "## calibrate all\n",
        "## rigs doctor\n",
        "| `--bands` | START:STOP:STEP in nm. |",
    ):
        assert words in commands


def test_notebooks_are_those_of_jupyter(site: ModuleType) -> None:
    for name in site.TUTORIALS:
        made = json.loads((site.PAGES / "tutorials" / f"{name}.ipynb").read_text(encoding="utf-8"))
        assert made["nbformat"] == 4
        kinds = [cell["cell_type"] for cell in made["cells"]]
        assert kinds[0] == "markdown"
        assert kinds.count("code") >= 2
        assert "".join(made["cells"][0]["source"]).startswith("# ")
