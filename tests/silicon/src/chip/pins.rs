//! Pins and their edges: GPIO (RM0456, 13) and EXTI (23).

use super::Chip;
use super::map::{EXTI, GPIO};

/// What a pin of the board's table is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Push-pull output.
    Output,
    /// Output that only pulls down.
    OpenDrain,
    /// Input with a resistor to ground.
    PulledDown,
    Analog,
    /// Alternate function of this number.
    Function(u32),
    /// Alternate function, open drain.
    Bus(u32),
    /// The PHY's own pins.
    Phy,
}

/// A pin of the board's table.
#[derive(Debug, Clone)]
pub struct Pin {
    pub name: String,
    pub port: usize,
    pub bit: usize,
    pub usage: Use,
}

impl Pin {
    fn place(&self) -> String {
        format!("P{}{} ({})", (b'A' + self.port as u8) as char, self.bit, self.name)
    }
}

/// What the board's pins do, by the alternate functions of ST's data sheet (DS13086, table 27).
#[must_use]
pub fn usage(name: &str) -> Use {
    match name {
        "fpga_sck" | "fpga_cs_n" | "fpga_io0" | "fpga_io1" | "fpga_io2" | "fpga_io3" => {
            Use::Function(10)
        }
        "config_sck" | "config_mosi" | "config_miso" => Use::Function(5),
        "tof_scl" | "tof_sda" => Use::Bus(4),
        "frame_ready" | "raw_ready" | "interlock" | "config_done" => Use::PulledDown,
        "thermistor" => Use::Analog,
        "config_program_n" => Use::OpenDrain,
        "usb_dp" | "usb_dm" => Use::Phy,
        _ => Use::Output,
    }
}

/// The rows of a board's `src/pins.rs`.
#[must_use]
pub fn table(source: &str) -> Vec<Pin> {
    let rows = source.lines().filter_map(|line| {
        let (name, rest) = line.trim().strip_suffix(';')?.split_once(": P")?;
        let (pin, _) = rest.split_once(" =>")?;
        let port = pin.bytes().next()?.checked_sub(b'A')?;
        let bit = pin.get(1..)?.parse().ok()?;
        Some(Pin { name: name.to_owned(), port: port.into(), bit, usage: usage(name) })
    });
    rows.collect()
}

/// The pins of the parallel port: the rows of the table in the board's README.
#[must_use]
pub fn parallel(readme: &str) -> Vec<Pin> {
    let rows = readme.lines().skip_while(|line| *line != "## Parallel port").filter_map(|line| {
        let mut cells = line.split('|').map(str::trim).skip(1);
        let (name, place) = (cells.next()?, cells.next()?.strip_prefix('P')?);
        let is_line = ["data", "clock", "valid", "ready"].iter().any(|kind| name.starts_with(kind));
        let port = place.bytes().next()?.checked_sub(b'A')?;
        Some((port, place.get(1..)?.parse().ok()?)).filter(|_| is_line)
    });
    let pins = rows.zip(super::pssi::FUNCTIONS).enumerate();
    pins.map(|(number, ((port, bit), function))| Pin {
        name: super::pssi::line(number),
        port: port.into(),
        bit,
        usage: Use::Function(function),
    })
    .collect()
}

/// Levels that come from outside.
#[derive(Debug, Default)]
pub struct Outside([[Option<bool>; 16]; 10]);

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const PUPDR: u32 = 0x0C;
const ODR: u32 = 0x14;

impl Chip {
    fn port(&self, port: usize, offset: u32) -> u32 {
        self.value(GPIO + 0x400 * port as u32 + offset)
    }

    /// The alternate function that a pin has now, if it has one.
    pub fn function(&self, port: usize, bit: usize) -> Option<u32> {
        (self.port(port, MODER) >> (2 * bit) & 3 == 2)
            .then(|| self.port(port, 0x20 + 4 * (bit as u32 / 8)) >> (4 * (bit % 8)) & 15)
    }

    /// Whether the pin of this name does what the table says.
    pub fn is_connected(&self, name: &str) -> bool {
        let pin = self.pins.iter().find(|pin| pin.name == name);
        pin.is_some_and(|pin| self.wrong(pin).is_none())
    }

    /// What is wrong with the setting of a pin.
    fn wrong(&self, pin: &Pin) -> Option<String> {
        let &Pin { port, bit, usage, .. } = pin;
        let field = |offset: u32| self.port(port, offset) >> (2 * bit) & 3;
        let open = self.port(port, OTYPER) >> bit & 1 == 1;
        let (mode, pull) = (field(MODER), field(PUPDR));
        let right = match usage {
            Use::Output => mode == 1 && !open,
            Use::OpenDrain => mode == 1 && open,
            Use::PulledDown => mode == 0 && pull == 2,
            Use::Analog => mode == 3,
            Use::Function(number) => self.function(port, bit) == Some(number),
            Use::Bus(number) => self.function(port, bit) == Some(number) && open,
            Use::Phy => true,
        };
        let found = match mode {
            0 => format!("an input, pull {pull}"),
            1 => format!("an output, open drain {open}"),
            2 => format!("function {:?}, open drain {open}", self.function(port, bit)),
            _ => "analog".to_owned(),
        };
        (!right).then(|| format!("{} is {found}, expected {usage:?}", pin.place()))
    }

    /// All pins whose setting differs from the board's table.
    #[must_use]
    pub fn wrong_pins(&self) -> Vec<String> {
        self.pins.iter().filter_map(|pin| self.wrong(pin)).collect()
    }

    pub(super) fn write_port(&mut self, port: usize, offset: u32, value: u32) {
        let base = GPIO + 0x400 * port as u32;
        let lit = self.is_lit();
        let data = self.value(base + ODR);
        match offset {
            0x18 => self.set(base + ODR, data & !(value >> 16) | value & 0xFFFF),
            0x28 => self.set(base + ODR, data & !(value & 0xFFFF)),
            MODER => {
                self.check_modes(port, self.value(base) ^ value);
                self.set(base, value);
            }
            0x10 => self.violation(format!("P{port}: IDR written")),
            _ => self.set(base + offset, value),
        }
        if port == 6
            && offset != 0x20
            && self.value(super::map::PWR + 0x10) >> 29 & 1 == 0
            && value >> 2 != 0
        {
            self.violation(
                "port G is used without IO2SV: its pins from 2 on have no supply".into(),
            );
        }
        if self.is_lit() != lit {
            self.light_changed(!lit);
        }
    }

    /// Only pins of the table, and those of the debugger, may change.
    fn check_modes(&mut self, port: usize, changed: u32) {
        for bit in (0..16).filter(|bit| changed >> (2 * bit) & 3 != 0) {
            let debugger = [(0, 13), (0, 14), (0, 15), (1, 3), (1, 4)].contains(&(port, bit));
            if !debugger && !self.pins.iter().any(|pin| (pin.port, pin.bit) == (port, bit)) {
                let port = (b'A' + port as u8) as char;
                self.violation(format!(
                    "P{port}{bit} is not in the board's table, and its mode is set"
                ));
            }
        }
    }

    /// The level of a pin.
    #[must_use]
    pub fn level(&self, port: usize, bit: usize) -> bool {
        let mode = self.port(port, MODER) >> (2 * bit) & 3;
        let open = self.port(port, OTYPER) >> bit & 1 == 1;
        let high = self.port(port, ODR) >> bit & 1 == 1;
        let outside = self.outside.0[port][bit];
        if mode == 1 && !(open && high) {
            return high;
        }
        // A pin without a level from outside: the chip's resistor, or a pull-up beside an open drain.
        outside.unwrap_or(self.port(port, PUPDR) >> (2 * bit) & 3 == 1 || mode == 1)
    }

    pub(super) fn levels(&self, port: usize) -> u32 {
        (0..16).map(|bit| u32::from(self.level(port, bit)) << bit).sum()
    }

    /// Sets a level from outside, and sees to the edge.
    pub fn drive(&mut self, port: usize, bit: usize, level: bool) {
        let was = self.level(port, bit);
        self.outside.0[port][bit] = Some(level);
        let is = self.level(port, bit);
        if was == is {
            return;
        }
        let source = self.value(EXTI + 0x60 + 4 * (bit as u32 / 4)) >> (8 * (bit % 4)) & 0xFF;
        let (selection, pending) = if is { (0x00, 0x0C) } else { (0x04, 0x10) };
        if source as usize == port && self.value(EXTI + selection) >> bit & 1 == 1 {
            self.set(EXTI + pending, self.value(EXTI + pending) | 1 << bit);
        }
    }

    /// Sets the level of the pin of this name.
    ///
    /// # Panics
    /// If the board has no such pin.
    pub fn drive_named(&mut self, name: &str, level: bool) {
        let (port, bit) = self.place(name);
        self.drive(port, bit, level);
    }

    /// Port and bit of the pin of this name.
    ///
    /// # Panics
    /// If the board has no such pin.
    #[must_use]
    pub fn place(&self, name: &str) -> (usize, usize) {
        let pin = self.pins.iter().find(|pin| pin.name == name);
        pin.map(|pin| (pin.port, pin.bit)).unwrap_or_else(|| panic!("no pin {name}"))
    }

    pub(super) fn write_exti(&mut self, offset: u32, value: u32) {
        let is_pending = matches!(offset, 0x0C | 0x10);
        let kept = if is_pending { self.value(EXTI + offset) & !value } else { value };
        self.set(EXTI + offset, kept);
    }

    /// Lines of the EXTI that ask for their interrupt.
    pub(super) fn edges(&self) -> u32 {
        let pending = self.value(EXTI + 0x0C) | self.value(EXTI + 0x10);
        pending & self.value(EXTI + 0x80) & 0xFFFF
    }
}
