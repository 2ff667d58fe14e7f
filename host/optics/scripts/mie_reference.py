#!/usr/bin/env python3
"""Holds our Mie solver against two codes that others wrote, miepython and scattnlay (both from PyPI).

    pip install miepython==3.3.0 scattnlay==2.4
    cargo build -p nirspi-optics --example mie_table
    python3 host/optics/scripts/mie_reference.py target/debug/examples/mie_table          # compares, exit code 1 if off
    python3 host/optics/scripts/mie_reference.py --write host/optics/tests/data/mie_reference.csv

Agreement asked for: 1e-6 up to x = 12 000, with the exceptions in `tolerance`. Of what, is said in MEASURES:
quantities that fall to nothing (absorption of clear water, backscatter, side lobes) are measured against what they are a
part of, because both codes get them by subtraction.
PyMieScatt 1.8.1.1 is not used: it does not import with SciPy 1.14 or later, and with that mended its own errors are 1e-5
to 1e-3 in these numbers for x of 100 to 12 000.
"""

import csv
import subprocess
import sys

import miepython
import numpy as np
from scattnlay import scattnlay



def tolerance(code, name, x):
    """A millionth, but for what the other code itself does not hold."""
    if code == "miepython" and name in ("q_back", "p_180"):
        return 1e-4  # its series ends at Wiscombe's term, 1e-5 too early straight back; scattnlay judges these
    return 1e-6 if x <= 12000 else 2e-5  # beyond, rounding moves resonances by more


COSINES = np.array([1.0, 0.0, -1.0])
NAMES = ["q_ext", "q_sca", "q_abs", "q_back", "g", "p_0", "p_90", "p_180"]
# Index into NAMES -> what the error is relative to, given the reference row.
MEASURES = {
    "q_ext": lambda r: abs(r[0]),
    "q_sca": lambda r: abs(r[1]),
    "q_abs": lambda r: abs(r[0]),
    "q_back": lambda r: max(r[3], r[1]),
    "g": lambda r: max(abs(r[4]), 1e-2),
    "p_0": lambda r: abs(r[5]),
    "p_90": lambda r: max(r[6], 1.0),
    "p_180": lambda r: max(r[7], 1.0),
}
SIZES = [0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.3, 1.7, 2.3, 3.0, 5.2, 8.0, 13.0, 20.0, 35.0, 57.0, 100.0, 170.0,
         300.0, 520.0, 900.0, 1500.0, 12000.0]
LARGE_SIZES = [2300.0, 3400.0, 5000.0, 7000.0, 9500.0, 20000.0, 63000.0]  # of water alone: they take seconds each
WATER = [  # from violet to 2 um
    1.339 + 1.86e-9j, 1.3355 + 1e-9j, 1.3330 + 1.96e-9j, 1.3290 + 2.93e-7j, 1.3273 + 2.89e-6j, 1.3240 + 9.89e-6j,
    1.3180 + 1.35e-4j, 1.3060 + 1.1e-3j,
]
INDICES = WATER + [  # no absorption, more of it, glass, a bubble, a metal
    1.33 + 0.0j, 1.33 + 0.01j, 1.33 + 0.1j, 1.142 + 0.115j, 1.5 + 0.0j, 1.5 + 0.1j,
    1.5 + 1.0j, 1.05 + 1e-4j, 0.75 + 0.0j, 2.0 + 1e-3j, 8.88 + 0.63j, 0.6 + 5.0j,
]
# For the committed table: enough to notice any mistake, few enough to read.
TABLE_SIZES = [0.01, 0.3, 1.0, 5.2, 20.0, 100.0, 520.0, 2300.0, 5000.0, 12000.0, 50000.0]
TABLE_INDICES = [1.3330 + 1.96e-9j, 1.3290 + 2.93e-7j, 1.3180 + 1.35e-4j, 1.33 + 0.1j, 1.5 + 0.0j, 8.88 + 0.63j]


def by_miepython(x, m):
    q_ext, q_sca, q_back, g = miepython.efficiencies_mx(np.conj(m), x)
    phase = miepython.i_unpolarized(np.conj(m), x, COSINES, norm="4pi")
    return [q_ext, q_sca, q_ext - q_sca, q_back, g, *phase]


def by_scattnlay(x, m):
    # It guesses its number of terms too low to be exact and is given ours.
    terms = int(np.ceil(x + 6 * x ** (1 / 3) + 3))
    result = scattnlay(np.array([[x]]), np.array([[m]], dtype=complex), nmax=terms)
    q_ext, q_sca, q_abs, q_back, _, g = (np.ravel(part)[0] for part in result[1:7])
    # Its angles take quadratic time: 15 s a sphere. Straight back is known without.
    return [q_ext, q_sca, q_abs, q_back, g, np.nan, np.nan, q_back / q_sca]


CODES = {"miepython": by_miepython, "scattnlay": by_scattnlay}


def write(path):
    with open(path, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        file.write(f"# miepython {miepython.__version__} and scattnlay 2.4, by ")
        file.write("host/optics/scripts/mie_reference.py --write\n")
        out.writerow(["code", "x", "n", "k", *NAMES])
        for m in TABLE_INDICES:
            for x in TABLE_SIZES:
                for code, solve in CODES.items():
                    out.writerow([code, x, m.real, m.imag, *(f"{value:.10e}" for value in solve(x, m))])


def compare(program):
    points = [(x, m) for m in INDICES for x in SIZES] + [(x, m) for m in WATER for x in LARGE_SIZES]
    lines = "".join(f"{x!r} {m.real!r} {m.imag!r}\n" for x, m in points)
    answer = subprocess.run([program], input=lines, capture_output=True, text=True, check=True).stdout
    ours = [[float(field) for field in line.split()] for line in answer.splitlines()]
    assert len(ours) == len(points), f"{len(ours)} answers to {len(points)} questions"
    failed = 0
    for code, solve in CODES.items():
        worst = dict.fromkeys(NAMES, (0.0, None))
        for (x, m), found in zip(points, ours):
            reference = solve(x, m)
            for k, name in enumerate(NAMES):
                if np.isnan(reference[k]):
                    continue
                error = abs(found[k] - reference[k]) / MEASURES[name](reference)
                if not error <= worst[name][0]:
                    worst[name] = (error, (x, m))
                if not error <= tolerance(code, name, x):
                    failed += 1
                    print(f"{code}: {name} at x = {x}, m = {m}: {found[k]!r} against {reference[k]!r}")
        print(f"{code}, {len(points)} points, worst: "
              + "  ".join(f"{name} {error:.1e}" for name, (error, _) in worst.items()))
    return failed


if __name__ == "__main__":
    if sys.argv[1:2] == ["--write"]:
        write(sys.argv[2])
    else:
        sys.exit(1 if compare(sys.argv[1]) else 0)
