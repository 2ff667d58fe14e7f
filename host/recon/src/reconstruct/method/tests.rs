use super::*;
use crate::reconstruct::prior::{Network, Seen};
use crate::testing::{correlation_of, measured, scene, side};
use crate::{Order, reconstruct};

/// The methods of this crate that need no network.
fn alone() -> impl Iterator<Item = &'static Method> {
    Method::ALL.iter().filter(|method| !method.needs_network())
}

fn part() -> Measurements {
    measured(side(16), &scene(side(16), 2)).take(Some(&Order::ZigZag), 0.3).unwrap()
}

#[test]
fn words_are_read_as_they_are_written_and_stand_once() {
    for (at, method) in Method::ALL.iter().enumerate() {
        assert_eq!(method.to_string().parse(), Ok(*method));
        assert_eq!(Method::ALL.iter().position(|other| other == method), Some(at));
        assert!(method.about().contains(' '), "{method}: {}", method.about());
    }
    let error = "svd".parse::<Method>().unwrap_err().to_string();
    assert!(error.starts_with("unknown method \"svd\", expected hadamard, omp, "), "{error}");
    assert!(error.ends_with(", prior or auto"), "{error}");
    assert_eq!(Method::default().argument(), "auto");
    assert_eq!(format!("{:?}", Method::OMP), "Method(omp)");
}

/// A network that completes every image with zeros.
struct NoScene;

impl Network for NoScene {
    fn name(&self) -> &str {
        "no scene"
    }

    fn takes(&self, _: crate::Side) -> bool {
        true
    }

    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String> {
        Ok(vec![0.0; seen.values().len()])
    }
}

#[test]
fn a_method_that_needs_a_network_is_an_error_without_one() {
    for method in Method::ALL {
        match method.prepare(&MethodSettings::default()) {
            Ok(_) => assert!(!method.needs_network(), "{method}"),
            Err(error) => {
                assert!(method.needs_network(), "{method}");
                let words =
                    "the method prior needs a network: give it one, or choose another method";
                assert_eq!(error.to_string(), words);
            }
        }
    }
    let network = Some(SharedNetwork::new(NoScene));
    let settings = MethodSettings { network, ..MethodSettings::default() };
    assert!(Method::ALL.iter().all(|method| method.prepare(&settings).is_ok()));
}

#[test]
fn methods_with_a_past_begin_a_video_with_it() {
    for (word, has_a_past) in [
        ("tikhonov", true),
        ("fista", true),
        ("tv", true),
        ("prior", true),
        ("auto", true),
        ("omp", false),
    ] {
        let method: Method = word.parse().unwrap();
        let network = Some(SharedNetwork::new(NoScene));
        let ready = method.prepare(&MethodSettings { network, ..MethodSettings::default() });
        assert_eq!(ready.unwrap().begin_video().unwrap().is_some(), has_a_past, "{word}");
        assert!(method.takes(Setting::WarmStart), "{word}");
    }
}

#[test]
fn a_users_own_patterns_have_the_method_of_the_same_name() {
    use reconstruct::Penalty::{Sparse, Tikhonov, TotalVariation};
    let with = |word: &str| word.parse::<Method>().unwrap().with_matrix();
    assert_eq!(with("omp"), Some(MatrixMethod::Omp));
    assert_eq!(with("pseudo-inverse"), Some(MatrixMethod::PseudoInverse));
    for (word, penalty) in [("tikhonov", Tikhonov), ("fista", Sparse), ("tv", TotalVariation)] {
        assert_eq!(with(word), Some(MatrixMethod::Penalty(penalty)));
    }
    assert_eq!((with("hadamard"), with("prior")), (None, None));
    for method in Method::ALL {
        if let Some(matrix) = method.with_matrix() {
            assert_eq!(Method::of_matrix(matrix), Some(*method));
        }
    }
}

#[test]
fn every_method_reports_its_own_name_with_the_image() {
    for method in alone() {
        let ready = method.prepare(&MethodSettings::default()).unwrap();
        let made = ready.reconstruct(&part()).unwrap();
        assert_eq!(ready.name(), method.name());
        // The report of a choice is that of the method that was chosen.
        let name = match made.report.chosen {
            Some(chosen) => chosen.parse::<Method>().unwrap().name(),
            None => method.name(),
        };
        assert_eq!(made.report.name, name);
        assert!(made.report.to_string().starts_with(name), "{}", made.report);
        assert_eq!(made.report.chosen.is_some(), *method == Method::AUTO);
        let basis = *method != Method::AUTO && method.takes(Setting::Basis);
        assert!(*method == Method::AUTO || made.report.basis.is_some() == basis, "{method}");
        assert!(made.image.pixels().iter().all(|pixel| pixel.is_finite()));
    }
}

#[test]
fn a_prepared_method_makes_the_image_of_the_function_that_it_wraps() {
    let part = part();
    let image = |word: &str| {
        let method: Method = word.parse().unwrap();
        let ready = method.prepare(&MethodSettings::default()).unwrap();
        ready.reconstruct(&part).unwrap().image
    };
    assert_eq!(image("hadamard"), reconstruct::hadamard(&part));
    assert_eq!(image("pseudo-inverse"), reconstruct::hadamard(&part));
    assert_eq!(image("omp"), reconstruct::omp(&part, &OmpSettings::default()).unwrap().image);
    for (word, penalty) in [
        ("tikhonov", reconstruct::Penalty::Tikhonov),
        ("fista", reconstruct::Penalty::Sparse),
        ("tv", reconstruct::Penalty::TotalVariation),
    ] {
        let settings = reconstruct::RegularisedSettings::new(penalty);
        assert_eq!(image(word), reconstruct::regularised(&part, &settings).unwrap().image);
        let (basis, strength) = (Basis::Haar, Strength::Fixed(0.2));
        let asked = MethodSettings { basis, strength, ..MethodSettings::default() };
        let method: Method = word.parse().unwrap();
        let found = method.prepare(&asked).unwrap().reconstruct(&part).unwrap().image;
        let settings = reconstruct::RegularisedSettings { basis, strength, ..settings };
        assert_eq!(found, reconstruct::regularised(&part, &settings).unwrap().image);
    }
}

#[test]
fn algorithm_1_as_printed_is_that_of_its_settings() {
    let settings = MethodSettings {
        as_printed: true,
        sparsity: Sparsity::Fixed(9),
        ..MethodSettings::default()
    };
    let made = Method::OMP.prepare(&settings).unwrap().reconstruct(&part()).unwrap();
    let printed = reconstruct::omp(&part(), &OmpSettings::as_printed(Basis::Dct, 9)).unwrap();
    assert_eq!((made.image, made.report.sparsity), (printed.image, Some(9)));
    assert_eq!((made.report.reading_weight, made.report.held_back), (Some(0.0), None));
    assert_eq!(made.report.stop, Some("as many atoms as asked for"));
}

#[test]
fn settings_of_other_methods_are_refused_with_the_methods_that_take_them() {
    let sound = MethodSettings::default();
    let refused = |word: &str, settings: &MethodSettings| {
        let method: Method = word.parse().unwrap();
        method.prepare(settings).err().unwrap().to_string()
    };
    let strong = MethodSettings { strength: Strength::Fixed(2.0), ..sound.clone() };
    assert_eq!(refused("omp", &strong), "strength belongs to tikhonov, fista or tv, not to omp");
    let lit = MethodSettings { non_negative: true, basis: Basis::Pixel, ..sound.clone() };
    assert_eq!(refused("tv", &lit), "non-negative belongs to omp, not to tv");
    let gpu = MethodSettings { backend: Backend::Cuda, ..sound.clone() };
    assert_eq!(refused("hadamard", &gpu), "backend belongs to omp, not to hadamard");
    let values = vec![1.0; 256].into();
    let own = OwnAtoms { name: "mine".into(), values };
    let own = MethodSettings { dictionary: Some(own), ..sound.clone() };
    assert_eq!(refused("fista", &own), "dictionary belongs to omp, not to fista");
    let lit = MethodSettings { non_negative: true, ..sound.clone() };
    assert!(refused("omp", &lit).contains("dct basis"));
    let few = MethodSettings { sparsity: Sparsity::Fixed(9), ..sound.clone() };
    assert_eq!(refused("tikhonov", &few), "sparsity belongs to omp, not to tikhonov");
    let residual = MethodSettings { residual: 1.0, ..sound.clone() };
    assert_eq!(refused("omp", &residual), "residual is 1, expected 0 or more, below 1");
    let none = MethodSettings { sparsity: Sparsity::Fixed(0), ..sound.clone() };
    assert_eq!(refused("omp", &none), "sparsity is 0, expected at least 1");
    let weak = MethodSettings { strength: Strength::Fixed(0.0), ..sound };
    assert_eq!(refused("tv", &weak), "strength is 0, expected more than 0, at most 1e6");
}

#[test]
fn one_list_of_settings_makes_every_method_ready() {
    let asked = MethodSettings {
        strength: Strength::Fixed(2.0),
        non_negative: true,
        sparsity: Sparsity::Fixed(5),
        residual: 0.1,
        basis: Basis::Pixel,
        ..MethodSettings::default()
    };
    for &method in alone() {
        let taken = asked.taken_by(method);
        assert_eq!(taken.non_negative, method.takes(Setting::NonNegative), "{method}");
        assert_eq!(
            taken.sparsity == Sparsity::Fixed(5),
            method.takes(Setting::Sparsity),
            "{method}"
        );
        assert_eq!(taken.residual > 0.0, method.takes(Setting::Residual), "{method}");
        let made = method.prepare(&taken).unwrap().reconstruct(&part()).unwrap();
        let asked = !method.takes(Setting::Strength) || made.report.strength == Some(2.0);
        assert!(asked, "{method}");
    }
}

#[test]
fn atoms_of_ones_own_are_named_in_the_report() {
    let values: Vec<f32> = (0..256 * 256).map(|p| f32::from(u8::from(p % 257 == 0))).collect();
    let own = OwnAtoms { name: "points.npy".into(), values: values.into() };
    let settings = MethodSettings { dictionary: Some(own), ..MethodSettings::default() };
    let made = Method::OMP.prepare(&settings).unwrap().reconstruct(&part()).unwrap();
    assert!(made.report.short().ends_with("atoms of the points.npy basis"), "{}", made.report);
}

#[test]
fn frames_of_a_video_start_warm_where_the_method_can() {
    let frames = vec![part(); 3];
    for method in alone() {
        let ready = method.prepare(&MethodSettings::default()).unwrap();
        let made = ready.reconstruct_video(&frames).unwrap();
        let warm: Vec<bool> = made.iter().map(|made| made.report.warm).collect();
        let starts_warm = method.takes(Setting::WarmStart);
        assert_eq!(warm, [false, starts_warm, starts_warm], "{method}");
    }
}

#[test]
fn an_image_in_memory_of_the_caller_is_the_same_image() {
    for method in alone() {
        let ready = method.prepare(&MethodSettings::default()).unwrap();
        let made = ready.reconstruct(&part()).unwrap();
        let mut pixels = vec![7.0; made.image.pixels().len()];
        let report = ready.reconstruct_into(&part(), &mut pixels).unwrap();
        assert_eq!((&*pixels, &report), (made.image.pixels(), &made.report), "{method}");
    }
}

/// A user's own method: every pixel is the mean.
struct Flat;

impl Reconstruct for Flat {
    fn name(&self) -> &str {
        "flat"
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        let sum = measurements.rows().iter().position(|&row| row == 0);
        let sum = sum.ok_or_else(|| ReconstructError::Failed("row 0 was not measured".into()))?;
        let side = measurements.side();
        let mean = measurements.values()[sum] / side.area() as f64;
        let image = crate::Image::new(side, vec![mean as f32; side.area()]);
        Ok(Reconstruction { image, report: Report::new("flat") })
    }
}

#[test]
fn a_method_of_ones_own_stands_beside_the_built_in_ones() {
    let mut all: Vec<Box<dyn Reconstruct>> = vec![Box::new(Flat)];
    for method in alone() {
        all.push(method.prepare(&MethodSettings::default()).unwrap());
    }
    let image = |method: &dyn Reconstruct| method.reconstruct(&part()).unwrap().image;
    let full = reconstruct::hadamard(&measured(side(16), &scene(side(16), 2)));
    let flat = image(&*all[0]);
    assert!(flat.pixels().windows(2).all(|pair| pair[0] == pair[1]));
    for method in &all[1..] {
        assert!(correlation_of(&image(&**method), &full) > 0.5, "{}", method.name());
    }
    let without_mean = part().subset(1..4);
    let error = Flat.reconstruct(&without_mean).unwrap_err();
    assert_eq!(error.to_string(), "row 0 was not measured");
}
