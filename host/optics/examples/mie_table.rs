//! Reads lines `x n k` and writes lines `q_ext q_sca q_abs q_back g p(0) p(90) p(180)`, p in degrees: what
//! `scripts/mie_reference.py` holds against other codes.

use nirspi_optics::mie::{Index, Mie};
use std::io::{BufRead, Write};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut mie = Mie::new();
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let fields: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [x, real, imaginary] = fields[..] else {
            return Err(format!("found {line:?}, expected: x n k").into());
        };
        let sphere = mie.sphere(x, Index { real, imaginary })?;
        let q = sphere.efficiencies();
        let phase = sphere.phase(&[1.0, 0.0, -1.0])?;
        let numbers = [q.extinction, q.scattering, q.absorption, q.backscatter, q.asymmetry];
        for value in numbers.iter().chain(&phase) {
            write!(out, "{value:e} ")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
