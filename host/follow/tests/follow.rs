//! Frames of targets at rest, in motion, and changing their way. Not beside the code: the Fourier transforms of `rustfft` would be
//! compiled a second time for them, which takes a minute.
#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_follow::{FollowError, FollowSettings, Timed, follow};
use nirspi_recon::{Measurements, Order, Rows, Side};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const SIDE: usize = 32;

/// A scene without steps: spots of light, so that its pixels are known between the pixels, too.
fn scene(down: f64, right: f64) -> Vec<f64> {
    let spots = [
        (10.0, 8.0, 2.0, 1.0),
        (20.0, 12.0, 3.0, 0.7),
        (14.0, 22.0, 1.5, 0.9),
        (25.0, 2.0, 2.0, 0.8),
    ];
    let at = |row: f64, column: f64| {
        let of = |&(r, c, width, light): &(f64, f64, f64, f64)| {
            let (dy, dx) = (row - down - r, column - right - c);
            light * (-(dy * dy + dx * dx) / (2.0 * width * width)).exp()
        };
        spots.iter().map(of).sum()
    };
    (0..SIDE * SIDE).map(|k| at((k / SIDE) as f64, (k % SIDE) as f64)).collect()
}

fn measured(pixels: &[f64], rows: &Rows, noise: f64, rng: &mut Pcg64Mcg) -> Measurements {
    let mut values = pixels.to_vec();
    nirspi_recon::fwht(&mut values).unwrap();
    let normal = Normal::new(0.0, noise).unwrap();
    let values: Vec<f64> =
        rows.iter().map(|&row| values[row as usize] + normal.sample(rng)).collect();
    Measurements::from_differential(rows, &values).unwrap()
}

/// Noise of a value: that of a pixel is a 32nd.
const NOISE: f64 = 3.2;

fn rows(share: f64) -> Rows {
    let side = Side::new(SIDE as u64).unwrap();
    let rows = Order::ZigZag.rows(side).unwrap();
    let all = Measurements::from_differential(&rows, &vec![0.0; SIDE * SIDE]).unwrap();
    all.take(None, share).unwrap().rows().clone()
}

/// Frames of a scene whose place in each frame is given, and times.
fn frames(places: &[[f64; 2]], rows: &Rows, seed: u64) -> Vec<Measurements> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    places
        .iter()
        .map(|[down, right]| measured(&scene(*down, *right), rows, NOISE, &mut rng))
        .collect()
}

fn timed(frames: &[Measurements]) -> Vec<Timed<'_>> {
    frames.iter().enumerate().map(|(k, frame)| Timed { frame, at: k as f64 }).collect()
}

fn at_speed(velocity: [f64; 2], count: usize) -> Vec<[f64; 2]> {
    let time = |k: usize| k as f64 - (count - 1) as f64;
    (0..count).map(|k| velocity.map(|v| v * time(k))).collect()
}

/// Root mean square difference between the values of a measurement and those of a scene.
fn error(found: &Measurements, pixels: &[f64]) -> f64 {
    let mut rng = Pcg64Mcg::seed_from_u64(0);
    let truth = measured(pixels, found.rows(), 0.0, &mut rng);
    let squares = found.values().iter().zip(truth.values()).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / found.values().len() as f64).sqrt()
}

#[test]
fn frames_at_rest_give_their_mean() {
    for (count, share) in [(2, 1.0), (7, 0.5), (28, 1.0)] {
        let frames = frames(&vec![[0.0; 2]; count], &rows(share), 1);
        let found = follow(&timed(&frames), &FollowSettings::default()).unwrap();
        assert_eq!((found.frames, found.velocity_px), (count, [0.0; 2]));
        for (k, value) in found.measurements.values().iter().enumerate() {
            let mean = frames.iter().map(|frame| frame.values()[k]).sum::<f64>() / count as f64;
            assert!((value - mean).abs() < 1e-9);
        }
        if let Some(noise) = found.measurements.noise() {
            assert!((noise / (NOISE / (count as f64).sqrt()) - 1.0).abs() < 0.1, "{noise}");
        }
    }
}

#[test]
fn frames_of_a_moving_scene_are_added_where_it_was() {
    let cases = [
        ([0.0, 0.49], 1.0, 28),
        ([-0.3, 0.7], 1.0, 28),
        ([0.02, -0.1], 1.0, 28),
        ([0.0, 0.49], 0.5, 28),
        // By more than a side in 28 frames.
        ([1.3, 0.2], 1.0, 14),
    ];
    for (velocity, share, count) in cases {
        let frames = frames(&at_speed(velocity, 28), &rows(share), 2);
        let found = follow(&timed(&frames), &FollowSettings::default()).unwrap();
        assert_eq!(found.frames, count, "{velocity:?}");
        let off =
            velocity.iter().zip(found.velocity_px).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.015, "{velocity:?}: {:?}", found.velocity_px);
        let error = error(&found.measurements, &scene(0.0, 0.0));
        let mean = frames_mean_error(&frames);
        assert!(
            error < 0.5 * NOISE && error < 0.5 * mean,
            "{velocity:?}, {share}: {error}, {mean}"
        );
        let said = found.measurements.noise().unwrap();
        assert!((0.5..1.6).contains(&(error / said)), "{velocity:?}, {share}: {error}, {said}");
    }
}

fn frames_mean_error(frames: &[Measurements]) -> f64 {
    let rows = frames[0].rows();
    let mean: Vec<f64> = (0..rows.len())
        .map(|k| frames.iter().map(|frame| frame.values()[k]).sum::<f64>() / frames.len() as f64)
        .collect();
    error(&Measurements::from_differential(rows, &mean).unwrap(), &scene(0.0, 0.0))
}

/// What the target did before it changed its way does not count.
#[test]
fn after_another_motion_only_the_newest_frames_are_added() {
    let mut places = at_speed([0.0, 0.5], 14);
    places.iter_mut().for_each(|place| *place = [place[1], 3.0]);
    places.extend(at_speed([0.0, 0.5], 14));
    let frames = frames(&places, &rows(1.0), 3);
    let found = follow(&timed(&frames), &FollowSettings::default()).unwrap();
    assert_eq!(found.frames, 14);
    assert!((found.velocity_px[1] - 0.5).abs() < 0.01, "{:?}", found.velocity_px);
}

/// A target that begins to move, turns, and stops: frames of before must not be taken for what is there now. The newest frame
/// alone would have an error of [`NOISE`].
#[test]
fn a_target_that_changes_its_way_is_never_worse_than_its_newest_frame() {
    let path = |k: usize| -> [f64; 2] {
        let since = |turn: f64| (k as f64 - turn).clamp(0.0, 24.0);
        [0.3 * since(52.0), 0.5 * since(28.0) - 0.5 * since(52.0)]
    };
    let places: Vec<[f64; 2]> = (0..92).map(path).collect();
    let frames = frames(&places, &rows(1.0), 8);
    let timed = timed(&frames);
    let mut before = None;
    for now in (24..timed.len()).step_by(2) {
        let settings = FollowSettings { before, ..FollowSettings::default() };
        let found = follow(&timed[now.saturating_sub(27)..=now], &settings).unwrap();
        before = Some(found.velocity_px);
        let error = error(&found.measurements, &scene(places[now][0], places[now][1]));
        assert!(error < 0.7 * NOISE, "frame {now}, {} added: {error}", found.frames);
    }
}

#[test]
fn a_scene_that_jumps_gives_the_newest_frame_alone() {
    let places: Vec<[f64; 2]> =
        (0..8).map(|k| [f64::from(k * 7 % 11), f64::from(k * 5 % 13)]).collect();
    let frames = frames(&places, &rows(1.0), 4);
    let found = follow(&timed(&frames), &FollowSettings::default()).unwrap();
    assert_eq!(found.frames, 1);
    assert_eq!(found.measurements.values(), frames[7].values());
}

/// Times say how far apart the frames are where some were lost.
#[test]
fn lost_frames_leave_the_motion_as_it_is() {
    let frames = frames(&at_speed([0.1, 0.4], 28), &rows(1.0), 5);
    let mut timed = timed(&frames);
    timed.drain(9..15);
    let found = follow(&timed, &FollowSettings::default()).unwrap();
    assert_eq!(found.frames, 22);
    assert!((found.velocity_px[1] - 0.4).abs() < 0.01, "{:?}", found.velocity_px);
}

#[test]
fn frames_that_do_not_belong_together_are_refused() {
    let (all, half) = (frames(&[[0.0; 2]], &rows(1.0), 6), frames(&[[0.0; 2]], &rows(0.5), 6));
    let settings = FollowSettings::default();
    assert_eq!(follow(&[], &settings), Err(FollowError::Empty));
    let mixed = [Timed { frame: &all[0], at: 0.0 }, Timed { frame: &half[0], at: 1.0 }];
    assert_eq!(follow(&mixed, &settings), Err(FollowError::Rows { index: 0 }));
    let at_once = [Timed { frame: &all[0], at: 1.0 }, Timed { frame: &all[0], at: 1.0 }];
    assert_eq!(follow(&at_once, &settings), Err(FollowError::Time { index: 1, found: 1.0 }));
}
