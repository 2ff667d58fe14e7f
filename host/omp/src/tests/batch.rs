//! Tests that batches of any size, on any vector width, give the same bits.

use super::*;
use crate::batch::solve_batch_with;
use crate::path::Path;
use crate::referee::Referee;
use pulp::Arch;

fn frames<T: Scalar>(problem: &Problem, count: usize) -> Vec<T> {
    let mut random = Pcg64::seed_from_u64(9);
    let scale = |y: &f64, gain: f64, noise: f64| T::from_f64(y * gain + 0.1 * noise);
    (0..count)
        .flat_map(|_| {
            let gain = normal(&mut random);
            problem.y.iter().map(|y| scale(y, gain, normal(&mut random))).collect::<Vec<T>>()
        })
        .collect()
}

fn a_batch_is_a_loop_for<T: Scalar>() {
    let problem = problem(Kind::Noisy, 48, 150, 6, 2);
    let (dictionary, _) = dense::<T>(&problem);
    let limits = Limits { residual: 0.05, ..Limits::atoms(20) };
    // One frame, a part of a group, several groups and a rest.
    for count in [1, 7, 16, 50] {
        let y = frames::<T>(&problem, count);
        let batch = super::super::Problem { dictionary: &dictionary, limits };
        let together = solve_batch(&batch, &y, Backend::Auto).unwrap();
        assert_eq!(together.len(), count);
        let mut solver = Solver::new(&dictionary, &limits).unwrap();
        for (y, found) in y.chunks_exact(48).zip(&together) {
            assert_eq!(&solver.solve(y).unwrap().solution(), found);
        }
    }
}

#[test]
fn a_batch_is_a_loop() {
    a_batch_is_a_loop_for::<f32>();
    a_batch_is_a_loop_for::<f64>();
}

#[test]
fn a_batch_of_broken_frames_is_refused() {
    let (dictionary, y) = dense::<f32>(&problem(Kind::Noisy, 16, 40, 3, 1));
    let solve = |y: &[f32], limits| {
        solve_batch(&super::super::Problem { dictionary: &dictionary, limits }, y, Backend::Cpu)
    };
    assert_eq!(solve(&[], Limits::atoms(3)), Ok(vec![]));
    assert_eq!(solve(&y[1..], Limits::atoms(3)), Err(OmpError::Length { found: 15, expected: 16 }));
    let mut broken = [y.clone(), y.clone()].concat();
    broken[20] = f32::NAN;
    assert!(matches!(
        solve(&broken, Limits::atoms(3)),
        Err(OmpError::NotFinite { field: "measurement", index: 20, .. })
    ));
    let limits = Limits { noise: f64::NAN, ..Limits::atoms(3) };
    assert!(matches!(solve(&y, limits), Err(OmpError::Limit { limit: "noise", .. })));
}

#[test]
fn a_gram_matrix_that_does_not_fit_is_done_without() {
    let problem = problem(Kind::Noisy, 48, 150, 6, 4);
    let matrix = problem.dictionary.map(|v| v as f32);
    let (whole, y) = dense::<f32>(&problem);
    let columns = DenseDictionary::with_gram_within(&matrix, 0);
    let limits = Limits::atoms(20);
    let solve = |dictionary| Solver::new(dictionary, &limits).unwrap().solve(&y).unwrap();
    assert_eq!(solve(&whole).solution(), solve(&columns).solution());
}

#[test]
fn every_vector_width_gives_the_same_bits() {
    fn bits<T: Scalar>(problem: &Problem, arch: Arch) -> Solution {
        let matrix = problem.dictionary.map(T::from_f64);
        let dictionary = DenseDictionary::on(arch, &matrix, usize::MAX);
        let y: Vec<T> = frames(problem, 1);
        let limits = Limits::atoms(30);
        Solver::on(arch, &dictionary, &limits).unwrap().solve(&y).unwrap().solution()
    }
    let problem = problem(Kind::Noisy, 64, 200, 9, 6);
    for width in widths() {
        assert_eq!(bits::<f32>(&problem, width), bits::<f32>(&problem, Arch::Scalar));
        assert_eq!(bits::<f64>(&problem, width), bits::<f64>(&problem, Arch::Scalar));
    }
}

/// The vector widths of this machine.
fn widths() -> Vec<Arch> {
    #[cfg(target_arch = "x86_64")]
    let narrower = pulp::x86::V3::try_new().map(Arch::V3);
    #[cfg(not(target_arch = "x86_64"))]
    let narrower = None;
    [Some(Arch::new()), narrower].into_iter().flatten().collect()
}

/// Takes the atom of its own number wherever it is asked, and is always asked.
struct Favourite(usize);

impl Referee<f32> for Favourite {
    fn believed(&self) -> f64 {
        f64::INFINITY
    }

    fn choose(&mut self, _: &Path<f32>, rivals: &[usize]) -> usize {
        assert!(rivals.contains(&self.0), "{} is not among {rivals:?}", self.0);
        self.0
    }
}

#[test]
fn each_frame_of_a_batch_has_a_referee_of_its_own() {
    let problem = problem(Kind::Noisy, 48, 150, 6, 2);
    let (dictionary, _) = dense::<f32>(&problem);
    let limits = Limits::atoms(1);
    let batch = super::super::Problem { dictionary: &dictionary, limits };
    let y = frames::<f32>(&problem, 50);
    let paths = solve_batch_with(&batch, &y, Favourite).unwrap();
    let chosen: Vec<usize> = paths.iter().map(|path| path.support[0]).collect();
    assert_eq!(chosen, (0..50).collect::<Vec<_>>());
    // Frames without a referee take the atom with the largest score.
    let some = |frame| (frame % 3 == 0).then_some(Favourite(frame));
    let best = solve_batch(&batch, &y, Backend::Cpu).unwrap();
    for (frame, path) in solve_batch_with(&batch, &y, some).unwrap().iter().enumerate() {
        let expected = if frame % 3 == 0 { frame } else { best[frame].support[0] };
        assert_eq!(path.support, [expected], "frame {frame}");
    }
}
