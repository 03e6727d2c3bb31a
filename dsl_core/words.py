"""Numbers of things, clauses, names and commands as people write them."""

from __future__ import annotations

import re
import shlex
import sys
from numbers import Real


def counted(count: int, one: str, many: str = "") -> str:
    """A number of things; without ``many``, an s makes the plural of ``one``.

    >>> counted(1, "picture"), counted(3, "picture"), counted(0, "spectrum", "spectra")
    ('1 picture', '3 pictures', '0 spectra')
    """
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def capitalised(text: str) -> str:
    """A text that begins with a capital letter, all others as they are (unlike ``str.capitalize``).

    >>> capitalised("the LED of 450 nm"), capitalised("")
    ('The LED of 450 nm', '')
    """
    return f"{text[:1].upper()}{text[1:]}"


def in_groups(value: float, digits: int = 0) -> str:
    """A number with its thousands apart, by a space: a comma that is typed is a decimal point.

    >>> in_groups(21402.37, 1).split(), in_groups(999)
    (['21', '402.4'], '999')
    """
    return f"{value:,.{digits}f}".replace(",", chr(0xA0))


def as_given(value: object) -> str:
    """What was given, in an error: a number in few digits, anything else as Python writes it.

    >>> as_given(2.0), as_given("2")
    ('2', "'2'")
    """
    return f"{value:g}" if isinstance(value, Real) else repr(value)


def sentence(clause: str) -> str:
    """A clause as a sentence of its own.

    >>> sentence("the LED of 450 nm is off")
    'The LED of 450 nm is off.'
    """
    return f"{capitalised(clause)}."


def ended(text: str) -> str:
    """A text that ends as a sentence does, so that another one can follow.

    >>> ended("USB reset"), ended("Is it on?")
    ('USB reset.', 'Is it on?')
    """
    return text if text.endswith((".", "!", "?")) else f"{text}."


def quoted(word: object) -> str:
    """A word of a command, such as a path, in quotes where a shell needs them.

    >>> quoted("scan.dsl"), quoted("my scan.dsl")
    ('scan.dsl', "'my scan.dsl'")
    """
    return shlex.quote(str(word))


def readable(name: str) -> str:
    """A name as a text that can be written; a system or a locale may have one that is not in UTF-8.

    >>> readable("leaf"), chr(0xFFFD) in readable(f"B{chr(0xDCE4)}ume")
    ('leaf', True)
    """
    return name.encode(errors=sys.getfilesystemencodeerrors()).decode(errors="replace")


def natural(name: str) -> list[tuple[int, str]]:
    """What names are sorted by as people count.

    >>> sorted(["im10", "im9"], key=natural)
    ['im9', 'im10']
    """
    return [(int(p), "") if p.isdecimal() else (-1, p) for p in re.split(r"(\d+)", name) if p]
