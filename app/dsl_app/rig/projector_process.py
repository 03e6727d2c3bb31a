"""The projector's window as a program of its own, for whoever has none: the command line, or a server.

It reads patterns from its input, each a line with the shape in JSON and the drive levels, and answers each by
a line of JSON: when it was painted, or what is wrong. It ends with its input.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import BinaryIO

import numpy as np
from PySide6.QtCore import QMetaObject, Qt
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QApplication

from dsl_app.rig.projector_window import ProjectorWindow, ScreenProjector
from dsl_core.errors import DeviceError, DslError


def choose_screen(name: str, screens: Sequence[QScreen], alone: bool) -> QScreen:
    """The screen of a name; without one, the only one (``alone``) or the first that is not the operator's.

    Raises `DeviceError`.
    """
    named = [screen for screen in screens if screen.name() == name]
    others = list(screens) if alone else list(screens)[1:]
    if named or (not name and others):
        return (named or others)[0]
    there = ", ".join(screen.name() for screen in screens) or "none"
    wanted = f"no screen {name!r}" if name else "no second screen"
    raise DeviceError(
        f"There is {wanted}; screens: {there}. Connect the projector and extend the desktop onto it, or"
        " change screen in the profile."
    )


def serve(projector: ScreenProjector, patterns: BinaryIO, answers: BinaryIO) -> None:
    """Show pattern after pattern until there are no more."""
    while header := patterns.readline():
        shape = tuple(json.loads(header))
        image = np.frombuffer(patterns.read(int(np.prod(shape))), np.uint8).reshape(shape)
        try:
            projector.show(image)
            period_ms = projector.info.frame_period_ms
            tell(answers, painted_s=time.monotonic(), frame_period_ms=period_ms)
        except DslError as error:
            tell(answers, error=str(error))


def tell(answers: BinaryIO, **said: object) -> None:
    """Write one line."""
    answers.write((json.dumps(said) + "\n").encode())
    answers.flush()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until the input ends; 0, or 2 where no screen can be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--screen", default="", help="name of the screen")
    parser.add_argument("--alone", action="store_true", help="the only screen is the projector")
    chosen = parser.parse_args(arguments)
    # Only answers may be on the pipe: whatever else is printed goes to the errors.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    application = QApplication(sys.argv[:1])
    window = ProjectorWindow()
    try:
        window.arm(choose_screen(chosen.screen, QGuiApplication.screens(), chosen.alone), chosen.alone)
    except DslError as error:
        tell(answers, error=str(error))
        return 2
    projector = ScreenProjector(window, latency_ms=0.0)
    tell(answers, **asdict(projector.info))

    def work() -> None:
        try:
            serve(projector, sys.stdin.buffer, answers)
        except (OSError, ValueError):
            pass  # the other side is gone, in the middle of a pattern too
        finally:
            QMetaObject.invokeMethod(application, "quit", Qt.ConnectionType.QueuedConnection)

    threading.Thread(target=work, daemon=True).start()
    return application.exec()


if __name__ == "__main__":
    sys.exit(main())
