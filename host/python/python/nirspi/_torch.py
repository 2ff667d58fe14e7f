"""The operator for torch tensors, with gradients. A tensor on the processor is computed by the
compiled part; a tensor on another device is computed there, by torch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch

from ._nirspi import Error

if TYPE_CHECKING:
    from .hadamard import Hadamard


def forward(operator: Hadamard, x: torch.Tensor) -> torch.Tensor:
    return _Apply.apply(_checked(operator, "forward", x), operator, "forward")


def adjoint(operator: Hadamard, y: torch.Tensor) -> torch.Tensor:
    return _Apply.apply(_checked(operator, "adjoint", y), operator, "adjoint")


def pinv(operator: Hadamard, y: torch.Tensor) -> torch.Tensor:
    # The pseudo-inverse is the transpose over the squared norm of the rows, on differences.
    y = _checked(operator, "pinv", y)
    if operator.split:
        from .hadamard import Hadamard

        return pinv(Hadamard(operator.n, rows=operator.rows, scale=operator.scale), operator.unsplit(y))
    made = adjoint(operator, y)
    return made if operator.scale == "ortho" else made / operator.n**2


def _checked(operator: Hadamard, what: str, values: torch.Tensor) -> torch.Tensor:
    name = "x" if what == "forward" else "y"
    if values.dtype.is_complex:
        raise Error(f"{name} holds {values.dtype}, expected real numbers")
    if values.layout is not torch.strided:
        raise Error(f"{name} has the layout {values.layout}, expected {torch.strided}")
    before, _after = operator._axes("forward" if what == "forward" else "adjoint")
    if tuple(values.shape[values.dim() - len(before) :]) != before or values.dim() < len(before):
        wanted = ", ".join(["..."] + [str(edge) for edge in before])
        raise Error(f"{name} has shape {tuple(values.shape)}, expected ({wanted})")
    if not values.dtype.is_floating_point:
        return values.to(torch.get_default_dtype())
    return values


class _Apply(torch.autograd.Function):
    """A linear operator and its transpose, each the gradient of the other."""

    @staticmethod
    def forward(ctx: Any, values: torch.Tensor, operator: Hadamard, what: str) -> torch.Tensor:
        ctx.operator, ctx.what = operator, what
        return _compute(operator, what, values)

    @staticmethod
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        other = "adjoint" if ctx.what == "forward" else "forward"
        return _Apply.apply(gradient, ctx.operator, other), None, None

    @staticmethod
    def jvp(ctx: Any, tangent: torch.Tensor, *_: Any) -> torch.Tensor:
        return _Apply.apply(tangent, ctx.operator, ctx.what)


def _compute(operator: Hadamard, what: str, values: torch.Tensor) -> torch.Tensor:
    if values.device.type != "cpu":
        return _on_device(operator, what, values)
    kept = values.dtype in (torch.float32, torch.float64)
    made = operator._numpy(what, values.detach().to(values.dtype if kept else torch.float32).numpy())
    tensor = torch.from_numpy(made)
    return tensor if kept else tensor.to(values.dtype)


def _on_device(operator: Hadamard, what: str, values: torch.Tensor) -> torch.Tensor:
    """The same by torch's own kernels."""
    before, after = operator._axes(what)
    batch = tuple(values.shape[: values.dim() - len(before)])
    flat = values.detach().reshape(-1, *before).flatten(1)
    rows = torch.as_tensor(operator.rows.copy(), device=values.device)
    unit = (1.0 / operator.n if operator.scale == "ortho" else 1.0) * (0.5 if operator.split else 1.0)
    if what == "forward":
        grid = _transform(flat)
        made = grid[:, rows]
        if operator.split:
            light = grid[:, :1]
            made = torch.stack((light + made, light - made), -1).flatten(1)
        return (made * unit).reshape(*batch, *after)
    grid = flat.new_zeros(flat.shape[0], operator.n**2)
    if operator.split:
        grid[:, rows] = flat[:, 0::2] - flat[:, 1::2]
        grid[:, 0] += flat.sum(1)
    else:
        grid[:, rows] = flat
    return (_transform(grid) * unit).reshape(*batch, *after)


def _transform(values: torch.Tensor) -> torch.Tensor:
    """The Walsh-Hadamard transform of each row, in natural order."""
    count, length = values.shape
    half = 1
    while half < length:
        pairs = values.reshape(count, -1, 2, half)
        a, b = pairs[:, :, 0], pairs[:, :, 1]
        values = torch.stack((a + b, a - b), 2).reshape(count, length)
        half *= 2
    return values
