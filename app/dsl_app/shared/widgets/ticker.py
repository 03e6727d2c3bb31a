"""A timer that keeps calling."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, QTimer


class Ticker(QTimer):
    """Calls ``act`` every so many milliseconds while it runs, as long as its parent lives."""

    def __init__(self, parent: QObject, interval_ms: int, act: Callable[[], object]) -> None:
        super().__init__(parent)
        self.setInterval(interval_ms)
        self.timeout.connect(act)

    def run_while(self, is_needed: bool) -> None:
        """Run, or stop."""
        if is_needed:
            self.start()
        else:
            self.stop()
