//! A general-purpose timer that counts up: prescaler, compare channels, update (RM0456, 54 and 55).
//!
//! Assumed: the timer's clock is the core's (the bus prescalers are 1, which the clock rule checks). Not modelled: preload of
//! compare values, capture, slave mode.

/// Registers and state.
#[derive(Debug, Default)]
pub struct Timer {
    cr1: u32,
    pub dier: u32,
    pub sr: u32,
    prescaler: u32,
    /// The prescaler in use: a new one waits for the next update.
    divider: u64,
    reload: u64,
    compare: [u32; 4],
    pub modes: u32,
    pub outputs: u32,
    /// The time at which the count was 0.
    zero_ps: u64,
    /// The count while the timer stands.
    held: u64,
    /// Ticks that have been looked at.
    seen: u64,
}

const CEN: u32 = 1;
const URS: u32 = 1 << 2;

impl Timer {
    pub fn new() -> Self {
        Self { divider: 1, reload: 0xFFFF, ..Self::default() }
    }

    fn runs(&self) -> bool {
        self.cr1 & CEN != 0
    }

    fn period(&self) -> u64 {
        self.reload + 1
    }

    fn tick_ps(&self, clock_ps: u64) -> u64 {
        self.divider * clock_ps
    }

    fn ticks(&self, now: u64, clock_ps: u64) -> u64 {
        now.saturating_sub(self.zero_ps) / self.tick_ps(clock_ps)
    }

    pub fn count(&self, now: u64, clock_ps: u64) -> u64 {
        let ticks = if self.runs() { self.ticks(now, clock_ps) } else { self.held };
        ticks % self.period()
    }

    /// Sets the flags of all that has happened up to now.
    pub fn advance(&mut self, now: u64, clock_ps: u64) {
        if !self.runs() {
            return;
        }
        let (ticks, period) = (self.ticks(now, clock_ps), self.period());
        for (bit, value) in self.marks() {
            // So many times has the count been at this value.
            let passed = |ticks: u64| (ticks + period - value) / period;
            if passed(ticks) > passed(self.seen) {
                self.sr |= 1 << bit;
            }
        }
        self.seen = ticks;
    }

    /// Bits of the status, each with the count that sets it.
    fn marks(&self) -> impl Iterator<Item = (u32, u64)> + use<> {
        let [a, b, c, d] = self.compare.map(u64::from);
        let period = self.period();
        [(0, 0), (1, a), (2, b), (3, c), (4, d)].into_iter().filter(move |(_, at)| *at < period)
    }

    /// When the next interrupt comes, if no flag is set already.
    pub fn due(&self, now: u64, clock_ps: u64) -> u64 {
        if !self.runs() {
            return u64::MAX;
        }
        let (ticks, period, tick) =
            (self.ticks(now, clock_ps), self.period(), self.tick_ps(clock_ps));
        let waiting = self.marks().filter(|(bit, _)| (self.dier & !self.sr) >> bit & 1 != 0);
        let next = waiting.map(|(_, value)| {
            let ahead = (value + period - ticks % period) % period;
            ticks + if ahead == 0 { period } else { ahead }
        });
        next.min().map_or(u64::MAX, |ticks| self.zero_ps + ticks * tick)
    }

    pub fn interrupts(&self) -> bool {
        self.sr & self.dier & 0x1F != 0
    }

    pub fn read(&mut self, offset: u32, now: u64, clock_ps: u64) -> u32 {
        self.advance(now, clock_ps);
        match offset {
            0x00 => self.cr1,
            0x0C => self.dier,
            0x10 => self.sr,
            0x18 => self.modes,
            0x20 => self.outputs,
            0x24 => self.count(now, clock_ps) as u32,
            0x28 => self.prescaler,
            0x2C => self.reload as u32,
            0x34..=0x40 => self.compare[(offset as usize - 0x34) / 4],
            _ => 0,
        }
    }

    pub fn write(&mut self, offset: u32, value: u32, now: u64, clock_ps: u64) {
        self.advance(now, clock_ps);
        match offset {
            0x00 => {
                if value & CEN != 0 && !self.runs() {
                    self.start_at(self.held, now, clock_ps);
                } else if value & CEN == 0 && self.runs() {
                    self.held = self.count(now, clock_ps);
                }
                self.cr1 = value;
            }
            0x0C => self.dier = value,
            0x10 => self.sr &= value,
            0x14 if value & 1 != 0 => {
                self.divider = u64::from(self.prescaler) + 1;
                self.start_at(0, now, clock_ps);
                if self.cr1 & URS == 0 {
                    self.sr |= 1;
                }
            }
            0x18 => self.modes = value,
            0x20 => self.outputs = value,
            0x24 => self.start_at(value.into(), now, clock_ps),
            0x28 => self.prescaler = value,
            0x2C => self.reload = value.into(),
            0x34..=0x40 => self.compare[(offset as usize - 0x34) / 4] = value,
            _ => {}
        }
    }

    fn start_at(&mut self, count: u64, now: u64, clock_ps: u64) {
        self.held = count;
        self.zero_ps = now.saturating_sub(count * self.tick_ps(clock_ps));
        self.seen = count;
    }

    /// Channel 1 as an output, PWM mode 1: high while the count is below the compare value. The second: when it falls.
    pub fn output(&self, now: u64, clock_ps: u64) -> (bool, u64) {
        let pwm1 = self.modes >> 4 & 7 == 6 && self.modes >> 16 & 1 == 0;
        let on = self.runs() && self.outputs & 1 != 0 && pwm1;
        let (count, compare) = (self.count(now, clock_ps), u64::from(self.compare[0]));
        if on && count < compare {
            (true, now + (compare - count) * self.tick_ps(clock_ps))
        } else {
            (false, u64::MAX)
        }
    }
}
