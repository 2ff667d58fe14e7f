"""Feeds: the live readings of a bench, from an address or from a generator, and their page."""

import contextlib
import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
import warnings

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT, asymmetric

N = 16
ROWS = ns.order("cake-cutting", N)


def volts(seed=7):
    return ns.Hadamard(N, rows=ROWS, split=True)(asymmetric(N, seed))


def pixels(measurement):
    return np.asarray(ns.reconstruct(measurement, method="hadamard"))


def expected(seed=7):
    return pixels(ns.Measurement(y=volts(seed), rows=ROWS, n=N))


def interruptible(command, folder):
    """A program that Ctrl-C reaches, also where the tests run in the background and ignore it."""
    return subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
    )


@contextlib.contextmanager
def sent(*pieces):
    """An address at which these bytes are sent to the first program that connects."""
    listener = socket.create_server(("127.0.0.1", 0))
    failed = []

    def send():
        try:
            with listener.accept()[0] as stream:
                for piece in pieces:
                    stream.sendall(piece)
        except OSError as error:
            failed.append(error)

    thread = threading.Thread(target=send)
    thread.start()
    yield f"127.0.0.1:{listener.getsockname()[1]}"
    listener.close()
    thread.join(20)


def header(**more):
    said = {"n": N, "h_row": ROWS.tolist(), "readings": "pairs", "numbers": "f64"}
    return json.dumps(said | more).encode() + b"\n"


def test_frames_of_an_address_give_the_images_of_a_file(tmp_path):
    y = volts()
    np.savez(tmp_path / "file.npz", n=N, h_row=ROWS, y=y)
    with (
        sent(header(name="DMD", unit="V", simulated=True), y.tobytes() * 2, y.tobytes()[:800]) as address,
        ns.Feed(address) as feed,
    ):
        assert (feed.size, feed.readings, feed.unit, feed.name) == ((N, N), "pairs", "V", "DMD")
        assert feed.rows.tolist() == ROWS.tolist() and feed.order == "cake-cutting" and feed.simulated
        with pytest.warns(RuntimeWarning, match="100 readings of a last frame that is not complete"):
            frames = list(feed)
    assert [frame.sequence for frame in frames] == [0, 1]
    assert abs(frames[0].time_ns - time.time_ns()) < 60e9
    assert all(np.array_equal(frame.readings, y) for frame in frames)
    measurement = feed.measurement(frames[0])
    assert np.array_equal(pixels(measurement), pixels(ns.load(tmp_path / "file.npz")))
    assert measurement.unit == "V" and feed.account == ns.FeedAccount(frames=2, cut=100)
    assert feed.closed and "closed" in repr(feed)


def test_a_generator_gives_frames_however_its_blocks_are_cut():
    y = volts()

    def by_one():
        yield from (value for _ in range(2) for value in y.tolist())

    def in_blocks():
        whole = np.tile(y, 2).astype(np.float32)
        yield from (whole[at : at + 77] for at in range(0, len(whole), 77))

    for source in (by_one(), in_blocks(), [y.reshape(N, -1), y], [y.tolist() * 2]):
        with ns.Feed(source, n=N, order="cake-cutting") as feed:
            found = feed.read(2)
            assert feed.account.frames == 2
        assert np.allclose(found, np.tile(y, (2, 1)), rtol=1e-6)


def test_a_block_of_many_frames_is_taken_whole():
    # More than waits between the program and the feed.
    y = volts()
    with ns.Feed([y[:100].tolist() + [0.5], np.tile(y, 3000)[101:]], n=N, order=ROWS) as feed:
        assert sum(1 for _ in feed) == 3000 and feed.account == ns.FeedAccount(frames=3000)


def test_a_generator_is_asked_for_no_more_than_a_frame_needs_and_is_closed():
    asked, ended = [], []

    def daq():
        try:
            while True:
                asked.append(1)
                yield volts()
        finally:
            ended.append(1)

    with ns.Feed(daq(), n=N, order=ROWS) as feed:
        for frame in feed.frames(3):
            assert len(asked) == frame.sequence + 1
    assert len(asked) == 3 and ended


def test_readings_that_were_not_read_leave_their_pattern_out_and_are_told():
    y = volts()
    holes = y.copy()
    holes[4] = np.nan
    with ns.Feed([holes, y], n=N, order=ROWS) as feed:
        mean = feed.capture(2)
        assert np.allclose(mean.d, ns.Measurement(y=y, rows=ROWS, n=N).d)
    with ns.Feed([np.append(holes, np.inf)], n=N, order=ROWS) as feed:
        with pytest.warns(RuntimeWarning, match="1 number refused .*1 reading not read.*1 reading of a last"):
            (frame,) = feed
        assert feed.measurement(frame).not_read.tolist() == [2]
        with pytest.raises(ns.Error, match="at least one frame"):
            feed.measurement([])
        with pytest.raises(ns.Error, match="ended before the last 1 of 1 frames"):
            feed.read(1)


def test_a_trigger_cuts_the_samples_of_a_generator():
    y = volts()
    samples = np.stack([np.repeat(y, 5), np.tile([5, 5, 0, 0, 0], len(y))], axis=1)
    with ns.Feed([samples[:700], samples[700:]], n=N, order=ROWS, samples=5, trigger=(1, 2)) as feed:
        assert np.allclose(feed.read(1), y, rtol=1e-12) and feed.account == ns.FeedAccount(frames=1)


def test_patterns_of_ones_own_give_readings_for_a_matrix(tmp_path):
    random = np.random.default_rng(5)
    masks = random.integers(0, 2, (60, 4, 6)).astype(float)
    scene = random.random((4, 6))
    y = (masks * scene).sum(axis=(1, 2))
    with ns.Feed([y, y], size=(4, 6), patterns=60, readings="single") as feed:
        assert (feed.size, feed.patterns, feed.order) == ((4, 6), 60, "own")
        (frame,) = feed.frames(1)
        image = ns.reconstruct(frame.readings, matrix=masks, method="pseudo-inverse")
        assert np.allclose(image, scene, atol=1e-4)
        with pytest.raises(ns.Error, match="60 patterns of its own on 4 x 6 pixels"):
            feed.measurement(frame)
        with pytest.raises(ns.Error, match="60 patterns of its own on 4 x 6 pixels"):
            ns.serve(feed, listen="127.0.0.1:0", wait=False)
        feed.record(tmp_path / "rec.npz")
    assert np.array_equal(np.load(tmp_path / "rec.npz")["y"], [y])
    np.save(tmp_path / "masks.npy", masks)
    shown = {
        "matrix": tmp_path / "masks.npy",
        "method": "pseudo-inverse",
        "listen": "127.0.0.1:0",
        "wait": False,
    }
    with ns.serve([y], size=(4, 6), patterns=60, readings="single", **shown) as page:
        state(page.url, lambda state: state["picture"])
        assert np.allclose(np.load(io.BytesIO(get(page.url, "/image.npy"))), scene, atol=1e-4)
    with pytest.raises(ns.Error, match="method hadamard needs Hadamard rows"):
        ns.serve([y], size=(4, 6), patterns=60, readings="single", **shown | {"method": "hadamard"})


def test_a_recording_is_opened_by_load(tmp_path):
    path = tmp_path / "rec.npz"
    daq = (volts(seed) for seed in range(3))
    with ns.Feed(daq, n=N, order=ROWS, unit="V") as feed:
        assert feed.record(path, frames=2) == [str(path)]
        assert feed.record(tmp_path / "rest.npz") == [str(tmp_path / "rest.npz")]
        with pytest.raises(ns.Error, match="is there already"):
            feed.record(path)
    loaded = ns.load(path, index="all")
    assert np.array_equal(pixels(loaded[1]), expected(1)) and len(loaded) == 2


def test_what_is_no_feed_is_refused_in_one_line(tmp_path):
    def told(source, error=ns.Error, **header):
        with pytest.raises(error) as raised:
            ns.Feed(source, **header)
        text = str(raised.value)
        assert len(text.splitlines()) == 1, text
        return text

    assert "n beside an address" in told("127.0.0.1:1", n=8)
    assert "no program listens there" in told("127.0.0.1:1", ConnectionError)
    assert "no such file, pipe or socket" in told(tmp_path / "nothing", ConnectionError)
    assert "without order" in told([1.0], n=8)
    assert "expected an address or an iterable" in told(7, n=8, order="natural")
    assert "a power of two from 2 to 256" in told([], n=9, order="natural")
    assert "expected one of natural" in told([], n=8, order="spiral")
    assert "64 at [0] of h_row" in told([], n=8, order=[64])
    assert "expected pairs, halves" in told([], n=8, order="natural", readings="triples")
    (tmp_path / "words.txt").write_text("1 2 3\n")
    assert 'begins with "1 2 3"' in told(tmp_path / "words.txt")
    with (
        ns.Feed(["a word"], n=2, order="natural") as feed,
        pytest.raises(ns.Error, match="expected real numbers"),
    ):
        feed.read(1)
    (tmp_path / "grows.txt").write_bytes(header())
    with ns.Feed(tmp_path / "grows.txt") as feed, pytest.raises(TimeoutError, match="no frame for 0.1 s"):
        next(feed.frames(timeout=0.1))
    with pytest.raises(ns.Error, match="the feed is closed"):
        next(feed.frames())


def get(url, path):
    address, _, token = url.partition("?")
    with urllib.request.urlopen(f"{address.rstrip('/')}{path}{'?' + token if token else ''}") as answer:
        return answer.read()


def state(url, want):
    until = time.monotonic() + 60
    while True:
        found = None
        # The page has no state before the first one.
        with contextlib.suppress(urllib.error.HTTPError):
            found = json.loads(get(url, "/api/state"))
            if want(found):
                return found
        assert time.monotonic() < until, found
        time.sleep(0.05)


def test_the_page_of_a_generator_shows_its_images_and_stays_after_the_last(tmp_path):
    daq = (block for seed in range(3) for block in np.split(volts(seed), 4))
    page = ns.serve(
        daq,
        n=N,
        order=ROWS,
        name="DMD 3",
        unit="V",
        method="hadamard",
        listen="127.0.0.1:0",
        record_to=tmp_path,
        wait=False,
    )
    with page:
        found = state(
            page.url, lambda state: state["camera"]["phase"] == "lost" and state["frames"]["received"] == 3
        )
        assert found["camera"]["feed"]["name"] == "DMD 3" and found["camera"]["leds"] == "none"
        state(page.url, lambda state: (state["picture"] or {}).get("frames") == 1)
        # The picture of an earlier frame may still be shown when the last frame has come.
        until = time.monotonic() + 60
        while not np.array_equal(np.load(io.BytesIO(get(page.url, "/image.npy"))).reshape(N, N), expected(2)):
            assert time.monotonic() < until, "the picture of the last frame did not come"
            time.sleep(0.1)
        assert page.failed is None and not page.closed
    assert page.closed and page.close() is None
    with pytest.raises(urllib.error.URLError):
        get(page.url, "/api/state")


def test_a_page_of_an_address_and_one_with_a_token():
    with sent(header(), volts().tobytes()) as address, ns.Feed(address) as feed:
        with ns.serve(feed, listen="127.0.0.1:0", token="0123456789abcdef", wait=False) as page:
            assert "token=0123456789abcdef" in page.url
            state(page.url, lambda state: state["frames"]["received"] == 1)
            with pytest.raises(urllib.error.HTTPError):
                urllib.request.urlopen(page.url.partition("?")[0])
        assert feed.closed


def test_a_page_that_cannot_be_is_refused_in_one_line(tmp_path):
    def told(error=ns.Error, source=(), **options):
        with pytest.raises(error) as raised:
            ns.serve(source, **{"n": 8, "order": "natural", "listen": "127.0.0.1:0", "wait": False} | options)
        text = str(raised.value)
        assert len(text.splitlines()) == 1, text
        return text

    assert "cannot listen there" in told(OSError, listen="nowhere:1")
    assert "expected 16 to 128" in told(token="short")
    assert "found no such folder" in told(record_to=tmp_path / "nothing")
    assert "sum is 100000, expected 1 to" in told(sum=100000)
    assert "sorcery" in told(method="sorcery")
    feed = ns.Feed([], n=8, order="natural")
    assert "n beside a Feed" in told(source=feed)
    feed.close()
    with pytest.raises(ns.Error, match="the feed is closed"):
        ns.serve(feed, listen="127.0.0.1:0", wait=False)


def test_a_generator_that_fails_leaves_its_error_with_the_page():
    def daq():
        yield volts()
        raise OSError("the DAQ is gone")

    with ns.serve(daq(), n=N, order=ROWS, listen="127.0.0.1:0", wait=False) as page:
        state(page.url, lambda state: state["camera"]["phase"] == "lost")
        assert str(page.failed) == "the DAQ is gone"


def code(page, nth):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), re.S | re.M)[nth]


def test_five_lines_of_the_page_show_a_generator_until_ctrl_c(tmp_path):
    lines = code(ROOT / "docs/feeds.md", 0)
    assert len([line for line in lines.splitlines() if line]) <= 5 and lines.count("nirspi.serve(") == 1
    # A simulated DAQ at the place of the driver, and a free port.
    made = "pairs = [2.5, 0.5] * (64 * 64)\ndef blocks():\n    while True:\n        yield pairs\ndaq = blocks()\n"
    script = made + lines.replace('unit="V"', 'unit="V", listen="127.0.0.1:0"')
    (tmp_path / "bench.py").write_text(script)
    run = interruptible([sys.executable, "bench.py"], tmp_path)
    try:
        url = re.match(r"open (http://\S+) to see DMD", run.stdout.readline())[1]
        state(url, lambda state: state["frames"]["received"] >= 3)
        run.send_signal(signal.SIGINT)
        out, err = run.communicate(timeout=60)
    finally:
        run.kill()
    assert run.returncode == 0 and err == "" and out.startswith("stopped: "), (out, err)


def test_the_images_of_the_page_about_feeds_are_made():
    lines = code(ROOT / "docs/feeds.md", 1)
    scene = np.add.outer(np.linspace(0, 1, 64) ** 2, np.linspace(0, 3, 64))
    y = ns.Hadamard(64, rows=ns.order("zig-zag", 64), split=True)(scene)
    names = {"daq": [y, y], "show": lambda image: shown.append(np.asarray(image))}
    shown = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exec(compile(lines, "docs/feeds.md", "exec"), names)
    assert len(shown) == 2 and np.corrcoef(shown[0].ravel(), scene.ravel())[0, 1] > 0.99


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_the_wait_for_a_header(tmp_path):
    (tmp_path / "log.txt").write_text("")
    script = "import nirspi\nprint('now', flush=True)\nnirspi.Feed('log.txt')\n"
    run = interruptible([sys.executable, "-c", script], tmp_path)
    try:
        run.stdout.readline()
        time.sleep(0.5)
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=20)
    finally:
        run.kill()
    assert run.returncode != 0 and "KeyboardInterrupt" in err, err
