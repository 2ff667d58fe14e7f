"""Parts of the tile: pins, packages, order codes. `sure` says whether the order code was compared with its maker's page:
none was, because no shop and no maker's site can be reached from here."""

from collections.abc import Callable
from dataclasses import dataclass

VERIFY = "from memory: verify"
TO_FIND = "no: choose, verify"

Pins = tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Kind:
    prefix: str
    value: str
    maker: str
    order_code: str
    package: str
    footprint: str
    pins: Pins
    sure: str = VERIFY


def quad(*names: str) -> Pins:
    """A 14-pin package of four gates, pins 1 to 14 by name."""
    functions = {"Y": "OUTPUT", "A": "INPUT", "B": "INPUT"}
    return tuple((str(number), name, functions.get(name[-1], "PWRIN") if name[0].isdigit() else "PWRIN")
                 for number, name in enumerate(names, 1))


def gate(*names: str) -> Pins:
    """A small package of one gate; an empty name is a pin without connection."""
    functions = {"Y": "OUTPUT", "Q": "OUTPUT", "GND": "PWRIN", "VCC": "PWRIN", "NC": "NOCONNECT",
                 "CEXT": "PASSIVE", "REXT": "PASSIVE"}
    return tuple((str(number), name, functions.get(name, "INPUT")) for number, name in enumerate(names, 1))


def passive(*names: str) -> Pins:
    return tuple((str(number), name, "PASSIVE") for number, name in enumerate(names, 1))


TWO = passive("1", "2")
AND_PINS = quad("1A", "1B", "1Y", "2A", "2B", "2Y", "GND", "3Y", "3A", "3B", "4Y", "4A", "4B", "VCC")
NOR_PINS = quad("1Y", "1A", "1B", "2Y", "2A", "2B", "GND", "3A", "3B", "3Y", "4A", "4B", "4Y", "VCC")
TSSOP = ("TSSOP-14", "Package_SO:TSSOP-14_4.4x5mm_P0.65mm")
SOT5 = ("SOT-23-5", "Package_TO_SOT_SMD:SOT-23-5")
R0402 = ("0402", "Resistor_SMD:R_0402_1005Metric")
R0603 = ("0603", "Resistor_SMD:R_0603_1608Metric")
C0402 = ("0402", "Capacitor_SMD:C_0402_1005Metric")
C0805 = ("0805", "Capacitor_SMD:C_0805_2012Metric")
TI, YAGEO, MURATA = "Texas Instruments", "Yageo", "Murata"

PARTS: dict[str, Kind] = {
    "xor": Kind("U", "quad exclusive or", TI, "SN74LVC86APWR", *TSSOP, AND_PINS),
    "and": Kind("U", "quad and, row buffers", TI, "SN74LVC08APWR", *TSSOP, AND_PINS),
    "nor": Kind("U", "quad nor, column buffers", TI, "SN74LVC02APWR", *TSSOP, NOR_PINS),
    "xor1": Kind("U", "exclusive or, corner", TI, "SN74LVC1G86DBVR", *SOT5, gate("A", "B", "GND", "Y", "VCC")),
    "not1": Kind("U", "inverter", TI, "SN74LVC1G04DBVR", *SOT5, gate("NC", "A", "GND", "Y", "VCC")),
    "and3": Kind("U", "3-input and, enable", TI, "SN74LVC1G11DBVR", "SOT-23-6", "Package_TO_SOT_SMD:SOT-23-6",
                 gate("A", "GND", "B", "Y", "VCC", "C")),
    "shot": Kind("U", "one-shot, 10 ms", TI, "SN74LVC1G123DCTR", "SM8", "Package_SO:SSOP-8_2.95x2.8mm_P0.65mm",
                 gate("A", "B", "CLR", "GND", "Q", "CEXT", "REXT", "VCC")),
    "switch": Kind("U", "load switch, 4 A", TI, "TPS22965DSGR", "WSON-8", "Package_SON:WSON-8-1EP_2x2mm_P0.5mm",
                   (("1", "VIN", "PWRIN"), ("2", "VIN2", "PWRIN"), ("3", "ON", "INPUT"), ("4", "VBIAS", "PWRIN"),
                    ("5", "GND", "PWRIN"), ("6", "CT", "PASSIVE"), ("7", "VOUT", "PASSIVE"),
                    ("8", "VOUT2", "PASSIVE"), ("9", "PAD", "PWRIN"))),
    "fet": Kind("Q", "BSS138", "onsemi", "BSS138", "SOT-23", "Package_TO_SOT_SMD:SOT-23",
                (("1", "G", "INPUT"), ("2", "S", "PASSIVE"), ("3", "D", "PASSIVE"))),
    "led": Kind("D", "LED 1550 nm, 50 mA", "Thorlabs, for example", "LED1550L", "TO-18", "Package_TO_SOT_THT:TO-18-2_Lens",
                passive("A", "K"), TO_FIND),
    "r27": Kind("R", "27 ohm 1 %", YAGEO, "RC0603FR-0727RL", *R0603, TWO),
    "r10": Kind("R", "10 ohm 1 %", YAGEO, "RC0402FR-0710RL", *R0402, TWO),
    "r22": Kind("R", "22 ohm 1 %", YAGEO, "RC0402FR-0722RL", *R0402, TWO),
    "r2k2": Kind("R", "2.2 kohm 1 %", YAGEO, "RC0402FR-072K2L", *R0402, TWO),
    "r100k": Kind("R", "100 kohm 1 %", YAGEO, "RC0402FR-07100KL", *R0402, TWO),
    "c10n": Kind("C", "10 nF 16 V X7R", MURATA, "GRM155R71C103KA01D", *C0402, TWO),
    "c100n": Kind("C", "100 nF 16 V X7R", MURATA, "GRM155R71C104KA88D", *C0402, TWO),
    "c1u": Kind("C", "1 uF 6.3 V X5R", MURATA, "GRM155R60J105KE19D", *C0402, TWO),
    "c10u": Kind("C", "10 uF 6.3 V X5R", MURATA, "GRM21BR60J106KE19L", *C0805, TWO),
    "c220u": Kind("C", "220 uF 6.3 V polymer, 15 mohm or less", "Panasonic", "EEF-series", "7343",
                  "Capacitor_Tantalum_SMD:CP_EIA-7343-31_Kemet-D", TWO, TO_FIND),
    "ntc": Kind("RT", "NTC 10 kohm, 1 %, B 3435 K", MURATA, "NCP18XH103F03RB", "0603",
                "Resistor_SMD:R_0603_1608Metric", TWO),
    "lines": Kind("J", "header 2 x 20, 2.54 mm", "any", "2 x 20 box header", "2.54 mm",
                  "Connector_IDC:IDC-Header_2x20_P2.54mm_Vertical", passive(*(str(n) for n in range(1, 41))), "not needed"),
    "supply": Kind("J", "power connector, 4 poles, 5 A", "any", "4 poles, 5 A", "3.5 mm",
                   "TerminalBlock:TerminalBlock_bornier-4_P5.08mm", passive("1", "2", "3", "4"), "not needed"),
}

# Logic kinds: names of a gate's inputs, and what the gate does.
LOGIC: dict[str, tuple[str, Callable[..., bool]]] = {
    "xor": ("AB", lambda a, b: a != b),
    "and": ("AB", lambda a, b: a and b),
    "nor": ("AB", lambda a, b: not (a or b)),
    "xor1": ("AB", lambda a, b: a != b),
    "not1": ("A", lambda a: not a),
    "and3": ("ABC", lambda a, b, c: a and b and c),
    "shot": ("", lambda: False),
}
