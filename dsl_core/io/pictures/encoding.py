"""Whether values of pictures are linear in light or encoded for screens, by their code and their files."""

from __future__ import annotations

from pathlib import Path

from dsl_core.io.linearity import Linearity, linearity_of
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.io.pictures.source import PictureScan, open_pictures
from dsl_core.model.frames import FrameSource

#: Tag of EXIF for the colour space; its value for sRGB.
_COLOUR_SPACE, _SRGB = 0xA001, 1
_EXIF_FOLDER = 0x8769


def encoding_of(source: PictureScan, fewer: FrameSource | None = None) -> tuple[Linearity, str]:
    """What the code of pictures says of their values, and what to do about it; empty if nothing.

    ``fewer`` are the same pictures with fewer pixels, if these are enough. Raises `StoreError` when a picture
    cannot be read.
    """
    found = linearity_of(fewer or source, source.full_scale_dn, 0.0)
    return found, _advice(found, source)


def guessed_encoding(folder: Path, mapping: Mapping) -> tuple[Mapping, tuple[str, ...]]:
    """The mapping with the encoding that its pictures show, and what is unsure of it; raises `StoreError`."""
    source = open_pictures(folder, mapping)
    found, advice = encoding_of(source)
    if found.verdict == "srgb":
        decoded = mapping.model_copy(update={"encoding": "srgb"})
        return decoded, (f"values are {found.sentence}: they are decoded from sRGB",)
    if found.is_wrong:
        return mapping, (f"values are {found.sentence}: {advice}",)
    return mapping, (advice,) if advice else ()


def noted_encoding(path: Path) -> str:
    """What a picture's file notes of its encoding, in words; empty if nothing or linear."""
    from PIL import Image

    try:
        with Image.open(path) as head:
            noted, exif = head.info, head.getexif()
            is_srgb = _SRGB in (exif.get(_COLOUR_SPACE), exif.get_ifd(_EXIF_FOLDER).get(_COLOUR_SPACE))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return ""
    if "srgb" in noted or is_srgb:
        return "sRGB"
    if "icc_profile" in noted:
        return "a colour profile"
    return "JPEG, which is made for screens" if path.suffix.lower() in {".jpg", ".jpeg"} else ""


def _advice(found: Linearity, source: PictureScan) -> str:
    stated = source.mapping.encoding
    match found.verdict:
        case "srgb" if stated == "linear":
            return "set encoding of the mapping to srgb"
        case "darker" if stated == "srgb":
            return "set encoding of the mapping to linear, which the files seem to be already"
        case "darker":
            return "give the pictures unfiltered, and project patterns of the projector's own size"
        case "srgb" | "encoded":
            return "capture again with gamma 1 of the camera; columns hold, brightness does not"
        case "unknown" if stated == "linear":
            noted = noted_encoding(source.arrangement.frames[0].path)
            if noted:
                return (
                    f"the files note {noted}, and {found.sentence}: set encoding of the mapping to srgb if"
                    " the camera made pictures for screens"
                )
    return ""
