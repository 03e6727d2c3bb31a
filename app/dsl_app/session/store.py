"""Saves the session on disk while the program runs, and finds the session of a program that crashed. No Qt.

Each running program has a file of its own, named by its computer, as several may share the folder, and its
process. It removes the file when it ends normally: a file whose process no longer runs is from a crash.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from dsl_app.session.records import Session
from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder, set_aside, write_atomic
from dsl_core.io.reading import read_bounded
from dsl_core.io.scan.origin import computer_name

_log = logging.getLogger(__name__)
_PREFIX = "session-"
_ADVICE = "Use File, Open recent to open your files."


class SessionStore:
    """Writes what ``collect`` gives whenever that has changed since the last `save`."""

    def __init__(
        self,
        folder: Path,
        collect: Callable[[], Session],
        process: int | None = None,
        writer: Executor | None = None,
    ) -> None:
        """``process`` is this program's number; its own by default.

        With a ``writer`` of one thread, `save` does not wait for the disk, and tells of a failure next time.
        """
        self._writer, self._writing = writer, Future[str]()
        self._writing.set_result("")
        self._folder, self._collect = folder, collect
        self._process = os.getpid() if process is None else process
        self._host = re.sub(r"[^\w-]", "_", computer_name())
        self._path = folder / f"{_PREFIX}{self._host}-{self._process}.json"
        self._latest: Session | None = None
        self._has_complained = False

    def save(self) -> str:
        """Write the session if it has changed; returns a sentence the first time that this fails.

        Called by a timer, so that many changes cost one write. An empty session gets no file.
        """
        if not self._writing.done():
            return ""
        session, trouble = self._collect(), self._told()
        if session == self._latest or (self._latest is None and not session.names):
            return trouble
        self._latest = session
        if self._writer is not None:
            self._writing = self._writer.submit(self._write, session)
            return trouble
        return self._write(session)

    def _told(self) -> str:
        """What became of the last write, once."""
        trouble = self._writing.result()
        self._writing = Future()
        self._writing.set_result("")
        return trouble

    def _write(self, session: Session) -> str:
        try:
            make_folder(self._folder)
            write_atomic(self._path, session.model_dump_json(indent=1).encode())
        except (OSError, StoreError) as error:
            return self._complain(f"The open session cannot be saved for recovery after a crash: {error}")
        return ""

    def _complain(self, text: str) -> str:
        _log.warning("%s", text)
        first, self._has_complained = not self._has_complained, True
        return text if first else ""

    def remove(self) -> None:
        """Remove the file: the program ends normally, and nothing has to be restored."""
        self._told()
        with suppress(OSError):  # it was never written, and that was told
            self._path.unlink()

    def crashed_session(self) -> tuple[Session | None, str]:
        """The newest session of a program that crashed here, and a sentence on one that cannot be read.

        All sessions of crashed programs that can be read are removed, so that they are offered once.
        """
        newest: Session | None = None
        trouble = ""
        for path in sorted(self._folder.glob(f"{_PREFIX}*.json"), key=_age, reverse=True):
            # Files of earlier versions name no computer, or its domain as well.
            host, _, number = path.stem.removeprefix(_PREFIX).rpartition("-")
            if host.partition(".")[0] not in ("", self._host) or not number.isdigit():
                continue
            if int(number) != self._process and is_running(int(number)):
                continue
            try:
                found = Session.model_validate_json(read_bounded(path))
            except FileNotFoundError:
                continue  # another program that was started just now offers it
            except OSError as error:
                trouble = f"The session before the crash could not be read now ({error}). {_ADVICE}"
                continue
            except ValidationError:
                trouble = (
                    "The session before the crash could not be read: its file is damaged."
                    f"{set_aside(path)} {_ADVICE}"
                )
                continue
            path.unlink(missing_ok=True)
            if newest is None and found.names:
                newest = found
        return newest, trouble


def _age(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def is_running(process: int) -> bool:
    """Whether a process of that number runs and is a Python program: another one may have got the number."""
    import psutil

    try:
        words = psutil.Process(process).cmdline()
    except (psutil.Error, OSError):
        return False
    return any("python" in word or "dsl-scan" in word for word in words[:2])
