//! The images of a simulated capture side by side, from the scene to the deblurred image and its
//! uncertainty.
//!
//! # Invariant
//! All panels show the camera's field, so that the scene and its images have one scale, and all
//! images are drawn on one scale of grey: 0 is black, the white sheet is white
//! (`all_panels_show_one_field_on_one_scale` in `host/cli/tests/cli/demo.rs`).

use super::{Stages, VirtualOptics};
use nirspi::capture::Capture;
use nirspi::imaging::{MethodReport, Quality};
use nirspi::picture::{FigureStyle, Panel, Pictures, Range, SideBySide, Unit};
use nirspi::provenance::Provenance;
use nirspi::scene::SceneMap;
use nirspi_nets::{deblur, fusion};
use nirspi_recon::Image;
use std::str::FromStr;

/// Edge of the scene in its panel.
pub const SCENE_PX: usize = 256;

/// An image of `side_by_side.png`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The scene.
    Scene,
    /// What a perfect camera with as many LEDs would show.
    Truth,
    /// The plain inverse transform.
    Raw,
    /// The result of the method.
    Result,
    /// The result, enlarged by a network.
    Enlarged,
    /// The enlarged image, deblurred.
    Deblurred,
    /// Where the deblurred image is unsure.
    Uncertainty,
}

impl Shown {
    /// All images, in order.
    pub const ALL: [Self; 7] = [
        Self::Scene,
        Self::Truth,
        Self::Raw,
        Self::Result,
        Self::Enlarged,
        Self::Deblurred,
        Self::Uncertainty,
    ];

    /// The name, as users write it, and what it is.
    #[must_use]
    pub fn named(self) -> (&'static str, &'static str) {
        match self {
            Self::Scene => ("scene", "the scene"),
            Self::Truth => ("limit", "what 32 x 32 LEDs can show"),
            Self::Raw => ("plain", "the plain inverse transform"),
            Self::Result => ("result", "the image by --method"),
            Self::Enlarged => ("enlarged", "the result, enlarged by a network"),
            Self::Deblurred => ("deblurred", "the enlarged image, deblurred"),
            Self::Uncertainty => ("uncertainty", "where the deblurred image is unsure"),
        }
    }
}

impl FromStr for Shown {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|shown| shown.named().0 == name);
        found.ok_or_else(|| format!("{name}: no such panel"))
    }
}

/// What the panels show.
#[derive(Debug)]
pub struct Panels<'a> {
    /// The scene.
    pub map: &'a SceneMap,
    /// The scene as it lies in the camera's field: [`SCENE_PX`] x [`SCENE_PX`] reflectances.
    pub in_field: &'a [f32],
    /// The simulated camera in front of the scene.
    pub optics: &'a VirtualOptics,
    /// The capture.
    pub capture: &'a Capture,
    /// Time of light.
    pub acquisition_ms: f64,
    /// The weather between camera and scene.
    pub rain: &'a str,
    /// Seed of the noise.
    pub seed: u64,
    /// The image of a perfect camera with as many LEDs.
    pub truth: &'a [f32],
    /// The plain inverse transform, in shares of white.
    pub raw: (&'a Image, &'a Quality),
    /// The result of the method, in shares of white.
    pub result: (&'a Image, &'a Quality),
    /// The method.
    pub method: &'a MethodReport,
    /// The learned stages.
    pub stages: &'a Stages,
}

impl Panels<'_> {
    /// `side_by_side.png` of these panels, with SVG and PDF beside it, and each image from the raw
    /// one on as a picture of its own.
    #[must_use]
    pub fn pictures(
        &self,
        shown: &[Shown],
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Pictures {
        let mut pictures = Pictures::new(style, provenance);
        let mut all = self.side_by_side();
        let of = |shown: &Shown| all.panels.get(*shown as usize).cloned();
        let panels: Vec<Panel> = shown.iter().filter_map(of).collect();
        // Without intervals there is no last panel.
        let panels = if panels.is_empty() { all.panels.clone() } else { panels };
        pictures.add("side_by_side.png", SideBySide { panels, ..all.clone() });
        all.panels.push(self.panel("upscaled", deblur::SIDE, &self.stages.upscaled, Vec::new()));
        let interval = self.stages.half_width.as_ref().map(|_| "interval");
        let names: Vec<&str> = ["raw", "reconstruction", "fused", "deblurred"]
            .into_iter()
            .chain(interval)
            .chain(["upscaled"])
            .collect();
        pictures.each(&names, &all.panels[2..]);
        pictures
    }

    /// A panel of the camera's field, from black to the white sheet.
    fn panel(&self, title: &str, side: usize, values: &[f32], caption: Vec<String>) -> Panel {
        Panel {
            caption,
            range: Range::Unit,
            field_mm: Some(self.optics.field_mm()),
            ..Panel::square(title, side, values, Unit::OfWhite)
        }
    }

    fn side_by_side(&self) -> SideBySide {
        let (map, counters) = (self.map, &self.capture.counters);
        let setup = &self.capture.setup;
        let (patterns, sweeps) = (setup.rows.len(), setup.sweeps);
        let distance_m = self.optics.distance_mm() / 1e3;
        let field_mm = self.optics.field_mm();
        let enhancement = &self.stages.report;
        let size = map.side_mm.map_or_else(
            || format!("fills the field, {field_mm:.0} mm"),
            |mm| format!("{mm:.0} mm target in a field of {field_mm:.0} mm"),
        );
        let reference = "the reference, no defocus, no noise".to_owned();
        let transform = format!("hadamard, {patterns} patterns");
        let network = format!("FSRCNN, {} depth zones", enhancement.depth_zones);
        let bridge = format!("bridge, 1 step; inconsistency {:.2}", enhancement.inconsistency);
        let small = |title, values, caption| self.panel(title, fusion::SIDE, values, caption);
        let large = |title, values, caption| self.panel(title, deblur::SIDE, values, caption);
        let with = |quality: &Quality, line: String| {
            quality.short().into_iter().chain([line]).collect::<Vec<_>>()
        };
        let mut deblurred = with(&enhancement.deblurred, bridge);
        deblurred.push(enhancement.reading.to_string());
        let uncertainty = self.stages.half_width.as_deref().map(|half_width| Panel {
            range: Range::Fixed(0.0, 0.5),
            ..large("uncertainty: bright is unsure", half_width, enhancement.uncertainty())
        });
        let truth = Panel {
            unit: Unit::Reflectance,
            ..small("what 32 x 32 LEDs can show", self.truth, vec![reference])
        };
        let scene = Panel {
            unit: Unit::Reflectance,
            ..self.panel("scene", SCENE_PX, self.in_field, vec![size])
        };
        let (raw, result) = (self.raw, self.result);
        let mut made = SideBySide {
            header: format!("{} at {distance_m} m, seen with one pixel", map.title()),
            panels: vec![
                scene,
                truth,
                small("plain transform", raw.0.pixels(), with(raw.1, transform)),
                small("result", result.0.pixels(), with(result.1, self.method.short())),
                large(
                    "enlarged by a network",
                    &self.stages.fused,
                    with(&enhancement.fused, network),
                ),
                Panel {
                    warnings: enhancement.short_warnings.clone(),
                    ..large("deblurred", &self.stages.deblurred, deblurred)
                },
            ],
            footer: format!(
                "simulated: virtual camera, weather {}, seed {}; {} frames of {sweeps} sweeps of {patterns} patterns, {:.1} ms of light; \
                 {} lost, {} corrupt, {} late. One scale of grey for all images: 0 is black, the white sheet measured at this distance is white; PSNR on a 32 x 32 grid \
                 up to the result, on 64 x 64 after it",
                self.rain,
                self.seed,
                counters.received,
                self.acquisition_ms,
                counters.lost,
                counters.corrupt,
                counters.late
            ),
        };
        made.panels.extend(uncertainty);
        made
    }
}
