"""Sums a table of `ncu --csv --page raw` by kernel and size of its grid, the longest first.

usage: kernels.py TABLE.csv
"""
import collections
import csv
import sys


def number(text):
    return float(text.replace(",", "")) if text else 0.0


def main():
    with open(sys.argv[1]) as file:
        # ncu's own lines come first.
        rows = list(csv.DictReader(line for line in file if line.startswith('"')))
    # The first row holds the units.
    units, rows = rows[0], rows[1:]
    time = "gpu__time_duration.sum"
    to_ms = {"ns": 1e-6, "us": 1e-3, "usecond": 1e-3, "nsecond": 1e-6, "ms": 1.0, "msecond": 1.0}[units[time]]
    shares = [name for name in rows[0] if ".avg." in name and name.endswith("_active")]
    kinds = collections.defaultdict(list)
    for row in rows:
        kinds[row["Kernel Name"], row["Grid Size"], row["Block Size"]].append(row)
    of = lambda rows, name: sum(number(row[name]) for row in rows)
    whole = of(rows, time)
    print("     ms  share  launches  us each  kernel, grid, block", *shares, sep="; ")
    for kind, rows in sorted(kinds.items(), key=lambda kind: -of(kind[1], time)):
        ms = of(rows, time) * to_ms
        mean = [f"{of(rows, name) / len(rows):5.1f}" for name in shares]
        share = 100 * of(rows, time) / whole
        print(f"{ms:7.3f} {share:5.1f}% {len(rows):9} {1e3 * ms / len(rows):8.1f}  {' '.join(kind)}", *mean)


main()
