#!/usr/bin/env python3
"""Plants faults in the sources of the reference board, builds each, and runs the scenarios on the model of the chip.

    python3 tests/silicon/faults.py [NAME...]

Works in a copy of the tree under target/silicon-faults. NIRSPI_UNICORN names Unicorn's library, and the tests' program is
built already (`bash .ci/run silicon` does both). Exits 1 if a fault is not seen.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPY = ROOT / "target/silicon-faults"
BOARD = "nucleo-u5a5zj-q"
U5 = f"boards/{BOARD}/src"

# Name, file, text, the same with the fault, feature, the test that sees it.
FAULTS = [
    ("request", f"{U5}/parallel.rs", "transfer.set_reqsel(request);", "transfer.set_reqsel(request + 1);", "parallel", "bit_for_bit"),
    ("alternate function", f"{U5}/parallel.rs", "input($pin, function)", "input($pin, function ^ 1)", "parallel", "bit_for_bit"),
    ("prescaler", f"{U5}/fpga.rs", "prescaler(SYSTEM_HZ, READ_PACKET);", "prescaler(SYSTEM_HZ, READ_PACKET) - 1;", "", "bit_for_bit"),
    ("endpoint size", "boards/usb/src/lib.rs", "let packet_bytes = PACKET_BYTES as u16;", "let packet_bytes = 256;", "", "it_boots"),
    ("missing enable", f"{U5}/parallel.rs", "        enable_and_reset::<DCMI>();\n", "", "parallel", "bit_for_bit"),
    ("priority", f"{U5}/clocks.rs", "    let rcc = &mut config.rcc;", "    config.gpdma_interrupt_priority = embassy_stm32::interrupt::Priority::P3;\n    let rcc = &mut config.rcc;", "", "it_boots"),
    ("descriptor", "boards/usb/src/lib.rs", "config.max_packet_size_0 = CONTROL_BYTES as u8;", "config.max_packet_size_0 = 32;", "", "it_boots"),
    ("phase", f"{U5}/fpga.rs", "SampleShift::HALF_CYCLE } else", "SampleShift::NONE } else", "", "bit_for_bit"),
    ("stack", f"{U5}/board.rs", "    fn inputs(&mut self) -> Inputs {\n", "    fn inputs(&mut self) -> Inputs {\n        core::hint::black_box(&mut [0_u8; 60_000]);\n", "", "stack_has_room"),
    # The waits of the start: for ADC, OCTOSPI and USB core.
    ("watchdog's time", f"{U5}/main.rs", "nirspi_mcu::BOARD_WATCHDOG_US);", "20 * nirspi_mcu::BOARD_WATCHDOG_US);", "", "a_wait_of_the_start"),
    ("light while USB starts", f"{U5}/main.rs", "    let mut usb_config = usb::Config::default();", "    board.enable_leds(true);\n    let mut usb_config = usb::Config::default();", "", "a_wait_of_the_start"),
    ("device mode", "boards/otg/src/lib.rs", "        while r.gintsts().read().cmod() {}\n", "", "", "a_wait_of_the_start"),
    ("light at the start", f"{U5}/main.rs", "Output::new(pins.led_enable, Level::Low,", "Output::new(pins.led_enable, Level::High,", "", "a_wait_of_the_start"),
    # What the firmware tries before a run.
    ("training", "mcu/src/training.rs", "Ok(true) if is_whole(room) =>", "Ok(true) =>", "", "wrong_phase"),
    ("enable of the self-test", "mcu/src/enables.rs", "if self.high == High::BoardAlone { mode::UNLIT } else { 0 };", "0;", "", "stuck_led_enable"),
    ("first light", f"{U5}/main.rs", "limits: Limits::default(),", "limits: Limits::SIMULATED,", "", "refuses_the_first_run"),
    ("feed", f"{U5}/board.rs", "self.watchdog.pet();", "", "", "stops_reading"),
    ("pin", f"{U5}/pins.rs", "bits.set_br(14, true)", "bits.set_br(13, true)", "", "crash_while_lit"),
    ("list", f"{U5}/parallel.rs", "number as u32 * u32::from(BLOCK_BYTES)", "number as u32 * u32::from(BLOCK_BYTES / 2)", "parallel", "bit_for_bit"),
]


def run(command: list[str], **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, **more)


def tests() -> str:
    """The tests' program, as cargo has built it."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    found = [path for path in target.glob("debug/deps/nirspi_tests_silicon-*") if path.suffix == ""]
    return str(max(found, key=lambda path: path.stat().st_mtime))


def copy() -> None:
    files = run(["git", "ls-files", "boards", "mcu", "Cargo.toml"], cwd=ROOT).stdout.split("\n")
    for name in filter(None, files):
        to = COPY / name
        to.parent.mkdir(parents=True, exist_ok=True)
        if not to.exists() or to.read_bytes() != (ROOT / name).read_bytes():
            shutil.copy(ROOT / name, to)


def main() -> int:
    chosen = sys.argv[1:] or [name for name, *_ in FAULTS]
    program, missed = tests(), []
    for name, file, text, fault, feature, test in FAULTS:
        if name not in chosen:
            continue
        copy()
        source = (COPY / file).read_text()
        assert source.count(text) == 1, f"{name}: {text!r} is {source.count(text)} times in {file}"
        (COPY / file).write_text(source.replace(text, fault))
        built = run(["bash", "boards/build.sh", BOARD], cwd=COPY, env={**os.environ, "FEATURES": feature})
        assert built.returncode == 0, f"{name}: {built.stderr}"
        elf = COPY / "boards/target/thumbv8m.main-none-eabihf/release" / BOARD
        variable = "NIRSPI_SILICON_PARALLEL_ELF" if feature else "NIRSPI_SILICON_ELF"
        wanted = "tests::parallel::frames" if feature else test
        tried = run([program, wanted], cwd=ROOT / "tests/silicon", env={**os.environ, variable: str(elf)})
        seen = tried.returncode != 0
        words = [line for line in tried.stdout.splitlines() if "expected" in line or "assert" in line or '    "' in line]
        print(f"{name}: {'seen' if seen else 'MISSED'}: {' '.join(words[:3]).strip()[:600]}", flush=True)
        if not seen:
            missed.append(name)
    print(f"missed: {missed}" if missed else "all seen")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
