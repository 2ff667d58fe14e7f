//! What the files of a board say agrees: pins in code, in its page and at the FPGA, settings, rules, aliases.

use nirspi_tests::root;
use nirspi_wire::usb;
use std::collections::BTreeSet;

/// Boards with pins.
const BOARDS: [&str; 2] = ["nucleo-u5a5zj-q", "nucleo-h7s3l8"];

/// Signal, pin, place on the board, where the wire goes.
type Row = [String; 4];

fn read(path: &str) -> String {
    let found = std::fs::read_to_string(root().join(path));
    found.unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// `name: PIN => "place", "wire";`
fn pins_in_code(board: &str) -> Vec<Row> {
    let code = read(&format!("boards/{board}/src/pins.rs"));
    let table = code.split_once("pin_table! { ($)\n").expect("a pin table").1;
    let table = table.split_once("\n}\n").expect("an end of the table").0;
    let lines = table.lines().map(str::trim).filter(|line| !line.starts_with("//"));
    lines
        .map(|line| {
            let (name, rest) = line.split_once(": ").expect(line);
            let (pin, rest) = rest.split_once(" => \"").expect(line);
            let (place, wire) = rest.split_once("\", \"").expect(line);
            [name, pin, place, wire.strip_suffix("\";").expect(line)].map(str::to_owned)
        })
        .collect()
}

/// ``| `name` | PIN | place | wire |``
fn pins_in_page(board: &str) -> Vec<Row> {
    let page = read(&format!("boards/{board}/README.md"));
    let (_, table) = page.split_once("| signal | pin |").expect("a table of pins");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    rows.map(|row| {
        let cells: Vec<String> =
            row.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect();
        cells.try_into().unwrap_or_else(|cells| panic!("{cells:?}"))
    })
    .collect()
}

#[test]
fn a_boards_page_shows_the_pins_of_its_code() {
    for board in BOARDS {
        let code = pins_in_code(board);
        assert!(code.len() > 15, "{board}: {code:?}");
        assert_eq!(pins_in_page(board), code, "{board}");
    }
}

#[test]
fn no_pin_and_no_place_is_used_twice() {
    for board in BOARDS {
        let rows = pins_in_code(board);
        let count = |column: usize| {
            rows.iter().map(|row| &row[column]).filter(|cell| !cell.contains("USB")).count()
        };
        let distinct = |column: usize| {
            let cells = rows.iter().map(|row| &row[column]).filter(|cell| !cell.contains("USB"));
            cells.collect::<BTreeSet<_>>().len()
        };
        for column in 0..4 {
            assert_eq!(distinct(column), count(column), "{board}, column {column}");
        }
    }
}

/// `FPGA J6.6 (D13) spi_sck` against `LOCATE COMP "spi_sck" SITE "H16"; # J6.6, D13`.
#[test]
fn a_wire_to_the_fpga_ends_where_the_constraints_have_that_signal() {
    let constraints = read("hdl/boards/ecp5-evn/board.lpf");
    for board in BOARDS {
        let rows = pins_in_code(board);
        let wires: Vec<_> = rows.iter().filter_map(|row| row[3].strip_prefix("FPGA ")).collect();
        assert_eq!(wires.len(), 8, "{board}: the host port and two lines");
        for wire in wires {
            let [place, arduino, signal] = wire.split(' ').collect::<Vec<_>>()[..] else {
                panic!("{board}: {wire}")
            };
            let signal = match signal.split_once("spi_io") {
                Some((_, index)) => format!("\"spi_io[{index}]\""),
                None => format!("\"{signal}\""),
            };
            let place = format!("# {place}, {}", arduino.trim_matches(['(', ')']));
            let line = constraints
                .lines()
                .find(|line| line.starts_with("LOCATE COMP") && line.contains(&signal))
                .unwrap_or_else(|| panic!("no {signal} in the constraints"));
            assert!(line.ends_with(&place), "{board}: {wire}, but {line}");
        }
    }
}

#[test]
fn the_crash_handler_turns_off_the_pin_that_enables_the_leds() {
    for board in BOARDS {
        let rows = pins_in_code(board);
        let pin = &rows.iter().find(|row| row[0] == "led_enable").expect("led_enable")[1];
        let (port, number) = pin[1..].split_at(1);
        let code = read(&format!("boards/{board}/src/pins.rs"));
        let off = format!("pac::GPIO{port}.bsrr().write(|bits| bits.set_br({number}, true));");
        assert!(code.contains(&off), "{board}: {pin}");
    }
}

#[test]
fn udev_rules_name_the_camera_and_come_before_the_seats() {
    for board in BOARDS {
        let rules = read(&format!("boards/{board}/60-nirspi.rules"));
        let rule = rules.lines().find(|line| !line.starts_with('#')).expect("a rule");
        for part in [
            format!("ATTR{{idVendor}}==\"{:04x}\"", usb::VENDOR_ID),
            format!("ATTR{{idProduct}}==\"{:04x}\"", usb::PRODUCT_ID),
            format!("ATTR{{product}}==\"{}\"", usb::PRODUCT),
            "TAG+=\"uaccess\"".to_owned(),
        ] {
            assert!(rule.contains(&part), "{board}: {part}");
        }
    }
}

#[test]
fn aliases_use_each_boards_own_settings() {
    let aliases = read(".cargo/config.toml");
    for board in BOARDS {
        let settings = read(&format!("boards/{board}/.cargo/config.toml"));
        assert!(settings.contains("probe-rs run --chip STM32"), "{board}");
        for command in ["build", "run"] {
            let alias = format!(
                "\"{command} --release --manifest-path boards/{board}/Cargo.toml \
                 --config boards/{board}/.cargo/config.toml\""
            );
            assert!(aliases.contains(&alias), "no alias {alias}");
        }
    }
}
