"""The operator as a physics of deepinv."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from deepinv.physics import LinearPhysics

if TYPE_CHECKING:
    from .hadamard import Hadamard


class HadamardPhysics(LinearPhysics):
    """Images ``(B, C, n, n)`` to readings ``(B, C, M)``, or ``(B, C, 2 M)`` with split.

    Parameters
    ----------
    operator : nirspi.Hadamard
    **kwargs
        Of ``LinearPhysics``, for example ``noise_model``.
    """

    def __init__(self, operator: Hadamard, **kwargs: Any) -> None:
        kwargs.setdefault("img_size", (1, operator.n, operator.n))
        super().__init__(**kwargs)
        self.operator = operator

    def A(self, x: torch.Tensor, **_: Any) -> torch.Tensor:
        return self.operator.forward(x)

    def A_adjoint(self, y: torch.Tensor, **_: Any) -> torch.Tensor:
        return self.operator.adjoint(y)

    def A_dagger(self, y: torch.Tensor, **_: Any) -> torch.Tensor:
        return self.operator.pinv(y)
