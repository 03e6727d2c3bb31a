"""What is imported is declared, what is declared is imported, and the pins satisfy the declarations."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [*(ROOT / "dsl_core").rglob("*.py"), *(ROOT / "app").rglob("*.py")]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Import name -> distribution, where they differ.
DISTRIBUTIONS = {
    "OpenEXR": "openexr",
    "PIL": "pillow",
    "PySide6": "pyside6-essentials",
    "cv2": "opencv-contrib-python-headless",
    "serial": "pyserial",
    "yaml": "pyyaml",
    "zaber_motion": "zaber-motion",
    # The part of PySide that knows which objects are still alive.
    "shiboken6": "pyside6-essentials",
    "vtkmodules": "vtk",
}
#: What extras bring to those who run the program; that of the tests is not imported by it.
EXTRAS = [
    requirement
    for extra, requirements in PROJECT["optional-dependencies"].items()
    for requirement in requirements
    if extra != "test" and not requirement.startswith("dsl-scan[")
]
# The desktop application is built on these; until its first window nothing imports them.
OF_THE_APP = {"platformdirs", "pyside6-essentials", "pyqtgraph", "pyvista", "superqt"}
GPL = {"plyfile", "pylablib", "pylablib-lightweight", "thorlabs-apt-device", "pyqt5", "pyqt6"}


@cache
def imported() -> frozenset[str]:
    """Distributions that dsl_core and app import anywhere, also inside functions."""
    return frozenset(each for path in SOURCES for each in imports_of(path))


def imports_of(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        for name in (name.partition(".")[0] for name in names):
            if name not in sys.stdlib_module_names and name not in ("dsl_core", "dsl_app"):
                yield canonicalize_name(DISTRIBUTIONS.get(name, name))


def declared(requirements: list[str]) -> dict[str, Requirement]:
    parsed = (Requirement(text) for text in requirements)
    return {canonicalize_name(requirement.name): requirement for requirement in parsed}


def test_every_import_is_declared() -> None:
    assert imported() - set(declared(PROJECT["dependencies"] + EXTRAS)) == set()


def test_every_declaration_is_imported() -> None:
    assert set(declared(PROJECT["dependencies"] + EXTRAS)) - imported() - OF_THE_APP == set()


def test_every_declaration_is_pinned_to_a_version_that_it_allows() -> None:
    lines = (ROOT / "packaging" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = declared([line for line in lines if line and not line.startswith("#")])
    for_tests = [each for each in PROJECT["optional-dependencies"]["test"] if "dsl-scan[" not in each]
    for name, wanted in declared(PROJECT["dependencies"] + EXTRAS + for_tests).items():
        version = re.fullmatch(r"==([^+]+)", str(pins[name].specifier))
        assert version is not None, f"{name} is not pinned to one public version"
        assert wanted.specifier.contains(version[1]), f"{name} {version[1]} is not {wanted.specifier}"


def test_nothing_is_under_the_gpl() -> None:
    text = (ROOT / "packaging" / "constraints.txt").read_text(encoding="utf-8")
    names = {canonicalize_name(re.split(r"[= ]", line)[0]) for line in text.splitlines()}
    assert names.isdisjoint(GPL)


def test_architecture_gives_a_reason_for_every_dependency() -> None:
    table = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").lower()
    missing = [name for name in declared(PROJECT["dependencies"] + EXTRAS) if f"`{name}`" not in table]
    assert missing == []
