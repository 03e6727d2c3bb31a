"""Tooltips in which nothing is read as markup. No Qt."""

from __future__ import annotations

from html import escape, unescape


def plain_tip(text: str) -> str:
    """A tooltip that shows a text as it is: names in it may come from a file of a stranger.

    Qt guesses whether a tooltip is markup. What it could take for that is given as markup of the same text.

    >>> plain_tip("scans/<b>leaf</b>.zarr")
    '<p>scans/&lt;b&gt;leaf&lt;/b&gt;.zarr</p>'
    """
    is_mistakable = "<" in text or "&lt;" in text
    return f"<p>{escape(text, quote=False)}</p>".replace("\n", "<br>") if is_mistakable else text


def text_of_tip(tip: str) -> str:
    r"""The text of a tooltip that `plain_tip` made.

    >>> text_of_tip(plain_tip("a <b>\nleaf")), text_of_tip("leaf")
    ('a <b>\nleaf', 'leaf')
    """
    if not tip.startswith("<p>"):
        return tip
    return unescape(tip.removeprefix("<p>").removesuffix("</p>").replace("<br>", "\n"))
