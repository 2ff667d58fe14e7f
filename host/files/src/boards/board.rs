//! One board, as described in `boards/NAME/board.toml`.
//!
//! `board.toml` is TOML of the simplest form, which a shell script can read too
//! (`boards/facts.sh`): one `key = value` a line. A value is a `"text"` or a whole number. A
//! comment has its own line.

/// A board under `boards/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Board {
    /// The name of the board's folder, package and program, and its name on the wire.
    pub name: &'static str,
    /// The title of the board for users.
    pub title: &'static str,
    /// Its microcontroller, or the core that an emulator runs.
    pub processor: &'static str,
    /// The chip's name in probe-rs; `None` for an emulated board, which has no flash to program.
    pub chip: Option<&'static str>,
    /// The Rust target of its firmware.
    pub target: &'static str,
    /// The link to the host.
    pub host_link: &'static str,
    /// The link to the FPGA.
    pub fpga_link: &'static str,
    /// What has been tested with the board.
    pub state: &'static str,
    /// The most flash that its firmware may use.
    pub flash_bytes: u64,
    /// The most static memory that its firmware may use.
    pub static_bytes: u64,
    /// The least room for the stack.
    pub stack_bytes: u64,
    /// The longest bitstream of gateware that a host can load through it; `None` for an emulated board.
    pub staging_bytes: Option<u64>,
    /// Its pins; `None` for an emulated board.
    pub pins: Option<Pins>,
}

/// The properties with which tests check a board's pin table (`src/pins.rs`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pins {
    /// Number of wires to the FPGA: the host port and its ready lines.
    pub fpga_wires: u64,
    /// The name of a pin in the board's code, with `{port}` (one letter, if there are ports) and
    /// `{number}`.
    pub pin_name: &'static str,
    /// The statement that pulls the pin `led_enable` low, with `{port}` and `{number}` of that pin.
    pub led_enable_low: &'static str,
}

/// Keys of every board.
const KEYS: [&str; 10] = [
    "title",
    "kind",
    "processor",
    "target",
    "host_link",
    "fpga_link",
    "state",
    "flash_bytes",
    "static_bytes",
    "stack_bytes",
];
/// Keys of boards with `kind = "hardware"`.
const HARDWARE_KEYS: [&str; 5] =
    ["chip", "staging_bytes", "fpga_wires", "pin_name", "led_enable_low"];

#[derive(Clone, Copy)]
enum Value {
    Text(&'static str),
    Number(u64),
}

struct Table {
    name: &'static str,
    entries: Vec<(&'static str, Value)>,
}

impl Table {
    fn error(&self, what: impl std::fmt::Display) -> String {
        format!("boards/{}/board.toml: {what}", self.name)
    }

    fn read(name: &'static str, text: &'static str) -> Result<Self, String> {
        let mut table = Self { name, entries: Vec::new() };
        for (index, line) in text.lines().enumerate() {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let entry = line.split_once(" = ").and_then(|(key, text)| Some((key, value(text)?)));
            let Some((key, value)) = entry else {
                return Err(table.error(format_args!(
                    "line {} is {line:?}, expected key = \"text\" or key = 12_345, and comments on lines of their own",
                    index + 1
                )));
            };
            if !KEYS.contains(&key) && !HARDWARE_KEYS.contains(&key) {
                let known = [&KEYS[..], &HARDWARE_KEYS].concat().join(", ");
                return Err(table.error(format_args!("unknown key {key}, expected one of {known}")));
            }
            if table.find(key).is_some() {
                return Err(table.error(format_args!("key {key} is there twice")));
            }
            table.entries.push((key, value));
        }
        Ok(table)
    }

    fn find(&self, key: &str) -> Option<Value> {
        self.entries.iter().find(|(found, _)| *found == key).map(|(_, value)| *value)
    }

    fn value(&self, key: &str) -> Result<Value, String> {
        self.find(key).ok_or_else(|| self.error(format_args!("missing key {key}")))
    }

    fn text(&self, key: &str) -> Result<&'static str, String> {
        match self.value(key)? {
            Value::Text(text) => Ok(text),
            Value::Number(_) => Err(self.error(format_args!("{key} must be a \"text\""))),
        }
    }

    fn number(&self, key: &str) -> Result<u64, String> {
        match self.value(key)? {
            Value::Number(number) => Ok(number),
            Value::Text(_) => Err(self.error(format_args!("{key} must be a whole number"))),
        }
    }
}

/// The value `"text"` or `12_345`.
fn value(text: &'static str) -> Option<Value> {
    if let Some(text) = text.strip_prefix('"') {
        let text = text.strip_suffix('"')?;
        return (!text.is_empty() && !text.contains(['"', '\\'])).then_some(Value::Text(text));
    }
    text.replace('_', "").parse().ok().map(Value::Number)
}

impl Board {
    /// Reads the text of `boards/NAME/board.toml`.
    ///
    /// # Errors
    /// One line with the file, the problem, and what was expected.
    pub fn parse(name: &'static str, text: &'static str) -> Result<Self, String> {
        let table = Table::read(name, text)?;
        let is_hardware = match table.text("kind")? {
            "hardware" => true,
            "emulated" => false,
            other => {
                return Err(table.error(format_args!(
                    "kind is {other:?}, expected \"hardware\" or \"emulated\""
                )));
            }
        };
        if let Some(key) =
            HARDWARE_KEYS.iter().find(|key| !is_hardware && table.find(key).is_some())
        {
            return Err(
                table.error(format_args!("an emulated board has no {key}: leave that key out"))
            );
        }
        let hardware = |key| if is_hardware { table.text(key).map(Some) } else { Ok(None) };
        let pins = match (hardware("pin_name")?, hardware("led_enable_low")?) {
            (Some(pin_name), Some(led_enable_low)) => {
                let fpga_wires = table.number("fpga_wires")?;
                Some(Pins { fpga_wires, pin_name, led_enable_low })
            }
            _ => None,
        };
        let staging_bytes = is_hardware.then(|| table.number("staging_bytes")).transpose()?;
        Ok(Self {
            name,
            title: table.text("title")?,
            processor: table.text("processor")?,
            chip: hardware("chip")?,
            target: table.text("target")?,
            host_link: table.text("host_link")?,
            fpga_link: table.text("fpga_link")?,
            state: table.text("state")?,
            flash_bytes: table.number("flash_bytes")?,
            static_bytes: table.number("static_bytes")?,
            stack_bytes: table.number("stack_bytes")?,
            staging_bytes,
            pins,
        })
    }
}
