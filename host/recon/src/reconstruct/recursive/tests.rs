use super::*;
use crate::reconstruct::frame::{believed_frame, residual};
use crate::reconstruct::{Reconstruct, Reconstruction};
use crate::testing::{figure, noisy, scene, side};
use crate::{Order, Rows};
use proptest::prelude::*;

/// The rows of a frame: the first of zig-zag order always, the others in turn.
fn rows_of(side: Side, frame: usize, always: usize, of_others: usize) -> Rows {
    let order = Order::ZigZag.rows(side).unwrap();
    let turns = (side.area() - always).div_ceil(of_others);
    let others = (always..side.area()).filter(|at| at % turns == frame % turns);
    Rows::trusted(side, (0..always).chain(others).map(|at| order[at]).collect())
}

/// Measurements of an image by some rows, with noise of a pixel of the image of all patterns.
fn read(rows: &Rows, image: &[f64], noise: f64, seed: u64) -> Measurements {
    noisy(rows, image, rows.side().pixels() as f64 * noise, seed)
}

fn rms(image: &Image, truth: &[f64]) -> f64 {
    let squares = image.pixels().iter().zip(truth).map(|(a, b)| (f64::from(*a) - b).powi(2));
    (squares.sum::<f64>() / truth.len() as f64).sqrt()
}

fn estimate(settings: RecursiveSettings, frames: &[Measurements]) -> Vec<RecursiveFrame> {
    let mut estimate = Recursive::new(settings).unwrap();
    frames.iter().map(|frame| estimate.add(frame).unwrap()).collect()
}

fn still() -> RecursiveSettings {
    RecursiveSettings { speed_px: Some(0.0), follow: false, ..RecursiveSettings::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_still_scene_is_the_mean_of_its_frames(
        kind in 0_u8..5, noise in 0.001_f64..0.2, count in 2_usize..9, seed in 0_u64..100,
    ) {
        let side = side(16);
        let truth = scene(side, kind);
        let all = Rows::natural(side);
        let frames: Vec<Measurements> =
            (0..count as u64).map(|k| read(&all, &truth, noise, 1000 * seed + k)).collect();
        let settings = RecursiveSettings { noise: NoiseLevel::Known(16.0 * noise), ..still() };
        let last = estimate(settings, &frames).pop().unwrap();
        let mean: Vec<f64> = (0..side.area())
            .map(|k| frames.iter().map(|f| f.values()[k]).sum::<f64>() / count as f64)
            .collect();
        let largest = mean.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (&row, value) in last.fused.rows().iter().zip(last.fused.values()) {
            prop_assert!((value - mean[row as usize]).abs() < 1e-5 * largest, "{}", row);
        }
        // A scene without any structure is not predicted, which costs a little.
        let mean = super::super::hadamard(&Measurements::trusted(all, mean));
        prop_assert!(rms(&last.image, &truth) < 1.3 * rms(&mean, &truth));
        prop_assert!(last.warm && last.fused.rows().len() == side.area());
    }

    #[test]
    fn while_nothing_moves_the_error_falls_with_the_root_of_the_number_of_frames(
        noise in 0.01_f64..0.1, seed in 0_u64..100,
    ) {
        let side = side(32);
        let truth = scene(side, 1);
        let frames: Vec<Measurements> = (0..64)
            .map(|k| read(&rows_of(side, k, 64, 240), &truth, noise, 1000 * seed + k as u64))
            .collect();
        // Four frames show every row once.
        let made = estimate(still(), &frames);
        let error = |frame: usize| rms(&made[frame].image, &truth);
        prop_assert_eq!(made[3].fused.rows().len(), 1024);
        for (frame, looks) in [(15, 4.0_f64), (63, 16.0)] {
            let (found, expected) = (error(frame), noise / looks.sqrt());
            prop_assert!(found < 1.1 * expected, "frame {}: {} {}", frame, found, expected);
        }
        prop_assert!(error(63) < 0.8 * error(15));
    }
}

#[test]
fn motion_and_speed_that_are_estimated_cost_a_still_scene_little() {
    let side = side(32);
    let truth = scene(side, 1);
    for noise in [0.01, 0.1] {
        let frame = |k: usize| read(&rows_of(side, k, 64, 240), &truth, noise, k as u64);
        let frames: Vec<Measurements> = (0..64).map(frame).collect();
        let error = |settings| rms(&estimate(settings, &frames)[63].image, &truth);
        let (found, told) = (error(RecursiveSettings::default()), error(still()));
        assert!(found < 1.5 * told, "noise {noise}: {found} against {told}");
    }
}

/// The detail of a scene hides its noise within one frame: only a second look at the same rows tells the two apart.
#[test]
fn the_noise_of_a_scene_that_stands_still_again_is_found_however_small_it_is() {
    let side = side(32);
    for noise in [1e-4, 1e-3, 1e-2] {
        let frames: Vec<Measurements> = (0..32)
            .map(|k| {
                let truth = figure(side, 0, i64::from(k >= 8));
                read(&rows_of(side, k, 64, 240), &truth, noise, 7 + k as u64)
            })
            .collect();
        let made = estimate(RecursiveSettings::default(), &frames);
        assert_eq!(made[8].shift_px, [0.0, 1.0]);
        for k in [7, 31] {
            let found = made[k].noise / (32.0 * noise);
            assert!((0.6..1.6).contains(&found), "noise {noise}, frame {k}: {found} times that");
        }
    }
}

#[test]
fn a_part_that_moves_costs_nothing_where_the_readings_have_hardly_any_noise() {
    let side = side(32);
    let (all, noise) = (Rows::natural(side), 0.001);
    let still = figure(side, 0, 0);
    let alone = RegularisedSettings::new(Penalty::Tikhonov);
    let mut estimate = Recursive::new(RecursiveSettings::default()).unwrap();
    for k in 0..8 {
        let mut truth = still.clone();
        (0..side.area()).filter(|p| p % 32 / 4 == k).for_each(|p| truth[p] = 0.6);
        let frame = read(&all, &truth, noise, k as u64);
        let made = estimate.add(&frame).unwrap();
        let (found, by_itself) =
            (rms(&made.image, &truth), rms(&regularised(&frame, &alone).unwrap().image, &truth));
        // Both estimate the noise, and not alike.
        assert!(found < 1.12 * by_itself, "frame {k}: {found} against {by_itself}");
    }
}

#[test]
fn a_cut_starts_anew_and_costs_nothing() {
    let side = side(32);
    let noise = 0.03;
    let (before, after) = (scene(side, 2), scene(side, 1));
    let frame = |k: usize, truth: &[f64]| read(&rows_of(side, k, 100, 200), truth, noise, k as u64);
    let mut frames: Vec<Measurements> = (0..5).map(|k| frame(k, &before)).collect();
    frames.push(frame(5, &after));
    frames.push(frame(6, &after));
    let made = estimate(RecursiveSettings::default(), &frames);
    let warm: Vec<bool> = made.iter().map(|frame| frame.warm).collect();
    assert_eq!(warm, [false, true, true, true, true, false, true]);
    for k in [0, 5] {
        let alone = regularised(&frames[k], &RegularisedSettings::new(Penalty::Tikhonov)).unwrap();
        assert_eq!(made[k].image, alone.image);
    }
}

#[test]
fn a_moving_figure_is_followed_and_better_than_frame_by_frame() {
    let side = side(32);
    let noise = 0.05;
    for (down, right) in [(0, 1), (1, -2), (0, 0)] {
        let truths: Vec<Vec<f64>> =
            (0..8).map(|k| figure(side, down * (k - 3), right * (k - 3))).collect();
        let frames: Vec<Measurements> = truths
            .iter()
            .enumerate()
            .map(|(k, truth)| read(&rows_of(side, k, 100, 200), truth, noise, k as u64))
            .collect();
        let made = estimate(RecursiveSettings::default(), &frames);
        let (mut error, mut of_alone) = (0.0, 0.0);
        for k in 4..8 {
            let (found, motion) = (made[k].shift_px, [down as f64, right as f64]);
            assert!(made[k].warm, "frame {k} of {motion:?}");
            let near = |axis: usize| (found[axis] - motion[axis]).abs() <= 0.5;
            assert!(near(0) && near(1), "{found:?} {motion:?}");
            let settings = RegularisedSettings::new(Penalty::Tikhonov);
            let alone = regularised(&frames[k], &settings).unwrap();
            error += rms(&made[k].image, &truths[k]);
            of_alone += rms(&alone.image, &truths[k]);
        }
        assert!(error < 0.65 * of_alone, "({down}, {right}): {error} against {of_alone}");
    }
}

#[test]
fn a_row_that_was_never_read_is_certain_only_where_readings_say_far_more_than_the_prior() {
    let side = side(32);
    let rows = Order::ZigZag.rows(side).unwrap().first(512);
    for (noise, some) in [(0.001, true), (0.1, false)] {
        let frames: Vec<Measurements> =
            (0..6).map(|k| read(&rows, &figure(side, 0, k), noise, k as u64)).collect();
        let last = estimate(RecursiveSettings::default(), &frames).pop().unwrap();
        assert_eq!(last.shift_px, [0.0, 1.0], "noise {noise}");
        let never_read =
            |known: &Measurements| known.rows().iter().filter(|row| !rows.contains(row)).count();
        let (fused, certain) = (never_read(&last.fused), never_read(&last.certain));
        assert!(fused > 0 && certain <= fused, "noise {noise}: {certain} of {fused}");
        assert_eq!(certain > 0, some, "noise {noise}: {certain} of {fused}");
        assert_eq!(last.certain.rows().len(), rows.len() + certain, "noise {noise}");
    }
}

#[test]
fn frames_without_light_of_another_side_and_out_of_range_are_no_trouble() {
    let dark = |n: u64| read(&Rows::natural(side(n)), &vec![0.0; (n * n) as usize], 0.0, 0);
    let frames = [dark(16), dark(16), dark(32), dark(32)];
    let made = estimate(RecursiveSettings::default(), &frames);
    for (frame, warm) in made.iter().zip([false, true, false, true]) {
        assert!(frame.image.pixels().iter().all(|v| v.abs() < 1e-6), "{frame:?}");
        assert_eq!(frame.warm, warm);
    }
    let mut estimate = Recursive::new(RecursiveSettings::default()).unwrap();
    estimate.add(&frames[0]).unwrap();
    estimate.restart();
    assert!(!estimate.add(&frames[0]).unwrap().warm);
    for speed in [-1.0, f64::NAN, 1e4] {
        let settings = RecursiveSettings { speed_px: Some(speed), ..still() };
        let error = Recursive::new(settings).err().unwrap();
        assert!(matches!(error, ReconstructError::Setting { setting: "speed", .. }));
    }
}

#[test]
fn the_residual_is_what_an_image_misses_of_the_readings() {
    let rows = Rows::natural(side(2));
    let image = Image::new(side(2), vec![1.0, 2.0, 3.0, 4.0]);
    // The rows of the image are 10, -2, -4 and 0.
    let of =
        |values: [f64; 4]| residual(&image, &Measurements::trusted(rows.clone(), values.into()));
    assert_eq!((of([10.0, -2.0, -4.0, 0.0]), of([0.0; 4])), (0.0, 0.0));
    assert!((of([10.0, -2.0, -4.0, 3.0]) - 3.0 / 129.0_f64.sqrt()).abs() < 1e-9);
}

/// A method whose image is that of the measured rows, and of zeros elsewhere.
struct ZeroFilled;

impl Reconstruct for ZeroFilled {
    fn name(&self) -> &str {
        "zero-filled"
    }

    fn reconstruct(&self, measured: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(Reconstruction {
            image: crate::reconstruct::hadamard(measured),
            report: crate::reconstruct::Report::new("zero-filled"),
        })
    }
}

#[test]
fn a_past_that_misleads_a_method_is_not_believed_and_one_that_helps_is() {
    let side = side(32);
    let rows = Rows::natural(side);
    // The motion is hidden from an estimate that holds the scene for still.
    for (moves, helps) in [(0, true), (1, false)] {
        let mut past = Recursive::new(still()).unwrap();
        let mut shares = Vec::new();
        for k in 0..8 {
            let truth = figure(side, 0, moves * k);
            let frame = read(&rows, &truth, 0.05, 7 + k as u64);
            let alone = ZeroFilled.reconstruct(&frame).unwrap().image;
            let made = believed_frame(&ZeroFilled, &mut past, &frame).unwrap();
            let share = past.belief.share();
            assert_eq!(made.report.warm, share > 0.0);
            if share == 0.0 {
                assert_eq!(made.image, alone, "frame {k}");
            }
            let (mixed, alone) = (rms(&made.image, &truth), rms(&alone, &truth));
            // What misleads costs less than half a decibel.
            let most = if helps && k > 3 { 0.7 } else { 1.059 };
            assert!(mixed < most * alone, "frame {k}: {mixed} of {alone}, share {share}");
            shares.push(share);
        }
        // The second frame is the first whose two images differ, and the third judges them.
        assert_eq!(shares[..2], [0.0, 0.0]);
        let expected = if helps { 0.5..=1.0 } else { 0.0..=0.2 };
        assert!(shares[2..].iter().all(|share| expected.contains(share)), "{shares:?}");
        past.restart();
        assert_eq!(past.belief.share(), 0.0);
    }
}

#[test]
fn a_cut_ends_the_belief_in_the_scene_before() {
    let side = side(32);
    let rows = Rows::natural(side);
    let mut past = Recursive::new(RecursiveSettings::default()).unwrap();
    let mut shares = Vec::new();
    for k in 0..9 {
        let truth = if k < 7 { figure(side, 0, 0) } else { scene(side, 1) };
        let frame = read(&rows, &truth, 0.05, 7 + k);
        let made = believed_frame(&ZeroFilled, &mut past, &frame).unwrap();
        shares.push(past.belief.share());
        assert_eq!(made.report.note.is_some_and(|note| note.contains("another scene")), k == 7);
    }
    assert!(shares[6] > 0.3, "{shares:?}");
    // The second frame of a scene is the first whose two images differ, and the third judges them.
    assert_eq!(shares[7..], [0.0, 0.0]);
}

#[test]
fn the_noise_that_the_camera_knows_is_that_of_the_frames() {
    let (side, noise, count) = (side(16), 0.05, 9);
    let (truth, all) = (scene(side, 0), Rows::natural(side));
    let frames: Vec<Measurements> = (0..count).map(|k| read(&all, &truth, noise, k)).collect();
    let of_a_value = 16.0 * noise;
    let known: Vec<Measurements> =
        frames.iter().map(|frame| frame.clone().with_noise(of_a_value).unwrap()).collect();
    let [unknown, known] = [&frames, &known].map(|all| estimate(still(), all).pop().unwrap());
    assert!((known.noise / of_a_value - 1.0).abs() < 1e-4, "{}", known.noise);
    let of_the_fused = known.fused.noise().unwrap();
    assert!((of_the_fused / (of_a_value / 3.0) - 1.0).abs() < 0.02, "{of_the_fused}");
    // Without it, the noise is an estimate, which says nothing of the fused rows.
    assert!((unknown.noise / of_a_value - 1.0).abs() > 1e-3 && unknown.fused.noise().is_none());
    assert!(rms(&known.image, &truth) < 1.1 * noise / 3.0, "{}", rms(&known.image, &truth));
}
