"""The examples of every docstring run."""

import doctest
import importlib
import inspect
import pkgutil

import pytest

import nirspi

# Modules that need a package which is not installed with nirspi.
PEERS = {"nirspi._torch", "nirspi._deepinv", "nirspi._spyrit", "nirspi.ray"}
MODULES = ["nirspi"] + [
    found.name
    for found in pkgutil.iter_modules(nirspi.__path__, "nirspi.")
    if found.name not in PEERS and not found.name.endswith("_nirspi")
]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_docstrings_run(name):
    if name == "nirspi.hadamard":
        pytest.importorskip("scipy")
    module = importlib.import_module(name)
    assert doctest.testmod(module).failed == 0


def test_every_public_name_has_a_docstring_and_functions_have_an_example():
    for name in nirspi.__all__:
        found = getattr(nirspi, name)
        assert inspect.getdoc(found), name
        members = [found]
        if inspect.ismodule(found):
            members = [
                f
                for n, f in vars(found).items()
                if inspect.isfunction(f) and n[0] != "_" and f.__module__ == found.__name__
            ]
        for member in members:
            if inspect.isfunction(member):
                assert ">>>" in inspect.getdoc(member), member


def test_what_is_told_in_the_readme_runs(monkeypatch, tmp_path):
    import pathlib
    import re

    monkeypatch.chdir(tmp_path)
    text = (pathlib.Path(__file__).resolve().parents[1] / "README.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    exec(compile(code, "README.md", "exec"), {})
