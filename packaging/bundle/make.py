"""Make the program as one folder, and a Debian package of it: ``python3 packaging/run.py bundle``.

``build/bundle/dist/dsl-scan`` runs where no Python is installed: ``dsl-scan`` is the command,
``dsl-scan-gui`` the window, and packages in its folder ``drivers`` are found as if they were installed. Where
``dpkg-deb`` is, the folder becomes ``build/bundle/dsl-scan_VERSION_ARCHITECTURE.deb`` with a desktop entry
and an icon. ``--smoke`` only tries what was made.
"""

from __future__ import annotations

import contextlib
import filecmp
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
BUILD = ROOT / "build" / "bundle"
FOLDER = BUILD / "dist" / "dsl-scan"
#: What Qt and VTK load at run time, as Debian 12 and Ubuntu 24.04 call it.
DEPENDS = (
    "libc6, libdbus-1-3, libegl1, libfontconfig1, libgl1, libglib2.0-0 | libglib2.0-0t64, libxcb-cursor0, "
    "libxcb-icccm4, libxcb-keysyms1, libxcb-shape0, libxkbcommon-x11-0, libxkbcommon0"
)
CONTROL = """Package: dsl-scan
Version: {version}
Architecture: {architecture}
Maintainer: the dsl-scan contributors
Installed-Size: {kilobytes}
Depends: {depends}
Section: science
Priority: optional
Description: hyperspectral 3D scanning by dispersed structured light
 Depth and a reflectance spectrum for every pixel, each with an uncertainty, from
 a camera, a projector and a diffraction film. Drivers of other packages are found
 in /usr/lib/dsl-scan/drivers.
"""
#: Libraries whose names of functions, for debuggers, take the most space.
STRIPPED = ("llvmlite", "torch/lib", "vtkmodules")
DESKTOP = """[Desktop Entry]
Type=Application
Name=dsl-scan
Comment=Hyperspectral 3D scanning
Exec=dsl-scan-gui %f
Icon=dsl-scan
Categories=Science;Graphics;
Terminal=false
"""
#: A command, and words that its output has to contain.
SMOKE = (
    (("--version",), "dsl-scan "),
    (("rigs",), "bundled-lab"),
    (
        (
            "scan",
            "a.dsl",
            "-O",
            "size=64x48",
            "--code",
            "columns",
            "--lines",
            "8x8",
            "--setting",
            "333.3@0.8",
        ),
        "saved",
    ),
    (("reconstruct", "a.dsl", "--bands", "430:660:46"), "have a depth"),
    (("export", "a.zarr", "png", "a.png"), "Written"),
    (("doctor", "--no-devices"), "OpenGL"),
    (("-m", "drawing"), "drawn True"),
)
#: A package as `pip install --target` leaves it in the folder for drivers: a rig, and a module to run.
DRIVER = {
    "bundled_lab-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: bundled-lab\nVersion: 1\n",
    "bundled_lab-1.dist-info/entry_points.txt": "[dsl_scan.rigs]\nbundled-lab = drawing:open_lab\n",
    "drawing.py": """
import pyvista

plotter = pyvista.Plotter(off_screen=True)
plotter.add_points(pyvista.Sphere().points, scalars=range(len(pyvista.Sphere().points)))
print("drawn", plotter.screenshot(return_img=True).std() > 0)
""",
}


def main() -> int:
    """Make folder and package and try them; returns 0 when everything worked."""
    if "--smoke" not in sys.argv:
        code = build()
        if code:
            return code
    return smoke()


def build() -> int:
    """The folder, and the package where its tool is; returns PyInstaller's exit code."""
    start_s = time.monotonic()
    command = [sys.executable, "-m", "PyInstaller", "--noconfirm", "--log-level", "ERROR"]
    command += [
        "--distpath",
        str(BUILD / "dist"),
        "--workpath",
        str(BUILD / "work"),
        str(HERE / "dsl_scan.spec"),
    ]
    code = subprocess.run(command, check=False).returncode
    if code:
        return code
    if os.name == "posix":
        slim()
    (FOLDER / "drivers").mkdir()
    told = "pip install --target here PACKAGE makes its rigs, formats and drivers known to dsl-scan.\n"
    (FOLDER / "drivers" / "README").write_text(told)
    print(f"{FOLDER}: {size_of(FOLDER) / 1e6:.0f} MB, {time.monotonic() - start_s:.0f} s")
    if shutil.which("dpkg-deb"):
        start_s = time.monotonic()
        package = make_package()
        print(f"{package}: {package.stat().st_size / 1e6:.0f} MB, {time.monotonic() - start_s:.0f} s")
    return 0


def slim() -> None:
    """Drop the names of functions from large libraries, and keep both programs as one file of two names.

    Only Windows tells a program with a console from one without.
    """
    command, window = FOLDER / "dsl-scan", FOLDER / "dsl-scan-gui"
    if filecmp.cmp(command, window, shallow=False):
        window.unlink()
        window.hardlink_to(command)
    if shutil.which("strip") and sys.platform == "linux":
        inside = FOLDER / "_internal"
        libraries = [path for name in STRIPPED for path in inside.joinpath(name).rglob("*.so*")]
        subprocess.run(["strip", "--strip-unneeded", *libraries], check=True)


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder; links not counted, nor further names of a file."""
    files = [path.stat() for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return sum({(file.st_dev, file.st_ino): file.st_size for file in files}.values())


def make_package() -> Path:
    """The Debian package of the folder, which is moved through it by hard links."""
    from dsl_core.version import __version__

    asked = subprocess.run(["dpkg", "--print-architecture"], capture_output=True, text=True, check=True)
    architecture = asked.stdout.strip()
    root = BUILD / "deb"
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(FOLDER, root / "usr/lib/dsl-scan", symlinks=True, copy_function=os.link)
    for name in ("dsl-scan", "dsl-scan-gui"):
        link = root / "usr/bin" / name
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(f"../lib/dsl-scan/{name}")
    texts = {
        "DEBIAN/control": CONTROL.format(
            version=__version__, architecture=architecture, kilobytes=size_of(FOLDER) // 1024, depends=DEPENDS
        ),
        "usr/share/applications/dsl-scan.desktop": DESKTOP,
        "usr/share/icons/hicolor/scalable/apps/dsl-scan.svg": (ROOT / "resources/icons/scan.svg").read_text(),
        "usr/share/doc/dsl-scan/copyright": (ROOT / "LICENSE").read_text(),
    }
    for name, text in texts.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    package = BUILD / f"dsl-scan_{__version__}_{architecture}.deb"
    command = ["dpkg-deb", "--root-owner-group", "-Zzstd", "-z12", "--build", str(root), str(package)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    shutil.rmtree(root)
    return package


@contextlib.contextmanager
def driver_beside_program() -> Iterator[None]:
    """Put `DRIVER` into the program's folder for drivers while a block runs."""
    files = {FOLDER / "drivers" / name: text for name, text in DRIVER.items()}
    for path, text in files.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    try:
        yield
    finally:
        for part in {path.relative_to(FOLDER / "drivers").parts[0] for path in files}:
            whole = FOLDER / "drivers" / part
            shutil.rmtree(whole) if whole.is_dir() else whole.unlink()


def smoke() -> int:
    """Give the commands of `SMOKE` in an environment without Python; returns how many went wrong."""
    wrong = 0
    program = FOLDER / ("dsl-scan.exe" if os.name == "nt" else "dsl-scan")
    with tempfile.TemporaryDirectory() as folder, driver_beside_program():
        bare = {"HOME": folder, "PATH": "/usr/bin:/bin", "QT_QPA_PLATFORM": "offscreen", "LANG": "C.UTF-8"}
        environment = os.environ | bare if os.name == "nt" else bare
        for arguments, words in SMOKE:
            start_s = time.monotonic()
            answer = subprocess.run(
                [program, *arguments],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            good = answer.returncode == 0 and words in answer.stdout
            wrong += not good
            seconds = time.monotonic() - start_s
            print(f"{'good ' if good else 'WRONG'} {seconds:5.1f} s  dsl-scan {' '.join(arguments)}")
            if not good:
                print(answer.stdout[-500:] + answer.stderr[-2000:])
    return wrong


if __name__ == "__main__":
    sys.exit(main())
