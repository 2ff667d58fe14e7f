//! The fault matrix: every fault of the way from camera to host, on every kind of camera that this machine
//! has. Each cell is one capture with the fault and one after it. The counters must be exactly those of the
//! injector's own log, the LEDs must be off afterwards, and the capture after it must be whole.
//!
//! The table of `docs/reliability.md` is what the cells have found; `NIRSPI_BLESS=1` writes it.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

mod fault_matrix;

use fault_matrix::{Cell, FAULTS, PLACES, tried};
use nirspi_tests::root;
use std::fmt::Write;

const PAGE: &str = "docs/reliability.md";

const HEAD: &str = "# Reliability

What happens when something fails between camera and host. `cargo test --test faults` tries every
cell of the table and writes this page (`NIRSPI_BLESS=1`); a stale page fails the test. Everything
here is simulated: the real firmware logic on the gateware's golden model, or a recording of that.

Each cell is one capture of 40 frames with the fault, and one of 10 frames after it, from a fixed
seed. In every cell

- nothing panics, and nothing waits for ever;
- the four counters of [frames](recordings.md) are exactly those that follow from the injector's own
  log: a damaged packet is one *corrupt* frame, a lost one is *lost*, one that comes after its
  successor is *late*;
- after the capture no LED shines, and the firmware does not run;
- the capture after it, in a new session with the same camera, is whole.

The cell says how the capture with the fault ended. [Safety](safety.md) says what switches the LEDs
off, and [Firmware](firmware.md#every-state-of-a-session) what was checked in every state that the
firmware can reach. USB's own faults are tested on a simulated core
([Firmware](firmware.md#usb-simulated)); no cable of a real camera was ever pulled.

`cargo run --release -p nirspi-tests --example soak` sends ten million frames, one of 256 with a
fault at random and one session of ten cut off, through capture, recording and reconstruction. It
ends at the first frame that is not accounted for or image that is wrong, and draws the memory that
it takes.

Seen on 22 November 2026 (simulated, release build, a busy machine): 10 001 001 frames in 103
sessions, 32 074 of them with a fault, none not accounted for, every image right, 289 s of a
processor and 20 to 23 MB of memory from the first session to the last:

![Resident memory over ten million frames](reliability/memory.png)

";

#[test]
fn every_fault_is_counted_and_survived() {
    let mut page = HEAD.to_owned();
    let columns: Vec<&str> = PLACES.iter().map(|place| place.title()).collect();
    writeln!(page, "| fault | {} |", columns.join(" | ")).unwrap();
    writeln!(page, "| -- |{}", " -- |".repeat(PLACES.len())).unwrap();
    let mut broken = Vec::new();
    for fault in FAULTS {
        write!(page, "| {} |", fault.title()).unwrap();
        for place in PLACES {
            let cell = std::panic::catch_unwind(|| tried(fault, place));
            match cell {
                Ok(Cell::Survived(words)) => write!(page, " {words} |").unwrap(),
                Ok(Cell::None(why)) => write!(page, " - ({why}) |").unwrap(),
                Ok(Cell::Broken(why)) => broken.push(format!("{fault:?}, {place:?}: {why}")),
                Err(_) => broken.push(format!("{fault:?}, {place:?}: panicked")),
            }
        }
        page.push('\n');
    }
    assert!(broken.is_empty(), "{broken:#?}");
    let path = root().join(PAGE);
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == page, "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test faults\n{page}");
}
