//! Files that are not what they should be: one line, no result, nothing left behind.

use crate::bench::{Bench, Measured};
use nirspi::identity::CameraIdentity;
use nirspi::recording::{Opening, Recorder, RunAccount, Target};
use nirspi::response::Settling;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::samples::Width;
use nirspi_wire::{DeviceMessage, Frame, FrameFlags, Samples, encode};

/// Reconstructs a file of these bytes, which must fail and leave nothing behind.
#[track_caller]
fn refused(bench: &Bench, name: &str, bytes: &[u8], words: &[&str]) {
    bench.write(name, bytes);
    let outcome =
        bench.run(&["reconstruct", name, "--out", "out"]).failed(1, &[&[name], words].concat());
    assert!(outcome.stdout.is_empty(), "{outcome:?}");
    assert!(!bench.path("out").exists(), "{:?}", bench.names());
}

#[test]
fn readings_too_large_for_the_image_are_refused() {
    let (bench, measured) = (Bench::new(), Measured::new(2));
    // Each reading is finite; their differences are not in 32 bits.
    let y = [f32::MAX, -f32::MAX].repeat(4);
    let bytes = measured.npz_with("y", Some((&[8], &y)));
    refused(&bench, "large.npz", &bytes, &["too large"]);
}

#[test]
fn files_of_another_kind_are_refused() {
    let bench = Bench::new();
    refused(&bench, "empty.npz", b"", &["an empty file"]);
    refused(&bench, "text.npz", b"hello, world", &["a text file without numbers", ".npz"]);
    refused(&bench, "empty.mcap", b"", &["nirspi recording"]);
    refused(&bench, "text.mcap", b"hello, world, this is no recording", &["another kind"]);
    bench.run(&["reconstruct", "none.npz"]).failed(1, &["none.npz", "no such file"]);
    bench.run(&["reconstruct", "."]).failed(1, &["none of 4 files gave an image", "./empty.mcap"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_recording_cut_anywhere_gives_what_is_before_the_cut_or_says_what_is_missing() {
    let bench = Bench::new();
    bench.run(&["capture", "--frames", "150", "--out", "whole.mcap"]).succeeded();
    let whole = std::fs::read(bench.path("whole.mcap")).unwrap();
    let mut kept = 0;
    for cut in (0..whole.len()).step_by(whole.len() / 12).chain([1, 20, 300, 3000]) {
        bench.write("cut.mcap", &whole[..cut]);
        let outcome = bench.run(&["reconstruct", "cut.mcap", "--method", "hadamard", "--json"]);
        if outcome.code == Some(0) {
            kept += 1;
            let report = outcome.json();
            assert!(report["warnings"][0].as_str().unwrap().contains("cut short"), "{report}");
            assert!(report["frames"]["received"].as_u64().unwrap() > 0, "{report}");
        } else {
            outcome.failed(1, &["cut.mcap"]);
        }
    }
    assert!(kept > 0, "nothing of the recording was saved");
}

#[test]
fn a_damaged_packet_in_a_recording_costs_one_frame() {
    let bench = Bench::new();
    bench.run(&["capture", "--frames", "600", "--out", "rec.mcap"]).succeeded();
    let mut bytes = std::fs::read(bench.path("rec.mcap")).unwrap();
    let early = bytes.len() / 5;
    bytes[early] ^= 0x10;
    bench.write("rec.mcap", &bytes);
    let outcome = bench.run(&["reconstruct", "rec.mcap", "--method", "hadamard", "--json"]);
    let report = outcome.succeeded().json();
    assert_eq!(report["frames"]["received"], 599, "{report}");
    assert_eq!(report["frames"]["corrupt"], 1, "{report}");
    assert!(report["warnings"][0].as_str().unwrap().contains("damaged"), "{report}");
    // The warning is on stderr, and --quiet does not hide it.
    let export = ["recording", "export", "rec.mcap", "--to", "npz", "--out", "x.npz", "--quiet"];
    let outcome = bench.run(&export);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let told = ["nirspi: warning: the recording is not whole: 599 received, 0 lost, 1 corrupt"];
    assert!(told.iter().all(|part| outcome.stderr.contains(part)), "{outcome:?}");
}

#[test]
fn a_recording_that_is_there_is_not_written_over() {
    let bench = Bench::new();
    bench.write("rec.mcap", b"precious");
    let capture = |more: &[&str]| {
        bench.run(&[&["capture", "--frames", "2", "--out", "rec.mcap"], more].concat())
    };
    capture(&[]).failed(2, &["rec.mcap is there already", "--overwrite"]);
    assert_eq!(std::fs::read(bench.path("rec.mcap")).unwrap(), b"precious");
    capture(&["--overwrite"]).succeeded();
    bench.run(&["reconstruct", "rec.mcap"]).succeeded();
    let into = |path: &str| bench.run(&["capture", "--frames", "2", "--out", path]);
    into("none/rec.mcap").failed(1, &["none/rec.mcap", "cannot record"]);
    #[cfg(target_os = "linux")]
    bench
        .run(&["capture", "--frames", "2", "--overwrite", "--out", "/dev/full"])
        .failed(1, &["/dev/full", "No space left"]);
}

/// A recording of one frame of 1024 samples whose setup or calibration is not what a camera or a burst gives.
fn crafted(bench: &Bench, name: &str, setup: &MeasurementSetup, settling: &Settling) {
    let identity = CameraIdentity::current("crafted", "1");
    let target = Target::New(bench.path(name));
    let opening = Opening { settling: Some(settling), ..Opening::of(&identity, setup, 7) };
    let mut recorder = Recorder::create(&target, &opening).unwrap();
    let (mut words, mut packet) = ([0; 8192], vec![0; MAX_DEVICE_PACKET + 1]);
    let samples =
        Samples::pack((0..1024_i32).map(|k| i64::from(5000 - k)), Width::Bits32, &mut words)
            .unwrap();
    let flags = FrameFlags::DIFFERENTIAL;
    let frame = Frame { run: 7, sequence: 0, device_time_us: 1, sweeps: 1, flags, samples };
    recorder.packet(encode(&DeviceMessage::Frame(frame), &mut packet).unwrap()).unwrap();
    recorder.finish(&RunAccount::default()).unwrap();
}

#[test]
fn a_recording_whose_setup_or_calibration_cannot_be_is_refused() {
    let bench = Bench::new();
    let setup = MeasurementSetup::new(&Order::CakeCutting, 1.0).unwrap();
    let settling = Settling {
        adc_latency: 6,
        response: vec![0.9],
        dark_counts: 200.0,
        step_counts: 8000.0,
        noise_counts: 18.5,
        tile_sag: 0.0,
    };
    crafted(&bench, "sound.mcap", &setup, &settling);
    let reconstruct = |name: &str| bench.run(&["reconstruct", name, "--method", "hadamard"]);
    reconstruct("sound.mcap").succeeded();
    let fewer = MeasurementSetup::new(&Order::CakeCutting, 0.5).unwrap();
    // That every number is checked is tested in `nirspi-camera`.
    let setups: [(MeasurementSetup, &[&str]); 3] = [
        (MeasurementSetup { blanked: 5, ..setup.clone() }, &["blanked is 5, expected 0 to 4"]),
        (
            MeasurementSetup { differential: false, ..setup.clone() },
            &["differences of patterns and complements, expected single patterns"],
        ),
        (fewer, &["frames of 1024 patterns, expected 512"]),
    ];
    for (at, (wrong, words)) in setups.iter().enumerate() {
        let name = format!("setup-{at}.mcap");
        crafted(&bench, &name, wrong, &settling);
        reconstruct(&name).failed(1, &[&[name.as_str()], *words].concat());
    }
    crafted(&bench, "settling.mcap", &setup, &Settling { response: vec![0.5; 4000], ..settling });
    reconstruct("settling.mcap").failed(1, &["settling.mcap", "length of the response is 4000"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_or_a_device_is_refused_and_not_waited_for() {
    let bench = Bench::new();
    let pipes = ["pipe.mcap", "pipe.npz", "pipe.safetensors", "pipe.json", "pipe.csv", "pipe.txt"];
    let paths = pipes.map(|name| bench.path(name));
    assert!(std::process::Command::new("mkfifo").args(paths).status().unwrap().success());
    bench.write("in.npy", &nirspi::files::npy::encode(&[32, 32], &[0.5; 1024]));
    for command in [
        "reconstruct pipe.mcap",
        "reconstruct pipe.npz",
        "reconstruct pipe.txt",
        "dev upscale in.npy --out out.npy --weights pipe.safetensors",
        "dev upscale in.npy --out out.npy --weights /dev/zero",
        "capture --frames 1 --out rec.mcap --calibration pipe.json",
        "capture --frames 1 --out rec.mcap --calibration /dev/zero",
        "camera gateware --camera virtual pipe.json",
        "camera gateware --camera virtual /dev/zero",
        "camera model pipe.json",
        "camera model /dev/zero",
        "physics rig --volumes pipe.csv",
        "physics rig --volumes /dev/zero",
        "physics rain --drops pipe.csv",
        "demo --light=1ms --weather pipe.csv",
        "demo --light=1ms --order table:pipe.txt",
    ] {
        let (_, file) = command.rsplit_once([' ', ':']).unwrap();
        let refused = bench.run_line(command);
        assert_eq!(refused.stderr.matches(" pipe, expected").count(), 1, "{refused:?}");
        assert!(refused.failed(1, &[file]).stdout.is_empty(), "{command}");
    }
    assert_eq!(bench.names().len(), pipes.len() + 1, "{:?}", bench.names());
}

#[cfg(unix)]
#[test]
fn an_interrupted_command_leaves_nothing_of_its_own() {
    // Half of the time of so many images passes after the first file is there.
    const MANY: usize = 800;
    let bench = Bench::new();
    let many = vec![0.5; MANY * 64 * 64];
    bench.write("many.npy", &nirspi::files::npy::encode(&[MANY, 64, 64], &many));
    let before = bench.names();
    let interrupted = |signal| {
        let mut deblur = bench.start(&["deblur", "many.npy", "--model", "wiener", "--out", "of"]);
        deblur.has_made(&bench.path("of"));
        deblur.signal(signal);
        let outcome = deblur.wait();
        // On a busy machine the command may end before the signal comes; then it is done again.
        if outcome.code == Some(0) {
            std::fs::remove_dir_all(bench.path("of")).unwrap();
            std::fs::remove_file(bench.path("of.picture.png")).unwrap();
            return None;
        }
        Some(outcome)
    };
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        let outcome = (0..5).find_map(|_| interrupted(signal)).expect("always too late");
        assert_eq!((outcome.code, bench.names()), (Some(code), before.clone()), "{outcome:?}");
    }
}
