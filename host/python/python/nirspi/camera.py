"""A camera: real or virtual. The LEDs are off in whatever way a run is left."""

from __future__ import annotations

import asyncio
import atexit
import json
import os
import warnings
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error
from .camera_model import CameraModel
from .measurement import Measurement

_OPEN: weakref.WeakSet[Camera] = weakref.WeakSet()


class Account(NamedTuple):
    """What became of every frame that the camera made; nothing is estimated.

    ``passed_over`` frames were received, but the program was too slow to take them.
    """

    received: int = 0
    lost: int = 0
    corrupt: int = 0
    late: int = 0
    passed_over: int = 0


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a camera.

    Attributes
    ----------
    sums : ndarray of int64, (M,)
        Summed ADC counts, one a pattern in the order shown: pattern less complement, or with
        ``differential=False`` the pattern alone.
    sequence : int
        Number of the frame in the run.
    device_time_us : int
        The camera's time of the first pattern.
    sweeps : int
        Number of sweeps summed.
    flags : int
        1: a sample was outside the ADC's range; 2: a sum overflowed; 4: the FPGA lost a frame
        before; 8: samples of the test generator; 16: differences.
    time_ns : int
        The computer's time of the first pattern, in ns since 1970: the camera's time by a running
        fit of its clock. It is later than the true time by the link's shortest delay.
    """

    sums: np.ndarray
    sequence: int
    device_time_us: int
    sweeps: int
    flags: int
    time_ns: int


class Frames(Iterator[Frame]):
    """The frames of a run, as they come: an iterator, also an asynchronous one."""

    def __init__(self, camera: Camera, run: Any) -> None:
        self._camera, self._run = camera, run

    def __iter__(self) -> Frames:
        return self

    def __next__(self) -> Frame:
        try:
            found = self._run.next()
        except BaseException:
            # A traceback would keep the run alive.
            self._run.stop()
            raise
        if found is None:
            self._camera._ended(self._run)
            raise StopIteration
        return Frame(*found)

    def __aiter__(self) -> Frames:
        return self

    async def __anext__(self) -> Frame:
        try:
            found = await asyncio.to_thread(self._run.next)
        except BaseException:
            self._run.stop()
            raise
        if found is None:
            self._camera._ended(self._run)
            raise StopAsyncIteration
        return Frame(*found)

    @property
    def account(self) -> Account:
        """The account of the run so far."""
        return Account(*self._run.account)

    def measurement(self, frames: Sequence[Frame]) -> Measurement:
        """The measurement of some frames of this run together, in mean ADC counts, with the leak
        between patterns corrected.

        Examples
        --------
        >>> import itertools
        >>> import nirspi as ns
        >>> with ns.Camera("virtual", sampling=0.1) as camera, camera.frames() as frames:
        ...     ten = list(itertools.islice(frames, 10))
        ...     frames.measurement(ten).d.shape
        (102,)
        """
        if not frames:
            raise Error("frames is empty, expected at least one frame")
        sums = np.concatenate([frame.sums for frame in frames], dtype=np.int64)
        readings = self._run.readings(sums, [frame.sweeps for frame in frames])
        return _measurement(readings, self._camera._camera.taken)

    def close(self) -> None:
        """Ends the run; the LEDs are off."""
        self._run.stop()

    def __enter__(self) -> Frames:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Camera:
    """An open camera.

    Use it in a ``with`` block. The LEDs are off after the block, and after every run: at its end, at
    an exception, at Ctrl-C, when nothing refers to the run any more. If the program is killed, the
    camera switches them off by itself.

    Parameters
    ----------
    address : str
        "virtual", "usb", "usb:SERIAL", "tcp:HOST:PORT" or "serial:PATH[:BAUD]".
    order : str
        Order of the patterns, see :func:`nirspi.order`.
    sampling : float or str
        Share of the 1024 patterns to show, the first of the order: 0.3 or "30%".
    sweeps : int
        Sweeps summed into one frame.
    clocks_per_pattern, blanked : int, optional
        ADC clocks (of 8 ns) a pattern, and how many of them are left out at its start.
    differential : bool
        Whether each pattern is followed by its complement.
    calibration : str or path
        "kept": latency and settling kept for the camera by ``nirspi camera calibrate``, or measured on the
        scene if none are kept; a virtual camera measures them against its simulated white sheet.
        "measure": always measured on the scene. "off": none, with ``adc_latency``. Or a file.
    adc_latency : int, optional
        ADC clocks from light to sample, with ``calibration="off"``.
    scene : str or array_like, (k, k)
        What a virtual camera looks at: "letter:R", "word:STOP", "white", "black", the path of a
        picture, or an array of reflectances in [0, 1].
    scene_side_mm : float, optional
        Side of an array's target. Default: it fills the field.
    distance_m : float, optional
        Of the virtual camera's target. Default: where the lens is focused.
    weather : str, optional
        Before a virtual camera: "rain:20", "rain:20,mono:2", "fog:5m", ...
    model : str, path or CameraModel
        Description of the virtual camera.
    seed : int
        Of the virtual camera's noise: the same seed gives the same bytes.

    Examples
    --------
    >>> import nirspi as ns
    >>> with ns.Camera("virtual", scene="letter:R", sampling=0.25) as camera:
    ...     sums = camera.read(10)
    ...     measurement = camera.capture(100)
    >>> sums.shape, measurement.d.shape, camera.account.received
    ((10, 256), (256,), 100)
    """

    def __init__(
        self,
        address: str = "virtual",
        *,
        order: str = "cake-cutting",
        sampling: float | str = 1.0,
        sweeps: int = 1,
        clocks_per_pattern: int | None = None,
        blanked: int | None = None,
        differential: bool = True,
        calibration: str | os.PathLike[str] = "kept",
        adc_latency: int | None = None,
        scene: Any = None,
        scene_side_mm: float | None = None,
        distance_m: float | None = None,
        weather: str | None = None,
        model: str | os.PathLike[str] | CameraModel | None = None,
        seed: int = 1,
    ) -> None:
        self._run: weakref.ref[Any] | None = None
        virtual = {
            "scene": scene,
            "scene_side_mm": scene_side_mm,
            "distance_m": distance_m,
            "weather": weather,
        }
        if address != "virtual":
            given = [name for name, value in virtual.items() if value is not None]
            if given:
                raise Error(f"{given[0]} belongs to the virtual camera, not to {address}")
        named = scene is None or isinstance(scene, (str, os.PathLike))
        if not named:
            scene_map = _arrays.real(scene, "scene")
            if scene_map.ndim != 2 or scene_map.shape[0] != scene_map.shape[1] or not scene_map.size:
                raise Error(f"scene has shape {scene_map.shape}, expected (k, k)")
            virtual["scene_map"] = _arrays.flat(scene_map, "scene", np.float32)
        words = ("kept", "measure", "off")
        file = None if calibration in words else os.fspath(calibration)
        options = {
            "order": str(order),
            "sampling": _arrays.share(sampling),
            "sweeps": _arrays.count(sweeps, "sweeps", least=1),
            "clocks_per_pattern": _small(clocks_per_pattern, "clocks_per_pattern", 65535),
            "blanked": _small(blanked, "blanked", 65535),
            "differential": bool(differential),
            "calibration": "file" if file is not None else calibration,
            "calibration_file": file,
            "adc_latency": _small(adc_latency, "adc_latency", 255),
            "scene": os.fspath(scene) if named and scene is not None else None,
            "scene_map": virtual.get("scene_map"),
            "scene_side_mm": None if scene_side_mm is None else float(scene_side_mm),
            "distance_m": None if distance_m is None else float(distance_m),
            "weather": weather,
            "model": None if model is None or isinstance(model, CameraModel) else os.fspath(model),
            "model_text": model.toml if isinstance(model, CameraModel) else None,
            "seed": _arrays.count(seed, "seed"),
        }
        self._camera = _nirspi.Camera(str(address), options)
        self.address = str(address)
        _OPEN.add(self)

    # ---- what it is

    @property
    def identity(self) -> dict[str, Any]:
        """Board, serial number, versions, wavelength, capabilities."""
        return json.loads(self._camera.identity)

    @property
    def setup(self) -> dict[str, Any]:
        """The measurement: order, rows, timing."""
        return json.loads(self._camera.setup)

    @property
    def rows(self) -> np.ndarray:
        """Natural-order Hadamard rows in the order shown, (M,)."""
        return np.asarray(self.setup["rows"], np.int64)

    @property
    def truth(self) -> np.ndarray | None:
        """What a perfect camera of 32 x 32 pixels would see of a virtual camera's scene, (32, 32) in
        [0, 1]; None for any other camera."""
        truth = self._camera.truth
        return None if truth is None else truth.reshape(32, 32)

    @property
    def status(self) -> dict[str, Any]:
        """The camera's state between two runs: ``state``, ``fault``, ``leds_on``, ``celsius``."""
        names = ("state", "fault", "leds_on", "celsius")
        return dict(zip(names, self._camera.status(), strict=True))

    @property
    def account(self) -> Account:
        """The account of the current run, or of the last one."""
        return Account(*self._camera.account)

    @property
    def events(self) -> list[str]:
        """What the camera reported before it was opened, and during the last run."""
        return self._camera.events

    @property
    def closed(self) -> bool:
        return self._camera.closed

    def __repr__(self) -> str:
        return f"Camera({self.address!r}, {'closed' if self.closed else 'open'})"

    def __reduce__(self) -> Any:
        raise TypeError("a camera cannot be pickled: open it in the process that uses it")

    # ---- runs

    def frames(self, n: int | None = None) -> Frames:
        """The next ``n`` frames as they come; without ``n``, until the iterator is closed.

        Up to 1024 frames of a virtual camera wait for a slow program, and then its time waits, too.
        Of a real camera up to 65 536 frames wait; any further frame is left out and counted as passed over.

        Examples
        --------
        >>> import nirspi as ns
        >>> with ns.Camera("virtual", sampling=0.1) as camera:
        ...     [frame.sequence for frame in camera.frames(3)]
        [0, 1, 2]
        """
        return Frames(self, self._start(n, stream=True, path=None, overwrite=False))

    def read(self, n: int) -> np.ndarray:
        """The summed ADC counts of the next ``n`` frames, (n, M) of int64, in one call.

        Other threads of Python go on meanwhile. Frames that are missing are named in a
        RuntimeWarning; a run that breaks off is an Error.
        """
        run = self._start(_arrays.count(n, "n", least=1), stream=True, path=None, overwrite=False)
        try:
            sums, _sequence, _times = run.collect()
        finally:
            run.stop()
        self._ended(run)
        return sums.reshape(-1, len(self.rows))

    def capture(self, n: int) -> Measurement:
        """The measurement of the next ``n`` frames together, in mean ADC counts, with the leak
        between patterns corrected."""
        run = self._start(_arrays.count(n, "n", least=1), stream=False, path=None, overwrite=False)
        self._wait(run)
        return self._measurement(run)

    def record(self, path: str | os.PathLike[str], *, frames: int, overwrite: bool = False) -> Measurement:
        """Records the next frames into an MCAP file, and returns their measurement.

        The recording keeps what has come in whatever way it ends.

        Parameters
        ----------
        path : path
            A file that does not exist.
        frames : int
        overwrite : bool
            Replace a file that exists, when the new recording is whole.
        """
        asked = _arrays.count(frames, "frames", least=1)
        run = self._start(asked, stream=False, path=os.fspath(path), overwrite=overwrite)
        self._wait(run)
        return self._measurement(run)

    def _start(self, n: int | None, *, stream: bool, path: Any, overwrite: bool) -> Any:
        run = self._camera.start(
            {
                "frames": _arrays.count(n, "n", least=1),
                "stream": stream,
                "record": path,
                "overwrite": bool(overwrite),
            }
        )
        # Weak, so that a run that nothing refers to ends.
        self._run = weakref.ref(run)
        return run

    def _wait(self, run: Any) -> None:
        try:
            run.wait()
        finally:
            run.stop()
        self._ended(run)

    def _measurement(self, run: Any) -> Measurement:
        readings, notes = run.measurement()
        made = _measurement(readings, self._camera.taken)
        made.frames, made.notes = self.account, notes
        return made

    def _ended(self, run: Any) -> None:
        """Says what a run lacks."""
        outcome = run.outcome()
        if outcome is None:
            return
        _words, missing, broke, _path, _seconds = outcome
        if broke:
            raise Error(missing or "the run broke off")
        if missing and not missing.startswith("stopped by the user"):
            warnings.warn(missing, RuntimeWarning, stacklevel=3)

    def close(self) -> None:
        """Ends a run that goes on, switches the LEDs off and closes the link."""
        run = self._run() if self._run is not None else None
        if run is not None:
            run.stop()
        self._camera.close()
        _OPEN.discard(self)

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _measurement(readings: Any, taken: str) -> Measurement:
    """The measurement of what the library made of frames."""
    n, rows, d, noise, flat = readings
    made = Measurement(d=d, rows=rows, n=n, unit="ADC counts", flat_field=flat, noise=noise)
    made.origin = json.loads(taken)
    return made


def _small(value: Any, name: str, most: int) -> int | None:
    number = _arrays.count(value, name)
    if number is not None and number > most:
        raise Error(f"{name} is {number}, expected at most {most}")
    return number


@atexit.register
def _close_all() -> None:
    for camera in list(_OPEN):
        camera.close()
