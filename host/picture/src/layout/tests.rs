use super::*;
use crate::{Figure, FigureStyle};
use proptest::prelude::*;

fn look() -> Look {
    FigureStyle::Paper.look()
}

fn panel(title: &str, side: usize, caption: &[&str]) -> Panel {
    Panel {
        title: title.to_owned(),
        width: side,
        height: side,
        values: (0..side * side).map(|i| i as f32 / (side * side - 1) as f32).collect(),
        range: Range::Unit,
        unit: Unit::OfWhite,
        caption: caption.iter().map(|&line| line.to_owned()).collect(),
        warnings: Vec::new(),
        field_mm: None,
    }
}

fn side_by_side(header: &str, panels: Vec<Panel>, footer: &str) -> SideBySide {
    SideBySide { header: header.to_owned(), panels, footer: footer.to_owned() }
}

fn drawn(panels: Vec<Panel>) -> Drawing {
    Figure::Images(side_by_side("", panels, "")).draw(&look())
}

/// Places and pixels of the images, without grey bars.
fn images(drawing: &Drawing) -> Vec<([u32; 4], u32, Vec<u8>)> {
    let images = drawing.shapes.iter().filter_map(|shape| match shape {
        Shape::Image { at, columns, levels, .. } if levels.len() as u32 != *columns => {
            Some((*at, *columns, levels.clone()))
        }
        _ => None,
    });
    images.collect()
}

fn bars(drawing: &Drawing) -> usize {
    let is_bar = |shape: &&Shape| matches!(shape, Shape::Image { columns: 256, levels, .. } if levels.len() == 256);
    drawing.shapes.iter().filter(is_bar).count()
}

#[test]
fn images_of_one_scale_have_one_bar_and_others_one_each() {
    assert_eq!(bars(&drawn(vec![panel("", 32, &[]); 3])), 1);
    let mut panels = vec![panel("", 32, &[]); 3];
    panels[1].range = Range::Fixed(0.0, 0.5);
    assert_eq!(bars(&drawn(panels)), 3);
    // A reflectance and a share of a white sheet are drawn alike; readings have no white.
    let mut panels = vec![panel("", 32, &[]); 2];
    panels[0].unit = Unit::Reflectance;
    assert_eq!(bars(&drawn(panels.clone())), 1);
    panels[0].unit = Unit::Readings;
    assert_eq!(bars(&drawn(panels)), 2);
    assert_eq!(bars(&drawn(vec![panel("", 32, &[])])), 1);
}

#[test]
fn a_field_has_axes_in_millimetres() {
    let with = |field_mm| Panel { field_mm, ..panel("", 32, &[]) };
    let drawing = drawn(vec![with(Some(96.0)), with(Some(96.0))]);
    let texts: Vec<&str> = drawing.texts().into_iter().map(|(text, _)| text).collect();
    // Below both images, and left of the first.
    assert_eq!(texts.iter().filter(|text| **text == "20").count(), 3, "{texts:?}");
    assert!(!drawn(vec![with(None)]).texts().iter().any(|(text, _)| text.ends_with("mm")));
    let [first, second] = &images(&drawing)[..] else { panic!() };
    let ticks = |left: u32, wide: u32| {
        let of = |mm: f64| f64::from(left) + mm / 96.0 * f64::from(wide);
        let is_at = |x: f64| {
            drawing.shapes.iter().any(|shape| {
            matches!(shape, Shape::Line { points, .. } if (points[0].0 - x).abs() < 1.0 && (points[1].0 - x).abs() < 1.0)
        })
        };
        is_at(of(0.0)) && is_at(of(80.0))
    };
    assert!(ticks(first.0[0], first.0[2]) && ticks(second.0[0], second.0[2]));
}

#[test]
fn a_single_image_has_whole_pixels() {
    for side in (1..300).chain([512]) {
        let single = drawn(vec![panel("", side, &[])]);
        let (at, columns, _) = images(&single).pop().unwrap_or((
            [0, 0, side as u32, side as u32],
            side as u32,
            Vec::new(),
        ));
        assert!(at[2] == at[3] && at[2].is_multiple_of(columns), "{side}: {at:?}");
    }
    let of = |width, height| {
        let values = vec![0.0; width * height];
        Panel { width, height, values, ..Panel::square("", 0, &[], Unit::OfWhite) }
    };
    assert_eq!(of(7, 3).shown_px(384, true), (378, 162));
    assert_eq!(of(3, 700).shown_px(384, true), (1, 384));
    // Beside each other, a scene of 256 pixels and the camera's image have one size.
    assert_eq!(of(256, 256).shown_px(384, false), of(32, 32).shown_px(384, false));
}

#[test]
fn panels_have_as_many_rows_as_their_text_needs() {
    for (style, count, columns) in [
        (FigureStyle::Paper, 7, 4),
        (FigureStyle::Paper, 5, 5),
        (FigureStyle::Column, 7, 2),
        (FigureStyle::Column, 1, 1),
    ] {
        let picture = side_by_side("", vec![panel("", 32, &[]); count], "");
        let drawing = Figure::Images(picture).draw(&style.look());
        let tops: Vec<u32> = images(&drawing).iter().map(|(at, ..)| at[1]).collect();
        let first = tops.iter().filter(|top| **top == tops[0]).count();
        assert_eq!((tops.len(), first), (count, columns), "{style:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn text_of_any_length_stays_inside_its_panel(
        texts in prop::collection::vec("[ -~µ×−\n]{0,90}|[a-zW@]{60,90}", 7),
        field_mm in prop::option::of(1e-3f64..1e4),
    ) {
        let left = Panel { field_mm, ..panel(&texts[0], 32, &[&texts[1], &texts[2]]) };
        let panels = vec![left, panel(&texts[3], 64, &[&texts[4]])];
        let figure = Figure::Images(side_by_side(&texts[5], panels, &texts[6]));
        for style in FigureStyle::ALL {
            let look = style.look();
            let drawing = figure.draw(&look);
            prop_assert_eq!(drawing.size().0, look.width());
            let beyond = drawing.beyond(look.px(MARGIN));
            prop_assert!(beyond.is_none(), "{:?}: {:?}", style, beyond);
            // Panels are beside each other: their texts do not touch.
            prop_assert!(drawing.overlapping().is_none(), "{:?}: {:?}", style, drawing.overlapping());
        }
    }
}

#[test]
fn pixels_of_the_camera_stay_square_and_unmixed() {
    let drawing = drawn(vec![panel("", 32, &[])]);
    let ([left, top, wide, _], ..) = images(&drawing)[0].clone();
    let canvas = drawing.raster();
    let cell = wide / 32;
    for row in 0..32 {
        for column in 0..32 {
            let level = to_level((row * 32 + column) as f32 / 1023.0);
            for (dx, dy) in [(0, 0), (cell - 1, 0), (0, cell - 1), (cell - 1, cell - 1)] {
                let found = canvas.pixel(left + column * cell + dx, top + row * cell + dy);
                assert_eq!(found, Some(&[level; 3]), "{row} {column} {dx} {dy}");
            }
        }
    }
}

#[test]
fn the_range_says_what_is_black_and_white() {
    let levels = |range| {
        let values = vec![-1.0, 0.0, 0.5, 3.0];
        let panel = Panel { width: 2, height: 2, values, range, ..panel("", 2, &[]) };
        images(&drawn(vec![panel])).remove(0).2
    };
    assert_eq!(levels(Range::Unit), [0, 0, 128, 255]);
    // 200 values and more have percentiles of their own; of four, these are the ends.
    assert_eq!(levels(Range::Stretched), [0, 64, 96, 255]);
    assert_eq!(levels(Range::Fixed(0.0, 0.5)), [0, 0, 255, 255]);
}

#[test]
fn flat_wide_and_broken_images_are_drawn_too() {
    for (width, height, value) in
        [(1, 1, 0.5), (7, 3, 0.0), (3, 700, 1.0), (2, 2, f32::NAN), (2, 2, f32::INFINITY)]
    {
        for range in [Range::Unit, Range::Stretched, Range::Fixed(1.0, 1.0)] {
            let values = vec![value; width * height];
            let odd = Panel { width, height, values, range, ..panel("odd", 2, &["x"]) };
            let canvas = drawn(vec![odd]).raster();
            assert_eq!(canvas.width(), look().single(), "{width} x {height}");
        }
    }
}

#[test]
fn a_warning_is_drawn_below_its_image_in_its_own_colour() {
    let warned = Panel { warnings: vec!["too little light".to_owned()], ..panel("", 2, &["x"]) };
    let drawing = drawn(vec![panel("", 2, &["x"]), warned]);
    let colour = look().palette.warning;
    let places: Vec<f64> = drawing
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            Shape::Text { x, colour: of, .. } if *of == colour => Some(*x),
            _ => None,
        })
        .collect();
    let second = images(&drawing)[1].0[0];
    assert_eq!(places, [f64::from(second)]);
}

#[test]
fn more_text_makes_a_taller_picture_and_less_a_lower_one() {
    let height = |caption: &str| drawn(vec![panel("", 2, &[caption])]).size().1;
    assert!(height(&"word ".repeat(40)) > height("word") && height("word") > height(""));
}
