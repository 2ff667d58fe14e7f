"""Descriptions of cameras: every constant of optics and electronics."""

from __future__ import annotations

import json
from typing import Any

from . import _nirspi


class CameraModel:
    """A camera description, and what follows from it (simulated).

    Parameters
    ----------
    name : str
        "paper", "fga015", "one-metre", or the path of a TOML file.
    toml : str, optional
        The description itself. It needs only the keys that differ from the paper's camera, or from
        the camera that it names as ``basis``.

    Attributes
    ----------
    name : str
    toml : str
        The whole description.
    report : dict
        Field, light, noise and eye safety, as ``nirspi camera model --json``.

    Examples
    --------
    >>> import nirspi as ns
    >>> bright = ns.CameraModel(toml='name = "bright"\\n[leds]\\npower_mw = 5')
    >>> bright.name, len(bright.report["distances"]) > 0
    ('bright', True)
    """

    def __init__(self, name: str = "paper", *, toml: str | None = None) -> None:
        self.name, self.toml, report = _nirspi.camera_model(str(name), toml)
        self.report: dict[str, Any] = json.loads(report)

    def __repr__(self) -> str:
        return f"CameraModel({self.name!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_made, (self.toml,))


def _made(toml: str) -> CameraModel:
    return CameraModel(toml=toml)
