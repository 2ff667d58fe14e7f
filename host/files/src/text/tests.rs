mod reference;

use super::*;
use crate::testing::{file, line};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

fn table(content: &str) -> (Vec<usize>, Vec<f64>) {
    let (_folder, path) = file("y.txt", content.as_bytes());
    match read(&path, false).unwrap().numbers {
        Numbers::Table(field) => (field.shape, field.real),
        Numbers::Columns(columns) => panic!("{columns:?}"),
    }
}

/// A table as bits, because NaN differs from itself; or the refusal.
fn seen(read: Result<Text, FileError>) -> String {
    let bits = |field: &Field| -> Vec<u64> { field.real.iter().map(|v| v.to_bits()).collect() };
    match read {
        Err(error) => error.to_string(),
        Ok(Text { numbers: Numbers::Table(field), skipped }) => {
            format!("{:?} {:?} {skipped:?}", field.shape, bits(&field))
        }
        Ok(Text { numbers: Numbers::Columns(columns), skipped }) => {
            let columns: Vec<_> =
                columns.iter().map(|(name, field)| (name, &field.shape, bits(field))).collect();
            format!("{columns:?} {skipped:?}")
        }
    }
}

const CELLS: [&str; 40] = [
    "1",
    "1.5",
    "-2",
    "3e-1",
    "1,5",
    "0,05",
    "2,5E-3",
    "nan",
    "NaN",
    "null",
    "",
    " ",
    "#N/A",
    "-1.#IND",
    "OL",
    "overload",
    "∞",
    "-∞",
    "−3",
    "1.25D+01",
    "np.float64(1.5)",
    "\"7\"",
    "\"a, b\"",
    "word",
    "two words",
    "10:00:01",
    "1.5.2",
    "+4",
    ".5",
    "inf",
    "-inf",
    "d",
    "1d",
    "0x10",
    "1_000",
    "\u{a0}6",
    "µV",
    "(V)",
    "Volt",
    "\"",
];

fn text() -> impl Strategy<Value = String> {
    let cell = prop_oneof![6 => "[0-9]{1,3}(\\.[0-9]{1,3})?", 1 => select(&CELLS[..]).prop_map(str::to_owned)];
    let mark = select(&[",", ";", "\t", " ", ", ", ";\t", "  "][..]);
    let end = select(&["\n", "\r\n", "\r", " \n"][..]);
    let lines = vec(vec(cell, 1..5), 1..24);
    let width = prop_oneof![4 => (1_usize..5).prop_map(Some), 1 => Just(None)];
    let before = vec("[ -~µ]{0,20}", 0..4);
    (lines, width, mark, end, before, 0_u8..8).prop_map(|(lines, width, mark, end, before, odd)| {
        let mut text = String::new();
        if odd & 1 == 1 {
            before.iter().for_each(|line| text += &format!("{line}{end}"));
        }
        if odd == 6 {
            text = format!("sep={mark}{end}{text}");
        }
        for cells in lines {
            let cells = match width {
                Some(width) => cells.iter().cycle().take(width).cloned().collect(),
                None => cells,
            };
            text += &cells.join(mark);
            if odd & 2 == 2 {
                text += mark;
            }
            text += end;
        }
        text
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]
    #[test]
    fn a_text_gives_the_table_of_the_simple_reader(text in text(), decimal_comma: bool) {
        let path = Path::new("y.csv");
        let fast = seen(read_str(path, text.clone(), decimal_comma));
        prop_assert_eq!(fast, seen(reference::read(path, &text, decimal_comma)));
    }
}

/// Processor time and time of the reader and of the simple one, in MB/s of a text of 100 MB, medians of five in turn:
/// `cargo test --release -p nirspi-files --lib text_a_second -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes, and prints figures"]
fn text_a_second() {
    fn processor_s() -> f64 {
        let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
        let fields = stat.rsplit_once(") ").unwrap().1.split(' ');
        fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().unwrap() / 100.0).sum()
    }
    fn median(mut of: Vec<f64>) -> f64 {
        of.sort_by(f64::total_cmp);
        of[of.len() / 2]
    }
    let value = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 8) * 1e-5;
    let one: String = (0..11_000_000).map(|k| format!("{:.4}\n", value(k) % 1000.0)).collect();
    let row = |k: u32| {
        let [a, b, c, d] = [1, 2, 3, 4].map(|j| value(k * j) % 10.0);
        format!("{:.6},{a:.5},{b:.5},{c:.5},{d:.5}\n", f64::from(k) * 1e-6)
    };
    let five: String = (0..2_700_000).map(row).collect();
    let five = format!("Model,X1\nDate,today\n\ntime,CH1,CH2,CH3,CH4\ns,V,V,V,V\n{five}");
    let path = Path::new("y.csv");
    for (name, text) in [("one column", one), ("five columns, preamble", five)] {
        let mut times = [const { Vec::new() }; 4];
        for _ in 0..5 {
            for (at, is_fast) in [(0, true), (2, false)] {
                let given = text.clone();
                let (processor, began) = (processor_s(), std::time::Instant::now());
                let found = match is_fast {
                    true => read_str(path, given, false),
                    false => reference::read(path, &given, false),
                };
                times[at + 1].push(began.elapsed().as_secs_f64());
                times[at].push(processor_s() - processor);
                found.unwrap();
            }
        }
        let megabytes = text.len() as f64 * 1e-6;
        let [a, b, c, d] = times.map(|times| megabytes / median(times));
        println!(
            "{name}, {megabytes:.0} MB: processor {a:.0} MB/s, time {b:.0} MB/s; before {c:.0}, {d:.0}"
        );
    }
}

/// Lines of many pieces and blocks, and an error in one of the last.
#[test]
fn a_long_text_gives_the_table_of_the_simple_reader() {
    let row = |k: usize| format!("{k},{}.{:02},{}\n", k % 777, k % 100, k * k % 1001);
    let plain: String = (0..140_000).map(row).collect();
    assert!(plain.len() > 2 * PIECE);
    let path = Path::new("y.csv");
    let wrong = plain.clone() + "1,2\n" + &plain + "x,2,3\n";
    let word = plain.clone() + "1,two,3\n1,2\n" + &plain;
    for text in [
        plain.clone(),
        format!("# log\nt,a,b\n{plain}"),
        format!("A meter\nmade: today\n\nt,a,b\n{plain}total,of,all\n"),
        wrong,
        word,
    ] {
        let simple = seen(reference::read(path, &text, false));
        assert!(seen(read_str(path, text, false)) == simple, "{simple:.200}");
    }
}

#[test]
fn numbers_are_read_however_a_spreadsheet_writes_them() {
    assert_eq!(table("1.5\n-2\n3e-1\n"), (vec![3, 1], vec![1.5, -2.0, 0.3]));
    assert_eq!(table("1.5, 2\n3,4.5\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.5]));
    assert_eq!(table("1,5;2;\n3;4,25;\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.25]));
    assert_eq!(table("1,5\t2\r\n3\t4\r\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.0]));
    assert_eq!(table("# log\n1 2 3\n"), (vec![1, 3], vec![1.0, 2.0, 3.0]));
    assert_eq!(table("1,2,3\n4,5,6\n").0, [2, 3]);
    assert_eq!(table("voltage of the wing\n1\n2\n3 ").1, [1.0, 2.0, 3.0]);
    // A byte that is not valid UTF-8, as in a heading of another code page.
    let (_folder, path) = file("y.txt", b"U in \xb5V\n1\n2\n");
    assert!(
        matches!(read(&path, false).unwrap().numbers, Numbers::Table(field) if field.real == [1.0, 2.0])
    );
}

#[test]
fn text_in_utf_16_is_known_by_its_beginning() {
    let text = "\u{feff}d\r\n1,5\r\n";
    for bytes_of in [u16::to_le_bytes, u16::to_be_bytes] {
        let bytes: Vec<u8> = text.encode_utf16().flat_map(bytes_of).collect();
        // Only the first bytes of a file are looked at, which may end within a character.
        assert!(is_start(&bytes) && is_start(&bytes[..7]), "{bytes:?}");
    }
    assert!(is_start(b"\xef\xbb\xbf1\n") && !is_start(b"\xff\xfe\x01\x00\x02\x00"));
}

#[test]
fn a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not() {
    assert_eq!(table("0,5\n0,05\n").1, [0.5, 0.05]);
    assert_eq!(table("1,5E-3\n2,5E-3\n").1, [0.0015, 0.0025]);
    assert_eq!(table("1,5\n2\n").1, [1.5, 2.0]);
    assert_eq!(table("1,5 2,5\n3 4\n").1, [1.5, 2.5, 3.0, 4.0]);
    let (_folder, path) = file("y.txt", b"1,5\n2,5\n");
    let message = line(&read(&path, false).err().unwrap(), "y.txt");
    assert!(message.contains("one comma a line") && message.contains("--decimal-comma"));
    let Numbers::Table(field) = read(&path, true).unwrap().numbers else { panic!("a table") };
    assert_eq!(field.real, [1.5, 2.5]);
    let (_folder, path) = file("y.csv", b"h_row,d\n0,15\n3,-4\n");
    let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!("columns") };
    assert_eq!(columns[1].1.real, [15.0, -4.0]);
    let (_folder, path) = file("y.txt", b"1,5;2.5\n");
    assert!(line(&read(&path, false).err().unwrap(), "y.txt").contains("points and commas"));
}

#[test]
fn numbers_are_read_however_programs_print_them() {
    let printed = "np.float64(1.5)\nnp.float64(-2)\n1.25D+01\n\u{2212}3\n";
    assert_eq!(table(printed).1, [1.5, -2.0, 12.5, -3.0]);
    let (_, found) = table("1\n#N/A\n-1.#IND\nOL\n-\u{221e}\n".replace("\n#", "\n\"#").as_str());
    assert!(found[1].is_nan() && found[2].is_nan(), "{found:?}");
    assert_eq!([found[0], found[3], found[4]], [1.0, OVERLOAD, -OVERLOAD]);
    assert_eq!(table("1.5\r2.5\r").1, [1.5, 2.5]);
    assert_eq!(table("sep=;\n1,5;2\n3;4,5\n").1, [1.5, 2.0, 3.0, 4.5]);
    let (_folder, path) = file("y.csv", b",y\n0,1.5\n1,2.5\n");
    let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!() };
    assert_eq!((&*columns[1].0, &columns[1].1.real), ("y", &vec![1.5, 2.5]));
}

#[test]
fn a_heading_names_the_columns_and_words_for_unread_are_nan() {
    let (_folder, path) = file("y.csv", b"h_row; d\n0;1,5\n3;null\n2;\n1;NaN\n");
    let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!("columns") };
    assert_eq!([&columns[0].0, &columns[1].0], ["h_row", "d"]);
    assert_eq!(columns[0].1.real, [0.0, 3.0, 2.0, 1.0]);
    let d = &columns[1].1.real;
    assert!(d[0] == 1.5 && d[1..].iter().all(|v| v.is_nan()) && d.len() == 4, "{d:?}");
}

#[test]
fn what_is_no_number_is_named_with_its_line() {
    for (content, found) in [
        ("1\n2\nthree\n", "\"three\" in line 3"),
        ("1 2\n3\n", "1 numbers in line 2"),
        ("a b\n", "without numbers"),
        ("1,2;x\n", "\"x\" in line 1"),
        ("1.5.2\n2\n3\n", "\"1.5.2\" in line 1"),
    ] {
        let (_folder, path) = file("y.txt", content.as_bytes());
        let message = line(&read(&path, false).err().unwrap(), "y.txt");
        assert!(message.contains(found), "{message}");
    }
}
