"""Sealed JSON: every flipped bit of it is found or changes nothing, and it stays JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.io.reading import read_json
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.sealed import SealError, is_sealed, seal, unseal
from dsl_core.model.plan import CapturePlan, GrayCode, Setting

PLAN = CapturePlan(
    name="näme", code=GrayCode(rows=False), settings=(Setting(exposure_ms=10, level=0.5),), code_settings=(0,)
)


@pytest.mark.parametrize("text", ["{}", '{"a":1}', '{\n "a": {}\n}', '{\n  "ä": "ö"\n}\n'])
def test_a_sealed_object_is_the_object_and_its_checksum(text: str) -> None:
    sealed = seal(text)
    assert json.loads(unseal(sealed)) == json.loads(text)
    content = json.loads(sealed)
    assert content.pop("checksum").startswith("crc32:")
    assert content == json.loads(text)
    assert is_sealed(sealed)
    assert not is_sealed(text.encode())
    assert unseal(text.encode()) == text.encode()


@pytest.mark.parametrize("indent", [None, 1])
def test_every_flipped_bit_is_refused_or_harmless(indent: int | None) -> None:
    sealed = seal(PLAN.model_dump_json(indent=indent))
    refused = 0
    for place in range(8 * len(sealed)):
        flipped = bytearray(sealed)
        flipped[place // 8] ^= 1 << place % 8
        try:
            assert CapturePlan.model_validate_json(unseal(bytes(flipped))) == PLAN, place
        except (SealError, ValidationError):
            refused += 1
    assert refused > 0.98 * 8 * len(sealed)


def test_other_line_ends_are_no_damage() -> None:
    sealed = seal(PLAN.model_dump_json(indent=1))
    assert CapturePlan.model_validate_json(unseal(sealed.replace(b"\n", b"\r\n"))) == PLAN


def test_a_changed_record_is_told_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    replace_record(path, PLAN)
    assert read_record(path, CapturePlan) == PLAN
    assert read_json(path)["name"] == "näme"
    path.write_bytes(path.read_bytes().replace(b"10.0", b"11.0"))
    with pytest.raises(StoreError, match=r"plan\.json was changed or damaged .* delete its last field"):
        read_record(path, CapturePlan)
    path.write_text(PLAN.model_dump_json())  # by hand, or by an earlier version
    assert read_record(path, CapturePlan) == PLAN
