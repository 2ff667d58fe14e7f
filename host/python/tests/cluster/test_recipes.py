"""The Python code of docs/clusters.md runs, from top to bottom."""

import re

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT

pytest.importorskip("ray")
pq = pytest.importorskip("pyarrow.parquet")


def test_the_code_of_the_page_runs_and_makes_tables(monkeypatch, tmp_path):
    import ray

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RAYON_NUM_THREADS", "1")
    (tmp_path / "archive").mkdir()
    random = np.random.default_rng(3)
    for k in range(40):
        ns.Measurement(d=random.normal(size=256), rows="natural", n=16).save(tmp_path / f"archive/{k:03}.npz")
    (tmp_path / "archive/bad.npz").write_bytes(b"PK damaged")
    text = (ROOT / "docs/clusters.md").read_text()
    names = {"__name__": "__main__"}
    blocks = list(re.finditer(r"```python\n(.*?)```", text, re.S))
    assert len(blocks) == 2
    try:
        for block in blocks:
            line = text[: block.start(1)].count("\n")
            exec(compile("\n" * line + block[1], "docs/clusters.md", "exec"), names)
    finally:
        ray.shutdown()
    rows = pq.read_table("images.parquet").to_pylist()
    assert len(rows) == 40 and [one.item.name for one in names["failed"]] == ["bad.npz"]
    image = ns.reconstruct(ns.load("archive/007.npz"), method="omp", sampling="30%")
    assert np.asarray(rows[7]["image"], np.float32).tobytes() == np.asarray(image).tobytes()
    shots = [
        row for part in (tmp_path / "shots").glob("*.parquet") for row in pq.read_table(part).to_pylist()
    ]
    assert len(shots) == 8 and all(len(row["truth"]) == 1024 and len(row["d"]) == 102 for row in shots)
