"""What tests share: the command line's program, data of other groups, a scene."""

import os
import pathlib

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def cli():
    """The program `nirspi`: NIRSPI_CLI, or what a build has left under target/."""
    target = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    given = os.environ.get("NIRSPI_CLI")
    places = [given] if given else [target / "release/nirspi", target / "debug/nirspi"]
    for place in places:
        if pathlib.Path(place).exists():
            return str(place)
    pytest.skip("no program nirspi: cargo build --release, or NIRSPI_CLI")


@pytest.fixture(scope="session")
def data():
    """The folder of measurements of other groups."""
    folder = pathlib.Path(os.environ.get("NIRSPI_DATA", "")) / "spi"
    if not os.environ.get("NIRSPI_DATA") or not folder.is_dir():
        pytest.skip("no data")
    return folder


@pytest.fixture
def random():
    return np.random.default_rng(20261121)


def asymmetric(n, seed=7):
    """An image without any symmetry, so that a transposition or a mirror shows."""
    return np.random.default_rng(seed).random((n, n)) + np.linspace(0, 1, n)[:, None] ** 2
