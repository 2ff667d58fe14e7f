"""Orders of patterns, the patterns, and the measurement operator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator


def order(name: str, n: int) -> np.ndarray:
    """The natural-order Hadamard row that is shown k-th, for all ``n * n`` patterns.

    Parameters
    ----------
    name : str
        A name of :func:`orders`, ``"random:SEED"``, or ``"table:FILE"``.
    n : int
        Side of the image, a power of two from 2 to 256.

    Returns
    -------
    ndarray of int64, (n * n,)

    Examples
    --------
    >>> import nirspi as ns
    >>> ns.order("zig-zag", 4)[:6].tolist()
    [0, 2, 8, 12, 10, 3]
    """
    return _nirspi.order(str(name), _arrays.side(n))


def orders() -> dict[str, str]:
    """The orders that have a name, each with one line about it.

    Examples
    --------
    >>> import nirspi as ns
    >>> ns.orders()["walsh-2d"]
    "the grid of two sequencies row by row: SPyRiT's HadamSplit2d"
    """
    return {name: about for name, about, _package, _ties in _nirspi.orders()}


def patterns(rows: Any, n: int, *, split: bool = True) -> np.ndarray:
    """The patterns of these rows as images.

    Parameters
    ----------
    rows : array_like of int, (M,)
        Natural-order Hadamard rows in the order shown.
    n : int
        Side of the image, a power of two from 2 to 256.
    split : bool
        True: light that is on or off, each pattern followed by its complement. False: the signed
        rows.

    Returns
    -------
    ndarray, (2 M, n, n) of uint8 with split, (M, n, n) of int8 without

    Examples
    --------
    >>> import nirspi as ns
    >>> ns.patterns([1], 2).tolist()
    [[[1, 0], [1, 0]], [[0, 1], [0, 1]]]
    """
    operator = Hadamard(n, rows=rows)
    signed = operator.matrix(np.int8).reshape(-1, operator.n, operator.n)
    if not split:
        return signed
    shown = np.empty((2 * len(signed), operator.n, operator.n), np.uint8)
    shown[0::2] = signed > 0
    shown[1::2] = signed < 0
    return shown


class Hadamard:
    """Some rows of the Hadamard matrix of an image, as an operator with fast transforms.

    NumPy arrays and torch tensors are taken; the same kind comes out. float32 and float64 keep their
    type. A tensor has gradients: those of the forward operator are the adjoint's.

    Parameters
    ----------
    n : int
        Side of the image, a power of two from 2 to 256.
    rows : array_like of int, (M,), optional
        Natural-order Hadamard rows in the order shown. Default: all of them in natural order.
    split : bool
        True: readings of light that is on or off, ``(..., 2 M)``: each pattern, then its complement.
        False: the signed measurements, ``(..., M)``.
    scale : {"sum", "ortho"}
        "sum": entries +1 and -1 (nirspi, SPyRiT). "ortho": rows of norm 1 (deepinv).

    Attributes
    ----------
    n : int
    rows : ndarray of int64, (M,)
    split : bool
    scale : str
    shape : tuple of int
        ``(M, n * n)``, or ``(2 M, n * n)`` with split.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> H = ns.Hadamard(8, rows=ns.order("cake-cutting", 8)[:20])
    >>> x = np.random.default_rng(1).random((3, 8, 8), np.float32)
    >>> H(x).shape, H.adjoint(H(x)).shape, H.shape
    ((3, 20), (3, 8, 8), (20, 64))
    """

    def __init__(self, n: int, rows: Any = None, *, split: bool = False, scale: str = "sum") -> None:
        self.n = _arrays.side(n)
        if scale not in ("sum", "ortho"):
            raise Error(f'scale is {scale!r}, expected "sum" or "ortho"')
        self.scale = scale
        self.split = bool(split)
        self.rows = (
            _nirspi.order("natural", self.n) if rows is None else _arrays.whole_numbers(rows, "rows").copy()
        )
        self._operator = _nirspi.Operator(self.n, self.rows, self.split, scale == "ortho")
        self.rows.flags.writeable = False

    @property
    def shape(self) -> tuple[int, int]:
        readings = len(self.rows) * (2 if self.split else 1)
        return (readings, self.n * self.n)

    def __repr__(self) -> str:
        return f"Hadamard(n={self.n}, {len(self.rows)} rows, split={self.split}, scale={self.scale!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_made, (self.n, np.array(self.rows), self.split, self.scale))

    # ---- the operator

    def forward(self, x: Any, *, out: Any = None) -> Any:
        """The readings of images.

        Parameters
        ----------
        x : array or tensor, (..., n, n)
        out : ndarray, optional
            Where the result is written, with the result's shape and type, contiguous; not with a
            tensor. Default: a new array.

        Returns
        -------
        array or tensor, (..., M), or (..., 2 M) with split
        """
        if _is_tensor(x):
            from . import _torch

            _arrays.no_out(out, "a tensor")
            return _torch.forward(self, x)
        return self._numpy("forward", x, out)

    __call__ = measure = A = forward

    def adjoint(self, y: Any, *, out: Any = None) -> Any:
        """The transpose of :meth:`forward`.

        Parameters
        ----------
        y : array or tensor, (..., M), or (..., 2 M) with split
        out : ndarray, optional
            As of :meth:`forward`.

        Returns
        -------
        array or tensor, (..., n, n)
        """
        if _is_tensor(y):
            from . import _torch

            _arrays.no_out(out, "a tensor")
            return _torch.adjoint(self, y)
        return self._numpy("adjoint", y, out)

    A_adjoint = adjoint

    def pinv(self, y: Any, *, out: Any = None) -> Any:
        """The image by the pseudo-inverse: patterns that were not shown count as zero.

        With split, the pseudo-inverse of the differences (:meth:`unsplit`), in which a dark level
        cancels.

        Parameters
        ----------
        y : array or tensor, (..., M), or (..., 2 M) with split
        out : ndarray, optional
            As of :meth:`forward`.

        Returns
        -------
        array or tensor, (..., n, n)
        """
        if _is_tensor(y):
            from . import _torch

            _arrays.no_out(out, "a tensor")
            return _torch.pinv(self, y)
        return self._numpy("pinv", y, out)

    A_dagger = pinv

    def unsplit(self, y: Any) -> Any:
        """Pattern less complement: ``(..., 2 M)`` to ``(..., M)``.

        Examples
        --------
        >>> import numpy as np
        >>> import nirspi as ns
        >>> x = np.arange(16.0).reshape(4, 4)
        >>> split = ns.Hadamard(4, split=True)
        >>> bool(np.allclose(split.unsplit(split(x)), ns.Hadamard(4)(x)))
        True
        """
        y = y if _is_tensor(y) else _arrays.floating(y, "y")
        if y.ndim < 1 or y.shape[-1] != 2 * len(self.rows):
            raise Error(f"y has shape {tuple(y.shape)}, expected (..., {2 * len(self.rows)})")
        return y[..., 0::2] - y[..., 1::2]

    def matrix(self, dtype: Any = np.float32) -> np.ndarray:
        """The operator as a matrix of :attr:`shape`.

        Examples
        --------
        >>> import nirspi as ns
        >>> ns.Hadamard(2, rows=[0, 3]).matrix().tolist()
        [[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, -1.0, 1.0]]
        """
        readings, area = self.shape
        whole = np.empty((readings, area), dtype)
        # A few rows at a time: of a large image, all of them in float64 would not fit into memory.
        step = max(1, (1 << 22) // max(readings, area))
        for first in range(0, readings, step):
            last = min(first + step, readings)
            units = np.zeros((last - first, readings))
            units[np.arange(last - first), np.arange(first, last)] = 1
            whole[first:last] = self._operator.adjoint(units.reshape(-1)).reshape(-1, area)
        return whole

    def _axes(self, what: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
        image, readings = (self.n, self.n), (self.shape[0],)
        return (image, readings) if what == "forward" else (readings, image)

    def _numpy(self, what: str, values: Any, out: Any = None) -> np.ndarray:
        name = "x" if what == "forward" else "y"
        values = _arrays.array_of(values, name)
        if values.dtype.kind == "c":
            _arrays.no_out(out, "complex numbers")
            return self._numpy(what, values.real) + 1j * self._numpy(what, values.imag)
        array = _arrays.floating(values, name)
        before, after = self._axes(what)
        if array.shape[array.ndim - len(before) :] != before:
            wanted = ", ".join(["..."] + [str(edge) for edge in before])
            raise Error(f"{name} has shape {array.shape}, expected ({wanted})")
        shape = array.shape[: array.ndim - len(before)] + after
        if out is None:
            return getattr(self._operator, what)(array.reshape(-1)).reshape(shape)
        _arrays.place(out, shape, array, name)
        getattr(self._operator, what)(array.reshape(-1), out.reshape(-1))
        return out

    # ---- other packages

    def scipy(self) -> LinearOperator:
        """The operator as a ``scipy.sparse.linalg.LinearOperator`` on flat images.

        Examples
        --------
        >>> import numpy as np
        >>> from scipy.sparse.linalg import lsqr
        >>> import nirspi as ns
        >>> H, x = ns.Hadamard(8), np.arange(64.0).reshape(8, 8)
        >>> bool(np.allclose(lsqr(H.scipy(), H(x))[0], x.reshape(-1)))
        True
        """
        from scipy.sparse.linalg import LinearOperator

        def forward(x: np.ndarray) -> np.ndarray:
            return self.forward(np.asarray(x).reshape(self.n, self.n))

        def backward(y: np.ndarray) -> np.ndarray:
            return self.adjoint(np.asarray(y).reshape(-1)).reshape(-1)

        def forward_all(x: np.ndarray) -> np.ndarray:
            return self.forward(np.asarray(x).T.reshape(-1, self.n, self.n)).T

        def backward_all(y: np.ndarray) -> np.ndarray:
            return self.adjoint(np.asarray(y).T).reshape(-1, self.n * self.n).T

        return LinearOperator(
            self.shape,
            matvec=forward,
            rmatvec=backward,
            matmat=forward_all,
            rmatmat=backward_all,
            dtype=np.float64,
        )

    def deepinv(self, **kwargs: Any) -> Any:
        """A ``deepinv.physics.LinearPhysics`` of images ``(B, C, n, n)`` and readings ``(B, C, M)``.

        Parameters
        ----------
        **kwargs
            Of ``LinearPhysics``, for example ``noise_model``.
        """
        try:
            from ._deepinv import HadamardPhysics
        except ImportError as error:
            raise Error(f"deepinv() needs deepinv and torch: pip install deepinv ({error})") from None

        return HadamardPhysics(self, **kwargs)

    def spyrit(self, **kwargs: Any) -> Any:
        """SPyRiT's ``HadamSplit2d`` of the same rows in the same order.

        Its ``measure_H``, ``adjoint_H`` and ``fast_pinv`` are those of this operator without split,
        and its ``measure`` is this operator with split.

        Parameters
        ----------
        **kwargs
            Of ``HadamSplit2d``, for example ``noise_model``.
        """
        from . import _spyrit

        return _spyrit.of(self, **kwargs)

    @classmethod
    def of(cls, other: Any) -> Hadamard:
        """The operator of deepinv's ``SinglePixelCamera`` or of SPyRiT's ``HadamSplit2d``.

        deepinv keeps no order in time, so the rows of a ``SinglePixelCamera`` come in ascending
        order: ``y.flatten()[mask]`` are the measurements.
        """
        kinds = [kind.__name__ for kind in type(other).__mro__]
        if "HadamSplit2d" in kinds:
            from . import _spyrit

            return cls(int(other.meas_shape[-1]), rows=_spyrit.rows_of(other))
        if "SinglePixelCamera" in kinds:
            mask = np.asarray(other.mask.detach().cpu())
            mask = mask.reshape(-1, *mask.shape[-2:])[0]
            return cls(mask.shape[-1], rows=np.flatnonzero(mask.reshape(-1)), scale="ortho")
        raise Error(f"{type(other).__name__}: expected deepinv's SinglePixelCamera or SPyRiT's HadamSplit2d")


def _made(n: int, rows: np.ndarray, split: bool, scale: str) -> Hadamard:
    return Hadamard(n, rows=rows, split=split, scale=scale)


def _is_tensor(value: Any) -> bool:
    kind = type(value)
    return not isinstance(value, np.ndarray) and any(
        base.__module__.split(".")[0] == "torch" and base.__name__ == "Tensor" for base in kind.__mro__
    )
