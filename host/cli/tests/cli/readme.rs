//! Every command line of the README and of the book's first pages runs as it stands, from a folder that holds nothing.

use crate::bench::{Bench, correlation};

/// What follows `cargo run --release -- ` in blocks of shell commands, without comments.
fn commands(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut is_shell = false;
    for line in page.lines() {
        match line.strip_prefix("```") {
            Some(language) => is_shell = language == "sh",
            None if is_shell => {
                let command = line.split(" #").next().unwrap_or("").trim();
                found.extend(command.strip_prefix("cargo run --release -- ").map(str::to_owned));
            }
            None => {}
        }
    }
    found
}

/// Runs the lines of a page in turn, from one empty folder. `not_run` names lines that are left out, and why.
fn runs_as_it_stands(name: &str, page: &str, least: usize, not_run: &[(&str, &str)]) {
    let commands = commands(page);
    assert!(commands.len() >= least, "{name}: {commands:?}");
    let bench = Bench::new();
    let mut left_out = Vec::new();
    let mut recorded = false;
    for command in &commands {
        if let Some((line, _)) = not_run.iter().find(|(line, _)| command.starts_with(line)) {
            left_out.push(*line);
            if command.contains("--out rec.mcap") && !recorded {
                // The recording that the next line reads, of the same camera in this process.
                bench.run(&["capture", "--frames", "100", "--out", "rec.mcap"]).succeeded();
                recorded = true;
            }
            continue;
        }
        bench.run(&command.split_whitespace().collect::<Vec<_>>()).succeeded();
    }
    // The list says nothing of lines that are gone.
    for (line, why) in not_run {
        assert!(left_out.contains(line), "{line} ({why}) is no line of {name}");
    }
}

#[test]
fn every_line_of_the_readme_runs_as_it_stands() {
    let not_run = [
        ("virtual", "runs until it is stopped; tests/cli/capture_tcp.rs"),
        ("capture --camera tcp:", "needs the camera of another terminal; tests/cli/capture_tcp.rs"),
    ];
    runs_as_it_stands("README.md", include_str!("../../../../README.md"), 11, &not_run);
}

#[test]
fn every_line_of_the_first_picture_runs_as_it_stands() {
    let page = include_str!("../../../../docs/first-picture.md");
    let not_run = [("serve", "runs until it is stopped; tests/cli/serve.rs")];
    runs_as_it_stands("docs/first-picture.md", page, 8, &not_run);
}

#[test]
fn every_line_of_the_page_about_measurements_runs_as_it_stands() {
    let page = include_str!("../../../../docs/measurements.md");
    runs_as_it_stands("docs/measurements.md", page, 10, &[]);
}

#[test]
fn every_line_of_the_page_about_recordings_runs_as_it_stands() {
    let page = include_str!("../../../../docs/recordings.md");
    runs_as_it_stands("docs/recordings.md", page, 6, &[]);
}

#[test]
fn every_line_of_how_it_works_and_of_bring_up_runs_as_it_stands() {
    let page = include_str!("../../../../docs/how-it-works.md");
    runs_as_it_stands("docs/how-it-works.md", page, 2, &[]);
    let page = include_str!("../../../../docs/bring-up.md");
    runs_as_it_stands("docs/bring-up.md", page, 3, &[]);
}

#[test]
fn every_line_about_several_detectors_runs_as_it_stands() {
    let page = include_str!("../../../../docs/several-cameras.md");
    let (_, section) = page.split_once("## Several detectors").unwrap();
    let (_, description) = section.split_once("```toml\n").unwrap();
    let bench = Bench::new();
    bench.write("three.toml", description.split("```").next().unwrap().as_bytes());
    let commands = commands(section);
    assert_eq!(commands.len(), 6, "{commands:?}");
    let ran = commands.iter().map(|command| {
        bench.run(&command.split_whitespace().collect::<Vec<_>>()).succeeded().stdout
    });
    let ran: Vec<String> = ran.collect();
    for said in [&ran[0], &ran[1]] {
        assert!(said.contains("detector 2: 100 received, 0 lost"), "{said}");
    }
    assert!(ran[2].contains("3 detectors of 32 x 32"), "{}", ran[2]);
    assert!(ran[3].contains("100 frames of 32 x 32"), "{}", ran[3]);
    // The sum of each detector's frames, from the recording and from its arrays.
    assert_eq!(bench.pixels("three/image.npy").len(), 3 * 1024);
    let same = correlation(&bench.pixels("three/image.npy"), &bench.pixels("same/image.npy"));
    assert!(same > 0.999_999, "{same}");
}
