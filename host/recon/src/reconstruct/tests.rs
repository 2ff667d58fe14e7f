use super::*;
use crate::testing::{array, correlation_of, measured, normal, real_data, scene, side};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn opar() -> Option<Measurements> {
    let mut file = real_data("opar_ala1.npz")?;
    let rows = Rows::new(side(64), array::<i32>(&mut file, "h_row")).unwrap();
    let y: Vec<f64> = array::<f32>(&mut file, "y").into_iter().map(f64::from).collect();
    let crate::law::Reading { measurements, dropouts, outliers, doubts, .. } =
        Measurements::from_pairs(&rows, &y).unwrap();
    assert_eq!(dropouts, vec![], "its own description says that nothing dropped out");
    assert_eq!((outliers, doubts), (vec![], vec![]));
    Some(measurements)
}

fn car(detector: usize) -> Option<Measurements> {
    let mut file = real_data("scheidt_car.npz")?;
    let rows = Rows::new(side(32), array::<i32>(&mut file, "h_row")).unwrap();
    let d: Vec<f64> = array::<i32>(&mut file, "d").into_iter().map(f64::from).collect();
    let d = &d[detector * 1024..(detector + 1) * 1024];
    Some(Measurements::from_differential(&rows, d).unwrap())
}

/// Correlations with the full image, of zero filling and of OMP.
fn against_full(all: &Measurements, part: &Measurements, basis: Basis) -> (f64, f64) {
    let full = hadamard(all);
    let settings = OmpSettings { basis, ..OmpSettings::default() };
    let sparse = omp(part, &settings).unwrap();
    (correlation_of(&hadamard(part), &full), correlation_of(&sparse.image, &full))
}

#[test]
fn the_public_wing_comes_out_as_its_authors_have_it() {
    let Some(all) = opar() else { return };
    let mut file = real_data("opar_ala1.npz").unwrap();
    let recon = Image::new(side(64), array::<f32>(&mut file, "recon"));
    assert!(correlation_of(&hadamard(&all), &recon) > 0.9999);
    let shown = Order::ZigZag.rows(side(64)).unwrap();
    assert_eq!(&shown, all.rows(), "our zig-zag is its order");
}

#[test]
fn omp_beats_zero_filling_on_real_measurements() {
    if let Some(all) = opar() {
        let (zero, sparse) = against_full(&all, &all.take(None, 0.3).unwrap(), Basis::Dct);
        // The full image has the noise of the same readings, which favours zero filling.
        assert!(sparse > zero + 0.005, "wing, DCT: {sparse} against {zero}");
        let (zero, sparse) = against_full(&all, &all.take(None, 0.3).unwrap(), Basis::Haar);
        assert!(sparse > zero - 0.002, "wing, Haar: {sparse} against {zero}");
    }
    if let Some(all) = car(0) {
        let part = all.take(Some(&LOWEST_SEQUENCIES), 0.3).unwrap();
        let (zero, sparse) = against_full(&all, &part, Basis::Dct);
        assert!(sparse > zero, "car, DCT: {sparse} against {zero}");
        let (zero, sparse) = against_full(&all, &part, Basis::Haar);
        assert!(sparse > zero - 0.002, "car, Haar: {sparse} against {zero}");
    }
}

#[test]
fn the_lowest_sequencies_see_more_than_the_first_rows_of_a_raster() {
    let image = scene(side(32), 2);
    let all = measured(side(32), &image);
    let full = hadamard(&all);
    for raster in [Order::Natural, Order::Sequency, Order::Walsh2d] {
        let part =
            |order: &Order| correlation_of(&hadamard(&all.take(Some(order), 0.3).unwrap()), &full);
        let (first, lowest) = (part(&raster), part(&LOWEST_SEQUENCIES));
        assert!(lowest > first + 0.01, "{raster}: {first}, lowest sequencies {lowest}");
    }
}

#[test]
fn a_full_sweep_is_inverted_exactly_by_every_method() {
    let image = scene(side(16), 1);
    let all = measured(side(16), &image);
    let exact = Image::new(side(16), image.iter().map(|&v| v as f32).collect());
    for found in [hadamard(&all), omp(&all, &OmpSettings::default()).unwrap().image] {
        for (a, b) in found.pixels().iter().zip(exact.pixels()) {
            assert!((a - b).abs() < 1e-4);
        }
    }
}

#[test]
fn what_was_measured_is_kept_within_its_noise_and_any_side_and_share_gives_an_image() {
    for n in [2, 8, 16, 32] {
        let all = measured(side(n), &scene(side(n), 2));
        for share in [0.01, 0.05, 0.3, 0.9, 1.0] {
            for order in [Order::ZigZag, Order::Random(4)] {
                let part = all.take(Some(&order), share).unwrap();
                for basis in [Basis::Dct, Basis::Haar, Basis::Pixel] {
                    let settings = OmpSettings { basis, ..OmpSettings::default() };
                    let found = omp(&part, &settings).unwrap();
                    let within = f64::from(WITHIN) * found.noise + 1e-3 * n as f64;
                    assert!(found.image.pixels().iter().all(|p| p.is_finite()));
                    let mut back: Vec<f64> =
                        found.image.pixels().iter().map(|&p| p.into()).collect();
                    fwht(&mut back).unwrap();
                    for (&row, value) in part.rows().iter().zip(part.values()) {
                        assert!((back[row as usize] - value).abs() < within);
                    }
                }
            }
        }
    }
}

#[test]
fn a_sparse_image_is_recovered_from_a_random_half() {
    let side = side(16);
    let transform = Transform::new(Basis::Dct, side);
    let mut coefficients = vec![0.0_f32; 256];
    for (atom, value) in [(3, 6.0), (37, 4.0), (39, -3.0), (18, 2.5), (121, 2.0)] {
        coefficients[atom] = value;
    }
    transform.synthesise(&mut coefficients);
    let image: Vec<f64> = coefficients.iter().map(|&v| v.into()).collect();
    let part = measured(side, &image).take(Some(&Order::Random(3)), 0.5).unwrap();
    let found = omp(&part, &OmpSettings::as_printed(Basis::Dct, 5)).unwrap();
    for (a, b) in found.image.pixels().iter().zip(&coefficients) {
        assert!((a - b).abs() < 1e-3);
    }
    assert!(found.residual < 1e-3);
}

#[test]
fn atoms_of_ones_own_stand_for_a_basis_and_do_better_where_they_fit() {
    let side = side(16);
    // Bars of all lengths and places; the scene is two of these bars.
    let bar = |r: usize, c: usize, height: usize, width: usize| -> Vec<f32> {
        let inside =
            |p: usize| (r..r + height).contains(&(p / 16)) && (c..c + width).contains(&(p % 16));
        (0..256).map(|p| f32::from(u8::from(inside(p)))).collect()
    };
    let mut atoms = vec![1.0; 256];
    for (r, c) in (0..12).flat_map(|r| (0..12).map(move |c| (r, c))) {
        atoms.extend(bar(r, c, 2, 5));
        atoms.extend(bar(r, c, 5, 2));
    }
    let scene: Vec<f64> =
        bar(3, 4, 2, 5).iter().zip(bar(7, 2, 5, 2)).map(|(a, b)| f64::from(a + 2.0 * b)).collect();
    let all = measured(side, &scene);
    let full = hadamard(&all);
    let part = all.take(Some(&Order::Random(3)), 0.3).unwrap();
    let settings = OmpSettings::default();
    let own = omp_over(&part, &atoms, &settings).unwrap();
    let cosines = correlation_of(&omp(&part, &settings).unwrap().image, &full);
    let found = correlation_of(&own.image, &full);
    assert!(found > 0.99 && found > cosines + 0.1, "{found}, cosines {cosines}");
    assert!(own.trust > 0.5 && own.sparsity < 20, "{own:?}");

    let sparse = OmpSettings::as_printed(Basis::Pixel, 2);
    let exact = omp_over(&part, &atoms, &sparse).unwrap();
    for (a, b) in exact.image.pixels().iter().zip(full.pixels()) {
        assert!((a - b).abs() < 1e-3);
    }
    let refused = omp_over(&part, &atoms[1..], &settings).unwrap_err().to_string();
    assert!(refused.contains("multiple of the 256 pixels"), "{refused}");
}

#[test]
fn light_that_may_not_be_negative_is_not_and_points_come_back_better() {
    let side = side(16);
    let mut points = vec![0.0; 256];
    for (pixel, light) in [(18, 3.0), (77, 2.0), (140, 1.0), (141, 2.5), (250, 1.5)] {
        points[pixel] = light;
    }
    let all = measured(side, &points);
    // A fifth of the rows is too little for points with any sign.
    let part = all.take(Some(&Order::Table(crate::order::shuffled(256, 3))), 0.2).unwrap();
    let signed =
        OmpSettings { basis: Basis::Pixel, exactly_sparse: true, ..OmpSettings::default() };
    let signed = OmpSettings { sparsity: Sparsity::Fixed(5), ..signed };
    let lit = OmpSettings { non_negative: true, ..signed };
    let own: Vec<f32> = (0..256 * 256).map(|p| f32::from(u8::from(p % 257 == 0))).collect();
    let full = hadamard(&all);
    let any = correlation_of(&omp(&part, &signed).unwrap().image, &full);
    for found in [omp(&part, &lit).unwrap(), omp_over(&part, &own, &lit).unwrap()] {
        assert!(found.image.pixels().iter().all(|&p| p > -1e-4));
        let correlation = correlation_of(&found.image, &full);
        assert!(correlation > 0.95 && correlation > any + 0.1, "{correlation}, any sign {any}");
    }
    let refused = omp(&part, &OmpSettings { non_negative: true, ..OmpSettings::default() });
    assert_eq!(refused.unwrap_err(), ReconstructError::Signed { basis: Basis::Dct });
}

#[test]
fn units_do_not_matter() {
    let image = scene(side(16), 1);
    let volts = measured(side(16), &image).take(Some(&Order::CakeCutting), 0.3).unwrap();
    let settings = OmpSettings::default();
    let found = omp(&volts, &settings).unwrap();
    for factor in [1e-15, 1e15] {
        let values: Vec<f64> = volts.values().iter().map(|v| v * factor).collect();
        let other = Measurements::from_differential(volts.rows(), &values).unwrap();
        let other = omp(&other, &settings).unwrap();
        assert_eq!((other.sparsity, other.trust), (found.sparsity, found.trust));
        assert!((other.noise / factor / found.noise - 1.0).abs() < 1e-5);
        for (a, b) in other.image.pixels().iter().zip(found.image.pixels()) {
            assert!((f64::from(*a) / factor - f64::from(*b)).abs() < 1e-5);
        }
    }
}

#[test]
fn noise_is_told_in_the_units_of_the_measurements() {
    let all = measured(side(16), &scene(side(16), 1));
    let rows = Order::ZigZag.rows(side(16)).unwrap();
    let mut random = Pcg64::seed_from_u64(6);
    let noisy: Vec<f64> =
        rows.iter().map(|&r| all.values()[r as usize] + 0.7 * normal(&mut random)).collect();
    let noisy = Measurements::from_differential(&rows, &noisy).unwrap();
    let noise =
        |noise| omp(&noisy, &OmpSettings { noise, ..OmpSettings::default() }).unwrap().noise;
    let (known, estimated) = (noise(NoiseLevel::Known(0.7)), noise(NoiseLevel::Estimated));
    assert!((known - 0.7).abs() < 1e-6, "{known}");
    // 256 readings tell little, and the estimate is cautious.
    assert!((0.0..1.0).contains(&estimated), "{estimated}");
}

#[test]
fn darkness_reconstructs_to_darkness() {
    let part = measured(side(8), &[0.0; 64]).take(None, 0.5).unwrap();
    for settings in [OmpSettings::default(), OmpSettings::as_printed(Basis::Haar, 9)] {
        let found = omp(&part, &settings).unwrap();
        assert!(found.image.pixels().iter().all(|&p| p == 0.0));
        assert_eq!((found.residual, found.trust * 0.0), (0.0, 0.0));
    }
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let part = measured(side(8), &scene(side(8), 0));
    let sound = OmpSettings::default();
    let refused = |settings: OmpSettings| omp(&part, &settings).unwrap_err().to_string();
    assert!(
        refused(OmpSettings { falloff: Some(f64::NAN), ..sound }).starts_with("falloff is NaN")
    );
    assert!(refused(OmpSettings { visibility: 1.0, ..sound }).starts_with("visibility is 1"));
    assert!(refused(OmpSettings { residual: -1.0, ..sound }).contains("residual limit of -1"));
    let noise = NoiseLevel::Known(-0.5);
    assert!(refused(OmpSettings { noise, ..sound }).starts_with("noise is -0.5"));
    let sparsity = Sparsity::CrossValidated { most: 5, folds: 1 };
    assert!(refused(OmpSettings { sparsity, ..sound }).starts_with("folds is 1"));
    let noise = NoiseLevel::Known(f64::INFINITY);
    assert!(refused(OmpSettings { noise, ..sound }).starts_with("noise is inf"));
    assert!(refused(OmpSettings { falloff: Some(8.1), ..sound }).starts_with("falloff is 8.1"));
    assert!(refused(OmpSettings { visibility: -0.1, ..sound }).starts_with("visibility is -0.1"));
    let sparsity = Sparsity::CrossValidated { most: 5, folds: 2 };
    let (falloff, visibility, noise) = (Some(8.0), 0.0, NoiseLevel::Known(0.0));
    let last = OmpSettings { falloff, visibility, noise, sparsity, ..sound };
    assert_eq!(last.check(), Ok(()));
}

/// Frames with noise: a square stands still, moves, and is replaced by a bar.
fn video() -> Vec<Measurements> {
    let side = side(32);
    let mut random = Pcg64::seed_from_u64(5);
    let frame = |k: usize| -> Measurements {
        let lit = |r: usize, c: usize| match k {
            0..8 => (8..20).contains(&r) && (6..18).contains(&c),
            _ => (4..28).contains(&r) && (20..24).contains(&c),
        };
        let image: Vec<f64> =
            (0..1024).map(|p| if lit(p / 32, p % 32) { 1.0 } else { 0.1 }).collect();
        let rows = Order::CakeCutting.rows(side).unwrap().first(307);
        let all = measured(side, &image);
        let values: Vec<f64> =
            rows.iter().map(|&r| all.values()[r as usize] + 2.0 * normal(&mut random)).collect();
        Measurements::from_differential(&rows, &values).unwrap()
    };
    (0..12).map(frame).collect()
}

#[test]
fn frames_of_a_video_start_from_the_one_before_until_the_scene_changes() {
    let frames = video();
    let settings = OmpSettings::default();
    let found = omp_video(&frames, &settings).unwrap();
    let cold: Vec<usize> = (0..12).filter(|&k| !found[k].warm).collect();
    assert_eq!(cold, [0, 8]);
    for (frame, found) in frames.iter().zip(&found).filter(|(_, found)| found.warm) {
        let alone = omp(
            frame,
            &OmpSettings { sparsity: Sparsity::Fixed(found.reconstruction.sparsity), ..settings },
        );
        let alone = alone.unwrap();
        let alike = correlation_of(&found.reconstruction.image, &alone.image);
        assert!(alike > 0.98, "{alike}");
    }
    assert_eq!(found[8].reconstruction, omp(&frames[8], &settings).unwrap());
}

#[test]
fn frames_with_other_rows_start_from_scratch() {
    let mut frames = video();
    frames.truncate(4);
    frames[2] = frames[2].take(Some(&Order::CakeCutting), 0.25).unwrap();
    let found = omp_video(&frames, &OmpSettings::default()).unwrap();
    assert_eq!(found.iter().map(|f| f.warm).collect::<Vec<_>>(), [false, true, false, false]);
    assert_eq!(omp_video(&[], &OmpSettings::default()).unwrap(), []);
    let dark = vec![measured(side(8), &[0.0; 64]); 3];
    let found = omp_video(&dark, &OmpSettings::default()).unwrap();
    assert_eq!(found.iter().map(|f| f.warm).collect::<Vec<_>>(), [false, true, true]);
}
