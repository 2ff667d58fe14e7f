"""A cluster of which one node has Ray and no nirspi: an environment of its own, for real."""

import os
import pathlib
import subprocess
import sys
import sysconfig
import threading
import venv

import numpy as np
import pytest

import nirspi as ns
import nirspi.ray

pytest.importorskip("ray")

from nodes import alive, stop, two_nodes  # noqa: E402 - it needs Ray

# Far more than the run takes: a longer one hangs.
LONGEST_S = 240


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """The interpreter of an environment with the packages of this one, but nirspi."""
    place = tmp_path_factory.mktemp("bare") / "environment"
    try:
        venv.create(place, symlinks=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no second environment can be made here: {error}")
    python = place / "bin" / "python"
    of = {"base": str(place), "platbase": str(place)}
    for kind in ("purelib", "platlib"):
        there = pathlib.Path(sysconfig.get_path(kind, vars=of))
        there.mkdir(parents=True, exist_ok=True)
        for entry in os.scandir(sysconfig.get_path(kind)):
            # An editable package is a file of this name that leads to its sources.
            if not entry.name.startswith("nirspi") and not (there / entry.name).exists():
                (there / entry.name).symlink_to(entry.path)
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    asked = [str(python), "-c", "import ray.data, numpy, pyarrow; import nirspi"]
    told = subprocess.run(asked, env=clean, cwd=place, capture_output=True, text=True).stderr.strip()
    if not told.endswith("No module named 'nirspi'"):
        pytest.skip(f"no second environment with Ray and without nirspi can be made here: {told[-300:]}")
    return python


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    place = tmp_path_factory.mktemp("archive")
    random = np.random.default_rng(20261123)
    for k in range(24):
        ns.Measurement(d=random.normal(size=256), rows="zig-zag", n=16).save(place / f"{k:03}.npz")
    return sorted(place.glob("*.npz"))


def image(path):
    return np.asarray(ns.reconstruct(ns.load(path), method="hadamard"))


def told_by(work):
    """The exception of `work`, which must end."""
    found = []

    def run():
        try:
            found.append(work())
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(LONGEST_S)
    assert not thread.is_alive(), f"no end after {LONGEST_S} s"
    return found[0]


def test_a_node_without_the_package_is_named_before_anything_is_made(bare, files, tmp_path):
    def noted(path):
        (tmp_path / f"{path.name}.begun").touch()
        return image(path)

    with two_nodes(tmp_path, second=bare) as second:
        error = told_by(lambda: list(nirspi.ray.map(noted, files, workers=2, batch=4)))
        assert isinstance(error, ns.Error), error
        text = str(error)
        assert f"{bare} has no nirspi (ModuleNotFoundError: No module named 'nirspi')" in text, text
        assert text.endswith(f"expected {ns.__version__}: install the same package on every node"), text
        # The node that has the package is not named, and the text is one line.
        assert text.count("node ") == 1 and sys.executable not in text and "\n" not in text, text
        assert not list(tmp_path.glob("*.begun"))

        stop(second)
        for _ in range(LONGEST_S):
            if len(alive()) == 1:
                break
            threading.Event().wait(1)
        found = told_by(lambda: list(nirspi.ray.map(noted, files, workers=1, batch=4)))
    assert [one.value.tobytes() for one in found] == [image(path).tobytes() for path in files]
