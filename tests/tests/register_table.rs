//! Writes docs/registers.md, the register map, from the wire crate: `NIRSPI_BLESS=1` writes it anew.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::root;
use nirspi_wire::register::{Access, ORDER_TABLE, Register};
use std::fmt::Write;

const HEAD: &str = "\
# Register map

<!-- Written by tests/tests/register_table.rs: NIRSPI_BLESS=1 cargo test --test all register_table -->

This page is for people who write firmware or gateware: the registers of the FPGA, which the
microcontroller reads and writes by the host port. Addresses have 16 bits, values 32. Bits of single
registers are constants beside the registers, in
[`mcu/wire/src/register.rs`](../mcu/wire/src/register.rs). How an access is checked, and what
answers without the ADC's clock, is in the log ([Gateware](log/gateware.md#register-table)).
";

/// What the source says of each register: the lines of its doc comment.
fn words(source: &str) -> Vec<(String, String)> {
    let map = source.split_once("\nregisters! {\n").unwrap().1.split_once("\n}\n").unwrap().0;
    let (mut found, mut said) = (Vec::new(), String::new());
    for line in map.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("/// ") {
            said = format!("{said} {words}");
        } else {
            let name = line.split_once(' ').unwrap().0.to_owned();
            let plain = said.trim().replace("[`", "`").replace("`]", "`").replace('|', "\\|");
            found.push((name, plain));
            said.clear();
        }
    }
    found
}

fn page(source: &str) -> String {
    let words = words(source);
    assert_eq!(words.len(), Register::ALL.len());
    let mut page =
        format!("{HEAD}\n| register | address | access | after reset | what it does |\n");
    page += "| -- | -- | -- | -- | -- |\n";
    for (register, (name, said)) in Register::ALL.iter().zip(&words) {
        assert_eq!(name, &format!("{register:?}"));
        let access = match register.access() {
            Access::ReadOnly => "read",
            Access::ReadWrite => "read, write",
            Access::Command => "command",
        };
        let (address, reset) = (register.address(), register.reset());
        writeln!(page, "| `{name}` | 0x{address:02X} | {access} | 0x{reset:X} | {said} |").unwrap();
    }
    writeln!(
        page,
        "\nThe order table begins at 0x{ORDER_TABLE:04X}: 1024 entries of 10 bits, read and written. \
         A command reads as 0,\nand a written 1 acts once."
    )
    .unwrap();
    page
}

#[test]
fn the_page_of_registers_is_the_map_of_the_wire_crate() {
    let source = std::fs::read_to_string(root().join("mcu/wire/src/register.rs")).unwrap();
    let (path, expected) = (root().join("docs/registers.md"), page(&source));
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "docs/registers.md is stale: NIRSPI_BLESS=1 writes it");
}
