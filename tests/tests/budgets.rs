//! Tests that every board's firmware fits the budget of its `board.toml`, has no heap, and can
//! panic only where docs/log/firmware.md lists a place.
//!
//! A board that is not built is skipped with a message: `bash boards/build.sh` builds every board.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::boards::{BOARDS, Board};
use nirspi_tests::elf::Firmware;
use nirspi_tests::pages::{page, table};
use nirspi_tests::root;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

const PAGE: &str = "docs/log/firmware.md";

/// Prints past the test harness's capture, so that the table and a skipped board are visible.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The ELF, under `$NIRSPI_BOARDS_TARGET` or `boards/target`.
fn elf(board: &Board) -> PathBuf {
    match std::env::var_os("NIRSPI_BOARDS_TARGET") {
        Some(given) => PathBuf::from(given).join(board.target).join("release").join(board.name),
        None => root().join(board.elf()),
    }
}

/// Every board that is built.
fn built() -> Vec<(&'static Board, Firmware)> {
    let found = BOARDS.iter().filter_map(|board| {
        let path = elf(board);
        if !path.is_file() {
            say(&format!("skipped: {} is not built", board.name));
            return None;
        }
        Some((board, Firmware::read(&path).unwrap()))
    });
    found.collect()
}

#[test]
fn flash_and_memory_stay_within_their_budgets() {
    say("board              flash, bytes     of     static, bytes     of");
    let mut over = Vec::new();
    for (board, firmware) in built() {
        let Board { name, flash_bytes, static_bytes, .. } = board;
        say(&format!(
            "{name:<16} {:>14} {flash_bytes:>8} {:>14} {static_bytes:>8}",
            firmware.flash_bytes, firmware.static_bytes
        ));
        if firmware.flash_bytes > *flash_bytes || firmware.static_bytes > *static_bytes {
            over.push(name);
        }
    }
    assert!(over.is_empty(), "over budget: {over:?}");
}

#[test]
fn there_is_room_for_the_stack() {
    for (board, firmware) in built() {
        let (Some(start), Some(end)) =
            (firmware.symbol("_stack_start"), firmware.symbol("_stack_end"))
        else {
            panic!("{}: no stack symbols", board.name);
        };
        assert!(start - end >= board.stack_bytes, "{}: {} bytes", board.name, start - end);
    }
}

#[test]
fn no_firmware_has_a_heap() {
    const HEAP: &[&str] = &["__rust_alloc", "__rg_alloc", "__rdl_alloc", "malloc", "GlobalAlloc"];
    for (board, firmware) in built() {
        let found = firmware.symbols_with(HEAP);
        assert!(found.is_empty(), "{}: {found:?}", board.name);
    }
}

/// Functions with an instruction of the floating-point unit.
fn float_functions(firmware: &Firmware) -> BTreeSet<&str> {
    firmware.float_instructions().into_iter().map(|(_, name)| name).collect()
}

/// Sums are integers until they reach the host; the page lists the functions of the telemetry, none
/// of which sees a frame.
#[test]
fn only_the_telemetry_computes_with_floating_point() {
    const SOFT: &[&str] = &["__aeabi_f", "__aeabi_d", "__addsf", "__adddf", "__mulsf", "__muldf"];
    let listed: BTreeSet<String> =
        table(&page(PAGE), "## Floating point").into_iter().map(|row| row[0].clone()).collect();
    for (board, firmware) in built() {
        // The compiler's name for code that several functions share says nothing: its callers do.
        let shared = |name: &str| name.starts_with("OUTLINED_FUNCTION");
        let float = float_functions(&firmware);
        let callers = firmware.calls(|_| true, |name| shared(name) && float.contains(name));
        let own = float.iter().copied().filter(|name| !shared(name));
        let unlisted: Vec<_> = own
            .chain(callers.iter().map(|(caller, _)| *caller))
            .filter(|name| !listed.contains(*name))
            .collect();
        assert!(unlisted.is_empty(), "{}: not in {PAGE}: {unlisted:#?}", board.name);
        let found = firmware.symbols_with(SOFT);
        assert!(found.is_empty(), "{}: {found:?}", board.name);
    }
}

/// Otherwise every interrupt would save the registers of the floating-point unit, too.
#[test]
fn no_interrupt_computes_with_floating_point() {
    for (board, firmware) in built() {
        let run = firmware.run_by_interrupts();
        assert!(run.len() > 3, "{}: the vector table leads nowhere: {run:?}", board.name);
        let float = float_functions(&firmware);
        let found: Vec<_> = float.intersection(&run).collect();
        assert!(found.is_empty(), "{}: {found:?}", board.name);
    }
}

/// A boot loader whose stack lies below a limit of ours faults at its first push.
#[test]
fn the_boot_loader_is_entered_without_our_stack_limit() {
    for (board, firmware) in built() {
        if board.chip.is_none() {
            continue;
        }
        let found = firmware.stack_limit_instructions();
        let at_start = found.iter().filter(|(_, name)| *name == "Reset").count();
        let later = found.len() - at_start;
        // Firmware that sets the limit at its start also clears it before it jumps to the boot loader.
        assert_eq!(at_start > 0, later > 0, "{}: {found:x?}", board.name);
    }
}

#[test]
fn a_hard_fault_switches_the_leds_off_before_anything_else() {
    for (board, firmware) in built() {
        if board.chip.is_none() {
            continue;
        }
        let of_board = |path: &str| format!("{}::{path}", board.name.replace('-', "_"));
        let first = firmware.first_call(&of_board("crash::fault"));
        assert_eq!(first, Some(&*of_board("crash::darken")), "{}", board.name);
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

/// The emulated board: the same application, without a HAL with panics of its own.
#[test]
fn the_application_can_panic_only_where_the_page_says_and_why_it_does_not() {
    const BOARD: &str = "mps2-an505";
    let Some((_, firmware)) = built().into_iter().find(|(board, _)| board.name == BOARD) else {
        return;
    };
    // The list belongs to the compiler in boards/rust-toolchain.toml. Another compiler, which
    // boards/build.sh may have to use, leaves other panics and, from 1.96 on, mangles names
    // differently ("_R" instead of "_ZN").
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
    assert!(unlisted.is_empty(), "not in docs/log/firmware.md: {unlisted:#?}");
}
