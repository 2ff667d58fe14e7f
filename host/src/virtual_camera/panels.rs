//! The images of a simulated capture side by side, from the scene to the deblurred image and its
//! uncertainty.

use super::{Stages, VirtualOptics};
use crate::capture::Capture;
use crate::imaging::{Fitted, MethodReport, Quality};
use crate::picture::{Panel, Pictures, Range, SideBySide, Unit};
use crate::provenance::Provenance;
use crate::scene::SceneMap;
use nirspi_nets::{deblur, fusion};

/// What the panels show.
#[derive(Debug)]
pub struct Panels<'a> {
    /// The scene.
    pub map: &'a SceneMap,
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
    /// The plain inverse transform.
    pub raw: &'a Fitted,
    /// The result of the method.
    pub result: &'a Fitted,
    /// The method.
    pub method: &'a MethodReport,
    /// The learned stages.
    pub stages: &'a Stages,
}

impl Panels<'_> {
    /// `side_by_side.png`, and each image from the raw one on as a picture of its own.
    #[must_use]
    pub fn pictures(&self, provenance: &Provenance) -> Pictures {
        let mut pictures = Pictures::new(provenance);
        let mut all = self.side_by_side();
        pictures.add("side_by_side.png", &all);
        all.panels.push(panel("upscaled", deblur::SIDE, &self.stages.upscaled, Vec::new()));
        let interval = self.stages.half_width.as_ref().map(|_| "interval");
        let names: Vec<&str> = ["raw", "reconstruction", "fused", "deblurred"]
            .into_iter()
            .chain(interval)
            .chain(["upscaled"])
            .collect();
        pictures.each(&names, &all.panels[2..]);
        pictures
    }

    fn side_by_side(&self) -> SideBySide {
        let (map, counters) = (self.map, &self.capture.counters);
        let patterns = self.capture.setup.rows.len();
        let distance_m = self.optics.distance_mm() / 1e3;
        let field_mm = self.optics.field_mm();
        let enhancement = &self.stages.report;
        let size = map.side_mm.map_or_else(
            || format!("fills the field, {field_mm:.0} mm"),
            |mm| format!("{mm:.0} mm target in a field of {field_mm:.0} mm"),
        );
        let reference = "the reference, no defocus, no noise".to_owned();
        let transform = format!("inverse transform, {patterns} patterns");
        let network = format!("FSRCNN, {} depth zones", enhancement.depth_zones);
        let bridge = format!("bridge, 1 step; inconsistency {:.2}", enhancement.inconsistency);
        let small = |title, values, caption| panel(title, fusion::SIDE, values, caption);
        let large = |title, values, caption| panel(title, deblur::SIDE, values, caption);
        let deblurred =
            vec![metrics(&enhancement.deblurred), bridge, enhancement.reading.to_string()];
        let uncertainty = self.stages.half_width.as_deref().map(|half_width| Panel {
            range: Range::Fixed(0.0, 0.5),
            ..large("uncertainty: bright is unsure", half_width, enhancement.trust())
        });
        let mut made = SideBySide {
            header: format!("{} at {distance_m} m, seen with one pixel", map.title()),
            panels: vec![
                panel("scene", map.size_px, &map.reflectance, vec![size]),
                small("what 32 x 32 LEDs can show", self.truth, vec![reference]),
                small(
                    "raw reconstruction",
                    &self.raw.values,
                    vec![metrics(&self.raw.quality), transform],
                ),
                small(
                    "result",
                    &self.result.values,
                    vec![metrics(&self.result.quality), self.method.short()],
                ),
                large(
                    "enlarged by a network",
                    &self.stages.fused,
                    vec![metrics(&enhancement.fused), network],
                ),
                Panel {
                    warnings: enhancement.short_warnings.clone(),
                    ..large("deblurred", &self.stages.deblurred, deblurred)
                },
            ],
            footer: format!(
                "simulated: virtual camera, weather {}, seed {}; {} frames of {patterns} patterns, {:.1} ms of light; {} lost, {} corrupt, {} late",
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

fn panel(title: &str, side: usize, values: &[f32], caption: Vec<String>) -> Panel {
    Panel { caption, ..Panel::square(title, side, values, Unit::Reflectance) }
}

fn metrics(quality: &Quality) -> String {
    format!("PSNR {:.1} dB  SSIM {:.2}", quality.psnr_db, quality.ssim)
}
