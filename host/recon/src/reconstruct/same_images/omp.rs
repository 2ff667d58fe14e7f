//! Orthogonal matching pursuit with its settings, over a basis and over a user's own atoms.

use super::*;

fn add(table: &mut Table, name: &str, found: &OmpReconstruction) {
    table.image(name, found.image.pixels().iter().copied());
    let OmpReconstruction { sparsity, residual, unseen_atoms, trust, noise, .. } = *found;
    let numbers = [sparsity as f64, residual, unseen_atoms as f64, trust, noise];
    table.line(&format!("report, {name} [{:?}]", found.stop), &numbers);
}

fn settings() -> Vec<(&'static str, OmpSettings)> {
    let base = OmpSettings::default();
    let sparse = OmpSettings { exactly_sparse: true, ..base };
    vec![
        ("to the noise", OmpSettings { sparsity: Sparsity::Noise, ..base }),
        ("30 atoms", OmpSettings { sparsity: Sparsity::Fixed(30), ..sparse }),
        ("residual 0.1", OmpSettings { sparsity: Sparsity::Fixed(60), residual: 0.1, ..sparse }),
        ("known noise", OmpSettings { noise: NoiseLevel::Known(1.5), falloff: Some(0.6), ..base }),
        (
            "three parts, well seen",
            OmpSettings {
                sparsity: Sparsity::CrossValidated { most: 20, folds: 3 },
                visibility: 0.4,
                ..base
            },
        ),
        ("Daubechies", OmpSettings { basis: Basis::Daubechies4, ..base }),
        ("pixels", OmpSettings { basis: Basis::Pixel, non_negative: true, ..sparse }),
        ("as printed", OmpSettings::as_printed(Basis::Haar, 12)),
    ]
}

#[test]
fn omp_makes_the_images_that_it_made() {
    let mut table = Table::default();
    for (name, part) in parts() {
        for (what, settings) in settings() {
            let found = omp(&part, &settings).unwrap();
            add(&mut table, &format!("{what}, {name}"), &found);
        }
    }
    table.is_the_same_as("omp.txt");
}

#[test]
fn atoms_of_ones_own_make_the_images_that_they_made() {
    let mut table = Table::default();
    // Blurred spots and one even image, of different norms.
    let spot = |at: usize| -> Vec<f32> {
        let (r, c) = ((at / 8 * 2) as f32, (at % 8 * 2) as f32);
        let distance = |p: usize| (r - (p / 16) as f32).hypot(c - (p % 16) as f32);
        (0..256).map(|p| (1 + at % 3) as f32 * (-distance(p).powi(2) / 4.0).exp()).collect()
    };
    let mut atoms = vec![1.0; 256];
    (0..64).for_each(|at| atoms.extend(spot(at)));
    for (name, part) in parts() {
        for (what, settings) in settings().into_iter().filter(|(what, _)| *what != "Daubechies") {
            let found = omp_over(&part, &atoms, &settings).unwrap();
            add(&mut table, &format!("own atoms, {what}, {name}"), &found);
        }
    }
    table.is_the_same_as("own_atoms.txt");
}

#[test]
fn frames_of_a_video_by_omp_are_those_that_were_made() {
    let mut table = Table::default();
    let rows = Order::CakeCutting.rows(side(16)).unwrap().first(90);
    let frames: Vec<Measurements> = (0..6)
        .map(|k| noisy(&rows, &scene(side(16), if k < 4 { 2 } else { 1 }), 0.4, 5 + k))
        .collect();
    for (what, settings) in settings() {
        for (k, frame) in omp_video(&frames, &settings).unwrap().iter().enumerate() {
            let name = format!("frame {k}, warm: {}, {what}", frame.warm);
            add(&mut table, &name, &frame.reconstruction);
        }
    }
    table.is_the_same_as("omp_video.txt");
}
