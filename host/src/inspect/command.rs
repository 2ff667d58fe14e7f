//! The commands that read a file as a guess did.

use crate::files::measurement::{Form, Remedy, Selection};
use crate::files::trace::Cut;
use crate::provenance::quoted;
use nirspi_recon::Side;
use std::path::Path;

/// Words of a command, as a shell reads them.
pub(super) struct Command(Vec<String>);

impl Command {
    pub(super) fn new(command: &str, file: &Path) -> Self {
        let mut words = vec!["nirspi".to_owned(), command.to_owned()];
        let file = file.display().to_string();
        // A name that would be an option.
        words.push(if file.starts_with('-') { format!("./{file}") } else { file });
        Self(words)
    }

    pub(super) fn option(mut self, name: &str, value: impl ToString) -> Self {
        self.0.extend([name.to_owned(), value.to_string()]);
        self
    }

    pub(super) fn some(self, name: &str, value: Option<impl ToString>) -> Self {
        match value {
            Some(value) => self.option(name, value),
            None => self,
        }
    }

    pub(super) fn flag(mut self, name: &str, is_set: bool) -> Self {
        self.0.extend(is_set.then(|| name.to_owned()));
        self
    }

    pub(super) fn line(&self) -> String {
        let words: Vec<String> = self.0.iter().map(|word| quoted(word)).collect();
        words.join(" ")
    }
}

/// The command that reconstructs the readings of a file so.
pub(super) fn reconstruct(file: &Path, want: &Selection) -> Command {
    let remedy = want.remedy;
    Command::new("reconstruct", file)
        .some("--field", want.field.as_ref())
        .some("--readings", want.form.map(Form::name))
        .flag("--complements-first", remedy.complements_first)
        .flag("--inverted", remedy.inverted)
        .some("--shift", (remedy.shift != 0).then_some(remedy.shift))
        .some("--sweeps", (remedy.sweeps() > 1).then_some(remedy.sweeps))
        .flag("--divide-by-lamp", remedy.divide_by_lamp)
        .some("--shown", want.shown.as_ref())
        .some("--side", want.side.map(Side::pixels))
        .flag("--patterns-first", want.patterns_first)
        .flag("--transpose", want.transpose)
        .flag("--decimal-comma", want.decimal_comma)
        .some("--index", want.index)
        .option("--out", "out/")
}

/// The header of a feed whose readings are read so; `None` if no header says what is done with them.
pub(super) fn header(n: usize, patterns: usize, form: Form, want: &Selection) -> Option<String> {
    let is_plain = want.remedy == Remedy::default() && !want.transpose;
    let order = want.shown.as_ref().filter(|_| is_plain)?;
    let part = (patterns < n * n).then(|| format!(", \"patterns\": {patterns}"));
    let (part, form) = (part.unwrap_or_default(), form.name());
    Some(format!("{{\"n\": {n}, \"order\": \"{order}\"{part}, \"readings\": \"{form}\"}}"))
}

/// The command that makes readings of a trace.
pub(super) fn readings(file: &Path, cut: &Cut, out: &Path) -> Command {
    let some = |number: usize| (number > 0).then_some(number);
    Command::new("readings", file)
        .some("--field", cut.field.as_ref())
        .some("--trigger", cut.trigger.as_ref())
        .some("--samples", cut.samples)
        .some("--skip", some(cut.skip))
        .some("--settle", some(cut.settle))
        .some("--count", cut.count)
        .flag("--decimal-comma", cut.decimal_comma)
        .option("--out", out.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Order;

    #[test]
    fn a_command_has_what_the_file_does_not_say_and_a_shell_reads_it() {
        let want = Selection {
            field: Some("Channel 1".to_owned()),
            form: Some(Form::Halves),
            shown: Some(Order::Random(7)),
            side: Side::new(32).ok(),
            remedy: Remedy { shift: -1, sweeps: 4, ..Remedy::default() },
            ..Selection::default()
        };
        assert_eq!(
            reconstruct(Path::new("a b.csv"), &want).line(),
            "nirspi reconstruct 'a b.csv' --field 'Channel 1' --readings halves --shift -1 --sweeps 4 --shown random:7 \
             --side 32 --out out/"
        );
        let plain = reconstruct(Path::new("-y.npz"), &Selection::default()).line();
        assert_eq!(plain, "nirspi reconstruct ./-y.npz --out out/");
        let cut = Cut { trigger: Some("CH2".to_owned()), settle: 4, ..Cut::default() };
        assert_eq!(
            readings(Path::new("t.csv"), &cut, Path::new("m.npz")).line(),
            "nirspi readings t.csv --trigger CH2 --settle 4 --out m.npz"
        );
    }
}
