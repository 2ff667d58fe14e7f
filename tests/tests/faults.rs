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
    let found = std::fs::read_to_string(&path).unwrap();
    let columns = std::thread::scope(|scope| {
        let there = |place: Place| {
            let found = &found;
            scope.spawn(
                move || if place.is_here() { tried_there(place) } else { kept(found, place) },
            )
        };
        PLACES.map(there).map(|thread| thread.join().unwrap())
    });
    let (above, _) = found.split_once(HEADING).unwrap_or_else(|| panic!("{PAGE}: no {HEADING}"));
    let mut page = format!("{above}{HEADING}\n\n");
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
    let found = std::fs::read_to_string(&path).unwrap();
    assert!(found == page, "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test all faults\n{page}");
}
