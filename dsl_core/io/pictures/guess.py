"""A mapping guessed from the pictures of a folder, and what of it is unsure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import arrange
from dsl_core.io.pictures.candidates import FEWEST, Candidate, candidates, jump_of
from dsl_core.io.pictures.encoding import guessed_encoding
from dsl_core.io.pictures.guessed_parts import guessed_size, is_turned, part_of, untold_width
from dsl_core.io.pictures.look import Look, has_ending, look_at
from dsl_core.io.pictures.mapping import Encoding, Mapping
from dsl_core.io.pictures.picture_file import ARRAYS, LINEAR, load_values
from dsl_core.model.captured_code import Axis
from dsl_core.patterns.recognition.odd_pictures import lost_after, odd_pairs, same_in_a_row
from dsl_core.patterns.recognition.sequence import Recognised, recognise
from dsl_core.patterns.recognition.stripe_sets import StripeReading
from dsl_core.progress import NoProgress, Progress
from dsl_core.words import counted

#: Readings worse than this make sense, but not much.
DOUBTFUL = 0.8
#: Readings worse than this may come from values that are encoded for screens: their stripes look uneven, and
#: the finest, which a lens blurs, may pass for steps of sinusoids.
AS_ENCODED = 0.1
#: More pictures than this are rarely those of a code alone: 11 digits of columns and of rows have 46.
MANY = 64
Size = tuple[int, int]


@dataclass(frozen=True)
class Guess:
    """The mapping, what each file shows by it, other captures in the folder, and what a person must state."""

    mapping: Mapping
    table: tuple[tuple[str, str], ...]
    others: tuple[str, ...]
    asks: str = ""


def guess_mapping(
    folder: Path,
    projector_size_px: Size | None = None,
    chosen: str | None = None,
    progress: Progress | None = None,
    encoding: Encoding | None = None,
) -> Guess:
    """Find out from the pictures how they are a capture; ``chosen`` names one of several in the folder.

    An ``encoding`` of values that is known is not guessed. Nothing is written. Raises `StoreError` that says
    what was found when the pictures make no sense.
    """
    if not folder.is_dir():
        raise StoreError(f"{folder} is not a folder. Give the folder that contains the pictures.")
    progress = progress or NoProgress()
    whole, single = candidates(folder)
    names = list(dict.fromkeys(each.name for each in single))
    if chosen is not None:
        single = [each for each in single if each.name == chosen]
        if not single:
            known = ", ".join(names) or "none"
            raise StoreError(f"{folder} contains no set {chosen!r}; found were: {known}. Name one of these.")
        whole = []
    # A folder with a folder for each pose or camera holds many captures of the same kind.
    order = [*single, *whole] if len(names) > 2 and _alike(single) else [*whole, *single]
    best: tuple[Candidate, Look, Recognised] | None = None
    trouble: StoreError | None = None
    first: tuple[Candidate, Look] | None = None
    for number, candidate in enumerate(order):
        progress.report("look at the pictures", number, len(order))
        try:
            look = look_at(candidate)
        except StoreError as error:
            trouble = trouble or error
            continue
        first = first or (candidate, look)
        slots, count = [], 0
        for picture in candidate.pictures:
            slots.append(None if picture is None else count)
            count += picture is not None
        found = _recognised(look, tuple(slots), projector_size_px)
        if found is not None and (best is None or found.misfit < best[2].misfit):
            best = candidate, look, found
        if best is None or best[2].misfit >= DOUBTFUL or _alike_next(order, number, whole):
            continue
        # Two dark pictures pass for a digit and its inverse, or for black twice, until one is left out.
        is_doubtful = best[2].has_odd_pair or best[2].has_spare
        if not (is_doubtful and any(each in whole for each in order[number + 1 : number + 2])):
            break
    if best is not None and best[0] in whole and len(names) > 1:
        best = _single_instead(best, single, projector_size_px) or best
    elif best is not None and len(names) > 1 and not best[2].has_inverses:
        best = _whole_instead(best, whole, projector_size_px) or best
    if best is None:
        raise trouble or StoreError(
            f"The pictures of {folder} make no sense as a capture: no order of white, black, stripes and"
            f" sinusoids lets their positions run steadily. {_advice(order, first)}"
        )
    return _guess_of(folder, *best, projector_size_px, names, encoding)


def _advice(tried: Sequence[Candidate], looked_at: tuple[Candidate, Look] | None) -> str:
    """What to do about pictures that make no sense; the first candidate that was looked at may tell."""
    first = next((each.pictures[0] for each in tried if each.pictures[0] is not None), None)
    if first is not None and first.path.suffix.lower() in ARRAYS and first.index is not None:
        count, shape = len(tried[0].pictures), load_values(first).shape
        is_matlab = first.path.suffix.lower() == ".mat"
        axis, instead = ("first", "0, -1") if is_matlab else ("last", "-1, 0")
        if min(shape) < count:
            return (
                f"{first.path.name} is taken for {count} pictures of {shape[1]} x {shape[0]} px; where its"
                f" {axis} axis counts the pictures, save numpy.moveaxis(array, {instead})"
                f"{' (permute(array, [2 3 1]) in MATLAB)' if is_matlab else ''} instead."
            )
    if looked_at is not None and (twice := same_in_a_row(looked_at[1].probes.across)):
        one, other = (_picture_name(looked_at[0], place) for place in twice[0])
        return (
            f"{one} and {other} show the same. Keep one picture of each pattern, at one exposure; where the"
            " projector was late, capture again."
        )
    if tried and (count := len(tried[0].pictures)) > MANY:
        return (
            f"Most codes have fewer than {count} pictures: keep those of other patterns, such as scan lines,"
            " in another folder, or state a mapping whose files are those of the code."
        )
    return "Check that all are of one camera and scene and not too noisy, or state a mapping."


def _picture_name(candidate: Candidate, place: int) -> str:
    """The name of a picture by its place among those that are there."""
    picture = [each for each in candidate.pictures if each is not None][place]
    return picture.path.name if picture.index is None else f"{picture.path.name}[{picture.index}]"


def _doubts_of_digits(candidate: Candidate, look: Look, found: Recognised) -> list[str]:
    """Pictures that are no pattern and inverse; raises `StoreError` where the picture of a digit is lost."""
    doubts = []
    for block in found.blocks:
        if not isinstance(block.reading, StripeReading):
            continue
        as_stored, decoded, lines = (
            probes.across if block.axis == "columns" else probes.down
            for probes in (look.probes, look.decoded, found.probes)
        )
        if lost := lost_after(lines, block.slots, block.reading):
            one, other = (_picture_name(candidate, place) for place in lost)
            raise StoreError(
                f"The stripes of {block.axis} become four times finer from {one} to {other}: the picture of a"
                " digit between them is lost, or pictures are exchanged, so that no position is known."
                " Correct that, or name only the pictures of the other axis in a mapping."
            )
        # Where stripes blur, pictures for screens are brighter than a pattern and its inverse would be.
        odd = [odd_pairs(each, block.slots, block.reading) for each in (as_stored, decoded)]
        for pair in (each for each in odd[0] if each in odd[1]):
            one, other = (_picture_name(candidate, place) for place in pair)
            doubts.append(
                f"{one} and {other} should be a pattern and its inverse, but one of them shows something"
                " else, and many positions are wrong: guess again without the wrong one"
            )
    return doubts


def _recognised(look: Look, slots: tuple[int | None, ...], size_px: Size | None = None) -> Recognised | None:
    """What the pictures show as they are, or as pictures for screens where that makes more sense."""
    columns, rows = ((length - 1).bit_length() for length in size_px or (0, 0))
    needed: dict[Axis, int] = {"columns": columns, "rows": rows} if size_px else {}
    found = recognise(look.probes, slots, needed)
    if found is not None and found.misfit_upright < AS_ENCODED:
        return found
    decoded = recognise(look.decoded, slots, needed)
    return min((each for each in (found, decoded) if each), key=lambda each: each.misfit, default=None)


def _single_instead(
    best: tuple[Candidate, Look, Recognised], single: Sequence[Candidate], size_px: Size | None
) -> tuple[Candidate, Look, Recognised] | None:
    """The first of several sets that show the same, as those of two cameras do; None for parts of one."""
    # Stripes in one folder and the sinusoids that they count in another belong together.
    if not _alike(single) or len(single) < 2:
        return None
    found = []
    for each in single[:2]:
        try:
            look = look_at(each)
        except StoreError:
            return None
        slots = tuple(range(len(each.pictures)))
        read = None if None in each.pictures else _recognised(look, slots, size_px)
        if read is None or read.misfit > DOUBTFUL:
            return None
        found.append((each, look, read))
    # Names with the time of day begin a new set each minute, in the middle of a code.
    if found[0][2].content != found[1][2].content or _is_split(best[2], found[0][2]):
        return None
    return found[0]


def _whole_instead(
    best: tuple[Candidate, Look, Recognised], whole: Sequence[Candidate], size_px: Size | None
) -> tuple[Candidate, Look, Recognised] | None:
    """All pictures where they hold the inverses of a set, as names that end in "inv" do; else None."""
    for each in whole:
        if None in each.pictures:
            continue
        try:
            look = look_at(each)
        except StoreError:
            continue
        read = _recognised(look, tuple(range(len(each.pictures))), size_px)
        if read is not None and read.misfit < DOUBTFUL and _is_split(read, best[2]):
            return each, look, read
    return None


def _is_split(whole: Recognised, part: Recognised) -> bool:
    """Whether sets are pictures or inverses of one code: each has as many digits of an axis as all have."""
    together, alone = whole.digits, part.digits
    return alone <= together and whole.has_inverses and not part.has_inverses


def _alike(single: Sequence[Candidate]) -> bool:
    return len({len(each.pictures) for each in single}) == 1


def _alike_next(order: Sequence[Candidate], number: int, whole: Sequence[Candidate]) -> bool:
    """Whether the next candidate is this one with absent pictures, or without files that stand alone."""
    if number + 1 == len(order):
        return False
    this, following = order[number], order[number + 1]
    return following.files == this.files or (following in whole and following.left_out > this.left_out)


def _guess_of(
    folder: Path,
    candidate: Candidate,
    look: Look,
    found: Recognised,
    size_px: Size | None,
    names: Sequence[str],
    encoding: Encoding | None,
) -> Guess:
    unsure = [*look.notes, *_doubts_of_digits(candidate, look, found)]
    size, doubt = (size_px, "") if size_px else guessed_size(found.blocks)
    parts, turned = [], is_turned(found.blocks, size)
    if turned:
        unsure.append(
            f"numbers fit a projector of {size[0]} x {size[1]} px only where its columns run down the"
            " picture: the camera is taken to be turned by 90 degrees"
        )
    for block in found.blocks:
        part, doubts = part_of(block, found.blocks, size, found.probes, turned)
        parts.append(part)
        unsure += doubts
    if doubt:
        unsure.append(doubt)
    if found.misfit > DOUBTFUL:
        unsure.append("positions run less steadily than usual; compare the table with what was projected")
    # Fewer pictures than a capture has are strays, not another set.
    is_of_several = candidate.left_out >= FEWEST
    others = [name for name in names if name != candidate.name] if is_of_several else []
    unsure += _doubts_of_files(candidate, others, found)
    mapping = Mapping(
        name=candidate.name,
        files=candidate.files,
        parts=tuple(parts),
        missing=candidate.absent,
        projector_size_px=size,
        bayer=look.bayer,
        bit_depth=look.bit_depth,
        left_aligned=look.left_aligned,
        full_scale=look.full_scale,
    )
    if encoding is None and has_ending(candidate, LINEAR):
        encoding = "linear"
    if encoding is None:
        mapping, doubts_of_values = guessed_encoding(folder, mapping)
        unsure += doubts_of_values
    else:
        mapping = mapping.model_copy(update={"encoding": encoding})
    mapping = mapping.model_copy(update={"unsure": tuple(unsure)})
    asks = untold_width(found.blocks, size, turned)
    return Guess(mapping, arrange(folder, mapping).table, tuple(others), asks)


def _doubts_of_files(candidate: Candidate, others: Sequence[str], found: Recognised) -> list[str]:
    """What is unsure of which files are the capture: missing ones, those of ``others``, and strays."""
    doubts = []
    if jump := jump_of(candidate):
        doubts.append(f"{jump}: pictures may be missing, or not belong to the capture")
    if count := len(candidate.absent):
        doubts.append(f"by their numbers {counted(count, 'picture is', 'pictures are')} absent")
    if others:
        doubts.append(f"there are other sets ({_few(others)}): name one with --set")
    elif candidate.left_out == 1:
        doubts.append("1 picture does not belong to the code and is not used")
    elif candidate.left_out:
        doubts.append(f"{candidate.left_out} pictures do not belong to the code and are not used")
    kinds = {block.kind for block in found.blocks}
    lacking = [name for name in ("white", "black") if name not in kinds]
    if lacking:
        doubts.append(f"there is no {' and no '.join(lacking)} picture: extremes of the others stand for it")
    return doubts


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
