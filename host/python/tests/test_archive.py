"""Tables of archives and sets: the bytes of the program's, and what is refused."""

import json
import pickle
import subprocess

import numpy as np
import pytest

import nirspi as ns


@pytest.fixture
def folder(tmp_path, random):
    """Six good files with seven measurements, one damaged file, and one without a measurement."""
    place = tmp_path / "archive"
    (place / "b").mkdir(parents=True)
    for k in range(5):
        d = random.normal(size=256)
        ns.Measurement(d=d, rows="cake-cutting", n=16).save(place / f"b/{k}.npz")
    ns.Measurement(d=random.normal(size=(2, 64)), rows="zig-zag", n=8).save(place / "two.npz")
    (place / "a.npz").write_bytes(b"PK no archive")
    (place / "notes.md").write_text("none")
    return place


def rows_of(table):
    pq = pytest.importorskip("pyarrow.parquet")
    return pq.read_table(table).to_pylist()


def test_the_table_has_the_programs_bytes(cli, folder, tmp_path):
    options = ["--method", "omp", "--sampling", "50%", "--jobs", "2", "--out", tmp_path / "cli.parquet"]
    ran = subprocess.run(
        [cli, "reconstruct", folder, *map(str, options), "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert "1 of 7 files gave no image and have no row" in ran.stderr
    report = ns.Archive(folder, method="omp", sampling="50%").run(tmp_path / "ours.parquet", jobs=1)
    assert (tmp_path / "ours.parquet").read_bytes() == (tmp_path / "cli.parquet").read_bytes()
    told = json.loads(ran.stdout)
    assert (report.rows, report.files, report.skipped) == (told["rows"], told["files"], told["skipped"])
    assert report.rows == 7 and [one["file"] for one in report.skipped] == ["a.npz"]


def test_a_row_is_what_reconstruct_gives(folder, tmp_path):
    # Of all patterns, the image is the same with any strength.
    ns.Archive(folder, sampling="50%", method="tikhonov").run(tmp_path / "t.parquet")
    rows = rows_of(tmp_path / "t.parquet")
    assert [row["image_id"] for row in rows] == [f"b/{k}.npz" for k in range(5)] + ["two.npz#0", "two.npz#1"]
    for row in rows:
        m = ns.load(folder / row["file"], index="all")
        image = ns.reconstruct(m, sampling="50%", method="tikhonov")[row["index"]]
        assert np.asarray(row["image"], np.float32).tobytes() == np.asarray(image).tobytes()
        assert row["d"] == m.d[row["index"]].tolist() and row["rows"] == m.rows.tolist()
        assert row["n"] == m.n and row["simulated"] is None and row["truth"] is None
        assert json.loads(row["meta"])["reconstruction"]["report"]["method"] == "tikhonov"


def test_a_list_of_files_and_parts(folder, tmp_path):
    files = [folder / "two.npz", folder / "b/3.npz", folder / "gone.npz"]
    work = ns.Archive(files, method="hadamard")
    assert work.names == ["two.npz", "b/3.npz", "gone.npz"]
    copied = pickle.loads(pickle.dumps(work))
    for k, one in enumerate([work, copied]):
        report = one.part(tmp_path / f"{k}.parquet", 1, 3)
        assert (report.rows, report.files) == (1, 2)
        assert "no such file" in report.skipped[0]["reason"]
    assert (tmp_path / "0.parquet").read_bytes() == (tmp_path / "1.parquet").read_bytes()
    assert [row["file"] for row in rows_of(tmp_path / "0.parquet")] == ["b/3.npz"]


def test_recordings_are_one_row_or_one_a_frame(tmp_path):
    (tmp_path / "r").mkdir()
    with ns.Camera("virtual", sampling=0.1) as camera:
        camera.record(tmp_path / "r/rec.mcap", frames=5)
    ns.Archive(tmp_path / "r").run(tmp_path / "sum.parquet")
    ns.Archive(tmp_path / "r", index="all").run(tmp_path / "all.parquet")
    (one,), frames = rows_of(tmp_path / "sum.parquet"), rows_of(tmp_path / "all.parquet")
    assert len(frames) == 5 and [row["sequence"] for row in frames] == list(range(5))
    assert one["simulated"] and one["board"] == "virtual" and one["time"] is None
    assert np.allclose(one["d"], np.mean([row["d"] for row in frames], axis=0))


def test_enhanced_images_are_those_of_enhance(tmp_path):
    (tmp_path / "r").mkdir()
    with ns.Camera("virtual", sampling=0.5) as camera:
        camera.capture(50).save(tmp_path / "r/m.npz")
    ns.Archive(tmp_path / "r", enhance=True).run(tmp_path / "t.parquet")
    (row,) = rows_of(tmp_path / "t.parquet")
    sharp = ns.enhance(ns.reconstruct(ns.load(tmp_path / "r/m.npz")))
    assert np.asarray(row["enhanced"], np.float32).tobytes() == np.asarray(sharp).tobytes()
    assert json.loads(row["meta"])["enhancement"]["warnings"] == sharp.warnings


def test_a_sweep_is_measured_and_has_a_card(tmp_path):
    sweep = ns.Sweep(weathers=["none", "heavy"], orders=["zig-zag", "cake-cutting"], samplings=0.1, frames=4)
    report = sweep.run(tmp_path / "set.parquet", jobs=2)
    assert report.rows == 4 and not report.skipped
    card = (tmp_path / "set.md").read_text()
    assert "**simulated**" in card and "zig-zag, cake-cutting" in card and "none, heavy" in card
    rows = rows_of(tmp_path / "set.parquet")
    assert [row["image_id"] for row in rows] == sweep.names
    assert all(row["simulated"] and len(row["truth"]) == 1024 and len(row["d"]) == 102 for row in rows)
    alone = ns.Sweep(weathers="heavy", orders="zig-zag", samplings=0.1, frames=4)
    alone.run(tmp_path / "one.parquet")
    (one,) = rows_of(tmp_path / "one.parquet")
    assert one == rows[2]
    assert 0 < json.loads(one["meta"])["quality"]["correlation"] <= 1


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda p: ns.Archive(p / "none"), "expected a folder"),
        (lambda p: ns.Archive([]), "no file, expected at least one"),
        (lambda p: ns.Archive([p / "a", p / "a"]), "stands twice"),
        (lambda p: ns.Archive(p), "no measurement files in the folder"),
        (lambda p: ns.Archive([p / "a"], how="omp"), "unknown option 'how'"),
        (lambda p: ns.Archive([p / "a"], method="magic"), "magic"),
        (lambda p: ns.Archive([p / "a"], sparsity=3), "sparsity belongs to"),
        (lambda p: ns.Archive([p / "a"], dictionary=np.zeros(3)), "expected the path"),
        (lambda p: ns.Archive([p / "a"]).run(p / "t.csv"), "ends in .parquet"),
        (lambda p: ns.Archive([p / "a"]).run(p / "t.parquet", shard="3/2"), 'shard is "3/2"'),
        (lambda p: ns.Archive([p / "a"]).run(p / "t.parquet", jobs=0), "jobs is 0"),
        (
            lambda p: ns.Archive([p / "a"]).part(p / "t.parquet", 0, 2),
            "items 0 to 2, expected a part of 0 to 1",
        ),
        (lambda p: ns.Sweep(scenes=[]), "no scene, expected at least one"),
        (lambda p: ns.Sweep(seeds=[1, 1]), "seed 1 stands twice"),
        (lambda p: ns.Sweep(weathers="snow"), "snow"),
        (lambda p: ns.Sweep(distances_m=float("nan")), "distance NaN"),
        (lambda p: ns.Sweep(orders="backwards"), "backwards"),
        (lambda p: ns.Sweep(seeds=-1), "seed -1"),
        (lambda p: ns.Sweep(seeds="x"), "an axis of the sweep"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, wrong, told):
    with pytest.raises(ns.Error) as error:
        wrong(tmp_path)
    assert told in str(error.value) and "\n" not in str(error.value)


def test_an_interrupted_run_is_never_overwritten(folder, tmp_path):
    out = tmp_path / "t.parquet"
    ns.Archive(folder).run(out)
    (tmp_path / "t.parquet.parts").mkdir()
    (tmp_path / "t.parquet.parts/list.jsonl").write_text("{}\n")
    with pytest.raises(ns.Error, match="an earlier run was interrupted"):
        ns.Archive(folder).run(out)
    with pytest.raises(ns.Error, match="is damaged"):
        ns.Archive(folder).run(out, resume=True)


def test_without_ray_the_refusal_says_what_to_install(monkeypatch, folder, tmp_path):
    import sys

    pytest.importorskip("pyarrow")
    import nirspi.ray

    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ns.Error, match=r"pip install 'ray\[data\]'"):
        nirspi.ray.run(ns.Archive(folder), tmp_path / "out")
