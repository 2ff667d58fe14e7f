"""Images with a report of how they were made."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from . import _nirspi

UNITS = ("units of the readings", "ADC counts", "of white", "reflectance")


def _prints(images: np.ndarray) -> np.ndarray:
    """A fingerprint of each image of a stack."""
    return _nirspi.fingerprints(np.ascontiguousarray(images, np.float32).reshape(-1), images.shape[-1])


class Image(np.ndarray):
    """A float32 array ``(n, n)``, or a stack ``(..., n, n)``, that knows how it was made.

    An image is an array like any other. Arithmetic gives plain arrays, because the report is no
    longer true of its result. In a notebook it shows itself as the command line draws it: stretched
    between the percentiles 0.5 and 99.5, with a grey bar and one line of facts.

    Attributes
    ----------
    report : dict or list of dict
        How the image was made; a list, one an image, for a stack.
    unit : str
        Unit of the values.
    rows : ndarray of int64, list of such, or None
        The Hadamard rows that were used.
    warnings : list of str
        Reasons not to trust the image.
    origin : dict or None
        Where the readings come from, as in ``Measurement.origin``. Pictures say so.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> H = ns.Hadamard(16)
    >>> scenes = np.random.default_rng(1).random((3, 16, 16), np.float32)
    >>> images = ns.reconstruct(ns.Measurement(d=H(scenes), rows=H.rows, n=16), method="hadamard")
    >>> images[1].report["method"], type(images * 2).__name__
    ('hadamard', 'ndarray')
    """

    report: Any
    unit: str
    rows: Any
    warnings: list[str]
    origin: Any
    # What the networks get of each image: fingerprints of the images as shown, and other pixels.
    _networks: tuple[np.ndarray, np.ndarray] | None = None

    def __new__(
        cls,
        values: Any,
        *,
        report: Any = None,
        unit: str = UNITS[0],
        rows: Any = None,
        warnings: list[str] | None = None,
        origin: Any = None,
    ) -> Image:
        image = np.asarray(values, dtype=np.float32).view(cls)
        image.report, image.unit, image.rows = report, unit, rows
        image.warnings, image.origin = list(warnings or []), origin
        return image

    def __array_finalize__(self, source: Any) -> None:
        self.report = getattr(source, "report", None)
        self.unit = getattr(source, "unit", UNITS[0])
        self.rows = getattr(source, "rows", None)
        self.warnings = getattr(source, "warnings", [])
        self.origin = getattr(source, "origin", None)
        self._networks = getattr(source, "_networks", None)

    def _for(self, pixels: np.ndarray) -> Image:
        """Keeps the pixels that the networks get in place of these; none if they get these."""
        if pixels.size:
            self._networks = (_prints(self), pixels.reshape(-1, *self.shape[-2:]))
        return self

    def _for_networks(self) -> np.ndarray:
        """The images as the networks were trained for: measured patterns as they were read, noise and
        all. An image whose pixels were changed since stays as it is."""
        images = np.array(self, dtype=np.float32)
        if self._networks is not None:
            prints, given = self._networks
            known = {print_: k for k, print_ in enumerate(prints.tolist())}
            each = images.reshape(-1, *images.shape[-2:])
            for image, print_ in zip(each, _prints(self).tolist(), strict=True):
                if print_ in known:
                    image[...] = given[known[print_]]
        return images

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        plain = np.asarray(array)
        return plain[()] if return_scalar or plain.ndim == 0 else plain

    def __getitem__(self, index: Any) -> Any:
        part = super().__getitem__(index)
        if not isinstance(part, Image):
            return part
        if isinstance(self.report, list) and self.ndim == 3:
            first = index[0] if isinstance(index, tuple) and index else index
            if isinstance(first, (int, np.integer, slice)):
                part.report = self.report[first]
                if isinstance(self.rows, list):
                    part.rows = self.rows[first]
            elif first is not Ellipsis:
                part.report, part.rows = None, None
        if part.ndim < 2 or part.shape[-2:] != self.shape[-2:]:
            return np.asarray(part)
        return part

    def __reduce__(self) -> Any:
        make, arguments, state = tuple(super().__reduce__())
        kept = (self.report, self.unit, self.rows, self.warnings, self.origin, self._networks)
        return make, arguments, (state, kept)

    def __setstate__(self, state: Any) -> None:
        super().__setstate__(state[0])
        self.report, self.unit, self.rows, self.warnings, self.origin, self._networks = state[1]

    def facts(self) -> str:
        """One line about how the image was made."""
        report = self.report
        if isinstance(report, list):
            report = report[0] if report else None
        return str((report or {}).get("words", ""))

    def png(self, title: str = "") -> bytes:
        """The picture as a PNG: with a grey bar, its unit and one line of facts; of a stack, a
        contact sheet of up to 64 images.

        Parameters
        ----------
        title : str
            The line above the image.
        """
        values = np.ascontiguousarray(self, dtype=np.float32)
        taken = None if self.origin is None else json.dumps(self.origin)
        if values.ndim == 2:
            size = (values.shape[1], values.shape[0])
            facts = [self.facts()] if self.facts() else []
            warnings = list(self.warnings)
            return _nirspi.picture(values.reshape(-1), size, title, self.unit, (facts, warnings), taken)
        if values.shape[-1] != values.shape[-2]:
            raise _nirspi.Error(f"a stack of shape {self.shape}, expected square images: draw images[k]")
        header = title or self.facts()
        return _nirspi.sheet(values.reshape(-1), values.shape[-1], header, self.unit, taken)

    def _repr_png_(self) -> bytes | None:
        stack = self.ndim > 2 and self.shape[-1] != self.shape[-2]
        return None if self.ndim < 2 or self.size == 0 or stack else self.png()

    def plot(self, ax: Any = None, **kwargs: Any) -> Any:
        """Draws one image with matplotlib: value under the cursor, colour bar, unit.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        **kwargs
            Of ``imshow``; ``cmap`` is "gray" by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        try:
            import matplotlib.pyplot as plt
        except ImportError as error:
            raise _nirspi.Error(
                f"plot() needs matplotlib: pip install matplotlib ({error}); png() needs nothing else"
            ) from None
        if self.ndim != 2:
            raise _nirspi.Error(f"a stack of shape {self.shape}, expected one image: plot images[k]")
        if ax is None:
            _figure, ax = plt.subplots()
        values = np.asarray(self)
        low, high = np.percentile(values[np.isfinite(values)], (0.5, 99.5))
        kwargs = {"cmap": "gray", "vmin": low, "vmax": high, **kwargs}
        shown = ax.imshow(values, **kwargs)
        ax.figure.colorbar(shown, ax=ax, label=self.unit)
        ax.set_title(self.facts(), fontsize="small", wrap=True)
        return ax
