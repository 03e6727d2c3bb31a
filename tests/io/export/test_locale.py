"""Names in a locale that is not UTF-8, where Python keeps bytes of the command line as lone surrogates."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsl_core.cli.options import parse_place
from dsl_core.errors import StoreError
from dsl_core.io.export.exr import export_exr
from tests.cases.small_result import small_result

pytestmark = pytest.mark.skipif(os.name == "nt", reason="names are Unicode on Windows")
ROOT = Path(__file__).parents[3]
GIVEN = "gr" + chr(0xDCC3) + chr(0xDCBC) + "n"
EXPORT = """
import sys
from pathlib import Path
from dsl_core.io.export.mesh.export import export_mesh
from tests.cases.small_result import small_result
export_mesh(small_result(), Path(sys.argv[1]))
"""


def test_the_name_of_a_place_is_the_one_that_was_typed() -> None:
    assert parse_place("--at", f"{GIVEN}=50,30") == ("grün", [50, 30])


def test_openexr_says_that_it_takes_no_such_path(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"grün\.exr cannot be written as OpenEXR.*plain letters"):
        export_exr(small_result(), tmp_path / f"{GIVEN}.exr")


def test_a_mesh_names_its_material_in_any_locale(tmp_path: Path) -> None:
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    path = os.fsencode(tmp_path) + "/grün.obj".encode()
    subprocess.run([sys.executable, "-c", EXPORT, path], cwd=ROOT, env={**os.environ, **plain}, check=True)
    names = {name.decode() for name in os.listdir(os.fsencode(tmp_path))}
    assert names == {"grün.obj", "grün.mtl", "grün.png"}
    assert "mtllib grün.mtl" in (tmp_path / "grün.obj").read_text(encoding="utf-8")
    assert "grün.png" in (tmp_path / "grün.mtl").read_text(encoding="utf-8")
