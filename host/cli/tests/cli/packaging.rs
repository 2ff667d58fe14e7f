//! `nirspi completions` and `nirspi man`.

use crate::bench::Bench;

#[test]
fn every_shell_gets_a_script_that_knows_the_commands() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = bench.run(&["completions", shell]).succeeded().stdout;
        assert!(script.contains("reconstruct") && script.contains("capture"), "{shell}");
    }
    bench.run(&["completions", "cmd"]).failed(2, &["'cmd'", "bash"]);
}

#[test]
fn every_command_has_a_manual_page() {
    let bench = Bench::new();
    bench.write("file", b"");
    bench.run(&["man", "file"]).failed(1, &["file", "a folder"]);
    bench.run(&["man", "man1"]).succeeded();
    let page = |name: &str| std::fs::read_to_string(bench.path("man1").join(name)).unwrap();
    assert!(page("nirspi.1").contains("single\\-pixel camera"));
    assert!(page("nirspi-reconstruct.1").contains(".TH nirspi-reconstruct 1"));
    assert!(page("nirspi-bench-omp.1").contains("bench omp"));
}
