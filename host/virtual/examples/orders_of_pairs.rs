//! What is left in an image of LEDs that rise unlike they fall, for several orders of pattern and complement within a pair:
//! pattern always first, alternating from sweep to sweep, the same with all lines inverted in every second pair of sweeps,
//! random from pattern to pattern, and random with alternation.
//!
//! `cargo run --release -p nirspi-virtual --example orders_of_pairs [CAMERA [CROSSTALK_FF]]`. No gateware: the lines are set
//! by this program, because the gateware knows one of these orders alone. The receiver is without noise but for a dither of one
//! count. Readings of all slots are undone by the mean of rise and fall. docs/log/physics.md has the result.

use nirspi::response::Settling;
use nirspi::scene::SceneSource;
use nirspi_optics::{Chain, ChainSettings, Footprint, LedArray, Scene};
use nirspi_recon::fwht::fwht;
use nirspi_recon::{Order, Side};
use nirspi_virtual::{CameraModel, VirtualOptics, read_camera_model};
use std::error::Error;

const SWEEPS: usize = 40;
const DWELL: u16 = 5;
const BLANKED: u16 = 2;
const PIXELS: usize = 1024;

/// Bit i is the sign of Walsh function k at i.
fn lines(k: u32) -> u32 {
    (0..32).fold(0, |lines, i| lines | ((k & i).count_ones() & 1) << i)
}

/// How pattern `at` of a sweep is shown.
struct Pair {
    complement_first: bool,
    /// All lines are inverted, which lights the same LEDs.
    inverted: bool,
}

impl Pair {
    fn complement_first(complement_first: bool) -> Self {
        Self { complement_first, inverted: false }
    }
}

type Shown = fn(at: usize, sweep: usize) -> Pair;

fn random(at: usize) -> bool {
    (at as u32).wrapping_add(1).wrapping_mul(0x9e37_79b1).count_ones() % 2 == 1
}

const ORDERS: [(&str, Shown); 5] = [
    ("pattern first", |_, _| Pair::complement_first(false)),
    ("alternating", |_, sweep| Pair::complement_first(sweep % 2 == 1)),
    ("alternating, inverted lines", |_, sweep| Pair {
        complement_first: sweep % 2 == 1,
        inverted: sweep / 2 % 2 == 1,
    }),
    ("random", |at, _| Pair::complement_first(random(at))),
    ("random, alternating", |at, sweep| Pair::complement_first(random(at) ^ (sweep % 2 == 1))),
];
/// Sweeps after which every order repeats.
const PERIOD: usize = 4;

/// Differences of pattern and complement in the order of the rows, in electrons a sample.
fn measured(
    array: &mut LedArray,
    settings: ChainSettings,
    rows: &[u32],
    shown: Shown,
) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut chain = Chain::new(settings, 1)?;
    // The first period lets the LEDs forget that they were dark.
    let mut slots = vec![0.0; PERIOD * 2 * rows.len()];
    for sweep in 0..SWEEPS + PERIOD {
        for (at, &row) in rows.iter().enumerate() {
            let Pair { complement_first, inverted } = shown(at, sweep);
            for half in 0..2 {
                let complement = complement_first ^ (half == 1);
                let invert = |lines: u32, is: bool| if is { !lines } else { lines };
                let r = invert(lines(row / 32), complement ^ inverted);
                let c = invert(lines(row % 32), inverted);
                let mut sum = 0.0;
                for clock in 0..DWELL {
                    let light = array.step(r, c, true);
                    let counts = f64::from(chain.sample(light).counts);
                    sum += if clock < BLANKED { 0.0 } else { counts };
                }
                if sweep >= PERIOD {
                    slots[(sweep % PERIOD * rows.len() + at) * 2 + half] += sum;
                }
            }
        }
    }
    let scale =
        settings.electrons_per_count / f64::from(DWELL - BLANKED) / (SWEEPS / PERIOD) as f64;
    slots.iter_mut().for_each(|sum| *sum *= scale);
    let exact = Settling {
        adc_latency: 0,
        response: (0..64).map(|n| settings.settling(n)).collect(),
        dark_counts: 0.0,
        step_counts: 0.0,
        noise_counts: 0.0,
        tile_sag: 0.0,
    };
    exact.leak(DWELL, BLANKED)?.correct_single(&mut slots);
    let mut differences = vec![0.0; rows.len()];
    for sweep in 0..PERIOD {
        for (at, difference) in differences.iter_mut().enumerate() {
            let pair = (sweep * rows.len() + at) * 2;
            let sign = if shown(at, sweep).complement_first { -1.0 } else { 1.0 };
            *difference += sign * (slots[pair] - slots[pair + 1]) / PERIOD as f64;
        }
    }
    Ok(differences)
}

fn image(differences: &[f64], rows: &[u32]) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut pixels = vec![0.0; PIXELS];
    for (&row, difference) in rows.iter().zip(differences) {
        pixels[row as usize] = *difference / PIXELS as f64;
    }
    fwht(&mut pixels)?;
    Ok(pixels)
}

/// Grey levels that fall as one over frequency, as of natural scenes.
fn natural() -> Result<Scene, Box<dyn Error>> {
    let wave = |x: f64, y: f64| -> f64 {
        (1..12)
            .map(|n| {
                let n = f64::from(n);
                ((1.3 * n * x + 0.7 * n * n * y + 5.0 * n).sin() + (0.9 * n * y + n * n).cos()) / n
            })
            .sum()
    };
    let grey = |i: usize| {
        (0.5 + 0.14 * wave((i % 64) as f64 / 12.0, (i / 64) as f64 / 12.0)).clamp(0.0, 1.0)
    };
    Ok(Scene::new((0..4096).map(|i| grey(i) as f32).collect(), 64, 48.0)?)
}

fn decibels(a: &[f64], b: &[f64], skip: usize) -> f64 {
    let squares = a.iter().zip(b).skip(skip).map(|(a, b)| (a - b).powi(2));
    -10.0 * (squares.sum::<f64>() / (PIXELS - skip) as f64).log10()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "boards/electronics/camera.toml".to_owned());
    let mut camera: CameraModel = read_camera_model(&name)?;
    if let Some(ff) = arguments.next() {
        camera.leds.line_crosstalk_ff = ff.parse()?;
        camera.validate()?;
    }
    let letter = SceneSource::Letter('R').load(256)?;
    let letter = Scene::new(letter.reflectance, letter.size_px, 43.0)?;
    println!(
        "{}: pixel (0, 0) less that of the light, in units of white; PSNR of the image, and without that pixel",
        camera.name
    );
    println!(
        "| scene | patterns | order of pairs | pixel (0, 0) | PSNR, dB | without it |\n| -- | -- | -- | -- | -- | -- |"
    );
    for (scene_name, scene) in
        [("white", Scene::white()), ("letter R", letter), ("natural-like", natural()?)]
    {
        let optics = VirtualOptics::of(&camera, scene, 300.0)?.noiseless();
        let settings = ChainSettings { amplifier_noise_electrons: 3.0, ..*optics.chain() };
        let settings = ChainSettings { adc_latency_clocks: 0, ..settings };
        for order in [Order::CakeCutting, Order::ZigZag] {
            let all = order.rows(Side::INSTRUMENT)?;
            for count in [PIXELS, PIXELS / 2] {
                let rows = &all[..count];
                let truth = truth(optics.footprint(), rows)?;
                for (order_name, shown) in ORDERS {
                    let mut array = optics.led_array();
                    let seen = image(&measured(&mut array, settings, rows, shown)?, rows)?;
                    let white = optics.budget().electrons_per_led;
                    let seen: Vec<f64> = seen.iter().map(|electrons| electrons / white).collect();
                    let corner = seen[0] - truth[0];
                    let (whole, rest) = (decibels(&seen, &truth, 0), decibels(&seen, &truth, 1));
                    println!(
                        "| {scene_name} | {order}, {count} | {order_name} | {corner:.3} | {whole:.1} | {rest:.1} |"
                    );
                }
            }
        }
    }
    Ok(())
}

/// The image of these rows by a camera whose LEDs have no edges.
fn truth(footprint: &Footprint, rows: &[u32]) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut light: Vec<f64> = footprint.weights().iter().map(|&weight| f64::from(weight)).collect();
    fwht(&mut light)?;
    let differences: Vec<f64> = rows.iter().map(|&row| light[row as usize]).collect();
    image(&differences, rows)
}
