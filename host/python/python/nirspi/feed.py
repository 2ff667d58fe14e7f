"""Feeds: the live readings of any bench, as frames, measurements and a live page."""

from __future__ import annotations

import json
import os
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from . import _arrays, _nirspi
from ._nirspi import Error
from .measurement import Measurement, _of_loaded

# The longest wait between two looks whether a page is still served.
_TICK_S = 0.05
# Numbers that are given together at most: a block of the compiled part.
_BLOCK = 8192
# Single numbers are given together, after this time at the latest, or when a frame is complete.
_TOGETHER_S = 0.02


class FeedAccount(NamedTuple):
    """What became of the numbers of a feed; nothing is estimated.

    ``frames`` are complete, with at least one reading; ``empty_frames`` are complete without any and
    left out. ``refused`` numbers were words or infinite, ``not_read`` readings were NaN: both count as
    not read. ``lost`` readings were not read because the trigger lost their edge; ``early`` edges begin no
    reading. ``cut`` readings belong to a last frame that is not complete.
    """

    frames: int = 0
    empty_frames: int = 0
    refused: int = 0
    not_read: int = 0
    lost: int = 0
    early: int = 0
    cut: int = 0


@dataclass(frozen=True, eq=False)
class FeedFrame:
    """One frame of a feed: a sweep of all its patterns.

    Attributes
    ----------
    readings : ndarray of float64
        The readings in the order in which they came; NaN: not read.
    sequence : int
        Number of the frame among those of the feed, from 0 on.
    time_ns : int
        The computer's time at which the frame was complete, in ns since 1970.
    """

    readings: np.ndarray
    sequence: int
    time_ns: int


class Feed(Iterable[FeedFrame]):
    """Live readings of a bench that is no nirspi camera, such as a DMD with a DAQ.

    The readings come from an address, where another program sends them behind a header that says what
    they are; or from an iterable of this program, such as a generator, and the keywords say what a
    header says. See ``docs/feeds.md``.

    Parameters
    ----------
    source : str or iterable
        "HOST:PORT", "listen:HOST:PORT", the path of a socket, pipe or growing file, or "-". Or an
        iterable of numbers and of arrays of any length; NaN: not read.
    n : int, optional
        Of an iterable: side of the image.
    order : str or array_like of int, optional
        Of an iterable: the order in which patterns are shown, by its name (see :func:`nirspi.order`) or
        as natural-order rows.
    patterns : int, optional
        Of an iterable: number of patterns of a frame, the first of the order. Default: all.
    readings : {"pairs", "halves", "single", "differences"}
        Of an iterable: the form of a frame, as of :class:`Measurement`.
    size : (int, int), optional
        Of an iterable: height and width of the image, instead of ``n`` and ``order``, if ``patterns``
        patterns of your own are shown. Their frames have readings; ``nirspi.reconstruct`` with ``matrix``
        makes the images.
    samples, settle : int
        Of an iterable: numbers that make one reading, their mean, and how many at its beginning are left
        out.
    trigger : float or (float, float), optional
        Of an iterable: each sample is followed by one of a trigger. A reading begins where the trigger
        reaches this level, or the second level after it was below the first one.
    unit, name : str, optional
        Of an iterable: unit of the readings and name of the bench, for the page and recordings.
    simulated : bool, optional
        Of an iterable: whether no light is measured.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> volts = ns.Hadamard(8, rows=ns.order("zig-zag", 8), split=True)(np.eye(8))
    >>> daq = (block for _ in range(3) for block in np.split(volts, 4))
    >>> with ns.Feed(daq, n=8, order="zig-zag") as feed:
    ...     images = [ns.reconstruct(feed.measurement(frame), method="hadamard") for frame in feed]
    >>> len(images), bool(np.allclose(images[0], np.eye(8), atol=1e-5)), feed.account.frames
    (3, True, 3)
    """

    def __init__(
        self,
        source: Any,
        *,
        n: int | None = None,
        order: Any = None,
        patterns: int | None = None,
        size: tuple[int, int] | None = None,
        readings: str = "pairs",
        samples: int = 1,
        settle: int = 0,
        trigger: float | tuple[float, float] | None = None,
        unit: str | None = None,
        name: str | None = None,
        simulated: bool | None = None,
    ) -> None:
        self._blocks: Iterator[Any] | None = None
        self._waiting = np.empty(0)
        self._given = 0
        self._came = 0
        if isinstance(source, (str, os.PathLike)):
            said = {"n": n, "order": order, "patterns": patterns, "unit": unit, "name": name}
            given = [key for key, value in said.items() if value is not None]
            if given:
                raise Error(f"{given[0]} beside an address, whose header says what is measured")
            self._feed = _nirspi.Feed.open(os.fspath(source))
        else:
            header = {
                "n": None if n is None else _arrays.side(n),
                "height": None if size is None else _arrays.count(size[0], "size[0]"),
                "width": None if size is None else _arrays.count(size[1], "size[1]"),
                "order": order if order is None or isinstance(order, str) else None,
                "h_row": None if order is None or isinstance(order, str) else _rows(order),
                "patterns": _arrays.count(patterns, "patterns"),
                "readings": str(readings),
                "samples": _arrays.count(samples, "samples"),
                "settle": _arrays.count(settle, "settle"),
                "trigger": None if trigger is None else _levels(trigger),
                "unit": unit,
                "name": name,
                "simulated": None if simulated is None else bool(simulated),
            }
            if size is None and (n is None or order is None):
                missing = "n" if n is None else "order"
                raise Error(f"readings of this program without {missing}, expected n and order")
            try:
                self._blocks = iter(source)
            except TypeError:
                found = type(source).__name__
                raise Error(f"source is a {found}, expected an address or an iterable of readings") from None
            stated = {key: value for key, value in header.items() if value is not None}
            self._feed = _nirspi.Feed.of_numbers("this program", json.dumps(stated))
            self._each = self._feed.numbers

    # ---- what it is

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the image."""
        return self._feed.size

    @property
    def patterns(self) -> int:
        """Number of patterns of a frame."""
        return self._feed.patterns

    @property
    def rows(self) -> np.ndarray:
        """Natural-order Hadamard rows in the order shown, (M,)."""
        return self._feed.rows

    @property
    def order(self) -> str:
        """Name of the order of the patterns, "h_row", or "own" for patterns of the bench's own."""
        return self._feed.header[4]

    @property
    def readings(self) -> str:
        """Form of a frame's readings: "pairs", "halves", "single" or "differences"."""
        return self._feed.header[3]

    @property
    def unit(self) -> str | None:
        """Unit of the readings, if the header says it."""
        return self._feed.header[1]

    @property
    def name(self) -> str:
        """The bench as the header names it, or the address."""
        return self._feed.header[0] or self._feed.name

    @property
    def simulated(self) -> bool | None:
        """Whether no light is measured, if the header says it."""
        return self._feed.header[2]

    @property
    def account(self) -> FeedAccount:
        """The account of the numbers that have been taken."""
        return FeedAccount(*self._feed.account)

    @property
    def closed(self) -> bool:
        return self._feed.closed

    def __repr__(self) -> str:
        return f"Feed({self._feed.name!r}, {'closed' if self.closed else 'open'})"

    def __reduce__(self) -> Any:
        raise TypeError("a feed cannot be pickled: open it in the process that uses it")

    # ---- its frames

    def __iter__(self) -> Iterator[FeedFrame]:
        """The frames as they come, until the feed ends."""
        return self.frames()

    def frames(self, n: int | None = None, *, timeout: float | None = None) -> Iterator[FeedFrame]:
        """The next ``n`` frames as they come; without ``n``, until the feed ends.

        A feed that is lost, or that ends before the last of ``n`` frames, is an Error; numbers that are
        missing are named in a RuntimeWarning at the end. ``timeout`` is the longest time in seconds
        without a frame of an address; a longer one is a TimeoutError.
        """
        asked = _arrays.count(n, "n", least=1)
        while asked is None or asked > 0:
            frame = self._next(timeout)
            if frame is None:
                if asked is not None:
                    raise Error(f"the feed ended before the last {asked} of {n} frames")
                self._warn()
                return
            yield frame
            asked = None if asked is None else asked - 1

    def read(self, n: int) -> np.ndarray:
        """The readings of the next ``n`` frames, (n, readings of a frame)."""
        return np.stack([frame.readings for frame in self.frames(n)])

    def capture(self, n: int) -> Measurement:
        """The measurement of the next ``n`` frames together: of their mean."""
        return self.measurement(list(self.frames(n)))

    def measurement(self, frames: FeedFrame | Sequence[FeedFrame]) -> Measurement:
        """The measurement of one frame, or of the mean of several.

        It is that of a file with these readings: the same law of light, the same image.
        """
        several = [frames] if isinstance(frames, FeedFrame) else list(frames)
        if not several:
            raise Error("frames is empty, expected at least one frame")
        made = _of_loaded(self._feed.measurement(np.concatenate([frame.readings for frame in several])))
        made.unit = self.unit or made.unit
        return made

    def record(
        self, path: str | os.PathLike[str], *, frames: int | None = None, overwrite: bool = False
    ) -> list[str]:
        """Records the next frames, or all until the feed ends, into an ``.npz``; returns its name.

        More frames than one file holds go on in ``NAME-2.npz`` and so on. The recording keeps what has
        come if it breaks off, and ``nirspi.load(path, index="all")`` opens it.
        """
        recorder = self._feed.record(os.fspath(path), bool(overwrite))
        try:
            for frame in self.frames(frames):
                recorder.push(frame.readings)
        finally:
            files = recorder.finish()
        return [os.fspath(file) for file in files]

    def close(self) -> None:
        """Closes the feed. A generator is closed, too."""
        self._feed.close()
        close = getattr(self._blocks, "close", None)
        self._blocks = None
        if close is not None:
            close()

    def __enter__(self) -> Feed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next(self, timeout: float | None) -> FeedFrame | None:
        until = None if timeout is None else time.monotonic() + timeout
        while True:
            # What the program gives is there at once.
            found, end = self._feed.next(0.0 if self._blocks is not None else _TICK_S)
            if found is not None:
                self._came += 1
                return FeedFrame(found, self._came - 1, time.time_ns())
            if end is not None:
                if end != "the feed ended":
                    raise Error(f"{self._feed.name}: {end}")
                return None
            if self._blocks is not None:
                self._pull(self._blocks)
            elif until is not None and time.monotonic() > until:
                raise TimeoutError(f"{self._feed.name}: no frame for {timeout} s")

    def _pull(self, blocks: Iterator[Any]) -> bool:
        """Gives some readings of this program to the feed: never more than the feed takes before it is asked
        for a frame. Returns whether there may be more."""
        if not len(self._waiting):
            found = self._block(blocks)
            if found is None:
                self._feed.end()
                self._blocks = None
                return False
            self._waiting = found
        some, self._waiting = self._waiting[:_BLOCK], self._waiting[_BLOCK:]
        self._given += len(some)
        return self._feed.give(some)

    def _block(self, blocks: Iterator[Any]) -> np.ndarray | None:
        """The next readings of this program; None after the last. Single numbers come together."""
        began = time.monotonic()
        numbers: list[float] = []
        for block in blocks:
            if not isinstance(block, (float, int)):
                more = _arrays.flat(np.asarray(block), "a block of readings", np.float64)
                return np.concatenate([np.asarray(numbers, np.float64), more])
            numbers.append(block)
            # A frame that is complete, and numbers that came long ago, must not wait for more.
            whole = (self._given + len(numbers)) % self._each == 0
            if whole or time.monotonic() - began > _TOGETHER_S:
                break
        return np.asarray(numbers, np.float64) if numbers else None

    def _warn(self) -> None:
        missing = self._feed.missing()
        if missing:
            warnings.warn(f"{self._feed.name}: {missing}", RuntimeWarning, stacklevel=3)


class Page:
    """A live page of a feed: see :func:`serve`."""

    def __init__(self, feed: Feed, wanted: dict[str, Any]) -> None:
        self._feed = feed
        self._page = _nirspi.FeedPage(feed._feed, wanted)
        self.failed: BaseException | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """The address of the page, with its token if there is one."""
        return self._page.url

    @property
    def closed(self) -> bool:
        return self._page.is_over

    def _pump(self) -> None:
        """Gives the readings of this program to the page until they or the page end."""
        blocks = self._feed._blocks
        while blocks is not None and not self._page.is_over and self._feed._pull(blocks):
            pass

    def _pump_beside(self) -> None:
        try:
            self._pump()
        except BaseException as error:
            self.failed = error
            # The page says that no more comes.
            self._feed._feed.end()

    def _begin(self) -> None:
        if self._feed._blocks is not None:
            self._thread = threading.Thread(target=self._pump_beside, name="nirspi-feed", daemon=True)
            self._thread.start()

    def _wait(self) -> None:
        """Until Ctrl-C, or until the page fails."""
        self._pump()
        while not self._page.is_over:
            time.sleep(_TICK_S)

    def close(self) -> str | None:
        """Ends the page: the account of its frames and the delays of its images, in one line."""
        told = self._page.close()
        # The thread ends with the next block: the feed takes no more.
        self._feed._feed.end()
        return told

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Page({'closed' if self.closed else self.url!r})"


def serve(
    source: Any,
    *,
    listen: str = "127.0.0.1:8080",
    token: str | None = None,
    method: str = "auto",
    strength: float | None = None,
    sum: int = 1,
    record_to: str | os.PathLike[str] | None = None,
    matrix: str | os.PathLike[str] | None = None,
    device: str = "cpu",
    wait: bool = True,
    **header: Any,
) -> Page | None:
    """Shows live readings on a web page, until Ctrl-C: as ``nirspi serve --camera feed:ADDR`` does.

    After the last reading the page stays with the newest image.

    Parameters
    ----------
    source : Feed, iterable or str
        A :class:`Feed`, or what a Feed takes. The page ends the feed.
    listen : str
        Address of the page; port 0 takes a free port. An address that other machines reach demands a
        token.
    token : str, optional
        Token that browsers and scripts must know, 16 characters or more.
    method : str
        The method that makes the images at the beginning, see :func:`nirspi.methods`; the page can choose
        another.
    strength : float, optional
        Strength of the method's penalty. Default: chosen from held-back readings.
    sum : int
        Newest frames whose mean makes an image.
    record_to : path, optional
        Folder for recordings, which the page begins and ends.
    matrix : path, optional
        File of the patterns of a feed that shows its own: ``height``, ``width`` and ``patterns``.
    device : str
        Where OMP and networks compute, see :func:`nirspi.devices`.
    wait : bool
        Whether to return at Ctrl-C only. If not, a thread takes the readings of an iterable, and the
        :class:`Page` is returned at once: it has ``url`` and ``close``.
    **header
        What :class:`Feed` takes beside an iterable: ``n``, ``order``, ``readings``, ...

    Examples
    --------
    >>> import urllib.request
    >>> import nirspi as ns
    >>> volts = [2.5, 0.5] * 64 * 3
    >>> with ns.serve(volts, n=8, order="zig-zag", listen="127.0.0.1:0", wait=False) as page:
    ...     urllib.request.urlopen(page.url).status
    200
    """
    feed = source if isinstance(source, Feed) else Feed(source, **header)
    if feed is source and header:
        raise Error(f"{next(iter(header))} beside a Feed, which says what is measured")
    wanted = {
        "listen": str(listen),
        "token": token,
        "method": str(method),
        "strength": None if strength is None else float(strength),
        "sum": _arrays.count(sum, "sum", least=1),
        "record_to": None if record_to is None else os.fspath(record_to),
        "matrix": None if matrix is None else os.fspath(matrix),
        "device": str(device),
    }
    page = Page(feed, wanted)
    if not wait:
        page._begin()
        return page
    print(f"open {page.url} to see {feed.name}; Ctrl-C ends it", flush=True)
    try:
        page._wait()
    except KeyboardInterrupt:
        pass
    finally:
        told = page.close()
        feed.close()
    print(f"stopped: {told}", flush=True)
    return None


def _levels(trigger: Any) -> float | list[float]:
    levels = _arrays.real(trigger, "trigger").astype(np.float64)
    if levels.size not in (1, 2) or not np.isfinite(levels).all():
        raise Error(f"trigger is {trigger!r}, expected a level, or the lower and the upper one")
    return float(levels.reshape(-1)[0]) if levels.size == 1 else [float(level) for level in levels]


def _rows(order: Any) -> list[int]:
    return [int(row) for row in _arrays.whole_numbers(order, "order")]
