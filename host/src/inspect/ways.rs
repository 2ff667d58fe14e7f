//! The ways in which the readings of a file can be read, and their trial.

use super::other::{NO_READINGS, Trace, is_long, is_patterns};
use super::trial::{Guess, Judge, Verdict};
use super::{FileError, command};
use crate::files::contents::{Array, Contents, of_readings};
use crate::files::measurement::{Form, MeasurementFile, Remedy, Selection};
use crate::files::trace::Cut;
use nirspi_recon::law::Explanation;
use nirspi_recon::{Order, Rows, Side};
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::Path;

/// The most fields of which two are tried as patterns and complements.
const MOST_FIELDS: usize = 4;

/// How many patterns a recording may have begun early or late.
const SHIFTS: [i32; 4] = [1, -1, 2, -2];

/// Fewest readings of a measurement.
const LEAST: usize = 4;

/// Opens a file; a text that is no table otherwise, with decimal commas.
pub(super) fn opened(path: &Path) -> Result<Contents, FileError> {
    Contents::open(path, false).or_else(|error| Contents::open(path, true).map_err(|_| error))
}

/// The trials of a file.
pub(super) struct Trials<'t> {
    path: &'t Path,
    contents: &'t Contents,
    judge: &'t Judge,
    /// Whether the file names the row of each pattern.
    pub(super) has_rows: bool,
    /// Whether the readings are those of a feed: its header says how they are read.
    pub(super) is_feed: bool,
    tried: usize,
    visited: Vec<(Option<Cut>, Selection)>,
    guesses: Vec<Guess>,
    /// Number of measurements in the file, as it was read last.
    several: Option<usize>,
    /// How the readings repeat themselves, if they do: then they are not those of a larger image.
    repeated: Option<String>,
}

/// A way that was tried.
struct Tried {
    want: Selection,
    file: MeasurementFile,
    verdict: Verdict,
    has_rows: bool,
    mirrored: Option<String>,
}

impl<'t> Trials<'t> {
    pub(super) fn new(path: &'t Path, contents: &'t Contents, judge: &'t Judge) -> Self {
        let has_rows = contents.arrays().iter().any(|array| array.name == "h_row");
        let (tried, visited, guesses, several) = (0, Vec::new(), Vec::new(), None);
        let repeated = None;
        let is_feed = false;
        Self {
            path,
            contents,
            judge,
            has_rows,
            is_feed,
            tried,
            visited,
            guesses,
            several,
            repeated,
        }
    }

    /// How many ways were tried, and the guesses in their order.
    pub(super) fn finished(mut self) -> (usize, Vec<Guess>) {
        if let Some(repeated) = self.repeated {
            for guess in self.guesses.iter_mut().filter(|guess| !guess.takes_repeats) {
                guess.contradicted = true;
                guess.warnings.push(repeated.clone());
            }
        }
        let fitting = self.guesses.iter().filter(|guess| guess.fits());
        let most = fitting.map(|guess| guess.readings).max().unwrap_or(0);
        self.guesses.sort_by_key(|guess| guess.rank(most));
        // A file that states its form is read so with and without the option.
        let mut before = HashSet::new();
        self.guesses.retain(|guess| before.insert(guess.commands.clone()));
        (self.tried, self.guesses)
    }

    /// Whether a guess fits.
    pub(super) fn has_fit(&self) -> bool {
        self.guesses.iter().any(Guess::fits)
    }

    /// Tries to read the file as a measurement of a full sweep, or of the rows that it names.
    pub(super) fn of_contents(&mut self) {
        for base in bases(self.contents) {
            self.explore(None, base);
        }
    }

    /// Tries to read the file as part of a sweep, and as readings that began early or late.
    pub(super) fn of_parts(&mut self) {
        let bases = bases(self.contents);
        let sides = |base: &Selection| self.sides(base);
        for base in bases.iter().flat_map(sides).collect::<Vec<Selection>>() {
            self.explore(None, base);
        }
        if !self.has_fit() {
            bases.iter().for_each(|base| self.shifted(base));
        }
    }

    /// Tries the readings of a trace.
    pub(super) fn of_trace(&mut self, trace: &Trace) {
        for form in Form::ALL {
            let form = (form != Form::Pairs).then_some(form);
            self.explore(Some(trace), Selection { form, ..Selection::default() });
        }
    }

    /// Tries a way with every order, and what the law of readings says would explain them.
    fn explore(&mut self, trace: Option<&Trace>, base: Selection) {
        let visit = (trace.map(|trace| trace.cut.clone()), base.clone());
        if self.visited.contains(&visit) {
            return;
        }
        self.visited.push(visit);
        let has_rows = (self.has_rows || names_rows(&base)) && trace.is_none();
        let first = Selection { shown: (!has_rows).then_some(Order::Natural), ..base };
        let Some((first, file)) = self.read(trace, first) else { return };
        self.tried += 1;
        let Some(verdict) = self.judge.of(self.path, &file) else { return };
        let contradicted = verdict.is_contradicted();
        let explanations: Vec<Explanation> = verdict.explanations().collect();
        let mut all = vec![Tried { want: first.clone(), file, verdict, has_rows, mirrored: None }];
        if !has_rows && !contradicted {
            all.extend(self.orders(trace, &first, &mut |_| true));
        }
        self.mirror(&mut all);
        for tried in all {
            self.keep(trace, tried);
        }
        if contradicted && first.remedy == Remedy::default() {
            let plain = Selection { shown: None, ..first };
            for explanation in explanations {
                self.remedied(trace, &plain, explanation);
            }
        }
    }

    /// The other named orders of these readings, those that differ.
    fn orders(
        &mut self,
        trace: Option<&Trace>,
        first: &Selection,
        keep: &mut dyn FnMut(&Verdict) -> bool,
    ) -> Vec<Tried> {
        let mut read = Vec::new();
        for named in Order::NAMED.iter().filter(|named| Some(&named.order) != first.shown.as_ref())
        {
            let want = Selection { shown: Some(named.order.clone()), ..first.clone() };
            read.extend(self.read(trace, want));
        }
        self.tried += read.len();
        let judged = |(want, file): (Selection, MeasurementFile)| {
            let verdict = self.judge.of(self.path, &file)?;
            Some(Tried { want, file, verdict, has_rows: false, mirrored: None })
        };
        let all: Vec<Tried> = read.into_par_iter().filter_map(judged).collect();
        all.into_iter().filter(|tried| keep(&tried.verdict)).collect()
    }

    /// Reads the file so, or the first of several measurements.
    fn read(
        &mut self,
        trace: Option<&Trace>,
        mut want: Selection,
    ) -> Option<(Selection, MeasurementFile)> {
        let read = |want: &Selection| match trace {
            Some(trace) => of_readings(self.path, trace.readings.clone(), want),
            None => self.contents.measurement(want),
        };
        let file = match read(&want) {
            Err(FileError::Choice { count, asked: None, .. }) if count > 1 => {
                self.several = Some(count);
                want.index = Some(0);
                read(&want)
            }
            read => read,
        };
        let file = file.ok()?;
        if trace.is_none() && self.is_no_spectrum(&want, &file) {
            return None;
        }
        (file.h_row.len() >= LEAST).then_some((want, file))
    }

    /// Whether readings on two axes are no spectrum: in an image, other pixels are brighter than that of the all-on
    /// pattern would be.
    fn is_no_spectrum(&self, want: &Selection, file: &MeasurementFile) -> bool {
        let is_flat = |array: &Array| array.axes().len() <= 1;
        if want.shown.is_none() || want.index.is_some() || self.array(want).is_none_or(is_flat) {
            return false;
        }
        let readings = file.readings.values();
        let each = readings.len() / file.h_row.len();
        let all_on = file.h_row.iter().position(|&row| row == 0).map(|at| readings[each * at]);
        all_on.is_none_or(|all_on| readings.iter().any(|reading| reading.abs() > all_on.abs()))
    }

    /// The array of the readings.
    fn array(&self, want: &Selection) -> Option<&Array> {
        let field = want.field.as_deref().unwrap_or("y").split(',').next();
        let arrays = self.contents.arrays();
        arrays.iter().find(|array| Some(&*array.name) == field).or(arrays.first())
    }

    /// Leaves out orders under which these readings have the same patterns as under one before, or the
    /// transposed ones: the image is then the same, or mirrored.
    fn mirror(&self, all: &mut Vec<Tried>) {
        let mut kept: Vec<Tried> = Vec::new();
        for tried in all.drain(..) {
            let turned = transposed(&tried.file.h_row);
            if kept.iter().any(|before| before.file.h_row == tried.file.h_row) {
                continue;
            }
            match kept.iter_mut().find(|before| *before.file.h_row == *turned) {
                Some(before) => before.mirrored = tried.want.shown.as_ref().map(Order::to_string),
                None => kept.push(tried),
            }
        }
        *all = kept;
    }

    /// Tries what would explain the readings.
    fn remedied(&mut self, trace: Option<&Trace>, want: &Selection, explanation: Explanation) {
        let by = |remedy: Remedy| Selection { remedy, ..want.clone() };
        let none = Remedy::default();
        let stated = |form| Some(form).filter(|form| *form != self.default_form(want));
        let remedied = match explanation {
            Explanation::Form(form) => Selection { form: stated(form), ..want.clone() },
            Explanation::ComplementsFirst(form) => {
                Selection { form: stated(form), ..by(Remedy { complements_first: true, ..none }) }
            }
            Explanation::Inverted => by(Remedy { inverted: true, ..none }),
            Explanation::OneEarly => by(Remedy { shift: 1, ..none }),
            Explanation::OneLate => by(Remedy { shift: -1, ..none }),
            Explanation::Sweeps { count } => by(Remedy { sweeps: count as u32, ..none }),
            Explanation::Samples { each } if trace.is_none() => {
                let cut = Cut {
                    field: want.field.clone(),
                    samples: Some(each),
                    decimal_comma: want.decimal_comma,
                    ..Cut::default()
                };
                if let Some(trace) = Trace::of(self.path, cut) {
                    self.of_trace(&trace);
                }
                self.repeats(format!("each reading is there {each} times"));
                return;
            }
            Explanation::Repeats { each } => {
                // No option reads them, so no other way is right either.
                self.repeated = Some(format!(
                    "each pattern and its complement are there {each} times in a row: save them with `h_row`, each row {each} times"
                ));
                return;
            }
            _ => return,
        };
        self.explore(trace, remedied);
        if let Explanation::Sweeps { count } = explanation {
            self.repeats(format!("the readings are there {count} times, one sweep after another"));
        }
    }

    /// Remembers how readings repeat themselves, if a guess that takes this into account fits.
    fn repeats(&mut self, how: String) {
        if self.guesses.iter().any(|guess| guess.takes_repeats && guess.fits()) {
            self.repeated = Some(how);
        }
    }

    fn default_form(&self, want: &Selection) -> Form {
        default_form(self.contents.arrays(), want.field.as_deref())
    }

    /// Tries readings that began some patterns early or late, in every order.
    fn shifted(&mut self, base: &Selection) {
        for shift in SHIFTS {
            let form = base.form.unwrap_or(self.default_form(base));
            let remedy = Remedy { shift: shift * form.readings() as i32, ..Remedy::default() };
            let has_rows = self.has_rows || names_rows(base);
            let order = (!has_rows).then_some(Order::Natural);
            let want = Selection { remedy, shown: order, ..base.clone() };
            let Some((want, file)) = self.read(None, want) else { return };
            self.tried += 1;
            let fits =
                |verdict: &Verdict| !verdict.by_chance(has_rows) && !verdict.is_contradicted();
            let verdict = self.judge.of(self.path, &file);
            let first = verdict.filter(fits).map(|verdict| Tried {
                want: want.clone(),
                file,
                verdict,
                has_rows,
                mirrored: None,
            });
            let mut all: Vec<Tried> = first.into_iter().collect();
            if !has_rows {
                all.extend(self.orders(None, &want, &mut |verdict| fits(verdict)));
            }
            self.mirror(&mut all);
            all.into_iter().for_each(|tried| self.keep(None, tried));
        }
    }

    /// The sides of which the readings may be a part of a sweep.
    fn sides(&self, base: &Selection) -> Vec<Selection> {
        let holds = |name: &str| self.contents.arrays().iter().find(|array| array.name == name);
        if holds("n").is_some() || base.side.is_some() {
            return Vec::new();
        }
        let rows = holds("h_row").and_then(|array| array.numbers.as_ref()?.range);
        let least = match rows {
            Some([_, last]) => last as usize + 1,
            None => {
                let form = base.form.unwrap_or(self.default_form(base));
                let of = |array: &Array| array.axes().last().copied().unwrap_or(0);
                self.array(base).map_or(0, of) / form.readings() + 1
            }
        };
        let fits = |side: &Side| side.area() >= least;
        let sides = (1..=8).filter_map(|power| Side::new(1 << power).ok()).filter(fits).take(2);
        sides.map(|side| Selection { side: Some(side), ..base.clone() }).collect()
    }

    fn keep(&mut self, trace: Option<&Trace>, tried: Tried) {
        let Tried { want, file: read, verdict, has_rows, mirrored } = tried;
        let form = want.form.unwrap_or(self.default_form(&want));
        let order = want.shown.as_ref().map_or_else(|| "of h_row".to_owned(), Order::to_string);
        let words = (form_words(form, &want, trace), order);
        let guess = Guess::of(&read, verdict, has_rows, words);
        let commands = match self.is_feed {
            true => command::header(guess.n, guess.patterns, form, &want).into_iter().collect(),
            false => self.commands(trace, &want),
        };
        self.guesses.push(Guess {
            field: match trace {
                Some(trace) => trace.cut.field.clone(),
                None => want.field.clone(),
            },
            measurements_in_file: want.index.and(self.several),
            mirrored,
            takes_repeats: trace.is_some() || want.remedy.sweeps() > 1,
            commands,
            ..guess
        });
    }

    /// The commands that read the file so.
    fn commands(&self, trace: Option<&Trace>, want: &Selection) -> Vec<String> {
        let out = trace.map(|trace| trace.out(self.path));
        let file = out.as_deref().unwrap_or(self.path);
        let mut commands = Vec::new();
        if let (Some(trace), Some(out)) = (trace, &out) {
            commands.push(command::readings(self.path, &trace.cut, out).line());
        }
        commands.push(command::reconstruct(file, want).line());
        commands
    }
}

/// The form and what is done with the readings, in a few words.
fn form_words(form: Form, want: &Selection, trace: Option<&Trace>) -> String {
    let Remedy { complements_first, inverted, shift, .. } = want.remedy;
    let sweeps = want.remedy.sweeps();
    let mut words = form.name().to_owned();
    let mut add = |is_so: bool, more: &str| {
        if is_so {
            words += more;
        }
    };
    add(complements_first, ", complements first");
    add(inverted, ", inverted");
    add(shift != 0, &format!(", shifted by {shift}"));
    add(sweeps > 1, &format!(", {sweeps} sweeps"));
    add(want.patterns_first, ", patterns along the first axis");
    if let Some(samples) = trace.and_then(|trace| trace.cut.samples) {
        add(true, &format!(", {samples} samples each"));
    }
    words
}

/// The patterns with rows and columns exchanged.
fn transposed(rows: &Rows) -> Vec<u32> {
    let n = rows.side().pixels() as u32;
    rows.iter().map(|row| row % n * n + row / n).collect()
}

/// The ways to read the file without an order: fields, forms and axes.
fn bases(contents: &Contents) -> Vec<Selection> {
    let arrays = contents.arrays();
    let holds = |name: &str| arrays.iter().any(|array| array.name == name);
    if array_of(arrays, "h_row").is_none() && arrays.iter().any(is_long) {
        // Samples, of which readings are made first.
        return Vec::new();
    }
    let fields: Vec<Option<String>> = match () {
        () if contents.is_unnamed() => match arrays.iter().any(is_patterns) {
            true => return Vec::new(),
            false => vec![None],
        },
        () if holds("y") && holds("d") => vec![None, Some("d".to_owned())],
        () if holds("y") || holds("d") => vec![None],
        () => readings_of(arrays).map(|array| Some(array.name.clone())).collect(),
    };
    let mut found = Vec::new();
    // Two fields of patterns and complements explain more than each of them.
    let both = readings_of(arrays).filter(|array| array.axes().len() == 1);
    let both: Vec<&Array> = both.collect();
    if !holds("y") && !holds("d") && both.len() <= MOST_FIELDS {
        for first in &both {
            let others = both.iter().filter(|other| {
                other.name != first.name && other.shape == first.shape && !first.name.contains(',')
            });
            found.extend(others.map(|second| Selection {
                field: Some(format!("{},{}", first.name, second.name)),
                decimal_comma: contents.decimal_comma(),
                ..Selection::default()
            }));
        }
    }
    for field in fields {
        let named = |array: &&Array| Some(&array.name) == field.as_ref();
        let own = match &field {
            Some(_) => arrays.iter().find(named),
            None => ["", "y", "d"].iter().find_map(|name| array_of(arrays, name)),
        };
        let has_axes = own.is_some_and(|array| array.axes().len() > 1);
        let default = default_form(arrays, field.as_deref());
        let way = |form: Form, patterns_first, side| Selection {
            field: field.clone(),
            form: (form != default).then_some(form),
            patterns_first,
            side,
            decimal_comma: contents.decimal_comma(),
            ..Selection::default()
        };
        for patterns_first in [false, true].into_iter().take(1 + usize::from(has_axes)) {
            found.extend(Form::ALL.map(|form| way(form, patterns_first, None)));
        }
        let side = own.and_then(side_of_spectrum).filter(|_| !holds("n") && !holds("h_row"));
        found.extend(
            side.into_iter().flat_map(|side| Form::ALL.map(|form| way(form, false, Some(side)))),
        );
    }
    with_rows(arrays, &found).into_iter().chain(found.clone()).collect()
}

/// The same ways with rows that the file does not call `h_row`.
fn with_rows(arrays: &[Array], ways: &[Selection]) -> Vec<Selection> {
    // What counts the lines of a table is no list of rows: it would be natural order.
    let is_rows = |array: &&Array| {
        array.numbers.as_ref().is_some_and(|look| look.is_rows && !look.is_counter)
    };
    let named = |array: &&Array| !array.name.is_empty() && !NO_READINGS.contains(&&*array.name);
    let (None, Some(rows)) = (array_of(arrays, "h_row"), arrays.iter().filter(named).find(is_rows))
    else {
        return Vec::new();
    };
    let last = rows.numbers.as_ref().and_then(|look| look.range).map_or(0.0, |[_, last]| last);
    let side = (1..=8).filter_map(|power| Side::new(1 << power).ok());
    let side = side.into_iter().find(|side| side.area() as f64 > last);
    let others = ways.iter().filter(|way| {
        let fields = way.field.as_deref().unwrap_or_default();
        fields.split(',').all(|field| field != rows.name)
    });
    let with = |way: &Selection| {
        let field = way.field.iter().map(|field| format!("{field},")).collect::<String>();
        Selection {
            field: Some(format!("{field}h_row={}", rows.name)),
            side: side.filter(|_| array_of(arrays, "n").is_none()),
            ..way.clone()
        }
    };
    others.map(with).collect()
}

/// The side of the image whose spectrum an array may be, perhaps with pattern and complement on its last axis.
fn side_of_spectrum(array: &Array) -> Option<Side> {
    match *array.axes() {
        [height, width] | [height, width, 2] if height == width => Side::new(width as u64).ok(),
        _ => None,
    }
}

/// Whether a way names the rows of the patterns.
fn names_rows(want: &Selection) -> bool {
    want.field.as_ref().is_some_and(|field| field.contains("h_row="))
}

/// The form of a field, or of the field that is read by default, if the user says none.
fn default_form(arrays: &[Array], field: Option<&str>) -> Form {
    let holds = |name| array_of(arrays, name).is_some();
    let own = field.and_then(|field| field.split(',').find(|part| !part.contains('=')));
    let is_d = own.map_or(holds("d") && !holds("y"), |field| field == "d");
    if is_d { Form::Differences } else { Form::Pairs }
}

fn array_of<'a>(arrays: &'a [Array], name: &str) -> Option<&'a Array> {
    arrays.iter().find(|array| array.name == name)
}

/// Arrays that may be readings.
fn readings_of(arrays: &[Array]) -> impl Iterator<Item = &Array> {
    arrays.iter().filter(|array| {
        let look = array.numbers.as_ref();
        let varies = look
            .is_some_and(|look| !look.is_counter && look.count >= LEAST && look.levels.is_none());
        varies && !is_long(array) && !NO_READINGS.contains(&&*array.name) && !is_patterns(array)
    })
}
