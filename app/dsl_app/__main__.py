"""The desktop application: ``dsl-scan-gui``, ``dsl-scan gui``, or ``python -m dsl_app``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.shared.display import has_screen
from dsl_core.solve.threads import share_no_small_matrices

if TYPE_CHECKING:
    from dsl_app.shell.main_window import MainWindow

NO_SCREEN = (
    "There is no screen to open the window on: neither DISPLAY nor WAYLAND_DISPLAY is set. Log in to a"
    " desktop, or forward one (ssh -X). Without a window, use the command line; see 'dsl-scan --help'."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Open the window and run until it is closed; returns the exit code."""
    given = _parser().parse_args(arguments)
    if not has_screen(sys.platform, os.environ):
        print(NO_SCREEN, file=sys.stderr)
        return 2
    share_no_small_matrices()
    # superqt looks for this when it is imported.
    os.environ.setdefault("QT_API", "pyside6")
    from dsl_app.composition.window import Composition, StartOptions
    from dsl_app.connection.state import RigChoice
    from dsl_app.shell.application import ExceptionHook, collect_garbage, make_application
    from dsl_app.shell.warm_up import WarmUp

    application = make_application(sys.argv[:1])
    rig = None if given.rig is None else RigChoice(given.rig, _options(given.option))
    path = None if given.path is None else given.path.absolute()
    composition = Composition(StartOptions(rig, path, given.demo, predicts=True, offers_tour=True))
    window = composition.open_window(theme=given.theme, in_background=True)
    collect_garbage(window)
    hook = ExceptionHook(window.toasts)
    hook.install()
    warm_up = WarmUp(gives_way=composition.is_awaited)
    _after_first_page(window, composition.start, warm_up.start)
    window.show()
    code = application.exec()
    warm_up.stop()
    return code


def _after_first_page(window: MainWindow, *acts: Callable[[], object]) -> None:
    def opened(_: str) -> None:
        window.opened.disconnect(opened)
        for act in acts:
            act()

    window.opened.connect(opened)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="dsl-scan-gui", description="Scan, calibrate and read spectra in a window."
    )
    parser.add_argument("path", nargs="?", type=Path, help="a scan, result, reference or calibration to open")
    parser.add_argument("--rig", help="rig to connect instead of the one used last")
    parser.add_argument(
        "--option", "-O", action="append", default=[], metavar="KEY=VALUE", help="option of the rig"
    )
    parser.add_argument("--demo", action="store_true", help="open a finished scan of the simulated rig")
    parser.add_argument(
        "--theme", choices=("system", "light", "dark"), help="theme, instead of the one used last"
    )
    return parser


def _options(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    pairs = [text.partition("=") for text in texts]
    return tuple((key, value) for key, _, value in pairs)


if __name__ == "__main__":
    raise SystemExit(main())
