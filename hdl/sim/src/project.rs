//! Reads, checks and emits the Veryl sources, and prepares them for simulation. A warning of
//! Veryl's analyser is an error here.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    path::{Path, PathBuf},
    rc::Rc,
};
use veryl_analyzer::{Analyzer, Context, attribute_table, ir as air, symbol_table};
use veryl_emitter::Emitter;
use veryl_formatter::Formatter;
use veryl_metadata::Metadata;
use veryl_parser::Parser;
use veryl_simulator::{Config, Simulator, ir};

/// Texts of the sources, by file name without extension.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Project(pub BTreeMap<String, String>);

thread_local! {
    /// What this thread has analysed last, and the sources that it stands for. Analysing takes 0.2 s, and the benches of a
    /// deliberate fault simulate the same sources several times. Veryl's tables belong to a thread, so this does too.
    static ANALYSED: RefCell<Option<(Project, Rc<air::Ir>)>> = const { RefCell::new(None) };
}

/// A folder of `hdl/`.
#[must_use]
pub fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

/// Name without extension and text of every file in a folder; empty if the folder does not exist.
///
/// # Panics
/// On a file that is not text.
#[must_use]
pub fn files(folder: &Path) -> BTreeMap<String, String> {
    let mut texts = BTreeMap::new();
    let Ok(entries) = std::fs::read_dir(folder) else { return texts };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        texts.insert(name, std::fs::read_to_string(&path).unwrap());
    }
    texts
}

impl Project {
    /// The sources as committed.
    ///
    /// # Panics
    /// On a file that is not text.
    #[must_use]
    pub fn read() -> Self {
        Self(files(&folder("rtl")))
    }

    /// The sources with one change: in one file, `to` replaces `from`, which must occur exactly
    /// once.
    ///
    /// # Panics
    /// If `from` does not occur exactly once.
    #[must_use]
    pub fn with(&self, file: &str, from: &str, to: &str) -> Self {
        let mut changed = self.clone();
        let text = changed.0.get_mut(file).unwrap_or_else(|| panic!("no {file}.veryl"));
        assert_eq!(text.matches(from).count(), 1, "{from:?} must be once in {file}.veryl");
        *text = text.replace(from, to);
        changed
    }

    fn analyse(&self) -> (Metadata, Vec<(&str, &str, Parser)>, air::Ir) {
        // It refers to the tables that are cleared here.
        ANALYSED.take();
        symbol_table::clear();
        attribute_table::clear();
        let metadata = Metadata::create_default("nirspi").unwrap();
        let analyzer = Analyzer::new(&metadata);
        let mut errors = Vec::new();
        let mut parsed = Vec::new();
        for (name, text) in &self.0 {
            let path = folder("rtl").join(format!("{name}.veryl"));
            let parser = Parser::parse(text, &path)
                .unwrap_or_else(|e| panic!("{name}: {:?}", miette::Report::from(e)));
            errors.extend(analyzer.analyze_pass1("nirspi", &parser.veryl));
            parsed.push((name.as_str(), text.as_str(), parser));
        }
        errors.extend(Analyzer::analyze_post_pass1());
        let mut context = Context::default();
        let mut ir = air::Ir::default();
        for (_, _, parser) in &parsed {
            errors.extend(analyzer.analyze_pass2(&parser.veryl, &mut context, Some(&mut ir)));
        }
        errors.extend(Analyzer::analyze_post_pass2(&ir));
        let errors: Vec<_> =
            errors.into_iter().map(|e| format!("{:?}", miette::Report::new(e))).collect();
        assert!(errors.is_empty(), "{}", errors.join("\n"));
        (metadata, parsed, ir)
    }

    /// The SystemVerilog of every file.
    ///
    /// # Panics
    /// On any error or warning of parser or analyser.
    #[must_use]
    pub fn emit(&self) -> BTreeMap<String, String> {
        let (metadata, parsed, _) = self.analyse();
        parsed
            .into_iter()
            .map(|(name, text, parser)| {
                let file = |extension| PathBuf::from(format!("{name}.{extension}"));
                let (from, to, map) = (file("veryl"), file("sv"), file("sv.map"));
                let mut emitter = Emitter::new(&metadata, "nirspi", &from, &to, &map);
                emitter.emit(&parser.veryl, text);
                let lines = emitter.as_str().lines();
                let lines = lines.filter(|line| !line.starts_with("//# sourceMappingURL"));
                (name.to_owned(), lines.map(|line| format!("{}\n", line.trim_end())).collect())
            })
            .collect()
    }

    /// Every file in the form that `veryl fmt` gives it.
    ///
    /// # Panics
    /// On any error or warning of parser or analyser.
    #[must_use]
    pub fn format(&self) -> BTreeMap<String, String> {
        let (metadata, parsed, _) = self.analyse();
        let format = |(name, text, parser): (&str, &str, Parser)| {
            let mut formatter = Formatter::new(&metadata);
            formatter.format(&parser.veryl, text);
            (name.to_owned(), formatter.as_str().to_owned())
        };
        parsed.into_iter().map(format).collect()
    }

    /// One module, prepared for simulation.
    ///
    /// # Panics
    /// On any error or warning of parser, analyser or simulator.
    #[must_use]
    pub fn simulate(&self, top: &str) -> Simulator {
        let analysed = ANALYSED.take().filter(|(project, _)| project == self);
        let ir = analysed.map_or_else(|| Rc::new(self.analyse().2), |(_, ir)| ir);
        ANALYSED.set(Some((self.clone(), ir.clone())));
        let config = Config { use_jit: true, ..Config::default() };
        Simulator::new(ir::build_ir(&ir, top.into(), &config).unwrap(), None)
    }
}
