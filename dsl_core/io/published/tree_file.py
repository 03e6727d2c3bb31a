"""Numbers and matrices by name from XML, YAML and JSON, as OpenCV writes them and as other programs do.

OpenCV's own reader trusts a file: what is damaged can corrupt the memory of the program. These formats are
read by the libraries that exist for them, and only text, lists and names are taken.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded

Node = float | NDArray[np.float64] | None
#: A calibration takes a few kilobytes, is nested three deep, and holds matrices of at most 14 numbers.
_MOST_BYTES, _MOST_NESTED, _MOST_INDENT, _MOST_NAMES = 1 << 20, 20, 200, 2000
#: Names are taken from so many levels; what is deeper is no calibration.
_LEVELS = 5
#: What begins or ends a level in XML, YAML and JSON; declarations, comments and empty elements do neither.
_NESTING = re.compile(rb"</?[A-Za-z_][^<>]*(?<!/)>|[\[\]{}]")
_HEADER = re.compile(r"\A\ufeff?%YAML[^\n]*\n")
#: OpenCV writes these in JSON too, where they have other names.
_ODD, _JSON = re.compile(r"(?<=[\s\[,:-])\.(?:Nan|Inf)\b"), {".Nan": "NaN", ".Inf": "Infinity"}


class _RepeatedError(ValueError):
    """A YAML file repeats parts by reference, which can unfold to any size."""


def read_nodes(path: Path) -> dict[str, Node]:
    """Every number and matrix of a file by its name, those of inner levels with points between.

    What is neither, such as a date or a matrix with numbers missing, is None. Raises `CalibrationError` for a
    file that is not there, or is none of these formats.
    """
    return {name: _node(value) for name, value in _values(path).items()}


def read_texts(path: Path) -> dict[str, str]:
    """What a file says in words by its name; raises `CalibrationError` as `read_nodes` does."""
    values = {name: " ".join(value) if _is_lone(value) else value for name, value in _values(path).items()}
    return {name: value for name, value in values.items() if isinstance(value, str) and _node(value) is None}


def read_text(path: Path) -> str:
    """The text of a file in UTF-8 or UTF-16, otherwise in the code page of Windows in the west.

    Raises `CalibrationError` for a file that is not there, cannot be read, or is too large.
    """
    if not path.is_file():
        raise CalibrationError(f"{path} does not exist. Give the path of the calibration's XML or YAML file.")
    try:
        content = read_bounded(path, _MOST_BYTES)
    except OSError as error:
        raise CalibrationError(f"{path} cannot be read ({error.strerror or error}).") from error
    try:
        return content.decode(json.detect_encoding(content))
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _values(path: Path) -> dict[str, Any]:
    """Whatever a file has by its name."""
    text = read_text(path)
    _require_modest(text.encode(), path)
    try:
        tree = _parsed(text)
    except _RepeatedError as error:
        raise CalibrationError(
            f"{path} repeats values by references such as *id001, which are not followed. Write them out."
        ) from error
    except (ValueError, RecursionError) as error:
        raise CalibrationError(
            f"{path} is not a calibration that can be read: it is cut off or damaged, or it is not XML, YAML"
            " or JSON. Export the calibration again."
        ) from error
    values: dict[str, Any] = {}
    _collect(tree, "", values, 0)
    return values


def _require_modest(content: bytes, path: Path) -> None:
    """Refuse what parsers of YAML and XML need much time or stack for."""
    depth = deepest = 0
    for token in _NESTING.findall(content):
        depth += 1 if token[:1] in b"[{" or (token[:1] == b"<" and token[1:2] != b"/") else -1
        deepest = max(deepest, depth)
    indented = max((len(found) for found in re.findall(rb"^[ \t-]+", content, re.MULTILINE)), default=0)
    if deepest > _MOST_NESTED or indented > _MOST_INDENT or b"<!ENTITY" in content:
        raise CalibrationError(
            f"{path} is not the calibration of a camera and a projector: it is nested too deeply. Export the"
            " calibration again."
        )


def _parsed(text: str) -> Mapping[str, Any]:
    """Names, lists and texts; raises ``ValueError`` for everything else."""
    if text.lstrip("\ufeff \t\r\n")[:1] == "<":
        try:
            tree: Any = _of_element(ElementTree.fromstring(text.lstrip("\ufeff \t\r\n")))
        except ElementTree.ParseError as error:
            raise ValueError(str(error)) from error
    elif text.lstrip("\ufeff \t\r\n")[:1] == "{":
        sound = _ODD.sub(lambda found: _JSON[found[0]], text.lstrip("\ufeff"))
        tree = json.loads(sound, object_pairs_hook=_by_name)
    else:
        tree = _of_yaml(text)
    if not isinstance(tree, Mapping):
        raise ValueError("it has no names")
    return tree


def _of_yaml(text: str) -> Any:
    import yaml

    # Without types: OpenCV's tags are unknown to YAML, and its numbers are not all YAML's.
    base: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    sound = _HEADER.sub("", text)

    class Loader(base):  # type: ignore[misc]
        def construct_mapping(self, node: Any, deep: bool = False) -> dict[str, Any]:
            return _by_name(
                [tuple(self.construct_object(each, deep=True) for each in two) for two in node.value]
            )

    try:
        if any(isinstance(token, yaml.AliasToken) for token in yaml.scan(sound, Loader=base)):
            raise _RepeatedError
        return yaml.load(sound, Loader=Loader)
    except (yaml.YAMLError, TypeError) as error:
        raise ValueError(str(error)) from error


def _of_element(element: ElementTree.Element) -> Any:
    """The children of an element by name, those called ``_`` as a list, or the words of its text."""
    children = list(element)
    if not children:
        return (element.text or "").split()
    if all(child.tag == "_" for child in children):
        return [_of_element(child) for child in children]
    return _by_name([(child.tag, _of_element(child)) for child in children])


def _by_name(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Values by name; those of a name that is there more than once are a list, of which none is preferred."""
    found: dict[str, list[Any]] = {}
    for name, value in pairs:
        found.setdefault(name, []).append(value)
    return {name: values[0] if len(values) == 1 else values for name, values in found.items()}


def _collect(value: Any, name: str, into: dict[str, Any], level: int) -> None:
    if isinstance(value, Mapping) and not _is_matrix(value) and level < _LEVELS:
        for key, inner in value.items():
            if len(into) < _MOST_NAMES:
                _collect(inner, f"{name}.{key}" if name else str(key), into, level + 1)
    elif name:
        into[name] = value


def _is_matrix(value: Mapping[str, Any]) -> bool:
    """Whether a mapping is a matrix with its shape, not a level that happens to be called data."""
    return "data" in value and not isinstance(value["data"], Mapping)


def _node(value: Any) -> Node:
    """A number, or a matrix: a list, or a mapping with ``data`` and the shape that OpenCV gives it."""
    shape = None
    if isinstance(value, Mapping):
        shape = [_number(value.get(key)) for key in ("rows", "cols") if key in value]
        value = value.get("data")
    numbers = _array(value)
    if numbers is None or numbers.size == 0:
        return None
    if shape:
        wanted = [count for count in shape if count is not None]
        if len(wanted) < len(shape) or not np.isfinite(wanted).all():
            return None
        if len(wanted) == 1:
            wanted.append(numbers.size / max(wanted[0], 1))
        whole = all(count == int(count) for count in wanted)
        if not whole or wanted[0] * wanted[1] != numbers.size or min(wanted) < 1:
            return None
        return numbers.reshape(int(wanted[0]), int(wanted[1]))
    return float(numbers.ravel()[0]) if not isinstance(value, list) or _is_lone(value) else numbers


def _is_lone(value: Any) -> bool:
    """Whether this is the only word of an element of XML."""
    return isinstance(value, list) and len(value) == 1 and isinstance(value[0], str)


def _array(value: Any) -> NDArray[np.float64] | None:
    """Numbers in as many dimensions as lists are nested; None for ragged ones and for anything else."""
    if not isinstance(value, list):
        number = _number(value)
        return None if number is None else np.array([number])
    if any(isinstance(each, list) for each in value):
        rows = [_array(each) for each in value]
        if any(row is None or row.shape != rows[0].shape for row in rows):  # type: ignore[union-attr]
            return None
        return np.array(rows)
    numbers = [_number(each) for each in value]
    return None if None in numbers else np.array(numbers, np.float64)


def _number(value: Any) -> float | None:
    """A number, or the number that a text is; OpenCV writes ``.Nan`` and ``-.Inf``."""
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        try:
            return float(value)
        except OverflowError:
            return None
    if not isinstance(value, str) or len(value) > 40 or "_" in value:
        return None
    try:
        return float(re.sub(r"\A([-+]?)\.(?=[nNiI])", r"\1", value))
    except ValueError:
        return None
