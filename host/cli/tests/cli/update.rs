//! `nirspi camera update`, up to where a camera that can be updated would be needed: `host/update/src/tests.rs` goes on.

use crate::bench::Bench;
use nirspi_update::{Component, Source, pack};

#[test]
fn a_release_that_does_not_fit_is_one_line_and_changes_nothing() {
    let bench = Bench::new();
    bench.write("bits", &[&[0xFF, 0x00][..], &[7; 3000], &[0xFF; 40]].concat());
    bench.write("elf", b"\x7fELF and so on");
    let source = |file, component, board: &str| Source {
        path: bench.path(file),
        component,
        board: board.to_owned(),
    };
    let sources = [
        source("elf", Component::Firmware, "nucleo-u5a5zj-q"),
        source("bits", Component::Gateware, "ecp5-evn"),
    ];
    pack(&sources, &bench.path("release")).unwrap();
    let update = |what: &str, more: &[&str]| {
        bench.run(&[&["camera", "update", what, "--camera", "virtual"], more].concat())
    };
    update("release", &[]).failed(1, &["nucleo-u5a5zj-q", "camera's board is virtual"]);
    for more in [&["--check", "--json"][..], &["--check"], &[]] {
        update("release/ecp5-evn.bit", more)
            .failed(1, &["ecp5-evn.bit", "board is virtual, which loads none"]);
    }
    update("bits", &[]).failed(1, &["bits", "release.json"]);
    std::fs::write(bench.path("release/ecp5-evn.bit"), b"cut").unwrap();
    update("release/ecp5-evn.bit", &[]).failed(1, &["3 bytes, expected 3042"]);
}
