//! The clock of one camera in the time of the host's clock: a running fit of offset and drift.
//!
//! A frame arrives some time after its last pattern, never before. So every arrival is an upper
//! bound of the host's time at which the camera made the frame, and the earliest arrivals are the
//! best bounds. The fit is the straight line below all arrivals that leaves the least delay on
//! average (Moon, Skelly, Towsley, *Estimation and removal of clock skew from network delay
//! measurements*, INFOCOM 1999): an edge of their lower convex hull. Long delays do not move the
//! line, however many there are.
//!
//! What arrivals cannot show is the shortest delay that a frame ever has. The fitted time of a frame
//! is later than its true time by this delay, which is the same for equal cameras on equal links.
//!
//! Frames are timed by the FPGA's oscillator, which the firmware sets to the device's time at the
//! start of each run. So each run has a fit of its own.
//!
//! # Invariant
//! The fitted times are not later than any arrival in the window
//! (`tests::the_line_is_below_every_arrival`), and the true clock is within the stated uncertainty
//! (`tests::the_true_clock_is_within_the_uncertainty`). Memory does not grow with time
//! (`tests::two_days_of_frames_take_the_memory_of_one_window`).

mod host;

pub use host::HostClock;

/// The most points that the fit keeps: the earliest arrival of each of as many stretches of time.
const POINTS: usize = 128;
/// Points from which drift and uncertainty are known.
const ENOUGH: usize = 24;
/// Parts of the window whose earliest arrivals say how well the line is known.
const PARTS: usize = 12;
/// The shortest stretch.
const SHORTEST_US: u64 = 1000;
/// The longest stretch, so that the window is 524 s. Oscillators of quartz drift by a few ppm with
/// the temperature, which changes in minutes.
const LONGEST_US: u64 = SHORTEST_US << 12;
/// The largest drift of an oscillator, as a share. A clock beyond does not run in real time.
const MOST_DRIFT: f64 = 5e-3;
/// Where a device clock of 32 bits starts again.
const WRAP_US: u64 = 1 << 32;
/// By how much the time across a wrap may differ from the host's.
const WRAP_TOLERANCE_US: u64 = 1_000_000;
/// A frame that is further behind the newest one was made after a restart.
const LATE_US: u64 = 1_000_000;
/// The most late frames in a row.
const LATE_FRAMES: u32 = 8;

/// What a frame says about its camera's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heard {
    /// The clock goes on.
    Goes,
    /// The clock has begun again: another run, or a restart of the camera. The fit begins again.
    Begins,
    /// The frame is older than the newest one. The fit leaves it out.
    Late,
}

/// The earliest arrival of a stretch of time.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Number of the stretch.
    stretch: u64,
    /// The device's time since the first frame, in ns.
    x: f64,
    /// The host's time since the first arrival, less `x`, in ns.
    y: f64,
}

impl Point {
    fn above(&self, slope: f64) -> f64 {
        self.y - slope * self.x
    }
}

/// The host's time of a camera's clock: a straight line, with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// The device's time at the middle of the window, with wraps of 32 bits undone.
    pub device_time_us: u64,
    /// The host's time at this moment, in ns since 1970.
    pub host_ns: u64,
    /// By how much the camera's clock gains on the host's, in millionths; `None` until enough frames
    /// have come.
    pub drift_ppm: Option<f64>,
    /// Uncertainty of `drift_ppm`; `None` until enough frames have come.
    pub drift_uncertainty_ppm: Option<f64>,
    /// Uncertainty of `host_ns`, without the link's shortest delay; `None` until enough frames have
    /// come.
    pub uncertainty_us: Option<f64>,
    /// The host's time that passes in a unit of the device's, less 1.
    slope: f64,
}

impl Fit {
    /// The host's time of a device time, in ns since 1970. `device_time_us` is a time as
    /// [`Clock::device_time_us`] gives it.
    #[must_use]
    pub fn host_ns(&self, device_time_us: u64) -> u64 {
        let ahead_ns = (i128::from(device_time_us) - i128::from(self.device_time_us)) * 1000;
        let drifted = (ahead_ns as f64 * self.slope).round() as i128;
        u64::try_from(i128::from(self.host_ns) + ahead_ns + drifted).unwrap_or(0)
    }

    /// Uncertainty of [`host_ns`](Self::host_ns) at this device time, without the link's shortest
    /// delay.
    #[must_use]
    pub fn uncertainty_us(&self, device_time_us: u64) -> Option<f64> {
        let away_us = self.device_time_us.abs_diff(device_time_us) as f64;
        Some(self.uncertainty_us? + self.drift_uncertainty_ppm? * 1e-6 * away_us)
    }
}

/// The clock of one camera.
///
/// ```
/// use nirspi_camera::frame_time::Clock;
///
/// let mut clock = Clock::new(500_000.0);                 // frames of 0.5 ms
/// for n in 0..1000_u64 {
///     let device_us = 7_000_000 + 1000 * n;              // a frame each ms
///     let delay_ns = 80_000 + 1000 * (n * 7919 % 400);
///     clock.arrived(1, device_us, 1_800_000_000_000_000_000 + 1_000_020 * n + 500_000 + delay_ns);
/// }
/// let fit = clock.fit().unwrap();
/// assert!((fit.drift_ppm.unwrap() + 20.0).abs() < 1.0);  // 20 ns too slow in each ms
/// ```
#[derive(Debug, Clone)]
pub struct Clock {
    /// Time from a frame's device time to the end of its last pattern, in ns.
    frame_ns: f64,
    run: Option<u16>,
    /// The newest frame: the device's time on the wire, and the host's.
    newest: (u64, u64),
    /// What wraps add to the device's time on the wire.
    wrapped_us: u64,
    late: u32,
    /// The first frame: the device's time, and the host's.
    first: (u64, u64),
    stretch_us: u64,
    points: Vec<Point>,
    fit: Option<Fit>,
}

impl Clock {
    /// A clock of which nothing is known. `frame_ns` is the duration of a frame
    /// ([`MeasurementSetup::frame_ns`](crate::setup::MeasurementSetup::frame_ns)).
    #[must_use]
    pub fn new(frame_ns: f64) -> Self {
        Self {
            frame_ns,
            run: None,
            newest: (0, 0),
            wrapped_us: 0,
            late: 0,
            first: (0, 0),
            stretch_us: SHORTEST_US,
            points: Vec::with_capacity(POINTS + 1),
            fit: None,
        }
    }

    /// Takes the arrival of a frame of this run: the frame's device time, and the host's time in ns
    /// since 1970.
    pub fn arrived(&mut self, run: u16, device_time_us: u64, host_ns: u64) -> Heard {
        let (newest_us, newest_ns) = self.newest;
        let same = self.run == Some(run);
        if same && device_time_us < newest_us {
            let passed_us = host_ns.saturating_sub(newest_ns) / 1000;
            let across_us = device_time_us.saturating_add(WRAP_US).saturating_sub(newest_us);
            let is_late = newest_us - device_time_us <= LATE_US && self.late < LATE_FRAMES;
            if newest_us < WRAP_US && across_us.abs_diff(passed_us) < WRAP_TOLERANCE_US {
                self.wrapped_us += WRAP_US;
            } else if is_late {
                self.late += 1;
                return Heard::Late;
            } else {
                self.run = None;
            }
        }
        self.late = 0;
        self.newest = (device_time_us, host_ns);
        let begins = self.run != Some(run);
        if begins {
            self.run = Some(run);
            self.wrapped_us = 0;
            self.first = (device_time_us, host_ns);
            self.stretch_us = SHORTEST_US;
            self.points.clear();
            self.fit = None;
        }
        self.take(self.device_time_us(device_time_us), host_ns);
        if begins { Heard::Begins } else { Heard::Goes }
    }

    fn take(&mut self, device_us: u64, host_ns: u64) {
        let passed_us = device_us.saturating_sub(self.first.0);
        let x = passed_us as f64 * 1e3 + self.frame_ns;
        let y = (i128::from(host_ns) - i128::from(self.first.1)) as f64 - x;
        let slope = self.fit.map_or(0.0, |fit| fit.slope);
        let new = Point { stretch: passed_us / self.stretch_us, x, y };
        match self.points.last_mut() {
            Some(last) if last.stretch == new.stretch => {
                if new.above(slope) < last.above(slope) {
                    *last = new;
                }
                // The other points of a stretch change nothing, unless they are below the line.
                if self.fit.is_some_and(|fit| self.line_at(&fit, x) <= y) {
                    return;
                }
            }
            _ => self.points.push(new),
        }
        while self.points.len() > POINTS {
            if self.stretch_us < LONGEST_US {
                self.stretch_us *= 2;
                self.halve(slope);
            } else {
                self.points.remove(0);
            }
        }
        self.fit = Some(self.line());
    }

    /// Joins neighbouring stretches.
    fn halve(&mut self, slope: f64) {
        let mut joined: Vec<Point> = Vec::with_capacity(POINTS + 1);
        for point in self.points.drain(..) {
            let point = Point { stretch: point.stretch / 2, ..point };
            match joined.last_mut() {
                Some(last) if last.stretch == point.stretch => {
                    if point.above(slope) < last.above(slope) {
                        *last = point;
                    }
                }
                _ => joined.push(point),
            }
        }
        self.points = joined;
    }

    /// The fitted `y` at `x`.
    fn line_at(&self, fit: &Fit, x: f64) -> f64 {
        let device_ns = fit.device_time_us.saturating_sub(self.first.0) as f64 * 1e3;
        let host = (i128::from(fit.host_ns) - i128::from(self.first.1)) as f64;
        host - device_ns + (x - device_ns) * fit.slope
    }

    /// The line below all points that has the least sum of distances to them.
    fn line(&self) -> Fit {
        let count = self.points.len();
        let (from, to) = (self.points[0].x, self.points[count - 1].x);
        let middle = self.points.iter().map(|point| point.x).sum::<f64>() / count as f64;
        let edge = edge_at(&self.points, middle).unwrap_or(0.0);
        let mut excess = excess(&self.points, edge);
        // A line that turns about its middle by this much departs by two and a half times the excess
        // at its ends. Of 59 743 simulated links with delays of four kinds, the largest error was
        // 0.7 of this; one link of another draw had 0.95, with short delays at one end alone.
        let turn = 5.0 * (excess + 1e3) / (to - from);
        let known =
            (count >= ENOUGH).then_some((edge, turn)).filter(|&(_, turn)| turn <= MOST_DRIFT);
        // Where the drift cannot be known, a clock without drift is the better guess.
        let slope = known.map_or(0.0, |(edge, _)| edge.clamp(-MOST_DRIFT, MOST_DRIFT));
        if slope != edge {
            excess = self::excess(&self.points, slope);
        }
        let drift = known.map(|(_, turn)| (-slope / (1.0 + slope) * 1e6, turn * 1e6));
        let lowest =
            self.points.iter().map(|point| point.above(slope)).fold(f64::INFINITY, f64::min);
        // A whole microsecond of the device's time, so that the rest is in the host's time.
        let device_us = (middle / 1e3).max(0.0).floor();
        let host = lowest + (1.0 + slope) * device_us * 1e3;
        Fit {
            device_time_us: self.first.0.saturating_add(device_us as u64),
            host_ns: (i128::from(self.first.1) + host.floor() as i128).try_into().unwrap_or(0),
            drift_ppm: drift.map(|(ppm, _)| ppm),
            drift_uncertainty_ppm: drift.map(|(_, turn)| turn),
            uncertainty_us: drift.map(|_| 2.0 * excess * 1e-3 + 1.0),
            slope,
        }
    }

    /// The fit; `None` before the first frame.
    #[must_use]
    pub fn fit(&self) -> Option<Fit> {
        self.fit
    }

    /// A device time on the wire with wraps of 32 bits undone, as a [`Fit`] takes it.
    #[must_use]
    pub fn device_time_us(&self, on_the_wire: u64) -> u64 {
        on_the_wire.saturating_add(self.wrapped_us)
    }
}

/// The slope of the lower hull's edge at `x`; `None` for a single point.
fn edge_at(points: &[Point], x: f64) -> Option<f64> {
    let mut hull: Vec<&Point> = Vec::new();
    for point in points {
        while let [.., a, b] = hull[..]
            && (b.x - a.x) * (point.y - a.y) <= (b.y - a.y) * (point.x - a.x)
        {
            hull.pop();
        }
        hull.push(point);
    }
    let edge = hull.windows(2).find(|edge| edge[1].x >= x)?;
    Some((edge[1].y - edge[0].y) / (edge[1].x - edge[0].x))
}

/// How far the earliest arrivals are above the line of this slope below all points, in ns: what nine
/// of twelve parts of the window are within. Three parts may be busy.
fn excess(points: &[Point], slope: f64) -> f64 {
    let parts = points.len().min(PARTS);
    let earliest = |part: usize| {
        let of_part = &points[points.len() * part / parts..points.len() * (part + 1) / parts];
        of_part.iter().map(|point| point.above(slope)).fold(f64::INFINITY, f64::min)
    };
    let mut lows: Vec<f64> = (0..parts).map(earliest).collect();
    lows.sort_unstable_by(f64::total_cmp);
    lows[parts * 3 / 4] - lows[0]
}

#[cfg(test)]
mod tests;
