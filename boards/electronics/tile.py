#!/usr/bin/env python3
"""The 8 x 8 tile of the LED array as a netlist (SKiDL, parts defined here): electrical rules, law of light, parts list.

    python3 boards/electronics/tile.py           # check; exit 1 if a rule is broken or a written file is stale
    python3 boards/electronics/tile.py --write   # also write tile.net.txt and bom.csv

Computed, never built. target/electronics/tile.net is the netlist in KiCad's format.
The checks test themselves: faults are made in the netlist, one at a time, and each must be seen.
"""

import argparse
import contextlib
import csv
import io
import itertools
import logging
import os
import sys
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "target" / "electronics"
OUT.mkdir(parents=True, exist_ok=True)
# SKiDL writes its logs where it runs.
os.chdir(OUT)
with contextlib.redirect_stderr(io.StringIO()):
    from skidl import POWER, SKIDL, TEMPLATE, Circuit, Net, Part, Pin

from parts import LOGIC, PARTS, Kind  # noqa: E402

SIDE = 8
# Inputs that one output may drive through its series resistor; row.cir computes eight, and one for the one-shot.
FAN_OUT = 9
FAULTS = ("open row", "two outputs joined", "row and column swapped", "no capacitor", "too many inputs",
          "enable not used", "no supply", "LED turned round")


def template(kind: Kind) -> Part:
    pins = [Pin(num=number, name=name, func=getattr(Pin.types, function)) for number, name, function in kind.pins]
    return Part(name=kind.order_code, tool=SKIDL, dest=TEMPLATE, ref_prefix=kind.prefix, pins=pins,
                footprint=kind.footprint, value=kind.value, tag=kind.order_code)


class Tile:
    """One tile with its control: built, so that it can be built wrong on purpose."""

    def __init__(self, fault: str = "") -> None:
        self.fault = fault
        self.circuit = Circuit()
        self.kinds: dict[str, str] = {}
        self.counts: Counter[str] = Counter()
        self.templates = {name: template(kind) for name, kind in PARTS.items()}
        self.high, self.ground, self.led_supply = self.net("3V3"), self.net("GND"), self.net("VLED")
        for rail in (self.high, self.ground, self.led_supply):
            rail.drive = POWER
        rows = [self.net(f"ROW{i}") for i in range(SIDE)]
        columns = [self.net(f"COLUMN{i}") for i in range(SIDE)]
        self.connectors(rows, columns)
        enable, dark = self.control(rows, columns)
        self.pixels(self.buffers("and", rows, enable, "ROW"), self.buffers("nor", columns, dark, "COLUMN_NOT"))

    def net(self, name: str) -> Net:
        return Net(name, circuit=self.circuit)

    def part(self, name: str) -> Part:
        prefix = PARTS[name].prefix
        self.counts[prefix] += 1
        reference = f"{prefix}{self.counts[prefix]}"
        self.kinds[reference] = name
        part = self.templates[name](circuit=self.circuit, ref=reference, tag=reference)
        return part

    def logic(self, name: str) -> Part:
        """A logic package with its supply and its own capacitor."""
        package = self.part(name)
        if not (self.fault == "no supply" and package.ref == "U3"):
            package["VCC"] += self.high
        package["GND"] += self.ground
        if not (self.fault == "no capacitor" and package.ref == "U5"):
            self.two("c100n", self.high, self.ground)
        return package

    def two(self, name: str, first: Net, second: Net) -> Part:
        part = self.part(name)
        part["1"] += first
        part["2"] += second
        return part

    def connectors(self, rows: list[Net], columns: list[Net]) -> None:
        lines = self.part("lines")
        self.fpga_enable, self.led_enable = self.net("FPGA_ENABLE"), self.net("LED_ENABLE")
        self.interlock, self.warm = self.net("INTERLOCK"), self.net("NTC")
        signals = [*rows, *columns, self.fpga_enable, self.led_enable, self.interlock, self.warm]
        # A ground beside every signal.
        for number, signal in enumerate(signals):
            lines[str(2 * number + 1)] += signal
            lines[str(2 * number + 2)] += self.ground
        supply = self.part("supply")
        raw = self.net("VLED_RAW")
        raw.drive = POWER
        for pin, net in (("1", raw), ("2", self.ground), ("3", self.high), ("4", self.ground)):
            supply[pin] += net
        self.two("ntc", self.warm, self.ground)
        # The interlock's loop, 3.3 V when closed, switches the LED supply; no 3.3 V, no LED supply.
        switch = self.part("switch")
        switch["VIN"] += raw
        switch["VIN2"] += raw
        switch["ON"] += self.interlock
        switch["VBIAS"] += self.high
        switch["GND"] += self.ground
        switch["PAD"] += self.ground
        slow = self.net("SLOPE")
        switch["CT"] += slow
        self.two("c10n", slow, self.ground)
        switch["VOUT"] += self.led_supply
        switch["VOUT2"] += self.led_supply
        self.two("c100n", raw, self.ground)
        self.two("r100k", self.interlock, self.ground)
        for _ in range(2):
            self.two("c220u", self.led_supply, self.ground)
        for _ in range(2):
            self.two("c10u", self.high, self.ground)
        self.two("r2k2", self.fpga_enable, self.ground)
        self.two("r2k2", self.led_enable, self.ground)

    def control(self, rows: list[Net], columns: list[Net]) -> tuple[Net, Net]:
        """Enable of both chips and of the one-shot, which pulses of the pixel in the corner keep up for 10 ms."""
        toggle = self.logic("xor1")
        corner = self.net("CORNER")
        toggle["A"] += rows[SIDE - 1]
        toggle["B"] += columns[SIDE - 1]
        toggle["Y"] += corner
        shot = self.logic("shot")
        alive, timing, charge = self.net("ALIVE"), self.net("TIMING"), self.net("CHARGE")
        shot["A"] += self.ground
        shot["B"] += corner
        shot["CLR"] += self.high
        shot["Q"] += alive
        shot["REXT"] += timing
        shot["CEXT"] += charge
        self.two("c100n", timing, charge)
        self.two("r100k", timing, self.high)
        allowed = self.logic("and3")
        allowed["A"] += self.fpga_enable
        allowed["B"] += self.led_enable
        allowed["C"] += alive
        enable, dark = self.net("ENABLE"), self.net("DARK")
        allowed["Y"] += enable
        inverter = self.logic("not1")
        inverter["A"] += enable
        inverter["Y"] += dark
        return enable, dark

    def buffers(self, name: str, lines: list[Net], gate: Net, title: str) -> list[Net]:
        """The lines of this tile: rows AND enable, and NOT columns AND enable: all of them low is dark."""
        out = []
        for index, line in enumerate(lines):
            if index % 4 == 0:
                package = self.logic(name)
            unit = index % 4 + 1
            driven, near = self.net(f"{title}{index}_NEAR"), self.net(f"{title}{index}_TILE")
            if not (self.fault == "open row" and (title, index) == ("ROW", 5)):
                package[f"{unit}A"] += line
            unused = self.fault == "enable not used" and (title, index) == ("ROW", 2)
            package[f"{unit}B"] += self.high if unused else gate
            package[f"{unit}Y"] += driven
            if self.fault == "two outputs joined" and (title, index) == ("ROW", 6):
                package["1Y"] += driven
            self.two("r22", driven, near)
            out.append(near)
        return out

    def pixels(self, rows: list[Net], columns: list[Net]) -> None:
        for row, column in itertools.product(range(SIDE), range(SIDE)):
            if column % 4 == 0:
                package = self.logic("xor")
            unit = column % 4 + 1
            name = f"{row}_{column}"
            first, second = rows[row], columns[column]
            if self.fault == "row and column swapped" and (row, column) == (2, 5):
                first, second = rows[5], columns[2]
            if self.fault == "too many inputs" and (row, column) in ((1, 0), (1, 1)):
                first = rows[0]
            package[f"{unit}A"] += first
            package[f"{unit}B"] += second
            output, gate = self.net(f"LIT{name}"), self.net(f"GATE{name}")
            anode, cathode = self.net(f"ANODE{name}"), self.net(f"CATHODE{name}")
            package[f"{unit}Y"] += output
            self.two("r10", output, gate)
            fet = self.part("fet")
            fet["G"] += gate
            fet["S"] += self.ground
            fet["D"] += cathode
            led = self.part("led")
            turned = self.fault == "LED turned round" and (row, column) == (7, 0)
            led["A"] += cathode if turned else anode
            led["K"] += anode if turned else cathode
            self.two("r27", self.led_supply, anode)
            self.two("c1u", self.led_supply, self.ground)

    def pins(self) -> dict[str, list[tuple[str, str]]]:
        """Pins of each net, as reference and pin name."""
        found: dict[str, list[tuple[str, str]]] = {}
        for part in self.circuit.parts:
            for pin in part.pins:
                if pin.is_connected():
                    found.setdefault(pin.net.name, []).append((part.ref, pin.name))
        return {net: sorted(pins) for net, pins in sorted(found.items())}

    def net_of(self) -> dict[tuple[str, str], str]:
        return {pin: net for net, pins in self.pins().items() for pin in pins}


class Warnings(logging.Handler):
    """What SKiDL's rules warn of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        if "found while running ERC" not in record.getMessage():
            self.said.add(record.getMessage())


def rules(tile: Tile) -> list[str]:
    """SKiDL's own rules (open inputs, outputs that fight, supplies), and those of this board."""
    found = Warnings()
    erc = logging.getLogger("ERC_Logger")
    erc.addHandler(found)
    with contextlib.redirect_stderr(io.StringIO()):
        tile.circuit.ERC()
    erc.removeHandler(found)
    broken = sorted(found.said)
    net_of, nets = tile.net_of(), tile.pins()
    packages = [ref for ref, kind in tile.kinds.items() if kind in LOGIC]
    rails = {"3V3", "GND"}
    close = sum(1 for ref, kind in tile.kinds.items()
                if kind == "c100n" and {net_of.get((ref, "1")), net_of.get((ref, "2"))} == rails)
    if close < len(packages):
        broken.append(f"{close} capacitors of 100 nF at {len(packages)} logic packages")
    inputs = {name for kind in LOGIC for _, name, function in PARTS[kind].pins if function == "INPUT"}
    for net, pins in nets.items():
        driven = [pin for ref, pin in pins if tile.kinds[ref] in LOGIC and pin in inputs]
        if net not in rails and len(driven) > FAN_OUT:
            broken.append(f"{net} drives {len(driven)} inputs, at most {FAN_OUT}")
    return broken


def law(tile: Tile) -> list[str]:
    """Follows each LED to the connector's lines: lit where row equals column and the enable is high, and not else."""
    net_of, nets = tile.net_of(), tile.pins()

    def across(ref: str, net: str) -> str | None:
        ends = [net_of.get((ref, "1")), net_of.get((ref, "2"))]
        return ends[1 - ends.index(net)] if net in ends else None

    def level(net: str | None, given: dict[str, bool]) -> bool | None:
        """The level of a net, from the parts that drive it, through series resistors."""
        if net is None:
            return None
        if net in given:
            return given[net]
        for ref, pin in nets[net]:
            kind = tile.kinds[ref]
            if kind in LOGIC and pin.endswith("Y"):
                unit = pin[:-1]
                operands = [level(net_of.get((ref, unit + name)), given) for name in LOGIC[kind][0]]
                return None if None in operands else LOGIC[kind][1](*operands)
        for ref, _ in nets[net]:
            if tile.kinds[ref] in ("r22", "r10"):
                other = across(ref, net)
                if other is not None and any(pin.endswith("Y") for r, pin in nets[other] if tile.kinds[r] in LOGIC):
                    return level(other, given)
        return None

    def lit(row: int, column: int, given: dict[str, bool]) -> bool | None:
        """Whether current flows: supply, resistor, LED from anode to cathode, transistor that is on."""
        anode = f"ANODE{row}_{column}"
        led = next((ref for ref, pin in nets[anode] if tile.kinds[ref] == "led" and pin == "A"), None)
        resistor = next((ref for ref, _ in nets[anode] if tile.kinds[ref] == "r27"), None)
        if led is None or resistor is None or across(resistor, anode) != "VLED":
            return None
        for fet, pin in nets[net_of[(led, "K")]]:
            if tile.kinds[fet] == "fet" and pin == "D" and net_of.get((fet, "S")) == "GND":
                return level(net_of.get((fet, "G")), given)
        return None

    wrong = []
    for row, column in itertools.product(range(SIDE), range(SIDE)):
        lines = [(r, c, others_r, others_c, (True, True, True))
                 for r, c, others_r, others_c in itertools.product((False, True), repeat=4)]
        lines += [(*[high] * 4, allowed) for high in (False, True)
                  for allowed in itertools.product((False, True), repeat=3)]
        for high_row, high_column, other_rows, other_columns, allowed in lines:
            given = {f"ROW{i}": high_row if i == row else other_rows for i in range(SIDE)}
            given |= {f"COLUMN{i}": high_column if i == column else other_columns for i in range(SIDE)}
            given |= dict(zip(("FPGA_ENABLE", "LED_ENABLE", "ALIVE"), allowed)) | {"3V3": True, "GND": False}
            if lit(row, column, given) != (all(allowed) and high_row == high_column):
                wrong.append(f"LED {row}, {column} is not lit where row equals column and all enables are high")
                break
    return wrong


def netlist(tile: Tile) -> str:
    lines = ["# Nets of the 8 x 8 tile: written by tile.py --write. Computed, never built."]
    for net, pins in tile.pins().items():
        lines.append(f"{net}: " + " ".join(f"{ref}.{pin}" for ref, pin in pins))
    return "\n".join(lines) + "\n"


def bill(tile: Tile) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["quantity", "references", "part", "maker", "order code", "package", "order code checked"])
    for name, kind in PARTS.items():
        references = [ref for ref, found in tile.kinds.items() if found == name]
        few = references if len(references) <= 4 else [references[0], "to", references[-1]]
        if len(references) > 4 and kind.prefix in "RC":
            few = [f"{len(references)} of {kind.prefix}"]
        table.writerow([len(references), " ".join(few), kind.value, kind.maker, kind.order_code, kind.package, kind.sure])
    return text.getvalue()


def problems(tile: Tile) -> list[str]:
    return rules(tile) + law(tile)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write tile.net.txt and bom.csv")
    write = parser.parse_args().write
    tile = Tile()
    found = problems(tile)
    for path, text in ((HERE / "tile.net.txt", netlist(tile)), (HERE / "bom.csv", bill(tile))):
        if write:
            path.write_text(text)
        if not path.exists() or path.read_text() != text:
            found.append(f"{path.name} is stale: write it anew with tile.py --write")
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        tile.circuit.generate_netlist(file_="tile.net")
    for problem in found:
        print(problem, file=sys.stderr)
    print(f"tile: {len(tile.kinds)} parts, {len(tile.pins())} nets, {SIDE * SIDE} LEDs; "
          f"{len(found)} broken rules")
    blind = [fault for fault in FAULTS if not problems(Tile(fault))]
    for fault in blind:
        print(f"a fault made on purpose is not seen: {fault}", file=sys.stderr)
    print(f"tile: {len(FAULTS) - len(blind)} of {len(FAULTS)} faults made on purpose are seen")
    return 1 if found or blind else 0


if __name__ == "__main__":
    sys.exit(main())
