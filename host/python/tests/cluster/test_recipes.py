"""The Python code of docs/clusters.md runs, from top to bottom: one process, Ray."""

import re

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT

pytest.importorskip("ray")
pq = pytest.importorskip("pyarrow.parquet")


def test_the_code_of_the_page_runs_and_every_way_gives_the_same_rows(monkeypatch, tmp_path):
    import ray

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RAYON_NUM_THREADS", "1")
    (tmp_path / "archive").mkdir()
    random = np.random.default_rng(3)
    for k in range(100):
        ns.Measurement(d=random.normal(size=256), rows="natural", n=16).save(tmp_path / f"archive/{k:03}.npz")
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
    rows = pq.read_table("table.parquet").to_pylist()
    assert len(rows) == 100 and names["report"].rows == 100 and names["simulated"].rows == 8
    parts = sorted((tmp_path / "parts").glob("part-*.parquet"))
    assert [row for part in parts for row in pq.read_table(part).to_pylist()] == rows
