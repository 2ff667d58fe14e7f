//! Tests of the kernels against the reference, on the device that wgpu finds: software Vulkan
//! without a GPU. `NIRSPI_TEST_BACKEND=cuda` runs the same tests through CUDA.

use super::*;
use crate::gpu::{Choice, Device, DeviceDictionary, choose, path_over};
use crate::sampled::{Prior, SampledHadamard};
use crate::testing::side;
use nirspi_patterns::basis::{Basis, Transform};
use std::io::Write;
use std::sync::OnceLock;

/// A device, or `None`, with a printed message, if this machine has none.
fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Result<Device, String>> = OnceLock::new();
    let found = DEVICE.get_or_init(|| {
        let name = std::env::var("NIRSPI_TEST_BACKEND").unwrap_or_else(|_| "wgpu".to_owned());
        let opened = Device::open(name.parse().unwrap()).map_err(|absent| absent.to_string());
        opened?.ok_or_else(|| "the processor is no GPU".to_owned())
    });
    if let Err(why) = found {
        // Prints past the test harness's capture, so that a skipped test is visible.
        let _ = writeln!(std::io::stderr(), "skipped: {why}");
    }
    found.as_ref().ok()
}

/// Several measurements by the problem's dictionary: the problem's own, then similar ones.
fn frames(problem: &Problem, count: usize) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(3);
    let mut y = problem.y.clone();
    for _ in 1..count {
        let gain = 1.0 + normal(&mut random).abs();
        y.extend(
            problem.y.iter().map(|v| f64::from((v * gain + 0.1 * normal(&mut random)) as f32)),
        );
    }
    y
}

#[test]
fn every_kind_of_problem_has_the_references_solution() {
    let Some(device) = device() else { return };
    for (kind, (rows, atoms)) in KINDS
        .into_iter()
        .flat_map(|kind| [(16, 16), (40, 100), (64, 300)].into_iter().map(move |size| (kind, size)))
    {
        let problem = problem(kind, rows, atoms, 5, 7);
        let limits = Limits { residual: 2e-3, ..Limits::atoms(10) };
        let dictionary = DeviceDictionary::new(device, problem.dictionary.clone(), true).unwrap();
        let y = frames(&problem, 4);
        let single: Vec<f32> = y.iter().map(|&y| y as f32).collect();
        let alone = dictionary.solve_batch_single(&limits, &single).unwrap();
        let (checked, _) = dictionary.solve_batch(&limits, &y).unwrap();
        for ((y, alone), checked) in y.chunks_exact(rows).zip(&alone).zip(&checked) {
            let problem = Problem {
                recipe: problem.recipe.clone(),
                dictionary: problem.dictionary.clone(),
                y: y.to_vec(),
                sparse: Vec::new(),
            };
            agrees::<f32>(&problem, &limits, alone).unwrap();
            let exact = solve_exactly(&problem, &limits);
            if kind == Kind::Doubled {
                // Of copies of an atom, the reference's own rounding decides which it chooses.
                assert_eq!(exact.support.len(), checked.support.len(), "{problem:?}");
            } else {
                assert_eq!(exact.support, checked.support, "{problem:?}");
                assert_eq!(exact.stop, checked.stop, "{problem:?}");
            }
        }
    }
}

#[test]
fn a_large_problem_has_the_references_support_in_order() {
    let Some(device) = device() else { return };
    let problem = problem(Kind::Noisy, 512, 1000, 40, 5);
    let limits = Limits::atoms(64);
    let dictionary = DeviceDictionary::new(device, problem.dictionary.clone(), true).unwrap();
    let found = dictionary.solve_batch_single(&limits, &single(&problem.y)).unwrap();
    assert_eq!(found[0].support, solve_exactly(&problem, &limits).support);
    agrees::<f32>(&problem, &limits, &found[0]).unwrap();
}

fn single(y: &[f64]) -> Vec<f32> {
    y.iter().map(|&y| y as f32).collect()
}

/// A pursuit with more rounds of loops than software Vulkan finishes in one launch.
#[test]
fn a_pursuit_of_many_atoms_is_whole() {
    let Some(device) = device() else { return };
    let count = 400;
    let mut random = Pcg64::seed_from_u64(8);
    let dictionary = DMatrix::from_fn(count, count, |i, j| {
        f64::from(u8::from(i == j)) + 1e-3 * normal(&mut random)
    });
    let sizes = DVector::from_fn(count, |i, _| 0.985_f64.powi((i * 7 % count) as i32));
    let y = (&dictionary * sizes).as_slice().to_vec();
    let limits = Limits::atoms(380);
    let exact = Solver::new(&DenseDictionary::new(&dictionary), &limits)
        .unwrap()
        .solve(&y)
        .unwrap()
        .solution();
    let there = DeviceDictionary::new(device, dictionary, true).unwrap();
    let found = &there.solve_batch_single(&limits, &single(&y)).unwrap()[0];
    assert_eq!(found.support.len(), 380);
    assert_eq!(found.support, exact.support);
    for (a, b) in found.coefficients.iter().zip(&exact.coefficients) {
        assert!((a - b).abs() < 1e-4);
    }
}

#[test]
fn a_batch_is_a_loop_here_too() {
    let Some(device) = device() else { return };
    let problem = problem(Kind::Noisy, 48, 150, 6, 2);
    let limits = Limits { residual: 0.05, ..Limits::atoms(20) };
    let dictionary = DeviceDictionary::new(device, problem.dictionary.clone(), true).unwrap();
    let y = single(&frames(&problem, 19));
    let together = dictionary.solve_batch_single(&limits, &y).unwrap();
    for (y, found) in y.chunks_exact(48).zip(&together) {
        assert_eq!(&dictionary.solve_batch_single(&limits, y).unwrap()[0], found);
    }
    assert_eq!(dictionary.solve_batch_single(&limits, &[]), Ok(vec![]));
    // More frames than one turn holds: each frame comes as often as necessary, in the order given.
    let many: Vec<f32> = y.iter().copied().cycle().take(48 * 2100).collect();
    let found = dictionary.solve_batch_single(&limits, &many).unwrap();
    assert_eq!(found.len(), 2100);
    assert!(found.iter().zip(together.iter().cycle()).all(|(found, alone)| found == alone));
}

#[test]
fn images_are_the_atoms_times_their_coefficients() {
    let Some(device) = device() else { return };
    let problem = problem(Kind::Noisy, 48, 150, 6, 2);
    let limits = Limits::atoms(9);
    let dictionary = DeviceDictionary::new(device, problem.dictionary.clone(), true).unwrap();
    let frames = dictionary.upload(&single(&frames(&problem, 3))).unwrap();
    let solutions = dictionary.pursue(&limits, &frames).unwrap();
    let found = dictionary.download(&solutions).unwrap();
    let scattered = dictionary.images(&solutions, None).unwrap();
    let scattered = scattered.download().unwrap();
    let pixels = 70;
    let pictures: Vec<f32> = (0..150 * pixels).map(|i| (i % 17) as f32 - 8.0).collect();
    let there = dictionary.upload_pictures(&pictures, pixels).unwrap();
    let images = dictionary.images(&solutions, Some(&there)).unwrap();
    let images = images.download().unwrap();
    assert_eq!((found.len(), scattered.len(), images.len()), (3, 3 * 150, 3 * pixels));
    for (frame, solution) in found.iter().enumerate() {
        let mut whole = vec![0.0; 150];
        let mut image = vec![0.0; pixels];
        for (&atom, &value) in solution.support.iter().zip(&solution.coefficients) {
            whole[atom] = value as f32;
            for (pixel, picture) in image.iter_mut().zip(&pictures[atom * pixels..]) {
                *pixel += value * f64::from(*picture);
            }
        }
        assert_eq!(scattered[frame * 150..(frame + 1) * 150], whole);
        for (a, b) in image.iter().zip(&images[frame * pixels..]) {
            assert!(
                (a - f64::from(*b)).abs() < 1e-3 * image.iter().fold(1.0, |m, v| f64::max(m, *v))
            );
        }
    }
    assert!(dictionary.upload_pictures(&pictures[1..], pixels).is_err());
}

#[test]
fn a_dictionary_of_fast_transforms_has_the_same_path() {
    let Some(device) = device() else { return };
    let side = side(16);
    for basis in [Basis::Pixel, Basis::Dct] {
        let transform = Transform::new(basis, side);
        let prior = Prior { noise: 0.02, ..Prior::none(256) };
        let rows: Vec<u32> = (0..256).filter(|row| row % 5 < 3).collect();
        let dictionary = SampledHadamard::new(&transform, &rows, &prior);
        let mut random = Pcg64::seed_from_u64(5);
        let y: Vec<f32> = rows.iter().map(|_| normal(&mut random) as f32).collect();
        let limits = Limits::atoms(30);
        let exact = Solver::new(&dictionary, &limits).unwrap().solve(&y).unwrap();
        let found = path_over(device, &dictionary, &limits, &y).unwrap();
        assert_eq!(found.support, exact.support);
        assert_eq!(found.unseen, exact.unseen);
        for atoms in [0, 1, 17, 30] {
            let (a, b) = (found.coefficients(atoms), exact.coefficients(atoms));
            assert_eq!(a.len(), atoms);
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} and {b:?}");
        }
        let problem = crate::Problem { dictionary: &dictionary, limits };
        let two = [y.clone(), y].concat();
        let batch = solve_batch(&problem, &two, device.backend()).unwrap();
        assert_eq!([&batch[0].support, &batch[1].support], [&exact.support; 2]);
        // The same by a solver that keeps the dictionary on the device.
        let mut stack = StackSolver::new(&problem, device.backend(), 4).unwrap();
        for _ in 0..2 {
            assert_eq!(stack.solve(&two).unwrap(), (batch.clone(), 2));
        }
        assert_eq!((&**stack.turns().device(), stack.turns().said()), (device.name(), None));
        let refused = stack.solve(&[f32::NAN; 3]).unwrap_err();
        assert!(matches!(refused, OmpError::Length { .. }), "{refused}");
    }
}

/// Cosines of an image of `pixels` x `pixels` measured by `rows` Hadamard rows: atoms that are hard
/// to distinguish.
fn cosines(rows: &[usize], pixels: usize) -> DMatrix<f64> {
    let area = pixels * pixels;
    let transform = Transform::new(Basis::Dct, side(pixels as u64));
    let mut dictionary = DMatrix::zeros(rows.len(), area);
    for atom in 0..area {
        let mut image = vec![0.0_f32; area];
        image[atom] = 1.0;
        transform.synthesise(&mut image);
        nirspi_patterns::fwht::transform(&mut image);
        for (m, &row) in rows.iter().enumerate() {
            dictionary[(m, atom)] = f64::from(image[row] / pixels as f32);
        }
    }
    dictionary
}

#[test]
fn few_of_many_frames_need_double_precision_and_all_have_its_support() {
    let Some(device) = device() else { return };
    let mut random = Pcg64::seed_from_u64(4);
    let rows: Vec<usize> = (0..256).filter(|row| row * 37 % 16 < 7).collect();
    let random_atoms = problem(Kind::Noisy, 64, 256, 8, 11).dictionary;
    for (matrix, most) in [(random_atoms, 20), (cosines(&rows, 16), 100)] {
        let measurements = matrix.nrows();
        let y: Vec<f64> = (0..measurements * 200).map(|_| normal(&mut random)).collect();
        let limits = Limits::atoms(16);
        let dictionary = DeviceDictionary::new(device, matrix.clone(), true).unwrap();
        let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
        assert!(again < most, "{again} of 200");
        let exact = DenseDictionary::new(&matrix);
        let mut exact = Solver::new(&exact, &limits).unwrap();
        for (y, found) in y.chunks_exact(measurements).zip(&found) {
            assert_eq!(found.support, exact.solve(y).unwrap().support);
        }
    }
}

/// Random orthonormal atoms, and frames in which pairs of them have the same coefficient but for a
/// part in 10^9.
fn tied(rows: usize, normalised: bool) -> (DMatrix<f64>, Vec<f64>) {
    let mut random = Pcg64::seed_from_u64(21);
    let mut matrix = DMatrix::from_fn(rows, rows, |_, _| normal(&mut random)).qr().q();
    if !normalised {
        // Longer atoms, all of one length.
        matrix *= 3.0;
    }
    let mut y = Vec::new();
    for frame in 0..30 {
        let mut scene = DMatrix::zeros(rows, 1);
        let mut free: Vec<usize> = (0..rows).collect();
        for pair in 0..10 {
            let coefficient = 1.0 + f64::from(pair) + normal(&mut random).abs();
            for (more, place) in [(1e-9 * normal(&mut random), 0), (0.0, 1)] {
                let atom = (frame * 7 + 2 * pair as usize + place * 41) % rows;
                free.retain(|&other| other != atom);
                scene += coefficient * (1.0 + more) * matrix.column(atom);
            }
        }
        // Something is left at the end, by atoms that are not chosen.
        free.iter().for_each(|&atom| scene += 0.1 * normal(&mut random) * matrix.column(atom));
        y.extend_from_slice(scene.as_slice());
    }
    (matrix, y)
}

/// The camera's cosines behind half of its rows, and frames of a few cosines with noise.
fn camera() -> (DMatrix<f64>, Vec<f64>) {
    let mut random = Pcg64::seed_from_u64(4);
    let rows: Vec<usize> = (0..1024).filter(|row| row * 389 % 1024 < 512).collect();
    let matrix = cosines(&rows, 32);
    let mut y = Vec::new();
    for frame in 0..30 {
        let mut scene = DMatrix::from_fn(rows.len(), 1, |_, _| 0.05 * normal(&mut random));
        for k in 0..12 {
            scene += normal(&mut random) * matrix.column((frame * 7 + k * k) % 1024);
        }
        y.extend_from_slice(scene.as_slice());
    }
    (matrix, y)
}

#[test]
fn choices_that_single_precision_cannot_make_are_made_on_the_device() {
    let Some(device) = device() else { return };
    if !device.engine().has_doubles() {
        let _ = writeln!(std::io::stderr(), "skipped: {} has no f64", device.name());
        return;
    }
    for (what, (matrix, y), normalised, atoms) in [
        ("the camera's rows and cosines", camera(), true, 40),
        ("ties", tied(96, true), true, 20),
        ("ties of atoms as they are", tied(96, false), false, 20),
    ] {
        let limits = Limits::atoms(atoms);
        let measurements = matrix.nrows();
        let dictionary = DeviceDictionary::new(device, matrix.clone(), normalised).unwrap();
        let solve = |frames| {
            let there = dictionary.pursue(&limits, &frames).unwrap();
            dictionary.download_with_doubts(&there).unwrap()
        };
        let (alone, doubts_alone) = solve(dictionary.upload(&y).unwrap());
        let (found, doubts) = solve(dictionary.upload_exact(&y).unwrap());
        assert!(!doubts_alone.is_empty(), "{what}: single precision sees no doubt");
        assert!(doubts.is_empty(), "{what}: {doubts:?}");
        let exact = DenseDictionary::new(&matrix);
        let exact = if normalised { exact } else { exact.unnormalised() };
        let mut exact = Solver::new(&exact, &limits).unwrap();
        let mut other = 0;
        for ((y, found), alone) in y.chunks_exact(measurements).zip(&found).zip(&alone) {
            let exact = exact.solve(y).unwrap().support;
            assert_eq!(found.support, exact, "{what}");
            other += usize::from(alone.support != exact);
        }
        // The camera's few frames may be right by chance.
        assert!(other > 10 || what.contains("camera"), "{what}: single precision is enough");
        let (_, in_double) = dictionary.solve_batch(&limits, &y).unwrap();
        assert_eq!(in_double, doubts_alone.len(), "{what}: each doubt is told");
    }
}

#[test]
fn of_equal_atoms_the_lowest_is_chosen() {
    let Some(device) = device() else { return };
    let dictionary = DeviceDictionary::new(device, DMatrix::identity(300, 300), true).unwrap();
    let mut y = vec![0.0; 300];
    let bright = [0, 17, 64, 81, 128, 145, 255, 256, 299];
    bright.iter().for_each(|&k| y[k] = if k % 2 == 0 { 2.0 } else { -2.0 });
    let found = dictionary.solve_batch_single(&Limits::atoms(bright.len()), &y).unwrap();
    assert_eq!(found[0].support, bright);
}

#[test]
fn ties_and_ends_that_single_precision_cannot_see_go_to_double() {
    let Some(device) = device() else { return };
    for lead in [1e-9, -1e-9] {
        let mut matrix = DMatrix::identity(8, 70);
        matrix.column_mut(69).copy_from_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.8]);
        let y = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.6, 0.8 + lead];
        let dictionary = DeviceDictionary::new(device, matrix.clone(), true).unwrap();
        let limits = Limits::atoms(1);
        let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
        let exact = reference::solve(&matrix, &y, &limits).unwrap();
        assert_eq!((&found[0].support, again), (&exact.support, 1));
        // A limit that the residual meets only to within rounding.
        let limits = Limits { noise: ((1.0 + lead) / 8.0).sqrt(), ..Limits::atoms(3) };
        let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
        let exact = reference::solve(&matrix, &y, &limits).unwrap();
        assert_eq!((&found[0], again), (&exact, 1));
    }
    let identity = DeviceDictionary::new(device, DMatrix::identity(8, 8), true).unwrap();
    let y = [3.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0];
    let (found, again) = identity.solve_batch(&Limits::atoms(2), &y).unwrap();
    assert_eq!((&found[0].support[..], again), (&[0, 3][..], 0));
    // Three atoms leave a residual of zero, which `f32` alone cannot confirm.
    let (found, again) = identity.solve_batch(&Limits::atoms(5), &y).unwrap();
    assert_eq!((&found[0].support[..], again), (&[0, 3, 7][..], 1));
}

#[test]
fn problems_without_a_meaning_are_refused_here_too() {
    let Some(device) = device() else { return };
    let dictionary = DeviceDictionary::new(device, DMatrix::identity(4, 6), true).unwrap();
    let one = Limits::atoms(1);
    let refuse = |y: &[f32], limits: Limits| dictionary.solve_batch_single(&limits, y).unwrap_err();
    assert_eq!(refuse(&[1.0; 5], one), OmpError::Length { found: 5, expected: 4 });
    let infinite = refuse(&[1.0, 1.0, f32::INFINITY, 1.0], one);
    assert!(matches!(infinite, OmpError::NotFinite { field: "measurement", index: 2, .. }));
    let negative = refuse(&[1.0; 4], Limits { noise: -1.0, ..one });
    assert_eq!(negative, OmpError::Limit { limit: "noise", found: -1.0 });
    let broken = DeviceDictionary::new(device, DMatrix::from_element(2, 2, f64::NAN), true);
    assert!(matches!(broken.unwrap_err(), OmpError::NotFinite { field: "dictionary", .. }));
    let wide = DeviceDictionary::new(device, DMatrix::zeros(1, 70_000), true).unwrap_err();
    assert!(matches!(wide, OmpError::Backend(BackendError::TooLarge { .. })), "{wide}");
    let double = DenseDictionary::<f64>::new(&DMatrix::identity(4, 4));
    let problem = crate::Problem { dictionary: &double, limits: one };
    let refused = solve_batch(&problem, &[1.0; 4], device.backend()).unwrap_err();
    assert_eq!(refused, OmpError::Backend(BackendError::Precision));
}

#[test]
fn auto_takes_no_software_device_and_a_name_is_kept_to() {
    assert!(matches!(choose(Backend::Auto, 1), Ok(Choice::Cpu(None))));
    match choose(Backend::Auto, 1000).unwrap() {
        Choice::Gpu(device) => assert!(!device.is_software()),
        Choice::Cpu(why) => assert!(why.unwrap().to_string().starts_with("no GPU found (wgpu: ")),
    }
    assert!(matches!(choose(Backend::Cpu, 1000), Ok(Choice::Cpu(None))));
    // The result may be an error or a device, but never a panic.
    match choose(Backend::Cuda, 1) {
        Ok(Choice::Gpu(device)) => assert_eq!(device.backend(), Backend::Cuda),
        Ok(Choice::Cpu(_)) => panic!("the processor was not asked for"),
        Err(absent) => assert!(absent.to_string().starts_with("no GPU found (CUDA: "), "{absent}"),
    }
}
