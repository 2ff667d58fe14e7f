//! Defaults for options: a settings file, the environment, and the command line above both.

use crate::bench::{Bench, Measured};

/// Reconstructs `in.npz` and gives the report.
fn report(bench: &Bench, variables: &[(&str, &str)], more: &[&str]) -> serde_json::Value {
    let command = ["reconstruct", "in.npz", "--json"];
    bench.run_with(variables, &[&command[..], more].concat()).succeeded().json()
}

fn with_measurement() -> Bench {
    let bench = Bench::new();
    bench.write("in.npz", &Measured::new(16).npz());
    bench
}

#[test]
fn the_command_line_beats_the_environment_and_that_the_file() {
    let bench = with_measurement();
    bench.write(
        "lab.toml",
        b"sampling = \"25%\"\nframes = 7\n[reconstruct]\nmethod = \"hadamard\"\nout = \"from-file\"\n",
    );
    let file = ["--settings", "lab.toml"];
    let found = report(&bench, &[], &file);
    assert_eq!((&found["method"], &found["used"]), (&"hadamard".into(), &64.into()), "{found}");
    assert!(bench.path("from-file/report.json").exists());

    let variables = [("NIRSPI_METHOD", "tv"), ("NIRSPI_FIRST_OF", "zig-zag")];
    let found = report(&bench, &variables, &file);
    assert_eq!((&found["method"], &found["order"]), (&"tv".into(), &"zig-zag".into()), "{found}");
    let found =
        report(&bench, &variables, &["--settings=lab.toml", "--method", "fista", "--sampling=0.5"]);
    assert_eq!((&found["method"], &found["used"]), (&"fista".into(), &128.into()), "{found}");

    // The file itself, named by a variable; and in front of the command.
    let found = report(&bench, &[("NIRSPI_SETTINGS", "lab.toml")], &[]);
    assert_eq!(found["method"], "hadamard");
    let first = ["--settings", "lab.toml", "reconstruct", "in.npz", "--json"];
    assert_eq!(bench.run(&first).succeeded().json()["method"], "hadamard");
    let said = bench.run(&[&first[..], &["-v"]].concat());
    let from = "nirspi: --method hadamard: from lab.toml, [reconstruct]\n";
    assert!(
        said.stderr.contains(from) && said.stderr.contains("nirspi: reconstruct: "),
        "{said:?}"
    );
}

#[test]
fn a_default_gives_way_to_an_option_that_excludes_it() {
    let bench = with_measurement();
    bench.write("lab.toml", b"basis = \"haar\"\nreadings = \"pairs\"\nnon-differential = false\n");
    let atoms: Vec<f32> = (0..256 * 256).map(|p| f32::from(u8::from(p % 257 == 0))).collect();
    bench.write("atoms.npy", &nirspi::files::npy::encode(&[256, 16, 16], &atoms));
    let own = ["--settings", "lab.toml", "--method", "omp", "--sampling", "0.5"];
    let found = report(&bench, &[], &own);
    assert_eq!(found["omp"]["basis"], "haar", "{found}");
    let found = report(&bench, &[], &[&own[..], &["--dictionary", "atoms.npy"]].concat());
    assert_eq!(found["omp"]["basis"], "atoms.npy", "{found}");
}

#[test]
fn what_is_saved_gives_the_same_again_and_leaves_the_rest_of_the_file() {
    let bench = with_measurement();
    bench.write("lab.toml", b"# my bench\n[capture]\nframes = 9\n");
    let chosen = ["--method", "omp", "--sampling", "30%", "--sparsity", "12", "--transpose"];
    let save = ["--save-settings", "lab.toml", "--out", "a"];
    let first = bench.run(&[&["reconstruct", "in.npz", "--json"][..], &chosen, &save].concat());
    assert!(
        first.code == Some(0) && first.stderr == "nirspi: settings saved in lab.toml\n",
        "{first:?}"
    );
    let text = std::fs::read_to_string(bench.path("lab.toml")).unwrap();
    assert!(text.starts_with("# my bench\n[capture]\nframes = 9\n\n[reconstruct]\n"), "{text}");
    assert!(
        text.contains("sampling = \"30%\"\n") && text.contains("\n# basis = \"dct\"\n"),
        "{text}"
    );
    assert!(!text.contains("out =") && !text.contains("json"), "{text}");
    let again = report(&bench, &[], &["--settings", "lab.toml", "--out", "b"]);
    assert_eq!(bench.pixels("a/image.npy"), bench.pixels("b/image.npy"));
    assert_eq!(again["omp"], first.json()["omp"]);
    // A command that fails saves nothing.
    bench.run(&["reconstruct", "none.npz", "--save-settings", "new.toml"]).failed(1, &["none.npz"]);
    assert!(!bench.path("new.toml").exists());
}

#[test]
fn settings_that_cannot_be_are_refused_in_one_line_with_code_2() {
    let bench = with_measurement();
    let refused = |text: &str, words: &[&str]| {
        bench.write("lab.toml", text.as_bytes());
        let command = ["reconstruct", "in.npz", "--settings", "lab.toml"];
        bench.run(&command).failed(2, words);
    };
    refused("lens = 0.3", &["lab.toml", "`lens` is not the name of an option"]);
    refused("sampling = 400", &["'400'", "--sampling comes from lab.toml"]);
    refused("method = \"magic\"", &["magic", "hadamard", "--method comes from lab.toml"]);
    let variable = [("NIRSPI_SAMPLING", "many")];
    let said = bench.run_with(&variable, &["reconstruct", "in.npz"]);
    said.failed(2, &["'many'", "--sampling comes from NIRSPI_SAMPLING"]);
    bench
        .run(&["reconstruct", "in.npz", "--settings", "none.toml"])
        .failed(2, &["none.toml", "no such file"]);
    // Help needs no settings.
    bench.run_with(&[("NIRSPI_SETTINGS", "none.toml")], &["demo", "--help"]).succeeded();
    assert_eq!(bench.names(), ["in.npz", "lab.toml"]);
}
