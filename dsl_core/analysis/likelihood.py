"""How probable the spectrum of a pixel is under a class, by the deviations that the result states.

With ``D`` the stated deviations, ``C`` the correlation of bands and ``U`` what may vary (the brightness, the
components of a class), the covariance of a pixel is ``D C D + U U'``; its inverse and determinant follow from
those of ``C`` alone (Woodbury identity), so that one product of matrices serves a whole block of pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classes import Member, SpectralClass

Floats = NDArray[np.floating]
#: Deviation of a brightness that is free: a factor of whatever size.
FREE = 30.0
#: Deviations below this are rounding, not knowledge: a result stores reflectance in such steps.
_LEAST_STD = 2e-4


@dataclass(frozen=True)
class Block:
    """Pixels of which the same bands are known: reflectance and deviations (bands, pixels).

    ``whitening`` (bands, bands) makes errors in deviations independent, ``whitened`` is the reflectance in
    such units; ``brightness`` (pixels,) is the relative deviation of the level that all bands share.
    """

    reflectance: NDArray[np.float32]
    std: NDArray[np.float32]
    whitening: NDArray[np.float32]
    whitened: NDArray[np.float32]
    brightness: NDArray[np.float32]
    is_free: bool

    @classmethod
    def of(
        cls,
        reflectance: NDArray[np.float32],
        std: NDArray[np.float32],
        correlation: NDArray[np.float64],
        is_free: bool,
    ) -> Block:
        """The block of pixels with the correlation (bands, bands) of their bands."""
        spread = np.maximum(std, np.float32(_LEAST_STD))
        whitening = np.linalg.inv(np.linalg.cholesky(correlation)).astype(np.float32)
        if is_free:
            brightness = np.full(reflectance.shape[1], FREE, np.float32)
        else:
            # What all bands have in common cannot exceed what the surest band states.
            brightness = np.asarray((spread / np.maximum(reflectance, spread)).min(0), np.float32)
        whitened = np.asarray(whitening @ (reflectance / spread), np.float32)
        return cls(reflectance, spread, whitening, whitened, brightness, is_free)


def member_fit(block: Block, member: Member) -> tuple[Floats, Floats]:
    """Chi-square and log-likelihood (up to a constant of the block) of each pixel under a spectrum."""
    own = member.std.any()
    std = np.hypot(block.std, member.std[:, None].astype(np.float32)) if own else block.std
    inverse = 1 / std
    level = block.whitening @ (member.mean[:, None].astype(np.float32) * inverse)
    whitened = block.whitening @ (block.reflectance * inverse) if own else block.whitened
    residual = whitened - level
    chi_square, log_size = _less(residual, level, block)
    if own:
        # Relative to the block's own deviations, which all classes share.
        log_size = log_size + 2 * np.log(std / block.std).sum(0)
    if len(member.components):
        chi_square, more = _with_components(block, member, inverse, residual, level)
        log_size = log_size + more
    return chi_square, -0.5 * (chi_square + log_size)


def _less(residual: Floats, level: Floats, block: Block) -> tuple[Floats, Floats]:
    """Chi-square with the best brightness, and the log of the volume that the brightness adds."""
    power = np.einsum("bp,bp->p", level, level)
    along = np.einsum("bp,bp->p", level, residual)
    precision = 1 / np.square(block.brightness)
    chi_square = np.einsum("bp,bp->p", residual, residual) - along**2 / (power + precision)
    # A free level would favour the class of the darker name for the same shape.
    volume = np.zeros_like(power) if block.is_free else np.log1p(power / precision)
    return np.maximum(chi_square, 0), volume


def _with_components(
    block: Block, member: Member, inverse: Floats, residual: Floats, level: Floats
) -> tuple[Floats, Floats]:
    """Chi-square with the best brightness and components, and the log of the volume that these add."""
    components = member.components[:, :, None].astype(np.float32)
    columns = [level * block.brightness, *(block.whitening @ (each * inverse) for each in components)]
    varied = np.stack(columns)
    size = len(varied)
    matrix = np.einsum("ibp,jbp->pij", varied, varied).astype(np.float64) + np.eye(size)
    along = np.einsum("ibp,bp->pi", varied, residual).astype(np.float64)
    solved = np.linalg.solve(matrix, along[..., None])[..., 0]
    chi_square = np.einsum("bp,bp->p", residual, residual) - np.einsum("pi,pi->p", along, solved)
    whole = np.linalg.slogdet(matrix)[1]
    # The volume of the brightness alone is counted, or left out, where there are no components.
    return np.maximum(chi_square, 0), whole - np.log(matrix[:, 0, 0])


def class_fit(block: Block, each: SpectralClass) -> tuple[Floats, Floats]:
    """Chi-square of the best spectrum of a class and log-likelihood of the class, (pixels,)."""
    chi_square: Floats | None = None
    log_sum: Floats | None = None
    for member in each.members:
        own, log_likelihood = member_fit(block, member)
        chi_square = own if chi_square is None else np.minimum(chi_square, own)
        log_sum = log_likelihood if log_sum is None else np.logaddexp(log_sum, log_likelihood)
    assert chi_square is not None
    assert log_sum is not None
    return chi_square, log_sum - np.log(len(each.members))
