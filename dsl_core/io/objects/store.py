"""A folder of an object store: its objects by their names in it.

Credentials, region and endpoint come from the environment alone (``AWS_ACCESS_KEY_ID`` and others). What the
library says of an error is not passed on: it may quote keys and signatures.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import PurePosixPath
from typing import Any

from dsl_core.errors import StoreError
from dsl_core.io.objects.address import Address

#: A store that is slower than this is told as one that does not answer.
_CLIENT: Any = {"connect_timeout": "10s", "timeout": "120s", "allow_http": True}
_RETRY: Any = {"max_retries": 4, "retry_timeout": timedelta(seconds=60)}


@dataclass(frozen=True)
class Found:
    """An object: bytes, what the store calls its content, and when it was written."""

    size: int
    tag: str
    written: datetime


class ObjectFolder:
    """The objects below an address; every failure is a `StoreError` that names the address."""

    def __init__(self, address: Address) -> None:
        """Nothing is asked of the store yet."""
        from obstore.store import S3Store

        self.address = address
        with self._told("cannot be used"):
            self._store: Any = S3Store(
                address.bucket, prefix=address.name, client_options=_CLIENT, retry_config=_RETRY
            )

    def listed(self) -> dict[str, Found]:
        """All objects by their names, but for empty ones that other programs make in place of folders."""
        import obstore

        with self._told("cannot be read"):
            found = {
                meta["path"]: Found(meta["size"], str(meta["e_tag"]), meta["last_modified"])
                for batch in obstore.list(self._store)
                for meta in batch
            }
        folders = {"", *(str(folder) for name in found for folder in PurePosixPath(name).parents)}
        return {name: each for name, each in found.items() if each.size or name not in folders}

    def get(self, name: str) -> bytes | None:
        """An object; None where there is none."""
        import obstore

        with self._told("cannot be read"):
            try:
                return bytes(obstore.get(self._store, name).bytes())
            except FileNotFoundError:
                return None

    def put(self, name: str, content: bytes) -> None:
        """Write an object, in place of one that is there."""
        import obstore

        with self._told("could not be written"):
            obstore.put(self._store, name, content)

    def create(self, name: str, content: bytes) -> bool:
        """Write an object where none is; says whether it did."""
        import obstore
        from obstore.exceptions import AlreadyExistsError, PreconditionError

        with self._told("could not be written"):
            try:
                obstore.put(self._store, name, content, mode="create", use_multipart=False)
            except (AlreadyExistsError, PreconditionError):
                return False
            return True

    def replace(self, name: str, content: bytes, found: Found) -> None:
        """Write an object in place of one that was found, unless somebody has changed it since."""
        import obstore
        from obstore.exceptions import PreconditionError

        changed = contextlib.suppress(FileNotFoundError, PreconditionError)
        with self._told("could not be written"), changed:
            obstore.put(self._store, name, content, mode={"e_tag": found.tag}, use_multipart=False)

    def remove(self, names: list[str]) -> None:
        """Delete objects, if they are there."""
        import obstore

        with self._told("could not be changed"), contextlib.suppress(FileNotFoundError):
            if names:
                obstore.delete(self._store, names)

    @contextlib.contextmanager
    def _told(self, what: str) -> Iterator[None]:
        from obstore.exceptions import BaseError

        try:
            yield
        except (BaseError, OSError, ValueError) as error:
            why, do = _reason(error, self.address.bucket)
            # Without the library's own words, which may quote keys and signatures.
            raise StoreError(f"{self.address} {what}: {why}. {do}") from None


def _reason(error: Exception, bucket: str) -> tuple[str, str]:
    """What went wrong, and what to do."""
    from obstore.exceptions import PermissionDeniedError, UnauthenticatedError

    # A listing that is refused has no class of its own.
    found = re.search(r"status(?: code)?: (\d{3})\b", str(error))
    status = int(found[1]) if found else 0
    if isinstance(error, PermissionDeniedError | UnauthenticatedError) or status in (401, 403):
        return (
            "the store refused the credentials",
            "Check AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment, and what they may do.",
        )
    if isinstance(error, FileNotFoundError) or status == 404:
        return (
            f"the bucket {bucket} is not there",
            "Check its name, and AWS_ENDPOINT_URL in the environment.",
        )
    return (
        "the store does not answer, or not as it should",
        "Check the network, and AWS_ENDPOINT_URL and AWS_REGION in the environment; then give the same"
        " command again.",
    )
