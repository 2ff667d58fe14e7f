//! The watchdog (RM0456, 61), the ADC (33), I2C1 (62) and SPI1 (68).
//!
//! Assumed: LSI at 32 kHz; a conversion of 16 samples takes 22 us; the thermistor is at 25 degrees. I2C1 has nobody at its
//! other end, or a bus that somebody holds low.

use super::map::{I2C1, RCC, SPI1};
use super::{Cause, Chip};
use std::collections::VecDeque;

const US: u64 = 1_000_000;
const LSI_HZ: u64 = 32_000;

#[derive(Debug, Default)]
pub struct Watchdog {
    fed_ps: Option<u64>,
    prescaler: u32,
    reload: u64,
    unlocked: bool,
    /// The longest time between two feeds.
    pub longest_ps: u64,
}

impl Watchdog {
    /// After a reset; the longest time of before stays.
    pub fn new(longest_ps: u64) -> Self {
        Self { reload: 0xFFF, longest_ps, ..Self::default() }
    }

    pub fn due(&self) -> u64 {
        let clocks = (self.reload + 1) * (4 << self.prescaler.min(7));
        self.fed_ps.map_or(u64::MAX, |fed| fed + clocks * (1_000_000_000_000 / LSI_HZ))
    }
}

#[derive(Debug, Default)]
pub struct Adc {
    flags: u32,
    calibrated_ps: u64,
    enabled_ps: u64,
    ends_ps: u64,
    /// Of 14 bits.
    pub reading: u32,
}

impl Adc {
    pub fn new(reading: u32) -> Self {
        Self { reading, ..Self::default() }
    }
}

/// Who is on the bus of I2C1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnTheBus {
    Nobody,
    /// The clock's line is held low for ever: the bus is busy at first, and no start ends.
    Stuck,
}

#[derive(Debug)]
pub struct I2c {
    flags: u32,
    pub other: OnTheBus,
    /// The time at which the address has had no answer.
    refused_ps: u64,
}

impl I2c {
    pub fn new(other: OnTheBus) -> Self {
        let busy = if other == OnTheBus::Stuck { 1 << 15 } else { 0 };
        Self { flags: 1 | busy, other, refused_ps: u64::MAX }
    }

    pub fn due(&self) -> u64 {
        self.refused_ps
    }
}

/// Who is at the other end of SPI1: bytes out, bytes in.
pub trait SpiDevice {
    fn exchange(&mut self, byte: u8) -> u8;
    fn select(&mut self, selected: bool);
    fn program(&mut self, low: bool, now_us: u64);
    fn done(&self) -> bool;
    /// The bitstream that came last.
    fn bitstream(&self) -> Vec<u8>;
}

#[derive(Debug, Default)]
pub struct Spi {
    received: VecDeque<u8>,
    pub bytes: u64,
    ends_ps: u64,
    complete: bool,
}

impl Chip {
    pub(super) fn write_watchdog(&mut self, offset: u32, value: u32) {
        let now = self.now;
        let watchdog = &mut self.watchdog;
        match offset {
            0x00 => match value {
                0xCCCC => {
                    watchdog.fed_ps.get_or_insert(now);
                }
                0xAAAA => {
                    if let Some(fed) = &mut watchdog.fed_ps {
                        watchdog.longest_ps = watchdog.longest_ps.max(now - *fed);
                        *fed = now;
                    }
                    watchdog.unlocked = false;
                }
                0x5555 => watchdog.unlocked = true,
                _ => self.violation(format!("IWDG.KR {value:#x}")),
            },
            _ if !watchdog.unlocked => {
                self.violation("the watchdog's setting is written while locked".into());
            }
            0x04 => watchdog.prescaler = value,
            0x08 => watchdog.reload = value.into(),
            _ => {}
        }
    }

    pub(super) fn check_watchdog(&mut self) {
        if self.now >= self.watchdog.due() {
            let since = self.now - self.watchdog.fed_ps.unwrap_or(self.now);
            self.watchdog.longest_ps = self.watchdog.longest_ps.max(since);
            self.reset = Some(Cause::Watchdog);
        }
    }

    pub(super) fn read_adc(&mut self, offset: u32) -> u32 {
        let control = self.value(0x4202_8008);
        let stuck = |bit| self.stuck == Some(super::clocks::Ready("ADC1.ISR", bit));
        match offset {
            0x00 => {
                let mut flags = self.adc.flags;
                if control >> 28 & 1 == 1 && !stuck(12) {
                    flags |= 1 << 12;
                }
                if control & 1 == 1 && self.now >= self.adc.enabled_ps && !stuck(0) {
                    flags |= 1;
                }
                if control & 4 != 0 && self.now >= self.adc.ends_ps {
                    flags |= 0xC;
                }
                self.adc.flags = flags;
                flags
            }
            0x08 => {
                let calibrates =
                    control >> 31 == 1 && (self.now < self.adc.calibrated_ps || stuck(31));
                let converts = control & 4 != 0 && self.now < self.adc.ends_ps;
                control & !(1 << 31 | 4 | 2)
                    | u32::from(calibrates) << 31
                    | u32::from(converts) << 2
            }
            0x40 => {
                self.adc.flags &= !0xC;
                let control = self.value(0x4202_8008) & !4;
                self.set(0x4202_8008, control);
                self.adc.reading
            }
            _ => self.value(0x4202_8000 + offset),
        }
    }

    pub(super) fn write_adc(&mut self, offset: u32, value: u32) {
        match offset {
            0x00 => self.adc.flags &= !value,
            0x08 => {
                if value >> 31 == 1 {
                    self.adc.calibrated_ps = self.now + 50 * US;
                }
                if value & 1 == 1 && self.value(0x4202_8008) & 1 == 0 {
                    self.adc.enabled_ps = self.now + US;
                }
                if value & 4 != 0 {
                    self.adc.ends_ps = self.now + 22 * US;
                    if !self.has_analog_supply() {
                        self.violation("the ADC converts without ASV, its supply".into());
                    }
                    if !self.is_connected("thermistor") {
                        self.violation(
                            "the ADC converts, and the thermistor's pin is not analog".into(),
                        );
                    }
                }
                self.set(0x4202_8008, value);
            }
            _ => self.set(0x4202_8000 + offset, value),
        }
    }

    pub(super) fn read_i2c(&mut self, offset: u32) -> u32 {
        match offset {
            0x18 => self.i2c.flags,
            0x1C => 0,
            _ => self.value(I2C1 + offset),
        }
    }

    pub(super) fn write_i2c(&mut self, offset: u32, value: u32) {
        match offset {
            0x04 => {
                if value >> 13 & 1 == 1 && self.i2c.other == OnTheBus::Stuck {
                    self.i2c.flags |= 1 << 15;
                }
                if value >> 13 & 1 == 1 && self.i2c.other == OnTheBus::Nobody {
                    // Start, eight bits, no acknowledgement, stop: at 400 kHz.
                    self.i2c.refused_ps = self.now + 27 * US;
                    self.i2c.flags |= 1 << 15;
                    for pin in ["tof_scl", "tof_sda"] {
                        if !self.is_connected(pin) {
                            self.violation(format!(
                                "I2C1 starts, and {pin} has not its alternate function"
                            ));
                        }
                    }
                }
                self.set(I2C1 + 4, value);
            }
            0x1C => self.i2c.flags &= !value,
            0x00 => {
                if value & 1 == 0 {
                    // RM0456, 62.4.6, software reset: flags and transfers end.
                    self.i2c.flags = 1;
                    self.i2c.refused_ps = u64::MAX;
                    let control = self.value(I2C1 + 4) & !(1 << 13 | 1 << 14);
                    self.set(I2C1 + 4, control);
                }
                self.set(I2C1, value);
            }
            _ => self.set(I2C1 + offset, value),
        }
    }

    pub(super) fn refuse_i2c(&mut self) {
        if self.now < self.i2c.refused_ps {
            return;
        }
        self.i2c.refused_ps = u64::MAX;
        self.i2c.flags = self.i2c.flags & !(1 << 15) | 1 << 4 | 1 << 5;
        let control = self.value(I2C1 + 4) & !(1 << 13 | 1 << 14);
        self.set(I2C1 + 4, control);
    }

    /// `I2C1_EV` asks for its interrupt.
    pub(super) fn i2c_event(&self) -> bool {
        let control = self.value(I2C1);
        let enabled = (control & 1 << 4) | (control & 1 << 5);
        self.i2c.flags & enabled & 0x30 != 0 || control >> 6 & 1 == 1 && self.i2c.flags & 0xC0 != 0
    }

    pub(super) fn read_spi(&mut self, offset: u32) -> u32 {
        match offset {
            0x14 => {
                let whole = self.now >= self.spi.ends_ps;
                let received = whole && !self.spi.received.is_empty();
                u32::from(received)
                    | 2
                    | u32::from(whole) << 12
                    | u32::from(whole && self.spi.complete) << 3
            }
            0x30 => self.spi.received.pop_front().unwrap_or(0).into(),
            _ => self.value(SPI1 + offset),
        }
    }

    pub(super) fn write_spi(&mut self, offset: u32, bytes: u32, value: u32) {
        match offset {
            0x20 => {
                let (config, mode) = (self.value(SPI1 + 8), self.value(SPI1 + 0xC));
                let (hz, size) =
                    (self.core_hz() / f64::from(2u32 << (config >> 28 & 7)), config & 31);
                let wrong = [
                    (size != 7 || bytes != 1, "words that are not bytes"),
                    (mode >> 23 & 7 != 0, "not in mode 0, most significant bit first"),
                    (hz > 10e6, "faster than 10 MHz"),
                    (
                        !self.is_connected("config_sck") || !self.is_connected("config_mosi"),
                        "a pin without its function",
                    ),
                    (self.value(RCC + 0xE0) >> 20 & 3 != 0, "a clock other than the bus'"),
                ];
                for (_, what) in wrong.into_iter().filter(|(is, _)| *is) {
                    self.violation(format!("SPI1: {what}"));
                }
                let answer = self.fpga_configuration.exchange(value as u8);
                self.spi.received.push_back(answer);
                self.spi.bytes += 1;
                self.spi.ends_ps = self.spi.ends_ps.max(self.now) + (8e12 / hz) as u64;
                self.spi.complete = true;
            }
            0x18 => self.spi.complete = false,
            _ => self.set(SPI1 + offset, value),
        }
    }
}
