//! `nirspi dev completions` and `nirspi dev man`.

use crate::bench::Bench;
use std::process::Command;

#[test]
fn every_shell_gets_a_script_that_knows_the_commands() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = bench.run(&["dev", "completions", shell]).succeeded().stdout;
        assert!(script.contains("reconstruct") && script.contains("capture"), "{shell}");
    }
    bench.run(&["dev", "completions", "cmd"]).failed(2, &["'cmd'", "bash"]);
}

/// What bash itself offers after these words: the completions of the script, or files.
#[test]
fn bash_offers_files_where_a_file_can_stand() {
    if Command::new("bash").arg("--version").output().is_err() {
        eprintln!("skipped: no bash");
        return;
    }
    let bench = Bench::new();
    let script = bench.run(&["dev", "completions", "bash"]).succeeded().stdout;
    bench.write("script", script.as_bytes());
    let offers = |words: &[&str]| {
        let ask = "source ./script; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); \
                   _nirspi nirspi \"${COMP_WORDS[-1]}\" \"${COMP_WORDS[-2]}\"; printf '%s\\n' \"${COMPREPLY[@]}\"; complete -p nirspi";
        let asked = Command::new("bash")
            .args(["-c", ask, "bash", "nirspi"])
            .args(words)
            .current_dir(bench.path("."))
            .output()
            .unwrap();
        let said = String::from_utf8(asked.stdout).unwrap();
        let (offered, settings) = said.rsplit_once("complete ").unwrap();
        assert!(settings.contains("-o default"), "without it, bash offers no files: {settings}");
        offered.split_whitespace().map(str::to_owned).collect::<Vec<String>>()
    };
    // Nothing from the script: bash then offers files, with their spaces.
    for words in [&["reconstruct", ""][..], &["reconstruct", "my"], &["capture", "--picture", ""]] {
        assert!(offers(words).is_empty(), "{words:?}: {:?}", offers(words));
    }
    assert_eq!(offers(&["reconstruct", "--matr"]), ["--matrix", "--matrix-field"]);
    assert!(offers(&["reconstruct", "--method", "t"]).contains(&"tikhonov".to_owned()));
    assert_eq!(offers(&["recons"]), ["reconstruct"]);
    assert!(offers(&["dev", "bench", ""]).contains(&"omp".to_owned()));
    assert!(offers(&["dev", "completions", ""]).contains(&"zsh".to_owned()));
}

#[test]
fn every_command_has_a_manual_page() {
    let bench = Bench::new();
    bench.write("file", b"");
    bench.run(&["dev", "man", "file"]).failed(1, &["file", "a folder"]);
    bench.run(&["dev", "man", "man1"]).succeeded();
    let page = |name: &str| std::fs::read_to_string(bench.path("man1").join(name)).unwrap();
    assert!(page("nirspi.1").contains("single\\-pixel camera"));
    assert!(page("nirspi-reconstruct.1").contains(".TH nirspi-reconstruct 1"));
    assert!(page("nirspi-dev-bench-omp.1").contains("bench omp"));
}
