"""What pictures show that goes against the mapping by which they are arranged."""

from __future__ import annotations

from collections.abc import Sequence

from dsl_core.errors import StoreError
from dsl_core.io.pictures.candidates import Candidate, jump_of
from dsl_core.io.pictures.picture_file import Picture
from dsl_core.io.pictures.source import PictureScan
from dsl_core.optics.colour import srgb_decode
from dsl_core.patterns.recognition.odd_pictures import odd_among
from dsl_core.patterns.recognition.probes import ProbeTaker

#: One pair that is no pattern and inverse may be one spoilt picture; more are pictures that are shifted, and
#: with two digits wrong, few positions are right.
MOST_SPOILT = 1


def doubts_of_mapping(scan: PictureScan) -> list[str]:
    """Pairs that are no pattern and its inverse, and numbers of names that jump, as sentences.

    What the mapping itself says is left out. Raises `StoreError` as `require_pairs` does.
    """
    odd, jump = require_pairs(scan), _jump(scan)
    doubts = [
        f"{_name(one)} and {_name(other)} should be a pattern and its inverse, but one of them shows"
        " something else, and many positions are wrong"
        for one, other in odd
    ]
    if jump:
        doubts.append(f"{jump}: pictures may be missing, or not belong to the capture")
    return [each for each in doubts if each not in scan.mapping.unsure]


def require_pairs(scan: PictureScan) -> list[tuple[Picture, Picture]]:
    """Patterns and inverses of the mapping that do not go against each other.

    A mapping counts pictures only: one that is missing and a stray one shift all between them without a word.
    Raises `StoreError` where more than one is wrong, so that pictures must be shifted.
    """
    odd, count = _odd_pairs(scan), len(scan.arrangement.pairs)
    if len(odd) <= MOST_SPOILT:
        return odd
    one, other = (_name(picture) for picture in odd[0])
    jump = _jump(scan)
    where = f"; {jump}" if jump else ""
    raise StoreError(
        f"By the mapping, {one} and {other} are a pattern and its inverse, but they are not, nor are"
        f" {len(odd) - 1} of the other {count - 1} pairs: a picture is missing, or another stands in its"
        f" place{where}. Compare the table with what was projected, and correct files, parts or missing of"
        " the mapping."
    )


def _jump(scan: PictureScan) -> str:
    """Where the numbers of names jump although the mapping names no picture as missing; else empty."""
    candidate = Candidate(scan.plan.name, scan.arrangement.listed, (), 0)
    return "" if scan.mapping.missing else jump_of(candidate)


def _odd_pairs(scan: PictureScan) -> list[tuple[Picture, Picture]]:
    """Patterns and inverses of the mapping that do not go against each other."""
    pairs = scan.arrangement.pairs
    if not pairs:
        return []
    pictures = list(dict.fromkeys(picture for _, *both in pairs for picture in both))
    taker = ProbeTaker()
    for picture in pictures:
        taker.add(scan.load(picture))
    full_scale = float(2**scan.bit_depth - 1)
    # Where stripes blur, pictures for screens are brighter than a pattern and its inverse would be.
    views = taker.finish(full_scale), taker.finish(full_scale, srgb_decode)
    odd: list[tuple[Picture, Picture]] = []
    for axis in ("columns", "rows"):
        own = [(pictures.index(one), pictures.index(other)) for on, one, other in pairs if on == axis]
        lines = [view.across if axis == "columns" else view.down for view in views]
        found: Sequence[set[tuple[int, int]]] = [set(odd_among(each, own)) for each in lines]
        odd += [(pictures[a], pictures[b]) for a, b in own if all((a, b) in each for each in found)]
    return odd


def _name(picture: Picture) -> str:
    return picture.path.name if picture.index is None else f"{picture.path.name}[{picture.index}]"
