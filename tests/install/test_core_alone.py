"""The core works without torch, OpenCV, Qt and VTK, and names what to install for the rest."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dsl_core.extras import EXTRA_OF, missing_package, names_missing_packages

ROOT = Path(__file__).resolve().parents[2]

#: Runs in a process where the modules of the extras cannot be imported.
SCRIPT = """
import contextlib, importlib, io, json, pkgutil, sys
from pathlib import Path

blocked, example, folder = json.loads(sys.argv[1]), sys.argv[2], Path(sys.argv[3])

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in blocked:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())

import dsl_core as dsl
from dsl_core import errors
from dsl_core.cli.run import run
from dsl_core.workflows.new_rig import write_new_rig

for package in ("api", "capture", "cli", "devices", "evaluation", "io", "model", "patterns", "workflows"):
    home = importlib.import_module("dsl_core." + package)
    for module in pkgutil.walk_packages(home.__path__, home.__name__ + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)

found = {}
result = dsl.load_result(example)
found["bands"] = result.dsl.spectrum(100, 100).sizes["wavelength_nm"]
for ending in ("ply", "hdr", "exr", "tif", "npy"):
    found[ending] = len(dsl.export(result, folder / f"a.{ending}"))

write_new_rig("my-lab", folder / "my-lab", [])
sys.path.insert(0, str(folder / "my-lab"))
with importlib.import_module("my_lab").open_lab({}) as rig:
    lines = {"kind": "lines", "width_px": 40, "step_px": 40}
    scan = dsl.scan(rig, folder / "a.dsl", dsl.plan(rig, spectral=lines, sentinels=None))
found["frames"] = len(scan.sound())

def sentence(call):
    try:
        call()
    except errors.DslError as error:
        return type(error).__name__ + ": " + str(error)

found["twin"] = sentence(lambda: dsl.open_rig("twin").close())
found["png"] = sentence(lambda: dsl.export(result, folder / "a.png"))
found["evaluate"] = sentence(lambda: dsl.evaluate(result))
with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
    lines = ("rigs", "scenes", "calibrations list", f"demo -o {folder / 'd'}")
    found["codes"] = [run(line.split()) for line in lines]
found["demo"] = said.getvalue()
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("core")
    example = ROOT / "resources" / "examples" / "color-checker.zarr"
    blocked = json.dumps([*EXTRA_OF, "colour", "llvmlite", "numba", "qtpy"])
    command = [sys.executable, "-W", "ignore", "-c", SCRIPT, blocked, str(example), str(folder)]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


def test_results_are_read_and_exported(found: Any) -> None:
    assert found["bands"] == 47
    assert [found[ending] for ending in ("ply", "hdr", "exr", "tif", "npy")] == [1, 4, 1, 3, 3]


def test_devices_are_used_for_a_scan(found: Any) -> None:
    assert found["frames"] > 40


def test_what_computes_names_its_extra(found: Any) -> None:
    wanted = "MissingPackageError: This needs the package torch, which is not installed here."
    assert found["twin"].startswith(wanted)
    assert found["evaluate"].startswith(wanted)
    assert found["evaluate"].endswith('pip install "dsl-scan[reconstruct]"')


def test_the_readme_says_what_is_not_exported(found: Any) -> None:
    assert found["png"].startswith("MissingPackageError: This needs the package cv2")
    assert "export (but PNG and the published layout)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_commands_do_the_same(found: Any) -> None:
    assert found["codes"] == [0, 0, 0, 2]
    assert 'pip install "dsl-scan[reconstruct]"' in found["demo"]


def test_other_missing_modules_stay_errors_of_python() -> None:
    @names_missing_packages
    def work() -> None:
        raise ModuleNotFoundError("No module named 'pickles'", name="pickles")

    with pytest.raises(ModuleNotFoundError, match="pickles"):
        work()
    missing = missing_package(ModuleNotFoundError(name="vtkmodules.vtkCommonCore"))
    assert "dsl-scan[gui]" in str(missing)
