"""Orders of patterns as deepinv and SPyRiT themselves make them, as rows of the natural-order Hadamard matrix.

    python host/patterns/scripts/orders_of_others.py           writes host/patterns/src/order/others.txt anew
    python host/patterns/scripts/orders_of_others.py --check   compares that file with the installed packages

Needs `pip install deepinv spyrit`, which bring PyTorch (5 GB). Nothing here knows our own orders: each pattern is made by
the package, and its row is read from its signs.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from deepinv.physics import SinglePixelCamera
from spyrit.core.meas import HadamSplit2d

SIDES = (8, 16, 32)
TABLE = Path(__file__).parent.parent / "src" / "order" / "others.txt"


def row_of(pattern):
    """Row of the Sylvester matrix of order n*n whose signs these are: bit b of it is the sign at pixel 2**b."""
    signs = np.sign(np.asarray(pattern).ravel())
    assert signs[0] == 1, "a row of the Sylvester matrix begins with +1"
    row = sum(1 << b for b in range(signs.size.bit_length() - 1) if signs[1 << b] < 0)
    pixels = np.arange(signs.size)
    parity = np.array([bin(row & p).count("1") % 2 for p in pixels])
    assert np.array_equal(signs, 1 - 2 * parity), "these are no signs of a Hadamard row"
    return row


def deepinv(ordering, n):
    """The pattern that each further measurement adds."""
    rows, before = [], torch.zeros(n, n)
    row_at = {}
    camera = SinglePixelCamera(m=1, img_size=(1, n, n), ordering=ordering)
    for m in range(1, n * n + 1):
        mask = SinglePixelCamera(m=m, img_size=(1, n, n), ordering=ordering).mask[0, 0]
        (at,) = torch.nonzero(mask - before).tolist()
        before = mask
        if tuple(at) not in row_at:
            one = torch.zeros(1, 1, n, n)
            one[0, 0, at[0], at[1]] = 1
            row_at[tuple(at)] = row_of(camera.V(one)[0, 0])
        rows.append(row_at[tuple(at)])
    return rows


def spyrit(n):
    """Patterns as they are measured without an order. `define_order` is left out: its ties are those of an unstable sort."""
    camera = HadamSplit2d(n)
    return [row_of(pattern) for pattern in camera.H.reshape(n * n, n, n)]


ORDERS = {
    "walsh-2d": spyrit,
    "deepinv:sequency": lambda n: deepinv("sequency", n),
    "deepinv:cake_cutting": lambda n: deepinv("cake_cutting", n),
    "deepinv:zig_zag": lambda n: deepinv("zig_zag", n),
    "deepinv:xy": lambda n: deepinv("xy", n),
}


def table():
    versions = ", ".join(f"{package} {version(package)}" for package in ("deepinv", "spyrit", "torch"))
    lines = [f"# made by host/patterns/scripts/orders_of_others.py from {versions}"]
    for name, rows in ORDERS.items():
        for n in SIDES:
            found = rows(n)
            assert sorted(found) == list(range(n * n)), f"{name} at {n}"
            lines.append(f"{name} {n}: {' '.join(map(str, found))}")
    return "\n".join(lines) + "\n"


def main():
    found = table()
    if "--check" not in sys.argv[1:]:
        TABLE.write_text(found)
        return
    expected = TABLE.read_text()
    wrong = [line.split(":")[0] for line, old in zip(found.splitlines()[1:], expected.splitlines()[1:]) if line != old]
    if wrong or found.count("\n") != expected.count("\n"):
        sys.exit(f"{TABLE}: not what the installed packages give: {', '.join(wrong) or 'other orders'}")
    print(f"{len(ORDERS)} orders at {len(SIDES)} sides are those of {found.splitlines()[0].split(' from ')[1]}")


if __name__ == "__main__":
    main()
