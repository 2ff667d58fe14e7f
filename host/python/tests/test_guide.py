"""The code of docs/python.md runs, from top to bottom."""

import importlib.util
import re

import pytest

from conftest import ROOT

NEEDS = ["torch", "deepinv", "spyrit", "scipy"]


def test_the_code_of_the_guide_runs(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs/python.md").read_text()
    blocks = list(re.finditer(r"```python\n(.*?)```", text, re.S))
    assert len(blocks) >= 9
    names, skipped, missing = {}, 0, {name for name in NEEDS if importlib.util.find_spec(name) is None}
    for block in blocks:
        if any(re.search(rf"\b{name}\b", block[1]) for name in missing):
            skipped += 1
            continue
        line = text[: block.start(1)].count("\n")
        exec(compile("\n" * line + block[1], "docs/python.md", "exec"), names)
    if skipped:
        pytest.skip(f"{skipped} of {len(blocks)} blocks need {', '.join(sorted(missing))}; the others ran")
