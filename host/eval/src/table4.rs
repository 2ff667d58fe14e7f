//! Spatial resolution in rain, compared with the paper's Table 4: NIR-SPI, VIS and networks, in mm
//! on the target.
//!
//! The figures are the width of a line at which the transfer of a slanted edge falls to a half
//! (MTF50) and to a tenth (MTF10), and the finest bars that keep a tenth of their contrast. Rain
//! and noise differ in every picture. The transfer is that of all pictures of the edge together,
//! without the power of the noise, so more pictures narrow an interval without a bias. The
//! resolution of the lens by geometry is given for comparison.

use crate::DISTANCES_M;
use crate::error::Result;
use crate::estimate::Estimate;
use crate::pictures::{Enhancers, Picture};
use crate::resolution::{
    bar_scene, bar_transfer, disc_transfer, edge_mtf, edge_scene, line_width_px, square_transfer,
};
use crate::shot::{CalibratedCamera, Conditions, Exposure, Settings, Shots};
use nirspi::picture::{Axis, Chart, Line};
use nirspi_optics::{CameraModel, Projector, Scene};
use rayon::prelude::*;
use serde::Serialize;

/// Number of groups of pictures of the edge. Each group is left out once, and the spread of the
/// results gives the interval.
const GROUPS: usize = 10;

/// Number of averaged pictures of each bar width.
const BAR_PICTURES: u32 = 10;

/// The tested bar widths, in pixels of the grid.
const BARS_PX: [f64; 10] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];

/// The contrast that resolved bars keep.
const RESOLVED: f64 = 0.1;

/// Edge of the drawn scenes, in pixels per field.
const SCENE_PX: usize = 512;

/// Width of a scene in fields. The edge and the bars extend beyond the field by more than the
/// radius of the lens's disc, so that only the edge affects its measurement.
const SCENE_FIELDS: usize = 2;

/// The paper's rows, in mm. The paper's diffusion model is the ancestral sampler, with which
/// nirspi's networks are compared.
const PAPER: [(Picture, [f64; 3]); 6] = [
    (Picture::Vis, [45.0, 48.0, 60.0]),
    (Picture::NirSpi, [5.0, 25.0, 45.0]),
    (Picture::Gan, [5.0, 18.0, 40.0]),
    (Picture::Regression, [5.0, 15.0, 25.0]),
    (Picture::Diffusion, [5.0, 15.0, 25.0]),
    (Picture::Ancestral, [5.0, 15.0, 25.0]),
];

/// The basis of the figures.
fn reading(camera: &CameraModel) -> Vec<String> {
    let projector = camera.projector();
    let of = |length: fn(&Projector, f64) -> f64| {
        DISTANCES_M.map(|m| format!("{:.1}", length(&projector, m * 1e3))).join(", ")
    };
    vec![
        format!(
            "NIR-SPI: a pixel is {} mm wide and the lens's defocus disc {} mm. Aperture and focus, which the paper does not \
             give, were chosen so that the disc grows as its 5, 25, 45 mm do: that the two are alike shows nothing",
            of(|p, mm| p.field_mm(mm) / 32.0),
            of(Projector::blur_mm)
        ),
        "VIS: a focused camera on the same grid; the paper's 45 to 60 mm are coarser than its 43 mm letters".to_owned(),
        "networks: on their own grid of 64 x 64. They are not linear, and know edges: what they make of one edge or of \
         bars is no promise for finer things, and bars that are gone stay gone"
            .to_owned(),
        "lens: what disc and emitter let through by geometry, without rain, noise or sampling".to_owned(),
        "±: 95 %, by leaving out each tenth of the pictures once (jackknife, t of 9 degrees of freedom)".to_owned(),
        "what rain does to these: compare with --rain none".to_owned(),
    ]
}

/// Resolution, row by row.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The camera description's name.
    pub camera: String,
    /// `none`, `light` or `heavy`.
    pub rain: String,
    /// Number of pictures of the edge at each distance.
    pub scenes: u32,
    /// Number of sweeps summed into a picture.
    pub frames: u32,
    /// Seed of the first picture.
    pub seed: u64,
    /// Steps of the ancestral sampler; 0 means that its rows are left out.
    pub ancestral_steps: u32,
    /// Each kind of image at each distance.
    pub rows: Vec<Row>,
    /// How to interpret the numbers.
    pub reading: Vec<String>,
}

/// The resolution of one kind of image at one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The kind of image.
    pub image: Picture,
    /// Distance of the target.
    pub distance_m: f64,
    /// Width of a pixel on the target.
    pub pixel_mm: f64,
    /// Width of the lens's defocus disc on the target.
    pub defocus_mm: f64,
    /// MTF50 and MTF10 of the lens and the emitter alone, by geometry, at least a pixel; `null` for
    /// a camera without them.
    pub lens_mm: Option<[f64; 2]>,
    /// Line at which the transfer falls to a half; `null` if the transfer stays above a half.
    pub mtf50_mm: Option<Estimate>,
    /// Line at which the transfer falls to a tenth; `null` if the transfer stays above a tenth.
    pub mtf10_mm: Option<Estimate>,
    /// The finest bars such that all wider bars are resolved; `null` if the widest tested bars are
    /// not resolved.
    pub bars_mm: Option<f64>,
    /// Bar width in mm, and the contrast kept.
    pub bar_contrast: Vec<(f64, f64)>,
    /// The paper's resolution.
    pub paper_mm: f64,
}

/// Pictures of one row: of the edge, and of each width of bars.
struct Pictures {
    side: usize,
    edges: Vec<Vec<f32>>,
    bars: Vec<Vec<Vec<f32>>>,
}

/// Number of pictures to take.
#[must_use]
pub fn pictures_of(settings: &Settings) -> usize {
    let bars = BARS_PX.len() as u32 * BAR_PICTURES;
    DISTANCES_M.len() * (settings.scenes + bars) as usize
}

/// Takes all pictures and measures them; `done` is called after each picture.
///
/// # Errors
/// `EvalError` for a capture that fails.
pub fn table4(settings: &Settings, done: &(dyn Fn() + Sync)) -> Result<Report> {
    let Settings { scenes, exposure, ancestral_steps, .. } = settings;
    let enhancers = Enhancers::new(*ancestral_steps)?;
    let images = || {
        PAPER.into_iter().filter(|(image, _)| *ancestral_steps > 0 || *image != Picture::Ancestral)
    };
    let camera = CalibratedCamera::new(&settings.camera, exposure.seed)?;
    let mut rows = Vec::new();
    for (k, distance_m) in DISTANCES_M.into_iter().enumerate() {
        let take_all = |scene: &[f32], count: u32| -> Result<Vec<Shots>> {
            let one = |i: u32| {
                let shots = take(&camera, exposure, scene.to_vec(), distance_m, u64::from(i));
                done();
                shots
            };
            (0..count).into_par_iter().map(one).collect()
        };
        let edges = take_all(&edge_scene(SCENE_FIELDS * SCENE_PX), *scenes)?;
        let bars: Vec<Vec<Shots>> = BARS_PX
            .iter()
            .map(|bar_px| {
                let scene = bar_scene(SCENE_FIELDS * SCENE_PX, bar_px * SCENE_PX as f64 / 32.0);
                take_all(&scene, BAR_PICTURES)
            })
            .collect::<Result<_>>()?;
        let conditions = Conditions { distance_m, air: &exposure.air, frames: exposure.frames };
        let white = camera.white_level(conditions, exposure.seed)?;
        for (image, paper_mm) in images() {
            let of = |shots: &[Shots]| pictures(image, shots, white, &enhancers);
            let (side, edges) = of(&edges)?;
            let bar_pictures = bars.iter().map(|shots| Ok(of(shots)?.1)).collect::<Result<_>>()?;
            let pictures = Pictures { side, edges, bars: bar_pictures };
            let lens = settings.camera.projector();
            rows.push(row(&lens, image, distance_m, paper_mm[k], &pictures, &bars));
        }
    }
    rows.sort_by_key(|row: &Row| PAPER.iter().position(|(image, _)| *image == row.image));
    Ok(Report {
        simulated: true,
        camera: settings.camera.name.clone(),
        rain: exposure.air.name().to_owned(),
        scenes: *scenes,
        frames: exposure.frames,
        seed: exposure.seed,
        ancestral_steps: *ancestral_steps,
        rows,
        reading: reading(&settings.camera),
    })
}

/// Takes a scene that extends beyond the field.
fn take(
    camera: &CalibratedCamera,
    exposure: &Exposure,
    reflectance: Vec<f32>,
    distance_m: f64,
    i: u64,
) -> Result<Shots> {
    let field_mm = camera.model().projector().field_mm(distance_m * 1e3);
    let scene = wide_scene(reflectance, field_mm)?;
    let conditions = Conditions { distance_m, air: &exposure.air, frames: exposure.frames };
    camera.shoot(scene, conditions, exposure.seed.wrapping_add(i))
}

/// A drawn scene around a field of this width. The surroundings have the scene's mean reflectance
/// and are too far away to be seen.
fn wide_scene(reflectance: Vec<f32>, field_mm: f64) -> Result<Scene> {
    let scene = Scene::new(reflectance, SCENE_FIELDS * SCENE_PX, SCENE_FIELDS as f64 * field_mm)?;
    Ok(scene.with_surround(0.5)?)
}

/// Line at which the transfer of defocus disc and emitter falls to a level, in mm, by geometry, at
/// least a pixel.
fn lens_line_mm(projector: &Projector, distance_mm: f64, pixel_mm: f64, level: f64) -> f64 {
    let (disc, emitter) = (
        projector.blur_mm(distance_mm),
        projector.emitter_mm * projector.magnification(distance_mm),
    );
    let passes =
        |per_mm: f64| disc_transfer(disc, per_mm) * square_transfer(emitter, per_mm) > level;
    // The first crossing counts, because the disc's transfer oscillates beyond it.
    let limit = 0.5 / pixel_mm;
    let steps = 1000;
    let at = |k: u32| limit * f64::from(k) / f64::from(steps);
    let Some(first) = (1..=steps).find(|k| !passes(at(*k))) else { return pixel_mm };
    let (mut low, mut high) = (at(first - 1), at(first));
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        if passes(middle) { low = middle } else { high = middle }
    }
    0.5 / high
}

/// The pictures of a row and their side.
fn pictures(
    image: Picture,
    shots: &[Shots],
    white: f32,
    enhancers: &Enhancers,
) -> Result<(usize, Vec<Vec<f32>>)> {
    let all: Vec<&Shots> = shots.iter().collect();
    if let Some(pictures) = enhancers.pictures(image, &all, &vec![white; shots.len()])? {
        return Ok((64, pictures));
    }
    let of = |shot: &Shots| {
        if image == Picture::Vis { &shot.vis } else { &shot.nir_spi }.pixels().to_vec()
    };
    Ok((32, shots.iter().map(of).collect()))
}

/// The sum of pictures.
fn sum(pictures: &[Vec<f32>]) -> Vec<f32> {
    let mut sum = vec![0.0; pictures.first().map_or(0, Vec::len)];
    for picture in pictures {
        sum.iter_mut().zip(picture).for_each(|(sum, pixel)| *sum += pixel);
    }
    sum
}

fn row(
    projector: &Projector,
    image: Picture,
    distance_m: f64,
    paper_mm: f64,
    pictures: &Pictures,
    bars: &[Vec<Shots>],
) -> Row {
    let field_mm = projector.field_mm(distance_m * 1e3);
    let side = pictures.side;
    let pixel_mm = field_mm / side as f64;
    let of = |keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<&[f32]> = pictures
            .edges
            .iter()
            .enumerate()
            .filter(|(at, _)| keep(*at))
            .map(|(_, edge)| edge.as_slice())
            .collect();
        edge_mtf(&kept, side)
    };
    let whole = of(&|_| true);
    let without: Vec<_> = (0..GROUPS).map(|group| of(&|at| at % GROUPS != group)).collect();
    let contrast = |k: usize| {
        let truth =
            |shot: &Shots| if side == 64 { shot.truth_fine.clone() } else { shot.truth.clone() };
        let truth = bars[k].first().map(truth).unwrap_or_default();
        bar_transfer(&sum(&pictures.bars[k]), &truth, side, BARS_PX[k] * side as f64 / 32.0)
    };
    let contrasts: Vec<f64> = (0..BARS_PX.len()).map(contrast).collect();
    // Bars are in pixels of 32 x 32, whatever the picture's grid.
    let bar_mm = |px: f64| px * field_mm / 32.0;
    let at = |level| {
        let line = |mtf: &[(f64, f64)]| line_width_px(mtf, level).map(|px| px * pixel_mm);
        let left: Option<Vec<f64>> = without.iter().map(|mtf| line(mtf)).collect();
        Some(Estimate::jackknife(line(&whole)?, &left?))
    };
    let lens_mm = (image != Picture::Vis).then(|| {
        [0.5, 0.1].map(|level| lens_line_mm(projector, distance_m * 1e3, pixel_mm, level))
    });
    let unresolved =
        contrasts.iter().rposition(|&contrast| contrast.is_nan() || contrast < RESOLVED);
    let finest = BARS_PX.get(unresolved.map_or(0, |at| at + 1));
    Row {
        image,
        distance_m,
        pixel_mm,
        defocus_mm: if image == Picture::Vis { 0.0 } else { projector.blur_mm(distance_m * 1e3) },
        lens_mm,
        mtf50_mm: at(0.5),
        mtf10_mm: at(0.1),
        bars_mm: finest.map(|&px| bar_mm(px)),
        bar_contrast: BARS_PX.iter().map(|&px| bar_mm(px)).zip(contrasts.iter().copied()).collect(),
        paper_mm,
    }
}

/// The contrast of bars by their width.
#[must_use]
pub fn chart(report: &Report) -> Chart {
    let lines = report.rows.iter().enumerate().map(|(k, row)| Line {
        name: format!("{}, {} m", row.image.name(), row.distance_m),
        colour: k,
        // Ten lines differ; the others are the same, dashed.
        dashed: k >= Line::LOOKS,
        points: row.bar_contrast.iter().map(|&(mm, contrast)| (mm, contrast.max(0.0))).collect(),
    });
    Chart {
        header: "Contrast that bars keep".to_owned(),
        x: Axis {
            name: "width of a bar on the target, mm".to_owned(),
            from: 1.0,
            to: 100.0,
            logarithmic: true,
            ticks: vec![1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0],
        },
        y: Axis {
            name: "contrast kept".to_owned(),
            from: 0.0,
            to: 1.0,
            logarithmic: false,
            ticks: vec![0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0],
        },
        lines: lines.collect(),
        footer: format!("simulated: rain {}, {BAR_PICTURES} pictures a point", report.rain),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::classical::Blur;
    use nirspi_recon::{Image, Side};

    /// Perfect pictures of the edge and of all bars.
    fn perfect(side: usize) -> Pictures {
        let averaged = |scene: Vec<f32>| {
            let scene = wide_scene(scene, 1.0).unwrap();
            let at = |k: usize| (k as f64 + 0.5) / side as f64 - 0.5;
            let mean =
                |k: usize| scene.mean_over_square(at(k % side), at(k / side), 1.0 / side as f64);
            (0..side * side).map(|k| mean(k) as f32).collect::<Vec<f32>>()
        };
        let bars = |px: &f64| {
            vec![averaged(bar_scene(SCENE_FIELDS * SCENE_PX, px * SCENE_PX as f64 / 32.0))]
        };
        let edges = vec![averaged(edge_scene(SCENE_FIELDS * SCENE_PX)); 20];
        Pictures { side, edges, bars: BARS_PX.iter().map(bars).collect() }
    }

    /// The bars as taken by a camera without blur.
    fn truths(pictures: &Pictures) -> Vec<Vec<Shots>> {
        let shots = |bars: &Vec<Vec<f32>>| {
            let truth = bars[0].clone();
            let image = Image::new(Side::INSTRUMENT, truth.clone());
            vec![Shots { truth, truth_fine: Vec::new(), nir_spi: image.clone(), vis: image }]
        };
        pictures.bars.iter().map(shots).collect()
    }

    #[test]
    fn a_perfect_picture_resolves_lines_as_wide_as_a_pixel() {
        let pictures = perfect(32);
        let row =
            row(&Projector::default(), Picture::NirSpi, 0.3, 5.0, &pictures, &truths(&pictures));
        assert!((row.pixel_mm - Projector::default().field_mm(300.0) / 32.0).abs() < 1e-9);
        let mtf50 = row.mtf50_mm.unwrap();
        assert!((mtf50.mean / row.pixel_mm - 1.0).abs() < 1e-9, "{row:?}");
        assert_eq!((mtf50.n, mtf50.ci95), (GROUPS, Some(0.0)));
        assert!(row.bar_contrast.iter().all(|(_, kept)| (kept - 1.0).abs() < 1e-6), "{row:?}");
        assert!((row.bars_mm.unwrap() / row.pixel_mm - BARS_PX[0]).abs() < 1e-9, "{row:?}");
    }

    #[test]
    fn blur_widens_the_line_as_its_transfer_says() {
        let sharp = perfect(32);
        let blur = Blur::new(32, 32, 2.0);
        let blurred = |images: &[Vec<f32>]| -> Vec<Vec<f32>> {
            images.iter().map(|image| blur.apply(image)).collect()
        };
        let bars = sharp.bars.iter().map(|bars| blurred(bars)).collect();
        let pictures = Pictures { side: 32, edges: blurred(&sharp.edges), bars };
        let row = row(&Projector::default(), Picture::NirSpi, 0.3, 5.0, &pictures, &truths(&sharp));
        // A Gaussian of sigma s transfers a half at sqrt(ln 2 / 2) / (pi s) cycles a pixel, and a
        // line is half a cycle.
        let expected = std::f64::consts::PI * 2.0 / (2.0_f64.ln() / 2.0).sqrt() / 2.0;
        let found = row.mtf50_mm.unwrap().mean / row.pixel_mm;
        assert!((found / expected - 1.0).abs() < 0.1, "{found} against {expected}");
        let [narrow, .., wide] = row.bar_contrast[..] else { panic!("{row:?}") };
        assert!(narrow.1 < RESOLVED && wide.1 > 0.8, "{row:?}");
        assert!(row.bars_mm.unwrap() > 1.5 * row.pixel_mm, "{row:?}");
    }

    #[test]
    fn without_noise_the_slanted_edge_measures_what_geometry_says_of_the_lens() {
        let projector = Projector::default();
        for distance_mm in [600.0, 1000.0] {
            let field_mm = projector.field_mm(distance_mm);
            let scene = wide_scene(edge_scene(SCENE_FIELDS * SCENE_PX), field_mm).unwrap();
            let seen = projector.footprint(&scene, distance_mm).unwrap();
            let mtf = edge_mtf(&[seen.weights()], 32);
            for level in [0.5, 0.1] {
                let pixel_mm = field_mm / 32.0;
                let found = line_width_px(&mtf, level).unwrap() * pixel_mm;
                let lens = lens_line_mm(&projector, distance_mm, pixel_mm, level);
                assert!(
                    (found / lens - 1.0).abs() < 0.01,
                    "{distance_mm} mm, {level}: {found} for {lens}"
                );
            }
        }
        // At the focus the resolution is a pixel.
        assert!((lens_line_mm(&projector, 300.0, 1.5, 0.5) - 1.5).abs() < 1e-9);
    }

    #[test]
    fn sums_add_pixel_by_pixel() {
        assert_eq!(sum(&[vec![1.0, 2.0], vec![0.5, -2.0]]), [1.5, 0.0]);
        assert_eq!(sum(&[]), Vec::<f32>::new());
    }
}
