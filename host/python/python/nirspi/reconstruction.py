"""From measurements to images."""

from __future__ import annotations

import difflib
import inspect
import itertools
import json
import os
from typing import Any

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error
from .images import Image
from .measurement import Measurement, load, source_options

_OF_FILES = frozenset(source_options())


def methods() -> dict[str, str]:
    """The methods of reconstruction, each with one line about it.

    Examples
    --------
    >>> import nirspi as ns
    >>> ns.methods()["hadamard"]
    'Inverse Walsh-Hadamard transform; patterns that were not measured count as zero'
    """
    return {word: about for word, _name, about in _nirspi.methods()}


def bases() -> list[str]:
    """The names of the bases in which images are sparse.

    Examples
    --------
    >>> import nirspi as ns
    >>> ns.bases()
    ['pixel', 'dct', 'haar', 'daubechies4']
    """
    return _nirspi.bases()


def _meant(name: str) -> str:
    """The argument with nearly this name."""
    known = {*inspect.signature(reconstruct).parameters, *_OF_FILES} - {"source"}
    near = difflib.get_close_matches(name, known, n=1)
    return f", expected {near[0]}" if near else ""


def reconstruct(
    measurement: Measurement | str | os.PathLike[str],
    *,
    method: str = "auto",
    sampling: float | str = 1.0,
    first_of: str | None = None,
    basis: str | None = None,
    index: int | str | None = None,
    dictionary: Any = None,
    sparsity: int | None = None,
    residual: float | None = None,
    stop_at_noise: bool = False,
    strength: float | None = None,
    as_printed: bool = False,
    non_negative: bool = False,
    warm_start: bool = False,
    matrix: Any = None,
    dark: bool = True,
    n: int | tuple[int, int] | None = None,
    device: str = "auto",
    **source: Any,
) -> Image:
    """Reconstructs the image of a measurement, or the images of many.

    Parameters
    ----------
    measurement : Measurement or path
        A path is opened by ``nirspi.load(path, index=index, **source)``. With
        ``index="all"``, the measurements of a file are read while they are reconstructed: the memory
        holds a few of them at a time. Or, with ``matrix``, the readings ``(..., M)``.
    method : str
        A name of :func:`methods`.
    sampling : float or str
        Share of all ``n * n`` patterns to use: 0.3 or "30%".
    first_of : str, optional
        Which patterns ``sampling`` uses: the first of this order, or "recorded". Default: those of
        the lowest sequencies.
    basis : str, optional
        Of omp, tikhonov and fista: a name of :func:`bases`. Default "dct".
    index : int or "all", optional
        Which of several measurements. Default: all of a ``Measurement``; of a file, the only one.
    dictionary : array_like, (N, n, n), optional
        OMP: images of your own as atoms.
    sparsity : int, optional
        OMP: number of atoms. Default: the number that predicts held-back measurements best.
    residual : float, optional
        OMP: relative norm of the residual at which to stop.
    stop_at_noise : bool
        OMP: choose atoms until the residual is no larger than the estimated noise.
    strength : float, optional
        Of tikhonov, fista and tv. Default: the strength that predicts held-back measurements best.
    as_printed : bool
        OMP: Algorithm 1 as printed in the paper.
    non_negative : bool
        OMP: no negative light; needs the pixel basis or a dictionary.
    warm_start : bool
        Start each measurement from those before it; not for ``hadamard`` and ``pseudo-inverse``.
    matrix : array_like, (M, height, width) or (M, height * width), optional
        Patterns of your own instead of Hadamard rows, a picture or a row each. Where patterns or whole
        measurements of one scene repeat, they tell the noise, and readings count as much as it allows.
    dark : bool
        With ``matrix``: whether one constant, the reading without light, is fitted with the image.
    n : int or (int, int), optional
        With ``matrix``: side of the image, or its height and width, where patterns are rows and the
        image is no square.
    device : str
        Where OMP computes: "auto", "cpu", or another name of :func:`devices`.
    **source
        With a path: the other options of :func:`load`.

    Returns
    -------
    Image, (..., n, n) of float32
        In the units of the readings. Of complex measurements, the magnitude. With ``matrix``, of any
        height and width.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> scene = np.zeros((16, 16)); scene[3:9, 5:12] = 1
    >>> H = ns.Hadamard(16)
    >>> m = ns.Measurement(d=H(scene), rows=H.rows, n=16)
    >>> image = ns.reconstruct(m, method="tv", sampling="40%")
    >>> image.report["used"], round(float(ns.metrics.correlation(scene, image)), 2) > 0.95
    (102, True)
    """
    options = method_options(
        method=method,
        sampling=sampling,
        first_of=first_of,
        basis=basis,
        sparsity=sparsity,
        residual=residual,
        stop_at_noise=stop_at_noise,
        strength=strength,
        as_printed=as_printed,
        non_negative=non_negative,
        warm_start=warm_start,
        dark=dark,
        device=device,
    )
    if not dark and matrix is None:
        raise Error("dark belongs to a matrix")
    is_path = isinstance(measurement, (str, os.PathLike))
    for name in source:
        if name not in _OF_FILES:
            raise TypeError(f"reconstruct() got an unexpected keyword argument: {name}{_meant(name)}")
        if not is_path:
            raise TypeError(f"reconstruct() got an argument that needs the path of a file: {name}")
    if isinstance(measurement, (str, os.PathLike)):
        if index == "all" and matrix is None and dictionary is None:
            images = _while_reading(measurement, source, options)
            if images is not None:
                return images
        # These measurements are chosen when the file is read.
        measurement, index = load(measurement, index=index, **source), None
    if matrix is not None:
        return _by_matrix(measurement, matrix, n, dictionary, options)
    if not isinstance(measurement, Measurement):
        raise Error(
            f"found {type(measurement).__name__}, expected a Measurement: nirspi.Measurement(d=...,"
            " rows=..., n=...) or nirspi.load(path)"
        )
    if index is not None and index != "all":
        measurement = measurement[index]
    side: int = measurement.n
    _say_noise(options, measurement)
    if dictionary is not None:
        options["dictionary"] = _atoms(dictionary, (side, side))
    d = measurement.d
    leading = d.shape[:-1]
    if d.dtype.kind == "c":
        parts = [_run(side, measurement.rows, part, options) for part in (d.real, d.imag)]
        pixels = np.hypot(parts[0][0], parts[1][0])
        _, (reports, rows, _) = parts[0]
        # A part without pixels for the networks gives them its image.
        given = [given if given.size else shown for shown, (_, _, given) in parts]
        for_networks = np.hypot(*given)
    else:
        pixels, (reports, rows, for_networks) = _run(side, measurement.rows, d, options)
    if measurement.flat_field is not None:
        pixels = measurement.flat_field.correct(pixels)
        if for_networks.size:
            for_networks = measurement.flat_field.correct(for_networks)
    image = Image(
        pixels.reshape(*leading, side, side),
        report=reports if leading else reports[0],
        unit=measurement.unit,
        rows=rows[0] if len(rows) == 1 else rows,
        origin=measurement.origin,
    )
    return image._for(for_networks)


def method_options(
    *,
    method: str = "auto",
    sampling: float | str = 1.0,
    first_of: str | None = None,
    basis: str | None = None,
    sparsity: int | None = None,
    residual: float | None = None,
    stop_at_noise: bool = False,
    strength: float | None = None,
    as_printed: bool = False,
    non_negative: bool = False,
    warm_start: bool = False,
    dark: bool = True,
    device: str = "auto",
) -> dict[str, Any]:
    """The options of :func:`reconstruct` as the compiled part takes them."""
    return {
        "method": str(method),
        "sampling": _arrays.share(sampling),
        "first_of": first_of,
        "basis": basis,
        "dictionary": None,
        "sparsity": _arrays.count(sparsity, "sparsity"),
        "residual": None if residual is None else float(residual),
        "stop_at_noise": bool(stop_at_noise),
        "strength": None if strength is None else float(strength),
        "as_printed": bool(as_printed),
        "non_negative": bool(non_negative),
        "warm_start": bool(warm_start),
        "noise": None,
        "most_noise": None,
        "dark": bool(dark),
        "device": str(device),
    }


def _say_noise(options: dict[str, Any], measurement: Measurement) -> None:
    for name in ("noise", "most_noise"):
        said = getattr(measurement, name)
        options[name] = None if said is None else np.ravel(said).tolist()


def _run(
    n: int, rows: np.ndarray, d: np.ndarray, options: dict[str, Any]
) -> tuple[np.ndarray, tuple[list[Any], list[np.ndarray], np.ndarray]]:
    pixels, (reports, used, for_networks) = _nirspi.reconstruct(
        n, rows, np.ascontiguousarray(d, np.float64).reshape(-1), options
    )
    return pixels, (_each(reports), used, for_networks)


def _each(reports: list[tuple[str, int]]) -> list[Any]:
    """A report for each image, which a program may change without changing that of another image."""
    every: list[Any] = []
    for report, count in reports:
        every.extend(map(dict.copy, itertools.repeat(json.loads(report), count)))
    return every


def _while_reading(path: Any, source: dict[str, Any], options: dict[str, Any]) -> Image | None:
    """The images of all measurements of a file, if they can be made one by one while they are read. If
    one of them is refused, :func:`load` says why."""
    made = _nirspi.reconstruct_file(os.fspath(path), source_options(index="all", **source), options)
    if made is None:
        return None
    n, count, pixels, (reports, rows, for_networks), taken = made
    image = Image(
        pixels.reshape(count, n, n),
        report=_each(reports),
        rows=rows[0] if len(rows) == 1 else rows,
        origin=json.loads(taken),
    )
    return image._for(for_networks)


def _atoms(dictionary: Any, size: tuple[int, int]) -> np.ndarray:
    atoms = _arrays.real(dictionary, "dictionary")
    if atoms.ndim != 3 or atoms.shape[1:] != size:
        raise Error(f"dictionary has shape {atoms.shape}, expected (N, {size[0]}, {size[1]})")
    return _arrays.flat(atoms, "dictionary", np.float32)


def _size(weights: np.ndarray, n: Any) -> tuple[int, int]:
    """Height and width of the patterns in an array."""
    found = f"matrix has shape {weights.shape}"
    if weights.ndim not in (2, 3):
        raise Error(f"{found}, expected (M, height, width) or (M, height * width)")
    if n is not None:
        asked = (n, n) if np.ndim(n) == 0 else tuple(n)
        if len(asked) != 2:
            raise Error(f"n is {n!r}, expected a side, or height and width")
        height, width = (int(_arrays.count(side, "n", least=1) or 1) for side in asked)
        if weights.shape[1:] not in [(height * width,), (height, width)]:
            raise Error(f"{found}, expected (M, {height}, {width}) or (M, {height * width})")
        return height, width
    if weights.ndim == 3:
        return weights.shape[1], weights.shape[2]
    side = int(weights.shape[1] ** 0.5 + 0.5)
    if side * side != weights.shape[1]:
        raise Error(f"{found}, expected (M, {side * side}), or n=(height, width) of other images")
    return side, side


def _by_matrix(readings: Any, matrix: Any, n: Any, dictionary: Any, options: dict[str, Any]) -> Image:
    weights = _arrays.real(matrix, "matrix")
    size = _size(weights, n)
    y = readings.d if isinstance(readings, Measurement) else _arrays.real(readings, "y")
    if y.ndim < 1 or y.shape[-1] != weights.shape[0]:
        raise Error(f"y has shape {y.shape}, expected (..., {weights.shape[0]}): one a pattern")
    if options["warm_start"] or options["first_of"] is not None:
        raise Error("warm_start and first_of belong to Hadamard rows, not to a matrix")
    if isinstance(readings, Measurement):
        _say_noise(options, readings)
    if dictionary is not None:
        options["dictionary"] = _atoms(dictionary, size)
    pixels, reports = _nirspi.reconstruct_matrix(
        size, _arrays.flat(weights, "matrix", np.float64), _arrays.flat(y, "y", np.float64), options
    )
    made = [json.loads(report) for report in reports]
    leading = y.shape[:-1]
    origin = readings.origin if isinstance(readings, Measurement) else None
    return Image(pixels.reshape(*leading, *size), report=made if leading else made[0], origin=origin)
