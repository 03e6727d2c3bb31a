"""Where dense arithmetic runs: the devices that torch finds here."""

from __future__ import annotations

from dsl_core.errors import DecodeError

DEVICES = ("cpu", "cuda", "auto")


def has_cuda() -> bool:
    """Whether torch finds a CUDA device; imports torch."""
    import torch

    return torch.cuda.is_available()


def torch_device(name: str) -> str:
    """``cpu`` or ``cuda`` for one of `DEVICES`, and another name of torch, such as ``cuda:1``, as it is.

    Raises `DecodeError` when the device does not exist.
    """
    if name == "cpu":
        return name
    if name not in DEVICES:
        return _answering(name)
    found = has_cuda()
    if name == "cuda" and not found:
        raise DecodeError("There is no CUDA device, or torch was built without CUDA. Choose the device cpu.")
    return "cuda" if found else "cpu"


def _answering(name: str) -> str:
    import torch

    # torch knows names of devices that are not there, and says so only when one is used.
    try:
        torch.zeros(1, device=torch.device(name)).cpu()
    except Exception as error:  # every kind of device fails with an exception of its own
        raise DecodeError(f"There is no device {name!r}; choose {', '.join(DEVICES)}.") from error
    return name
