//! Every board's firmware fits the budget that docs/firmware.md states, has no heap, and can panic only where listed.
//!
//! What is not built is skipped aloud: `cargo build --release` in the folder of a board builds it.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::elf::Firmware;
use nirspi_tests::pages::{page, table};
use nirspi_tests::root;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

/// A row of the page's table of budgets.
struct Budget {
    board: String,
    flash_bytes: u64,
    static_bytes: u64,
    stack_bytes: u64,
}

const PAGE: &str = "docs/firmware.md";

fn budgets() -> Vec<Budget> {
    let number = |cell: &String| cell.replace(' ', "").parse().unwrap();
    let budget = |row: Vec<String>| {
        let [board, flash, statics, stack] = &row[..] else { panic!("four cells in {row:?}") };
        Budget {
            board: board.clone(),
            flash_bytes: number(flash),
            static_bytes: number(statics),
            stack_bytes: number(stack),
        }
    };
    table(&page(PAGE), "## Budgets").into_iter().map(budget).collect()
}

/// Past the test harness's capture, so that the table and a skipped board are seen.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The ELF, under `$NIRSPI_BOARDS_TARGET` or `boards/target`, if it has been built.
fn elf(board: &str) -> Option<PathBuf> {
    let given = std::env::var_os("NIRSPI_BOARDS_TARGET").map(PathBuf::from);
    let target = given.unwrap_or_else(|| root().join("boards/target"));
    ["thumbv8m.main-none-eabihf", "thumbv7em-none-eabihf"]
        .iter()
        .map(|triple| target.join(triple).join("release").join(board))
        .find(|path| path.is_file())
}

/// Every board that is built, with its budget.
fn built() -> Vec<(Budget, Firmware)> {
    let found = budgets().into_iter().filter_map(|budget| {
        let Some(path) = elf(&budget.board) else {
            say(&format!("skipped: {} is not built", budget.board));
            return None;
        };
        let firmware = Firmware::read(&path).unwrap();
        Some((budget, firmware))
    });
    found.collect()
}

#[test]
fn every_board_has_a_budget() {
    let folders: BTreeSet<String> = std::fs::read_dir(root().join("boards"))
        .unwrap()
        .filter_map(|entry| {
            let path = entry.unwrap().path();
            path.join("memory.x")
                .is_file()
                .then(|| path.file_name()?.to_str().map(str::to_owned))?
        })
        .collect();
    let budgeted: BTreeSet<String> = budgets().into_iter().map(|budget| budget.board).collect();
    assert_eq!(folders, budgeted);
}

#[test]
fn flash_and_memory_stay_within_their_budgets() {
    say("board              flash, bytes     of     static, bytes     of");
    let mut over = Vec::new();
    for (budget, firmware) in built() {
        let Budget { board, flash_bytes, static_bytes, .. } = &budget;
        say(&format!(
            "{board:<16} {:>14} {flash_bytes:>8} {:>14} {static_bytes:>8}",
            firmware.flash_bytes, firmware.static_bytes
        ));
        if firmware.flash_bytes > *flash_bytes || firmware.static_bytes > *static_bytes {
            over.push(budget.board);
        }
    }
    assert!(over.is_empty(), "over budget: {over:?}");
}

#[test]
fn there_is_room_for_the_stack() {
    for (budget, firmware) in built() {
        let (Some(start), Some(end)) =
            (firmware.symbol("_stack_start"), firmware.symbol("_stack_end"))
        else {
            panic!("{}: no stack symbols", budget.board);
        };
        assert!(start - end >= budget.stack_bytes, "{}: {} bytes", budget.board, start - end);
    }
}

#[test]
fn no_firmware_has_a_heap() {
    const HEAP: &[&str] = &["__rust_alloc", "__rg_alloc", "__rdl_alloc", "malloc", "GlobalAlloc"];
    for (budget, firmware) in built() {
        let found = firmware.symbols_with(HEAP);
        assert!(found.is_empty(), "{}: {found:?}", budget.board);
    }
}

/// Nowhere, so not in interrupts either: sums are integers until they are on the host.
#[test]
fn no_firmware_computes_with_floating_point() {
    const SOFT: &[&str] = &["__aeabi_f", "__aeabi_d", "__addsf", "__adddf", "__mulsf", "__muldf"];
    for (budget, firmware) in built() {
        let found = firmware.float_instructions();
        assert!(found.is_empty(), "{}: {found:x?}", budget.board);
        let found = firmware.symbols_with(SOFT);
        assert!(found.is_empty(), "{}: {found:?}", budget.board);
    }
}

/// Functions of `core` in which every panic begins.
const PANICS: &[&str] = &[
    "core::panicking::",
    "core::cell::panic_already",
    "core::option::unwrap_failed",
    "core::option::expect_failed",
    "core::result::unwrap_failed",
    "core::slice::index::slice_",
    "core::slice::copy_from_slice_impl::",
];

/// The emulated board: the same application, without a HAL that brings panics of its own.
#[test]
fn the_application_can_panic_only_where_the_page_says_and_why_it_does_not() {
    const BOARD: &str = "mps2-an505";
    let Some((_, firmware)) = built().into_iter().find(|(budget, _)| budget.board == BOARD) else {
        return;
    };
    // The list is of the compiler in boards/rust-toolchain.toml. Another one, as boards/build.sh may have to take, leaves
    // other panics and, from 1.96 on, spells names in another way ("_R" where "_ZN" stood).
    if firmware.symbols_with(&["nirspi_app"]).iter().any(|name| name.starts_with("_R")) {
        return say(&format!(
            "skipped: panics of {BOARD}, built by another compiler than the list"
        ));
    }
    let ours = |name: &str| name.contains("nirspi_");
    let panics = |name: &str| PANICS.iter().any(|part| name.starts_with(part));
    let found = firmware.calls(ours, panics);
    assert!(!found.is_empty(), "an async function can at least be polled after its end");
    let last = |name: &str| name.rsplit("::").next().map(str::to_owned);
    let listed: BTreeSet<(String, String)> = table(&page(PAGE), "## Panics")
        .into_iter()
        .map(|row| (row[0].clone(), row[1].clone()))
        .collect();
    let unlisted: Vec<_> = found
        .iter()
        .filter(|(caller, panic)| {
            !listed.contains(&((*caller).to_owned(), last(panic).unwrap_or_default()))
        })
        .collect();
    for (caller, panic) in &found {
        say(&format!("{caller}: {panic}"));
    }
    assert!(unlisted.is_empty(), "not in docs/firmware.md: {unlisted:#?}");
}
