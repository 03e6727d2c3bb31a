"""Text that users read is plain English: none of the phrases that once made it read as translated."""

from __future__ import annotations

import re

import pytest

from tests.architecture.words import Text, texts_now, texts_of_module

#: Phrase to avoid -> what to write instead.
INSTEAD = {
    r"\banew\b": "again",
    r"\bl(?:ies?|ay|ying) (?:in|at|beside|over)\b": "is in, is saved in",
    r"\bg(?:o|oes|oing|one) on\b|\bwent on\b": "continue, resume",
    r"\bat hand\b": "current, available",
    r"(?<!here )\b(?:is|are|was|were) no (?!longer\b|more\b|less\b)": "is not a",
    r"\bbeside\b": "next to",
    r"\bfor who\b": "for callers that, for anyone who",
    r"\btak(?:e|es|en|ing) in\b": "import",
    r"\btakes? the tick\b": "clear the check box",
    r"\bnothing to remark\b": "no remarks",
    r"\bany more\b": "no longer",
    r"\bexists? already\b": "already exists",
    r"\basked for\b": "requested",
    r"\bstored\b": "saved",
    r"\bknows\b": "supports, provides, contains",
    r"\b(?:file|folder|result|scan) holds\b|\bholds (?:no|not|neither|only)\b": "contains, has",
    r"\b(?:one|two) \w+ an? (?:band|colour|file|frame|line|order|pixel|pose|side)\b": "per band",
    r"\b(?:stands?|mm) before (?:the|a)\b": "in front of",
    r"\bfaster one\b": "faster scan",
    r"\bcounter-?clockwise\b": "anticlockwise",
    r"\b(?:color|center|meter)(?:s|ed)?\b": "British spelling",
}
#: Names, not words: Color Checker and Gray code are called so, and style sheets have words of their own.
NAMES = re.compile(
    r"color[ _-]?checker|gray[ -]code|color-scheme|[\w-]*color\s*[:=]|\bcenter\s*;", re.IGNORECASE
)


def faults(text: Text, phrase: str) -> bool:
    return re.search(phrase, NAMES.sub("", text.text), re.IGNORECASE) is not None


@pytest.mark.parametrize("phrase", INSTEAD)
def test_no_text_holds_it(phrase: str) -> None:
    found = [f"{each.path}:{each.line}: {each.text.strip()}" for each in texts_now() if faults(each, phrase)]
    assert found == [], f"write: {INSTEAD[phrase]}"


def test_strings_are_found_and_docstrings_only_of_commands() -> None:
    source = 'def f():\n    """A doc string."""\n    tell(f"All {n} frames", "x y", "word")\n'
    assert [each.text for each in texts_of_module("app/a.py", source)] == ["All {} frames", "x y"]
    assert "A doc string." in [each.text for each in texts_of_module("dsl_core/cli/a.py", source)]


def test_a_phrase_is_found_and_a_name_is_not() -> None:
    assert faults(Text("a", 1, "Taken anew."), r"\banew\b")
    british = next(phrase for phrase, instead in INSTEAD.items() if instead == "British spelling")
    assert faults(Text("a", 1, "The color of it."), british)
    assert not faults(Text("a", 1, "A Color Checker with Gray code."), british)
