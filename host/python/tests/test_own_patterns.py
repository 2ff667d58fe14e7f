"""The table of docs/own-patterns.md is what the methods make of simulated readings."""

import os
import re

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT

PAGE = ROOT / "docs/own-patterns.md"
BEGIN = "<!-- table: NIRSPI_BLESS=1 pytest host/python/tests/test_own_patterns.py -->"
END = "<!-- end of table -->"
METHODS = ["pseudo-inverse", "tikhonov", "fista", "tv", "omp"]
NOISE, SEED = 0.05, 1
# Another processor may choose a neighbouring strength.
RELATIVE, ABSOLUTE = 0.02, 0.006


def letter(n):
    """An F, of strokes an eighth of the picture wide."""
    scene, eighth = np.zeros((n, n)), n // 8
    scene[eighth : 7 * eighth, 2 * eighth : 3 * eighth] = 1
    for row, end in [(1, 6), (3, 5)]:
        scene[row * eighth : (row + 1) * eighth, 2 * eighth : end * eighth] = 1
    return scene


def blob_and_edge(n):
    """A Gaussian spot, and a dimmer half of the picture."""
    y, x = np.mgrid[:n, :n] / n
    return np.exp(-((x - 0.3) ** 2 + (y - 0.4) ** 2) / (2 * 0.1**2)) + 0.5 * (x > 0.7)


SCENES = [
    ("letter, 16 x 16", letter(16), 128),
    ("blob and edge, 16 x 16", blob_and_edge(16), 128),
    ("letter, 32 x 32", letter(32), 300),
]


def errors(scene, count):
    """The sum of squared errors by each method, from random patterns of zeros and ones."""
    random = np.random.default_rng(SEED)
    patterns = random.integers(0, 2, (count, *scene.shape)).astype(np.float32)
    y = np.tensordot(patterns, scene, 2) + NOISE * random.standard_normal(count)
    images = [ns.reconstruct(y, matrix=patterns, method=method) for method in METHODS]
    return [float(((np.asarray(image) - scene) ** 2).sum()) for image in images]


def cell(error, best):
    digits = 2 if error < 1 else 1 if error < 20 else 0
    text = f"{error:.{digits}f}"
    return f"**{text}**" if best else text


def table(rows):
    lines = [["scene", "patterns", *METHODS], ["--"] * (2 + len(METHODS))]
    for name, count, found in rows:
        lines.append([name, str(count), *(cell(error, error == min(found)) for error in found)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def numbers(text):
    return [float(one) for one in re.findall(r"(?<=\| )\**(\d+(?:\.\d+)?)\**(?= \|)", text)]


def test_the_table_of_methods_is_what_is_measured():
    text = PAGE.read_text()
    found = re.search(f"{re.escape(BEGIN)}\n\n(.*?)\n\n{re.escape(END)}", text, re.S)
    assert found, f"{BEGIN} in {PAGE}"
    made = table([(name, count, errors(scene, count)) for name, scene, count in SCENES])
    if os.environ.get("NIRSPI_BLESS") == "1":
        PAGE.write_text(text.replace(found[1], made))
        return
    said = "NIRSPI_BLESS=1 pytest host/python/tests/test_own_patterns.py writes it anew"
    assert re.sub(r"[\d.*]+", "", found[1]) == re.sub(r"[\d.*]+", "", made), said
    assert numbers(found[1]) == pytest.approx(numbers(made), rel=RELATIVE, abs=ABSOLUTE), said


def test_the_noise_of_the_table_is_the_pages():
    words = " ".join(PAGE.read_text().split())
    assert re.search(r"and a noise of ([\d.]+) in each reading", words)[1] == str(NOISE)
