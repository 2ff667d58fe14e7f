"""The step of light at the ADC's input (chain.cir) beside the simulator's two poles, what of it an image shows, and a
picture of both."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

SAMPLE_NS = 8
# The line's edges in chain.cir, and where the lit level is read.
RISE_NS, FALL_NS, LIT_NS = 20.0, 180.0, 175.0
WIDTH, HEIGHT, SPAN_NS = 640, 300, 64
# The samples of a pattern that count (readout of the paper's camera), and its length.
WINDOW, SLOT_NS = (2, 3, 4), 40
# Patterns after a switch that are looked at: as long as chain.cir keeps its level.
SLOTS = 3
PIXELS = 1024


def pairs_see(rest: Callable[[float], float]) -> float:
    """What of an edge all differences of pattern and complement have in common, in shares of the step: the mean rest in a
    pattern's samples, less that in the next pattern's, and so on. `rest` is what is missing, against ns after the edge.

    An LED changes in half of the patterns and in every complement. So each light that is still on its way after an odd
    number of slots is a quarter more in the pattern than in the complement, and after an even number a quarter less.
    """
    means = [sum(rest(slot * SLOT_NS + (n + 1) * SAMPLE_NS) for n in WINDOW) / len(WINDOW) for slot in range(SLOTS)]
    return sum(mean if slot % 2 == 0 else -mean for slot, mean in enumerate(means))


@dataclass(frozen=True)
class Edges:
    """The LEDs' edges as a camera description has them, before one pole of an amplifier."""

    rise_ns: float
    fall_ns: float
    turn_on_delay_ns: float
    turn_off_delay_ns: float
    bandwidth_mhz: float

    @staticmethod
    def of(description: dict) -> "Edges":
        leds = description["leds"]
        keys = ("rise_ns", "fall_ns", "turn_on_delay_ns", "turn_off_delay_ns")
        return Edges(*(leds[key] for key in keys), description["amplifier"]["bandwidth_mhz"])

    def rising(self, ns: float) -> float:
        return Chain.response(ns - self.turn_on_delay_ns, self.rise_ns, self.bandwidth_mhz)

    def falling(self, ns: float) -> float:
        return Chain.response(ns - self.turn_off_delay_ns, self.fall_ns, self.bandwidth_mhz)

    def corner(self) -> float:
        return corner(self.rising, self.falling)


def corner(rising: Callable[[float], float], falling: Callable[[float], float]) -> float:
    """What pixel (0, 0) of a white sheet is off by, in units of white, in the image of all patterns: a difference that
    all pairs have in common is one pixel, and 1024 LEDs add to it."""
    rise, fall = (pairs_see(lambda ns, part=part: 1 - part(ns)) for part in (rising, falling))
    # The host undoes the leak with what calibration knows, the rise: its taps pass their sum of what all pairs share.
    kept = 1 - 2 * sum(1 - rising((n + 1) * SAMPLE_NS) for n in WINDOW) / len(WINDOW)
    return PIXELS * (rise - fall) / 4 / kept


@dataclass(frozen=True)
class Chain:
    """Light and ADC input of chain.cir, against time in ns."""

    ns: list[float]
    light: list[float]
    adc: list[float]

    @staticmethod
    def read(path: Path) -> "Chain":
        lines = [[float(cell) for cell in line.split()] for line in path.read_text().splitlines()[1:]]
        return Chain([t * 1e9 for t, _, _ in lines], [light for _, light, _ in lines], [adc for _, _, adc in lines])

    def at(self, values: list[float], ns: float) -> float:
        step = self.ns[1] - self.ns[0]
        index = min(int(ns / step), len(values) - 2)
        share = ns / step - index
        return values[index] * (1 - share) + values[index + 1] * share

    @staticmethod
    def response(ns: float, edge_ns: float, bandwidth_mhz: float) -> float:
        """The simulator's step response: `ChainSettings::rising` of host/optics/src/chain.rs."""
        if ns <= 0:
            return 0.0
        led, amplifier = edge_ns / math.log(9), 1e3 / (2 * math.pi * bandwidth_mhz)
        rest = math.exp(-ns / amplifier)
        return 1 - rest - led / (led - amplifier) * (math.exp(-ns / led) - rest)

    def half(self, start: float) -> float:
        """Time at which the ADC's input passes half of the step that begins at `start`, in ns."""
        level = self.at(self.adc, LIT_NS) / 2
        above = self.at(self.adc, start) > level
        index = next(i for i, ns in enumerate(self.ns) if ns > start and (self.adc[i] > level) != above)
        return self.ns[index]

    def delay_ns(self, edge_ns: float, bandwidth_mhz: float, start: float = RISE_NS) -> float:
        """Delay of the circuit beyond the model: the two pass half of the step together."""
        low, high = 0.0, 100.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self.response(middle, edge_ns, bandwidth_mhz) < 0.5 else (low, middle)
        return self.half(start) - start - low

    def share(self, start: float, ns: float) -> float:
        """Share of the step that begins at `start` which the ADC's input has made `ns` later."""
        passed = self.at(self.adc, start + ns) / self.at(self.adc, LIT_NS)
        return passed if start == RISE_NS else 1 - passed

    def fitted(self, bandwidth_mhz: float) -> tuple[Edges, float]:
        """Edges and delays with which the simulator passes half of each step when the circuit does, and with which all
        pairs have as much in common as in the circuit; and the delay that both edges share, which is latency.

        The edge that begins first sets the phase in which the ADC samples both."""

        def edge(start: float, phase: float | None) -> tuple[float, float]:
            low, high = 1.0, 60.0
            for _ in range(60):
                edge_ns = (low + high) / 2
                delay = self.delay_ns(edge_ns, bandwidth_mhz, start)
                at = delay if phase is None else phase
                circuit = pairs_see(lambda ns: 1 - self.share(start, at + ns))
                model = pairs_see(lambda ns: 1 - self.response(ns + at - delay, edge_ns, bandwidth_mhz))
                low, high = (edge_ns, high) if model < circuit else (low, edge_ns)
            return edge_ns, delay

        phase = min(edge(start, None)[1] for start in (RISE_NS, FALL_NS))
        (rise, on), (fall, off) = (edge(start, phase) for start in (RISE_NS, FALL_NS))
        first = min(on, off)
        return Edges(rise, fall, on - first, off - first, bandwidth_mhz), first

    def corner(self, phase: float) -> float:
        """What pixel (0, 0) of a white sheet is off by with the circuit's edges, in units of white."""
        rise, fall = (lambda ns, start=start: self.share(start, phase + ns) for start in (RISE_NS, FALL_NS))
        return corner(rise, fall)


def draw(chain: Chain, edges: Edges, phase: float, path: Path) -> None:
    """Both steps of the circuit, those of the simulator and its samples, as SVG."""
    left, bottom = 50, HEIGHT - 40

    def point(ns: float, share: float) -> str:
        return f"{left + ns / SPAN_NS * (WIDTH - left - 10):.1f},{bottom - share * (bottom - 20):.1f}"

    def line(values: list[tuple[float, float]], colour: str, dash: str = "") -> str:
        points = " ".join(point(*value) for value in values)
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5" {dash}/>'

    times = [0.5 * i for i in range(2 * SPAN_NS + 1)]
    curves = []
    for start, colour, model in ((RISE_NS, "#c33", edges.rising), (FALL_NS, "#36c", edges.falling)):
        curves.append(line([(ns, chain.share(start, phase + ns)) for ns in times], colour))
        curves.append(line([(ns, model(ns)) for ns in times], colour, 'stroke-dasharray="4 3"'))
        for n in range(SPAN_NS // SAMPLE_NS):
            x, y = point((n + 1) * SAMPLE_NS, model((n + 1) * SAMPLE_NS)).split(",")
            curves.append(f'<circle cx="{x}" cy="{y}" r="3" fill="{colour}"/>')
    grid = []
    for share in (0, 0.5, 1):
        x, y = point(0, share).split(",")
        grid.append(f'<line x1="{x}" y1="{y}" x2="{WIDTH - 10}" y2="{y}" stroke="#ccc"/>'
                    f'<text x="10" y="{float(y) + 4}">{share:g}</text>')
    for ns in range(0, SPAN_NS + 1, SAMPLE_NS):
        grid.append(f'<text x="{point(ns, 0).split(",")[0]}" y="{bottom + 16}" text-anchor="middle">{ns}</text>')
    words = [("#c33", "circuit, dark to lit"), ("#36c", "circuit, lit to dark, turned over"),
             ("#000", "dashed: simulator, and its samples")]
    legend = [f'<text x="340" y="{150 + 18 * i}" fill="{colour}">{text}</text>'
              for i, (colour, text) in enumerate(words)]
    axis = (f'<text x="{WIDTH / 2}" y="{HEIGHT - 6}" text-anchor="middle">ns after the line, '
            "the circuit's delay taken off; computed, never built</text>")
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            'font-family="sans-serif" font-size="12">')
    background = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>'
    path.write_text("\n".join([head, background, *grid, *curves, *legend, axis, "</svg>"]) + "\n")
