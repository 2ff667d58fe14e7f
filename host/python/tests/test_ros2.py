"""The ROS 2 node: its messages against the definitions of ROS 2, and the node on a stand-in for rclpy.

ROS 2 itself is not on PyPI. `rosbags` has its message definitions and its serialisation (CDR). The
stand-in has the six functions of rclpy that the node calls.
"""

import importlib
import importlib.util
import subprocess
import sys
import time
import types

import numpy as np
import pytest

import nirspi as ns
from nirspi import ros2

rosbags = pytest.importorskip("rosbags.typesys", reason="rosbags has the definitions of ROS 2")
DISTROS = ["ROS2_HUMBLE", "ROS2_JAZZY"]
# What the node says by hand; a field that the definition does not have is a TypeError.
IMAGE = {"header", "height", "width", "encoding", "is_bigendian", "step", "data"}


def messages_of(distro):
    store = rosbags.get_typestore(rosbags.Stores[distro])
    made = ros2.Messages(
        store.types.__getitem__, octets=lambda data: np.frombuffer(data, np.uint8), octet=lambda value: value
    )
    return store, made


@pytest.mark.parametrize("distro", DISTROS)
def test_an_image_comes_back_from_the_wire_of_ros_bit_by_bit(distro):
    store, messages = messages_of(distro)
    pixels = np.random.default_rng(1).normal(0, 300, (32, 48)).astype(np.float32)
    name = "sensor_msgs/msg/Image"
    assert {field for field, _ in store.fielddefs[name][1]} == IMAGE
    made = messages.image(pixels, 1_790_000_000_123_456_789, "bench")
    back = store.deserialize_cdr(store.serialize_cdr(made, name), name)
    assert (back.height, back.width, back.step, back.encoding, back.is_bigendian) == (32, 48, 192, "32FC1", 0)
    assert (back.header.stamp.sec, back.header.stamp.nanosec) == (1_790_000_000, 123_456_789)
    assert back.header.frame_id == "bench"
    read = np.frombuffer(back.data.tobytes(), "<f4").reshape(back.height, back.width)
    assert (read == pixels).all()


@pytest.mark.parametrize("distro", DISTROS)
def test_diagnostics_come_back_from_the_wire_of_ros(distro):
    store, messages = messages_of(distro)
    made = messages.diagnostics(5_000_000_007, "A-17", ros2.WARN, "2 frames lost", {"lost": 2, "late": 0})
    name = "diagnostic_msgs/msg/DiagnosticArray"
    back = store.deserialize_cdr(store.serialize_cdr(made, name), name)
    (status,) = back.status
    assert (status.level, status.hardware_id, status.message) == (1, "A-17", "2 frames lost")
    assert [(pair.key, pair.value) for pair in status.values] == [("lost", "2"), ("late", "0")]
    assert (back.header.stamp.sec, back.header.stamp.nanosec) == (5, 7)


def test_an_image_of_another_shape_is_refused():
    with pytest.raises(ns.Error, match=r"\(3,\), expected \(rows, columns\)"):
        messages_of(DISTROS[0])[1].image(np.zeros(3), 0, "")


@pytest.fixture
def stand_in(monkeypatch):
    """The functions of rclpy that the node calls, and what was published: topic and message."""
    store, _ = messages_of("ROS2_JAZZY")
    published, state = [], {"ok": False}

    class Node:
        def create_publisher(self, message_type, topic, _qos):
            def publish(message):
                assert type(message) is message_type
                published.append((topic, message))

            return types.SimpleNamespace(publish=publish)

    rclpy = types.ModuleType("rclpy")
    rclpy.init = lambda args: state.update(ok=True, args=args)
    rclpy.ok = lambda: state["ok"]
    rclpy.shutdown = lambda: state.update(ok=False)
    rclpy.create_node = lambda name: Node()
    qos = types.ModuleType("rclpy.qos")
    qos.qos_profile_sensor_data = "sensor data"
    found = {"rclpy": rclpy, "rclpy.qos": qos}
    for package in ("builtin_interfaces", "std_msgs", "sensor_msgs", "diagnostic_msgs"):
        names = [name for name in store.types if name.startswith(f"{package}/msg/")]
        classes = {name.rpartition("/")[2]: store.types[name] for name in names}
        found[f"{package}.msg"] = types.SimpleNamespace(**classes)
    real = importlib.import_module
    monkeypatch.setattr(ros2.importlib, "import_module", lambda name: found.get(name) or real(name))
    return published, state


def test_the_node_publishes_images_with_times_and_diagnostics(stand_in):
    published, state = stand_in
    arguments = ["--images", "3", "--frames", "4", "--sweeps", "2", "--sampling", "10%"]
    assert ros2.main([*arguments, "--ros-args", "-r", "__ns:=/lab"]) == 0
    assert state == {"ok": False, "args": ["--ros-args", "-r", "__ns:=/lab"]}
    images = [message for topic, message in published if topic == "image"]
    assert [(image.height, image.width, image.header.frame_id) for image in images] == [
        (32, 32, "nirspi")
    ] * 3
    for image in images:
        assert np.isfinite(np.frombuffer(bytes(image.data), "<f4")).all()
    for image in images:
        stamp = image.header.stamp.sec * 10**9 + image.header.stamp.nanosec
        assert abs(time.time_ns() - stamp) < 60 * 10**9
    (status,) = next(message for topic, message in published if topic == "/diagnostics").status
    assert status.hardware_id == "virtual-1"
    assert [pair.key for pair in status.values][:2] == ["received", "lost"]


def test_a_camera_that_is_not_there_is_an_error_in_one_line(stand_in, capsys):
    assert ros2.main(["--camera", "tcp:127.0.0.1:1"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("nirspi.ros2: no camera at tcp:127.0.0.1:1") and said.count("\n") == 1


def test_losses_are_a_warning_once():
    health = ros2.Health()
    stream = types.SimpleNamespace(account=ns.Account(received=9, lost=2, passed_over=1), skipped=4)
    level, text, values = health.status(stream)
    assert (level, values["lost"], values["images skipped"]) == (ros2.WARN, 2, 4) and text.startswith(
        "3 frames"
    )
    assert health.status(stream)[0] == ros2.OK


def test_a_slow_program_gets_the_newest_image_and_skipped_ones_are_counted():
    with ns.Camera("virtual", sampling=0.1, sweeps=4) as camera, ros2.Stream(camera, frames=5) as stream:
        first = next(stream)
        time.sleep(0.5)
        second = next(stream)
        assert stream.skipped > 0 and second.time_ns > first.time_ns
    assert camera.closed


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="rclpy is here")
def test_without_rclpy_the_node_says_so_plainly():
    ran = subprocess.run([sys.executable, "-m", "nirspi.ros2"], capture_output=True, text=True, check=False)
    assert ran.returncode == 1 and "rclpy is missing: source a ROS 2 installation" in ran.stderr
    assert ran.stderr.count("\n") == 1
