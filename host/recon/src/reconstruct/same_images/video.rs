//! The recursive estimate of a moving scene.

use super::*;
use crate::testing::figure;

/// Frames of some rows each, in turn: a figure moves, then stands, a part of it changes, and at
/// last another scene comes.
fn frames(n: u64, always: usize, turns: usize, noise: f64) -> Vec<Measurements> {
    let side = side(n);
    let order = Order::ZigZag.rows(side).unwrap();
    let frame = |k: usize| {
        let mut truth = match k {
            0..4 => figure(side, 0, k as i64),
            4..8 => figure(side, 0, 3),
            _ => scene(side, 1),
        };
        if k == 6 || k == 7 {
            let n = side.pixels();
            (0..side.area()).filter(|p| p % n < n / 4).for_each(|p| truth[p] += 0.3);
        }
        let others = (always..side.area()).filter(|at| at % turns == k % turns);
        let rows = (0..always).chain(others).map(|at| order[at]);
        noisy(&Rows::new(side, rows).unwrap(), &truth, noise, k as u64)
    };
    (0..10).map(frame).collect()
}

/// Zero-filled pixels.
fn pixels(measurements: &Measurements) -> Vec<f32> {
    hadamard(measurements).pixels().to_vec()
}

#[test]
fn frames_of_a_recursive_estimate_are_those_that_were_made() {
    let mut table = Table::default();
    let base = RecursiveSettings::default();
    for (n, always, turns, noise) in
        [(32, 100, 4, 1.0), (32, 1024, 1, 1.0), (16, 60, 3, 0.05), (16, 256, 1, 2.0)]
    {
        let mut frames = frames(n, always, turns, noise);
        frames.truncate(if always == 1024 { 3 } else { 10 });
        let known = NoiseLevel::Known(noise);
        for (what, settings) in [
            ("default", base),
            ("still", RecursiveSettings { speed_px: Some(0.0), follow: false, ..base }),
            (
                "speed 0.3, not followed, known noise",
                RecursiveSettings { speed_px: Some(0.3), follow: false, noise: known, ..base },
            ),
            ("strength 0.5", RecursiveSettings { strength: Strength::Fixed(0.5), ..base }),
        ] {
            if n == 32 && what != "default" {
                continue;
            }
            let mut past = Recursive::new(settings).unwrap();
            for (k, frame) in frames.iter().enumerate() {
                let made = past.add(frame).unwrap();
                let name = format!("{n} x {n}, {always} always, {what}, frame {k}");
                table.image(&name, made.image.pixels().iter().copied());
                let [down, right] = made.shift_px;
                let note = made.note().unwrap_or_default();
                let numbers = [
                    down,
                    right,
                    made.speed_px,
                    made.residual,
                    made.noise,
                    made.strength,
                    made.fused.rows().len() as f64,
                    made.certain.rows().len() as f64,
                ];
                table.line(&format!("report, {name} [{note}]"), &numbers);
                table.image(&format!("fused, {name}"), pixels(&made.fused));
                table.image(&format!("certain, {name}"), pixels(&made.certain));
            }
        }
    }
    table.is_the_same_as("video.txt");
}

#[test]
fn frames_of_other_methods_are_those_that_were_made() {
    let mut table = Table::default();
    for (always, turns, noise) in [(60, 3, 0.05), (256, 1, 2.0)] {
        let frames = frames(16, always, turns, noise);
        for method in [Method::TIKHONOV, Method::HADAMARD] {
            let method = method.prepare(&MethodSettings::default()).unwrap();
            let (mut fused, mut believed) = (
                Recursive::new(RecursiveSettings::default()).unwrap(),
                Recursive::new(RecursiveSettings::default()).unwrap(),
            );
            for (k, frame) in frames.iter().enumerate() {
                let name = format!("{always} always, {}, frame {k}", method.name());
                let made = fused_frame(&*method, &mut fused, frame).unwrap();
                table.made(&format!("fused, warm: {}, {name}", made.report.warm), &made);
                let made = believed_frame(&*method, &mut believed, frame).unwrap();
                table.made(&format!("believed, warm: {}, {name}", made.report.warm), &made);
            }
        }
    }
    table.is_the_same_as("fused.txt");
}
