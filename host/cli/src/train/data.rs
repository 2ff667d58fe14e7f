//! What to train on: the arguments that all of `nirspi train` share.

use anyhow::{Context, Result};
use nirspi::files::characters;
use nirspi::training::fonts;
use nirspi_nets::data::{Scenes, Stack};
use serde::Serialize;
use std::path::PathBuf;

/// Which characters.
#[derive(Debug, Clone, clap::Args)]
pub struct DataArgs {
    /// A .npz stack (x, label, family or writer), a folder of them, or Chars74K's folder; may be given several times.
    /// Without any, and without --fonts, procedural scenes alone
    #[arg(long, value_name = "PATH")]
    pub data: Vec<PathBuf>,
    /// A folder of .ttf and .otf fonts, from which 0-9, A-Z and a-z are drawn
    #[arg(long, value_name = "DIR")]
    pub fonts: Vec<PathBuf>,
    /// Share of the font families, writers and photographs that training never sees
    #[arg(long, value_name = "0..1", default_value_t = 0.1)]
    pub held_out: f64,
    /// Share of the scenes that are no letters
    #[arg(long, value_name = "0..1", default_value_t = 0.15)]
    pub shapes: f32,
}

/// What was found, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Found {
    /// Of each stack.
    pub stacks: Vec<nirspi_nets::data::split::HeldOutGroups>,
    /// Images to train on.
    pub training_images: usize,
    /// Images that training never sees.
    pub held_out_images: usize,
    /// Fonts that were left out.
    pub skipped_fonts: Vec<PathBuf>,
}

impl DataArgs {
    /// Reads them; the split follows from the seed.
    pub fn scenes(&self, seed: u64) -> Result<(Scenes, Found)> {
        let mut stacks: Vec<Stack> = Vec::new();
        let mut skipped_fonts = Vec::new();
        for path in &self.data {
            stacks.extend(characters::read(path)?);
        }
        for folder in &self.fonts {
            let rendered = fonts::render(folder)?;
            stacks.push(rendered.stack);
            skipped_fonts.extend(rendered.skipped);
        }
        let scenes = if stacks.is_empty() {
            Scenes::procedural()
        } else {
            Scenes::new(stacks, self.held_out, self.shapes, seed).context("training data")?
        };
        let split = scenes.split();
        let found = Found {
            stacks: split.map_or_else(Vec::new, |split| split.groups().to_vec()),
            training_images: split.map_or(0, |split| split.training().len()),
            held_out_images: split.map_or(0, |split| split.held_out().len()),
            skipped_fonts,
        };
        Ok((scenes, found))
    }
}
