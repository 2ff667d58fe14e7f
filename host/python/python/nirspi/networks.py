"""The learned stages: enlarging and deblurring."""

from __future__ import annotations

import json
from typing import Any

from . import _arrays, _nirspi
from ._nirspi import Error
from .images import UNITS, Image


def deblur_models() -> dict[str, str]:
    """The networks and classical methods of :func:`deblur`, each with one line about it.

    Examples
    --------
    >>> import nirspi as ns
    >>> "diffusion" in ns.deblur_models() and "wiener" in ns.deblur_models()
    True
    """
    return dict(_nirspi.deblur_models())


def enhance(
    image: Any,
    *,
    blur_px: float | None = None,
    noise: float | None = None,
    consistency: bool = True,
    steps: int = 1,
    seed: int = 0,
    device: str = "auto",
) -> Image:
    """Enlarges and deblurs images, to 64 x 64 in [0, 1]. The networks were trained on characters.

    An :class:`Image` in the units of readings is enhanced as by ``nirspi reconstruct --enhance``: the
    networks get the measured patterns as they were read, unless you changed the pixels, and the
    mean of the brightest 2 x 2 pixels counts as white, of several images the median of these means;
    other options than the image must then keep their defaults. Any other array must be in [0, 1], as
    for ``nirspi enhance``.

    Parameters
    ----------
    image : Image or array_like, (..., 32, 32), or (..., 64, 64) for an Image of readings
    blur_px : float, optional
        Blur in pixels of the 64 x 64 grid, if you know it better than the estimator.
    noise : float, optional
        Noise, of a full scale of 1, if you know it better than the estimator.
    consistency : bool
        Whether the result is corrected where the readings contradict it.
    steps : int
        Steps of the deblurring network.
    seed : int
        Seed of everything random.
    device : str
        "auto", "cpu", or another name of :func:`devices`.

    Returns
    -------
    Image, (..., 64, 64) of float32 in [0, 1]

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> bar = np.zeros((32, 32), np.float32); bar[8:24, 14:18] = 1
    >>> sharp = ns.enhance(bar)
    >>> sharp.shape, sorted(sharp.report)[:3]
    ((64, 64), ['consistency', 'inconsistency', 'model'])
    """
    values = _arrays.square_images(image, "image")
    n, leading = values.shape[-1], values.shape[:-2]
    if isinstance(image, Image) and image.unit in (UNITS[0], UNITS[1]):
        given = (blur_px, noise, consistency, steps, seed, device)
        if given != (None, None, True, 1, 0, "auto"):
            raise Error(
                "options beside an Image in the units of readings, expected none: scale it to [0, 1]"
                " and give np.asarray(image)"
            )
        rows = image.rows
        lists = rows if isinstance(rows, list) else [rows]
        if any(one is None for one in lists):
            lists = [_nirspi.order("natural", n)]
        for_networks = image._for_networks().reshape(-1)
        pixels, texts = _nirspi.enhance_readings(n, for_networks, list(lists))
        reports = [json.loads(text) for text in texts]
        warnings = [warning for report in reports for warning in report["warnings"]]
        return Image(
            pixels.reshape(*leading, 64, 64),
            report=reports if leading else reports[0],
            unit="of white",
            warnings=list(dict.fromkeys(warnings)),
            origin=image.origin,
        )
    if n != 32:
        raise Error(f"image has shape {values.shape}, expected (..., 32, 32)")
    known = _known(blur_px, noise, consistency, steps, seed, device)
    pixels, report = _nirspi.enhance(values.reshape(-1), known)
    made = pixels.reshape(*leading, 64, 64)
    return Image(made, report=json.loads(report), unit="of white", origin=getattr(image, "origin", None))


def deblur(
    image: Any,
    *,
    model: str = "diffusion",
    steps: int | None = None,
    blur_px: float | None = None,
    noise: float | None = None,
    consistency: bool = True,
    seed: int = 0,
    device: str = "auto",
) -> Image:
    """Deblurs images of 64 x 64 in [0, 1], by a network or a classical method.

    Parameters
    ----------
    image : array_like, (..., 64, 64)
    model : str
        A name of :func:`deblur_models`.
    steps : int, optional
        Steps of a network.
    blur_px, noise : float, optional
        What you know better than the estimator.
    consistency : bool
        Whether a network's result is corrected where the image contradicts it.
    seed : int
    device : str

    Returns
    -------
    Image, (..., 64, 64) of float32 in [0, 1]

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> bar = np.zeros((64, 64), np.float32); bar[16:48, 28:36] = 1
    >>> ns.deblur(bar, model="wiener").report["model"]
    'wiener'
    """
    values = _arrays.square_images(image, "image")
    if values.shape[-1] != 64:
        raise Error(f"image has shape {values.shape}, expected (..., 64, 64)")
    known = _known(blur_px, noise, consistency, steps, seed, device)
    pixels, report = _nirspi.deblur(values.reshape(-1), str(model), known)
    made = pixels.reshape(values.shape)
    return Image(made, report=json.loads(report), unit="of white", origin=getattr(image, "origin", None))


def _known(
    blur_px: float | None,
    noise: float | None,
    consistency: bool,
    steps: int | None,
    seed: int,
    device: str,
) -> dict[str, Any]:
    return {
        "blur_px": None if blur_px is None else float(blur_px),
        "noise": None if noise is None else float(noise),
        "consistency": bool(consistency),
        "seed": _arrays.count(seed, "seed"),
        "steps": _arrays.count(steps, "steps"),
        "device": str(device),
    }
