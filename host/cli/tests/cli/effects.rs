//! Options that change what is measured or what a script learns: each is seen in the file, the camera or the exit code.

use crate::bench::{Bench, Measured, Process};
use nirspi::address::CameraAddress;
use nirspi::session::{IgnorePackets, request};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::RunLength;
use nirspi_wire::host_port::READ_REGISTER;
use nirspi_wire::register::{IDENTITY, Register};
use nirspi_wire::tunnel::{CRC_BYTES, Lines, REPLY_HEAD_BYTES, Request};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::time::Duration;

/// The recording of the wire protocol's first version.
const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/recordings/v1.mcap");

/// Every value is another one than the default.
#[test]
fn a_capture_is_of_the_setup_that_was_asked_for() {
    let bench = Bench::new();
    let setup = "--order natural --sampling 0.25 --sweeps 3 --clocks-per-pattern 8 --blanked 4 --non-differential \
                 --no-calibration --adc-latency 9";
    let capture: Vec<&str> = ["capture", "--frames", "2", "--out", "rec.mcap"]
        .into_iter()
        .chain(setup.split_whitespace())
        .collect();
    bench.run(&capture).succeeded();
    let info = bench.run(&["camera", "info", "rec.mcap", "--json"]).succeeded().json();
    for (name, value) in [
        ("order", serde_json::json!("natural")),
        ("patterns", 256.into()),
        ("sweeps", 3.into()),
        ("clocks_per_pattern", 8.into()),
        ("blanked", 4.into()),
        ("differential", false.into()),
        ("adc_latency", 9.into()),
        ("calibrated", false.into()),
    ] {
        assert_eq!(info[name], value, "{name}: {info}");
    }
}

#[test]
fn with_strict_a_warning_is_exit_code_1_and_the_result_is_there() {
    let bench = Bench::new();
    let mut bytes = std::fs::read(RECORDING).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    bench.write("rec.mcap", &bytes);
    let export = |out: &str, more: &[&str]| {
        let export = ["recording", "export", "rec.mcap", "--to", "npz", "--out", out];
        bench.run(&[&export[..], more].concat())
    };
    let warned = export("a.npz", &[]).succeeded();
    assert!(warned.stderr.contains("nirspi: warning: "), "{warned:?}");
    let strict = export("b.npz", &["--strict"]);
    assert_eq!((strict.code, &strict.stderr), (Some(1), &warned.stderr), "{strict:?}");
    assert_eq!(bench.names(), ["a.npz", "b.npz", "rec.mcap"]);
    // Without a warning nothing changes.
    std::fs::copy(RECORDING, bench.path("rec.mcap")).unwrap();
    assert_eq!(export("c.npz", &["--strict"]).succeeded().stderr, "");
}

fn serve(bench: &Bench, more: &[&str]) -> (Process, CameraAddress) {
    let virtual_camera =
        ["dev", "virtual", "--listen", "127.0.0.1:0", "--once", "--precompute", "4"];
    let mut server = bench.start(&[&virtual_camera[..], more].concat());
    let line = server.says("virtual camera on tcp:");
    let address = line.split_whitespace().find(|word| word.starts_with("tcp:")).unwrap();
    let address = address.trim_end_matches(':').parse().unwrap();
    (server, address)
}

/// Frames that a camera dropped while its host did not read.
fn dropped(more: &[&str]) -> u32 {
    let bench = Bench::new();
    let (_server, address) = serve(&bench, more);
    let mut session = address.open(|| Err("no virtual camera here")).unwrap();
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let ignore = &mut IgnorePackets;
    setup.with_configuration(|c| session.command(request::Configure(c), ignore)).unwrap();
    session.command(request::Start(RunLength::Continuous), &mut IgnorePackets).unwrap();
    std::thread::sleep(Duration::from_secs(1));
    // The run may have ended: the camera's time is ahead, and it heard nothing of its host.
    let _ = session.command(request::Stop, &mut IgnorePackets);
    session.status(&mut IgnorePackets).unwrap().frames_dropped
}

#[test]
fn a_virtual_camera_drops_frames_only_if_it_is_asked_to() {
    assert_eq!(dropped(&[]), 0);
    assert!(dropped(&["--drop-when-full"]) > 0);
}

#[test]
fn images_of_a_share_of_the_patterns_are_judged_by_the_measurement_that_was_named() {
    let bench = Bench::new();
    let mut measured = Measured::new(8);
    bench.write("in.npz", &measured.npz());
    let most = measured.y.iter().fold(0.0_f32, |most, y| most.max(y.abs()));
    let noise = (0..).map(|at| 0.02 * most * ((at * 37 % 23) as f32 / 11.0 - 1.0));
    measured.y.iter_mut().zip(noise).for_each(|(y, noise)| *y += noise);
    bench.write("again.npz", &measured.npz());
    measured.y.reverse();
    bench.write("other.npz", &measured.npz());
    let judged = |more: &[&str]| {
        let sampling = ["eval", "sampling", "in.npz", "--sampling", "50%", "--orders", "zig-zag"];
        bench.run(&[&sampling[..], &["--json"], more].concat())
    };
    let alone = judged(&[]).succeeded().json();
    let against = judged(&["--against", "again.npz"]).succeeded().json();
    assert_eq!(alone["judged_by"], "same_readings");
    assert_ne!(against["judged_by"], "same_readings");
    let psnr = |report: &serde_json::Value| report["rows"][0]["psnr_db"].as_f64().unwrap();
    assert!((psnr(&against) - psnr(&alone)).abs() > 0.01, "{alone} {against}");
    judged(&["--against", "other.npz"]).failed(1, &["do not show the same scene"]);
}

/// An emulator listens, and the FPGA of the virtual camera answers its reads.
#[test]
fn an_emulated_board_finds_the_fpga_behind_its_tunnel() {
    let bench = Bench::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let mut fpga = bench.start(&["dev", "virtual", "--tunnel", &address]);
    fpga.says("FPGA behind ");
    let (mut board, _) = listener.accept().unwrap();
    let identity = Register::Identity.address();
    let request = Request {
        opcode: READ_REGISTER,
        number: 7,
        address: identity,
        argument: 0,
        board_enable: false,
    };
    board.write_all(&request.to_bytes()).unwrap();
    let mut reply = [0; REPLY_HEAD_BYTES + 4 + CRC_BYTES];
    board.read_exact(&mut reply).unwrap();
    let (number, lines) = Lines::from_reply_head(*reply.first_chunk().unwrap());
    assert!(number == 7 && lines.interlock_closed && !lines.frame_ready, "{lines:?}");
    assert_eq!(reply[REPLY_HEAD_BYTES..][..4], IDENTITY.to_le_bytes());
    drop(board);
    fpga.says("the emulator disconnected");
    drop(listener);
    bench
        .run(&["dev", "virtual", "--tunnel", &address])
        .failed(1, &[&address, "no emulator there"]);
}

/// At 0.5 m/s a letter of 43 mm goes on by 6.7 pixels in 20 ms.
#[test]
#[ignore = "long: .ci/run demo"]
fn a_target_that_moves_is_simulated_and_its_smear_is_said() {
    let bench = Bench::new();
    let capture = |name: &str, motion: &[&str]| {
        let all = ["capture", "--camera", "virtual", "--no-calibration", "--adc-latency", "6"];
        let all = [&all[..], &["--light", "20ms", "--out", name], motion].concat();
        bench.run(&all).succeeded().stdout
    };
    let still = capture("still.mcap", &[]);
    assert!(!still.contains("readings changed"), "{still}");
    for motion in [&["--target-speed", "0.5"][..], &["--target-turning", "-2000"]] {
        let name = format!("{}.mcap", motion[0].trim_start_matches('-'));
        let said = capture(&name, motion);
        assert!(said.contains("the scene's readings changed by"), "{motion:?}: {said}");
        let made = bench.run(&["reconstruct", &name, "--out", "out"]).succeeded();
        assert!(made.stdout.contains("the scene's readings changed by"), "{}", made.stdout);
    }
    let down = ["--target-speed", "0.5", "--target-direction", "90"];
    capture("down.mcap", &down);
    let bytes = |name| std::fs::read(bench.path(name)).unwrap();
    assert_ne!(bytes("down.mcap"), bytes("target-speed.mcap"));
    let fast = ["capture", "--camera", "virtual", "--target-speed", "200", "--frames", "1"];
    bench.run(&fast).failed(2, &["target speed in m/s is 200, expected 0 to 100"]);
}

/// One pixel of the target is a mirror. The pixels around it keep what they see.
#[test]
fn a_specular_spot_shines_in_its_pixel_alone() {
    let bench = Bench::new();
    let image = |name: &str, spot: &[&str]| {
        let all = ["capture", "--camera", "virtual", "--no-calibration", "--adc-latency", "6"];
        let all = [&all[..], &["--light", "5ms", "--out", name], spot].concat();
        bench.run(&all).succeeded();
        let out = format!("{name}.out");
        bench.run(&["reconstruct", name, "--method", "hadamard", "--out", &out]).succeeded();
        bench.pixels(&format!("{out}/image.npy"))
    };
    let plain = image("plain.mcap", &[]);
    let shining = image("shining.mcap", &["--specular", "50@3,4"]);
    let more: Vec<f32> = shining.iter().zip(&plain).map(|(a, b)| a - b).collect();
    let spot = 3 * 32 + 4;
    let rest = more.iter().enumerate().filter(|&(at, _)| at != spot);
    let rest = rest.map(|(_, more)| more.abs()).fold(0.0, f32::max);
    assert!(more[spot] > 10.0 * rest && rest > 0.0, "{} {rest}", more[spot]);
    for (spot, words) in [("bright", "--specular"), ("5@40,0", "row 40, column 0")] {
        let found = bench.run(&["capture", "--camera", "virtual", "--specular", spot]);
        found.failed(2, &[words]);
    }
}
