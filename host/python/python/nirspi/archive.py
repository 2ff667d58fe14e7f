"""Tables of whole archives, and of sets of measurements by the virtual camera.

A table is a Parquet file with one measurement a row: what was measured, its image, and what is known
of it. Its columns are in ``docs/clusters.md``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from . import _arrays, _nirspi
from ._nirspi import Error
from .camera_model import CameraModel
from .measurement import source_options
from .reconstruction import method_options

_OF_SOURCES = frozenset(source_options())
_OF_METHODS = frozenset(method_options()) - {"dictionary", "warm_start"}


@dataclass(frozen=True)
class Report:
    """What was made of an archive or a set.

    Attributes
    ----------
    out : str
        The table, or the folder of its parts.
    files : int
        Number of files, or of measurements of a set.
    files_before : int
        Those that earlier runs had done.
    rows : int
        Rows of the table.
    skipped : list of dict
        What has no row: ``file`` and ``reason``.
    seconds : float
        Time of this run.
    """

    out: str
    files: int
    files_before: int
    rows: int
    skipped: list[dict[str, str]] = field(default_factory=list)
    seconds: float = 0.0

    @classmethod
    def of(cls, text: str) -> Report:
        """The report of a JSON text of the compiled part."""
        found = json.loads(text)
        return cls(**{name: found[name] for name in cls.__dataclass_fields__})

    def __str__(self) -> str:
        skipped = f", {len(self.skipped)} gave no image" if self.skipped else ""
        before = f", {self.files_before} by earlier runs" if self.files_before else ""
        return f"{self.out}: {self.rows} images of {self.files} files{skipped}{before}, {self.seconds:.1f} s"


class Work:
    """Items of which each becomes rows of a table, in a fixed order, by a method that is prepared
    once in each process. It can be pickled: another process makes its own from the same words."""

    def __init__(self, **words: Any) -> None:
        self._words = words
        self._table: Any = None
        # What is wrong shows here and not on a cluster.
        self.table()

    def _open(self) -> Any:
        raise NotImplementedError

    def table(self) -> Any:
        """The compiled part's object of this process."""
        if self._table is None:
            self._table = self._open()
        return self._table

    def enhance_on(self, device: str) -> None:
        """The networks run on this device, unless the user has chosen one."""
        if self._words.get("enhance") and self._words.get("device", "auto") == "auto":
            self._words["enhance"], self._table = device, None

    def __getstate__(self) -> dict[str, Any]:
        return {"_words": self._words, "_table": None}

    def __len__(self) -> int:
        return len(self.names)

    @property
    def names(self) -> list[str]:
        """The name of each item."""
        return self.table().names()

    @property
    def settings(self) -> dict[str, Any]:
        """What the rows depend on beside the items."""
        return json.loads(self.table().settings())

    def run(
        self,
        out: str | os.PathLike[str],
        *,
        jobs: int | None = None,
        resume: bool = False,
        shard: str | None = None,
    ) -> Report:
        """Makes the table in this process: the bytes of ``nirspi reconstruct DIR --out TABLE``.

        Parameters
        ----------
        out : path
            The table, a name that ends in ``.parquet``.
        jobs : int, optional
            Items to work on at a time. Default: the number of cores.
        resume : bool
            Continue a run that was interrupted.
        shard : str, optional
            A share of the items, such as "2/8".

        Returns
        -------
        Report
            Items that give no image are in ``skipped`` and are no exception.

        Raises
        ------
        Error
            If an interrupted run is there, or does not fit.
        """
        path = os.fspath(out)
        if not path.endswith(".parquet"):
            raise Error(f"out is {path!r}, expected a name that ends in .parquet")
        return Report.of(self.table().run(path, _arrays.count(jobs, "jobs"), bool(resume), shard))

    def part(self, out: str | os.PathLike[str], start: int, end: int) -> Report:
        """Makes a table of the items ``start`` to ``end`` (exclusive), whole or not at all. The bytes
        follow from the items and the settings."""
        start, end = (_arrays.count(value, name) or 0 for value, name in ((start, "start"), (end, "end")))
        return Report.of(self.table().part(os.fspath(out), start, end))


def _options(words: dict[str, Any]) -> tuple[dict[str, Any], str | None]:
    """Options of the method, and the file of the dictionary."""
    dictionary = words.get("dictionary")
    if dictionary is not None and not isinstance(dictionary, (str, os.PathLike)):
        raise Error("dictionary is an array, expected the path of a .npy file")
    made = method_options(**{name: words[name] for name in words if name in _OF_METHODS})
    return made, None if dictionary is None else os.path.abspath(dictionary)


def _known(words: Iterable[str], known: frozenset[str]) -> None:
    for name in words:
        if name not in known:
            raise Error(f"unknown option {name!r}, expected one of: {', '.join(sorted(known))}")


class Archive(Work):
    """The measurement files of a folder, or a list of files.

    Parameters
    ----------
    files : path, or list of paths
        A folder, with the folders below; hidden files and links to folders are left out. Or files.
    enhance : bool
        Whether networks also enlarge and deblur images of 32 x 32 and 64 x 64.
    **options
        Those of :func:`nirspi.load` and :func:`nirspi.reconstruct`, but ``matrix`` and
        ``warm_start``. ``dictionary`` is the path of a ``.npy`` file. Every measurement of a file is
        a row, and a recording is one row; with ``index="all"``, each frame of a recording is a row.

    Examples
    --------
    >>> import numpy as np, os, tempfile
    >>> import nirspi as ns
    >>> folder = tempfile.mkdtemp()
    >>> for k in range(3):
    ...     m = ns.Measurement(d=np.arange(16.0) + k, rows="zig-zag", n=4)
    ...     m.save(os.path.join(folder, f"{k}.npz"))
    >>> _ = open(os.path.join(folder, "bad.npz"), "w").write("no array")
    >>> report = ns.Archive(folder, method="tikhonov").run(os.path.join(folder, "table.parquet"))
    >>> report.rows, report.skipped[0]["file"]
    (3, 'bad.npz')
    """

    def __init__(
        self,
        files: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
        *,
        enhance: bool = False,
        **options: Any,
    ) -> None:
        _known(options, _OF_SOURCES | _OF_METHODS | {"dictionary"})
        folder: str
        names: list[str] | None
        if isinstance(files, (str, os.PathLike)):
            folder, names = os.path.abspath(files), None
            if not os.path.isdir(folder):
                raise Error(f"{os.fspath(files)}: expected a folder of measurements, or a list of files")
        else:
            paths = [os.path.abspath(path) for path in files]
            if not paths:
                raise Error("no file, expected at least one")
            folder = os.path.dirname(paths[0]) if len(paths) == 1 else os.path.commonpath(paths)
            names = [os.path.relpath(path, folder).replace(os.sep, "/") for path in paths]
            if len(set(names)) < len(names):
                raise Error("a file stands twice, expected each file once")
        super().__init__(folder=folder, files=names, enhance=bool(enhance), **options)
        # The same files in every process, whatever comes later.
        self._words["files"] = self.names

    def _open(self) -> Any:
        words = self._words
        options, dictionary = _options(words)
        source = source_options(**{name: words[name] for name in words if name in _OF_SOURCES})
        enhance = words["enhance"]
        if enhance is True:
            device = str(words.get("device", "auto"))
            enhance = "cpu" if device == "auto" else device
        return _nirspi.Table.files(
            words["folder"], words["files"], source, options, dictionary, enhance or None
        )


def _list(values: Any, kind: Any) -> list[Any]:
    several = isinstance(values, (list, tuple, range, set)) or hasattr(values, "tolist")
    return [kind(value) for value in (values if several else [values])]


class Sweep(Work):
    """Every combination of scenes, weathers, distances, orders, shares and seeds, each measured by
    the virtual camera and reconstructed (simulated).

    Each axis is a value or a list. The camera is calibrated once, against a white sheet. A
    measurement follows from its own values and not from the others of the set.

    Parameters
    ----------
    scenes : str or list
        ``"letter:R"``, ``"word:STOP"``, ``"white"``, or the path of a PNG or JPEG.
    weathers : str or list
        ``"none"``, ``"light"``, ``"heavy"``, ``"rain:20"``, ``"fog:5m"``, ...
    distances_m : float or list
    orders : str or list
        Names of :func:`nirspi.orders`.
    samplings : float, str or list
        Share of the patterns that the camera shows.
    seeds : int or list
    frames : int
        Frames summed into a measurement; 244 are 20 ms of all patterns.
    model : str or CameraModel
    **options
        Those of :func:`nirspi.reconstruct`, but ``matrix``, ``warm_start``, ``sampling`` and
        ``order``: the image is made of all patterns that were shown.

    Examples
    --------
    >>> import os, tempfile
    >>> import nirspi as ns
    >>> sweep = ns.Sweep(weathers=["none", "heavy"], seeds=range(2), samplings=0.1, frames=2)
    >>> sweep.names[0], len(sweep)
    ('letter:R none 0.3m zig-zag 0.1 0', 4)
    """

    def __init__(
        self,
        *,
        scenes: Any = "letter:R",
        weathers: Any = "none",
        distances_m: Any = 0.3,
        orders: Any = "zig-zag",
        samplings: Any = 0.5,
        seeds: Any = 1,
        frames: int = 244,
        model: str | CameraModel = "paper",
        **options: Any,
    ) -> None:
        _known(options, (_OF_METHODS | {"dictionary"}) - {"sampling", "order"})
        try:
            axes: dict[str, Any] = {
                "scenes": _list(scenes, str),
                "weathers": _list(weathers, str),
                "distances_m": _list(distances_m, float),
                "orders": _list(orders, str),
                "samplings": _list(samplings, _arrays.share),
                "seeds": _list(seeds, int),
            }
        except (TypeError, ValueError) as error:
            raise Error(f"an axis of the sweep: {error}") from None
        if any(seed < 0 for seed in axes["seeds"]):
            raise Error(f"seed {min(axes['seeds'])}, expected at least 0")
        axes["frames"] = _arrays.count(frames, "frames", least=1)
        text = model.toml if isinstance(model, CameraModel) else None
        name = None if text else str(model)
        super().__init__(axes=axes, model=name, model_text=text, **options)

    def _open(self) -> Any:
        words = self._words
        options, dictionary = _options(words | {"order": "recorded"})
        return _nirspi.Table.grid(words["axes"], words["model"], words["model_text"], options, dictionary)
