"""Everything that is wrong with a scan, one clear sentence each."""

from __future__ import annotations

from collections.abc import Iterator

from dsl_core.errors import DriveError, StoreError
from dsl_core.io.scan.capture_log import LogEntry
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import Shot, describe_shot, spoken_number

#: A camera may round the exposure it was asked for by this share.
EXPOSURE_TOLERANCE = 0.05


def find_problems(reader: ScanReader, verify: bool = False) -> list[str]:
    """Sentences about frames of other scans, missing, extra, wrongly exposed or repeated ones, in this order.

    With ``verify`` every frame is also read and compared with its checksum (truncated, damaged, swapped).
    """
    strangers = [reader.strangers] if reader.strangers else []
    found = [*strangers, *_missing(reader), *_extra(reader), *_wrong_exposure(reader), *_repeated(reader)]
    return [*found, *_unreadable(reader)] if verify else found


def require_complete(reader: ScanReader) -> None:
    """Raise `StoreError` with the first problem, and how many more there are, unless all is well."""
    found = find_problems(reader)
    if found:
        more = f" ({len(found) - 1} more problems)" if len(found) > 1 else ""
        raise StoreError(found[0] + more)


def _missing(reader: ScanReader) -> Iterator[str]:
    shots = reader.missing()
    if shots:
        yield (
            f"{reader.folder} lacks {len(shots)} of {reader.plan.shot_count} frames, the first is"
            f" {describe_shot(shots[0])}. Resume the scan to capture them."
        )


def _extra(reader: ScanReader) -> Iterator[str]:
    count = reader.plan.shot_count
    extra = sorted(i for i in reader.store.stored() | set(reader.entries) if i >= count)
    if extra:
        yield (
            f"{reader.folder} contains {len(extra)} more frames than the {count} of its plan, the first is"
            f" number {spoken_number(extra[0])}. They belong to another scan; move"
            f" {reader.store.path(extra[0])} away."
        )


def _wrong_exposure(reader: ScanReader) -> Iterator[str]:
    for shot in reader.plan.shots():
        entry = reader.entries.get(shot.index)
        if entry and abs(entry.exposure_ms - shot.exposure_ms) > EXPOSURE_TOLERANCE * shot.exposure_ms:
            yield (
                f"{_name(reader, shot)} was exposed for {entry.exposure_ms:g} ms instead of"
                f" {shot.exposure_ms:g} ms. {_remedy(reader, shot)}"
            )


def _repeated(reader: ScanReader) -> Iterator[str]:
    before: tuple[Shot, LogEntry] | None = None
    for shot in reader.plan.shots():
        entry = reader.entries.get(shot.index)
        if before and entry and _is_repeat(before[1], entry):
            yield (
                f"{_name(reader, shot)} is the same exposure as frame {before[0].number}:"
                f" the camera delivered an old picture. {_remedy(reader, shot)}"
            )
        before = (shot, entry) if entry else None


def _is_repeat(before: LogEntry, entry: LogEntry) -> bool:
    """Same number, or same noise: two exposures never agree in every pixel unless all are clipped.

    A frame that was taken again and came out the same is believed: its camera has no noise.
    """
    if before.run != entry.run:
        return False
    if before.frame_id == entry.frame_id:
        return True
    clipped = entry.darkest_dn == entry.brightest_dn
    return before.crc32 == entry.crc32 and not clipped and entry.attempts == 1


def _unreadable(reader: ScanReader) -> Iterator[str]:
    present = set(reader.entries) & reader.store.stored()
    for shot in reader.plan.shots():
        if shot.index in present:
            try:
                reader.read(shot)
            except DriveError:
                raise
            except StoreError as error:
                yield str(error)


def _name(reader: ScanReader, shot: Shot) -> str:
    return f"{describe_shot(shot).capitalize()} of {reader.folder}"


def _remedy(reader: ScanReader, shot: Shot) -> str:
    return f"Delete {reader.store.path(shot.index)} and resume the scan to capture it again."
