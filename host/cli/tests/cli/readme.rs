//! Every command line of the README runs as it stands, from a folder that holds nothing.

use crate::bench::Bench;

/// Lines that are not run, and why.
const NOT_RUN: [(&str, &str); 2] = [
    ("virtual", "runs until it is stopped; tests/cli/capture_tcp.rs"),
    ("capture --camera tcp:", "needs the camera of another terminal; tests/cli/capture_tcp.rs"),
];

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

#[test]
fn every_line_of_the_readme_runs_as_it_stands() {
    let page = include_str!("../../../../README.md");
    let commands = commands(page);
    assert!(commands.len() > 10, "{commands:?}");
    let bench = Bench::new();
    let mut left_out = Vec::new();
    let mut recorded = false;
    for command in &commands {
        if let Some((line, _)) = NOT_RUN.iter().find(|(line, _)| command.starts_with(line)) {
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
    for (line, why) in NOT_RUN {
        assert!(left_out.contains(&line), "{line} ({why}) is no line of the README");
    }
}
