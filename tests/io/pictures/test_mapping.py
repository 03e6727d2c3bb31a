"""The mapping that the help page shows is one."""

from __future__ import annotations

import re

from dsl_core.io.pictures.mapping import Mapping
from dsl_core.resources import resource_path


def test_the_mapping_of_the_help_page_is_one() -> None:
    page = resource_path("help/importing.md").read_text(encoding="utf-8")
    (content,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    mapping = Mapping.model_validate_json(content)
    assert [part.kind for part in mapping.parts] == ["white", "black", "stripes", "phases"]
