//! `nirspi camera info` and `nirspi camera devices`: who is there, and whether it fits.

use crate::bench::Bench;

#[test]
fn the_virtual_camera_is_of_this_version_and_needs_nothing() {
    let bench = Bench::new();
    let report = bench.run(&["camera", "info", "--camera", "virtual", "--json"]).succeeded().json();
    assert_eq!(report["camera"]["firmware"], env!("CARGO_PKG_VERSION"));
    let parts = report["parts"].as_array().unwrap();
    let names: Vec<_> = parts.iter().map(|part| part["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["protocol", "firmware", "gateware", "register map"]);
    assert!(parts.iter().all(|part| part["compared"] == "same"), "{report}");
    assert_eq!(
        (&report["fpga_answers"], &report["interlock_closed"]),
        (&true.into(), &true.into())
    );

    let said = bench.run(&["camera", "info", "--camera", "virtual"]).succeeded().stdout;
    assert!(said.starts_with("virtual virtual-1\n") && said.contains("interlock closed"), "{said}");
    assert_eq!(said.matches("as expected").count(), 4, "{said}");
    // Without a name, a note says which camera it is.
    let note = "note: no camera found on USB: using the virtual camera\n";
    assert_eq!(bench.run(&["camera", "info"]).succeeded().stdout.replace(note, ""), said);
}

#[test]
fn a_camera_that_is_not_on_usb_is_one_line() {
    let bench = Bench::new();
    let camera = "usb:no-such-serial-number";
    // Words that hold with no USB at all, too.
    bench.run(&["capture", "--camera", camera, "--frames", "1"]).failed(1, &["USB"]);
    assert!(bench.names().is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn the_udev_rule_is_installed_checked_and_removed() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("rules.d")).unwrap();
    let setup =
        |more: &[&str]| bench.run(&[&["camera", "setup", "--rules-dir", "rules.d"], more].concat());
    assert_eq!(setup(&["--check"]).code, Some(1));
    setup(&[]).succeeded();
    setup(&["--check"]).succeeded();
    assert!(bench.path("rules.d/60-nirspi.rules").exists());
    setup(&["--group", "root"]).succeeded();
    let rule = std::fs::read_to_string(bench.path("rules.d/60-nirspi.rules")).unwrap();
    assert!(rule.contains("GROUP=\"root\""), "{rule}");
    setup(&["--check"]).succeeded();
    setup(&["--group", "a b"]).failed(2, &["--group", "no name of a group"]);
    if std::path::Path::new("/usr/bin/getent").exists() {
        setup(&["--group", "no-such-group-here"]).failed(2, &["no group no-such-group-here"]);
    }
    setup(&["--uninstall"]).succeeded();
    assert_eq!(setup(&["--check"]).code, Some(1));
}

#[cfg(not(feature = "flash"))]
#[test]
fn a_build_that_cannot_flash_says_how_to_get_one_that_can() {
    let bench = Bench::new();
    let words = ["--features flash", "probe-rs run"];
    bench.run(&["camera", "flash", "--board", "nucleo-u5a5zj-q"]).failed(1, &words);
    bench.run(&["camera", "flash", "--list"]).failed(1, &words);
}

#[cfg(feature = "flash")]
#[test]
fn a_missing_firmware_file_says_how_to_build_it() {
    let bench = Bench::new();
    let flash = ["camera", "flash", "--board", "nucleo-u5a5zj-q"];
    bench.run(&flash).failed(1, &["boards/target", "bash boards/build.sh nucleo-u5a5zj-q"]);
    bench.run(&["camera", "flash", "--list"]).succeeded();
}

/// Without a board at hand: what was named is what is read and looked for.
#[cfg(feature = "flash")]
#[test]
fn flash_reads_the_file_and_looks_for_the_probe_that_were_named() {
    let bench = Bench::new();
    let flash = |more: &[&str]| {
        bench.run(&[&["camera", "flash", "--board", "nucleo-u5a5zj-q"][..], more].concat())
    };
    flash(&["--elf", "missing.elf"]).failed(1, &["missing.elf"]);
    bench.write("own.elf", b"not read before a probe is found");
    let refused = flash(&["--elf", "own.elf", "--probe", "ffff:ffff:none"]);
    let probes = bench.run(&["camera", "flash", "--list"]).succeeded().stdout;
    // A machine with a probe names it beside the one that is not there.
    let words = if probes.contains("no debug probe:") { "ST-LINK" } else { "ffff:ffff:none" };
    refused.failed(1, &["no debug probe", words]);
}
