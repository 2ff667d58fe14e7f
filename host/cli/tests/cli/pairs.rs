//! `nirspi dev pairs`: scenes and the virtual camera's pictures of them, to train networks on.

use crate::bench::{Bench, array, provenance};
use nirspi::files::image::encode_grey;

#[test]
fn pairs_are_as_many_as_asked_and_those_of_their_seed() {
    let bench = Bench::new();
    let pairs = |seed: &str, out: &str| {
        let args = ["dev", "pairs", "--count", "3", "--seed", seed, "--out", out, "--json"];
        let report = bench.run(&args).succeeded().json();
        assert_eq!((&report["pairs"], &report["simulated"]), (&3.into(), &true.into()));
        // The provenance has the command and the time.
        ["x", "optical", "y", "depth_m", "noise_std", "distance_m", "sweeps"]
            .map(|name| array(&bench.path(out), name))
    };
    let first = pairs("1", "a.npz");
    assert_eq!(pairs("1", "b.npz"), first);
    assert_ne!(pairs("2", "c.npz"), first);
}

#[test]
fn characters_of_chars74ks_folder_become_stacks_to_which_the_pairs_refer() {
    let bench = Bench::new();
    // A page for each of three fonts in class A, and of two writers in class 0.
    for (at, file) in [
        ("Fnt/Sample011", "img011-00001"),
        ("Fnt/Sample011", "img011-00005"),
        ("Fnt/Sample011", "img011-00009"),
        ("Hnd/Img/Sample001", "img001-001"),
        ("Hnd/Img/Sample001", "img001-033"),
    ]
    .into_iter()
    .enumerate()
    .map(|(at, (folder, file))| (at, format!("chars74k/English/{folder}/{file}.png")))
    {
        let dark = |pixel: usize| pixel / 64 > 8 && (20..30 + 2 * at).contains(&(pixel % 64));
        let page: Vec<f32> = (0..4096).map(|pixel| if dark(pixel) { 0.0 } else { 1.0 }).collect();
        std::fs::create_dir_all(bench.path(&file).parent().unwrap()).unwrap();
        bench.write(&file, &encode_grey(64, 64, &page, &provenance()));
    }
    let args = ["dev", "pairs", "--data", "chars74k", "--characters", "letters", "--shapes", "0"];
    let more = ["--count", "8", "--out", "pairs.npz", "--json"];
    let report = bench.run(&[&args[..], &more].concat()).succeeded().json();
    assert_eq!(report["data"]["stacks"][1]["stack"], "hnd", "{report}");

    let numbers = |file: &str, name: &str| -> Vec<i64> {
        let bytes = array(&bench.path(file), name);
        bytes.as_chunks::<8>().0.iter().map(|number| i64::from_le_bytes(*number)).collect()
    };
    assert_eq!(numbers("letters/000-fnt.npz", "label"), [10, 10, 10]);
    assert_eq!(numbers("letters/001-hnd.npz", "label"), [0, 0]);
    let groups = [numbers("letters/000-fnt.npz", "group"), numbers("letters/001-hnd.npz", "group")];
    let (stack, group) = (numbers("pairs.npz", "stack"), numbers("pairs.npz", "group"));
    for (stack, group) in stack.iter().zip(&group) {
        assert!(groups[usize::try_from(*stack).unwrap()].contains(group), "{stack} {group}");
    }
    assert!(stack.contains(&0) && stack.contains(&1), "{stack:?}");

    // The folder is new, and there must be characters to write.
    let again = [&args[..], &["--out", "other.npz"]].concat();
    bench.run(&again).failed(1, &["letters", "the name of a new folder"]);
    let none = ["dev", "pairs", "--characters", "none", "--out", "other.npz"];
    bench.run(&none).failed(2, &["--data <PATH>|--fonts <DIR>"]);
    assert!(!bench.path("other.npz").exists() && !bench.path("none").exists());
}
