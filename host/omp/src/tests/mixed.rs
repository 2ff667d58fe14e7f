//! Tests of single precision with `f64` as the referee.

use super::*;

/// Two atoms, in either order, whose correlations with the measurement differ by less than `f32`
/// resolves.
fn nearly_tied(lead: f64) -> (DMatrix<f64>, Vec<f64>) {
    let mut dictionary = DMatrix::identity(8, 70);
    dictionary.column_mut(69).copy_from_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.8]);
    let mut y = vec![0.0; 8];
    (y[2], y[6], y[7]) = (1.0, 0.6, 0.8 + lead);
    (dictionary, y)
}

#[test]
fn a_lead_that_single_precision_cannot_see_decides_all_the_same() {
    for lead in [1e-9, -1e-9] {
        let (matrix, y) = nearly_tied(lead);
        let limits = Limits::atoms(1);
        let exact = reference::solve(&matrix, &y, &limits).unwrap();
        assert_eq!(exact.support, [if lead > 0.0 { 69 } else { 2 }]);
        let dictionary = MixedDictionary::new(matrix, true);
        let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
        assert_eq!((&found[0].support, again), (&exact.support, 1));
        let mut solver = dictionary.solver(&limits).unwrap();
        // Runs twice, because the second run finds used memory.
        for _ in 0..2 {
            let (found, in_double) = solver.solve(&y).unwrap();
            assert_eq!((&found.support, in_double), (&exact.support, true));
        }
    }
}

#[test]
fn the_units_of_a_measurement_change_neither_choices_nor_who_makes_them() {
    for gain in [1e6, 1e-6] {
        for lead in [1e-9, -1e-9] {
            let (matrix, y) = nearly_tied(lead);
            let y: Vec<f64> = y.iter().map(|y| y * gain).collect();
            let dictionary = MixedDictionary::new(matrix, true);
            let (found, again) = dictionary.solve_batch(&Limits::atoms(1), &y).unwrap();
            let leads = if lead > 0.0 { 69 } else { 2 };
            assert_eq!((&found[0].support[..], again), (&[leads][..], 1), "{gain}, {lead}");
        }
        let clear = [0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 0.0, 0.0].map(|y| y * gain);
        let dictionary = MixedDictionary::new(DMatrix::identity(8, 8), true);
        let (_, in_double) = dictionary.solver(&Limits::atoms(1)).unwrap().solve(&clear).unwrap();
        assert!(!in_double, "{gain}");
    }
}

#[test]
fn few_of_many_frames_need_double_precision_and_all_have_its_support() {
    let problem = problem(Kind::Noisy, 64, 256, 8, 11);
    let mut random = Pcg64::seed_from_u64(4);
    let y: Vec<f64> = (0..64 * 300).map(|_| normal(&mut random)).collect();
    let dictionary = MixedDictionary::new(problem.dictionary.clone(), true);
    let limits = Limits::atoms(16);
    let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
    assert!(again < 30, "{again} of 300");
    for (y, found) in y.chunks_exact(64).zip(&found) {
        let exact = reference::solve(&problem.dictionary, y, &limits).unwrap();
        assert_eq!(found.support, exact.support);
    }
}

#[test]
fn atoms_that_point_the_same_way_are_one_and_no_reason_to_doubt() {
    let problem = problem(Kind::Doubled, 64, 256, 8, 3);
    let mut random = Pcg64::seed_from_u64(4);
    let y: Vec<f64> = (0..64 * 100).map(|_| normal(&mut random)).collect();
    let dictionary = MixedDictionary::new(problem.dictionary.clone(), true);
    let (found, again) = dictionary.solve_batch(&Limits::atoms(16), &y).unwrap();
    assert!(again < 20, "{again} of 100");
    // The copies stand five places after their originals.
    for solution in &found {
        assert!(solution.support.iter().all(|k| k % 6 != 5), "{:?}", solution.support);
    }
    // An angle that only double precision resolves still makes two distinct atoms.
    let mut nearly = DMatrix::<f64>::identity(4, 3);
    nearly.column_mut(2).copy_from_slice(&[1.0, 0.0, 0.0, 1e-3]);
    let dictionary = MixedDictionary::new(nearly, true);
    let (found, again) = dictionary.solve_batch(&Limits::atoms(1), &[1.0, 0.0, 0.0, 1e-3]).unwrap();
    assert_eq!((&found[0].support[..], again), (&[2][..], 1));
    assert_eq!(dictionary.single().atoms().doubles(), []);
}

#[test]
fn atoms_as_they_are_are_chosen_by_their_inner_products() {
    // The second atom is longer, but the first fits better.
    let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 3.0, 0.0, 3.0]);
    let first = |normalised| {
        let dictionary = MixedDictionary::new(matrix.clone(), normalised);
        let limits = Limits::atoms(1);
        let (found, _) = dictionary.solve_batch(&limits, &[1.0, 0.1]).unwrap();
        found[0].support[0]
    };
    assert_eq!((first(true), first(false)), (0, 1));
    // The second atom is the first one, but longer.
    let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 3.0, 0.0, 0.0]);
    let limits = Limits::atoms(1);
    let dictionary = MixedDictionary::new(matrix, false);
    let (found, _) = dictionary.solve_batch(&limits, &[1.0, 0.1]).unwrap();
    assert_eq!(found[0].support, [1]);
    assert_eq!(dictionary.single().atoms().doubles(), []);
}

#[test]
fn what_is_decided_again_is_decided_by_the_frames_own_measurement() {
    // Choices: the frames differ only by which atom leads.
    let (matrix, first) = nearly_tied(1e-9);
    let frames = [first, nearly_tied(-1e-9).1, nearly_tied(1e-9).1].concat();
    let (found, again) =
        MixedDictionary::new(matrix, true).solve_batch(&Limits::atoms(1), &frames).unwrap();
    let supports: Vec<_> = found.iter().map(|found| found.support[0]).collect();
    assert_eq!((supports, again), (vec![69, 2, 69], 3));
    // Ends: only the second frame meets the limit to rounding.
    let matrix = DMatrix::<f64>::identity(8, 8);
    let frames =
        [[0.0, 3.0, 0.0, 1.5, 0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.6, 0.8]];
    let limits = Limits { noise: ((1.0 + 1e-9_f64) / 8.0).sqrt(), ..Limits::atoms(3) };
    let (found, again) = MixedDictionary::new(matrix.clone(), true)
        .solve_batch(&limits, frames.as_flattened())
        .unwrap();
    for (found, y) in found.iter().zip(&frames) {
        assert_eq!(*found, reference::solve(&matrix, y, &limits).unwrap());
    }
    assert_eq!(again, 1);
}

#[test]
fn a_limit_that_the_residual_meets_to_rounding_is_judged_in_double_precision() {
    // In single precision the residual's energy is 5e-8 too large, so with the first two limits the
    // pursuit goes on, and with the last two it ends there.
    for (lead, size) in [(1e-9, 1.0), (-1e-9, 1.0), (1e-7, 1.0), (1e-7, 2.0_f64)] {
        let matrix = DMatrix::<f64>::identity(8, 8);
        let y = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.6, 0.8].map(|y| y * size);
        // After the first atom the residual's energy is 1; the limit is a little above or below.
        let noise = size * ((1.0_f64 + lead) / 8.0).sqrt();
        let limits = Limits { noise, ..Limits::atoms(3) };
        let dictionary = MixedDictionary::new(matrix.clone(), true);
        let (found, again) = dictionary.solve_batch(&limits, &y).unwrap();
        let exact = reference::solve(&matrix, &y, &limits).unwrap();
        assert_eq!((&found[0], again), (&exact, 1), "{lead}");
        assert_eq!(dictionary.solver(&limits).unwrap().solve(&y).unwrap(), (exact, true));
    }
}
