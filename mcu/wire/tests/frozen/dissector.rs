//! The names in Wireshark's dissector are the variants of the enums, in their order. `NIRSPI_BLESS=1` writes them there.

use super::variants;
use std::path::Path;

/// The dissector with the lists as they must be: `local Command = { "Hello", "Configure" }`.
fn renewed(dissector: &str) -> String {
    let line = |line: &str| {
        let name = line.strip_prefix("local ").and_then(|rest| rest.split_once(" = {"))?.0;
        let of = variants::ALL.iter().filter_map(|variant| variant.split_once("::"));
        let names: Vec<_> =
            of.filter(|(of, _)| *of == name).map(|(_, name)| format!("{name:?}")).collect();
        (!names.is_empty()).then(|| format!("local {name} = {{ {} }}", names.join(", ")))
    };
    dissector.lines().map(|old| line(old).unwrap_or_else(|| old.to_owned()) + "\n").collect()
}

#[test]
fn the_dissector_names_every_variant_in_its_order() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("wireshark/nirspi.lua");
    let found = std::fs::read_to_string(&path).unwrap();
    let expected = renewed(&found);
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    } else {
        assert!(found == expected, "{} is stale: NIRSPI_BLESS=1 writes it", path.display());
    }
    let missing = variants::ALL.iter().filter_map(|name| name.split_once("::"));
    let missing: Vec<_> =
        missing.filter(|(of, _)| !expected.contains(&format!("local {of} = {{"))).collect();
    assert!(missing.is_empty(), "enums that the dissector does not have: {missing:?}");
}
