//! Millions of frames through capture, recording and reconstruction, with random faults on the link. Every frame must be
//! accounted for, every image must be right, and the memory must stay flat.
//!
//!     cargo run --release -p nirspi-tests --example soak -- [FRAMES [FOLDER]]
//!
//! Everything is simulated: the camera repeats precomputed frames as fast as the host takes them. Sessions of 100 000
//! frames follow one another; one in ten loses its link in the middle. In each, one frame of 256 meets a fault, and the
//! counters must be those of the injector's own log. Prints a line a session, writes FOLDER/soak.csv and, on Linux, the
//! memory as FOLDER/memory.png. Exit code 1 at the first frame that is not accounted for.

use nirspi::capture::{Calibration, CaptureOptions, Ended, Record, capture};
use nirspi::picture::{Axis, Chart, Figure, FigureStyle, Line};
use nirspi::provenance::{Made, Origin, Taken};
use nirspi::recording::Target;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::source::{Source, SourceOptions};
use nirspi_optics::Scene;
use nirspi_recon::Order;
use nirspi_recon::metrics::correlation;
use nirspi_recon::reconstruct::hadamard;
use nirspi_tests::tamper::{Fate, Tampered};
use nirspi_virtual::{MemoryLink, PrecomputedFpga, VirtualCamera, VirtualOptics};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

/// Frames of a session.
const SESSION: u32 = 100_000;
/// One frame of so many meets a fault.
const RARITY: u32 = 256;
/// Sound frames after each fault. Which frame a damaged packet was, its neighbours tell: next to a frame that comes late,
/// the host counts the damaged one as lost, and the late one as received.
const BETWEEN: u32 = 4;
/// Frames are the only packets of at least this length.
const FRAME_BYTES: usize = 2000;
/// Sides of the scene and of the image.
const SIDE: usize = 32;

/// What the injector has done to the frames of a session.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Log {
    received: u64,
    lost: u64,
    corrupt: u64,
    late: u64,
    repeated: u64,
}

/// A scene with a corner and an edge, so that an image that is turned or mirrored is no image of it.
fn scene() -> Vec<f32> {
    let bright = |x: usize, y: usize| (4..12).contains(&x) && y > 6 || (y > 20 && x < 24);
    (0..SIDE * SIDE).map(|at| if bright(at % SIDE, at / SIDE) { 0.9 } else { 0.1 }).collect()
}

fn fate(random: &mut Pcg64Mcg) -> Fate {
    if !random.random_ratio(1, RARITY) {
        return Fate::Pass;
    }
    match random.random_range(0..6) {
        0 => Fate::Drop,
        1 => Fate::Flip(random.random()),
        2 => Fate::Lose(random.random()),
        3 => Fate::Delay,
        4 => Fate::Repeat,
        _ => Fate::Hold(random.random_range(1..4)),
    }
}

/// Bytes of memory that this process holds; `None` where the system does not say.
fn memory_bytes() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(pages.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
}

/// One session. Returns what the injector did and the correlation of the image with the scene.
fn session(
    number: u64,
    optics: &VirtualOptics,
    truth: &[f32],
    folder: &Path,
) -> Result<(Log, f64), Failure> {
    let camera = VirtualCamera::new(
        PrecomputedFpga::new(optics.fpga(number)?, 16),
        optics.depth(number)?,
        "soak",
    );
    let log = Arc::<Mutex<Log>>::default();
    let injected = Arc::clone(&log);
    let mut random = Pcg64Mcg::seed_from_u64(number);
    let unplugged = number % 10 == 9;
    let end = if unplugged { random.random_range(SESSION / 4..SESSION) } else { SESSION };
    let (mut frame, mut sound_until) = (0, 0);
    let link = Tampered::new(Box::new(MemoryLink::new(camera)), move |_, length| {
        if length < FRAME_BYTES {
            return Fate::Pass;
        }
        frame += 1;
        if unplugged && frame > end {
            return Fate::Close;
        }
        // A frame that comes late needs a successor.
        let may_fail = frame >= sound_until && frame + 2 < end;
        let fate = if may_fail { fate(&mut random) } else { Fate::Pass };
        if fate != Fate::Pass {
            sound_until = frame + 1 + BETWEEN;
        }
        #[expect(clippy::unwrap_used, reason = "poisoned only by a panic")]
        let mut log = injected.lock().unwrap();
        match fate {
            Fate::Drop => log.lost += 1,
            Fate::Flip(_) | Fate::Lose(_) => log.corrupt += 1,
            Fate::Delay => log.late += 1,
            Fate::Repeat => (log.received, log.repeated) = (log.received + 1, log.repeated + 1),
            _ => log.received += 1,
        }
        fate
    });
    let recording = folder.join("soak.mcap");
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::Sequency, 1.0)?,
        frames: Some(SESSION),
        calibration: Calibration::None,
        record: Some(Record {
            target: Target::New(recording.clone()),
            made: Made::by("a test", None, ["a test"], 0),
        }),
    };
    let captured =
        capture(&mut Session::open(Box::new(link))?, &options, &mut |_| ControlFlow::Continue(()))?;
    #[expect(clippy::unwrap_used, reason = "poisoned only by a panic")]
    let log = *log.lock().unwrap();
    let counters = captured.counters;
    let found = Log {
        received: counters.received,
        lost: counters.lost,
        corrupt: counters.corrupt,
        late: counters.late,
        repeated: captured.repeated,
    };
    if found != log {
        return Err(
            format!("session {number}: the host counted {found:?}, the injector {log:?}").into()
        );
    }
    if unplugged != matches!(captured.ended, Ended::LinkLost(_)) {
        return Err(format!("session {number} ended with: {}", captured.ended.in_words()).into());
    }
    // The image comes from the recording, as a user would make it.
    let source = Source::read(&recording, &SourceOptions::default())?;
    let recorded = source.frames.map_or(0, |frames| frames.received);
    if recorded != log.received {
        return Err(format!("session {number}: {recorded} frames in the recording, {log:?}").into());
    }
    let image = hadamard(&source.measurements);
    std::fs::remove_file(&recording)?;
    Ok((log, correlation(truth, image.pixels(), SIDE, SIDE)?))
}

/// Memory against frames.
fn chart(points: &[(f64, f64)]) -> Chart {
    Chart {
        header: "Memory of capture, recording and reconstruction".to_owned(),
        x: Axis::around("million frames", points.iter().map(|point| point.0).chain([0.0])),
        y: Axis::around("memory, MB", points.iter().map(|point| point.1).chain([0.0])),
        lines: vec![Line {
            name: "resident memory".to_owned(),
            colour: 0,
            dashed: false,
            points: points.to_vec(),
        }],
        footer: "simulated camera, one frame of 256 with a fault, one session of ten cut off"
            .to_owned(),
    }
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let asked: u64 = arguments.next().map_or(Ok(10_000_000), |frames| frames.parse())?;
    let folder = arguments.next().unwrap_or_else(|| "soak".to_owned());
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let truth = scene();
    let optics = VirtualOptics::new(Scene::new(truth.clone(), SIDE, 48.0)?, 300.0)?.ideal();
    let began = Instant::now();
    let (mut frames, mut faults, mut points) = (0, 0, Vec::new());
    let mut table =
        "session,frames,received,lost,corrupt,late,repeated,correlation,memory_bytes,seconds\n"
            .to_owned();
    for number in 0.. {
        if frames >= asked {
            break;
        }
        let (log, likeness) = session(number, &optics, &truth, folder)?;
        let Log { received, lost, corrupt, late, repeated } = log;
        frames += received + lost + corrupt + late;
        faults += lost + corrupt + late + repeated;
        let (memory, seconds) = (memory_bytes(), began.elapsed().as_secs_f64());
        let bytes = memory.map_or_else(String::new, |bytes| bytes.to_string());
        writeln!(
            table,
            "{number},{frames},{received},{lost},{corrupt},{late},{repeated},{likeness:.4},{bytes},{seconds:.1}"
        )?;
        points.extend(memory.map(|bytes| (frames as f64 / 1e6, bytes as f64 / 1e6)));
        println!(
            "session {number}: {frames} frames, {faults} with a fault, 0 not accounted for; correlation {likeness:.3}, {seconds:.0} s"
        );
        // A mirrored or wrong image is far below.
        if likeness < 0.8 {
            return Err(format!(
                "session {number}: the image's correlation with the scene is {likeness:.3}"
            )
            .into());
        }
    }
    std::fs::write(folder.join("soak.csv"), table)?;
    if points.is_empty() {
        println!("skipped: memory, this system does not say it");
    } else {
        let made = Made::now("soak", None, std::env::args());
        let provenance = Taken::without_camera(Origin::Simulated).made(&made);
        let picture = Figure::from(chart(&points)).png(&FigureStyle::Paper.look(), &provenance);
        std::fs::write(folder.join("memory.png"), picture)?;
    }
    Ok(())
}
