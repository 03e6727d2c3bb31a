"""Where something is in an object store."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dsl_core.errors import StoreError

_SCHEME = "s3:/"


@dataclass(frozen=True)
class Address:
    """A bucket, and a name in it that all objects of a scan or result begin with."""

    bucket: str
    name: str

    def __str__(self) -> str:
        return f"s3://{self.bucket}/{self.name}"


def address_of(path: Path) -> Address | None:
    """The address that a path of the command line stands for; None for a path of this computer.

    A path keeps one slash of two. Raises `StoreError` for an address that lacks a name, or holds a secret.

    >>> str(address_of(Path("s3://bucket/2026/leaf.dsl")))
    's3://bucket/2026/leaf.dsl'
    """
    text = path.as_posix()
    if not text.startswith(_SCHEME):
        return None
    bucket, _, name = text.removeprefix(_SCHEME).lstrip("/").partition("/")
    if "@" in bucket:
        # Not repeated: what is before the @ may be a secret.
        raise StoreError(
            "An address of an object store must not contain a user or a password. Give s3://BUCKET/NAME, and"
            " the credentials as AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment."
        )
    if not bucket or not name:
        raise StoreError(f"{text.replace(_SCHEME, 's3://')} names no object. Give s3://BUCKET/NAME.")
    return Address(bucket, name)


def require_local(path: Path) -> None:
    """Raise `StoreError` for an address or ``~``: as paths, they would make folders with such names."""
    if path.parts[:1] == ("~",):
        raise StoreError(
            f"{path} cannot be written: ~ stands for a home folder, and this user has none, or it was not"
            " looked up. Give a whole path; set DSL_SCAN_HOME to a folder for what the program keeps itself."
        )
    address = address_of(path)
    if address is not None:
        raise StoreError(
            f"{address} is an address of an object store; this is written on this computer only."
            " Give a path of this computer."
        )


def shown(path: Path) -> str:
    """A path as a person writes it, addresses with both slashes."""
    return str(address_of(path) or path)
