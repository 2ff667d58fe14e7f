"""What a user reads whose machine has no torch, no deepinv and no SPyRiT."""

import sys

import pytest

import nirspi as ns


@pytest.mark.parametrize("name", ["deepinv", "spyrit"])
def test_a_missing_package_is_named_with_its_remedy(name, monkeypatch):
    for module in ("torch", name):
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "nirspi._deepinv", raising=False)
    with pytest.raises(ns.Error, match=rf"{name}\(\) needs {name} and torch: pip install {name}"):
        getattr(ns.Hadamard(8), name)()
