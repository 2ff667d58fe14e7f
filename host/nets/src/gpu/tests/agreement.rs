//! The agreement with the readings on each GPU, against the processor's.

use nirspi_gpu::agreement::BROKEN;

use super::*;
use crate::consistency::{Binding, Consistency, MeasuredRows, agreement};
use crate::fusion;
use crate::grid::AREA;
use crate::random::Noise;
use crate::{Estimate, KnownEstimate};

/// A scene, readings of it under this blur and noise, and a guess that is wrong by `error`.
struct Case {
    what: &'static str,
    estimate: Estimate,
    readings: Vec<f32>,
    guess: Vec<f32>,
}

/// A guess that is clamped, and otherwise stays as it is.
const INSIDE: &str = "inside the ball";

/// A guess that is nearer to the truth than any image that agrees: the readings have a pattern that no image of this blur has.
const STAYS: &str = "no image gives the readings";

/// Means of 2 x 2 pixels.
fn halved(image: &[f32]) -> Vec<f32> {
    let pixel = |i: usize| {
        let first = i / 32 * 2 * 64 + i % 32 * 2;
        [0, 1, 64, 65].map(|more| image[first + more]).iter().sum::<f32>() / 4.0
    };
    (0..1024).map(pixel).collect()
}

fn scene(seed: usize) -> Vec<f32> {
    let wave = |i: usize| {
        let (x, y) = ((i % 64) as f32, (i / 64) as f32);
        let edge = f32::from(u8::from((x - 30.0).abs() < 9.0 || (y - 20.0).abs() < 4.0));
        0.5 * edge + 0.25 + 0.2 * (0.2 * x + seed as f32).sin() * (0.13 * y).cos()
    };
    (0..AREA).map(wave).collect()
}

fn case(
    what: &'static str,
    (sigma_px, noise): (f32, f32),
    (true_noise, error): (f32, f32),
    seed: usize,
) -> Case {
    let truth = scene(seed);
    let mut noises = Noise::of(5, seed);
    let readings = halved(&truth).iter().map(|v| v + true_noise * noises.draw()).collect();
    let guess = truth.iter().map(|v| v + error * noises.draw()).collect();
    Case { what, estimate: Estimate { sigma_px, noise }, readings, guess }
}

fn of_no_image(seed: usize) -> Case {
    let mut case = case(STAYS, (3.0, 0.01), (0.0, 0.0), seed);
    for (i, reading) in case.readings.iter_mut().enumerate() {
        *reading += if (i / 32 + i % 32).is_multiple_of(2) { 0.2 } else { -0.2 };
    }
    case
}

/// Every case is a frame of one launch.
fn cases() -> Vec<Case> {
    vec![
        of_no_image(7),
        case("moved onto the ball", (1.0, 0.02), (0.02, 0.3), 0),
        case(INSIDE, (0.5, 0.2), (0.02, 0.01), 1),
        case("too much blur: the least lambda", (6.0, 0.005), (0.005, 0.3), 2),
        case("no blur", (0.0, 0.01), (0.01, 0.2), 3),
        case("less noise than the least", (0.7, 0.0001), (0.001, 0.1), 4),
        case("noise only, and outside [0, 1]", (1.5, 0.1), (0.3, 1.0), 5),
        case("much blur and noise", (4.0, 0.05), (0.05, 0.5), 6),
    ]
}

fn rows(which: impl Fn(u32) -> bool) -> MeasuredRows {
    MeasuredRows::new(fusion::SIDE, &(0..1024).filter(|&row| which(row)).collect::<Vec<_>>())
        .unwrap()
}

#[test]
fn images_agree_as_on_the_processor() {
    let cases = cases();
    let all = |of: &dyn Fn(&Case) -> Vec<f32>| cases.iter().flat_map(of).collect::<Vec<f32>>();
    let outputs = all(&|case| vec![case.estimate.sigma_px / 8.0, case.estimate.noise * 10.0]);
    let measured = [
        ("all rows", MeasuredRows::All),
        ("the first half", rows(|row| row < 512)),
        ("one row", rows(|row| row == 0)),
    ];
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let readings = on.upload(&all(&|case| case.readings.clone()));
        let guesses = on.upload(&all(&|case| case.guess.clone()));
        let outputs = on.upload(&outputs);
        for ((rows, measured), binding) in measured.iter().flat_map(|rows| {
            [Binding::OfEstimate, Binding::OfKnownBlur, Binding::Off].map(|binding| (rows, binding))
        }) {
            let law =
                agreement(on, &on.limits(), measured, binding, KnownEstimate::default()).unwrap();
            let made = on.agree(&law, &readings, &guesses, &outputs, cases.len());
            let (images, ratios) = (read(on, &made.images), read(on, &made.ratios));
            let each = images.chunks_exact(AREA).zip(ratios).zip(&cases);
            for ((ours, ratio), case) in each {
                let Estimate { sigma_px, noise } = case.estimate;
                let model = Consistency::new(fusion::SIDE, sigma_px, noise).of_rows(measured);
                let model = model.unwrap();
                let mut theirs = case.guess.clone();
                model.agree(&case.readings, &mut theirs, binding);
                let what = format!("{backend}: {}, {rows}, {binding:?}", case.what);
                if case.what == STAYS && *rows == "all rows" {
                    let stays = binding != Binding::OfKnownBlur;
                    assert_eq!(ours == case.guess, stays, "{what}");
                    assert!(ratio > 10.0, "{what}: {ratio}");
                }
                if case.what == INSIDE {
                    assert_eq!(ours, theirs, "{what}");
                }
                let apart = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs());
                let apart = apart.fold(0.0, |most, v| if v <= most { most } else { v });
                // Both solve the equation of missing rows to a residual of 1e-3.
                assert!(apart < 2e-4, "{what}: {apart}");
                let expected = model.residual_ratio(&case.readings, &theirs);
                assert!(
                    (ratio - expected).abs() < 1e-3 * (1.0 + expected),
                    "{what}: {ratio} {expected}"
                );
            }
        }
    }
}

#[test]
fn what_the_caller_knows_is_used_in_place_of_the_estimate() {
    let known = KnownEstimate { sigma_px: Known::Exactly(2.0), noise: Known::AtLeast(0.03) };
    let case = case("known", (2.0, 0.03), (0.02, 0.3), 9);
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let [readings, guess] = [&case.readings, &case.guess].map(|numbers| on.upload(numbers));
        let image = |outputs: [f32; 2], known| {
            let law = agreement(on, &on.limits(), &MeasuredRows::All, Binding::OfEstimate, known)
                .unwrap();
            let made = on.agree(&law, &readings, &guess, &on.upload(&outputs), 1);
            read(on, &made.images)
        };
        let told = image([0.25, 0.3], KnownEstimate::default());
        assert_close(&image([0.9, 0.001], known), &told, &format!("{backend}"));
    }
}

#[test]
fn a_guess_with_nan_is_told_although_its_image_hides_it() {
    let case = case("NaN", (1.0, 0.02), (0.02, 0.3), 3);
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let mut guesses = [case.guess.clone(), case.guess.clone()].concat();
        guesses[AREA + 77] = f32::NAN;
        let [readings, guesses] = [&[&case.readings[..], &case.readings].concat(), &guesses]
            .map(|numbers| on.upload(numbers));
        let known = KnownEstimate::default();
        let law =
            agreement(on, &on.limits(), &MeasuredRows::All, Binding::OfEstimate, known).unwrap();
        let outputs = on.upload(&[0.125, 0.2, 0.125, 0.2]);
        let made = on.agree(&law, &readings, &guesses, &outputs, 2);
        let ratios = read(on, &made.ratios);
        assert!(ratios[0] >= 0.0, "{backend}: {ratios:?}");
        assert_eq!(ratios[1], BROKEN, "{backend}");
    }
}
