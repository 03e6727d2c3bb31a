"""Where dense arithmetic runs: the devices that torch finds here."""

from __future__ import annotations

from dsl_core.errors import DecodeError

DEVICES = ("cpu", "cuda", "auto")


def has_cuda() -> bool:
    """Whether torch finds a CUDA device; imports torch."""
    import torch

    return torch.cuda.is_available()


def torch_device(name: str) -> str:
    """``cpu`` or ``cuda`` for one of `DEVICES`; raises `DecodeError` when it does not exist."""
    if name == "cpu":
        return name
    found = has_cuda()
    if name == "cuda" and not found:
        raise DecodeError("There is no CUDA device, or torch was built without CUDA. Choose the device cpu.")
    return "cuda" if found else "cpu"
