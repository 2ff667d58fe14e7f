//! Tests that the register table of docs/log/gateware.md is the wire crate's.

use nirspi_tests::root;
use nirspi_wire::register::Register;

#[test]
fn every_register_stands_in_the_gateware_page_and_no_other() {
    let page = std::fs::read_to_string(root().join("docs/log/gateware.md")).unwrap();
    let rows: Vec<&str> =
        page.lines().filter(|line| line.starts_with("| `") && line.contains("` | 0x")).collect();
    let expected: Vec<String> = Register::ALL
        .iter()
        .map(|r| {
            format!("| `{r:?}` | {:#04X} | {:?} |", r.address(), r.access()).replace("0X", "0x")
        })
        .collect();
    assert_eq!(rows, expected);
}
