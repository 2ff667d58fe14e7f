//! Progress on stderr: a bar on a terminal, a plain line every ten seconds elsewhere, nothing with
//! `--quiet`.

use super::print;
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::capture;
use nirspi::heartbeat::Heartbeat;
use nirspi::picture::Tones;
use std::io::{IsTerminal, stderr};
use std::ops::ControlFlow;
use std::time::Duration;

/// Time between two plain lines.
const PERIOD: Duration = Duration::from_secs(10);

/// The progress of one piece of work. The bar goes when the progress is dropped.
pub struct Progress {
    bar: ProgressBar,
    _lines: Option<Heartbeat>,
}

impl Progress {
    /// Work on a known number of things: `frames`, `pictures`.
    pub fn of(what: &str, total: impl TryInto<u64>, unit: &str) -> Self {
        Self::new(what, total.try_into().ok(), unit)
    }

    /// Work of unknown length.
    pub fn working(what: &str) -> Self {
        Self::new(what, None, "")
    }

    /// Work on things that are counted, of a known total or without end.
    pub fn new(what: &str, total: Option<u64>, unit: &str) -> Self {
        let template = match (total, unit) {
            (Some(_), _) => {
                format!("{what} {{bar:30}} {{pos}}/{{len}} {unit}, {{eta}} left  {{msg}}")
            }
            (None, "") => format!("{{spinner}} {what} {{elapsed}}  {{msg}}"),
            (None, unit) => format!("{{spinner}} {what} {{pos}} {unit}  {{per_sec}}  {{msg}}"),
        };
        let style = ProgressStyle::with_template(&template)
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = match print::is_quiet() {
            true => ProgressBar::hidden(),
            false => ProgressBar::new(total.unwrap_or(0)),
        };
        let bar = bar.with_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        let lines = !print::is_quiet() && !stderr().is_terminal();
        let (seen, what, unit) = (bar.clone(), what.to_owned(), unit.to_owned());
        let lines = lines.then(|| {
            Heartbeat::every(PERIOD, move |since| {
                let done = match (total, unit.as_str()) {
                    (Some(total), unit) => format!(", {} of {total} {unit}", seen.position()),
                    (None, "") => String::new(),
                    (None, unit) => format!(", {} {unit}", seen.position()),
                };
                let message = seen.message();
                let message = if message.is_empty() { message } else { format!(", {message}") };
                let seconds = since.as_secs();
                print::remark(format_args!("progress: {what}{done}, {seconds} s{message}"));
            })
        });
        Self { bar, _lines: lines }
    }

    /// The number of things done.
    pub fn set(&self, done: impl TryInto<u64>) {
        self.bar.set_position(done.try_into().unwrap_or(u64::MAX));
    }

    /// More things are done.
    pub fn add(&self, more: u64) {
        self.bar.inc(more);
    }

    /// The grey tones of the terminal on which the bar is seen; `None` if no image can be shown.
    pub fn tones(&self) -> Option<Tones> {
        let seen = !self.bar.is_hidden();
        seen.then(|| Tones::announced(|name| std::env::var(name).ok())).flatten()
    }

    /// Words beside the bar.
    pub fn say(&self, message: impl Into<String>) {
        self.bar.set_message(message.into());
    }

    /// Watches one capture or several in turn, and goes on with them.
    pub fn watch(&self) -> impl FnMut(&capture::Progress) -> ControlFlow<capture::StopCause> + '_ {
        let (mut before, mut last) = (0, 0);
        move |progress| {
            let now = progress.counters.total();
            if now < last {
                before += last;
            }
            last = now;
            self.set(before + now);
            ControlFlow::Continue(())
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
