"""The notebook that trains a network of deepinv runs."""

import pytest

from notebooks import check


def test_the_notebook_of_deepinv_runs(tmp_path):
    pytest.importorskip("nbclient")
    pytest.importorskip("deepinv")
    check("deepinv", tmp_path)
