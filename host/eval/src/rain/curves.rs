//! Curves of rain: extinction, albedo and asymmetry against wavelength and drop size; drop sizes;
//! fall speeds; and extinction against rain rate, with laws fitted to measured optical links for
//! comparison.

use crate::error::{EvalError, Result};
use nirspi::picture::{Axis, Chart, Line};
use nirspi_optics::mie::Mie;
use nirspi_optics::rain::fall::{fall_speed_from_rest_m_per_s, fall_speed_m_per_s};
use nirspi_optics::rain::{Drops, FsoLaw, Medium, PaperRain};
use nirspi_optics::water::Water;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Wavelengths of the curves over wavelength, in nm.
const WAVELENGTHS_NM: (f64, f64, usize) = (400.0, 2000.0, 81);

/// Drop diameters of the curves over size, in mm.
const DIAMETERS_MM: (f64, f64, usize) = (0.001, 5.0, 241);

/// Number of sizes averaged in each point of a curve over size. A drop of one exact size has
/// ripples that rain does not show.
const SIZES_A_POINT: usize = 9;

/// Relative width of these sizes.
const SIZE_WIDTH: f64 = 0.1;

/// A chart and the name of its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// The file's name without an ending.
    pub name: &'static str,
    /// The lines.
    pub chart: Chart,
}

/// Kinds of air with a curve.
struct Air {
    name: String,
    drops: Drops,
}

/// The air of the drops asked for, and of those beside them.
fn airs(name: &str, drops: &Drops) -> Result<Vec<Air>> {
    let air = |name: &str, drops| Air { name: name.to_owned(), drops };
    let heavy = PaperRain::HEAVY.rate_mm_per_h;
    let asked = air(&format!("{name} (asked for)"), drops.clone());
    let others = [
        air("light, 0.5 mm", PaperRain::LIGHT.drops()?),
        air("heavy, 2 mm", PaperRain::HEAVY.drops()?),
        air("Marshall-Palmer, 5.6 mm/h", Drops::marshall_palmer(heavy)?),
        air("fog, 10 µm, 0.1 g/m3", Drops::fog(10.0, 0.1)?),
    ];
    // The rain asked for may be one of the others.
    let others = others.into_iter().filter(|other| other.drops != *drops);
    Ok(std::iter::once(asked).chain(others).collect())
}

/// All curves: of `drops`, called `name`, of the paper's two rains, of Marshall and Palmer's rain
/// at the heavier rate, and of fog. `wavelengths_nm` are those of the curves over size.
///
/// # Errors
/// [`EvalError::is_setting`] for a wavelength without an index of water, or drops that are not
/// possible.
pub fn curves(name: &str, drops: &Drops, wavelengths_nm: &[f64]) -> Result<Vec<Curves>> {
    let airs = airs(name, drops)?;
    let mut all = over_wavelength(&airs)?;
    all.extend(over_size(wavelengths_nm)?);
    all.push(sizes(&airs));
    all.push(speeds());
    all.push(rates(wavelengths_nm)?);
    Ok(all)
}

/// `count` values from `low` to `high` with equal ratios.
fn factors((low, high, count): (f64, f64, usize)) -> Vec<f64> {
    let at = |i| low * (high / low).powf(f64::from(i) / (count - 1) as f64);
    (0..count as u32).map(at).collect()
}

fn axis(name: &str, ticks: &[f64], logarithmic: bool) -> Axis {
    Axis::of(name, ticks.to_vec(), logarithmic)
}

fn line(name: &str, colour: usize, points: Vec<(f64, f64)>) -> Line {
    Line { name: name.to_owned(), colour, dashed: false, points }
}

const SHARES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];

fn share_axis(name: &str) -> Axis {
    axis(name, &SHARES, false)
}

/// Decades around the values of all lines.
fn decades(name: &str, lines: &[Line]) -> Axis {
    Axis::decades(name, lines.iter().flat_map(|line| &line.points).map(|point| point.1), 10)
}

fn over_wavelength(airs: &[Air]) -> Result<Vec<Curves>> {
    let (low, high, count) = WAVELENGTHS_NM;
    let at = |i: usize| low + (high - low) * i as f64 / (count - 1) as f64;
    let of = |air: &Air| -> Result<Vec<Medium>> {
        let medium = |i| Ok(Medium::new(&air.drops, at(i), Water::Segelstein)?);
        (0..count).into_par_iter().map(medium).collect()
    };
    let media: Vec<Vec<Medium>> = airs.iter().map(of).collect::<Result<_>>()?;
    let lines = |value: fn(&Medium) -> f64| -> Vec<Line> {
        let of = |(k, (air, media)): (usize, (&Air, &Vec<Medium>))| {
            let points = media.iter().map(|m| (m.wavelength_nm, value(m))).collect();
            line(&air.name, k, points)
        };
        airs.iter().zip(&media).enumerate().map(of).collect()
    };
    let x = || axis("wavelength, nm", &[400.0, 800.0, 1200.0, 1600.0, 2000.0], false);
    let footer = "simulated: Mie, water of Segelstein (1981)".to_owned();
    let extinction = lines(|m| m.extinction_per_m);
    Ok(vec![
        Curves {
            name: "extinction_wavelength",
            chart: Chart {
                header: "Extinction against wavelength".to_owned(),
                x: x(),
                y: decades("extinction, 1/m", &extinction),
                lines: extinction,
                footer: footer.clone(),
            },
        },
        Curves {
            name: "albedo_wavelength",
            chart: Chart {
                header: "Share of the extinction that is scattered".to_owned(),
                x: x(),
                y: share_axis("albedo"),
                lines: lines(Medium::albedo),
                footer: footer.clone(),
            },
        },
        Curves {
            name: "asymmetry_wavelength",
            chart: Chart {
                header: "Mean cosine of the scattering angle".to_owned(),
                x: x(),
                y: share_axis("asymmetry g"),
                lines: lines(|m| m.asymmetry),
                footer,
            },
        },
    ])
}

/// The optics of a drop of one size: extinction efficiency, albedo, asymmetry.
fn drop_optics(diameter_mm: f64, wavelength_nm: f64) -> Result<[f64; 3]> {
    let index = Water::Segelstein
        .index(wavelength_nm)
        .map_err(|e| EvalError::refused("wavelengths_nm", &e))?;
    let mut mie = Mie::new();
    let [mut extinction, mut scattering, mut forward] = [0.0; 3];
    for k in 0..SIZES_A_POINT {
        let part = (k as f64 + 0.5) / SIZES_A_POINT as f64 - 0.5;
        let size_mm = diameter_mm * (1.0 + SIZE_WIDTH * part);
        let q = mie.sphere(PI * size_mm * 1e6 / wavelength_nm, index)?.efficiencies();
        extinction += q.extinction;
        scattering += q.scattering;
        forward += q.asymmetry * q.scattering;
    }
    Ok([extinction / SIZES_A_POINT as f64, scattering / extinction, forward / scattering])
}

fn over_size(wavelengths_nm: &[f64]) -> Result<Vec<Curves>> {
    let diameters = factors(DIAMETERS_MM);
    let of = |&nm: &f64| -> Result<Vec<[f64; 3]>> {
        diameters.par_iter().map(|&mm| drop_optics(mm, nm)).collect()
    };
    let found: Vec<Vec<[f64; 3]>> = wavelengths_nm.iter().map(of).collect::<Result<_>>()?;
    let lines = |which: usize| -> Vec<Line> {
        let points = |found: &Vec<[f64; 3]>| {
            diameters.iter().zip(found).map(|(&mm, values)| (mm, values[which])).collect()
        };
        let each = wavelengths_nm.iter().zip(&found).enumerate();
        each.map(|(k, (nm, found))| line(&format!("{nm} nm"), k, points(found))).collect()
    };
    let x = || axis("drop diameter, mm", &[0.001, 0.01, 0.1, 1.0, 5.0], true);
    let footer = format!("simulated: Mie, each point a mean over {} % of size", SIZE_WIDTH * 100.0);
    let of = |name, header: &str, y, which| Curves {
        name,
        chart: Chart {
            header: header.to_owned(),
            x: x(),
            y,
            lines: lines(which),
            footer: footer.clone(),
        },
    };
    let efficiency = axis("Q_ext", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], false);
    Ok(vec![
        of("extinction_size", "Extinction over the drop's shadow", efficiency, 0),
        of("albedo_size", "Share of the extinction that is scattered", share_axis("albedo"), 1),
        of("asymmetry_size", "Mean cosine of the scattering angle", share_axis("asymmetry g"), 2),
    ])
}

/// Drop sizes; drops of one size have no curve.
fn sizes(airs: &[Air]) -> Curves {
    let mut lines = Vec::new();
    for (k, air) in airs.iter().enumerate() {
        let classes = air.drops.classes();
        let [first, second, ..] = classes else { continue };
        let width_mm = second.diameter_mm - first.diameter_mm;
        if width_mm > 0.0 {
            let density = classes.iter().map(|c| (c.diameter_mm, c.per_m3 / width_mm)).collect();
            lines.push(line(&air.name, k, density));
        }
    }
    for (k, rate) in [1.0, 50.0].into_iter().enumerate() {
        if let Ok(drops) = Drops::marshall_palmer(rate) {
            let classes = drops.classes();
            let width_mm = classes[1].diameter_mm - classes[0].diameter_mm;
            let density = classes.iter().map(|c| (c.diameter_mm, c.per_m3 / width_mm)).collect();
            lines.push(line(&format!("Marshall-Palmer, {rate} mm/h"), airs.len() + k, density));
        }
    }
    Curves {
        name: "drop_sizes",
        chart: Chart {
            header: "Drops by size".to_owned(),
            x: axis("drop diameter, mm", &[0.001, 0.01, 0.1, 1.0, 10.0], true),
            y: decades("N(D), drops per m3 and mm", &lines),
            lines,
            footer: "a measured distribution is drawn by its first two classes' distance; one size has no curve".to_owned(),
        },
    }
}

fn speeds() -> Curves {
    let diameters: Vec<f64> = (0..=100).map(|k| 0.11 + 5.89 * f64::from(k) / 100.0).collect();
    let of = |speed: &dyn Fn(f64) -> f64| diameters.iter().map(|&mm| (mm, speed(mm))).collect();
    Curves {
        name: "fall_speed",
        chart: Chart {
            header: "How fast drops fall".to_owned(),
            x: axis("drop diameter, mm", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], false),
            y: axis("m/s", &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0], false),
            lines: vec![
                line("terminal", 0, of(&fall_speed_m_per_s)),
                line("after 0.5 m from rest", 1, of(&|mm| fall_speed_from_rest_m_per_s(mm, 0.5))),
                line("after 0.25 m from rest", 2, of(&|mm| fall_speed_from_rest_m_per_s(mm, 0.25))),
            ],
            footer: "Atlas, Srivastava and Sekhon (1973); from rest with drag as the square of the speed".to_owned(),
        },
    }
}

/// Extinction against rain rate, with laws fitted to optical links for comparison.
fn rates(wavelengths_nm: &[f64]) -> Result<Curves> {
    let rates = factors((0.5, 100.0, 24));
    let ours = |&nm: &f64| -> Result<Vec<(f64, f64)>> {
        let at = |&rate: &f64| {
            let drops = Drops::marshall_palmer(rate)?;
            let medium = Medium::new(&drops, nm, Water::Segelstein)?;
            Ok((rate, medium.extinction_db_per_km()))
        };
        rates.par_iter().map(at).collect()
    };
    let mut lines = Vec::new();
    for (k, nm) in wavelengths_nm.iter().enumerate() {
        lines.push(line(&format!("Marshall-Palmer, {nm} nm"), k, ours(nm)?));
    }
    for law in FsoLaw::ALL {
        let points = rates.iter().map(|&rate| (rate, law.db_per_km(rate))).collect();
        let name = law.name.to_owned();
        lines.push(Line { name, colour: lines.len(), dashed: true, points });
    }
    Ok(Curves {
        name: "extinction_rate",
        chart: Chart {
            header: "Rain on an optical link".to_owned(),
            x: axis("rain rate, mm/h", &[0.5, 1.0, 5.0, 10.0, 50.0, 100.0], true),
            y: decades("extinction, dB/km", &lines),
            lines,
            footer: "simulated: Mie, in which wavelengths differ by less than a line's width; dashed: laws fitted to \
                     measured free-space optical links"
                .to_owned(),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_lies_in_its_frame_and_its_numbers_are_written() {
        let drops = Drops::gamma(5.6, 2.0, 3.0).unwrap();
        let all = curves("gamma:2,3", &drops, &[550.0, 1550.0]).unwrap();
        let names: Vec<&str> = all.iter().map(|curves| curves.name).collect();
        assert_eq!(
            names,
            [
                "extinction_wavelength",
                "albedo_wavelength",
                "asymmetry_wavelength",
                "extinction_size",
                "albedo_size",
                "asymmetry_size",
                "drop_sizes",
                "fall_speed",
                "extinction_rate"
            ]
        );
        for Curves { name, chart } in &all {
            assert!(!chart.lines.is_empty(), "{name}");
            assert_eq!(crate::looks(chart), chart.lines.len(), "{name}: two lines look alike");
            for Line { name: line, points, .. } in &chart.lines {
                let shown = |&&(x, y): &&(f64, f64)| {
                    (chart.x.from..=chart.x.to).contains(&x)
                        && (chart.y.from..=chart.y.to).contains(&y)
                };
                // Tails of size distributions leave the frame.
                let inside = points.iter().filter(shown).count() as f64 / points.len() as f64;
                assert!(
                    inside > if *name == "drop_sizes" { 0.3 } else { 0.999 },
                    "{name}, {line}: {inside}"
                );
            }
        }
    }

    #[test]
    fn the_rain_asked_for_has_one_curve_if_it_is_one_of_the_others() {
        let names = |drops: &Drops| -> Vec<String> {
            airs("asked", drops).unwrap().into_iter().map(|air| air.name).collect()
        };
        assert_eq!(names(&Drops::gamma(5.6, 2.0, 3.0).unwrap()).len(), 5);
        let found = names(&Drops::marshall_palmer(PaperRain::HEAVY.rate_mm_per_h).unwrap());
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(!found.contains(&"Marshall-Palmer, 5.6 mm/h".to_owned()), "{found:?}");
    }

    #[test]
    fn drops_that_are_large_take_out_twice_their_shadow_and_small_ones_absorb_nothing() {
        let [large, ..] = drop_optics(2.0, 550.0).unwrap();
        assert!((large - 2.0).abs() < 0.02, "{large}");
        let [_, albedo, _] = drop_optics(0.01, 550.0).unwrap();
        assert!(albedo > 0.9999, "{albedo}");
        assert!(drop_optics(1.0, 300.0).unwrap_err().is_setting());
    }
}
