"""The camera: the virtual one in this process, and one behind TCP. The LEDs are off on every way out."""

import asyncio
import gc
import os
import pickle
import re
import subprocess
import sys
import textwrap
import threading
import time
import warnings

import numpy as np
import pytest

import nirspi as ns


def virtual(**options):
    return ns.Camera("virtual", **{"sampling": 0.1, **options})


def off(camera):
    """Whether the camera itself says that its LEDs are off and no run goes on."""
    status = camera.status
    return not status["leds_on"] and status["state"] != "running"


@pytest.fixture
def served(cli):
    """The virtual camera in another process, behind TCP."""
    server = subprocess.Popen(
        [cli, "dev", "virtual", "--listen", "127.0.0.1:0", "--precompute", "4"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        for line in server.stdout:
            found = re.search(r"tcp:[0-9.:]*[0-9]", line)
            if found:
                yield found[0]
                break
    finally:
        server.kill()
        server.wait()
        server.stdout.close()


def test_frames_are_read_captured_and_recorded(tmp_path):
    with virtual() as camera:
        assert camera.identity["board"] == "virtual" and camera.setup["order"] == "cake-cutting"
        sums = camera.read(20)
        assert sums.shape == (20, 102) and sums.dtype == np.int64 and sums.std() > 0
        # The first pattern of each frame is the even one, which has all the light.
        assert (sums.argmax(axis=1) == 0).all()
        assert camera.account == ns.Account(received=20)
        frames = list(camera.frames(5))
        assert [frame.sequence for frame in frames] == [0, 1, 2, 3, 4]
        assert frames[0].sums.shape == (102,) and frames[1].device_time_us > frames[0].device_time_us
        assert camera.capture(7).frames.received == 7
        camera.record(tmp_path / "a.mcap", frames=3)
        assert off(camera)
    assert camera.closed


def test_a_measurement_knows_its_noise_however_it_was_taken(tmp_path):
    with virtual() as camera:
        recorded = camera.record(tmp_path / "a.mcap", frames=40)
        captured = camera.capture(40)
        with camera.frames() as frames:
            taken = [next(frames) for _ in range(40)]
            summed = frames.measurement(taken)
            assert frames.measurement(taken[:1]).noise is None
        scale = taken[0].sweeps * (camera.setup["clocks_per_pattern"] - camera.setup["blanked"])
    scattered = np.std([frame.sums / scale for frame in taken], axis=0, ddof=1).mean() / 40**0.5
    for measurement in (recorded, captured, summed):
        assert measurement.noise == pytest.approx(scattered, rel=0.1)
    loaded = ns.load(tmp_path / "a.mcap")
    assert loaded.noise == recorded.noise and np.allclose(loaded.d, recorded.d, rtol=1e-12)


def test_images_pictures_and_files_name_the_camera(tmp_path):
    with virtual() as camera:
        recorded = camera.record(tmp_path / "a.mcap", frames=4)
        captured = camera.capture(4)
        serial = camera.identity["serial"]
    captured.save(tmp_path / "b.npz")
    loaded = ns.load(tmp_path / "b.npz")
    every = ns.load(tmp_path / "a.mcap", index="all")
    for measurement in (recorded, captured, loaded, ns.load(tmp_path / "a.mcap"), every, every[1:]):
        assert measurement.origin["origin"] == "simulated"
        assert measurement.origin["camera"]["serial"] == serial
    assert loaded.origin["file"] == "b.npz"
    image = ns.reconstruct(loaded, method="hadamard")
    sharp = ns.enhance(image)
    for made in (image, pickle.loads(pickle.dumps(image)), sharp, ns.reconstruct(every, method="hadamard")):
        assert made.origin["camera"]["serial"] == serial
        assert f'"serial":"{serial}"'.encode() in made.png()
    plain = ns.reconstruct(ns.Measurement(d=loaded.d, rows=loaded.rows, n=32), method="hadamard")
    assert plain.origin is None and serial.encode() not in plain.png()


def test_a_capture_shows_the_scene():
    scene = np.zeros((32, 32), np.float32)
    scene[6:14, 8:26] = 0.9
    with ns.Camera("virtual", scene=scene, order="zig-zag") as camera:
        image = ns.reconstruct(camera.capture(100))
    assert image.unit == "ADC counts"
    assert ns.metrics.correlation(scene, image) > 0.8


def test_the_same_seed_gives_the_same_frames():
    reads = []
    for seed in (1, 1, 2):
        with virtual(seed=seed) as camera:
            reads.append(camera.read(3))
    assert (reads[0] == reads[1]).all() and (reads[0] != reads[2]).any()


def test_single_patterns_weather_and_models():
    with virtual(differential=False, scene="white", sampling=0.25) as camera:
        assert not camera.setup["differential"] and camera.capture(5).d.shape == (256,)
    with virtual(weather="rain:20", distance_m=0.3, model="fga015") as camera:
        assert camera.read(2).shape == (2, 102)
    with virtual(model=ns.CameraModel("paper"), calibration="off", adc_latency=6) as camera:
        assert any("no calibration" in note for note in camera.capture(3).notes)


def test_unequal_leds_leave_no_pattern():
    uneven = ns.CameraModel(toml="[leds]\npower_spread = 0.2")
    with ns.Camera("virtual", scene="white", model=uneven) as camera:
        m = camera.capture(300)
    assert m.flat_field is not None

    def unevenness(measurement):
        image = ns.reconstruct(measurement, method="hadamard")
        return float(image.std() / image.mean())

    flat = unevenness(pickle.loads(pickle.dumps(m)))
    m.flat_field = None
    assert flat < 0.3 * unevenness(m)


def test_a_kept_flat_field_of_a_camera_is_used(cli, tmp_path, monkeypatch):
    """As `nirspi camera calibrate --white` keeps it by serial number."""
    for variable in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"):
        monkeypatch.setenv(variable, str(tmp_path))
    (tmp_path / "uneven.toml").write_text("[leds]\npower_spread = 0.2\n")
    server = subprocess.Popen(
        [
            cli,
            "dev",
            "virtual",
            "--listen",
            "127.0.0.1:0",
            "--scene",
            "white",
            "--precompute",
            "64",
            "--camera-model",
            str(tmp_path / "uneven.toml"),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        address = next(m[0] for line in server.stdout if (m := re.search(r"tcp:[0-9.:]*[0-9]", line)))
        made = subprocess.run(
            [cli, "camera", "calibrate", "--camera", address, "--white"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert made.returncode == 0, made.stderr
        with ns.Camera(address) as camera:
            m = camera.capture(100)
        assert m.flat_field is not None and not any("no calibration" in note for note in m.notes)
    finally:
        server.kill()
        server.wait()
        server.stdout.close()


def test_the_leds_are_off_after_an_exception():
    with virtual() as camera:
        with pytest.raises(ZeroDivisionError):
            with camera.frames() as frames:
                for _frame in frames:
                    1 / 0
        assert off(camera)
        assert camera.account.received > 0
    with pytest.raises(ZeroDivisionError), virtual() as camera:
        for _frame in camera.frames():
            1 / 0
    assert camera.closed


def test_the_leds_are_off_when_a_loop_is_left():
    with virtual() as camera:
        for frame in camera.frames():
            if frame.sequence == 3:
                break
        gc.collect()
        assert off(camera)
        frames = camera.frames(1000)
        next(frames)
        with pytest.raises(ns.Error, match="a run goes on"):
            camera.read(1)
        del frames
        gc.collect()
        assert off(camera) and camera.read(2).shape == (2, 102)


def test_the_leds_of_a_camera_elsewhere_are_off_in_whatever_way_a_run_ends(served):
    """The next session asks the camera itself."""

    def leave_by_exception():
        with pytest.raises(KeyError), ns.Camera(served, calibration="measure") as camera:
            for _frame in camera.frames():
                raise KeyError

    def leave_by_garbage():
        camera = ns.Camera(served, calibration="measure")
        frames = camera.frames()
        next(frames)
        del frames, camera
        gc.collect()

    def leave_by_close():
        camera = ns.Camera(served, calibration="measure")
        frames = camera.frames()
        next(frames)
        camera.close()
        # What had come before is still there, and no more.
        assert sum(1 for _ in zip(frames, range(100_000), strict=False)) < 100_000

    for leave in (leave_by_exception, leave_by_garbage, leave_by_close):
        leave()
        for _ in range(50):
            try:
                camera = ns.Camera(served, calibration="measure")
                break
            except (OSError, ns.Error):
                time.sleep(0.1)
        with camera:
            assert off(camera), leave.__name__


@pytest.mark.skipif(sys.platform == "win32", reason="no signal of Ctrl-C to a process")
@pytest.mark.parametrize("call", ["list(camera.frames())", "camera.read(10**9)", "camera.capture(10**9)"])
def test_ctrl_c_ends_the_run_at_once(call):
    """In a process of its own, because the signal goes to the main thread."""
    program = f"""
        import os, signal, threading, time
        # A shell that runs the tests in the background has it ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        import nirspi as ns
        camera = ns.Camera("virtual", sampling=0.05, sweeps=50)
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        began = time.monotonic()
        try:
            {call}
        except KeyboardInterrupt:
            assert not camera.status["leds_on"] and camera.status["state"] != "running"
            assert time.monotonic() - began < 5
            print("interrupted")
    """
    made = subprocess.run(
        [sys.executable, "-X", "dev", "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert made.stdout == "interrupted\n", made.stderr


def test_an_interpreter_that_ends_within_a_run_ends_in_order():
    program = """
        import nirspi as ns
        camera = ns.Camera("virtual", sampling=0.05)
        frames = camera.frames()
        next(frames)
        print("bye")
    """
    made = subprocess.run(
        [sys.executable, "-X", "dev", "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (made.returncode, made.stdout, made.stderr) == (0, "bye\n", "")


def test_other_threads_go_on_while_a_camera_is_read():
    ticks, over = [], threading.Event()

    def tick():
        while not over.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    with virtual(sampling=1.0) as camera:
        began = time.monotonic()
        camera.read(300)
        took = time.monotonic() - began
    over.set()
    thread.join()
    within = [tick for tick in ticks if began <= tick <= began + took]
    assert max(np.diff([began, *within, began + took])) < max(0.5 * took, 0.2)


def test_a_second_thread_is_refused_and_the_first_goes_on():
    with virtual() as camera:
        frames = camera.frames(500)
        told = []

        def other():
            try:
                camera.read(1)
            except ns.Error as error:
                told.append(str(error))

        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        assert told == ["a run goes on, end it first"]
        assert sum(1 for _ in frames) == 500


def test_a_slow_program_loses_no_frame_of_the_virtual_camera():
    with virtual() as camera:
        frames = camera.frames(3000)
        next(frames)
        time.sleep(0.3)
        assert [frame.sequence for frame in frames] == list(range(1, 3000))
        assert camera.account == ns.Account(received=3000)


def test_frames_come_to_asyncio():
    async def read():
        found = []
        with virtual() as camera:
            async for frame in camera.frames(4):
                found.append(frame.sequence)
        return found

    assert asyncio.run(read()) == [0, 1, 2, 3]


def test_no_memory_is_kept_of_many_frames():
    resource = pytest.importorskip("resource")
    with virtual() as camera:
        for _ in camera.frames(2000):
            pass
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for _ in camera.frames(20_000):
            pass
        assert camera.account == ns.Account(received=20_000)
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert after - before < 20_000


def test_a_closed_camera_is_refused():
    camera = virtual()
    camera.close()
    camera.close()
    for use in (lambda: camera.read(1), lambda: camera.capture(1), lambda: camera.status, camera.frames):
        with pytest.raises(ns.Error, match="the camera is closed"):
            use()
    assert camera.identity["board"] == "virtual" and "closed" in repr(camera)


def test_a_camera_is_not_pickled():
    with virtual() as camera, pytest.raises(TypeError, match="open it in the process"):
        pickle.dumps(camera)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_of_fork_leaves_the_camera_alone():
    with virtual() as camera:
        frames = camera.frames(2000)
        next(frames)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            code = 1
            try:
                camera.read(1)
            except ns.Error as error:
                code = 0 if "belongs to the process that opened it" in str(error) else 2
            camera.close()
            del frames, camera
            os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert sum(1 for _ in frames) == 1999


def test_what_does_not_fit_is_refused_in_one_line(tmp_path):
    cases = [
        (dict(address="fax:1"), "expected virtual, usb"),
        (dict(order="spiral"), "unknown order"),
        (dict(sampling=0), "expected more than 0"),
        (dict(sampling="1.5"), "with its sign"),
        (dict(sweeps=0), "sweeps is 0"),
        (dict(blanked=5), "blanked is 5, expected 0 to 4"),
        (dict(clocks_per_pattern=70_000), "at most 65535"),
        (dict(adc_latency=6), "belongs to calibration"),
        (dict(calibration="off"), "needs adc_latency"),
        (dict(scene="word:"), "expected 1 to 8"),
        (dict(scene=np.ones((3, 4))), "expected (k, k)"),
        (dict(scene=np.full((4, 4), 2.0)), "scene is 2 at [0, 0], expected 0 to 1"),
        (dict(scene=np.full((4, 4), np.nan)), "scene is NaN at [0, 0]"),
        (dict(distance_m=-1), "expected a positive number of metres"),
        (dict(weather="hail"), "found hail"),
        (dict(model="none.toml"), "found no such file"),
        (dict(address="tcp:127.0.0.1:9", scene="white"), "belongs to the virtual camera"),
    ]
    for options, words in cases:
        with pytest.raises(ns.Error) as error:
            ns.Camera(options.pop("address", "virtual"), **options)
        assert words in str(error.value) and "\n" not in str(error.value), (options, error.value)
    with pytest.raises(ConnectionError, match="no camera at tcp:127.0.0.1:9"):
        ns.Camera("tcp:127.0.0.1:9")
    with virtual() as camera:
        for n in (0, -1, 1.5, "x"):
            with pytest.raises(ns.Error):
                camera.read(n)
        (tmp_path / "taken.mcap").write_text("precious")
        with pytest.raises(OSError, match="there already"):
            camera.record(tmp_path / "taken.mcap", frames=1)
        assert (tmp_path / "taken.mcap").read_text() == "precious"
        assert camera.read(1).shape == (1, 102)


def test_frames_have_the_computers_time_and_give_measurements_while_the_run_goes_on(served):
    with ns.Camera(served, sampling=0.1, calibration="off", adc_latency=6) as camera:
        before = time.time_ns()
        with camera.frames() as frames:
            taken = [next(frames) for _ in range(50)]
            summed = frames.measurement(taken)
            with pytest.raises(ns.Error, match="at least one frame"):
                frames.measurement([])
        after = time.time_ns()
        assert summed.d.shape == (102,) and (summed.rows == camera.rows).all()
        scale = sum(frame.sweeps for frame in taken) * 3
        sums = np.sum([frame.sums for frame in taken], axis=0)
        assert np.allclose(summed.d, sums / scale)
    assert all(before - 10**9 < frame.time_ns <= after for frame in taken)
