"""The desktop application: ``dsl-scan-gui``, ``dsl-scan gui``, or ``python -m dsl_app``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsl_app.shell.main_window import MainWindow

NO_SCREEN = (
    "There is no screen to open the window on: neither DISPLAY nor WAYLAND_DISPLAY is set. Log in at a"
    " desktop, or forward one (ssh -X). Everything but the window also works by 'dsl-scan'; see"
    " 'dsl-scan --help'."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Open the window and stay until it is closed; returns the exit code."""
    wanted = _parser().parse_args(arguments)
    if not has_screen(sys.platform, os.environ):
        print(NO_SCREEN, file=sys.stderr)
        return 2
    # superqt asks which Qt to use before anything of ours is imported by them.
    os.environ.setdefault("QT_API", "pyside6")
    from dsl_app.composition.window import IMPORTS, Composition, Wish
    from dsl_app.connection.state import RigChoice
    from dsl_app.shell.application import ExceptionHook, collect_garbage, make_application, make_window
    from dsl_app.shell.warm_up import WarmUp

    application = make_application(sys.argv[:1])
    rig = None if wanted.rig is None else RigChoice(wanted.rig, _options(wanted.option))
    path = None if wanted.path is None else wanted.path.absolute()
    composition = Composition(Wish(rig, path, wanted.demo, predicts=True, is_first_contact=True))
    window = make_window(
        composition.pages,
        theme=wanted.theme,
        commands=composition.commands,
        imports=IMPORTS,
        takers=composition.takers,
    )
    collect_garbage(window)
    hook = ExceptionHook(window.toasts)
    hook.install()
    warm_up = WarmUp()
    _at_the_first_page(window, lambda: composition.start(window), warm_up.start)
    window.show()
    code = application.exec()
    warm_up.stop()
    return code


def _at_the_first_page(window: MainWindow, *acts: Callable[[], object]) -> None:
    def opened(_: str) -> None:
        window.opened.disconnect(opened)
        for act in acts:
            act()

    window.opened.connect(opened)


def has_screen(platform: str, environment: Mapping[str, str]) -> bool:
    """Whether Qt will find something to draw on; without it would end the process instead of saying so."""
    if not platform.startswith("linux") or environment.get("QT_QPA_PLATFORM"):
        return True
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="dsl-scan-gui", description="Scan and read spectra by hand.")
    parser.add_argument("path", nargs="?", type=Path, help="a scan, result, reference or calibration to open")
    parser.add_argument("--rig", help="rig to connect instead of the last one")
    parser.add_argument(
        "--option", "-o", action="append", default=[], metavar="KEY=VALUE", help="option of the rig"
    )
    parser.add_argument("--demo", action="store_true", help="open a finished scan of the twin")
    parser.add_argument(
        "--theme", choices=("system", "light", "dark"), help="colours, instead of those used last"
    )
    return parser


def _options(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    pairs = [text.partition("=") for text in texts]
    return tuple((key, value) for key, _, value in pairs)


if __name__ == "__main__":
    raise SystemExit(main())
