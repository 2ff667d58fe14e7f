//! The tables of docs/networks.md and docs/log/quality.md that say how good enhanced images are hold the numbers of
//! docs/quality/quality.json, which `nirspi eval quality` has written. `NIRSPI_BLESS=1` writes the tables anew.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::root;
use serde_json::Value;
use std::fmt::Write;

/// Blur in pixels of 64 x 64 and noise of each column of the log's table.
const CONDITIONS: [(f64, f64); 5] = [(1.0, 0.03), (2.0, 0.03), (3.0, 0.03), (2.0, 0.0), (0.0, 0.0)];

const ROWS: [&str; 9] = [
    "Lanczos",
    "Wiener",
    "Richardson-Lucy",
    "total variation",
    "fusion alone",
    "GAN",
    "regression",
    "diffusion, 1 step",
    "diffusion, 4 steps",
];

/// PSNR, SSIM and Fréchet character distance as the tables print them.
fn figures(report: &Value, row: &str, (sigma_px, noise): (f64, f64)) -> [String; 3] {
    let of_all = |condition: &&Value| {
        condition["row"] == row
            && condition["stack"].is_null()
            && condition["sigma_px"] == sigma_px
            && condition["noise"] == noise
    };
    let found = report["conditions"].as_array().unwrap().iter().find(of_all);
    let found = found.unwrap_or_else(|| panic!("no {row} at {sigma_px} px and noise of {noise}"));
    let value = |of: &str| found[of]["value"].as_f64().unwrap();
    let distance = value("frechet_character_distance");
    let digits = if distance >= 9.95 { 0 } else { 1 + usize::from(distance < 1.95) };
    [
        format!("{:.1}", value("psnr_db")),
        format!("{:.3}", value("ssim")),
        format!("{distance:.digits$}"),
    ]
}

/// The log's table: the best of each figure in bold.
fn table_of_the_log(report: &Value) -> String {
    let columns = CONDITIONS.map(|condition| ROWS.map(|row| figures(report, row, condition)));
    let number = |text: &String| text.parse::<f64>().unwrap();
    let best = |column: &[[String; 3]; 9], figure: usize| {
        let all = column.iter().map(|figures| number(&figures[figure]));
        if figure < 2 { all.fold(0.0, f64::max) } else { all.fold(f64::INFINITY, f64::min) }
    };
    let mut table = "\n| row | blur 1 px, noise 3 % | 2 px, 3 % | 3 px, 3 % | 2 px, no noise | no blur, no noise |\n\
                     | -- | -- | -- | -- | -- | -- |\n"
        .to_owned();
    for (at, row) in ROWS.iter().enumerate() {
        write!(table, "| {row} |").unwrap();
        for column in &columns {
            let cell = |figure: usize| {
                let text = &column[at][figure];
                if number(text) == best(column, figure) {
                    format!("**{text}**")
                } else {
                    text.clone()
                }
            };
            write!(table, " {} / {} / {} |", cell(0), cell(1), cell(2)).unwrap();
        }
        table.push('\n');
    }
    table
}

/// The user's table, at 2 px and noise of 3 %.
fn table_of_the_user(report: &Value) -> String {
    let of = |row: &str| figures(report, row, CONDITIONS[1]);
    let psnr = |row: &&&str| of(row)[0].parse::<f64>().unwrap();
    let best = ROWS[1..4].iter().max_by(|a, b| psnr(a).total_cmp(&psnr(b))).unwrap();
    let rows = [
        ("interpolation", "Lanczos"),
        ("the best classical method, which is told blur and noise exactly", *best),
        ("a GAN", "GAN"),
        ("the shipped networks, which are told nothing", "diffusion, 1 step"),
    ];
    let mut table = "\n| method | PSNR | SSIM |\n| -- | -- | -- |\n".to_owned();
    for (words, row) in rows {
        let [psnr_db, ssim, _] = of(row);
        writeln!(table, "| {words} | {psnr_db} dB | {ssim} |").unwrap();
    }
    table
}

#[test]
fn tables_of_quality_hold_the_numbers_of_the_study() {
    const BEGIN: &str = "<!-- table: NIRSPI_BLESS=1 cargo test --test all quality_page -->\n";
    const END: &str = "\n<!-- end of table -->";
    let report = std::fs::read(root().join("docs/quality/quality.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let pages = [
        ("docs/networks.md", table_of_the_user(&report)),
        ("docs/log/quality.md", table_of_the_log(&report)),
    ];
    for (name, wanted) in pages {
        let path = root().join(name);
        let page = std::fs::read_to_string(&path).unwrap();
        let (before, rest) = page.split_once(BEGIN).unwrap();
        let (found, after) = rest.split_once(END).unwrap();
        if std::env::var_os("NIRSPI_BLESS").is_some() {
            std::fs::write(&path, format!("{before}{BEGIN}{wanted}{END}{after}")).unwrap();
        } else {
            assert_eq!(found, wanted, "{name}: NIRSPI_BLESS=1 writes it anew");
        }
    }
}
