"""A ROS 2 node: images of a camera as ``sensor_msgs/Image``, losses as ``diagnostic_msgs``.

``python -m nirspi.ros2 --camera usb --ros-args -r __ns:=/robot``

The node needs the Python of a ROS 2 installation (``rclpy``, ``sensor_msgs``, ``diagnostic_msgs``).
Everything but the node itself works without ROS: :class:`Messages` makes messages of any library
whose classes take their fields by name.
"""

from __future__ import annotations

import argparse
import array
import importlib
import itertools
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._nirspi import Error
from .camera import Account, Camera, Frames
from .measurement import Measurement
from .networks import enhance
from .reconstruction import reconstruct

OK, WARN, ERROR = 0, 1, 2
_MISSING = (
    "nirspi.ros2: {} is missing: source a ROS 2 installation (source /opt/ros/DISTRO/setup.bash) and "
    "install nirspi for its Python"
)


class Messages:
    """Makes ROS 2 messages.

    Parameters
    ----------
    named : callable
        Gives the class of a message: ``named("sensor_msgs/msg/Image")``.
    octets : callable
        Makes the value of a field ``uint8[]`` of bytes.
    octet : callable
        Makes the value of a field ``byte`` of an int.
    """

    def __init__(
        self,
        named: Callable[[str], Any],
        octets: Callable[[bytes], Any] = lambda data: array.array("B", data),
        octet: Callable[[int], Any] = lambda value: bytes([value]),
    ) -> None:
        self._named, self._octets, self._octet = named, octets, octet

    def _header(self, time_ns: int, frame_id: str) -> Any:
        sec, nanosec = divmod(int(time_ns), 1_000_000_000)
        stamp = self._named("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)
        return self._named("std_msgs/msg/Header")(stamp=stamp, frame_id=frame_id)

    def image(self, pixels: Any, time_ns: int, frame_id: str) -> Any:
        """``sensor_msgs/msg/Image`` of (rows, columns) pixels: 32FC1, little-endian, without gaps."""
        data = np.ascontiguousarray(pixels, "<f4")
        if data.ndim != 2:
            raise Error(f"pixels has shape {data.shape}, expected (rows, columns)")
        return self._named("sensor_msgs/msg/Image")(
            header=self._header(time_ns, frame_id),
            height=data.shape[0],
            width=data.shape[1],
            encoding="32FC1",
            is_bigendian=0,
            step=4 * data.shape[1],
            data=self._octets(data.tobytes()),
        )

    def diagnostics(self, time_ns: int, serial: str, level: int, text: str, values: dict[str, Any]) -> Any:
        """``diagnostic_msgs/msg/DiagnosticArray`` with the status of one camera."""
        pair = self._named("diagnostic_msgs/msg/KeyValue")
        status = self._named("diagnostic_msgs/msg/DiagnosticStatus")(
            level=self._octet(level),
            name="nirspi: frames",
            message=text,
            hardware_id=serial,
            values=[pair(key=key, value=str(value)) for key, value in values.items()],
        )
        header = self._header(time_ns, "")
        return self._named("diagnostic_msgs/msg/DiagnosticArray")(header=header, status=[status])


@dataclass(frozen=True, eq=False)
class Seen:
    """An image with its time.

    Attributes
    ----------
    time_ns : int
        The computer's time of the middle frame, in ns since 1970.
    pixels : ndarray of float32, (n, n)
    warnings : list of str
        Why the image may not be trusted.
    """

    time_ns: int
    pixels: np.ndarray
    warnings: list[str]


class Stream(Iterator[Seen]):
    """The newest images of a camera: a slow program passes images over, and they are counted.

    Parameters
    ----------
    camera : Camera
    frames : int
        Frames summed into an image.
    method : str
        See :func:`nirspi.methods`.
    sharp : bool
        Whether to enlarge and deblur: (64, 64) in [0, 1].
    """

    def __init__(
        self, camera: Camera, *, frames: int = 10, method: str = "tikhonov", sharp: bool = False
    ) -> None:
        self.skipped = 0
        self._method, self._sharp = method, sharp
        self._run = camera.frames()
        self._newest: queue.Queue[tuple[int, Measurement] | BaseException | None] = queue.Queue(1)
        self._thread = threading.Thread(target=self._read, args=(self._run, frames), daemon=True)
        self._thread.start()

    def _read(self, run: Frames, frames: int) -> None:
        end: BaseException | None = None
        try:
            while batch := list(itertools.islice(run, frames)):
                self._put((batch[len(batch) // 2].time_ns, run.measurement(batch)))
        except BaseException as error:  # given to the thread that takes the images
            end = error
        self._put(end)

    def _put(self, item: tuple[int, Measurement] | BaseException | None) -> None:
        while True:
            try:
                return self._newest.put_nowait(item)
            except queue.Full:
                try:
                    self._newest.get_nowait()
                    self.skipped += 1
                except queue.Empty:
                    pass

    def __next__(self) -> Seen:
        item = self._newest.get()
        if item is None:
            raise StopIteration
        if isinstance(item, BaseException):
            raise item
        time_ns, measurement = item
        image = reconstruct(measurement, method=self._method)
        if self._sharp:
            image = enhance(image)
        return Seen(time_ns, np.asarray(image), list(image.warnings))

    @property
    def account(self) -> Account:
        """The account of the frames so far."""
        return self._run.account

    def close(self) -> None:
        """Ends the run; the LEDs are off."""
        self._run.close()
        self._thread.join()

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Health:
    """Says whether frames were lost since the last time it was asked."""

    def __init__(self) -> None:
        self._before = 0

    def status(self, stream: Stream) -> tuple[int, str, dict[str, Any]]:
        """Level, text and values for :meth:`Messages.diagnostics`."""
        account = stream.account
        missing = account.lost + account.corrupt + account.late + account.passed_over
        new, self._before = missing - self._before, missing
        values = {**account._asdict(), "images skipped": stream.skipped}
        if new:
            return WARN, f"{new} frames lost, damaged, late or passed over since the last report", values
        return OK, "every frame received", values


def _class_of(name: str) -> Any:
    package, _, message = name.partition("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), message)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m nirspi.ros2",
        description="Publish images of a camera, and its losses, as ROS 2 messages.",
        epilog="Further arguments, such as --ros-args, go to ROS.",
    )
    add = parser.add_argument
    add("--camera", default="virtual", help="address of the camera, as for nirspi capture")
    add("--topic", default="image", help="topic of the images (sensor_msgs/Image, 32FC1)")
    add("--frame-id", default="nirspi", help="coordinate frame in the header of the images")
    add("--frames", type=int, default=10, help="frames summed into an image")
    add("--sweeps", type=int, default=122, help="sweeps summed into a frame; 122 are 10 ms")
    add("--sampling", default="50%", help="share of the patterns to show")
    add("--order", default="cake-cutting", help="order of the patterns")
    add("--method", default="tikhonov", help="how images are reconstructed")
    add("--enhance", action="store_true", help="enlarge and deblur the images: 64 x 64 in 0 to 1")
    add("--images", type=int, help="end after this many images")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until ROS or the camera ends. Returns the exit code."""
    own, rest = _arguments().parse_known_args(arguments)
    try:
        rclpy = importlib.import_module("rclpy")
        qos = importlib.import_module("rclpy.qos")
        image_type = _class_of("sensor_msgs/msg/Image")
        diagnostics_type = _class_of("diagnostic_msgs/msg/DiagnosticArray")
    except ImportError as error:
        print(_MISSING.format(error.name or "ROS 2"), file=sys.stderr)
        return 1
    messages, health, sent, due = Messages(_class_of), Health(), 0, 0.0
    rclpy.init(args=rest)
    try:
        node = rclpy.create_node("nirspi")
        images = node.create_publisher(image_type, own.topic, qos.qos_profile_sensor_data)
        diagnostics = node.create_publisher(diagnostics_type, "/diagnostics", 10)
        camera = Camera(own.camera, order=own.order, sampling=own.sampling, sweeps=own.sweeps)
        with (
            camera,
            Stream(camera, frames=own.frames, method=own.method, sharp=own.enhance) as stream,
        ):
            serial = camera.identity["serial"]

            def report(level: int, text: str, values: dict[str, Any]) -> None:
                now = time.time_ns()
                diagnostics.publish(messages.diagnostics(now, serial, level, text, values))

            try:
                for seen in stream:
                    images.publish(messages.image(seen.pixels, seen.time_ns, own.frame_id))
                    sent += 1
                    if time.monotonic() >= due:
                        due = time.monotonic() + 1.0
                        report(*health.status(stream))
                    if not rclpy.ok() or sent == own.images:
                        break
            except (Error, OSError) as error:
                report(ERROR, str(error), dict(health.status(stream)[2]))
                raise
    except (Error, OSError) as error:
        print(f"nirspi.ros2: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        if rclpy.ok():
            rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
