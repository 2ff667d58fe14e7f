use super::number::OVERLOAD;
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

proptest! {
    /// Whatever the marks between and behind numbers, the ends of lines, and the lines before the table.
    #[test]
    fn a_table_is_read_as_it_was_written(
        numbers in vec(-1e4_f64..1e4, 1..60),
        width in 1_usize..5,
        mark in select(&[", ", ";", "\t", " ", ";\t", "  "][..]),
        end in select(&["\n", "\r\n", "\r", " \n"][..]),
        is_closed: bool,
        is_headed: bool,
    ) {
        let rows: Vec<&[f64]> = numbers.chunks_exact(width).collect();
        prop_assume!(!rows.is_empty());
        let line = |row: &[f64]| row.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(mark);
        let close = if is_closed && mark == ";" { mark } else { "" };
        let mut text = if is_headed { format!("# a log{end}") } else { String::new() };
        rows.iter().for_each(|row| text += &format!("{}{close}{end}", line(row)));
        let read = read_str(Path::new("y.csv"), text, false).unwrap();
        let Numbers::Table(found) = read.numbers else { panic!("a table") };
        prop_assert_eq!(found.shape, [rows.len(), width]);
        prop_assert_eq!(found.real, rows.concat());
    }

    /// A refusal names a line; nothing else is lost or panics.
    #[test]
    fn any_text_is_read_or_refused(text in "([0-9.,;\\-eE \t\"a#%µ∞]{0,12}\r?\n){0,24}", decimal_comma: bool) {
        match read_str(Path::new("y.csv"), text, decimal_comma) {
            Ok(Text { numbers: Numbers::Table(field), .. }) => {
                prop_assert_eq!(field.shape.iter().product::<usize>(), field.real.len());
            }
            Ok(Text { numbers: Numbers::Columns(columns), .. }) => {
                let length = columns[0].1.real.len();
                prop_assert!(columns.iter().all(|(_, field)| field.real.len() == length));
            }
            Err(error) => prop_assert!(error.to_string().starts_with("y.csv: ")),
        }
    }
}

/// Lines of many pieces and blocks, and an error in one of the last.
#[test]
fn a_long_text_is_one_table_and_its_first_error_is_told() {
    const LINES: usize = 140_000;
    let of = |k: usize| [(k % 777) as f64, (k % 100) as f64 / 4.0, (k * k % 1001) as f64];
    let row = |k: usize| of(k).map(|v| v.to_string()).join(",") + "\n";
    let plain: String = (0..LINES).map(row).collect();
    assert!(plain.len() > PIECE && LINES > 2 * BLOCK);
    let path = Path::new("y.csv");
    let read = |text: String| read_str(path, text, false);
    let numbers: Vec<f64> = (0..LINES).flat_map(of).collect();
    let Numbers::Table(found) = read(plain.clone()).unwrap().numbers else { panic!("a table") };
    assert!(found.shape == [LINES, 3] && found.real == numbers);
    for before in ["# log\nt,a,b\n", "A meter\nmade: today\n\nt,a,b\n"] {
        let headed = read(format!("{before}{plain}")).unwrap().numbers;
        let Numbers::Columns(columns) = headed else { panic!("columns") };
        for (at, (name, field)) in columns.iter().enumerate() {
            assert_eq!(name, ["t", "a", "b"][at]);
            assert!(field.real.iter().copied().eq((0..LINES).map(|k| of(k)[at])), "{name}");
        }
    }
    let wrong = plain.clone() + "1,2\n" + &plain + "x,2,3\n";
    let told = read(wrong).err().unwrap().to_string();
    assert!(told.contains("2 numbers in line 140001"), "{told}");
    let word = plain.clone() + "1,two,3\n1,2\n" + &plain;
    let told = read(word).err().unwrap().to_string();
    assert!(told.contains("\"two\" in line 140001"), "{told}");
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
    // A date is no number with points.
    let (_folder, path) =
        file("y.txt", ("t;y\n".to_owned() + &"20.11.2026 10:00;1,5\n".repeat(8)).as_bytes());
    let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!("columns") };
    assert_eq!((&*columns[0].0, columns[0].1.real.last()), ("y", Some(&1.5)));
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

#[test]
fn lists_in_brackets_are_rows() {
    for (list, shape) in [
        ("[1, 2.5, 3]", [1, 3]),
        ("{1,2.5,3}\r\n", [1, 3]),
        ("[1. 2.5\n 3. ]", [1, 3]),
        ("[np.float64(1.0), np.float64(2.5), np.float64(3.0)]", [1, 3]),
        ("[[1, 2.5, 3], [1, 2.5, 3]]", [2, 3]),
        ("((1, 2.5, 3),\n (1, 2.5, 3),)", [2, 3]),
    ] {
        let expected = [1.0, 2.5, 3.0].repeat(shape[0]);
        assert_eq!(table(list), (shape.to_vec(), expected), "{list}");
    }
}

#[test]
fn numbers_behind_the_names_that_the_arduinos_plotter_shows_are_columns() {
    type Columns = Vec<(String, Vec<f64>)>;
    let columns = |content: &str| -> Result<Columns, String> {
        let (_folder, path) = file("y.txt", content.as_bytes());
        let read = read(&path, false).map_err(|error| line(&error, "y.txt"))?;
        let Numbers::Columns(columns) = read.numbers else { panic!("columns") };
        Ok(columns.into_iter().map(|(name, field)| (name, field.real)).collect())
    };
    let of = |name: &str, numbers: [f64; 2]| (name.to_owned(), numbers.to_vec());
    assert_eq!(columns("A0:1.5\r\nA0:-2\r\n"), Ok(vec![of("A0", [1.5, -2.0])]));
    let two = Ok(vec![of("light", [71.0, 72.0]), of("limit", [90.0, 90.0])]);
    assert_eq!(columns("light:71,limit:90\nlight:72,limit:90\n"), two);
    assert_eq!(columns("light:71\tlimit:90\n\nlight:72\tlimit:90\n"), two);
    for other in ["A0:1\nA1:2\n", "A0:1\nA0:\n", "A0:1\nA0:1,A1:2\n", "10:02\n10:03\n"] {
        assert!(columns(other).unwrap_err().contains(", expected "), "{other}");
    }
}

#[test]
fn words_of_instruments_for_no_reading_and_for_too_much() {
    let (_, numbers) = table("1.5\n--\n---\nO.L\n2\n");
    assert!(numbers[1].is_nan() && numbers[2].is_nan());
    assert_eq!((numbers[0], numbers[3], numbers[4]), (1.5, 9.9e37, 2.0));
    for unread in ["#VALUE!", "#DIV/0!", "#REF!", "1.#IND", "-1.#QNAN", "nan(ind)", "-nan(ind)"] {
        let (_, numbers) = table(&format!("0,1.5\n1,{unread}\n2,3.5\n"));
        assert!(numbers[3].is_nan() && numbers[5] == 3.5, "{unread}");
    }
    for over in ["Over", "OVERFLOW", "1.#INF"] {
        assert_eq!(table(&format!("1.5\n{over}\n-1.#INF\n")).1, [1.5, OVERLOAD, -OVERLOAD]);
    }
}

#[test]
fn what_is_in_quotes_is_one_cell() {
    for (heading, names) in [
        ("\"time, s\",\"signal, V\"", ["time, s", "signal, V"]),
        ("time,\"Power, W\"", ["time", "Power, W"]),
        ("\"time\",\"y\"", ["time", "y"]),
    ] {
        for row in ["0.5,15\n", "\"0.5\",\"15\"\n"] {
            let content = format!("{heading}\n{}", row.repeat(9));
            let (_folder, path) = file("y.csv", content.as_bytes());
            let read = read(&path, false).unwrap();
            let Numbers::Columns(columns) = read.numbers else { panic!("columns of {content}") };
            let found: Vec<&str> = columns.iter().map(|(name, _)| &**name).collect();
            assert_eq!(found, names);
            assert_eq!((columns[0].1.real[8], columns[1].1.real[8]), (0.5, 15.0), "{content}");
        }
    }
    // Two names in quotes head one column each, however many commas they have.
    let (_folder, path) = file("y.csv", b"\"time, s\",y\n0,15\n3,-4\n");
    let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!("columns") };
    assert_eq!((&*columns[0].0, &columns[1].1.real), ("time, s", &vec![15.0, -4.0]));
}

#[test]
fn thousands_may_be_grouped_where_no_mark_is_a_separator() {
    assert_eq!(table("\"83,770.02\"\n\"1,234,567\"\n\"12.5\"\n").1, [83770.02, 1_234_567.0, 12.5]);
    assert_eq!(table("0,5;83.770,02\n1,5;-1.234.567\n").1, [0.5, 83770.02, 1.5, -1_234_567.0]);
    // One mark and no decimals may be a decimal mark; groups have three digits.
    for other in ["\"83,770\"\n\"1.5\"\n", "\"83,77.02\"\n\"1.5\"\n", "0,5;1.5,3.7\n2,5;1,5\n"] {
        let (_folder, path) = file("y.csv", other.as_bytes());
        let message = line(&read(&path, false).err().unwrap(), "y.csv");
        assert!(message.contains(", expected "), "{other}: {message}");
    }
}
