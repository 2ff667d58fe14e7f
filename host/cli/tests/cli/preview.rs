//! The small image that `nirspi capture` shows on a terminal while it runs.

use crate::bench::{self, Bench};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::Read;
use std::process::{Command, Stdio};

/// What `nirspi capture` writes to a terminal of 256 colours.
fn written_to_a_terminal(no_colour: Option<&str>, more: &[&str]) -> String {
    let bench = Bench::new();
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
    let terminal = File::options().write(true).open(path).unwrap();
    let mut program = Command::new(bench::program());
    program
        .args(["capture", "--frames", "4000", "--no-calibration", "--adc-latency", "6"])
        .args(more)
        .current_dir(bench.path(""))
        .env("TERM", "xterm-256color")
        .env_remove("COLORTERM")
        .env_remove("NO_COLOR")
        .envs(no_colour.map(|value| ("NO_COLOR", value)))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(terminal);
    let mut child = program.spawn().unwrap();
    // The child's end of the terminal is the only one now, so reading ends with the child.
    drop(program);
    let mut written = Vec::new();
    let _ = File::from(master).read_to_end(&mut written);
    assert!(child.wait().unwrap().success());
    String::from_utf8(written).unwrap()
}

#[test]
fn a_terminal_shows_the_newest_frames_as_an_image() {
    let written = written_to_a_terminal(None, &[]);
    let pixels = written.matches('▀').count();
    // Each drawing has 16 lines of 32 characters.
    assert!(pixels > 0 && pixels.is_multiple_of(512), "{pixels}");
    assert!(written.contains("received"), "{written:?}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_terminal_without_colours_and_a_quiet_capture_show_no_image() {
    assert!(!written_to_a_terminal(Some("1"), &[]).contains('▀'));
    assert_eq!(written_to_a_terminal(None, &["--quiet"]), "");
}
