//! Tests that the files of a board agree with its `board.toml` and with each other: pins in the
//! code, on its page and at the FPGA, settings, scripts, tables of the pages, the host's list.

use nirspi::boards::{BOARDS, Board, Pins};
use nirspi_tests::root;
use nirspi_wire::usb;
use std::collections::BTreeSet;
use std::io::Write;
use std::process::Command;
use std::sync::LazyLock;

/// Every `boards/NAME/board.toml`, read anew: the host's list may be stale.
fn boards() -> &'static [Board] {
    static READ: LazyLock<Vec<Board>> = LazyLock::new(|| {
        let board = |name: String| {
            let text = read(&format!("boards/{name}/board.toml"));
            Board::parse(name.leak(), text.leak()).unwrap_or_else(|error| panic!("{error}"))
        };
        folders_with("board.toml").into_iter().map(board).collect()
    });
    &READ
}

/// Boards with a pin table.
fn wired() -> impl Iterator<Item = (&'static str, Pins)> {
    boards().iter().filter_map(|board| Some((board.name, board.pins?)))
}

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
    for (board, _) in wired() {
        let code = pins_in_code(board);
        assert!(code.len() > 15, "{board}: {code:?}");
        assert_eq!(pins_in_page(board), code, "{board}");
    }
}

#[test]
fn no_pin_and_no_place_is_used_twice() {
    for (board, _) in wired() {
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

/// `FPGA J6.5 (D12) spi_io[1]` against `LOCATE COMP "spi_io[1]" SITE "H18"; # J6.5, D12`.
#[test]
fn a_wire_to_the_fpga_ends_where_the_constraints_have_that_signal() {
    let constraints = read("hdl/boards/ecp5-evn/board.lpf");
    for (board, pins) in wired() {
        let rows = pins_in_code(board);
        let wires: Vec<_> = rows.iter().filter_map(|row| row[3].strip_prefix("FPGA ")).collect();
        assert_eq!(wires.len() as u64, pins.fpga_wires, "{board}: wires to the FPGA");
        for wire in wires {
            assert_located(&constraints, board, wire);
        }
    }
}

fn assert_located(constraints: &str, board: &str, wire: &str) {
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

/// The wires of a feature of one board's firmware: page, code and constraints.
#[test]
fn the_page_shows_the_wires_of_the_parallel_port() {
    let board = "nucleo-u5a5zj-q";
    let constraints = read("hdl/boards/ecp5-evn/board.lpf");
    let page = read(&format!("boards/{board}/README.md"));
    let (_, table) = page.split_once("| line | pin |").expect("a table of lines");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|row| row.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    for row in &rows {
        let wire = row[3].strip_prefix("FPGA ").expect("a wire to the FPGA");
        assert_located(&constraints, board, wire);
        let (_, signal) = wire.split_once("parallel_").expect("a line of the parallel port");
        assert_eq!(row[0].replace(' ', ""), signal.replace(['[', ']'], ""), "{row:?}");
    }
    let signals = constraints.lines().filter(|line| line.starts_with("LOCATE COMP \"parallel_"));
    assert_eq!(rows.len(), signals.count(), "every line has a wire");

    // The first lamp's pin is a line of the port.
    let code = read(&format!("boards/{board}/src/main.rs"));
    let (_, pins) = code.split_once("parallel::Parallel::new(").expect("the port's pins");
    let (pins, _) = pins.split_once("),\n    };").expect("an end of the pins");
    let used = pins.split([' ', '(', ')', ',', '\n']).filter_map(|word| match word {
        "pins.lamp_ready" => Some("PC7"),
        "p.DCMI" | "p.GPDMA1_CH3" | "p.TIM3" => None,
        pin => pin.strip_prefix("p."),
    });
    assert!(used.eq(rows.iter().map(|row| row[1])), "{pins}");
    let table = pins_in_code(board);
    for row in rows.iter().filter(|row| row[1] != "PC7") {
        let is_taken = table.iter().any(|other| other[1] == row[1] || other[2] == row[2]);
        assert!(!is_taken, "{row:?} is in the table of pins too");
    }
}

/// Port and number of a pin spelled as in `pattern`: `PF14` as `P{port}{number}` is `F` and `14`.
fn port_and_number<'p>(pattern: &str, pin: &'p str) -> Option<(&'p str, &'p str)> {
    let (before, after) = pattern.split_once("{number}").expect("{number} in pin_name");
    let pin = pin.strip_suffix(after)?;
    let (port, number) = match before.split_once("{port}") {
        Some((start, between)) => {
            let rest = pin.strip_prefix(start)?;
            (rest.get(..1)?, rest.get(1..)?.strip_prefix(between)?)
        }
        None => ("", pin.strip_prefix(before)?),
    };
    number.parse::<u8>().is_ok().then_some((port, number))
}

#[test]
fn pins_are_read_as_board_toml_spells_them() {
    assert_eq!(port_and_number("P{port}{number}", "PF14"), Some(("F", "14")));
    assert_eq!(port_and_number("PIN_{number}", "PIN_25"), Some(("", "25")));
    assert_eq!(port_and_number("P{port}_{number}", "P0_13"), Some(("0", "13")));
    assert_eq!(port_and_number("P{port}{number}", "PIN_25"), None);
}

#[test]
fn the_crash_handler_turns_off_the_pin_that_enables_the_leds() {
    for (board, pins) in wired() {
        let rows = pins_in_code(board);
        let pin = &rows.iter().find(|row| row[0] == "led_enable").expect("led_enable")[1];
        let Some((port, number)) = port_and_number(pins.pin_name, pin) else {
            panic!("{board}: {pin} is not spelled as {}, which board.toml says", pins.pin_name)
        };
        let off = pins.led_enable_low.replace("{port}", port).replace("{number}", number);
        let code = read(&format!("boards/{board}/src/pins.rs"));
        let leds_off = code.split_once("pub fn leds_off() {").expect("leds_off").1;
        let leds_off = leds_off.split_once("\n}\n").expect("an end of leds_off").0;
        assert!(leds_off.contains(&off), "{board}: no {off:?} in leds_off");
    }
}

#[test]
fn a_watchdog_runs_before_anything_waits() {
    for (board, _) in wired() {
        let code = read(&format!("boards/{board}/src/main.rs"));
        let steps = [
            "enter_bootloader_if_wished(",
            "clocks::start_watchdog();",
            "embassy_stm32::init(",
            "crash::on_crash(",
            "clocks::wait_for_supply();",
        ];
        let places = steps.map(|step| code.find(step).unwrap_or_else(|| panic!("{board}: {step}")));
        assert!(places.is_sorted(), "{board}: {steps:?} in this order");
    }
}

/// A camera that hangs restarts only if nothing but its own loop resets the watchdog: no interrupt
/// and no second task.
#[test]
fn the_cameras_loop_alone_feeds_the_watchdog() {
    let calls = |code: &str| code.matches(".feed_watchdog()").count();
    let pets = |code: &str| code.matches(".pet()").count();
    for board in boards() {
        let mut registers = 0;
        for (path, code) in sources(&format!("boards/{}/src", board.name)) {
            // The board's register, behind `Board::feed_watchdog` alone.
            let own =
                code.split_once("fn feed_watchdog(&mut self) {\n").map_or("", |(_, rest)| rest);
            let own = own.split_once("\n    }\n").map_or("", |(own, _)| own);
            assert_eq!(pets(&code), pets(own), "{path}: .pet() outside of feed_watchdog");
            registers += pets(own);
            // In `main`, before the loop begins: the load of the stored gateware.
            let main = code.split_once("async fn main(").map_or("", |(_, rest)| rest);
            let before_the_loop = main.split_once("\n    run(").map_or("", |(before, _)| before);
            assert_eq!(calls(&code), calls(before_the_loop), "{path}: feed_watchdog not in main");
        }
        assert_eq!(registers, usize::from(board.pins.is_some()), "{}", board.name);
    }
    for folder in ["app", "usb"] {
        for (path, code) in sources(&format!("boards/{folder}/src")) {
            let in_loop = usize::from(path == "boards/app/src/run.rs");
            assert_eq!((calls(&code), pets(&code)), (in_loop, 0), "{path}");
        }
    }
    let run = read("boards/app/src/run.rs");
    let calls_in_loop = run.split_once("    loop {\n        board.feed_watchdog();");
    assert!(calls_in_loop.is_some(), "once in each turn of the loop, first");
}

#[test]
fn the_udev_rule_names_the_camera() {
    let rules = read("boards/60-nirspi.rules");
    let rule = rules.lines().find(|line| !line.starts_with('#')).expect("a rule");
    for part in [
        format!("ATTR{{idVendor}}==\"{:04x}\"", usb::VENDOR_ID),
        format!("ATTR{{idProduct}}==\"{:04x}\"", usb::PRODUCT_ID),
        format!("ATTR{{product}}==\"{}\"", usb::PRODUCT),
        "TAG+=\"uaccess\"".to_owned(),
    ] {
        assert!(rule.contains(&part), "{part}");
    }
}

/// Rust files directly in a folder, with their paths from the root.
fn sources(folder: &str) -> Vec<(String, String)> {
    let entries = std::fs::read_dir(root().join(folder)).expect(folder);
    let names = entries.filter_map(|entry| entry.expect("an entry").file_name().into_string().ok());
    let paths = names.filter(|name| name.ends_with(".rs")).map(|name| format!("{folder}/{name}"));
    paths.map(|path| (path.clone(), read(&path))).collect()
}

/// Folders of `boards/` that have a file of this name.
fn folders_with(file: &str) -> BTreeSet<String> {
    let entries = std::fs::read_dir(root().join("boards")).expect("boards");
    let folders = entries.map(|entry| entry.expect("an entry").path());
    let found = folders.filter(|folder| folder.join(file).is_file());
    found.filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned())).collect()
}

#[test]
fn every_folder_with_a_memory_layout_is_a_board() {
    let described = folders_with("board.toml");
    assert_eq!(folders_with("memory.x"), described, "each needs a board.toml");
}

#[test]
fn the_list_of_the_host_program_is_that_of_the_files() {
    let path = root().join("host/files/src/boards/list.in");
    // What `Debug` prints of texts, numbers and `Option`s is Rust.
    let expected = format!("&{:#?}\n", boards());
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).expect("a written list");
    }
    let stale = "host/files/src/boards/list.in is stale: NIRSPI_BLESS=1 cargo test --test all boards writes it anew";
    assert!(std::fs::read_to_string(&path).unwrap_or_default() == expected, "{stale}");
    assert!(std::env::var_os("NIRSPI_BLESS").is_some() || BOARDS == boards(), "{stale}");
}

#[test]
fn a_boards_folder_is_its_package_and_its_settings_name_its_target_and_chip() {
    for Board { name, target, chip, .. } in boards() {
        let manifest = read(&format!("boards/{name}/Cargo.toml"));
        let package = format!("[package]\nname = \"{name}\"\n");
        assert!(manifest.starts_with(&package), "boards/{name}/Cargo.toml: no package {name}");
        let settings = read(&format!("boards/{name}/.cargo/config.toml"));
        let mut parts = vec![format!("target = \"{target}\""), format!("[target.{target}]")];
        parts.extend(chip.map(|chip| format!("probe-rs run --chip {chip}\"")));
        for part in parts {
            assert!(settings.contains(&part), "boards/{name}/.cargo/config.toml: no {part}");
        }
        let toolchain = read("boards/rust-toolchain.toml");
        let listed = format!("\"{target}\"");
        assert!(toolchain.contains(&listed), "boards/rust-toolchain.toml: no {target}");
    }
}

/// `boards/run.sh`, `boards/build.sh` and CI read these facts.
#[test]
fn shell_scripts_read_the_same_facts() {
    let shell = |command: &str| {
        let script = format!(". boards/facts.sh; {command}");
        let output = Command::new("bash").args(["-c", &script]).current_dir(root()).output();
        output.map(|output| {
            let text = if output.status.success() { output.stdout } else { output.stderr };
            (output.status.success(), String::from_utf8_lossy(&text).trim_end().to_owned())
        })
    };
    let Ok((true, names)) = shell("boards") else {
        return say("skipped: no bash");
    };
    assert_eq!(names, boards().iter().map(|board| board.name).collect::<Vec<_>>().join("\n"));
    for board in boards() {
        let name = board.name;
        let fact = |key: &str| shell(&format!("fact {name} {key}")).expect("bash");
        assert_eq!(fact("target"), (true, board.target.to_owned()));
        assert_eq!(fact("state"), (true, board.state.to_owned()));
        assert_eq!(fact("flash_bytes").1.replace('_', ""), board.flash_bytes.to_string());
        let elf = root().canonicalize().expect("a root").join(board.elf());
        assert_eq!(shell(&format!("elf {name}")).expect("bash").1, elf.display().to_string());
        let missing = format!("boards/{name}/board.toml: missing key colour");
        assert_eq!(fact("colour"), (false, missing));
    }
    let (found, error) = shell("fact toaster target").expect("bash");
    assert!(!found && error.starts_with("no board toaster, expected one of: "), "{error}");
}

/// Prints past the test harness's capture, so that a skipped test is visible.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Compares the rows of a page's table for which `is_row` holds with `rows`. `NIRSPI_BLESS=1`
/// writes them again.
fn check_rows(path: &str, header: &str, is_row: impl Fn(&str) -> bool, rows: &[String]) {
    let page = read(path);
    let lines: Vec<&str> = page.lines().collect();
    let header = lines.iter().position(|line| *line == header).expect(header);
    let is_other = |line: &&&str| line.starts_with('|') && !is_row(line);
    let start = header + 2 + lines[header + 2..].iter().take_while(is_other).count();
    let length = lines[start..].iter().take_while(|line| is_row(line)).count();
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        let (before, after) = (&lines[..start], &lines[start + length..]);
        let new = before.iter().copied().chain(rows.iter().map(String::as_str));
        let new: String =
            new.chain(after.iter().copied()).map(|line| format!("{line}\n")).collect();
        std::fs::write(root().join(path), new).expect(path);
        return;
    }
    assert_eq!(
        lines[start..start + length],
        *rows,
        "{path} is stale: NIRSPI_BLESS=1 cargo test --test all boards writes it anew"
    );
}

/// `65536` as `65 536`.
fn in_thousands(number: u64) -> String {
    match number {
        0..1000 => number.to_string(),
        _ => format!("{} {:03}", in_thousands(number / 1000), number % 1000),
    }
}

#[test]
fn tables_of_the_pages_show_what_board_toml_says() {
    let rows = |row: &dyn Fn(&Board) -> String| boards().iter().map(row).collect::<Vec<_>>();
    let boards = rows(&|board| {
        let Board { name, title, processor, target, host_link, fpga_link, state, .. } = board;
        let folder = format!("[`{name}`]({name}/README.md)");
        format!(
            "| {folder} | {title} | {processor} | `{target}` | {host_link} | {fpga_link} | {state} |"
        )
    });
    let header = "| folder | board | processor | target | host link | FPGA link | state |";
    check_rows("boards/README.md", header, |line| line.starts_with('|'), &boards);
    let states = rows(&|Board { name, title, state, .. }| {
        format!("| [{title}](boards/{name}/README.md) | {state} |")
    });
    check_rows("README.md", "| board | state |", |line| line.contains("](boards/"), &states);
    let budgets = rows(&|board| {
        let Board { name, flash_bytes, static_bytes, stack_bytes, .. } = *board;
        let [flash, statics, stack] = [flash_bytes, static_bytes, stack_bytes].map(in_thousands);
        format!("| `{name}` | {flash} | {statics} | {stack} |")
    });
    let header = "| board | flash, bytes | static memory, bytes | stack, bytes |";
    check_rows("docs/log/firmware.md", header, |line| line.starts_with('|'), &budgets);
}

/// The firmware does not depend on the optics' simulator, so each has the number of zones.
#[test]
fn the_simulated_depth_sensor_has_as_many_zones_as_the_boards() {
    let zones = format!("pub const DEPTH_SIDE: u8 = {};\n", nirspi_optics::DEPTH_SIDE);
    assert!(read("boards/app/src/ports.rs").contains(&zones), "boards/app: no {zones}");
}

/// Noise of an amplifier over its noise bandwidth `pi/2 B`, in nA rms at its input.
fn amplifier_noise_na(camera: &nirspi_optics::CameraModel) -> f64 {
    let bandwidth_hz = camera.amplifier.bandwidth_mhz * 1e6;
    let pa = camera.amplifier_noise_pa_per_sqrt_hz();
    pa * 1e-3 * (std::f64::consts::FRAC_PI_2 * bandwidth_hz).sqrt()
}

#[test]
fn the_electronics_are_a_camera_description_and_have_the_noise_of_their_circuit() {
    let camera = nirspi_optics::CameraModel::parse(&read("boards/electronics/camera.toml"));
    let camera = camera.expect("boards/electronics/camera.toml");
    let page = read("boards/electronics/README.md");
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.starts_with("| receiver's noise at its input |"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    let na = |cell: &str| -> f64 {
        let number = cell.strip_suffix(" nA rms").expect(cell);
        number.parse().expect(number)
    };
    let descriptions = [nirspi_optics::CameraModel::paper(), &camera];
    assert_eq!(rows.len(), descriptions.len(), "one row a description: {rows:?}");
    for (row, description) in rows.iter().zip(descriptions) {
        let simulated = amplifier_noise_na(description);
        assert!((na(row[3]) / simulated - 1.0).abs() < 0.01, "{simulated} against {row:?}");
    }
    assert!((na(rows[1][2]) / amplifier_noise_na(&camera) - 1.0).abs() < 0.03, "{rows:?}");
}

/// Whether a page shows this text as `shown`, in which `...` stands for anything.
fn is_shown_as(text: &str, shown: &str) -> bool {
    let mut pieces = shown.split("...");
    let first = pieces.next().expect("a first piece");
    let rest = text.strip_prefix(first).map(|rest| {
        pieces.try_fold(rest, |rest, piece| rest.split_once(piece).map(|(_, after)| after))
    });
    matches!(rest, Some(Some(rest)) if rest.is_empty() || shown.ends_with("..."))
}

#[test]
fn troubleshooting_lists_every_fault_with_the_flashes_of_its_lamp() {
    use nirspi_wire::Fault;
    use nirspi_wire::register::{DAMAGED, IDENTITY, NO_CLOCK};
    let absent =
        [0, IDENTITY, NO_CLOCK, DAMAGED, 0x1234].map(|identity| Fault::FpgaAbsent { identity });
    let others = [
        Fault::Interlock,
        Fault::OverTemperature { centi_celsius: 6_000 },
        Fault::TemperatureSensor,
        Fault::Duty,
        Fault::OverRange,
        Fault::FpgaConfiguration,
        Fault::FpgaStalled,
        Fault::FpgaWatchdog,
        Fault::HostSilent,
        Fault::BoardEnableStuck,
        Fault::FpgaEnableStuck,
    ];
    let page = read("docs/troubleshooting.md");
    let (_, table) = page.split_once("| the line says | red flashes |").expect("a table of faults");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect())
        .collect();
    for fault in others.into_iter().chain(absent) {
        let text = fault.to_string();
        let row = rows.iter().find(|row| is_shown_as(&text, row[0].trim_matches('`')));
        let row = row.unwrap_or_else(|| panic!("no row for {text:?}"));
        assert_eq!(row[1], nirspi_mcu::flashes(fault).to_string(), "{text}");
    }
}
