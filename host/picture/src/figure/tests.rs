use super::super::drawing::Shape;
use super::*;
use crate::testing::provenance;
use crate::{Axis, Panel, Unit};

fn chart(header: &str, points: &[(f64, f64)]) -> Chart {
    let line = |name: &str, colour| Line {
        name: name.to_owned(),
        colour,
        dashed: false,
        points: points.to_vec(),
    };
    Chart {
        header: header.to_owned(),
        x: Axis::of("distance, m", vec![0.0, 1.0], false),
        y: Axis::of("PSNR <dB> & more", vec![0.0, 40.0], false),
        lines: vec![line("ours, \"new\"", 0), line("theirs", 1)],
        footer: "simulated".to_owned(),
    }
}

fn images() -> SideBySide {
    let values: Vec<f32> = (0..1024).map(|p| p as f32).collect();
    let panel = |title| Panel {
        field_mm: Some(96.0),
        caption: vec!["PSNR 23.4 dB".to_owned()],
        ..Panel::square(title, 32, &values, Unit::AdcCounts)
    };
    SideBySide {
        header: "Letter R at 0.3 m".to_owned(),
        panels: vec![panel("raw"), panel("result")],
        footer: "simulated: virtual camera".to_owned(),
    }
}

fn figures() -> [Figure; 3] {
    let points = [(0.1, 10.0), (0.5, 20.0), (0.9, 30.0)];
    [
        images().into(),
        chart("one", &points).into(),
        Figure::grid(2, [chart("one", &points), chart("two", &points)]),
    ]
}

#[test]
fn no_text_of_a_figure_for_paper_is_below_8_points() {
    for style in FigureStyle::ALL {
        let look = style.look();
        for figure in figures() {
            let drawing = signed(figure.draw(&look), &look, &provenance());
            let texts = drawing.texts();
            assert!(texts.len() > 5, "{texts:?}");
            for (text, points) in texts {
                assert!(points >= 8.0 - 1e-9, "{style:?}: {points} points: {text}");
            }
        }
    }
}

#[test]
fn a_figure_has_the_width_of_its_place() {
    let mm = |style: FigureStyle, figure: &Figure| {
        let files = figure.files(style, &provenance());
        let svg = String::from_utf8(files[1].1.clone()).unwrap();
        let after = svg.split("width=\"").nth(1).unwrap();
        after.split("mm\"").next().unwrap().parse::<f64>().unwrap()
    };
    for figure in figures() {
        assert!((mm(FigureStyle::Paper, &figure) - 178.0).abs() < 0.1);
        assert!((mm(FigureStyle::Column, &figure) - 85.0).abs() < 0.1);
    }
    let single = Figure::Images(images().panels.remove(0).into());
    assert!((mm(FigureStyle::Paper, &single) - 85.0).abs() < 0.1);
}

/// The texts of an SVG, and the number of its images.
fn of_svg(svg: &str) -> (Vec<String>, usize) {
    let texts = svg.split("<text ").skip(1).map(|part| {
        let text = part.split_once('>').unwrap().1.split("</text>").next().unwrap();
        let plain = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
        plain.replace("&amp;", "&")
    });
    (texts.collect(), svg.matches("<image ").count())
}

/// The content of a PDF's page: the number of its texts, the letters of its font, and its images.
fn of_pdf(pdf: &[u8]) -> (usize, usize) {
    let mut texts = 0;
    let mut from = 0;
    let find = |from: usize, what: &[u8]| {
        pdf[from..].windows(what.len()).position(|part| part == what).map(|at| from + at)
    };
    while let Some(at) = find(from, b"stream\n") {
        let start = at + b"stream\n".len();
        let end = find(start, b"endstream").unwrap();
        let mut bytes = Vec::new();
        let mut unpacked = flate2::read::ZlibDecoder::new(&pdf[start..end]);
        if std::io::Read::read_to_end(&mut unpacked, &mut bytes).is_ok() && bytes.ends_with(b"ET") {
            texts += bytes.windows(2).filter(|pair| pair == b"BT").count();
        }
        from = end + b"endstream".len();
    }
    let images = pdf.windows(14).filter(|part| part == b"/Subtype /Imag").count();
    (texts, images)
}

#[test]
fn the_three_files_of_a_figure_have_the_same_texts_and_images() {
    for figure in figures() {
        let look = FigureStyle::Paper.look();
        let drawing = signed(figure.draw(&look), &look, &provenance());
        let texts: Vec<String> = drawing.texts().iter().map(|(t, _)| (*t).to_owned()).collect();
        let images = drawing.shapes.iter().filter(|s| matches!(s, Shape::Image { .. })).count();
        let files = figure.files(FigureStyle::Paper, &provenance());
        let svg = String::from_utf8(files[1].1.clone()).unwrap();
        assert_eq!(of_svg(&svg), (texts.clone(), images));
        let (count, found) = of_pdf(&files[2].1);
        assert_eq!((count, found), (texts.len(), images));
        // The PNG is this drawing, pixel by pixel.
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&files[0].1));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut png = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut png).unwrap();
        assert_eq!(png, drawing.raster().pixels().as_flattened());
    }
}

#[test]
fn the_csv_holds_every_point_of_every_curve() {
    let points = [(0.1, 10.0), (0.5, f64::NAN), (0.9, 30.5)];
    let files = Figure::from(chart("one", &points)).files(FigureStyle::Paper, &provenance());
    let endings: Vec<&str> = files.iter().map(|(ending, _)| *ending).collect();
    assert_eq!(endings, ["png", "svg", "pdf", "csv"]);
    let csv = String::from_utf8(files[3].1.clone()).unwrap();
    let rows: Vec<&str> = csv.lines().skip(1).collect();
    let expected = [
        "chart,curve,x axis,y axis,x,y",
        "one,\"ours, \"\"new\"\"\",\"distance, m\",PSNR <dB> & more,0.1,10",
        "one,\"ours, \"\"new\"\"\",\"distance, m\",PSNR <dB> & more,0.9,30.5",
        "one,theirs,\"distance, m\",PSNR <dB> & more,0.1,10",
        "one,theirs,\"distance, m\",PSNR <dB> & more,0.9,30.5",
    ];
    assert_eq!(rows, expected);
    assert!(csv.starts_with("# provenance: {"), "{csv}");
    assert_eq!(Figure::from(images()).files(FigureStyle::Paper, &provenance()).len(), 3);
}

#[test]
fn charts_with_one_legend_show_it_once() {
    let points = [(0.1, 10.0), (0.9, 30.0)];
    let named = |charts: Vec<Chart>| {
        let drawing = Figure::grid(2, charts).draw(&FigureStyle::Paper.look());
        let count = |name: &str| drawing.texts().iter().filter(|(text, _)| *text == name).count();
        (count("theirs"), count("simulated"))
    };
    let [one, two] = ["one", "two"].map(|header| chart(header, &points));
    assert_eq!(named(vec![one.clone(), two.clone()]), (1, 1));
    let mut other = two;
    other.lines[0].name = "another".to_owned();
    assert_eq!(named(vec![one, other]), (2, 1));
}

#[test]
fn the_provenance_is_in_every_file() {
    for figure in figures() {
        let files = figure.files(FigureStyle::Paper, &provenance());
        for (ending, bytes) in &files {
            let json = provenance().json();
            let text = String::from_utf8_lossy(bytes);
            let told = text.replace("&quot;", "\"").replace("\\(", "(").replace("\\)", ")");
            assert!(told.contains(&json), "{ending}");
        }
    }
}
