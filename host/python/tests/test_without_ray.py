"""nirspi.ray where there is no Ray, and what it refuses before it asks for one."""

import sys

import pytest

import nirspi as ns
import nirspi.ray


def test_without_ray_the_refusal_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ns.Error, match=r"pip install 'ray\[data\]'"):
        nirspi.ray.map(ns.load, ["a.npz"])


@pytest.mark.parametrize(("wrong", "told"), [({"batch": 0}, "batch is 0"), ({"workers": 0}, "workers is 0")])
def test_numbers_out_of_range_are_refused(wrong, told):
    with pytest.raises(ns.Error, match=f"{told}, expected at least 1"):
        nirspi.ray.map(ns.load, ["a.npz"], **wrong)
