"""The notebooks of the book run, and the book shows what they print and draw."""

import pytest

import notebooks
from notebooks import DOCS, FOLDER, cells, check, ipynb, markdown, page, same_text

NAMES = sorted(path.stem.removeprefix("notebook-") for path in DOCS.glob("notebook-*.md"))
# tests/peers runs these: they need packages of gigabytes.
PEERS = {"deepinv"}


@pytest.fixture
def jupyter():
    for package in ("nbclient", "ipykernel", "matplotlib", "pyarrow", "xarray"):
        pytest.importorskip(package)


def test_every_notebook_is_tested():
    assert set(NAMES) == PEERS | {"dataset", "lesson", "measurements", "orders"}
    used = {file for name in NAMES for cell in cells(page(name).read_text()) for _, file in cell.pictures}
    there = {path.name for path in FOLDER.iterdir() if path.suffix != ".ipynb"}
    assert used == there
    assert sum((FOLDER / file).stat().st_size for file in used) < 1_000_000


@pytest.mark.parametrize("name", NAMES)
def test_the_ipynb_is_the_page(name):
    text = page(name).read_text()
    assert markdown(cells(text)) == text
    file = FOLDER / f"{name}.ipynb"
    if notebooks.BLESS:
        file.write_text(ipynb(text))
    assert file.read_text() == ipynb(text), "NIRSPI_BLESS=1 pytest host/python/tests/test_notebooks.py"


@pytest.mark.parametrize("name", [name for name in NAMES if name not in PEERS])
def test_a_notebook_prints_and_draws_what_the_page_shows(jupyter, name, tmp_path, monkeypatch):
    monkeypatch.delenv("NIRSPI_DATA", raising=False)
    check(name, tmp_path)


def test_the_notebook_of_measurements_runs_on_a_real_detectors_log(jupyter, data, tmp_path):
    printed = [
        text or "" for text, _pictures in notebooks.executed(page("measurements").read_text(), tmp_path)
    ]
    assert "opar_ala1.npz" in "".join(printed)


def test_numbers_may_differ_by_rounding_and_words_may_not():
    assert same_text("PSNR 21.30 dB", "PSNR  21.31 dB")
    assert not same_text("PSNR 21.3 dB", "PSNR 22.3 dB")
    assert not same_text("PSNR 21.3 dB", "SSIM 21.3 dB")
    assert not same_text(None, "1")
