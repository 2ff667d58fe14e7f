"""The notebooks of the book.

A page ``docs/notebook-NAME.md`` is the notebook: text and Python blocks are its cells. What follows a
Python block, a block of ``text`` and pictures of ``docs/notebooks/``, are the cell's outputs.
``docs/notebooks/NAME.ipynb`` is the same notebook without outputs, made from the page.
"""

import base64
import io
import json
import os
import re
import warnings

import numpy as np

from conftest import ROOT

DOCS = ROOT / "docs"
FOLDER = DOCS / "notebooks"
BLESS = os.environ.get("NIRSPI_BLESS") == "1"
CODE = re.compile(r"^```python\n(.*?)\n```\n", re.S | re.M)
OUTPUTS = re.compile(r"(?:\n```text\n(.*?)\n```\n)?((?:\n!\[[^\]]*\]\(notebooks/[\w.-]+\)\n)*)", re.S)
PICTURE = re.compile(r"!\[([^\]]*)\]\(notebooks/([\w.-]+)\)")
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# On another machine the last digit of a number may differ; the frame of a picture, by a pixel.
RELATIVE, ABSOLUTE, GREY = 0.02, 0.02, 0.04


class Cell:
    """A cell of a page, with the outputs that the page shows."""

    def __init__(self, kind, source, text=None, pictures=()):
        self.kind, self.source, self.text, self.pictures = kind, source, text, list(pictures)


def page(name):
    return DOCS / f"notebook-{name}.md"


def cells(text):
    """The cells of a page."""
    found, at = [], 0
    while code := CODE.search(text, at):
        if text[at : code.start()].strip():
            found.append(Cell("markdown", text[at : code.start()].strip()))
        outputs = OUTPUTS.match(text, code.end())
        found.append(Cell("code", code[1], outputs[1], PICTURE.findall(outputs[2])))
        at = outputs.end()
    if text[at:].strip():
        found.append(Cell("markdown", text[at:].strip()))
    return found


def markdown(made):
    """The page of these cells: the way back from :func:`cells`."""
    parts = []
    for cell in made:
        if cell.kind == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        if cell.text is not None:
            parts.append(f"```text\n{cell.text}\n```")
        parts.extend(f"![{caption}](notebooks/{file})" for caption, file in cell.pictures)
    return "\n\n".join(parts) + "\n"


def ipynb(text):
    """The notebook of a page, without outputs, as the text of its file."""
    made = []
    for number, cell in enumerate(cells(text)):
        source = cell.source
        if cell.kind == "markdown":
            # The page is in the folder above, and a paragraph is one line.
            source = re.sub(r"\]\((?![a-z]+:|#)", "](../", source)
        made.append(
            {
                "cell_type": cell.kind,
                "id": f"cell-{number}",
                "metadata": {},
                "source": source.splitlines(keepends=True),
            }
        )
        if cell.kind == "code":
            made[-1] |= {"execution_count": None, "outputs": []}
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": made,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def executed(text, folder):
    """The code cells of a page after they ran in this folder, by Jupyter: (text, pictures) of each."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.reads(ipynb(text), as_version=4)
    with warnings.catch_warnings():
        # Jupyter's own, under -X dev.
        warnings.simplefilter("ignore")
        NotebookClient(
            notebook, timeout=1200, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
        ).execute()
    return [outputs(cell) for cell in notebook.cells if cell.cell_type == "code"]


def outputs(cell):
    """What a cell printed, or None, and its pictures as PNG. Its stderr is left out."""
    lines, pictures = [], []
    for output in cell.outputs:
        data = output.get("data", {})
        if output.output_type == "stream" and output.name == "stdout":
            lines.append(output.text)
        elif "image/png" in data:
            pictures.append(base64.b64decode(data["image/png"]))
        elif "text/plain" in data:
            lines.append(data["text/plain"] + "\n")
    text = "\n".join(line.rstrip() for line in "".join(lines).strip("\n").split("\n"))
    return text or None, pictures


def same_text(shown, made):
    """Whether words are equal and numbers nearly so."""
    if shown is None or made is None:
        return shown == made
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(made.split())):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(made), strict=True)
    return all(abs(float(a) - float(b)) <= RELATIVE * abs(float(a)) + ABSOLUTE for a, b in pairs)


def same_picture(shown, made):
    """Whether two PNGs have about the same size and, in a grid of 16 x 16 fields, the same grey."""
    import matplotlib.image

    grids = []
    for png in (shown, made):
        pixels = matplotlib.image.imread(io.BytesIO(png))
        grey = pixels if pixels.ndim == 2 else pixels[..., :3].mean(-1)
        fields = [part for band in np.array_split(grey, 16) for part in np.array_split(band, 16, 1)]
        grids.append((np.asarray(grey.shape), np.asarray([field.mean() for field in fields])))
    (size, one), (other_size, other) = grids
    return bool((abs(size - other_size) <= 0.05 * size).all() and abs(one - other).max() <= GREY)


def check(name, folder):
    """Runs the notebook, and compares its outputs with those of the page, if the page shows any; with
    NIRSPI_BLESS=1, writes the page and its pictures."""
    text = page(name).read_text()
    found = cells(text)
    wrong = []
    codes = [cell for cell in found if cell.kind == "code"]
    for number, (cell, (made, pictures)) in enumerate(zip(codes, executed(text, folder), strict=True)):
        where = f"{page(name).name}, code block {number + 1}"
        if BLESS:
            cell.text = made
            captions = [caption for caption, _file in cell.pictures] + ["picture"] * len(pictures)
            files = [f"{name}-{number + 1}{'abcdefgh'[k] if k else ''}.png" for k in range(len(pictures))]
            cell.pictures = list(zip(captions, files, strict=False))
            for file, png in zip(files, pictures, strict=True):
                (FOLDER / file).write_bytes(png)
            continue
        if not same_text(cell.text, made):
            wrong.append(f"{where}: the page shows\n{cell.text}\nand the block printed\n{made}")
        if len(cell.pictures) != len(pictures):
            wrong.append(f"{where}: the page shows {len(cell.pictures)} pictures of {len(pictures)}")
            continue
        for (_caption, file), png in zip(cell.pictures, pictures, strict=True):
            if not same_picture((FOLDER / file).read_bytes(), png):
                (folder / file).write_bytes(png)
                wrong.append(f"{where}: {file} looks unlike the new {folder / file}")
    if BLESS:
        page(name).write_text(markdown(found))
    shows = any(cell.text or cell.pictures for cell in codes)
    assert BLESS or not shows or not wrong, (
        "\n".join(wrong) + "\nNIRSPI_BLESS=1 writes what a run made: look at it before you commit it"
    )
