//! A run's folder: checkpoint, weights, log, plot.
//!
//! # Invariant
//! Each file is whole, or the previous version, whenever the run is killed. Only the log's last
//! line may be incomplete. A resumed run writes the log again from its checkpoint
//! (`tests::a_log_is_written_anew_from_its_checkpoint`).

use super::data::Found;
use crate::error::{EvalError, On, Result};
use nirspi::files::output::{OutputDir, keep};
use nirspi::picture::{Axis, Chart, Line, below, signed_png};
use nirspi::provenance::Provenance;
use nirspi_nets::train::Entry;
use nirspi_nets::train::checkpoint::Checkpoint;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The folder of one run.
pub struct RunFolder {
    path: PathBuf,
    log: Option<File>,
}

impl RunFolder {
    /// The state of the run.
    const CHECKPOINT: &'static str = "checkpoint.bin";
    /// Averaged weights with the best held-out score.
    pub const WEIGHTS: &'static str = "weights.safetensors";
    /// One line of JSON for each entry.
    const LOG: &'static str = "log.jsonl";
    /// Loss and held-out score.
    const PLOT: &'static str = "plot.png";
    /// The held-out groups.
    const DATA: &'static str = "data.json";

    fn at(path: &Path) -> Self {
        Self { path: path.to_owned(), log: None }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Starts a run from its first step. A run that could be resumed is not overwritten.
    ///
    /// # Errors
    /// [`EvalError`] for a folder that holds a run, or cannot be written.
    pub fn start(path: &Path) -> Result<Self> {
        let mut folder = Self::at(path);
        let checkpoint = folder.file(Self::CHECKPOINT);
        if checkpoint.exists() {
            return Err(EvalError::Content(format!(
                "{}: a run is kept there, expected --resume to go on with it, or another folder",
                checkpoint.display()
            )));
        }
        OutputDir::create(path)?.commit()?;
        folder.write_log(&[])?;
        Ok(folder)
    }

    /// Opens a run to resume. The log is restored from its checkpoint.
    ///
    /// # Errors
    /// [`EvalError`] for a folder without a checkpoint, or with a damaged one.
    pub fn resume(path: &Path) -> Result<(Self, Checkpoint)> {
        let mut folder = Self::at(path);
        let file = folder.file(Self::CHECKPOINT);
        let bytes = std::fs::read(&file)
            .on(|| format!("{}: no checkpoint to go on from", file.display()))?;
        let checkpoint = Checkpoint::from_bytes(&bytes).on_file(&file)?;
        folder.write_log(&checkpoint.progress.log)?;
        Ok((folder, checkpoint))
    }

    fn write_log(&mut self, log: &[Entry]) -> Result<()> {
        let lines = log
            .iter()
            .map(|entry| Ok(serde_json::to_string(entry)? + "\n"))
            .collect::<Result<String>>()?;
        let file = self.file(Self::LOG);
        keep(&file, lines.as_bytes())?;
        let named = || format!("{}: cannot write it", file.display());
        self.log = Some(OpenOptions::new().append(true).open(&file).on(named)?);
        Ok(())
    }

    /// Writes the held-out groups.
    ///
    /// # Errors
    /// [`EvalError`] for a file that cannot be written.
    pub fn write_data(&self, data: &Found) -> Result<()> {
        let text = serde_json::to_string_pretty(data)? + "\n";
        Ok(keep(&self.file(Self::DATA), text.as_bytes())?)
    }

    /// Appends a line to the log.
    ///
    /// # Errors
    /// [`EvalError`] for a file that cannot be written.
    pub fn entry(&mut self, entry: &Entry) -> Result<()> {
        let line = serde_json::to_string(entry)? + "\n";
        let named = || format!("{}: cannot write it", self.path.join(Self::LOG).display());
        match &mut self.log {
            Some(log) => log.write_all(line.as_bytes()).and_then(|()| log.flush()).on(named),
            None => Ok(()),
        }
    }

    /// Writes the state of the run, and its plot.
    ///
    /// # Errors
    /// [`EvalError`] for a file that cannot be written.
    pub fn checkpoint(&self, bytes: &[u8], log: &[Entry], provenance: &Provenance) -> Result<()> {
        keep(&self.file(Self::CHECKPOINT), bytes)?;
        let charts: Vec<_> = plot(log).iter().map(Chart::render).collect();
        if !charts.is_empty() {
            keep(&self.file(Self::PLOT), &signed_png(&below(&charts), provenance))?;
        }
        Ok(())
    }

    /// Writes the best weights.
    ///
    /// # Errors
    /// [`EvalError`] for a file that cannot be written.
    pub fn best(&self, bytes: &[u8]) -> Result<()> {
        Ok(keep(&self.file(Self::WEIGHTS), bytes)?)
    }
}

/// The loss by step on a logarithmic axis, and the held-out score by step in its own unit: one chart
/// or two.
fn plot(log: &[Entry]) -> Vec<Chart> {
    let Some(last) = log.last() else { return Vec::new() };
    let losses: Vec<(f64, f64)> = log.iter().map(|e| (e.step as f64, e.loss)).collect();
    let scores: Vec<(f64, f64)> =
        log.iter().filter_map(|e| e.held_out.map(|score| (e.step as f64, score))).collect();
    let chart = |header: &str, y: Axis, colour, points| Chart {
        header: header.to_owned(),
        x: Axis::around("steps", [0.0, last.step as f64]),
        y,
        lines: vec![Line { name: header.to_lowercase(), colour, dashed: false, points }],
        footer: format!("{} steps in {:.0} s", last.step, last.seconds),
    };
    let values = |points: &[(f64, f64)]| points.iter().map(|point| point.1).collect::<Vec<_>>();
    let loss = Axis::decades("loss", values(&losses), 8);
    let mut charts = vec![chart("Loss", loss, 1, losses)];
    if !scores.is_empty() {
        let score = Axis::around(last.score.unit(), values(&scores));
        charts.push(chart("Held-out score", score, 0, scores));
    }
    charts
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::train::Score;

    fn entry(step: u64, held_out: Option<f64>) -> Entry {
        let (loss, seconds) = (1.0 / step as f64, step as f64);
        Entry { step, loss, held_out, score: Score::PsnrDb, rate: 1e-3, seconds }
    }

    #[test]
    fn a_plot_shows_loss_and_score_as_they_are_on_axes_of_their_own() {
        assert!(plot(&[]).is_empty());
        assert_eq!(plot(&[entry(1, None)]).len(), 1);
        let log = [entry(1, None), entry(2, Some(20.0)), entry(4, Some(24.0))];
        let [loss, score] = &plot(&log)[..] else { panic!("two charts") };
        assert_eq!(loss.lines[0].points, [(1.0, 1.0), (2.0, 0.5), (4.0, 0.25)]);
        assert!(loss.y.logarithmic && loss.y.from <= 0.25 && loss.y.to >= 1.0, "{:?}", loss.y);
        assert_eq!(score.lines[0].points, [(2.0, 20.0), (4.0, 24.0)]);
        assert_eq!((score.y.name.as_str(), score.y.from, score.y.to), ("dB", 20.0, 24.0));
        assert!(
            (score.x.from, score.x.to) == (0.0, 4.0) && score.lines[0].name == "held-out score"
        );
    }

    #[test]
    fn a_log_is_written_anew_from_its_checkpoint() {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path().join("run");
        let mut folder = RunFolder::start(&path).unwrap();
        for step in 1..=3 {
            folder.entry(&entry(step, None)).unwrap();
        }
        let lines = || std::fs::read_to_string(path.join("log.jsonl")).unwrap().lines().count();
        assert_eq!(lines(), 3);
        // The run was killed after its checkpoint at step 2.
        folder.write_log(&[entry(1, None), entry(2, None)]).unwrap();
        folder.entry(&entry(3, None)).unwrap();
        assert_eq!(lines(), 3);
        let made = nirspi::provenance::Made::now("test", None, ["test"]);
        let taken =
            nirspi::provenance::Taken::without_camera(nirspi::provenance::Origin::Simulated);
        folder.checkpoint(b"damaged", &[entry(1, None)], &taken.made(&made)).unwrap();
        assert!(path.join("plot.png").exists());
        let told = RunFolder::start(&path).err().unwrap().to_string();
        assert!(told.contains("a run is kept there"), "{told}");
        let told = RunFolder::resume(&path).err().unwrap().to_string();
        assert!(told.ends_with("checkpoint.bin"), "{told}");
    }
}
