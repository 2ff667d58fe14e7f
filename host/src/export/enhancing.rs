//! The enhanced images of an exported recording, and how well their pixels repeat.

use super::{ExportError, ExportOptions, Whole};
use crate::calibration::FlatField;
use crate::imaging::{
    Enhance, EnhancedImage, ImageContext, KnownReadings, MethodReport, SPREAD_COPIES, White,
};
use nirspi_nets::Device;
use nirspi_recon::reconstruct::{Method, Reconstruction};
use nirspi_recon::{Image, Measurements};

/// What the networks get of an image.
pub(super) struct ForNetworks {
    image: Image,
    readings: Option<KnownReadings>,
}

impl ForNetworks {
    /// Of an image that the default method made of these measurements.
    pub(super) fn of(
        made: &Reconstruction,
        measurements: &Measurements,
        flat_field: Option<&FlatField>,
    ) -> Self {
        let report = MethodReport { method: Method::default(), made: made.report.clone() };
        Self {
            image: FlatField::corrected(flat_field, made.with_readings(measurements)),
            readings: KnownReadings::new(&report, &super::settings(), measurements),
        }
    }
}

/// Enhances the images of a recording with one white level, so that a viewer does not show a
/// flicker.
pub(super) struct Enhancing {
    /// `None` if no enhanced images are asked for.
    enhance: Option<Enhance>,
    /// The white level of each image.
    levels: Vec<f32>,
}

impl Enhancing {
    /// The built-in networks, if the options ask for them.
    pub(super) fn new(options: &ExportOptions) -> Result<Self, ExportError> {
        let enhance = options.enhance.then(|| Enhance::built_in(&Device::cpu())).transpose()?;
        Ok(Self { enhance, levels: Vec::new() })
    }

    /// Takes the white level of an image that will be enhanced.
    pub(super) fn look_at(&mut self, given: &ForNetworks) {
        if self.enhance.is_some() {
            self.levels.push(White::Brightest.level(&given.image));
        }
    }

    /// Enhances an image; `None` if no enhanced images are asked for, or the recording shows no light.
    pub(super) fn enhance(
        &mut self,
        whole: &Whole,
        time_ns: u64,
        given: &ForNetworks,
    ) -> Result<Option<EnhancedImage>, ExportError> {
        let Some(enhance) = &self.enhance else { return Ok(None) };
        self.levels.sort_by(f32::total_cmp);
        let white = self.levels.get(self.levels.len() / 2).copied().unwrap_or(0.0);
        if white <= 0.0 {
            return Ok(None);
        }
        let rows = Some(whole.source.measurements.rows());
        let (readings, copies) = (given.readings, SPREAD_COPIES);
        let context = ImageContext { rows, readings, copies, ..ImageContext::default() };
        let path = whole.path.clone();
        let problem = |problem| ExportError::Enhance { path, time_ns, problem };
        Ok(Some(enhance.enhance(&given.image, White::Known(white), &context).map_err(problem)?))
    }
}
