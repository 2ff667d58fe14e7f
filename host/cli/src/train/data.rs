//! The training data: arguments of all commands of `nirspi train`.

use nirspi_eval::train::Data;
use std::path::PathBuf;

/// Which characters.
#[derive(Debug, clap::Args)]
pub struct DataArgs {
    /// A .npz stack (x, label, family or writer), a folder of them, or Chars74K's folder; may be given several times.
    /// Without any, and without --fonts, procedural scenes alone
    #[arg(long, value_name = "PATH")]
    data: Vec<PathBuf>,
    /// A folder of .ttf and .otf fonts, from which 0-9, A-Z and a-z are drawn
    #[arg(long, value_name = "DIR")]
    fonts: Vec<PathBuf>,
    /// Share of the font families, writers and photographs that training never sees
    #[arg(long, value_name = "0..1", default_value_t = 0.1)]
    held_out: f64,
    /// Share of the scenes that are no letters
    #[arg(long, value_name = "0..1", default_value_t = 0.15)]
    shapes: f32,
}

impl DataArgs {
    /// The training data of these arguments.
    pub fn data(&self) -> Data {
        Data {
            stacks: self.data.clone(),
            fonts: self.fonts.clone(),
            held_out: self.held_out,
            shapes: self.shapes,
        }
    }
}
