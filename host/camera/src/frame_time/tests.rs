use super::*;
use proptest::prelude::*;

/// A moment of 2026 in ns since 1970.
const NOW: u64 = 1_790_000_000_000_000_000;

/// A camera with a clock of this error, behind a link.
#[derive(Debug, Clone, Copy)]
struct Camera {
    /// By how much the clock gains on the host's, in millionths.
    error_ppm: f64,
    /// The host's time at which the clock is 0, in ns since 1970.
    zero_ns: u64,
    period_us: u64,
    frame_ns: f64,
}

impl Camera {
    /// The host's time of a device time, as it is.
    fn host_ns(&self, device_us: u64) -> u64 {
        self.zero_ns + (device_us as f64 * 1e3 / (1.0 + self.error_ppm * 1e-6)).round() as u64
    }

    /// The host's time at which a frame of this device time has left the camera.
    fn done_ns(&self, device_us: u64) -> u64 {
        let done = device_us as f64 * 1e3 + self.frame_ns;
        self.zero_ns + (done / (1.0 + self.error_ppm * 1e-6)).round() as u64
    }
}

/// Delays in ns, drawn in different ways: even, mostly long, rare short ones, and bursts.
fn delays(kind: usize, count: usize) -> impl Strategy<Value = Vec<u64>> {
    prop::collection::vec((0.0..1.0_f64, 0.0..1.0_f64), count).prop_map(move |draws| {
        let delay = |(at, &(a, b)): (usize, &(f64, f64))| {
            1e5 * match kind {
                0 => 10.0 * a,
                1 => -2.0 * (1.0 - a).ln(),
                2 if b < 0.05 => a,
                2 => 10.0 + a,
                _ if at / 20 % 2 == 0 => a,
                _ => 50.0 * a,
            }
        };
        draws.iter().enumerate().map(delay).map(|ns| ns as u64).collect()
    })
}

fn camera() -> impl Strategy<Value = Camera> {
    (-200.0..200.0_f64, 0..1_000_000_000_u64, 200..20_000_u64, 0.0..1.0_f64).prop_map(
        |(error_ppm, zero, period_us, share)| Camera {
            error_ppm,
            zero_ns: NOW + zero,
            period_us,
            frame_ns: share * period_us as f64 * 1e3,
        },
    )
}

fn link() -> impl Strategy<Value = (Camera, Vec<u64>)> {
    (camera(), 0..4_usize, 200..1500_usize)
        .prop_flat_map(|(camera, kind, count)| (Just(camera), delays(kind, count)))
}

proptest! {
    #[test]
    fn the_true_clock_is_within_the_uncertainty((camera, delays) in link(), begin in 0..10_000_000_u64) {
        let mut clock = Clock::new(camera.frame_ns);
        for (n, delay) in (0..).zip(&delays) {
            let device_us = begin + n * camera.period_us;
            clock.arrived(1, device_us, camera.done_ns(device_us) + delay);
        }
        let fit = clock.fit().unwrap();
        // All of these links have delays of nearly 0, by chance of at least 1 in 20.
        if let (Some(ppm), Some(within)) = (fit.drift_ppm, fit.drift_uncertainty_ppm) {
            prop_assert!((ppm - camera.error_ppm).abs() <= within, "{ppm} +-{within}, {camera:?}");
            let last = begin + (delays.len() as u64 - 1) * camera.period_us;
            for device_us in [begin, (begin + last) / 2, last] {
                let (fitted, truth) = (fit.host_ns(device_us), camera.host_ns(device_us));
                let off_us = fitted.abs_diff(truth) as f64 * 1e-3;
                let within = fit.uncertainty_us(device_us).unwrap();
                prop_assert!(off_us <= within + 1.0, "{off_us} us, stated {within} us");
            }
        }
    }

    #[test]
    fn the_line_is_below_every_arrival((camera, delays) in link()) {
        let mut clock = Clock::new(camera.frame_ns);
        let mut arrivals = Vec::new();
        for (n, delay) in (0..).zip(&delays) {
            let device_us = n * camera.period_us;
            let arrival = camera.done_ns(device_us) + delay;
            clock.arrived(1, device_us, arrival);
            arrivals.push((device_us, arrival));
            let fit = clock.fit().unwrap();
            let frame_ns = camera.frame_ns as u64;
            // Rounding, and the drift within a frame.
            let slack = 2 + frame_ns / 100;
            prop_assert!(fit.host_ns(device_us) + frame_ns <= arrival + slack);
        }
        let fit = clock.fit().unwrap();
        for (device_us, arrival) in arrivals {
            prop_assert!(fit.host_ns(device_us) <= arrival + 2, "{device_us}");
        }
    }

    #[test]
    fn a_clock_of_32_bits_that_begins_again_goes_on(
        (camera, delays) in link(), before in 0..1000_u64,
    ) {
        let begin = WRAP_US - before * camera.period_us.min(1000) - 1;
        let (mut narrow, mut wide) = (Clock::new(camera.frame_ns), Clock::new(camera.frame_ns));
        for (n, delay) in (0..).zip(&delays) {
            let device_us = begin + n * camera.period_us;
            let arrival = camera.done_ns(device_us) + delay;
            let heard = narrow.arrived(1, device_us % WRAP_US, arrival);
            prop_assert_eq!(heard, if n == 0 { Heard::Begins } else { Heard::Goes });
            wide.arrived(1, device_us, arrival);
            prop_assert_eq!(narrow.device_time_us(device_us % WRAP_US), device_us);
        }
        prop_assert_eq!(narrow.fit(), wide.fit());
    }

    #[test]
    fn after_a_restart_the_fit_is_that_of_the_new_clock(
        (camera, delays) in link(), uptime_s in 2..4000_u64, same_run in any::<bool>(),
    ) {
        let mut clock = Clock::new(camera.frame_ns);
        let begin = uptime_s * 1_000_000;
        let mut end = 0;
        for (n, delay) in (0..).zip(&delays) {
            let device_us = begin + n * camera.period_us;
            end = camera.done_ns(device_us) + delay;
            clock.arrived(1, device_us, end);
        }
        // The camera is at its frames again within two seconds.
        let again = Camera { zero_ns: end + 1_000_000_000, ..camera };
        let mut fresh = Clock::new(camera.frame_ns);
        let run = if same_run { 1 } else { 2 };
        let half = &delays[..delays.len() / 2];
        for (n, delay) in (0..).zip(half) {
            let device_us = 900_000 + n * camera.period_us;
            let arrival = again.done_ns(device_us) + delay;
            let heard = clock.arrived(run, device_us, arrival);
            prop_assert_eq!(heard, if n == 0 { Heard::Begins } else { Heard::Goes });
            fresh.arrived(run, device_us, arrival);
        }
        prop_assert_eq!(clock.fit(), fresh.fit());
    }
}

/// 20 ms a frame, delays of 50 us and more in a fixed pattern.
fn steady(clock: &mut Clock, seconds: std::ops::Range<u64>, error_ppm: impl Fn(u64) -> f64) {
    for second in seconds {
        for n in 0..50 {
            let device_us = second * 1_000_000 + n * 20_000;
            let host = device_us as f64 * 1e3 / (1.0 + error_ppm(second) * 1e-6);
            clock.arrived(1, device_us, NOW + host as u64 + 1000 * (device_us / 20 * 7919 % 400));
        }
    }
}

#[test]
fn long_delays_move_nothing() {
    let (mut clean, mut delayed) = (Clock::new(0.0), Clock::new(0.0));
    for n in 0..2000_u64 {
        let at = NOW + n * 1_000_000;
        clean.arrived(1, 1000 * n, at);
        // Nine of ten frames are held up for up to 200 ms.
        delayed.arrived(1, 1000 * n, at + if n % 10 == 3 { 0 } else { n * 7919 % 200 * 1_000_000 });
    }
    let (clean, delayed) = (clean.fit().unwrap(), delayed.fit().unwrap());
    for device_us in [0, 1_000_000, 2_000_000] {
        assert!(clean.host_ns(device_us).abs_diff(delayed.host_ns(device_us)) <= 1000);
    }
}

#[test]
fn a_camera_that_falls_silent_is_where_its_clock_says() {
    let mut clock = Clock::new(0.0);
    steady(&mut clock, 0..30, |_| 40.0);
    let before = clock.fit().unwrap();
    // Two minutes without a frame.
    steady(&mut clock, 150..160, |_| 40.0);
    let after = clock.fit().unwrap();
    assert!((after.drift_ppm.unwrap() - 40.0).abs() < 2.0, "{after:?}");
    let at = 150_000_000;
    let off_us = before.host_ns(at).abs_diff(after.host_ns(at)) as f64 * 1e-3;
    assert!(off_us <= before.uncertainty_us(at).unwrap(), "{off_us} us: {before:?}");
}

#[test]
fn the_fit_follows_an_oscillator_that_warms_up() {
    let mut clock = Clock::new(0.0);
    // From 10 to 40 ppm in 40 minutes; the time that has passed is continuous.
    let mut host_ns = 0.0;
    for step in 0..120_000_u64 {
        let error_ppm = 10.0 + 30.0 * step as f64 / 120_000.0;
        clock.arrived(1, step * 20_000, NOW + host_ns as u64 + step * 7919 % 100 * 1000);
        host_ns += 20e6 / (1.0 + error_ppm * 1e-6);
    }
    // The middle of the window is four minutes ago.
    let fit = clock.fit().unwrap();
    assert!((fit.drift_ppm.unwrap() - 36.7).abs() < 1.5, "{fit:?}");
}

#[test]
fn two_days_of_frames_take_the_memory_of_one_window() {
    let mut clock = Clock::new(0.0);
    for minute in 0..2 * 24 * 60_u64 {
        for n in 0..60 {
            let device_us = (minute * 60 + n) * 1_000_000;
            clock.arrived(1, device_us, NOW + device_us * 1000);
            assert!(clock.points.len() <= POINTS && clock.points.capacity() <= 2 * POINTS + 2);
        }
    }
    let fit = clock.fit().unwrap();
    let newest = 2 * 24 * 3600 * 1_000_000;
    assert!(
        fit.drift_ppm.unwrap().abs() < 0.01
            && newest - fit.device_time_us < LONGEST_US * POINTS as u64
    );
}

#[test]
fn a_few_frames_give_a_time_and_no_drift() {
    let mut clock = Clock::new(500_000.0);
    assert!(clock.fit().is_none());
    clock.arrived(1, 1_000_000, NOW);
    clock.arrived(1, 1_001_000, NOW + 1_300_000);
    let fit = clock.fit().unwrap();
    assert_eq!((fit.drift_ppm, fit.uncertainty_us), (None, None));
    assert_eq!(fit.host_ns(1_000_000), NOW - 500_000);
    assert_eq!(fit.host_ns(1_001_000), NOW + 500_000);
}

#[test]
fn a_late_frame_changes_nothing_and_many_are_a_restart() {
    let mut clock = Clock::new(0.0);
    steady(&mut clock, 5..7, |_| 0.0);
    let fit = clock.fit();
    let late = NOW + 8_000_000_000;
    for n in 0..LATE_FRAMES {
        assert_eq!(clock.arrived(1, 6_500_000 + u64::from(n), late), Heard::Late);
    }
    assert_eq!(clock.fit(), fit);
    assert_eq!(clock.arrived(1, 6_600_000, late), Heard::Begins);
}

#[test]
fn no_device_time_is_too_large() {
    let mut clock = Clock::new(f64::from(u32::MAX));
    for (n, device_us) in (0..).zip([0, u64::MAX, 0, u64::MAX / 2, u64::MAX, 1, 2, 3]) {
        clock.arrived(1, device_us, n * (u64::MAX / 10));
        let fit = clock.fit().unwrap();
        for at in [0, device_us, u64::MAX] {
            let _ = (fit.host_ns(at), fit.uncertainty_us(clock.device_time_us(at)));
        }
    }
}
