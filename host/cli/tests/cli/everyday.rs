//! What everybody meets every day: help that is grouped, progress in a log, as much said as wanted,
//! counts and numbers as people write them.

use crate::bench::{Bench, Measured, PROGRESS};

#[test]
fn options_stand_under_headings_each_once() {
    let bench = Bench::new();
    let headings = |command: &[&str]| -> Vec<String> {
        let help = bench.run(&[command, &["--help"]].concat()).succeeded().stdout;
        let is_heading = |line: &&str| {
            !line.starts_with(' ') && line.ends_with(':') && !line.starts_with("Example")
        };
        help.lines().filter(is_heading).map(str::to_owned).collect()
    };
    let scene = "Scene and weather, simulated:";
    assert_eq!(
        headings(&["demo"]),
        ["Options:", scene, "Measurement:", "Picture:", "Output:", "Every command:"]
    );
    assert_eq!(
        headings(&["capture"]),
        ["Options:", "Camera:", "Calibration:", "Measurement:", scene, "Output:", "Every command:"]
    );
    assert_eq!(
        headings(&["enhance"]),
        [
            "Arguments:",
            "Options:",
            "Input:",
            "Deblurring:",
            "Measurement:",
            "Output:",
            "Networks:",
            "Every command:"
        ]
    );
    // Only a simulated camera has a scene.
    assert!(!headings(&["camera", "gateware"]).contains(&scene.to_owned()));
}

#[test]
fn the_words_of_help_have_colour_on_demand_and_none_with_no_color() {
    let bench = Bench::new();
    let help = |variables: &[(&str, &str)]| bench.run_with(variables, &["demo", "--help"]).stdout;
    let forced = ("CLICOLOR_FORCE", "1");
    assert!(help(&[forced]).contains('\u{1b}'));
    assert!(!help(&[forced, ("NO_COLOR", "1")]).contains('\u{1b}'));
    let error = bench.run_with(&[forced], &["demo", "--bogus"]).stderr;
    assert!(!error.contains('\u{1b}'), "{error}");
}

#[cfg(unix)]
#[test]
fn a_log_gets_a_plain_line_of_progress_every_ten_seconds_and_none_if_quiet() {
    let bench = Bench::new();
    let started = std::time::Instant::now();
    let mut capture = bench.start(&["capture", "--out", "rec.mcap"]);
    let quiet = bench.start(&["capture", "--quiet", "--out", "quiet.mcap"]);
    let line = capture.remarks(PROGRESS);
    assert!(started.elapsed().as_secs() >= 10, "{line}");
    assert!(line.contains(" frames, 10 s, ") && line.contains("capture, "), "{line}");
    assert!(line.contains(" lost") && !line.contains('\u{1b}'), "{line}");
    std::thread::sleep(std::time::Duration::from_secs(1));
    quiet.signal("INT");
    capture.signal("INT");
    assert!(!quiet.wait_raw().contains(PROGRESS));
    capture.wait().succeeded();
}

#[test]
fn quiet_leaves_out_notes_and_one_is_no_plural() {
    let (bench, mut measured) = (Bench::new(), Measured::new(8));
    measured.d[3] = f32::NAN;
    let fields: [(&str, &[usize], &[f32]); 3] =
        [("n", &[], &[8.0]), ("h_row", &[64], &measured.h_row), ("y", &[64], &measured.d)];
    bench.write("in.npz", &crate::bench::npz(&fields));
    let command =
        ["reconstruct", "in.npz", "--non-differential", "--method", "omp", "--sparsity", "1"];
    let said = bench.run(&command).succeeded().stdout;
    assert!(said.contains("\nnote: ") && said.contains("not read: 1 pattern left out"), "{said}");
    assert!(said.contains("1 atom of the dct basis"), "{said}");
    let quiet = bench.run(&[&command[..], &["-q"]].concat()).succeeded().stdout;
    assert!(!quiet.contains("note: ") && quiet.contains("1 atom of the dct basis"), "{quiet}");
    let third =
        "reconstruct in.npz --non-differential --sampling 30% --method tikhonov --strength 0.3";
    let said = bench.run_line(third).succeeded().stdout;
    assert!(said.contains(", strength 0.3, "), "{said}");
}
