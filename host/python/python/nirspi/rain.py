"""What rain, fog and single drops do to light: the numbers of ``nirspi physics rain``."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from . import _arrays, _nirspi


def extinction(
    rate_mm_h: float = 5.6,
    *,
    wavelengths_nm: Any = 1550.0,
    drops: str = "marshall-palmer",
    distance_m: float = 1.0,
) -> dict[str, Any]:
    """Extinction, scattering and absorption of rain or fog, by Mie scattering.

    Parameters
    ----------
    rate_mm_h : float
        Rain rate.
    wavelengths_nm : float or array_like
        400 to 2000 nm.
    drops : str
        ``"marshall-palmer"``, ``"mono:MM"``, ``"gamma:SHAPE,SLOPE"``, ``"fog:UM,G"``, or the path of
        a CSV file of diameters in mm and drops per cubic metre.
    distance_m : float
        Of the target; light passes it there and back.

    Returns
    -------
    dict
        ``rate_mm_per_h``, ``drops_per_m3``, ``water_g_per_m3``, and ``wavelengths``: a list of
        dicts, or one dict for one wavelength, with ``extinction_per_m``, ``scattering_per_m``,
        ``absorption_per_m``, ``albedo``, ``asymmetry``, ``loss_there_and_back``, ``visibility_m``.

    Examples
    --------
    >>> import nirspi as ns
    >>> found = ns.rain.extinction(5.6, wavelengths_nm=1550, drops="mono:2")
    >>> round(found["wavelengths"]["albedo"], 1)
    0.6
    """
    several = np.ndim(wavelengths_nm) > 0
    wavelengths = _arrays.flat(np.atleast_1d(wavelengths_nm), "wavelengths_nm", np.float64)
    report = json.loads(_nirspi.rain(float(rate_mm_h), str(drops), wavelengths.tolist(), float(distance_m)))
    if not several:
        report["wavelengths"] = report["wavelengths"][0]
    return report


def mie(x: float, m: complex) -> dict[str, float]:
    """Efficiencies of one sphere.

    Parameters
    ----------
    x : float
        Size parameter, pi times diameter over wavelength.
    m : complex
        Refractive index; its imaginary part is positive for a sphere that absorbs.

    Returns
    -------
    dict
        ``qext``, ``qsca``, ``qabs``, ``qback``, and the asymmetry ``g``.

    Examples
    --------
    >>> import nirspi as ns
    >>> round(ns.rain.mie(10, 1.5)["qext"], 4)
    2.882
    """
    m = complex(m)
    return json.loads(_nirspi.mie(float(x), m.real, m.imag))
