"""Orthogonal matching pursuit: a dictionary prepared once, for any number of measurements; and a
function with scikit-learn's signature."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error

if TYPE_CHECKING:
    from scipy.sparse import csc_array

PREMATURE = (
    "Orthogonal matching pursuit ended prematurely due to linear dependence in the dictionary. The"
    " requested precision might not have been met."
)


@dataclass(eq=False)
class Solution:
    """Sparse representations of one measurement, or of a batch.

    Attributes
    ----------
    support : ndarray of int32, (K,) or (B, K)
        Atoms in the order in which they were chosen; -1 after the last.
    coef : ndarray of float64, (K,) or (B, K)
        Their coefficients; 0 after the last.
    residual : float or ndarray, (B,)
        Norm of what is left, relative to the measurement's norm.
    stop : str or list of str
        Why the pursuit stopped: "sparsity", "residual", "no atom left", "dependent".
    n_atoms : int
        Number of atoms in the dictionary.
    double : int
        For how many measurements double precision was used.
    """

    support: np.ndarray
    coef: np.ndarray
    residual: Any
    stop: Any
    n_atoms: int
    double: int

    def toarray(self) -> np.ndarray:
        """The coefficients of all atoms: (N,), or (N, B) of a batch."""
        support, coef = np.atleast_2d(self.support), np.atleast_2d(self.coef)
        dense = np.zeros((len(support), self.n_atoms))
        chosen = support >= 0
        frame = np.broadcast_to(np.arange(len(support))[:, None], support.shape)
        dense[frame[chosen], support[chosen]] = coef[chosen]
        return dense[0] if self.support.ndim == 1 else dense.T

    def tocsc(self) -> csc_array:
        """The same as a sparse array of scipy, (N, B)."""
        from scipy.sparse import csc_array

        support, coef = np.atleast_2d(self.support), np.atleast_2d(self.coef)
        chosen = support >= 0
        frame = np.broadcast_to(np.arange(len(support))[:, None], support.shape)
        entries = (coef[chosen], (support[chosen], frame[chosen]))
        return csc_array(entries, shape=(self.n_atoms, len(support)))


class Dictionary:
    """Atoms, prepared for any number of measurements: copied, with their Gram matrix.

    Parameters
    ----------
    X : array_like, (M, N)
        An atom in each column, of any norm.
    normalised : bool
        True: atoms are chosen by their correlation with the residual (the paper's algorithm). False:
        by their plain inner product, as scikit-learn does.
    precision : {"mixed", "double"}
        "mixed": float32, and float64 wherever float32 cannot decide. The support is that of "double".
    device : str
        "auto" and "cpu" are the processor; or another name of :func:`nirspi.devices`, in float32.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> X = np.random.default_rng(1).standard_normal((64, 256))
    >>> D = ns.omp.Dictionary(X)
    >>> x = np.zeros(256); x[[3, 77]] = 2, -1
    >>> solution = D.solve(X @ x, n_nonzero_coefs=2)
    >>> solution.support.tolist(), solution.coef.round(6).tolist()
    ([3, 77], [2.0, -1.0])
    """

    def __init__(
        self, X: Any, *, normalised: bool = True, precision: str = "mixed", device: str = "auto"
    ) -> None:
        matrix = _arrays.real(X, "X")
        if matrix.ndim != 2 or 0 in matrix.shape:
            raise Error(f"X has shape {matrix.shape}, expected (M, N)")
        if precision not in ("mixed", "double"):
            raise Error(f'precision is {precision!r}, expected "mixed" or "double"')
        columns = np.ascontiguousarray(matrix.T, dtype=np.float64)
        self._prepared = _nirspi.Dictionary(
            columns.reshape(-1), len(matrix), bool(normalised), precision == "double", str(device)
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(M, N): numbers of a measurement, and atoms."""
        return self._prepared.shape

    @property
    def unseen(self) -> list[int]:
        """Atoms of (nearly) zero norm, which are never chosen."""
        return self._prepared.unseen

    def __repr__(self) -> str:
        return f"Dictionary({self.shape[0]} x {self.shape[1]})"

    def solve(self, Y: Any, *, n_nonzero_coefs: int | None = None, residual: Any = 0.0) -> Solution:
        """Represents measurements by a few atoms each.

        Parameters
        ----------
        Y : array_like, (M,) or (M, B)
            One measurement, or one in each column.
        n_nonzero_coefs : int, optional
            Largest number of atoms. Default: with ``residual``, as many as it takes; without, a
            tenth of the atoms.
        residual : float or array_like, (B,)
            Norm of what is left, relative to the measurement's norm, at which to stop; 0: never.

        Returns
        -------
        Solution
        """
        y, batch = self._measurements(Y)
        sparsity, limits = self._limits(n_nonzero_coefs, residual)
        support, coef, left, stop, double = self._prepared.solve(y, sparsity, limits)
        support, coef = support.reshape(-1, sparsity), coef.reshape(-1, sparsity)
        if batch:
            return Solution(support, coef, left, stop, self.shape[1], double)
        return Solution(support[0], coef[0], float(left[0]), stop[0], self.shape[1], double)

    def _limits(self, n_nonzero_coefs: int | None, residual: Any) -> tuple[int, list[float]]:
        most = min(self.shape)
        limits = np.atleast_1d(_arrays.real(residual, "residual")).astype(np.float64)
        asked = _arrays.count(n_nonzero_coefs, "n_nonzero_coefs", least=1)
        if asked is None:
            asked = most if (limits > 0).any() else max(self.shape[1] // 10, 1)
        if asked > self.shape[1]:
            raise Error(f"n_nonzero_coefs is {asked}, expected at most the {self.shape[1]} atoms")
        return min(asked, most), limits.tolist()

    def _measurements(self, Y: Any) -> tuple[np.ndarray, bool]:
        array = _arrays.real(Y, "Y")
        if array.ndim not in (1, 2) or array.shape[0] != self.shape[0]:
            m = self.shape[0]
            raise Error(f"Y has shape {array.shape}, expected ({m},) or ({m}, B)")
        return np.ascontiguousarray(array.T, dtype=np.float64).reshape(-1), array.ndim == 2


def orthogonal_mp(
    X: Any,
    y: Any,
    *,
    n_nonzero_coefs: int | None = None,
    tol: float | None = None,
    precompute: Any = False,
    copy_X: bool = True,
    return_path: bool = False,
    return_n_iter: bool = False,
) -> Any:
    """scikit-learn's ``orthogonal_mp``: the same arguments, shapes, errors and warnings.

    One call prepares the dictionary anew. For many calls with one ``X``, keep a :class:`Dictionary`.

    Parameters
    ----------
    X : array_like, (n_samples, n_features)
        Columns are assumed to have unit norm.
    y : array_like, (n_samples,) or (n_samples, n_targets)
    n_nonzero_coefs : int, optional
        Default: a tenth of the features, at least 1. Has no effect beside ``tol``.
    tol : float, optional
        Largest squared norm of the residual.
    precompute, copy_X
        Have no effect: the Gram matrix is always computed, and ``X`` is never written to.
    return_path : bool
        Whether to return the coefficients after every atom along the last axis.
    return_n_iter : bool
        Whether to return the numbers of atoms, too.

    Returns
    -------
    coef : ndarray, (n_features,) or (n_features, n_targets), with the path (..., n_steps)
    n_iters : int or list of int
        With ``return_n_iter``.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> X = np.eye(8); y = np.array([0, 3, 0, 0, -1, 0, 0, 0.0])
    >>> ns.omp.orthogonal_mp(X, y, n_nonzero_coefs=2).tolist()
    [0.0, 3.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0]
    """
    del precompute, copy_X
    matrix, targets = _arrays.real(X, "X"), _arrays.real(y, "y")
    if matrix.ndim != 2:
        raise Error(f"X has shape {matrix.shape}, expected (n_samples, n_features)")
    squeezed = targets.ndim == 1
    columns = targets.reshape(-1, 1) if squeezed else targets
    if columns.ndim != 2 or columns.shape[0] != matrix.shape[0]:
        raise Error(f"y has shape {targets.shape}, expected ({matrix.shape[0]}, n_targets)")
    features = matrix.shape[1]
    asked = max(int(0.1 * features), 1) if n_nonzero_coefs is None else n_nonzero_coefs
    if tol is not None and not tol >= 0:
        raise Error("Epsilon cannot be negative")
    if tol is None and asked <= 0:
        raise Error("The number of atoms must be positive")
    if tol is None and asked > features:
        raise Error("The number of atoms cannot be more than the number of features")
    dictionary = Dictionary(matrix, normalised=False)
    flat, _batch = dictionary._measurements(columns)
    most = min(matrix.shape)
    if tol is None:
        sparsity, limits = min(int(asked), most), [0.0]
    else:
        norms = np.linalg.norm(columns.astype(np.float64), axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(norms > 0, np.sqrt(tol) / norms, 1.0)
        # scikit-learn chooses an atom before it looks at what is left.
        relative = np.where(norms > 0, np.minimum(relative, 1 - 1e-9), relative)
        sparsity, limits = most, relative.tolist()
    solve = dictionary._prepared.path if return_path else dictionary._prepared.solve
    support, coef, _left, stop, _double = solve(flat, sparsity, limits)
    count = columns.shape[1]
    support = support.reshape(count, sparsity)
    steps = (support >= 0).sum(axis=1)
    if tol is None:
        premature = bool((steps < asked).any())
    else:
        premature = any(reason in ("no atom left", "dependent") for reason in stop)
    if premature:
        warnings.warn(PREMATURE, RuntimeWarning, stacklevel=2)
    if return_path:
        coef = coef.reshape(count, sparsity, sparsity)
        made = np.zeros((features, count, sparsity))
        for target in range(count):
            for step in range(steps[target]):
                chosen = support[target, : step + 1]
                made[chosen, target, step] = coef[target, step, : step + 1]
        made = made[:, :, : steps.max(initial=0)]
    else:
        coef = coef.reshape(count, sparsity)
        made = np.zeros((features, count))
        for target in range(count):
            chosen = support[target, : steps[target]]
            made[chosen, target] = coef[target, : steps[target]]
    if squeezed or count == 1:
        made = made[:, 0]
    if not return_n_iter:
        return made
    return made, (int(steps[0]) if squeezed or count == 1 else steps.tolist())
