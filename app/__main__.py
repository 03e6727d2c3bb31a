"""The desktop application: ``dsl-scan-gui``, or ``python -m app``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Open the window and stay until it is closed; returns the exit code."""
    wanted = _parser().parse_args(arguments)
    # pyvistaqt and superqt ask which Qt to use before anything of ours is imported by them.
    os.environ.setdefault("QT_API", "pyside6")
    from app.application import ExceptionHook, make_application, make_window
    from app.composition import Composition, Wish
    from app.state.rig import RigChoice

    application = make_application(sys.argv[:1])
    rig = None if wanted.rig is None else RigChoice(wanted.rig, _options(wanted.option))
    composition = Composition(Wish(rig, wanted.path))
    window = make_window(composition.pages)
    hook = ExceptionHook(window.toasts)
    hook.install()
    window.show()
    composition.start(window)
    return application.exec()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="dsl-scan-gui", description="Scan and read spectra by hand.")
    parser.add_argument("path", nargs="?", type=Path, help="a scan or a result to open")
    parser.add_argument("--rig", help="rig to connect instead of the last one")
    parser.add_argument(
        "--option", "-o", action="append", default=[], metavar="KEY=VALUE", help="option of the rig"
    )
    return parser


def _options(texts: Sequence[str]) -> tuple[tuple[str, str], ...]:
    pairs = [text.partition("=") for text in texts]
    return tuple((key, value) for key, _, value in pairs)


if __name__ == "__main__":
    raise SystemExit(main())
