#!/usr/bin/env python3
"""Runs the ngspice decks beside this file and prints each figure beside the simulator's constant.

    python3 boards/electronics/check.py           # run, print, compare; exit 1 if a figure is off
    python3 boards/electronics/check.py --write   # also write camera.toml, the README's table and step.svg

Computed, never built. Needs ngspice and Python 3.11; the standard library alone. The decks' waveforms go into
target/electronics. Afterwards the check tests itself: each constant is made wrong in turn and must be seen.
"""

import argparse
import math
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

from step import FALL_NS, RISE_NS, SAMPLE_NS, Chain, Edges, draw

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
OUT = ROOT / "target" / "electronics"
CAMERAS = ROOT / "host" / "optics" / "cameras"
OWN = HERE / "camera.toml"
README = HERE / "README.md"
DECKS = ("led", "row", "receiver", "chain", "supply")

ELECTRON_C = 1.602176634e-19
FOUR_KT_J = 4 * 1.380649e-23 * 300
LEDS = 1024
ADC_FULL_SCALE_V = 2.0
# Supply of the LEDs, and the gateware's limit of light over time (mcu/wire/src/register.rs, DUTY_LIMIT_MAX).
LED_SUPPLY_V, DUTY_LIMIT = 2.5, 0.625
# Of the LED, over which no resistance lies: a sag is shared by the rest.
JUNCTION_V = 0.8
# The paper's camera as a whole (its Fig. 2).
PAPER_W = 45
# The keys of a camera description that say how light follows its line.
EDGE_KEYS = ("rise_ns", "fall_ns", "turn_on_delay_ns", "turn_off_delay_ns")
# What a written figure may differ from one computed here: another ngspice rounds its steps otherwise.
STALE = 0.03


class Failure(Exception):
    """One clear line."""


@dataclass(frozen=True)
class Row:
    """A figure beside the simulator's constant.

    `rule`: "near" (within `tolerance` of the constant), "most" (at most the constant) or "gap" (a stated
    disagreement: the circuit's figure is `ratio` times the constant, within `tolerance`).
    """

    name: str
    unit: str
    circuit: float
    constant: float
    source: str
    rule: str
    tolerance: float = 0.0
    ratio: float = 1.0

    def holds(self) -> bool:
        if self.rule == "most":
            return self.circuit <= self.constant
        expected = self.ratio * self.constant
        return abs(self.circuit - expected) <= self.tolerance * abs(expected)

    def verdict(self) -> str:
        if not self.holds():
            return "WRONG"
        return {"near": "agrees", "most": "within", "gap": "known gap"}[self.rule]

    def said(self) -> str:
        per_cent = f"{100 * self.tolerance:g} %"
        return {
            "near": f"within {per_cent}",
            "most": "at most",
            "gap": f"{self.ratio:g} times, within {per_cent}",
        }[self.rule]


def merged(base: dict, over: dict) -> dict:
    both = dict(base)
    for key, value in over.items():
        both[key] = merged(base[key], value) if isinstance(value, dict) and key in base else value
    return both


def camera(path: Path) -> dict:
    """A camera description over those that it names as basis."""
    own = tomllib.loads(path.read_text())
    return merged(camera(CAMERAS / f"{own['basis']}.toml"), own) if "basis" in own else own


def figures_of(deck: str) -> dict[str, float]:
    """Lines `figure NAME VALUE` of a deck, run in target/electronics."""
    command = ["ngspice", "-b", str(HERE / f"{deck}.cir")]
    run = subprocess.run(command, cwd=OUT, capture_output=True, text=True, timeout=300)
    said = run.stdout + run.stderr
    found = dict(re.findall(r"^figure (\S+) (\S+)$", said, re.M))
    # A waveform is what chain.cir gives; every other deck gives figures.
    complaint = re.search(r"failed!|^Error|cannot open|singular|aborted", said, re.M)
    if run.returncode != 0 or complaint or (deck != "chain" and not found):
        raise Failure(f"{deck}.cir failed:\n{said[-3000:]}")
    return {f"{deck}.{name}": float(value) for name, value in found.items()}


def deck_value(path: Path, element: str) -> float:
    """The value of an element such as `rf diode tia 22k`, as the deck has it."""
    line = re.search(rf"^{element} \S+ \S+ ([0-9.]+)([pnumk]?)$", path.read_text(), re.M)
    if line is None:
        raise Failure(f"{path.name}: no element {element} with a plain value")
    scale = {"p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3, "": 1.0}
    return float(line[1]) * scale[line[2]]


def input_pf() -> float:
    """Capacitance of the transimpedance amplifier's input and its pads, as the deck has it."""
    text = (HERE / "receiver.lib").read_text()
    amplifier = re.search(r"^xtia .* common=([0-9.]+)p differential=([0-9.]+)p$", text, re.M)
    if amplifier is None:
        raise Failure("receiver.lib: no xtia with common=...p differential=...p")
    return float(amplifier[1]) + float(amplifier[2]) + deck_value(HERE / "receiver.lib", "cpads") * 1e12


def voltage_noise_pa(description: dict) -> float:
    """Noise of the amplifier's voltage noise alone, as host/optics/src/camera/views.rs has it, in pA/sqrt(Hz)."""
    part = description["amplifier"]
    farad = (description["detector"]["capacitance_pf"] + part["input_capacitance_pf"]) * 1e-12
    volt = part["voltage_noise_nv_per_sqrt_hz"] * 1e-9
    return 2e12 * math.pi * part["bandwidth_mhz"] * 1e6 * farad * volt / math.sqrt(3)


def resistor_noise_pa(description: dict) -> float:
    return 1e12 * math.sqrt(FOUR_KT_J / (description["amplifier"]["feedback_kohm"] * 1e3))


def noise_na(description: dict) -> float:
    """Noise of the amplifier over its noise bandwidth, in nA rms at its input."""
    pa = math.hypot(resistor_noise_pa(description), voltage_noise_pa(description))
    return pa * 1e-3 * math.sqrt(math.pi / 2 * description["amplifier"]["bandwidth_mhz"] * 1e6)


def settled_ns(bandwidth_mhz: float, rest: float) -> float:
    """Time from the half to within `rest` of the end, of one pole."""
    return 1e3 * math.log(0.5 / rest) / (2 * math.pi * bandwidth_mhz)


def sag(found: dict) -> float:
    """Share of the light that a tile loses if all of its LEDs are lit."""
    return found["supply.sag_v"] / (LED_SUPPLY_V - JUNCTION_V)


def circuits_camera(found: dict, chain: Chain) -> dict:
    """The constants that the circuits give, as keys of a camera description."""
    bandwidth_mhz = found["receiver.bandwidth_hz"] / 1e6
    edges, _ = chain.fitted(bandwidth_mhz)
    described = merged(camera(CAMERAS / "fga015.toml"), {
        "leds": {key: getattr(edges, key) for key in EDGE_KEYS} | {"tile_sag": sag(found)},
        "amplifier": {
            "bandwidth_mhz": bandwidth_mhz,
            "feedback_kohm": deck_value(HERE / "receiver.lib", "rf") / 1e3,
            "input_capacitance_pf": input_pf(),
            "voltage_noise_nv_per_sqrt_hz": 1.0,
        },
    })
    # The voltage noise with which the simulator's formula gives the circuit's noise.
    pa = 1e12 * input_noise_a(found) / math.sqrt(math.pi / 2 * bandwidth_mhz * 1e6)
    rest = math.sqrt(pa**2 - resistor_noise_pa(described) ** 2)
    described["amplifier"]["voltage_noise_nv_per_sqrt_hz"] = rest / voltage_noise_pa(described)
    return described


def input_noise_a(found: dict) -> float:
    return found["receiver.noise_v"] / found["receiver.gain_ohm"]


def rows(found: dict, chain: Chain, paper: dict, fga015: dict, own: dict) -> list[Row]:
    edge_ns = (paper["leds"]["rise_ns"] + paper["leds"]["fall_ns"]) / 2
    bandwidth_mhz = paper["amplifier"]["bandwidth_mhz"]
    half_ns = found["receiver.half_s"] * 1e9
    full_scale_a = ADC_FULL_SCALE_V / found["receiver.gain_ohm"]
    electrons_per_count = full_scale_a / 2**14 * SAMPLE_NS * 1e-9 / ELECTRON_C
    supply_w = LED_SUPPLY_V * found["led.current_a"] * LEDS / 2
    made = circuits_camera(found, chain)
    _, phase = chain.fitted(found["receiver.bandwidth_hz"] / 1e6)
    white = 1 + chain.corner(phase)
    described = Edges.of(own)
    table = [
        Row("pixel (0, 0) of a white sheet, all patterns", "of white", white, 1 + Edges.of(paper).corner(),
            "paper, rise and fall alike", "gap", 0.05, -2.7),
        Row("pixel (0, 0) of a white sheet, all patterns", "of white", white, 1 + described.corner(),
            "camera.toml leds", "near", 0.03),
        Row("light, rise", "ns", found["led.rise_s_6"] * 1e9, paper["leds"]["rise_ns"], "paper leds.rise_ns",
            "near", 0.15),
        Row("light, fall", "ns", found["led.fall_s_6"] * 1e9, paper["leds"]["fall_ns"], "paper leds.fall_ns",
            "near", 0.15),
        Row("row line at the last gate, buffered", "ns", found["row.gate_rise_s"] * 1e9, edge_ns / 3,
            "a third of the LEDs' edge", "most"),
        Row("row line at the last gate, without buffers", "ns", found["row.direct_rise_s"] * 1e9, edge_ns / 3,
            "a third of the LEDs' edge", "gap", 0.1, 7.9),
        Row("row line, first to last tile", "ns", abs(found["row.skew_s"]) * 1e9, 1.0,
            "1 ns, docs/log/gateware.md", "most"),
        Row("photodiode", "pF", deck_value(HERE / "receiver.lib", "cdiode") * 1e12,
            fga015["detector"]["capacitance_pf"], "fga015 detector.capacitance_pf", "near", 0.001),
        Row("feedback", "kohm", deck_value(HERE / "receiver.lib", "rf") / 1e3,
            paper["amplifier"]["feedback_kohm"], "paper amplifier.feedback_kohm", "near", 0.001),
        Row("receiver, -3 dB", "MHz", found["receiver.bandwidth_hz"] / 1e6, bandwidth_mhz,
            "paper amplifier.bandwidth_mhz", "near", 0.05),
        Row("receiver, from half to within 1 %", "ns", found["receiver.settle_1_s"] * 1e9 - half_ns,
            settled_ns(bandwidth_mhz, 0.01), "one pole of bandwidth_mhz", "most"),
        Row("receiver, from half to within 0.1 %", "ns", found["receiver.settle_01_s"] * 1e9 - half_ns,
            settled_ns(bandwidth_mhz, 0.001), "one pole of bandwidth_mhz", "most"),
        Row("receiver's noise at its input", "nA rms", input_noise_a(found) * 1e9, noise_na(paper),
            "paper amplifier", "gap", 0.05, 1.72),
        Row("receiver's noise at its input", "nA rms", input_noise_a(found) * 1e9, noise_na(own),
            "camera.toml amplifier", "near", 0.03),
        Row("gain, with 2 V at the ADC", "electrons/count", electrons_per_count, 3.0,
            "step of the gain at 0.3 m", "near", 0.05),
    ]
    for n in (2, 3, 4):
        ns = (n + 1) * SAMPLE_NS
        table.append(Row(f"sample {n} of a step, dark to lit", "", chain.share(RISE_NS, phase + ns), described.rising(ns),
                         "camera.toml, ChainSettings::rising", "near", 0.01))
        table.append(Row(f"sample {n} of a step, lit to dark", "", chain.share(FALL_NS, phase + ns), described.falling(ns),
                         "camera.toml, ChainSettings::falling", "near", 0.01))
    table += [
        Row("supply's sag at a slot, all of a tile", "of the light", sag(found), 0.03, "3 %", "most"),
        Row("LEDs' supply, half lit", "W", supply_w, PAPER_W, "the paper's camera, Fig. 2", "gap", 0.05, 1.5),
        Row("LEDs' supply at the duty limit", "W", 2 * DUTY_LIMIT * supply_w, 100.0, "12 V, 100 W supply", "most"),
        Row("LEDs' current, all lit", "A", LEDS * found["led.current_a"], 60.0, "16 tiles of 3.75 A", "most"),
        Row("light after the LED supply is cut", "ms", found["supply.cut_s"] * 1e3, 5.0, "5 ms", "most"),
    ]
    for key in EDGE_KEYS:
        # A delay of 0 is 0; what is small has an error of its rounding.
        table.append(Row(f"camera.toml leds.{key}, from 10 ns", "ns", 10 + made["leds"][key], 10 + own["leds"][key],
                         "camera.toml", "near", 0.01))
    table.append(Row("camera.toml leds.tile_sag", "of the light", made["leds"]["tile_sag"], own["leds"]["tile_sag"],
                     "camera.toml", "near", STALE))
    units = {"bandwidth_mhz": "MHz", "feedback_kohm": "kohm", "voltage_noise_nv_per_sqrt_hz": "nV/sqrt(Hz)",
             "input_capacitance_pf": "pF"}
    for key, unit in units.items():
        table.append(Row(f"camera.toml amplifier.{key}", unit, made["amplifier"][key], own["amplifier"][key],
                         "camera.toml", "near", STALE))
    return table


def markdown(table: list[Row]) -> str:
    lines = ["| figure | circuit | simulator | which constant | rule | verdict |", "| -- | -- | -- | -- | -- | -- |"]
    for row in table:
        unit = f" {row.unit}" if row.unit else ""
        lines.append(f"| {row.name} | {row.circuit:.3g}{unit} | {row.constant:.3g}{unit} | {row.source} "
                     f"| {row.said()} | {row.verdict()} |")
    return "\n".join(lines) + "\n"


def plain(table: list[Row]) -> str:
    cells = [("figure", "circuit", "simulator", "", "which constant", "rule", "verdict")]
    cells += [(r.name, f"{r.circuit:.3g}", f"{r.constant:.3g}", r.unit, r.source, r.said(), r.verdict()) for r in table]
    wide = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, wide)).rstrip() for row in cells)


OWN_TEXT = """\
# A camera with the electronics of this folder: what differs from `fga015`. Written by `check.py --write` from the
# ngspice decks; `bash boards/electronics/run.sh` holds it to them. Computed, never built.

basis = "fga015"
name = "electronics"

[leds]
# chain.cir, with carriers that live 6 ns (typical, no data sheet at hand). First-order edges that pass half of the step
# when the circuit does, and of which pattern and complement see as much as of the circuit's.
rise_ns = {rise_ns:.2f}
fall_ns = {fall_ns:.2f}
turn_on_delay_ns = {turn_on_delay_ns:.2f}
turn_off_delay_ns = {turn_off_delay_ns:.2f}
# supply.cir.
tile_sag = {sag:.4f}
# No deck has the way from a line to the receiver: it is a matter of layout and shield. 0 is a perfect shield, an
# assumption. See README.md, "Not computed", for what 1 fF a line does.
line_crosstalk_ff = 0.0

[amplifier]
# receiver.cir.
bandwidth_mhz = {bandwidth:.1f}
feedback_kohm = {feedback:.1f}
# 0.8 pF of the OPA858 and 0.3 pF of pads.
input_capacitance_pf = {input:.1f}
# The OPA858 has 2.5 nV/sqrt(Hz). With this value the simulator's formula gives the noise of the whole receiver, whose
# filter passes noise beyond its bandwidth.
voltage_noise_nv_per_sqrt_hz = {noise:.2f}
"""


def own_text(found: dict, chain: Chain) -> str:
    made = circuits_camera(found, chain)
    part = made["amplifier"]
    edges = {key: made["leds"][key] for key in EDGE_KEYS}
    return OWN_TEXT.format(**edges, sag=made["leds"]["tile_sag"], bandwidth=part["bandwidth_mhz"],
                           feedback=part["feedback_kohm"], input=part["input_capacitance_pf"],
                           noise=part["voltage_noise_nv_per_sqrt_hz"])


BEGIN, END = "<!-- table: check.py --write -->\n\n", "\n<!-- end of table -->"


def stale(readme: str, table: list[Row]) -> list[str]:
    """Rows of the README's table that are no longer what the decks give."""
    written = readme.split(BEGIN)[1].split(END)[0].splitlines()
    now = markdown(table).splitlines()
    if len(written) != len(now):
        return [f"{len(written)} lines instead of {len(now)}"]
    number = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
    wrong = []
    for old, new in zip(written, now):
        pairs = list(zip(number.findall(old), number.findall(new)))
        same = number.sub("#", old) == number.sub("#", new)
        if not same or any(abs(float(a) - float(b)) > STALE * abs(float(b)) for a, b in pairs):
            wrong.append(old)
    return wrong


def self_test(table: list[Row]) -> list[str]:
    """Rows whose constant can be made wrong without being seen."""
    blind = []
    for row in table:
        wrong = [0.5 * row.circuit] if row.rule == "most" else [row.constant / 1.3, 1.3 * row.constant]
        if any(replace(row, constant=value).holds() for value in wrong):
            blind.append(row.name)
    return blind


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write camera.toml, the README's table and step.svg")
    write = parser.parse_args().write
    OUT.mkdir(parents=True, exist_ok=True)
    found = {}
    for deck in DECKS:
        found |= figures_of(deck)
    chain = Chain.read(OUT / "chain.txt")
    if write:
        OWN.write_text(own_text(found, chain))
    paper, fga015, own = camera(CAMERAS / "paper.toml"), camera(CAMERAS / "fga015.toml"), camera(OWN)
    table = rows(found, chain, paper, fga015, own)
    print(plain(table))
    print("\nNo constant of the simulator; for the README:")
    for name, value in sorted(found.items()):
        print(f"  {name} {value:.4g}")
    fitted, phase = chain.fitted(found["receiver.bandwidth_hz"] / 1e6)
    print(f"  chain.delay_ns {phase:.4g}")
    readme = README.read_text()
    if write:
        before, rest = readme.split(BEGIN)
        README.write_text(before + BEGIN + markdown(table) + END + rest.split(END)[1])
        draw(chain, fitted, phase, HERE / "step.svg")
        readme = README.read_text()
    problems = [f"off: {row.name}: {row.circuit:.3g} {row.unit}, {row.source} {row.constant:.3g}, {row.said()}"
                for row in table if not row.holds()]
    problems += [f"README.md is stale, write it anew with check.py --write: {line}" for line in stale(readme, table)]
    problems += [f"this check is blind: a wrong constant of `{name}` is not seen" for name in self_test(table)]
    for problem in problems:
        print(problem, file=sys.stderr)
    gaps = sum(row.rule == "gap" for row in table)
    seen = "NOT SEEN" if self_test(table) else "seen"
    print(f"\n{len(table)} figures, {gaps} known gaps; each constant made wrong in turn: {seen}")
    return 1 if problems else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyError as error:
        sys.exit(f"boards/electronics/check.py: no figure of a deck and no key of a description is named {error}")
    except (Failure, OSError, subprocess.TimeoutExpired, tomllib.TOMLDecodeError) as error:
        sys.exit(f"boards/electronics/check.py: {error}")
