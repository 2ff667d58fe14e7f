//! Tests that generated files match their sources. `NIRSPI_BLESS=1` writes the files again.

use crate::map;
use crate::project::{Project, files, folder};
use std::{collections::BTreeMap, path::Path};

fn check(folder: &Path, extension: &str, fresh: &BTreeMap<String, String>, whole_folder: bool) {
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::create_dir_all(folder).unwrap();
        for (name, text) in fresh {
            std::fs::write(folder.join(format!("{name}.{extension}")), text).unwrap();
        }
    }
    let committed = files(folder);
    for (name, text) in fresh {
        assert!(
            committed.get(name) == Some(text),
            "{name}.{extension} is stale: run the tests with NIRSPI_BLESS=1 and commit it"
        );
    }
    for name in committed.keys() {
        assert!(!whole_folder || fresh.contains_key(name), "{name}.{extension} has no source");
    }
}

#[test]
fn every_source_is_formatted() {
    check(&folder("rtl"), "veryl", &Project::read().format(), true);
}

#[test]
fn the_register_map_and_the_emitted_systemverilog_are_fresh() {
    let package = BTreeMap::from([("register_map".to_owned(), map::package())]);
    check(&folder("rtl"), "veryl", &package, false);
    check(&folder("sv"), "sv", &Project::read().emit(), true);
}
