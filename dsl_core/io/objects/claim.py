"""Who works on a result that belongs in an object store: an object that its owner renews while it lives."""

from __future__ import annotations

import contextlib
import logging
import threading
import uuid
from pathlib import PurePosixPath
from typing import Self

from dsl_core.errors import StoreError
from dsl_core.io.claims import BEAT_S, LAPSE_S, ClaimedError, Owner
from dsl_core.io.objects.address import Address
from dsl_core.io.objects.store import ObjectFolder

_log = logging.getLogger(__name__)


class _Holder(Owner):
    """``token`` tells its claim from those of the same process, and of others with its number and name."""

    token: str = ""


class ObjectClaim:
    """Held from construction to `release`, or as a ``with`` block."""

    def __init__(self, target: Address, beat_s: float = BEAT_S, lapse_s: float = LAPSE_S) -> None:
        """Claim an address; raises `ClaimedError` that names its owner, `StoreError` if the store fails."""
        name = PurePosixPath(target.name)
        self._folder = ObjectFolder(Address(target.bucket, f"{name.parent}/.claims"))
        self._name = f"{name.name}.claim"
        mine = _Holder(**Owner.this().model_dump(), token=uuid.uuid4().hex)
        self._content = mine.model_dump_json().encode()
        #: Whose claim was taken over, as a sentence; empty where there was none.
        self.taken_over = ""
        if not self._folder.create(self._name, self._content):
            self._take_over(target, lapse_s)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, args=(beat_s,), daemon=True, name="claim")
        self._thread.start()

    def _take_over(self, target: Address, lapse_s: float) -> None:
        owner = self._folder.get(self._name)
        who = "another process" if owner is None else str(_Holder.model_validate_json(owner))
        # By the clock of the store, which a new object of ours tells; others who ask have another.
        probe = f"{self._name}.{uuid.uuid4().hex}"
        self._folder.put(probe, b"")
        known = self._folder.listed()
        self._folder.remove([probe])
        held = known.get(self._name)
        if held is not None and (known[probe].written - held.written).total_seconds() < lapse_s:
            raise ClaimedError(f"{target} is being made by {who}. Wait until it ends, or end it.")
        if held is None:
            self._folder.create(self._name, self._content)
        else:
            self._folder.replace(self._name, self._content, held)
        if not self._is_mine():  # another one was quicker
            raise ClaimedError(f"{target} is being made by another process. Wait until it ends, or end it.")
        self.taken_over = f"{target} was begun by {who}, which died; it is made again."

    def _beat(self, beat_s: float) -> None:
        while not self._ended.wait(beat_s):
            with contextlib.suppress(StoreError):
                if not self._is_mine():
                    _log.warning("%s was taken over: it had not been renewed for long.", self._name)
                    return
                self._folder.put(self._name, self._content)

    def _is_mine(self) -> bool:
        """Whether nobody has taken it over; a computer that sleeps does not renew its claims."""
        return self._folder.get(self._name) == self._content

    def release(self) -> None:
        """Let others work on it."""
        self._ended.set()
        self._thread.join()
        with contextlib.suppress(StoreError):  # it lapses
            if self._is_mine():
                self._folder.remove([self._name])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.release()
