//! The fault matrix: every fault of the way from camera to host, on every kind of camera that this machine
//! has. Each cell is one capture with the fault and one after it. The counters must be exactly those of the
//! injector's own log, the LEDs must be off afterwards, and the capture after it must be whole. The column of
//! the simulated USB core is kept: `boards/usb/src/tests/faults.rs` tries it.
//!
//! The table of `docs/log/reliability.md` is what the cells have found; `NIRSPI_BLESS=1` writes it.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

mod fault_matrix;

use fault_matrix::{Cell, FAULTS, Fault, PLACES, Place, tried};
use nirspi_tests::pages::column;
use nirspi_tests::root;
use std::fmt::Write;

const PAGE: &str = "docs/log/reliability.md";
const HEADING: &str = "## Each fault";

const HEAD: &str = "# Reliability

What happens when something fails between camera and host. `cargo test --test all faults` tries the
cells of the [table](#each-fault) and writes this page (`NIRSPI_BLESS=1`); a stale page fails the
test. Everything here is simulated:

| column | camera | link | tried by |
| -- | -- | -- | -- |
| virtual camera | the firmware's logic on the gateware's golden model | in the process | `cargo test --test all faults` |
| over TCP | the same behind the program's server | a socket of the same machine | the same |
| replay | a recording of the virtual camera | a file | the same |
| emulated board | the firmware's machine code in QEMU, the golden model behind it | a serial line | the same, where QEMU is; elsewhere the test says `skipped: no qemu` and keeps the cells |
| USB, simulated | the firmware's loop, the USB device and the chip's driver on a [simulated core](firmware.md#usb-simulated), a simple FPGA | a simulated bus with its host | `cargo test -p nirspi-usb` in `boards`, which writes this column |

Each cell is one capture of 40 frames with the fault, and one of 10 frames after it, from a fixed
seed. In every cell

- nothing panics, and nothing waits for ever;
- the four counters of [frames](../recordings.md) are exactly those that follow from the injector's
  own log: a damaged packet is one *corrupt* frame, a lost one is *lost*, one that comes after its
  successor is *late*. On the simulated bus a simple host has exactly the frames that the camera
  made less those that the log says;
- after the capture no LED shines, and the firmware does not run;
- the capture after it, in a new session with the same camera, is whole.

The cell says how the capture with the fault ended. [Safety](../safety.md) says what switches the
LEDs off, and [Firmware](firmware.md#every-state-of-a-session) what was checked in every state that
the firmware can reach. No cable of a real camera was ever pulled.

## Ten million frames

`cargo run --release -p nirspi-tests --example soak` sends ten million frames, one of 256 with a
fault at random and one session of ten cut off, through capture, recording and reconstruction. It
ends at the first frame that is not accounted for or image that is wrong, and draws the memory that
it takes.

Seen on 22 November 2026 (simulated, release build, a busy machine): 10 001 001 frames in 103
sessions, 32 074 of them with a fault, none not accounted for, every image right, 289 s of a
processor and 20 to 23 MB of memory from the first session to the last:

![Resident memory over ten million frames](reliability/memory.png)

## A thousand clients that misbehave

```sh
python3 host/scripts/serve_soak.py target/release/nirspi --plot memory.svg --markdown    # ten minutes; Linux, Python alone
```

The command starts `nirspi serve` with a token, and lets it open 256 files (`ulimit -n 256`). 1000
clients, from 40 addresses of the same machine, each do one of the things in the table, and again.
All the while one page reads its events and asks for the state each second; every ten seconds a page
is opened anew. The command exits with 1 if the page's stream ends, if a page waits for more than 5
s, if a client without the right to do so gets any answer but a refusal, or if memory or open files
grow. It prints the tables below, and without `--markdown` all that it saw as JSON.

Seen on 22 November 2026 (simulated camera, release build, two cores that clients and builds used
too, load 10), in 599 s: 620 668 connections, 1034 a second, a fifth of them to a WebSocket server
that has gone since. A new connection takes the place of the
[oldest one without an event stream](../live-page-network.md#who-can-open-the-page), so most
connections were closed before their answer.

| a client that | connections | answered | closed by the program | left by the client |
| -- | -- | -- | -- | -- |
| says nothing | 41 646 | 0 | 41 624 | 22 |
| sends half a request | 41 526 | 0 | 41 519 | 7 |
| sends a request a byte at a time | 41 374 | 0 | 41 374 | 0 |
| sends half a body | 41 152 | 0 | 41 144 | 8 |
| sends a body without end | 41 241 | 6 with 413 | 41 235 | 0 |
| sends headers of 1 MB | 41 462 | 1 336 with 431 | 40 126 | 0 |
| sends noise | 41 392 | 28 079 with 400 | 13 313 | 0 |
| asks for 200 files and reads none | 41 254 | 0 | 41 247 | 7 |
| opens the events and reads none | 41 457 | 0 | 37 585 | 3 872 |
| connects and leaves | 41 418 | 0 | 0 | 41 418 |
| has a wrong token | 41 341 | 27 931 with 401 | 13 410 | 0 |
| is a page of another site | 41 437 | 28 243 with 403 | 13 194 | 0 |

| what a good page and the program saw | before | among the clients |
| -- | -- | -- |
| images a second | 21.6 | 14.7 |
| processors of `nirspi serve` | 0.86 | 0.6 |
| frames lost, of 932 373 |  | 0 |
| longest time without a new state on the page |  | 0.72 s |
| ends of the page's stream |  | 0 |
| requests of the page, answered at the first attempt; median and longest wait |  | 595 of 599; 3.8 ms, 0.28 s |
| pages opened anew, at the first attempt; median and longest wait |  | 22 of 59; 0.26 s, 3.59 s |
| memory: mean before, in the first and in the last quarter | 61 MiB | 68 and 71 MiB |
| open files: before, most, afterwards | 9 | 238, then 9 |

A page that is opened anew waits for a place among the event streams: clients that never read have
taken all of them, and a stream gives way when nothing could be written to it for 2 s.

![Resident memory of nirspi serve over ten minutes](reliability/crowd.svg)

## Each fault

";

/// The cells of one place in the order of the faults: what the page says, or what is broken.
fn tried_there(place: Place) -> Vec<Result<String, String>> {
    let cell = |fault| match std::panic::catch_unwind(|| tried(fault, place)) {
        Ok(Cell::Survived(words)) => Ok(words),
        Ok(Cell::None(why)) => Ok(format!("- ({why})")),
        Ok(Cell::Broken(why)) => Err(format!("{fault:?}, {place:?}: {why}")),
        Err(_) => Err(format!("{fault:?}, {place:?}: panicked")),
    };
    FAULTS.map(cell).into()
}

/// The cells that the page has for a place where nothing can be tried now.
fn kept(page: &str, place: Place) -> Vec<Result<String, String>> {
    let mut cells = column(page, HEADING, place.title());
    let missing = |fault: Fault| format!("{fault:?}, {place:?}: {PAGE} has no cell to keep");
    FAULTS.map(|fault| cells.remove(fault.title()).ok_or_else(|| missing(fault))).into()
}

#[test]
fn every_fault_is_counted_and_survived() {
    let path = root().join(PAGE);
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    let columns = std::thread::scope(|scope| {
        let there = |place: Place| {
            let found = &found;
            scope.spawn(
                move || if place.is_here() { tried_there(place) } else { kept(found, place) },
            )
        };
        PLACES.map(there).map(|thread| thread.join().unwrap())
    });
    let mut page = HEAD.to_owned();
    let titles: Vec<&str> = PLACES.iter().map(|place| place.title()).collect();
    writeln!(page, "| fault | {} |", titles.join(" | ")).unwrap();
    writeln!(page, "| -- |{}", " -- |".repeat(PLACES.len())).unwrap();
    let mut broken = Vec::new();
    for (row, fault) in FAULTS.iter().enumerate() {
        write!(page, "| {} |", fault.title()).unwrap();
        for cell in columns.iter().map(|column| &column[row]) {
            match cell {
                Ok(words) => write!(page, " {words} |").unwrap(),
                Err(why) => broken.push(why),
            }
        }
        page.push('\n');
    }
    assert!(broken.is_empty(), "{broken:#?}");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == page, "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test all faults\n{page}");
}
