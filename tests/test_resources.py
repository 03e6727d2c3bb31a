from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from dsl_core import resources
from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.rig_profile import profile_names
from dsl_core.io.scan.origin import is_of_this_computer, rig_notes
from dsl_core.simulation.published_rig import published_rig
from dsl_core.workflows.diagnosis import diagnosis


def test_a_resource_of_the_source_tree_is_found() -> None:
    path = resources.resource_path("bibliography.bib")
    assert path.read_text(encoding="utf-8").startswith("%")


def test_a_user_without_a_home_finds_nothing_and_is_told_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a container that was started with the number of a user whom it does not know."""

    pwd = pytest.importorskip("pwd", reason="the system keeps no table of users")

    def unknown(number: int) -> None:
        raise KeyError(number)

    monkeypatch.setattr(pwd, "getpwuid", unknown)
    for name in ("HOME", "DSL_SCAN_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    assert is_of_this_computer(rig_notes("twin", {}))
    assert next(diagnosis(tmp_path))[0] == "dsl-scan"
    assert [*profile_names(), *CalibrationLibrary().names()] == []
    with pytest.raises(StoreError, match="set DSL_SCAN_HOME to a folder"):
        CalibrationLibrary().store("lab", published_rig())
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path / "own"))
    assert CalibrationLibrary().store("lab", published_rig()).name == "lab"


@pytest.mark.parametrize("name", ["no_such_file.txt", "../pyproject.toml", "/etc/hosts"])
def test_anything_else_is_refused_with_its_name(name: str) -> None:
    with pytest.raises(StoreError, match=name):
        resources.resource_path(name)


def test_a_frozen_app_looks_into_its_bundle_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bundled = tmp_path / "resources" / "bibliography.bib"
    bundled.parent.mkdir()
    bundled.write_text("bundled")
    monkeypatch.setattr(sys, "_MEIPASS", str(tmp_path), raising=False)
    assert resources.resource_path("bibliography.bib") == bundled


def test_an_unpacked_wheel_finds_its_own_copy(tmp_path: Path) -> None:
    """Lays the package out as the wheel's force-include does, and asks another interpreter."""
    wheel = tmp_path / "dsl_scan.whl"
    source = Path(resources.__file__).parent
    with zipfile.ZipFile(wheel, "w") as archive:
        for name in ("__init__.py", "errors.py", "resources.py", "version.py"):
            archive.write(source / name, f"dsl_core/{name}")
        archive.writestr("dsl_core/_resources/bibliography.bib", "from the wheel")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    code = "from dsl_core.resources import resource_path as p; print(p('bibliography.bib').read_text())"
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=site, capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "from the wheel"
