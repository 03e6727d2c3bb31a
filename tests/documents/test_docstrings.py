"""Examples in docstrings are true."""

from __future__ import annotations

import doctest
import linecache
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = [
    ".".join(path.relative_to(base).with_suffix("").parts)
    for base, package in ((ROOT, "dsl_core"), (ROOT / "app", "dsl_app"))
    for path in sorted((base / package).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_give_what_they_say(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    # For each docstring, doctest looks at every file whose lines are kept: after many tests, thousands.
    linecache.clearcache()
    found = doctest.testmod(import_module(name))
    assert found.attempted
    assert not found.failed, capsys.readouterr().out
