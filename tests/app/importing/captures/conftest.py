"""One capture of another program for all tests of a module."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.importing.captures.small_capture import make_capture


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """To be read only."""
    return make_capture(tmp_path_factory.mktemp("capture") / "set")
