//! Tests of the scan of the ADC's sampling phase, with a converter and a PLL of their own.
#![expect(clippy::single_range_in_vec_init, reason = "one window is a list too")]

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::sampling::{
    AFTER, BEFORE, CHECKERBOARD, DONE, PERIOD, PHASE, STEPS, WIDTH,
};
use std::ops::Range;

laws![
    the_clock_stops_in_the_middle_of_the_longest_window,
    without_a_window_the_phase_is_as_built,
    the_adc_sends_its_own_samples_before_and_after,
];

/// Most clocks of the host port (310 MHz / 3) that a scan may take: 0.5 ms.
const PATIENCE: u32 = 51_667;

/// The ADC as its serial port is written to, the PLL as it is stepped, and the lines between ADC and FPGA.
struct Board {
    bench: Bench,
    dice: Dice,
    /// Steps from the phase as built in which the lines stand when they are sampled.
    windows: Vec<Range<u32>>,
    /// The serial port is wired.
    wired: bool,
    /// What the serial port has taken, each word with its number of bits.
    words: Vec<(u32, u32)>,
    taking: (u32, u32),
    clock_was: bool,
    selected: bool,
    step_was: bool,
    phase: u32,
    sample: u16,
}

impl Board {
    fn new(project: &Project, windows: &[Range<u32>], wired: bool, seed: u64) -> Self {
        let mut bench = Bench::new(project, "phase_scan");
        bench.reset("clk_host", "rst_host");
        bench.reset("clk_adc", "rst_adc");
        Self {
            bench,
            dice: Dice::new(seed),
            windows: windows.to_vec(),
            wired,
            words: Vec::new(),
            taking: (0, 0),
            clock_was: false,
            selected: false,
            step_was: false,
            phase: 0,
            sample: CHECKERBOARD,
        }
    }

    /// The register of the test pattern, as far as a transfer has made it take effect.
    fn shows_pattern(&self) -> bool {
        let mut written = (0, 0);
        for &(word, bits) in &self.words {
            assert_eq!(bits, 24, "a word has 24 bits");
            match word >> 8 {
                0x0D => written.0 = word & 0xFF,
                0xFF => written.1 = written.0,
                _ => panic!("the scan writes {word:#08x}"),
            }
        }
        self.wired && written.1 == 4
    }

    fn host_edge(&mut self) {
        self.bench.edge("clk_host");
        let selected = !self.bench.is("serial_select_n");
        let clock = self.bench.is("serial_clock");
        if selected && clock && !self.clock_was {
            let bit = u32::from(self.bench.is("serial_data"));
            self.taking = (self.taking.0 << 1 | bit, self.taking.1 + 1);
        }
        if self.selected && !selected {
            self.words.push(std::mem::take(&mut self.taking));
        }
        (self.selected, self.clock_was) = (selected, clock);
        let step = self.bench.is("phase_step");
        if self.step_was && !step {
            self.phase = (self.phase + 1) % STEPS;
        }
        self.step_was = step;
    }

    fn adc_edge(&mut self) {
        let right = self
            .windows
            .iter()
            .any(|window| window.contains(&self.phase) || window.contains(&(self.phase + STEPS)));
        self.sample ^= 0x3FFF;
        let code = if !self.shows_pattern() {
            0x1000 + self.dice.range(0, 7)
        } else if right {
            self.sample.into()
        } else {
            // Each line may still show the sample before.
            u64::from(self.sample) ^ self.dice.next() & 0x3FFF
        };
        self.bench.set("code", code);
        self.bench.edge("clk_adc");
    }

    /// Runs the scan; returns what the register says after it.
    fn scan(&mut self) -> u32 {
        for _ in 0..PATIENCE {
            // 125 MHz beside 103: sometimes two edges of the ADC's clock in one of the host's.
            self.adc_edge();
            if self.dice.once_in(5) {
                self.adc_edge();
            }
            assert_eq!(self.bench.get("sampling") as u32 & DONE, 0, "done before the end");
            self.host_edge();
            if self.bench.is("done") {
                return self.bench.get("sampling") as u32;
            }
        }
        panic!("the scan does not end");
    }
}

fn register(phase: u32, width: u32) -> u32 {
    let fields = phase & PHASE | width << 8 & WIDTH | STEPS << 16 & PERIOD;
    fields | DONE
}

/// Windows, where the clock stops, and the width of the longest window. It stops in the middle, or half a step
/// before it if the width is even.
const SCANS: [(&[Range<u32>], u32, u32); 5] = [
    (&[10..25], 17, 15),
    (&[0..1], 0, 1),
    // Through the end of the period.
    (&[35..47], 0, 12),
    // Two windows: the longer second one counts, although the scan meets a part of the first again at its end.
    (&[36..42, 10..19], 14, 9),
    (&[2..5, 6..40], 22, 34),
];

fn the_clock_stops_in_the_middle_of_the_longest_window(project: &Project) {
    for (seed, (windows, middle, width)) in (0..).zip(SCANS) {
        let mut board = Board::new(project, windows, true, seed);
        let said = board.scan();
        assert_eq!(board.phase, middle, "{windows:?}: {said:#010x}");
        assert_eq!(said, register(middle, width), "{windows:?}: {said:#010x}");
        // It stays there until the next reset, and begins anew from there.
        for _ in 0..1000 {
            board.adc_edge();
            board.host_edge();
            assert!(board.bench.is("done") && board.phase == middle);
        }
    }
    let mut board = Board::new(project, &[10..25], true, 7);
    board.scan();
    board.words.clear();
    board.bench.reset("clk_host", "rst_host");
    board.bench.reset("clk_adc", "rst_adc");
    assert!(!board.bench.is("done"));
    board.scan();
    assert_eq!(board.phase, 17);
}

fn without_a_window_the_phase_is_as_built(project: &Project) {
    for (windows, wired) in [(&[][..], true), (&[10..25][..], false)] {
        let mut board = Board::new(project, windows, wired, 11);
        assert_eq!(board.scan(), register(0, 0));
        assert_eq!(board.phase, 0);
    }
}

fn the_adc_sends_its_own_samples_before_and_after(project: &Project) {
    for windows in [&[][..], &[10..25][..]] {
        let mut board = Board::new(project, windows, true, 13);
        board.scan();
        let words: Vec<u32> = board.words.iter().map(|&(word, _)| word).collect();
        assert_eq!(words, [BEFORE, AFTER].concat());
        assert!(!board.shows_pattern() && !board.selected);
    }
}
