//! `docs/report.md` is what the sources say of the fields of `report.json`, and real reports have these fields and no others.
//! `NIRSPI_BLESS=1` writes the page.

use crate::bench::{Bench, Measured};
use nirspi::files::npy;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

const HEAD: &str = "\
# report.json

<!-- Written by host/cli/tests/cli/report_page.rs: NIRSPI_BLESS=1 cargo test -p nirspi-cli --test cli report_page -->

`nirspi reconstruct` and `nirspi capture --picture` write `report.json` beside their images, and `--json` prints the same. This
page has all its fields; a test reads real reports by it. A field that is *optional* is left out where there is nothing to say.
Numbers in the report are those that made the images, unrounded.
";

/// What `method` and the section beside it are: written by hand in `MethodReport`.
const METHOD: &str = "\
The field `method` has the method's name on the command line. A section beside it has the fields below. Its name is that of
the method too, or `penalty` for a method with a strength; a method with nothing to say has no section.
";

/// A structure of the sources, as a section of the page.
struct Section {
    /// Its name in the sources.
    name: &'static str,
    /// The file that has it.
    file: &'static str,
    /// The heading.
    heading: &'static str,
    /// What stands before the table.
    about: &'static str,
}

const fn section(
    name: &'static str,
    file: &'static str,
    heading: &'static str,
    about: &'static str,
) -> Section {
    Section { name, file, heading, about }
}

const SECTIONS: [Section; 17] = [
    section(
        "OneReport",
        "host/src/reconstruct/one.rs",
        "One image",
        "One measurement, or the sum of a recording's frames.\n",
    ),
    section(
        "StackReport",
        "host/src/reconstruct/stack.rs",
        "A stack",
        "All measurements of a file, or many files.\n",
    ),
    section("ImageReport", "host/src/reconstruct/stack.rs", "Image of a stack", ""),
    section(
        "OwnReport",
        "host/src/reconstruct/own.rs",
        "Patterns of your own",
        "With `--matrix`. The fields under *How it was made* stand among these; of all measurements of a file, `frames` has them for\neach.\n",
    ),
    section("OwnMade", "host/src/reconstruct/own.rs", "How it was made", ""),
    section("Details", "host/src/imaging/method_report.rs", "Method", METHOD),
    section("HeldBackReport", "host/src/imaging/method_report.rs", "Held-back readings", ""),
    section(
        "FrameReport",
        "host/src/imaging/frames.rs",
        "Enhancement",
        "What the networks say of an image, with `--enhance`.\n",
    ),
    section("DropoutReport", "host/src/reconstruct/one.rs", "Lost readings", ""),
    section("OutlierReport", "host/src/source.rs", "Reading that light cannot have given", ""),
    section("LampReport", "host/src/reconstruct/one.rs", "Lamp", ""),
    section("LossCounters", "host/camera/src/account.rs", "Account of frames", ""),
    section("Skipped", "host/src/reconstruct/many.rs", "File without an image", ""),
    section("Entry", "host/picture/src/report.rs", "Picture", ""),
    section("Shown", "host/picture/src/report.rs", "Image in a picture", ""),
    section(
        "Provenance",
        "host/files/src/provenance.rs",
        "Provenance",
        "Who measured, and who made the images: `provenance` of every report.\n",
    ),
    section("Camera", "host/files/src/provenance.rs", "Camera", ""),
];

/// Structures without a section, whose fields stand among those of others.
const AMONG_OTHERS: [(&str, &str); 4] = [
    ("OwnInput", "host/src/reconstruct/own.rs"),
    ("Scale", "host/picture/src/scale.rs"),
    ("Taken", "host/files/src/provenance.rs"),
    ("Made", "host/files/src/provenance.rs"),
];

#[derive(Debug, Clone)]
struct Field {
    name: String,
    /// Its type in the sources.
    of: String,
    meaning: String,
    optional: bool,
}

/// What a field holds besides numbers, texts and lists of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Holds {
    Plain,
    One(&'static str),
    List(&'static str),
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The fields of a structure as they stand in JSON, those of flattened structures among them.
fn fields(name: &str, file: &str) -> Vec<Field> {
    let text = fs::read_to_string(root().join(file)).unwrap();
    let start = text.lines().position(|line| {
        let rest = line.strip_prefix("pub ").unwrap_or(line).strip_prefix("struct ");
        rest.and_then(|rest| rest.strip_prefix(name))
            .is_some_and(|rest| rest.starts_with([' ', '<']))
    });
    let lines = text.lines().skip(start.unwrap_or_else(|| panic!("{name} in {file}")) + 1);
    let (mut all, mut meaning, mut attributes) = (Vec::new(), String::new(), String::new());
    for line in lines.take_while(|line| *line != "}").map(str::trim) {
        if let Some(doc) = line.strip_prefix("///") {
            write!(meaning, " {}", doc.trim()).unwrap();
        } else if line.starts_with('#') {
            attributes += line;
        } else if let Some((field, of)) = line.trim_end_matches(',').split_once(": ") {
            let meaning = std::mem::take(&mut meaning).trim().to_owned();
            let attributes = std::mem::take(&mut attributes);
            let (field, of) = (field.trim_start_matches("pub "), of.to_owned());
            if attributes.contains("flatten") {
                all.extend(flattened(&of));
            } else if !attributes.contains("serde(skip)") {
                assert!(!meaning.is_empty(), "{name}::{field} says nothing of itself");
                let optional = attributes.contains("skip_serializing_if");
                all.push(Field { name: field.to_owned(), of, meaning, optional });
            }
        }
    }
    all
}

fn by_hand(name: &str, of: &str, meaning: &str) -> Field {
    let optional = of.starts_with("Option<");
    let [name, of, meaning] = [name, of, meaning].map(str::to_owned);
    Field { name, of, meaning, optional }
}

/// The fields of a structure that stand among those of another one.
fn flattened(of: &str) -> Vec<Field> {
    let of = of.trim_start_matches("&'i ");
    match of {
        "MethodReport" => {
            return vec![by_hand(
                "method",
                "String",
                "The method, with a [section](#method) beside it.",
            )];
        }
        "OwnFrames" => return Vec::new(),
        _ => {}
    }
    let section = SECTIONS.iter().find(|section| section.name == of);
    let file = section.map(|section| section.file);
    let other = AMONG_OTHERS.iter().find(|(name, _)| *name == of).map(|(_, file)| *file);
    fields(of, file.or(other).unwrap_or_else(|| panic!("{of} has no section")))
}

fn holds(of: &str) -> Holds {
    let inner =
        of.trim_start_matches("Option<").trim_start_matches("Vec<").trim_start_matches("&'i [");
    let inner = inner.trim_end_matches(['>', ']']);
    let named = |name: &str| SECTIONS.iter().find(|section| section.name == name).map(|s| s.name);
    match of {
        "FrameReports" => Holds::List("ImageReport"),
        "Pictures" => Holds::List("Entry"),
        _ => match named(inner) {
            Some(name) if of.contains(['[']) || of.contains("Vec<") => Holds::List(name),
            Some(name) => Holds::One(name),
            None => Holds::Plain,
        },
    }
}

/// The type of a field in words, with a link to its section.
fn in_words(of: &str) -> String {
    let link = |name: &str| {
        let heading = SECTIONS.iter().find(|section| section.name == name).unwrap().heading;
        let place = heading.to_lowercase().replace(' ', "-");
        format!("[{}](#{place})", heading.to_lowercase())
    };
    match holds(of) {
        Holds::One(name) => return link(name),
        Holds::List(name) => return format!("list: {}", link(name)),
        Holds::Plain => {}
    }
    let plain = of.trim_start_matches("Option<").trim_end_matches('>');
    match plain {
        "usize" | "u64" | "u32" | "u16" => "whole number",
        "f64" | "f32" => "number",
        "bool" => "true or false",
        "[f64; 2]" => "two numbers",
        "Vec<usize" | "Vec<u32" => "list of whole numbers",
        "Vec<String" | "&'i [String]" => "list of texts",
        "StageTimes" => "milliseconds by name",
        "String" | "PathBuf" | "&'i Path" | "Method" | "Unit" | "Origin" | "&'static str"
        | "&'r str" => "text",
        _ => panic!("no word for {of}"),
    }
    .to_owned()
}

/// The fields of each section.
fn schema() -> BTreeMap<&'static str, Vec<Field>> {
    let of = |section: &Section| (section.name, fields(section.name, section.file));
    let mut all: BTreeMap<&'static str, Vec<Field>> = SECTIONS.iter().map(of).collect();
    let mut add = |name, field| all.get_mut(name).unwrap().push(field);
    // Joined to a report that is on the disk already.
    add("ImageReport", by_hand("enhancement", "Option<FrameReport>", "What the networks report."));
    for name in ["OneReport", "StackReport", "OwnReport"] {
        add(name, by_hand("provenance", "Provenance", "Who measured, and what made the images."));
    }
    all
}

fn page(schema: &BTreeMap<&'static str, Vec<Field>>, example: &str) -> String {
    let mut page = HEAD.to_owned();
    for section in &SECTIONS {
        write!(page, "\n## {}\n\n", section.heading).unwrap();
        if !section.about.is_empty() {
            writeln!(page, "{}", section.about).unwrap();
        }
        page += "| field | holds | meaning |\n| -- | -- | -- |\n";
        for field in &schema[section.name] {
            let optional = if field.optional { ", optional" } else { "" };
            let null =
                if !field.optional && field.of.starts_with("Option<") { ", or `null`" } else { "" };
            let missing = if field.optional { "; left out if" } else { "; `null` if" };
            let meaning = field.meaning.replace('|', "\\|").replace("; `None` if", missing);
            let words = in_words(&field.of);
            writeln!(page, "| `{}` | {words}{optional}{null} | {meaning} |", field.name).unwrap();
        }
    }
    page + "\n## Example\n\nThe report of `nirspi reconstruct a.npz --method hadamard --out out`:\n\n```json\n"
        + example
        + "```\n"
}

/// Compares a part of a report with its section.
fn check(of: &str, found: &Value, schema: &BTreeMap<&'static str, Vec<Field>>) {
    let found: &Map<String, Value> = found.as_object().unwrap_or_else(|| panic!("{of}: {found}"));
    let has_method = ["OneReport", "ImageReport"].contains(&of);
    let mut fields = schema[of].clone();
    if of == "OwnReport" {
        match found.get("frames") {
            Some(_) => fields.push(by_hand("frames", "Vec<OwnMade>", "")),
            None => fields.extend(schema["OwnMade"].clone()),
        }
    }
    for field in fields.iter().filter(|field| !field.optional) {
        assert!(found.contains_key(&field.name), "{of} without {}: {found:?}", field.name);
    }
    for (name, value) in found {
        if has_method && (Some(name.as_str()) == found["method"].as_str() || name == "penalty") {
            check("Details", value, schema);
            continue;
        }
        let field = fields.iter().find(|field| field.name == *name);
        let field = field.unwrap_or_else(|| panic!("{of}: {name} is on no list"));
        match holds(&field.of) {
            Holds::Plain => {}
            Holds::One(of) if value.is_null() => assert!(field.of.starts_with("Option"), "{of}"),
            Holds::One(of) => check(of, value, schema),
            Holds::List(of) => {
                value.as_array().unwrap().iter().for_each(|one| check(of, one, schema));
            }
        }
    }
}

#[test]
fn the_page_of_reports_has_the_fields_of_reports() {
    let (bench, schema) = (Bench::new(), schema());
    bench.write("a.npz", &Measured::new(8).npz());
    let simple = ["reconstruct", "a.npz", "--method", "hadamard", "--out", "out"];
    let example = bench.run_with(&[("SOURCE_DATE_EPOCH", "1764059400")], &simple);
    example.succeeded();
    let mut report = bench.json("out/report.json");
    check("OneReport", &report, &schema);
    // What differs from run to run, and from build to build.
    report["provenance"]["commit"] = Value::Null;
    for (_, ms) in report["stage_ms"].as_object_mut().unwrap() {
        *ms = serde_json::json!(1.5);
    }
    report["correlation_with_files_recon"] = serde_json::json!(1.0);
    let expected = page(&schema, &format!("{report:#}\n"));
    let path = root().join("docs/report.md");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        fs::write(&path, &expected).unwrap();
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{} is stale: NIRSPI_BLESS=1 writes it", path.display());
}

#[test]
#[ignore = "long: .ci/run demo"]
fn reports_of_every_kind_have_the_fields_of_the_page() {
    let (bench, schema) = (Bench::new(), schema());
    bench.write("a.npz", &Measured::new(32).npz());
    bench.write("bad.npz", b"PK damaged");
    bench.run(&["example", "wing", "--out", "wing.npz"]).succeeded();
    bench.run(&["capture", "--frames", "4", "--out", "rec.mcap"]).succeeded();
    let report = |arguments: &[&str], of: &str| {
        let told = bench.run(&[&["reconstruct"], arguments, &["--json"]].concat()).json();
        check(of, &told, &schema);
    };
    report(&["wing.npz", "--sampling", "25%", "--enhance", "--out", "b"], "OneReport");
    report(&["a.npz", "--method", "omp", "--sparsity", "9", "--out", "c"], "OneReport");
    // Six readings of 2 x 2, and the same twice.
    let weights = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let weights =
        [&weights[..], &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]].concat();
    bench.write("m.npy", &npy::encode(&[6, 2, 2], &weights));
    let readings = [1.0, 2.0, 3.0, 4.0, 3.1, 9.0];
    bench.write("y.npy", &npy::encode(&[6], &readings));
    bench.write("two.npy", &npy::encode(&[2, 6], &[readings, readings].concat()));
    report(&["y.npy", "--matrix", "m.npy", "--out", "g"], "OwnReport");
    report(&["two.npy", "--matrix", "m.npy", "--index", "all", "--out", "h"], "OwnReport");
    report(&["rec.mcap", "--method", "tikhonov", "--out", "d"], "OneReport");
    report(&["rec.mcap", "--index", "all", "--enhance", "--out", "e"], "StackReport");
    report(&["a.npz", "bad.npz", "wing.npz", "--method", "hadamard", "--out", "f"], "StackReport");
}
