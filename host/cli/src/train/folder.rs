//! A run's folder: checkpoint, weights, log, plot.
//!
//! The one law: each file is whole or the one before, whenever the run is killed; only the log's last line may be torn,
//! and it is made anew when the run goes on.

use super::data::Found;
use super::run::unit;
use crate::report::to_json;
use anyhow::{Context, Result, bail};
use nirspi::files::image::encode_rgb;
use nirspi::files::output::{OutputDir, write_atomic};
use nirspi::picture::{Axis, Chart, Line};
use nirspi_nets::train::Entry;
use nirspi_nets::train::checkpoint::Checkpoint;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The folder of one run.
pub struct Folder {
    path: PathBuf,
    log: Option<File>,
}

impl Folder {
    /// The run as it is.
    const CHECKPOINT: &'static str = "checkpoint.bin";
    /// Averaged weights with the best held-out score.
    pub const WEIGHTS: &'static str = "weights.safetensors";
    /// A line of JSON an entry.
    const LOG: &'static str = "log.jsonl";
    /// Loss and held-out score.
    const PLOT: &'static str = "plot.png";
    /// Which groups were held out.
    const DATA: &'static str = "data.json";

    fn at(path: &Path) -> Self {
        Self { path: path.to_owned(), log: None }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// A run from its first step. One that could go on is not overwritten.
    pub fn start(path: &Path) -> Result<Self> {
        let mut folder = Self::at(path);
        let checkpoint = folder.file(Self::CHECKPOINT);
        if checkpoint.exists() {
            bail!(
                "{}: a run is kept there, expected --resume to go on with it, or another folder",
                checkpoint.display()
            );
        }
        OutputDir::create(path)?.commit()?;
        folder.write_log(&[])?;
        Ok(folder)
    }

    /// A run to go on with; the log is brought back to its checkpoint.
    pub fn resume(path: &Path) -> Result<(Self, Checkpoint)> {
        let mut folder = Self::at(path);
        let file = folder.file(Self::CHECKPOINT);
        let bytes = std::fs::read(&file)
            .with_context(|| format!("{}: no checkpoint to go on from", file.display()))?;
        let checkpoint =
            Checkpoint::from_bytes(&bytes).with_context(|| file.display().to_string())?;
        folder.write_log(&checkpoint.progress.log)?;
        Ok((folder, checkpoint))
    }

    fn write_log(&mut self, log: &[Entry]) -> Result<()> {
        let lines = log
            .iter()
            .map(|entry| Ok(serde_json::to_string(entry)? + "\n"))
            .collect::<Result<String>>()?;
        let file = self.file(Self::LOG);
        write_atomic(&file, lines.as_bytes())?;
        let named = || format!("{}: cannot write it", file.display());
        self.log = Some(OpenOptions::new().append(true).open(&file).with_context(named)?);
        Ok(())
    }

    /// Keeps who was held out.
    pub fn write_data(&self, data: &Found) -> Result<()> {
        let text = to_json(data)?;
        Ok(write_atomic(&self.file(Self::DATA), text.as_bytes())?)
    }

    /// A line of the log.
    pub fn entry(&mut self, entry: &Entry) -> Result<()> {
        let line = serde_json::to_string(entry)? + "\n";
        let named = || format!("{}: cannot write it", self.path.join(Self::LOG).display());
        match &mut self.log {
            Some(log) => {
                log.write_all(line.as_bytes()).and_then(|()| log.flush()).with_context(named)
            }
            None => Ok(()),
        }
    }

    /// The run as it is, and its plot.
    pub fn checkpoint(&self, bytes: &[u8], log: &[Entry]) -> Result<()> {
        write_atomic(&self.file(Self::CHECKPOINT), bytes)?;
        if let Some(chart) = plot(log) {
            write_atomic(&self.file(Self::PLOT), &encode_rgb(&chart.render()))?;
        }
        Ok(())
    }

    /// The best weights.
    pub fn best(&self, bytes: &[u8]) -> Result<()> {
        Ok(write_atomic(&self.file(Self::WEIGHTS), bytes)?)
    }
}

/// Loss and held-out score over steps, each brought to the range of its values: they share a frame, not a unit.
fn plot(log: &[Entry]) -> Option<Chart> {
    let last = log.last()?;
    let losses: Vec<(f64, f64)> = log.iter().map(|e| (e.step as f64, e.loss)).collect();
    let scores: Vec<(f64, f64)> =
        log.iter().filter_map(|e| e.held_out.map(|score| (e.step as f64, score))).collect();
    let line = |name: &str, colour, points: &[(f64, f64)], decimals: usize| {
        let low = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        let span = if high > low { high - low } else { 1.0 };
        Line {
            name: format!("{name}: {low:.decimals$} to {high:.decimals$}"),
            colour,
            dashed: false,
            points: points.iter().map(|&(x, y)| (x, (y - low) / span)).collect(),
        }
    };
    let steps = last.step as f64;
    let mut lines = vec![line("loss", 1, &losses, 5)];
    if !scores.is_empty() {
        lines.push(line(&format!("held out, {}", unit(last.score)), 0, &scores, 2));
    }
    Some(Chart {
        header: "Loss and held-out score".to_owned(),
        x: Axis {
            name: "steps".to_owned(),
            from: 0.0,
            to: steps,
            logarithmic: false,
            ticks: (0..=4).map(|k| (steps * f64::from(k) / 4.0).round()).collect(),
        },
        y: Axis {
            name: "least to most of each line".to_owned(),
            from: -0.05,
            to: 1.05,
            logarithmic: false,
            ticks: vec![0.0, 0.5, 1.0],
        },
        lines,
        footer: format!("{} steps in {:.0} s", last.step, last.seconds),
    })
}
