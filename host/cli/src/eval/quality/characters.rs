//! The characters that everything is measured on.
//!
//! The law: an image whose family, writer or photograph training has seen is not among them.

use anyhow::{Context, Result, bail};
use nirspi::files::characters;
use nirspi_nets::data::Stack;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Groups that the embedded weights' training has not seen, by the stack's name.
const HELD_OUT: &str = include_str!("../../../../nets/weights/held_out.json");

/// Images that a stack must have: a distance of sets needs two.
const LEAST: usize = 2;

/// Where images come from.
#[derive(Debug, Clone, Serialize)]
pub struct Origin {
    pub stack: String,
    pub images: usize,
    /// `of 460 held out`, or why all were taken.
    pub choice: String,
}

/// One image.
#[derive(Debug, Clone)]
pub struct Character {
    /// 64 x 64 in [0, 1].
    pub sharp: Vec<f32>,
    pub label: Option<u8>,
    /// Index among the origins.
    pub stack: usize,
}

/// All images, stack after stack.
#[derive(Debug, Clone)]
pub struct Characters {
    all: Vec<Character>,
    origins: Vec<Origin>,
    notes: Vec<String>,
}

impl Characters {
    /// `count` images of each stack at `path`, chosen by the seed from the groups held out.
    pub fn read(path: &Path, held_out: Option<&Path>, count: usize, seed: u64) -> Result<Self> {
        let groups = match held_out {
            None => groups(HELD_OUT).context("held_out.json of the embedded weights")?,
            Some(file) => {
                let text = std::fs::read_to_string(file);
                let text = text.with_context(|| format!("{}: cannot read", file.display()))?;
                groups(&text).with_context(|| file.display().to_string())?
            }
        };
        let stacks = characters::read(path)?;
        let mut all = Self { all: Vec::new(), origins: Vec::new(), notes: Vec::new() };
        for stack in &stacks {
            all.add(stack, groups.get(stack.name()).map(Vec::as_slice), count, seed);
        }
        if all.all.is_empty() {
            bail!("{}: no image that training has not seen", path.display());
        }
        Ok(all)
    }

    fn add(&mut self, stack: &Stack, groups: Option<&[u32]>, count: usize, seed: u64) {
        let unseen = |at: &usize| groups.is_none_or(|g| g.contains(&stack.groups()[*at]));
        let mut places: Vec<usize> = (0..stack.len()).filter(unseen).collect();
        let choice = match groups {
            Some(_) => format!("of {} held out", places.len()),
            None => format!("of {}: training is not said to have seen this stack", places.len()),
        };
        if places.len() < count {
            let name = stack.name();
            self.notes.push(format!("{name}: {} images, fewer than {count}", places.len()));
        }
        if places.len() < LEAST {
            self.notes.push(format!("{}: left out", stack.name()));
            return;
        }
        places.shuffle(&mut Pcg64Mcg::seed_from_u64(seed));
        places.truncate(count);
        let at = self.origins.len();
        self.all.extend(places.iter().map(|&place| Character {
            sharp: stack.image(place).iter().map(|&level| f32::from(level) / 255.0).collect(),
            label: stack.label(place),
            stack: at,
        }));
        let (name, images) = (stack.name().to_owned(), places.len());
        self.origins.push(Origin { stack: name, images, choice });
    }

    /// The first `count` of each stack.
    pub fn first(&self, count: usize) -> Self {
        let mut fewer = Self { all: Vec::new(), ..self.clone() };
        for (at, origin) in fewer.origins.iter_mut().enumerate() {
            let of_stack = self.all.iter().filter(|character| character.stack == at).take(count);
            let before = fewer.all.len();
            fewer.all.extend(of_stack.cloned());
            origin.images = fewer.all.len() - before;
        }
        fewer
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn iter(&self) -> std::slice::Iter<'_, Character> {
        self.all.iter()
    }

    /// All pixels, (N, 64, 64).
    pub fn values(&self) -> Vec<f32> {
        self.all.iter().flat_map(|character| character.sharp.iter().copied()).collect()
    }

    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

fn groups(text: &str) -> Result<BTreeMap<String, Vec<u32>>> {
    serde_json::from_str(text).context("expected {\"stack\": [group, ...], ...}")
}
