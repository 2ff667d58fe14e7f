"""The reference of the package is what its docstrings say."""

import os
import sys
from pathlib import Path

import nirspi

sys.path.insert(0, str(Path(__file__).parents[1]))
import reference  # noqa: E402


def test_the_page_is_that_of_the_docstrings():
    made = reference.page()
    if os.environ.get("NIRSPI_BLESS"):
        reference.PAGE.write_text(made)
    assert reference.PAGE.read_text() == made, "python3 host/python/reference.py"


def test_every_public_name_is_there_with_a_text():
    headings = reference.page().split("\n## ")[1:]
    said = {heading.split("`")[1]: heading.partition("\n")[2].strip() for heading in headings}
    assert sorted(said) == sorted(nirspi.__all__)
    assert all(said.values()), [name for name, text in said.items() if not text]
