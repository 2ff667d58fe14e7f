"""Numbers that compare images: those of ``nirspi metrics``."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error


def _pair(reference: Any, test: Any) -> tuple[np.ndarray, np.ndarray]:
    a, b = (
        np.ascontiguousarray(_arrays.real(v, name), np.float32)
        for v, name in ((reference, "reference"), (test, "test"))
    )
    if a.shape != b.shape:
        raise Error(f"test has shape {b.shape}, expected {a.shape} as the reference")
    if a.ndim < 2 or a.size == 0:
        raise Error(f"reference has shape {a.shape}, expected (..., H, W)")
    return a, b


def _shaped(values: list[float], shape: tuple[int, ...]) -> Any:
    return float(values[0]) if not shape[:-2] else np.asarray(values).reshape(shape[:-2])


def _scaled(
    reference: Any, test: Any, align: str | None, data_range: float | None
) -> tuple[np.ndarray, np.ndarray, tuple[int, ...], float]:
    a, b = _pair(reference, test)
    count = int(np.prod(a.shape[:-2], dtype=np.int64))
    shape = (count, a.shape[-2], a.shape[-1])
    data_range = None if data_range is None else float(data_range)
    one, other, used = _nirspi.scaled(a.reshape(-1), b.reshape(-1), shape, align, data_range)
    return one, other, a.shape, used


def psnr(reference: Any, test: Any, *, align: str | None = None, data_range: float | None = None) -> Any:
    """Peak signal-to-noise ratio in dB; infinite for equal images.

    Parameters
    ----------
    reference, test : array_like, (..., H, W)
        In [0, 1], unless ``align`` or ``data_range`` is given.
    align : "gain-offset", optional
        Bring each test image to its reference by the gain (0 or more) and offset of least squares.
    data_range : float, optional
        Default 1; with ``align``, the reference's own range if it is not in [0, 1].

    Returns
    -------
    float, or ndarray of one number an image

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> a = np.linspace(0, 1, 256).reshape(16, 16)
    >>> round(ns.metrics.psnr(a, a * 0.9), 2), ns.metrics.psnr(a, 5 * a + 2, align="gain-offset") > 90
    (24.76, True)
    """
    one, other, shape, _range = _scaled(reference, test, align, data_range)
    return _shaped(_nirspi.psnr(one, other, (shape[-1], shape[-2]), 1.0), shape)


def ssim(reference: Any, test: Any, *, align: str | None = None, data_range: float | None = None) -> Any:
    """Structural similarity: Gaussian window of 11 pixels, sigma 1.5, population covariance.

    Parameters and result are those of :func:`psnr`.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> a = np.linspace(0, 1, 256).reshape(16, 16)
    >>> ns.metrics.ssim(a, a)
    1.0
    """
    one, other, shape, _range = _scaled(reference, test, align, data_range)
    return _shaped(_nirspi.ssim(one, other, (shape[-1], shape[-2]), 1.0), shape)


def correlation(reference: Any, test: Any) -> Any:
    """Pearson's correlation of the pixels, -1 to 1. Brightness and contrast do not change it.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> a = np.linspace(0, 1, 256).reshape(16, 16)
    >>> round(ns.metrics.correlation(a, 3 - a), 6)
    -1.0
    """
    a, b = _pair(reference, test)
    found = _nirspi.correlation(a.reshape(-1), b.reshape(-1), (a.shape[-1], a.shape[-2]))
    return _shaped(found, a.shape)


def align(image: Any, reference: Any) -> tuple[float, float, bool]:
    """The gain (0 or more) and offset of least squares that bring an image to a reference, and
    whether the image is inverted (the gain is then 0).

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> a = np.linspace(0, 1, 256).reshape(16, 16)
    >>> gain, offset, inverted = ns.metrics.align(2 * a + 1, a)
    >>> round(gain, 3), round(offset, 3), inverted
    (0.5, -0.5, False)
    """
    b, a = _pair(reference, image)
    return _nirspi.fit(a.reshape(-1), b.reshape(-1))


def compare(
    reference: Any, test: Any, *, align: str | None = None, data_range: float | None = None
) -> dict[str, Any]:
    """PSNR, SSIM and correlation together, with the data range that was used.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> a = np.linspace(0, 1, 256).reshape(16, 16)
    >>> sorted(ns.metrics.compare(a, a * 0.5))
    ['correlation', 'data_range', 'psnr_db', 'ssim']
    """
    one, other, shape, used = _scaled(reference, test, align, data_range)
    size = (shape[-1], shape[-2])
    return {
        "psnr_db": _shaped(_nirspi.psnr(one, other, size, 1.0), shape),
        "ssim": _shaped(_nirspi.ssim(one, other, size, 1.0), shape),
        "correlation": correlation(reference, test),
        "data_range": used,
    }
