use super::*;

/// Pseudo-random numbers in [0, 1].
fn numbers(count: usize, seed: u32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
    (0..count)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        })
        .collect()
}

/// The model by its definition: Gaussian weights with half-sample reflection at the edge, one axis
/// after the other, then means of 2 x 2 pixels for 32 x 32.
fn blurred(image: &[f32], sigma_px: f32, side: usize) -> Vec<f32> {
    let radius = (6.0 * sigma_px).ceil() as i64;
    let weights: Vec<f64> = (-radius..=radius)
        .map(|d| (-0.5 * (d as f64 / f64::from(sigma_px)).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let reflected = |at: i64| {
        let period = 2 * SIDE as i64;
        let at = at.rem_euclid(period);
        (if at < SIDE as i64 { at } else { period - 1 - at }) as usize
    };
    let along = |pixel: &dyn Fn(usize) -> f32, at: usize| -> f32 {
        let taps = weights.iter().zip(-radius..);
        taps.map(|(w, d)| w / sum * f64::from(pixel(reflected(at as i64 + d)))).sum::<f64>() as f32
    };
    let rows: Vec<f32> =
        (0..SIDE * SIDE).map(|i| along(&|x| image[i / SIDE * SIDE + x], i % SIDE)).collect();
    let both: Vec<f32> =
        (0..SIDE * SIDE).map(|i| along(&|y| rows[y * SIDE + i % SIDE], i / SIDE)).collect();
    let step = SIDE / side;
    let mean = |i: usize| {
        let (y, x) = (i / side * step, i % side * step);
        let block = (0..step * step).map(|j| both[(y + j / step) * SIDE + x + j % step]);
        block.sum::<f32>() / (step * step) as f32
    };
    (0..side * side).map(mean).collect()
}

fn apart(a: &[f32], b: &[f32]) -> f32 {
    norm(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>())
}

/// Half of the rows.
fn every_other() -> MeasuredRows {
    MeasuredRows::new(32, &(0..1024).step_by(2).collect::<Vec<_>>()).unwrap()
}

#[test]
fn the_model_in_cosine_space_is_blur_and_pair_means() {
    let image = numbers(SIDE * SIDE, 1);
    for (side, sigma_px) in [(32, 1.0), (32, 3.5), (64, 2.0)] {
        let model = Consistency::new(side, sigma_px, 0.01);
        let seen = model.readings.inverse(&model.camera.forward(&image));
        let error = apart(&seen, &blurred(&image, sigma_px, side)) / side as f32;
        assert!(error < 1e-4, "{side} {sigma_px}: {error}");
    }
}

#[test]
fn the_adjoint_is_the_adjoint() {
    let model = Consistency::new(32, 1.5, 0.01);
    let (image, dual) = (numbers(SIDE * SIDE, 2), numbers(32 * 32, 3));
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    let back = model.camera.adjoint(&dual);
    let (left, right) = (dot(&model.camera.forward(&image), &dual), dot(&image, &back));
    assert!((left - right).abs() < 1e-4 * left.abs(), "{left} {right}");
}

#[test]
fn inside_the_ball_nothing_changes() {
    let image = numbers(SIDE * SIDE, 4);
    let readings = blurred(&image, 2.0, 32);
    let model = Consistency::new(32, 2.0, 0.02);
    assert!(model.residual_ratio(&readings, &image) < 0.1);
    let mut projected = image.clone();
    model.project(&readings, &mut projected);
    assert_eq!(projected, image);
}

#[test]
fn an_invented_stroke_is_moved_onto_the_ball_and_no_further() {
    let readings = blurred(&vec![0.2; SIDE * SIDE], 1.5, 32);
    for rows in [MeasuredRows::All, every_other()] {
        let model = Consistency::new(32, 1.5, 0.01).of_rows(&rows).unwrap();
        let mut image = vec![0.2; SIDE * SIDE];
        (20..44).for_each(|y| image[y * SIDE + 30..][..5].fill(0.9));
        let before = model.residual_ratio(&readings, &image);
        assert!(before > 3.0, "{before}");
        model.project(&readings, &mut image);
        let after = model.residual_ratio(&readings, &image);
        assert!((after - TAU).abs() < 0.002, "{rows:?}: {after}");
    }
}

#[test]
fn rows_that_were_not_measured_constrain_nothing() {
    let measured: Vec<u32> = (0..256).collect();
    let rows = MeasuredRows::new(32, &measured).unwrap();
    assert!(matches!(&rows, MeasuredRows::Rows(rows) if rows.count() == 256));
    let model = Consistency::new(32, 1.0, 0.01).of_rows(&rows).unwrap();
    let image = numbers(SIDE * SIDE, 5);
    let mut readings = blurred(&image, 1.0, 32);
    // The measurement of row 1000, a pattern that was not shown, has a large error.
    for (i, value) in readings.iter_mut().enumerate() {
        *value += if (i & 1000).count_ones() % 2 == 0 { 0.3 } else { -0.3 };
    }
    assert!(model.residual_ratio(&readings, &image) < 0.1);
}

#[test]
fn all_rows_some_rows_and_no_rows_are_told_apart() {
    let all: Vec<u32> = (0..1024).rev().collect();
    assert_eq!(MeasuredRows::new(32, &all), Ok(MeasuredRows::All));
    let twice = MeasuredRows::new(32, &[5, 5, 3]).unwrap();
    assert_eq!(twice, MeasuredRows::new(32, &[3, 5]).unwrap());
    assert!(matches!(twice, MeasuredRows::Rows(rows) if rows.count() == 2));
    assert_eq!(MeasuredRows::new(32, &[]), Err(MeasuredRowsError::Empty));
    for found in [0, 16, 33, 128] {
        assert_eq!(MeasuredRows::new(found, &[0]), Err(MeasuredRowsError::Side { found }));
    }
    let beyond = MeasuredRows::new(32, &[0, 1024]).unwrap_err();
    assert_eq!(beyond.to_string(), "Hadamard row 1024 of readings of 32 x 32, expected 0 to 1023");
    let other = Consistency::new(64, 1.0, 0.01).of_rows(&every_other()).unwrap_err();
    assert_eq!(other, MeasuredRowsError::OtherSide { rows: 32, readings: 64 });
}

#[test]
fn what_no_image_explains_is_not_amplified() {
    let readings = numbers(32 * 32, 6);
    for rows in [MeasuredRows::All, every_other()] {
        let model = Consistency::new(32, 4.0, 0.004).of_rows(&rows).unwrap();
        let flat = vec![0.5; SIDE * SIDE];
        let residual = norm(&model.residual(&readings, &flat));
        let mut image = flat.clone();
        model.project(&readings, &mut image);
        let change = apart(&image, &flat);
        assert!(change > 0.0 && change <= 5.001 * residual, "{change} for {residual}");
        assert!(model.residual_ratio(&readings, &image) > 2.0 * TAU, "nothing is hidden");
    }
}

#[test]
fn an_image_stays_where_no_image_gives_its_readings() {
    let mut bars = vec![0.1; SIDE * SIDE];
    (8..56).for_each(|y| [12, 28, 44].iter().for_each(|x| bars[y * SIDE + x..][..5].fill(0.9)));
    // A target that moved by 8 pixels to the right.
    let moved: Vec<f32> = (0..SIDE * SIDE)
        .map(|i| {
            (0..8).map(|by| bars[i / SIDE * SIDE + (i % SIDE + SIDE - by) % SIDE]).sum::<f32>()
                / 8.0
        })
        .collect();
    let of_motion = blurred(&moved, 0.3, 32);
    for rows in [MeasuredRows::All, every_other()] {
        // What the estimator takes for it.
        let model = Consistency::new(32, 3.0, 0.01).of_rows(&rows).unwrap();
        let mut image = bars.clone();
        model.agree(&of_motion, &mut image, Binding::OfEstimate);
        assert_eq!(image, bars);
        model.agree(&of_motion, &mut image, Binding::OfKnownBlur);
        assert!(image != bars, "a known blur changes it");
        assert!(model.residual_ratio(&of_motion, &image) > REACHED);
        // A blur that the model knows is no reason to leave what contradicts the readings, however far off it is.
        let of_blur = blurred(&bars, 3.0, 32);
        let mut image = vec![0.1; SIDE * SIDE];
        let before = model.residual_ratio(&of_blur, &image);
        model.agree(&of_blur, &mut image, Binding::OfEstimate);
        let after = model.residual_ratio(&of_blur, &image);
        assert!(before > 5.0 && after < STUCK * before, "{before} {after}");
    }
}
