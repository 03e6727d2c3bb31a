"""Devices of torch by name: one that is not there is told before it is used."""

from __future__ import annotations

import pytest

from dsl_core.errors import DecodeError
from dsl_core.solve import torch_device as here
from dsl_core.solve.torch_device import torch_device


@pytest.mark.parametrize(("found", "auto"), [(True, "cuda"), (False, "cpu")])
def test_auto_is_what_is_there(found: bool, auto: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "has_cuda", lambda: found)
    assert torch_device("auto") == auto
    assert torch_device("cpu") == "cpu"


def test_cuda_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "has_cuda", lambda: False)
    with pytest.raises(DecodeError, match="There is no CUDA device"):
        torch_device("cuda")


@pytest.mark.parametrize("name", ["cuda:99", "abacus", "meta", ""])
def test_a_name_is_no_device_until_it_answers(name: str) -> None:
    with pytest.raises(DecodeError, match=f"no device '{name}'; choose cpu, cuda, auto"):
        torch_device(name)
    assert torch_device("cpu:0") == "cpu:0"
