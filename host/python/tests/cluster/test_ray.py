"""Archives and sweeps on a real cluster of two nodes of this machine: two `ray start`."""

import json
import os
import pathlib
import signal
import threading
import time

import numpy as np
import pytest

import nirspi as ns
import nirspi.ray

pytest.importorskip("ray")
pq = pytest.importorskip("pyarrow.parquet")

from nodes import two_nodes  # noqa: E402 - it needs Ray


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two nodes with one processor each."""
    with two_nodes(tmp_path_factory.mktemp("ray", numbered=True)) as second:
        yield second


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """200 measurement files, and three files that hold no measurement."""
    place = tmp_path_factory.mktemp("archive")
    random = np.random.default_rng(20261121)
    for k in range(200):
        d = random.normal(size=1024) + 200 * (np.arange(1024) < 1)
        ns.Measurement(d=d, rows="zig-zag", n=32).save(place / f"{k:03}.npz")
    for k in (17, 60, 150):
        (place / f"{k:03}.npz").write_bytes(b"PK damaged")
    return place


def joined(folder):
    parts = sorted(pathlib.Path(folder).glob("part-*.parquet"))
    return [row for part in parts for row in pq.read_table(part).to_pylist()]


def workers():
    """The processes of the workers that make parts."""
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().replace(b"\0", b" ")
        except OSError:
            continue
        if b"ray::MapWorker" in words:
            found.append(int(entry.name))
    return found


def test_the_cluster_gives_the_rows_of_one_process(cluster, archive, tmp_path):
    work = ns.Archive(archive, method="tikhonov", sampling="40%")
    alone = work.run(tmp_path / "alone.parquet")
    report = nirspi.ray.run(work, tmp_path / "parts", items=16)
    assert (report.rows, report.files) == (197, 200) == (alone.rows, alone.files)
    assert report.skipped == alone.skipped and len(report.skipped) == 3
    assert joined(tmp_path / "parts") == pq.read_table(tmp_path / "alone.parquet").to_pylist()
    again = nirspi.ray.run(work, tmp_path / "parts", items=16, resume=True)
    assert (again.rows, again.files_before, again.skipped) == (197, 200, alone.skipped)
    assert json.loads((tmp_path / "parts/report.json").read_text())["rows"] == 197


def test_a_killed_worker_loses_nothing_and_changes_nothing(cluster, archive, tmp_path):
    work = ns.Archive(archive, method="omp", sampling="40%")
    work.run(tmp_path / "alone.parquet")
    killed = []

    def kill():
        # After the first part is there, and long before the last.
        for _ in range(2000):
            if list((tmp_path / "parts").glob("part-*.parquet")) and workers():
                killed.append(workers()[0])
                os.kill(killed[0], signal.SIGKILL)
                return
            time.sleep(0.01)

    thread = threading.Thread(target=kill)
    thread.start()
    report = nirspi.ray.run(work, tmp_path / "parts", items=4)
    thread.join()
    assert killed, "no worker was there to kill"
    assert (report.rows, len(report.skipped)) == (197, 3)
    names = {path.name for path in (tmp_path / "parts").iterdir() if not path.name.startswith(".")}
    assert names == {f"part-{k:06}.parquet" for k in range(50)} | {"plan.json", "report.json"}
    assert joined(tmp_path / "parts") == pq.read_table(tmp_path / "alone.parquet").to_pylist()


def test_missing_parts_are_made_and_others_are_kept(cluster, archive, tmp_path):
    work = ns.Archive(archive, method="hadamard")
    out = tmp_path / "parts"
    nirspi.ray.run(work, out, items=50)
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in out.glob("part-*")}
    lost = out / "part-000002.parquet"
    lost.unlink()
    report = nirspi.ray.run(work, out, items=50, resume=True)
    assert (report.rows, report.files_before) == (197, 150)
    for path, (at, content) in before.items():
        assert path.read_bytes() == content and (path == lost or path.stat().st_mtime_ns == at)
    with pytest.raises(ns.Error, match="expected resume=True"):
        nirspi.ray.run(work, out, items=50)
    with pytest.raises(ns.Error, match="made with other items"):
        nirspi.ray.run(work, out, items=49, resume=True)
    with pytest.raises(ns.Error, match="made with other settings"):
        nirspi.ray.run(ns.Archive(archive, sampling=0.5), out, items=50, resume=True)
    with pytest.raises(ns.Error, match="made with other names"):
        nirspi.ray.run(ns.Archive([archive / "000.npz"], method="hadamard"), out, items=50, resume=True)


def test_a_sweep_gives_the_rows_of_one_process(cluster, tmp_path):
    sweep = ns.Sweep(
        weathers=["none", "heavy"], distances_m=[0.3, 0.6], samplings=0.1, seeds=range(3), frames=4
    )
    sweep.run(tmp_path / "alone.parquet")
    report = nirspi.ray.run(sweep, tmp_path / "parts", items=2)
    assert report.rows == 12
    assert joined(tmp_path / "parts") == pq.read_table(tmp_path / "alone.parquet").to_pylist()


def test_a_store_by_its_address(cluster, archive, tmp_path):
    work = ns.Archive(archive, method="hadamard")
    report = nirspi.ray.run(work, f"file://{tmp_path}/parts", items=100)
    assert report.rows == len(joined(tmp_path / "parts")) == 197


def test_failures_of_the_cluster_are_errors_in_one_line(cluster, archive, tmp_path, monkeypatch):
    work = ns.Archive(archive)
    monkeypatch.setattr(nirspi.ray, "__version__", "9.9")
    with pytest.raises(ns.Error, match=r"expected 9\.9: install the same package") as error:
        nirspi.ray.run(work, tmp_path / "other")
    assert "\n" not in str(error.value) and not (tmp_path / "other").exists()
    # A worker on a node that came after the nodes were asked.
    with pytest.raises(ns.Error, match=r"nirspi 9\.9 on node .*, expected 8\.8: install the same package"):
        nirspi.ray._Worker(work, str(tmp_path / "other"), "8.8", False)
    for wrong, told in [
        (lambda: nirspi.ray.run("archive/", tmp_path / "x"), "expected nirspi.Archive"),
        (lambda: nirspi.ray.run(work, tmp_path / "x", items=0), "items is 0"),
        (lambda: nirspi.ray.run(work, tmp_path / "x", workers=0), "workers is 0"),
    ]:
        with pytest.raises(ns.Error, match=told):
            wrong()
