"""Recordings of a camera (MCAP)."""

from __future__ import annotations

import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _nirspi
from .camera import Account
from .measurement import Measurement, load

if TYPE_CHECKING:
    import xarray


class Recording:
    """A recording: setup, identity and account at once, the frames when they are first asked for.

    A recording that was cut short gives what is before the cut; :attr:`cut_short` says why.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    path : str
    identity : dict
        The recorded camera.
    setup : dict
        The measurement: order, rows, timing.
    settling : dict or None
        Latency and settling, if the camera was calibrated.
    account : dict or None
        The account as the capture wrote it; None for a recording that was cut short.
    counted : Account
        The frames counted again.
    events : list of (int, str)
        Time in ns of the host's clock, and what the camera reported.
    cut_short : str or None

    Examples
    --------
    >>> import os, tempfile
    >>> import nirspi as ns
    >>> path = os.path.join(tempfile.mkdtemp(), "rec.mcap")
    >>> with ns.Camera("virtual", sampling=0.25) as camera:
    ...     _ = camera.record(path, frames=5)
    >>> recording = ns.Recording(path)
    >>> recording.y.shape, recording.account["received"], recording.setup["order"]
    ((5, 256), 5, 'cake-cutting')
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        found = _nirspi.read_recording(self.path, False)
        self.identity: dict[str, Any] = json.loads(found["identity"])
        self.setup: dict[str, Any] = json.loads(found["setup"])
        settling, account = found["settling"], found["account"]
        self.settling: dict[str, Any] | None = None if settling is None else json.loads(settling)
        self.account: dict[str, Any] | None = None if account is None else json.loads(account)
        self.counted = Account(*found["counted"])
        self.events: list[tuple[int, str]] = found["events"]
        self.cut_short: str | None = found["cut_short"]

    def __repr__(self) -> str:
        return f"Recording({self.path!r}, {self.counted.received} frames)"

    def __len__(self) -> int:
        return self.counted.received

    @cached_property
    def _frames(self) -> dict[str, Any]:
        return _nirspi.read_recording(self.path, True)

    @property
    def rows(self) -> np.ndarray:
        """Natural-order Hadamard rows in the order shown, (M,)."""
        return np.asarray(self.setup["rows"], np.int64)

    @property
    def y(self) -> np.ndarray:
        """Summed ADC counts, (F, M) of int64: pattern less complement, or patterns alone."""
        return self._frames["sums"].reshape(-1, len(self.setup["rows"]))

    @property
    def sequence(self) -> np.ndarray:
        """Number of each frame in the run, (F,)."""
        return self._frames["sequence"]

    @property
    def device_time_us(self) -> np.ndarray:
        """The camera's time of each frame's first pattern, (F,)."""
        return self._frames["device_time_us"]

    @property
    def time_ns(self) -> np.ndarray:
        """The host's time of each frame's arrival, ns since 1970, (F,)."""
        return self._frames["time_ns"]

    @property
    def sweeps(self) -> np.ndarray:
        """Sweeps summed in each frame, (F,)."""
        return self._frames["sweeps"]

    @property
    def flags(self) -> np.ndarray:
        """Flags of each frame, see :class:`Frame`, (F,)."""
        return self._frames["flags"]

    def measurement(self, **options: Any) -> Measurement:
        """The measurement of all frames together: :func:`nirspi.load` of this file.

        ``index="all"`` gives one measurement a frame.
        """
        return load(self.path, **options)

    def to_xarray(self) -> xarray.Dataset:
        """The frames as a dataset of xarray: dimensions ``time`` and ``pattern``."""
        import xarray

        coords = {
            "time": ("time", self.time_ns.astype("datetime64[ns]")),
            "sequence": ("time", self.sequence),
            "device_time_us": ("time", self.device_time_us),
            "row": ("pattern", self.rows),
        }
        attributes = {
            "identity": json.dumps(self.identity),
            "setup": json.dumps({k: v for k, v in self.setup.items() if k != "rows"}),
            "cut_short": self.cut_short or "",
        }
        return xarray.Dataset(
            {
                "y": (("time", "pattern"), self.y, {"units": "summed ADC counts"}),
                "sweeps": ("time", self.sweeps),
                "flags": ("time", self.flags),
            },
            coords=coords,
            attrs=attributes,
        )

    def to_parquet(self, path: str | os.PathLike[str], **options: Any) -> None:
        """Writes the frames as a Parquet table, one a row, with pyarrow.

        Columns: ``time_ns``, ``sequence``, ``device_time_us``, ``sweeps``, ``flags``, and ``y``, a
        list of M numbers. The metadata of the schema hold ``rows``, ``setup`` and ``identity``.

        Parameters
        ----------
        path : path
        **options
            Of ``pyarrow.parquet.write_table``; ``compression`` is "zstd" by default.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        patterns = len(self.setup["rows"])
        values = pa.array(self.y.reshape(-1))
        columns = {
            "time_ns": pa.array(self.time_ns),
            "sequence": pa.array(self.sequence),
            "device_time_us": pa.array(self.device_time_us),
            "sweeps": pa.array(self.sweeps),
            "flags": pa.array(self.flags),
            "y": pa.FixedSizeListArray.from_arrays(values, patterns),
        }
        facts = {
            "rows": json.dumps(self.setup["rows"]),
            "setup": json.dumps({k: v for k, v in self.setup.items() if k != "rows"}),
            "identity": json.dumps(self.identity),
        }
        table = pa.table(columns).replace_schema_metadata(facts)
        pq.write_table(table, os.fspath(path), **{"compression": "zstd", **options})
