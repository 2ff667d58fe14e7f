"""The operator as SPyRiT's, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import _nirspi
from ._nirspi import Error

if TYPE_CHECKING:
    from .hadamard import Hadamard


def of(operator: Hadamard, **kwargs: Any) -> Any:
    """SPyRiT's operator of the same rows in the same order."""
    try:
        import torch
        from spyrit.core.meas import HadamSplit2d
    except ImportError as error:
        raise Error(f"spyrit() needs spyrit and torch: pip install spyrit ({error})") from None

    if operator.scale != "sum":
        raise Error('scale is "ortho", expected "sum": entries of SPyRiT\'s matrix are +1 and -1')
    area = operator.n**2
    place = np.empty(area, np.int64)
    place[_nirspi.order("walsh-2d", operator.n)] = np.arange(area)
    # The highest entry is shown first.
    rank = np.zeros(area, np.float32)
    rank[place[operator.rows]] = np.arange(len(operator.rows), 0, -1)
    # SPyRiT's fast path takes the first row for the all-ones row.
    kwargs.setdefault("fast", bool(operator.rows[0] == 0))
    kwargs.setdefault("reshape_output", True)
    order = torch.from_numpy(rank.reshape(operator.n, operator.n))
    return HadamSplit2d(operator.n, len(operator.rows), order=order, **kwargs)


def rows_of(other: Any) -> np.ndarray:
    """Natural rows of SPyRiT's operator in the order shown."""
    walsh = _nirspi.order("walsh-2d", int(other.meas_shape[-1]))
    return walsh[np.asarray(other.indices.cpu(), np.int64)[: int(other.M)]]
