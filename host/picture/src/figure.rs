//! A figure: images with their titles, charts, and several of these in columns. A figure is written
//! as PNG, SVG and PDF, and its curves as CSV.
//!
//! # Invariant
//! The CSV holds every point of every curve
//! (`tests::the_csv_holds_every_point_of_every_curve`). Charts that say the same below their frames
//! say it once (`tests::charts_with_one_legend_show_it_once`).

use super::chart::{Below, Chart, Line};
use super::drawing::Drawing;
use super::layout::SideBySide;
use super::look::{FigureStyle, Look};
use super::signature::signed;
use nirspi_files::FileError;
use nirspi_files::image::{encode_labelled, encode_rgb};
use nirspi_files::output::{Existing, OutputDir, write_result};
use nirspi_files::provenance::Provenance;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What a figure shows.
#[derive(Debug, Clone, PartialEq)]
pub enum Figure {
    /// Images.
    Images(SideBySide),
    /// A chart.
    Chart(Chart),
    /// Figures in rows of so many.
    Grid(usize, Vec<Figure>),
}

impl From<SideBySide> for Figure {
    fn from(images: SideBySide) -> Self {
        Self::Images(images)
    }
}

impl From<Chart> for Figure {
    fn from(chart: Chart) -> Self {
        Self::Chart(chart)
    }
}

/// The least width of a figure in a grid, in sixteenths of the text's size.
const LEAST: u32 = 320;

impl Figure {
    /// These figures below each other.
    #[must_use]
    pub fn column(figures: impl IntoIterator<Item = impl Into<Self>>) -> Self {
        Self::grid(1, figures)
    }

    /// These figures in rows of at most so many.
    #[must_use]
    pub fn grid(columns: usize, figures: impl IntoIterator<Item = impl Into<Self>>) -> Self {
        Self::Grid(columns.max(1), figures.into_iter().map(Into::into).collect())
    }

    /// Draws the figure without its provenance.
    ///
    /// # Panics
    /// If a row of images has no image, or an image does not have exactly `width * height` values.
    #[must_use]
    pub fn draw(&self, look: &Look) -> Drawing {
        let width = match self {
            Self::Images(images) => images.width(look),
            Self::Chart(_) | Self::Grid(..) => look.width(),
        };
        self.draw_in(look, width, Below { legend: true, footer: true })
    }

    fn draw_in(&self, look: &Look, width: u32, below: Below) -> Drawing {
        match self {
            Self::Images(images) => images.draw(look, width).0,
            Self::Chart(chart) => chart.draw(look, width, below),
            Self::Grid(columns, figures) => {
                let columns = (*columns).min((width / look.px(LEAST)).max(1) as usize);
                grid(look, width, columns, figures)
            }
        }
    }

    /// The figure as a PNG with its provenance. Readers of this program find the image of a single
    /// panel in the picture, and refuse a picture of several.
    ///
    /// # Panics
    /// As [`draw`](Self::draw).
    #[must_use]
    pub fn png(&self, look: &Look, provenance: &Provenance) -> Vec<u8> {
        match self {
            Self::Images(images) => {
                let (drawing, placed) = images.draw(look, images.width(look));
                let picture = signed(drawing, look, provenance).raster();
                encode_labelled(&picture, images.panels.len(), placed, provenance)
            }
            Self::Chart(_) | Self::Grid(..) => {
                encode_rgb(&signed(self.draw(look), look, provenance).raster(), provenance)
            }
        }
    }

    /// The figure as files: endings and bytes of PNG, SVG and PDF, and of a CSV if there is a chart.
    ///
    /// # Panics
    /// As [`draw`](Self::draw).
    #[must_use]
    pub fn files(
        &self,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Vec<(&'static str, Vec<u8>)> {
        let look = style.look();
        let drawing = signed(self.draw(&look), &look, provenance);
        let mut files = drawing.files(self.png(&look, provenance), provenance);
        files.extend(self.csv(provenance).map(|csv| ("csv", csv.into_bytes())));
        files
    }

    /// Stages the files of the figure, `NAME.png` and beside it the others, in a folder.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason.
    ///
    /// # Panics
    /// As [`draw`](Self::draw).
    pub fn write(
        &self,
        out: &mut OutputDir,
        name: &str,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Result<(), FileError> {
        let mut files = self.files(style, provenance).into_iter();
        files.try_for_each(|(ending, bytes)| out.write(&format!("{name}.{ending}"), &bytes))
    }

    /// The files that a chart `NAME.png` has, itself included.
    #[must_use]
    pub fn paths_of_chart(png: &Path) -> [PathBuf; 4] {
        ["png", "svg", "pdf", "csv"].map(|ending| png.with_extension(ending))
    }

    /// Writes the files of the figure beside each other: the PNG of this name, and the same with
    /// other endings.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason.
    ///
    /// # Panics
    /// As [`draw`](Self::draw).
    pub fn write_files(
        &self,
        png: &Path,
        existing: Existing<'_>,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Result<(), FileError> {
        let mut files = self.files(style, provenance).into_iter();
        files.try_for_each(|(ending, bytes)| {
            write_result(&png.with_extension(ending), existing, &bytes)
        })
    }

    /// The points of all curves, a row each; `None` without a chart.
    #[must_use]
    pub fn csv(&self, provenance: &Provenance) -> Option<String> {
        let charts = self.charts();
        if charts.is_empty() {
            return None;
        }
        let mut csv =
            format!("# provenance: {}\nchart,curve,x axis,y axis,x,y\n", provenance.json());
        for chart in charts {
            for line in &chart.lines {
                let texts = [&chart.header, &line.name, &chart.x.name, &chart.y.name];
                let texts = texts.map(|text| quoted(text)).join(",");
                for (x, y) in line.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()) {
                    // A `String` takes everything.
                    let _ = writeln!(csv, "{texts},{x},{y}");
                }
            }
        }
        Some(csv)
    }

    /// All charts of the figure, in order.
    #[must_use]
    pub fn charts(&self) -> Vec<&Chart> {
        match self {
            Self::Images(_) => Vec::new(),
            Self::Chart(chart) => vec![chart],
            Self::Grid(_, figures) => figures.iter().flat_map(Self::charts).collect(),
        }
    }
}

fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"").replace(['\n', '\r'], " ")),
        false => text.to_owned(),
    }
}

/// Figures in rows. What all charts say below their frames stands once, below the last row.
fn grid(look: &Look, width: u32, columns: usize, figures: &[Figure]) -> Drawing {
    let charts: Vec<&Chart> = figures
        .iter()
        .filter_map(|figure| if let Figure::Chart(chart) = figure { Some(chart) } else { None })
        .collect();
    let several = charts.len() > 1 && charts.len() == figures.len();
    let one_legend =
        several && charts.iter().all(|chart| chart.legend_of() == charts[0].legend_of());
    let one_footer = several && charts.iter().all(|chart| chart.footer == charts[0].footer);
    let below = Below { legend: !one_legend, footer: !one_footer };
    let cell = width / columns as u32;
    let mut canvas = Drawing::new(look, width, 0);
    for row in figures.chunks(columns) {
        let drawn = row.iter().map(|figure| figure.draw_in(look, cell, below));
        let top = canvas.height;
        for (column, drawing) in drawn.enumerate() {
            canvas.height = canvas.height.max(top + drawing.height);
            canvas.place(drawing, column as u32 * cell, top);
        }
    }
    if let Some(first) = charts.first() {
        // Points are marked in the legend if they are in a chart, which the fullest line decides.
        let lines: Vec<Line> = (0..first.lines.len())
            .filter_map(|k| {
                charts.iter().filter_map(|chart| chart.lines.get(k)).max_by_key(|l| l.points.len())
            })
            .cloned()
            .collect();
        let shared = Chart { lines, ..(*first).clone() };
        if one_legend {
            let legend = shared.legend(look, width);
            let top = canvas.height;
            canvas.height += legend.height;
            canvas.place(legend, 0, top);
        }
        if one_footer {
            let footer = shared.source(look, width);
            let top = canvas.height;
            canvas.height += footer.height;
            canvas.place(footer, 0, top);
        }
    }
    canvas.height = canvas.height.max(1);
    canvas
}

#[cfg(test)]
mod tests;
