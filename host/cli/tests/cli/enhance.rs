//! `nirspi dev upscale`, `deblur` and `enhance`. That the networks compute what they should is tested in `nirspi-nets`.

use crate::bench::{Bench, provenance};
use nirspi::files::image::encode_grey;
use nirspi::files::npy;
use nirspi_nets::weights::Precision;
use std::ops::Range;

/// A blurred bar on `side` x `side` pixels, brightness from 0 to 1.
fn bar(side: usize) -> Vec<f32> {
    let across = |x: usize| {
        let off = (x as f32 + 0.5) / side as f32 - 0.5;
        0.9 * (-(off / 0.12).powi(4)).exp()
    };
    (0..side * side).map(|i| across(i % side)).collect()
}

#[test]
fn a_stack_comes_out_at_64_pixels_with_its_estimates_and_its_inconsistency() {
    let bench = Bench::new();
    bench.write("in.npy", &npy::encode(&[2, 32, 32], &[bar(32), bar(32)].concat()));
    let zones: Vec<f32> = (0..64).map(|i| if i % 3 == 0 { f32::NAN } else { 0.6 }).collect();
    bench.write("tof.npy", &npy::encode(&[8, 8], &zones));
    let line = "enhance in.npy --depth tof.npy --spread spread.npy --interval interval.npy --method tikhonov \
                --sampling 1 --readings-noise 0.01 --out out.npy --backend cpu --json";
    let report = bench.run_line(line).succeeded().json();
    let stack = npy::read_stack(&bench.path("out.npy")).unwrap();
    assert_eq!((stack.count, stack.height, stack.width), (2, 64, 64));
    assert!(stack.values.iter().all(|v| (0.0..=1.0).contains(v)));
    assert_eq!(stack.values[..4096], stack.values[4096..], "the same image, the same result");
    assert_eq!(npy::read_stack(&bench.path("spread.npy")).unwrap().count, 2);
    let widths = npy::read_stack(&bench.path("interval.npy")).unwrap();
    assert_eq!((widths.count, widths.height), (2, 64));
    assert!(widths.values.iter().all(|width| *width > 0.0 && *width < 1.0));
    // The bar's edges are less sure than the dark beside it, and no width is finer than a bench.
    assert!(widths.values.iter().all(|width| *width >= nirspi_nets::interval::FLOOR));
    assert_eq!(widths.values[..4096], widths.values[4096..], "the same image, the same widths");
    let most =
        |columns: Range<usize>| columns.map(|x| widths.values[32 * 64 + x]).fold(0.0_f32, f32::max);
    assert!(most(20..30) > most(0..8), "{} {}", most(20..30), most(0..8));
    let enhance = ["enhance", "in.npy", "--interval", "i.npy", "--out", "o.npy"];
    let readings =
        |method, share, noise| ["--method", method, "--sampling", share, "--readings-noise", noise];
    let refused = |more: &[&str], code, told: &[&str]| {
        bench.run(&[&enhance[..], more].concat()).failed(code, told);
        assert!(!bench.path("i.npy").exists() && !bench.path("o.npy").exists());
    };
    let good = readings("omp", "0.5", "0.03");
    let steps = [&good[..], &["--steps", "2"]].concat();
    refused(&steps, 1, &["no intervals", "not for diffusion in 2 steps"]);
    // Nothing is known of the readings, or more is asked for than the calibration holds.
    refused(&[], 2, &["--method", "--sampling", "--readings-noise"]);
    refused(&readings("omp", "0.02", "0.03"), 1, &["no intervals", "10 to 100 % of the patterns"]);
    refused(&readings("omp", "0.5", "0.7"), 1, &["no intervals", "up to 20 % of white"]);
    assert_eq!((&report["images"], &report["model"]), (&2.into(), &"diffusion".into()));
    for key in ["sigma_px", "noise", "inconsistency"] {
        assert!(report[key][1].as_f64().is_some_and(|v| (0.0..10.0).contains(&v)), "{report}");
    }
    assert_eq!(report["device"], "CPU");
    assert_eq!(report["weights"].as_array().unwrap().len(), 3, "{report}");
}

#[test]
fn a_single_image_stays_one_and_bytes_are_grey_levels() {
    let bench = Bench::new();
    bench.write("in.npy", &npy::encode(&[32, 32], &bar(32)));
    bench.run(&["dev", "upscale", "in.npy", "--out", "out.npy"]).succeeded();
    assert_eq!(bench.pixels("out.npy").len(), 64 * 64);
    // The same as 8-bit levels, in NumPy's format by hand, and as a PNG.
    let levels: Vec<u8> = bar(32).iter().map(|v| (v * 255.0).round() as u8).collect();
    let mut file = npy::encode(&[32, 32], &[0.0_f32; 1024]);
    let header = file.len() - 4096;
    file.truncate(header);
    let descr = file.windows(3).position(|w| w == b"<f4").unwrap();
    file[descr..descr + 3].copy_from_slice(b"|u1");
    file.extend(&levels);
    bench.write("bytes.npy", &file);
    bench.write("in.png", &encode_grey(32, 32, &bar(32), &provenance()));
    bench.run(&["dev", "upscale", "bytes.npy", "--out", "from_bytes.npy"]).succeeded();
    bench.run(&["dev", "upscale", "in.png", "--out", "from_png.npy"]).succeeded();
    assert_eq!(bench.pixels("from_bytes.npy"), bench.pixels("from_png.npy"));
    let exact = bench.pixels("out.npy");
    let close = |(a, b): (&f32, &f32)| (a - b).abs() < 0.02;
    assert!(bench.pixels("from_bytes.npy").iter().zip(&exact).all(close));
}

#[test]
fn a_folder_of_pictures_becomes_a_folder_of_the_same_names() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("in")).unwrap();
    for name in ["b.png", "a.png"] {
        bench.write(&format!("in/{name}"), &encode_grey(64, 64, &bar(64), &provenance()));
    }
    bench.write("in/notes.txt", b"not a picture");
    bench.run(&["deblur", "in", "--steps", "2", "--out", "sharp"]).succeeded();
    let mut names: Vec<_> = std::fs::read_dir(bench.path("sharp"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.starts_with('.'))
        .collect();
    names.sort();
    assert_eq!(names, ["a.png", "b.png"]);
    // `*.picture.png` is written beside the folder, for people to look at. In a folder of images it is not read.
    std::fs::copy(bench.path("sharp.picture.png"), bench.path("in/sharp.picture.png")).unwrap();
    bench.run(&["deblur", "in", "--out", "sharper"]).succeeded();
    bench.write("in/c.png", &encode_grey(32, 32, &bar(32), &provenance()));
    bench.run(&["deblur", "in", "--out", "again"]).failed(1, &["c.png", "32 x 32", "64 x 64"]);
    assert!(!bench.path("again").exists());
}

#[test]
fn what_is_no_image_for_the_networks_gets_one_line_and_nothing_is_written() {
    let bench = Bench::new();
    let with = |at: usize, value: f32| {
        let mut stack = [bar(32), bar(32)].concat();
        stack[at] = value;
        npy::encode(&[2, 32, 32], &stack)
    };
    bench.write("nan.npy", &with(1024 + 32 + 3, f32::NAN));
    bench.write("bright.npy", &with(1024 + 32 + 3, 1.75));
    bench.write("dark.npy", &with(5, -0.5));
    bench.write("good.npy", &with(0, 0.5));
    bench.write("large.npy", &npy::encode(&[1, 64, 64], &bar(64)));
    bench.write("empty.npy", &npy::encode::<f32>(&[0, 32, 32], &[]));
    bench.write("cut.npy", &with(0, 0.5)[..3000]);
    bench.write("text.npy", b"no array at all");
    bench.write("tof.npy", &npy::encode(&[3, 8, 8], &[0.5; 192]));
    std::fs::create_dir(bench.path("folder")).unwrap();
    let files = bench.names();
    let enhance = |input: &str| bench.run(&["enhance", input, "--out", "out.npy"]);
    enhance("nan.npy").failed(1, &["nan.npy", "NaN", "[1, 1, 3]"]);
    enhance("bright.npy").failed(1, &["bright.npy", "image 1, row 1, column 3 is 1.75", "0 to 1"]);
    enhance("dark.npy").failed(1, &["dark.npy", "-0.5", "0 to 1"]);
    enhance("large.npy").failed(1, &["large.npy", "64 x 64", "expected 32 x 32"]);
    enhance("empty.npy").failed(1, &["empty.npy", "(0, 32, 32)"]);
    enhance("cut.npy").failed(1, &["cut.npy", "cut short"]);
    enhance("text.npy").failed(1, &["text.npy", "NumPy"]);
    enhance("none.npy").failed(1, &["none.npy", "no such file"]);
    enhance("folder").failed(1, &["folder", "no .png or .jpg files"]);
    bench
        .run(&["enhance", "good.npy", "--depth", "tof.npy", "--out", "out.npy"])
        .failed(1, &["tof.npy", "3 depth maps", "1 or 2"]);
    bench
        .run(&["enhance", "good.npy", "--out", "out.png"])
        .failed(1, &["out.png", "2 images", "folder"]);
    bench
        .run(&["enhance", "good.npy", "--weights", "text.npy", "--out", "out.npy"])
        .failed(1, &["text.npy", "safetensors"]);
    let other = nirspi_nets::Weights::embedded("classifier").unwrap();
    bench.write("other.safetensors", &other.to_bytes(Precision::Half).unwrap());
    let upscale = ["dev", "upscale", "good.npy", "--out", "out.npy"];
    bench
        .run(&[&upscale[..], &["--weights", "other.safetensors"]].concat())
        .failed(2, &["other.safetensors", "network classifier", "expected fsrcnn"]);
    std::fs::remove_file(bench.path("other.safetensors")).unwrap();
    assert_eq!(bench.names(), files);
}

#[test]
fn no_result_replaces_its_own_input_nor_another_file_unasked() {
    let bench = Bench::new();
    let input = npy::encode(&[32, 32], &bar(32));
    bench.write("in.npy", &input);
    let deblur = |more: &[&str]| bench.run(&[&["dev", "upscale", "in.npy"][..], more].concat());
    deblur(&["--out", "in.npy"]).failed(1, &["in.npy: is there already", "--overwrite"]);
    let own = ["in.npy: the result is made of this file, expected another name for it"];
    deblur(&["--out", "in.npy", "--overwrite"]).failed(1, &own);
    assert_eq!(std::fs::read(bench.path("in.npy")).unwrap(), input);
    deblur(&["--out", "large.npy"]).succeeded();
    deblur(&["--out", "large.npy"]).failed(1, &["large.npy: is there already"]);
    deblur(&["--out", "large.npy", "--overwrite"]).succeeded();
    deblur(&["--out", "-"]).failed(1, &["-: found no name"]);
    assert_eq!(
        bench.names(),
        ["in.npy", "large.npy", "large.picture.pdf", "large.picture.png", "large.picture.svg"]
    );
}

#[test]
fn classical_methods_deblur_too_and_what_is_the_networks_is_not_theirs() {
    let bench = Bench::new();
    bench.write("in.npy", &npy::encode(&[1, 64, 64], &bar(64)));
    for model in ["wiener", "rl", "tv"] {
        let arguments = ["deblur", "in.npy", "--model", model, "--blur-px", "1", "--noise", "0.01"];
        let report = bench
            .run(&[&arguments[..], &["--json", "--out", "out.npy", "--overwrite"]].concat())
            .succeeded()
            .json();
        assert_eq!(report["model"], model);
        assert!((report["noise"][0].as_f64().unwrap() - 0.01).abs() < 1e-6, "{report}");
        assert!(report["inconsistency"][0].as_f64().is_some_and(|v| v < 2.0), "{report}");
        assert_eq!(bench.pixels("out.npy").len(), 64 * 64);
        for mine in [["--steps", "2"], ["--spread", "s.npy"]] {
            bench.run(&[&arguments[..], &mine, &["--out", "o.npy"]].concat()).failed(2, &mine[..1]);
        }
    }
}

#[test]
fn a_reconstruction_is_enhanced_if_its_size_allows() {
    let bench = Bench::new();
    bench.run(&["capture", "--camera", "virtual", "--frames", "20", "--out", "r.mcap"]).succeeded();
    let report = bench
        .run(&["reconstruct", "r.mcap", "--enhance", "--out", "out", "--json"])
        .succeeded()
        .json();
    assert!(report["enhancement"]["white"].as_f64().is_some_and(|white| white > 0.0), "{report}");
    let sharp = bench.pixels("out/enhanced.npy");
    assert!(sharp.len() == 64 * 64 && sharp.iter().all(|v| (0.0..=1.0).contains(v)));
    // A letter on a dark ground: both are there.
    let share = |lit: fn(&f32) -> bool| sharp.iter().filter(|v| lit(v)).count() as f32 / 4096.0;
    assert!(share(|&v| v > 0.8) > 0.05 && share(|&v| v < 0.1) > 0.5);
}

#[test]
fn the_time_of_enhancing_is_reported_with_its_parts() {
    let bench = Bench::new();
    let args = ["dev", "bench", "enhance", "--frames", "2", "--repeats", "1", "--backend", "cpu"];
    let report = bench.run(&args).succeeded().json();
    assert_eq!((&report["device"], &report["frames"]), (&"CPU".into(), &2.into()), "{report}");
    let ms = |part: &serde_json::Value| part["median_ms"].as_f64().unwrap();
    // Both are parts of the whole, which has the UNet besides.
    assert!(ms(&report) > ms(&report["fusion"]), "{report}");
    assert!(ms(&report) > ms(&report["estimate"]), "{report}");
}

#[test]
fn the_whole_of_the_pipeline_is_timed_and_reconstructs_what_was_measured() {
    let bench = Bench::new();
    let time = |backend| {
        let few = ["--frames", "2", "--sparsity", "32", "--repeats", "1"];
        bench.run(&[&["dev", "bench", "pipeline", "--backend", backend], &few[..]].concat())
    };
    let report = time("cpu").succeeded().json();
    assert_eq!((&report["device"], &report["frames"]), (&"CPU".into(), &2.into()), "{report}");
    let ms = |part: &serde_json::Value| part["median_ms"].as_f64().unwrap();
    assert!(ms(&report) > ms(&report["reconstruct"]), "{report}");
    // 23.6 dB with 32 atoms; 12 where the mean is missed.
    let db = |report: &serde_json::Value| report["reconstructed_psnr_db"].as_f64().unwrap();
    assert!(db(&report) > 22.0, "{report}");
    let on_gpu = time("wgpu");
    if on_gpu.code != Some(0) {
        on_gpu.failed(1, &["backend wgpu"]);
        eprintln!("skipped: no wgpu on this machine");
        return;
    }
    let on_gpu = on_gpu.succeeded().json();
    assert!((db(&on_gpu) - db(&report)).abs() < 0.01, "{on_gpu}");
    // Images that stay on the device are those that come to the host and go back.
    assert!(on_gpu["largest_difference"].as_f64().unwrap() < 1e-3, "{on_gpu}");
}

#[test]
fn a_gpu_enhances_as_the_processor_and_says_what_it_does_in_another_way() {
    let bench = Bench::new();
    bench.write("in.npy", &npy::encode(&[3, 32, 32], &[bar(32), bar(32), bar(32)].concat()));
    let enhance = |backend, out, more: &[&str]| {
        let usual = ["enhance", "in.npy", "--out", out, "--backend", backend];
        bench.run(&[&usual[..], more].concat())
    };
    enhance("cpu", "cpu.npy", &[]).succeeded();
    let on_gpu = enhance("wgpu", "gpu.npy", &[]);
    if on_gpu.code != Some(0) {
        on_gpu.failed(1, &["backend wgpu"]);
        eprintln!("skipped: no wgpu on this machine");
        return;
    }
    on_gpu.succeeded();
    let read = |file| npy::read_stack(&bench.path(file)).unwrap().values;
    let cpu = read("cpu.npy");
    let apart = |other: &[f32]| {
        let apart = cpu.iter().zip(other).map(|(a, b)| (a - b).abs());
        // NaN counts as the largest difference.
        apart.fold(0.0, |most, v| if v <= most { most } else { v })
    };
    assert!(apart(&read("gpu.npy")) < 1e-3, "{}", apart(&read("gpu.npy")));
    let half = enhance("wgpu", "half.npy", &["--precision", "f16"]);
    let said = "precision f16 needs a GPU with tensor cores, through CUDA; ";
    assert!(half.code == Some(0) && half.stderr.contains(said), "{half:?}");
    assert!(apart(&read("half.npy")) < 1e-3);
}

#[test]
fn a_precision_that_does_not_exist_is_refused_and_the_processor_has_one_alone() {
    let bench = Bench::new();
    bench.write("in.npy", &npy::encode(&[32, 32], &bar(32)));
    let enhance = |precision| {
        let usual = ["enhance", "in.npy", "--out", "out.npy", "--overwrite", "--backend", "cpu"];
        bench.run(&[&usual[..], &["--precision", precision]].concat())
    };
    enhance("f32").succeeded();
    let half = enhance("f16");
    let said = "precision f16 needs a GPU with tensor cores, through CUDA; CPU computes in f32";
    assert!(half.code == Some(0) && half.stderr.contains(said), "{half:?}");
    enhance("bf16").failed(2, &["precision \"bf16\", expected f32 or f16"]);
}

#[test]
fn noise_below_black_and_above_white_is_cut_and_counted() {
    let bench = Bench::new();
    let of = |low: f32, high: f32| -> Vec<f32> {
        let value = |at: usize| match at {
            7 => low,
            99 | 500 => high,
            at => (at % 32) as f32 / 31.0,
        };
        (0..1024).map(value).collect()
    };
    let encode = |values: &[f32]| npy::encode(&[1, 32, 32], values);
    bench.write("noisy.npy", &encode(&of(-0.3, 1.4)));
    bench.write("cut.npy", &encode(&of(0.0, 1.0)));
    let said = bench.run(&["enhance", "noisy.npy", "--out", "a.npy"]).succeeded().stdout;
    assert!(said.contains("noisy.npy: 3 values below 0 or above 1"), "{said}");
    let said = bench.run(&["enhance", "cut.npy", "--out", "b.npy"]).succeeded().stdout;
    assert!(!said.contains("below 0"), "{said}");
    assert_eq!(bench.pixels("a.npy"), bench.pixels("b.npy"));
}
