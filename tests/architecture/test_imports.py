"""Imports keep the rules of ARCHITECTURE.md, folders stay small, and the command line starts light."""

from __future__ import annotations

import graphlib
import importlib.util
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parents[2]

HEAVY = (
    "OpenEXR",
    "PySide6",
    "colour",
    "cv2",
    "matplotlib",
    "numba",
    "pandas",
    "pyvista",
    "scipy",
    "spectral",
    "torch",
    "vtkmodules",
    "xarray",
    "zarr",
)
#: Modules, beside ``__init__.py``, that a reader takes in at a glance.
MOST_IN_A_FOLDER = 20


def test_folders_can_be_taken_in_at_a_glance() -> None:
    modules = (path for part in ("app", "dsl_core") for path in (ROOT / part).rglob("[!_]*.py"))
    counted = Counter(path.parent.relative_to(ROOT).as_posix() for path in modules)
    assert [folder for folder, count in counted.items() if count > MOST_IN_A_FOLDER] == []


def test_import_contracts_hold() -> None:
    """In a process of its own, since the linter silences the loggers of the one it runs in."""
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    command = [sys.executable, "-c", code]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout


def test_no_module_imports_itself_in_a_circle() -> None:
    graph = grimp.build_graph("dsl_core", "dsl_app", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        pytest.fail(" > ".join(error.args[1]))


def test_modules_that_say_no_qt_import_none() -> None:
    graph = grimp.build_graph("dsl_app", include_external_packages=True, cache_dir=None)
    qt = {"PySide6", "pyqtgraph", "shiboken6", "superqt"} & graph.modules
    folder = ROOT / "app"
    found = []
    for path in sorted(folder.rglob("*.py")):
        module = ".".join(path.relative_to(folder).with_suffix("").parts)
        docstring = path.read_text(encoding="utf-8").split('"""', 2)[1]
        if "No Qt" in docstring and graph.find_upstream_modules(module) & qt:
            found.append(module)
    assert qt
    assert found == []


@pytest.mark.skipif(importlib.util.find_spec("dsl_core.cli") is None, reason="there is no command line yet")
def test_the_command_line_starts_light() -> None:
    code = "import json, sys, dsl_core.cli; print(json.dumps(sorted(sys.modules)))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(HEAVY).isdisjoint(json.loads(answer.stdout))


def test_the_window_is_painted_before_heavy_libraries_are_imported() -> None:
    """They are imported in a thread afterwards, while the window is on screen already."""
    modules = "dsl_app.__main__, dsl_app.composition.window, dsl_app.shell.application"
    code = f"import json, sys, {modules}; print(json.dumps(sorted(sys.modules)))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"numpy", "pyqtgraph", *HEAVY} - {"PySide6"}
    assert heavy.isdisjoint(json.loads(answer.stdout))


def test_a_first_look_at_a_result_waits_for_nothing_that_it_does_not_need() -> None:
    modules = "dsl_app.composition.demo, dsl_app.results.controller, dsl_app.results.page"
    code = f"import json, sys, {modules}; print(json.dumps(sorted(sys.modules)))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    later = {"scipy", "zarr", "pyvista", "torch", "dsl_core.capture.runner", "dsl_core.workflows.scans"}
    assert later.isdisjoint(json.loads(answer.stdout))
