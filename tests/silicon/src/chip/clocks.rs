//! Clocks and supplies: RCC (RM0456, 11), PWR (10), the flash's wait states (7.3.3).
//!
//! Assumed times until something is ready: 2 ms for the crystal (data sheet, typical), 50 us for the PLL, 30 us for a
//! voltage range, 10 us for the rest. Not modelled: a clock that fails, calibration, the low-power modes.

use super::Chip;
use super::map::{PWR, RCC, SYSCFG};
use std::collections::BTreeMap;

/// A bit that says that something is ready, by register and number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ready(pub &'static str, pub u32);

const VOSR: u32 = PWR + 0x0C;
const SVMCR: u32 = PWR + 0x10;

const CRYSTAL_HZ: f64 = 16e6;
const US: u64 = 1_000_000;

/// What is on its way to be ready, and when.
pub type Rising = BTreeMap<Ready, u64>;

/// Oscillators in `RCC.CR`: switch, ready bit, time.
const OSCILLATORS: &[(u32, u32, u64)] = &[
    (0, 2, 10 * US),
    (4, 5, 10 * US),
    (8, 10, 10 * US),
    (12, 13, 10 * US),
    (16, 17, 2_000 * US),
    (24, 25, 50 * US),
    (26, 27, 50 * US),
    (28, 29, 50 * US),
];

impl Chip {
    /// Whether a thing that was switched on is ready by now.
    fn is_ready(&self, ready: Ready) -> bool {
        self.stuck != Some(ready) && self.rising.get(&ready).is_some_and(|at| self.now >= *at)
    }

    fn rises(&mut self, ready: Ready, on: bool, after_ps: u64) {
        if !on {
            self.rising.remove(&ready);
        } else {
            let at = self.now + after_ps;
            self.rising.entry(ready).or_insert(at);
        }
    }

    pub(super) fn start_clocks(&mut self) {
        for (_, bit, _) in OSCILLATORS.iter().take(2) {
            self.rising.insert(Ready("RCC.CR", *bit), 0);
        }
        self.rising.insert(Ready("PWR.VOSR", 15), 0);
    }

    pub(super) fn read_rcc(&mut self, offset: u32) -> u32 {
        let value = self.value(RCC + offset);
        match offset {
            0x00 => OSCILLATORS.iter().fold(value, |value, (_, bit, _)| {
                value & !(1 << bit) | u32::from(self.is_ready(Ready("RCC.CR", *bit))) << bit
            }),
            0x1C => {
                let source = if self.stuck == Some(Ready("RCC.CFGR1", 2)) { 0 } else { value & 3 };
                value & !0xC | source << 2
            }
            0xF0 => value & !(1 << 27 | 2) | u32::from(self.is_ready(Ready("RCC.BDCR", 27))) << 27,
            _ => value,
        }
    }

    pub(super) fn write_rcc(&mut self, offset: u32, value: u32) {
        let before = self.value(RCC + offset);
        self.set(RCC + offset, value);
        match offset {
            0x00 => {
                for (on, bit, time) in OSCILLATORS {
                    self.rises(Ready("RCC.CR", *bit), value >> on & 1 == 1, *time);
                }
                if value >> 24 & 1 == 1 && before >> 24 & 1 == 0 {
                    self.check_pll();
                }
            }
            0x1C if (before ^ value) & 3 != 0 => self.switch_clock(value & 3),
            0x20 if value & 0x77F != 0 => {
                self.violation(format!("RCC.CFGR2 {value:#x}: a bus has a prescaler"));
            }
            0x24 if value & 0x70 != 0 => {
                self.violation(format!("RCC.CFGR3 {value:#x}: a bus has a prescaler"));
            }
            0xE4 if value >> 20 & 3 != 0 => {
                self.violation("OCTOSPI's clock is not the core's".into());
            }
            // RMVF forgets the reset flags.
            0xF4 if value >> 23 & 1 == 1 => {
                self.set(RCC + offset, value & 0x007F_FFFF);
            }
            0xF0 => self.rises(Ready("RCC.BDCR", 27), value >> 26 & 1 == 1, 130 * US),
            _ => {}
        }
        // A reset of a peripheral clears its registers.
        if (0x60..=0x80).contains(&offset) {
            self.reset_peripherals(offset, value);
        }
    }

    /// PLL1, by its registers, in Hz; the first is its input, the second its oscillator.
    fn pll_hz(&self) -> (f64, f64, f64) {
        let (config, dividers) = (self.value(RCC + 0x28), self.value(RCC + 0x34));
        let source = match config & 3 {
            1 => 4e6,
            2 => 16e6,
            3 => CRYSTAL_HZ,
            _ => 0.0,
        };
        let input = source / f64::from((config >> 8 & 15) + 1);
        let oscillator = input * f64::from((dividers & 0x1FF) + 1);
        (input, oscillator, oscillator / f64::from((dividers >> 24 & 0x7F) + 1))
    }

    fn check_pll(&mut self) {
        let config = self.value(RCC + 0x28);
        let (input, oscillator, _) = self.pll_hz();
        if !(4e6..=16e6).contains(&input) || !(128e6..=544e6).contains(&oscillator) {
            self.violation(format!(
                "PLL1: input {:.1} MHz, oscillator {:.1} MHz",
                input / 1e6,
                oscillator / 1e6
            ));
        }
        let range = if input <= 8e6 { 0 } else { 3 };
        if config >> 2 & 3 != range {
            self.violation(format!(
                "PLL1RGE {}, expected {range} for {:.0} MHz",
                config >> 2 & 3,
                input / 1e6
            ));
        }
        if config & 3 == 3 && !self.is_ready(Ready("RCC.CR", 17)) {
            self.violation("PLL1 is started before the crystal is ready".into());
        }
    }

    fn switch_clock(&mut self, source: u32) {
        let (bit, hz) = match source {
            0 => (2, 4e6),
            1 => (10, 16e6),
            2 => (17, CRYSTAL_HZ),
            _ => (25, self.pll_hz().2),
        };
        if !self.is_ready(Ready("RCC.CR", bit)) {
            self.violation(format!(
                "the core's clock is switched to a source that is not ready ({bit})"
            ));
        }
        // Range 1: RM0456, table 54; the booster above 55 MHz: 10.5.4.
        let (wait, latency) = ((hz / 32e6).ceil() as u32, self.value(super::map::FLASH_ACR) & 15);
        if latency + 1 < wait {
            self.violation(format!(
                "{:.0} MHz with {latency} wait states of the flash, needs {}",
                hz / 1e6,
                wait - 1
            ));
        }
        let range = self.value(VOSR) >> 16 & 3;
        if hz > 55e6 && !(range == 3 && self.is_ready(Ready("PWR.VOSR", 14))) {
            self.violation(format!(
                "{:.0} MHz in voltage range {}, or without the booster",
                hz / 1e6,
                4 - range
            ));
        }
        if hz > 160e6 {
            self.violation(format!("{:.0} MHz, at most 160", hz / 1e6));
        }
        self.core = hz;
        self.clock_changed = true;
    }

    pub(super) fn read_pwr(&mut self, offset: u32) -> u32 {
        let value = self.value(PWR + offset);
        let bit = |register: &'static str, bit: u32| {
            u32::from(self.is_ready(Ready(register, bit))) << bit
        };
        match offset {
            0x0C => {
                value & !(7 << 13) | bit("PWR.VOSR", 13) | bit("PWR.VOSR", 14) | bit("PWR.VOSR", 15)
            }
            0x3C => {
                let low = self.supply_millivolts < self.supply_threshold();
                let ready = (24..28).map(|number| bit("PWR.SVMSR", number)).sum::<u32>();
                2 | u32::from(low) << 4 | 1 << 15 | (self.value(VOSR) & 3 << 16) | ready
            }
            _ => value,
        }
    }

    /// Below this the voltage detector says that the supply is low.
    fn supply_threshold(&self) -> u32 {
        let control = self.value(SVMCR);
        let levels = [2000, 2200, 2400, 2500, 2600, 2800, 2900, 0];
        if control >> 4 & 1 == 1 { levels[(control >> 5 & 7) as usize] } else { 0 }
    }

    /// The crystal stops. Whether the clock security system sees that, which goes over to 4 MHz and raises the interrupt that
    /// nothing masks (RM0456, 11.4.9).
    pub fn stop_crystal(&mut self) -> bool {
        let is_watched = self.value(RCC) >> 19 & 1 == 1;
        for bit in [17, 25] {
            self.rising.remove(&Ready("RCC.CR", bit));
        }
        if is_watched {
            self.core = 4e6;
        }
        is_watched
    }

    /// Whether the supply is below the brown-out level, where the chip is held in reset (data sheet, table 35, falling).
    #[must_use]
    pub fn is_browned_out(&self) -> bool {
        let levels = [1700, 2000, 2200, 2500, 2800];
        let level = levels.get(self.brown_out_level as usize).copied().unwrap_or(2800);
        self.supply_millivolts < level
    }

    pub(super) fn write_pwr(&mut self, offset: u32, value: u32) {
        let before = self.value(PWR + offset);
        self.set(PWR + offset, value);
        match offset {
            0x0C => {
                if (before ^ value) >> 16 & 3 != 0 {
                    self.rising.remove(&Ready("PWR.VOSR", 15));
                }
                self.rises(Ready("PWR.VOSR", 15), true, 30 * US);
                self.rises(Ready("PWR.VOSR", 14), value >> 18 & 1 == 1, 30 * US);
                self.rises(Ready("PWR.VOSR", 13), value >> 20 & 1 == 1, 30 * US);
            }
            0x10 => {
                // VDDUSB, VDDIO2, VDDA twice: a monitor says that the supply is there.
                for number in 24..28 {
                    self.rises(Ready("PWR.SVMSR", number), value >> number & 1 == 1, 10 * US);
                }
            }
            _ => {}
        }
    }

    /// What the USB core needs to be heard on the bus (RM0456, 73.4.3 and 10.5.5).
    pub(super) fn usb_needs(&self) -> Vec<&'static str> {
        let syscfg = self.value(SYSCFG + 0x74);
        let needs = [
            (self.value(SVMCR) >> 28 & 1 == 1, "PWR.SVMCR.USV, the supply of its pins"),
            (self.value(VOSR) >> 19 & 1 == 1, "PWR.VOSR.USBPWREN"),
            (self.is_ready(Ready("PWR.VOSR", 13)), "the USB booster"),
            (self.value(RCC + super::map::AHB2ENR1) >> 15 & 1 == 1, "the clock of its PHY"),
            (self.is_ready(Ready("RCC.CR", 17)), "the crystal"),
            (
                self.value(RCC + 0xE4) >> 30 == 0,
                "the crystal as the PHY's reference (CCIPR2.OTGHSSEL)",
            ),
            (syscfg >> 2 & 15 == 3, "SYSCFG.OTGHSPHYCR.CLKSEL for 16 MHz"),
            (syscfg & 1 == 1, "SYSCFG.OTGHSPHYCR.EN"),
        ];
        needs.into_iter().filter(|(has, _)| !has).map(|(_, need)| need).collect()
    }

    /// Whether the ADC has its supply.
    pub(super) fn has_analog_supply(&self) -> bool {
        self.value(SVMCR) >> 30 & 1 == 1
    }

    #[must_use]
    pub fn core_hz(&self) -> f64 {
        self.core
    }

    /// One clock of the core.
    pub(super) fn clock_ps(&self) -> u64 {
        (1e12 / self.core) as u64
    }
}
