//! What the frames before add to a method, on every moving scene, for shares of the patterns and
//! noises: the table of `docs/log/reconstruction.md`.
//!
//! `cargo run --release -p nirspi-eval --example video_gain -- [METHOD [FRAMES]]`
//!
//! For each share and noise a line has the least gain in dB, and the gain on each scene in the order
//! of [`Motion::ALL`].

use nirspi_eval::video::{Motion, Shown, gain};
use nirspi_recon::reconstruct::Method;
use rayon::prelude::*;
use std::error::Error;

const SHOWN: [Shown; 5] =
    [Shown::Lowest(10), Shown::Lowest(30), Shown::Lowest(50), Shown::Turns, Shown::All];
const NOISES: [f64; 5] = [0.001, 0.003, 0.01, 0.03, 0.1];
const SEED: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let method = arguments.next().map_or(Ok(Method::TIKHONOV), |name| name.parse())?;
    let frames = arguments.next().map_or(Ok(16), |count| count.parse())?;
    for shown in SHOWN {
        for noise in NOISES {
            let gains = Motion::ALL
                .par_iter()
                .map(|&motion| gain(method, motion, shown, noise, frames, SEED))
                .collect::<Result<Vec<_>, _>>()?;
            let each: Vec<String> = gains.iter().map(|gain| format!("{:6.2}", gain.db())).collect();
            let least = gains.iter().map(|gain| gain.db()).fold(f64::INFINITY, f64::min);
            println!(
                "{:<10} {noise:<6} least {least:6.2}: {}",
                format!("{shown:?}"),
                each.join(" ")
            );
        }
    }
    Ok(())
}
