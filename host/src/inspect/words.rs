//! An inspection in words.

use super::{ArrayReport, FeedSeen, Guess, Inspection};
use crate::files::provenance::quoted;
use nirspi_recon::words::count_of;

/// The most arrays that are listed.
const ARRAYS: usize = 24;

impl Guess {
    /// The way to read in a few words.
    #[must_use]
    pub fn name(&self) -> String {
        let field = self.field.as_ref().map(|field| format!("`{field}`: ")).unwrap_or_default();
        let Self { form, order, n, .. } = self;
        format!("{field}{form}, order {order}, {n} x {n}")
    }

    /// How much it explains, in a few words.
    #[must_use]
    pub fn explains(&self) -> String {
        let percent = 100.0 * self.explained;
        let chance = if self.by_chance { ", no better than chance" } else { "" };
        format!("explains {percent:.0} % of the held-back readings{chance}")
    }
}

impl ArrayReport {
    fn words(&self) -> String {
        let Self { name, shape, kind, range, missing } = self;
        let name = if name.is_empty() { "one array".to_owned() } else { quoted(name) };
        let axes: Vec<String> = shape.iter().map(usize::to_string).collect();
        let comma = if axes.len() == 1 { "," } else { "" };
        let shape = format!("({}{comma})", axes.join(", "));
        let range =
            range.map(|[least, most]| format!(", from {} to {}", short(least), short(most)));
        let missing = (*missing > 0).then(|| format!(", {missing} NaN"));
        match range {
            Some(range) => format!("  {name} {shape} {kind}{range}{}", missing.unwrap_or_default()),
            None => format!("  {name} {kind}{}", missing.unwrap_or_default()),
        }
    }
}

/// A number with five digits; a very large or small one with a power of ten.
fn short(value: f64) -> String {
    let plain = format!("{value}");
    let rounded = format!("{value:.4e}").parse::<f64>().unwrap_or(value);
    match plain.len() {
        0..=7 => plain,
        _ if rounded != 0.0 && !(1e-4..1e10).contains(&rounded.abs()) => format!("{rounded:e}"),
        _ => format!("{rounded}"),
    }
}

impl Inspection {
    /// The inspection, a line each: what the file holds, then the best ways to read it with their commands.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut lines = vec![format!("{}: {}", self.input.display(), self.format)];
        lines.extend(self.arrays.iter().take(ARRAYS).map(ArrayReport::words));
        if self.arrays.len() > ARRAYS {
            lines.push(format!("  and {} more", self.arrays.len() - ARRAYS));
        }
        if let Some(recording) = &self.recording {
            lines.extend(recording.to_string().lines().map(|line| format!("  {line}")));
        }
        lines.extend(self.feed.iter().flat_map(FeedSeen::words));
        for finding in self.findings.iter().chain(&self.unexplained) {
            lines.push(finding.what.clone());
            lines.extend(finding.commands.iter().map(|command| format!("   {command}")));
        }
        let shown = self.shown();
        let has_fit = !self.fitting().is_empty();
        if !has_fit && !shown.is_empty() {
            lines.push(format!("{} tried, none fits; the best:", count_of(self.tried, "way")));
        }
        for (at, guess) in shown.iter().enumerate() {
            lines.push(format!("{}. {}: {}", at + 1, guess.name(), guess.explains()));
            lines.extend(guess.warnings.iter().map(|warning| format!("   but {warning}")));
            let header = if self.feed.is_some() { "the header for it: " } else { "" };
            let commands = guess.commands.iter();
            lines.extend(commands.map(|command| format!("   {header}{command}")));
            lines.extend(guess.measurements_in_file.map(|count| {
                format!("   the first of {count} measurements: --index all reconstructs each")
            }));
            let mirrored = guess.mirrored.as_ref();
            lines.extend(mirrored.map(|order| {
                let option = if self.feed.is_some() { "order" } else { "--shown" };
                format!("   the image mirrored along its diagonal: {option} {order}")
            }));
        }
        let others = self.tried.saturating_sub(shown.len());
        if has_fit && others > 0 {
            lines.push(format!(
                "{} tried; the others explain less, or break the law of readings",
                count_of(self.tried, "way")
            ));
        }
        lines
    }
}
