"""Files and seeds on a real cluster of two nodes of this machine: two `ray start`."""

import os
import pathlib
import signal
import threading
import time

import numpy as np
import pytest

import nirspi as ns
import nirspi.ray

ray = pytest.importorskip("ray")

from nodes import two_nodes  # noqa: E402 - it needs Ray


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two nodes with one processor each."""
    with two_nodes(tmp_path_factory.mktemp("ray", numbered=True)) as second:
        yield second


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """200 measurement files, and three files that hold no measurement."""
    place = tmp_path_factory.mktemp("archive")
    random = np.random.default_rng(20261121)
    for k in range(200):
        d = random.normal(size=1024) + 200 * (np.arange(1024) < 1)
        ns.Measurement(d=d, rows="zig-zag", n=32).save(place / f"{k:03}.npz")
    for k in (17, 60, 150):
        (place / f"{k:03}.npz").write_bytes(b"PK damaged")
    return sorted(place.glob("*.npz"))


def image(path):
    return np.asarray(ns.reconstruct(ns.load(path), method="omp", sampling="40%"))


def alone(path):
    """What one process makes of a file."""
    try:
        return image(path)
    except ns.Error:
        return None


def same(found, expected):
    return all(
        (one.value is None and made is None) or one.value.tobytes() == made.tobytes()
        for one, made in zip(found, expected, strict=True)
    )


def workers():
    """The processes of the workers that make images."""
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().replace(b"\0", b" ")
        except OSError:
            continue
        if b"ray::_work" in words:
            found.append(int(entry.name))
    return found


def test_two_nodes_give_what_one_process_gives_in_the_order_of_the_items(cluster, files):
    def image_and_node(path):
        return ray.get_runtime_context().get_node_id(), image(path)

    found = list(nirspi.ray.map(image_and_node, files, batch=4))
    assert [one.item for one in found] == files
    nodes = {one.value[0] for one in found if one.value}
    assert len(nodes) == 2, nodes
    images = [nirspi.ray.Mapped(one.item, one.value and one.value[1]) for one in found]
    assert same(images, [alone(path) for path in files])
    failed = [one for one in found if one.error]
    assert [one.item.name for one in failed] == ["017.npz", "060.npz", "150.npz"]
    for one in failed:
        assert one.value is None and one.item.name in one.error and "\n" not in one.error


def test_a_killed_worker_loses_nothing_and_changes_nothing(cluster, files):
    killed = []

    def kill():
        for _ in range(2000):
            if there := workers():
                killed.append(there[0])
                os.kill(there[0], signal.SIGKILL)
                return
            time.sleep(0.01)

    found = nirspi.ray.map(image, files, batch=4)
    first = next(found)
    # After the first batch is there, and long before the last.
    thread = threading.Thread(target=kill)
    thread.start()
    found = [first, *found]
    thread.join()
    assert killed, "no worker was there to kill"
    assert [one.item for one in found] == files
    assert same(found, [alone(path) for path in files])


def test_seeds_give_the_measurements_of_one_process(cluster):
    def shot(seed):
        with ns.Camera("virtual", sampling=0.1, weather="heavy", seed=seed) as camera:
            return {"d": camera.capture(4).d, "truth": camera.truth}

    found = list(nirspi.ray.map(shot, range(1, 7), batch=2))
    for one in found:
        expected = shot(one.item)
        assert (one.value["d"] == expected["d"]).all() and (one.value["truth"] == expected["truth"]).all()
    assert not (found[0].value["d"] == found[1].value["d"]).all()


def test_failures_of_the_cluster_are_errors_in_one_line(cluster, files, monkeypatch):
    def typo(path):
        return path.nowhere

    with pytest.raises(ns.Error, match="the cluster failed: .*nowhere") as error:
        list(nirspi.ray.map(typo, files[:2]))
    assert "\n" not in str(error.value)
    monkeypatch.setattr(nirspi.ray, "__version__", "9.9")
    with pytest.raises(ns.Error, match=r"expected 9\.9: install the same package") as error:
        nirspi.ray.map(image, files)
    assert "\n" not in str(error.value)
    # A worker on a node that came after the nodes were asked.
    with pytest.raises(ns.Error, match=r"nirspi 9\.9 on node .*, expected 8\.8: install the same package"):
        nirspi.ray._work(image, files, "8.8")
