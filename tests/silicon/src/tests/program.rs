//! The program `nirspi`, as a process of its own, in front of the chip.

use super::*;
use crate::camera::{Bridge, library, root};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The program, from the release build.
fn program() -> Option<PathBuf> {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let program = target.join("release/nirspi");
    if !program.exists() {
        println!("skipped: no {} (cargo build --release)", program.display());
        return None;
    }
    Some(program)
}

#[test]
fn the_program_captures_over_tcp_as_from_a_camera_on_a_bench() {
    let (Some(library), Some(program)) = (library(), program()) else { return };
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let camera = format!("tcp:{}", listener.local_addr().unwrap());
    let done = Arc::new(AtomicBool::new(false));
    let ended = Arc::clone(&done);
    let chip = std::thread::spawn(move || {
        let mut machine = plan().machine(&library);
        let goes_on = &mut |_: &mut _| !ended.load(Ordering::Relaxed);
        Bridge::new(&listener).unwrap().serve(&mut machine, goes_on).unwrap();
        (machine.violations(), machine.resets.clone(), machine.now_us())
    });
    let out = std::env::temp_dir().join(format!("nirspi-silicon-{}", std::process::id()));
    let run = |arguments: &[&str]| {
        let output = Command::new(&program).args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            output.status.success(),
            "{arguments:?}: {said}{}",
            String::from_utf8_lossy(&output.stderr)
        );
        said
    };
    let begun = Instant::now();
    let said = run(&["camera", "info", "--camera", &camera]);
    assert!(said.contains("nucleo-u5a5zj-q"), "{said}");
    let recording = out.join("frames.mcap");
    std::fs::create_dir_all(&out).unwrap();
    let recording = recording.to_str().unwrap();
    let said = run(&[
        "capture", "--camera", &camera, "--frames", "100", "--sweeps", "24", "--out", recording,
        "--json",
    ]);
    assert!(said.contains("\"received\": 100"), "{said}");
    let picture = out.join("picture");
    run(&["reconstruct", recording, "--method", "hadamard", "--out", picture.to_str().unwrap()]);
    done.store(true, Ordering::Relaxed);
    let (violations, resets, us) = chip.join().unwrap();
    println!("{:.1} s of the chip in {:.1} s", us / 1e6, begun.elapsed().as_secs_f64());
    std::fs::remove_dir_all(&out).unwrap();
    assert_eq!((violations, resets), (vec![], vec![]));
}
