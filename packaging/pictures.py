"""Make the pictures of the README from the scans of the program: ``python packaging/pictures.py``.

Needs the environment of the tests and Xvfb. ``resources/pictures`` gets the window with spectra, a cloud, and
spectra with their bands. Run it again when the window has changed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT), str(ROOT / "app")]
TARGET = ROOT / "resources" / "pictures"
EXAMPLES = ROOT / "resources" / "examples"
#: Pixels of patches that tell colours apart: red, green, blue, yellow, white.
PINS = ((190, 178), (124, 178), (60, 178), (255, 178), (60, 243))
JPEG_QUALITY = 82
#: How often the cloud is turned by its arrow key.
TURNS = 5


def spectra() -> None:
    """Spectra of the chart with their 95 % bands."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    import dsl_core as dsl

    result = dsl.load_result(EXAMPLES / "color-checker.zarr")
    figure, axes = plt.subplots(figsize=(6.4, 3.4), layout="constrained", dpi=110)
    for x, y in PINS:
        result.dsl.plot(x=x, y=y, ax=axes)
        rgb = result["rgb"].sel(x=x, y=y).values.clip(0, 0.92)
        axes.lines[-1].set_color(rgb)
        axes.collections[-1].set_facecolor(rgb)
    axes.set(ylim=(0, 1), title="Single pixels of a Color Checker, with 95 % bands")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(TARGET / "spectra.png")


def window(folder: Path) -> None:
    """The Results page with pins, and the cloud of a face; needs a display."""
    from dsl_app.results.cloud.views import InteractiveCloud
    from dsl_app.results.page import ResultsPage
    from dsl_app.shell.application import make_application
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    from tests.screens.look import Look
    from tests.screens.material import Material
    from tests.screens.results_scenes import _wait_for_cloud
    from tests.screens.stage import Stage

    make_application([])
    os.environ["HOME"] = str(folder)
    for name, pins in (("color-checker", PINS), ("face", ())):
        stage = Stage(name, folder / name, folder, Material(folder), Look(1280, 800, "light"))
        stage.folder.mkdir()
        stage.open()
        stage.window.open_path(stage.copied(EXAMPLES / f"{name}.zarr"))
        page = stage.window.page_of("results")
        assert isinstance(page, ResultsPage)
        stage.wait(lambda page=page: page._state.result.value is not None)  # type: ignore[misc]
        stage.idle()
        for pixel in pins:
            page._control.point_at(pixel)
            page._control.marks.pin(pixel)
        if name == "face":
            stage.window.do("view_cloud")
            stage.idle()
            _wait_for_cloud(stage, page)
            cloud = page.findChild(InteractiveCloud)
            for _ in range(TURNS):
                QTest.keyClick(cloud, Qt.Key.Key_Left)
            stage.settle()
        stage.shoot()
        if name == "face":
            cloud.grab().save(str(folder / "cloud.png"))
        stage.close()


def main() -> int:
    """Make all three; the window in a process with a virtual display."""
    if len(sys.argv) > 1:
        window(Path(sys.argv[1]))
        return 0
    from PIL import Image

    from tests.app.support.virtual_display import virtual_display

    TARGET.mkdir(exist_ok=True)
    spectra()
    # The picture shows the folder's name.
    with tempfile.TemporaryDirectory(prefix="lab-") as spare, virtual_display(1280, 800) as display:
        environment = {**os.environ, "DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "QT_API": "pyside6"}
        home = Path(spare) / "scans"
        home.mkdir()
        subprocess.run([sys.executable, __file__, home], env=environment, check=True)
        for scene, name in (("color-checker", "window"), ("cloud", "cloud")):
            picture = Image.open(home / f"{scene}.png").convert("RGB")
            picture.save(TARGET / f"{name}.jpg", quality=JPEG_QUALITY, optimize=True)
    for path in sorted(TARGET.iterdir()):
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
