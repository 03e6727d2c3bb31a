"""One writer a campaign, among all windows and commands of this computer."""

from __future__ import annotations

from pathlib import Path

from dsl_core.io.atomic import store_error
from dsl_core.io.scan.lock import SessionLock


class CampaignLock:
    """Held between `take` and `release`."""

    def __init__(self) -> None:
        self._lock: SessionLock | None = None

    def take(self, folder: Path) -> None:
        """Take it; raises `StoreError` when another process writes the campaign, or nobody may."""
        try:
            self._lock = SessionLock(folder / "lock")
        except OSError as error:
            raise store_error(folder / "lock", error) from error

    def release(self) -> None:
        """Give it back; a second call does nothing."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None
