"""The step of light at the ADC's input (chain.cir) beside the simulator's two poles, and its picture."""

import math
from dataclasses import dataclass
from pathlib import Path

SAMPLE_NS = 8
# The line's edges in chain.cir, and where the lit level is read.
RISE_NS, FALL_NS, LIT_NS = 20.0, 180.0, 175.0
WIDTH, HEIGHT, SPAN_NS = 640, 300, 64


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
        """The simulator's step response: `ChainSettings::settling` of host/optics/src/chain.rs."""
        led, amplifier = edge_ns / math.log(9), 1e3 / (2 * math.pi * bandwidth_mhz)
        rest = math.exp(-ns / amplifier)
        return 1 - rest - led / (led - amplifier) * (math.exp(-ns / led) - rest)

    def model(self, sample: int, edge_ns: float, bandwidth_mhz: float) -> float:
        return self.response((sample + 1) * SAMPLE_NS, edge_ns, bandwidth_mhz)

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

    def settled(self, edge_ns: float, bandwidth_mhz: float) -> tuple[list[float], list[float]]:
        """Share of a step in samples 0 to 4, dark to lit and lit to dark, sampled in the model's phase."""
        lit = self.at(self.adc, LIT_NS)
        both = []
        for start in (RISE_NS, FALL_NS):
            delay = self.delay_ns(edge_ns, bandwidth_mhz, start)
            shares = [self.at(self.adc, start + delay + (n + 1) * SAMPLE_NS) / lit for n in range(5)]
            both.append(shares if start == RISE_NS else [1 - share for share in shares])
        return both[0], both[1]


def draw(chain: Chain, edge_ns: float, bandwidth_mhz: float, path: Path) -> None:
    """Both steps of the circuit, the model and its samples, as SVG."""
    left, bottom = 50, HEIGHT - 40

    def point(ns: float, share: float) -> str:
        return f"{left + ns / SPAN_NS * (WIDTH - left - 10):.1f},{bottom - share * (bottom - 20):.1f}"

    def line(values: list[tuple[float, float]], colour: str, dash: str = "") -> str:
        points = " ".join(point(*value) for value in values)
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5" {dash}/>'

    times = [0.5 * i for i in range(2 * SPAN_NS + 1)]
    lit = chain.at(chain.adc, LIT_NS)
    curves = []
    for start, colour, fall in ((RISE_NS, "#c33", False), (FALL_NS, "#36c", True)):
        delay = chain.delay_ns(edge_ns, bandwidth_mhz, start)
        shares = [chain.at(chain.adc, start + delay + ns) / lit for ns in times]
        curves.append(line([(ns, 1 - s if fall else s) for ns, s in zip(times, shares)], colour))
    model = [(ns, chain.response(ns, edge_ns, bandwidth_mhz)) for ns in times]
    curves.append(line(model, "#000", 'stroke-dasharray="4 3"'))
    for n in range(SPAN_NS // SAMPLE_NS):
        x, y = point((n + 1) * SAMPLE_NS, chain.model(n, edge_ns, bandwidth_mhz)).split(",")
        curves.append(f'<circle cx="{x}" cy="{y}" r="3"/>')
    grid = []
    for share in (0, 0.5, 1):
        x, y = point(0, share).split(",")
        grid.append(f'<line x1="{x}" y1="{y}" x2="{WIDTH - 10}" y2="{y}" stroke="#ccc"/>'
                    f'<text x="10" y="{float(y) + 4}">{share:g}</text>')
    for ns in range(0, SPAN_NS + 1, SAMPLE_NS):
        grid.append(f'<text x="{point(ns, 0).split(",")[0]}" y="{bottom + 16}" text-anchor="middle">{ns}</text>')
    words = [("#c33", "circuit, dark to lit"), ("#36c", "circuit, lit to dark, turned over"),
             ("#000", "simulator, and its samples")]
    legend = [f'<text x="340" y="{150 + 18 * i}" fill="{colour}">{text}</text>'
              for i, (colour, text) in enumerate(words)]
    axis = (f'<text x="{WIDTH / 2}" y="{HEIGHT - 6}" text-anchor="middle">ns after the line, '
            "the circuit's delay taken off; computed, never built</text>")
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            'font-family="sans-serif" font-size="12">')
    background = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>'
    path.write_text("\n".join([head, background, *grid, *curves, *legend, axis, "</svg>"]) + "\n")
