//! Tests of every module of the RTL on its own. A law is a property of one module that a test
//! checks.
//!
//! # Invariant
//! Every module has a bench (`every_module_has_a_bench`). At least one deliberate fault breaks
//! each law (`mutation::every_deliberate_fault_is_seen_and_every_law_can_be_broken`).

use crate::project::{Project, files, folder};

/// Lists the laws of a module, and makes a test of each law. A law is a function of the RTL's text.
macro_rules! laws {
    ($($law:ident),+ $(,)?) => {
        /// The laws and their names.
        pub const LAWS: &[crate::modules::Law] = &[$((stringify!($law), $law)),+];

        mod tests {
            $(#[test]
            fn $law() {
                super::$law(&crate::project::Project::read());
            })+
        }
    };
}

mod accumulators;
mod bank_ram;
mod bundles;
mod byte_fifo;
mod clock_meter;
mod control;
mod crc32;
mod crossing;
mod duty;
mod engine;
mod formatter;
mod frames;
mod glitch_filter;
mod host_registers;
mod leds;
mod loopback;
mod order_table;
mod over_counter;
mod packer;
mod packet_port;
mod parallel_port;
mod pattern_check;
mod phase_scan;
mod raw_capture;
mod registers;
mod safety;
mod sample_total;
mod sequencer;
mod source;
mod spi_slave;
mod synchroniser;
mod watchdog;
mod window;

/// A property of a module: its name, and a function that panics when the RTL lacks the property.
pub type Law = (&'static str, fn(&Project));

/// Files of `hdl/rtl`, each with the laws of its module.
pub const BENCHES: &[(&str, &[Law])] = &[
    ("accumulators", accumulators::LAWS),
    ("bank_ram", bank_ram::LAWS),
    ("byte_fifo", byte_fifo::LAWS),
    ("clock_meter", clock_meter::LAWS),
    ("control", control::LAWS),
    ("crc32", crc32::LAWS),
    ("crossing", crossing::LAWS),
    ("duty", duty::LAWS),
    ("engine", engine::LAWS),
    ("formatter", formatter::LAWS),
    ("frames", frames::LAWS),
    ("glitch_filter", glitch_filter::LAWS),
    ("host_registers", host_registers::LAWS),
    ("leds", leds::LAWS),
    ("loopback", loopback::LAWS),
    ("order_table", order_table::LAWS),
    ("over_counter", over_counter::LAWS),
    ("packer", packer::LAWS),
    ("packet_port", packet_port::LAWS),
    ("parallel_port", parallel_port::LAWS),
    ("pattern_check", pattern_check::LAWS),
    ("phase_scan", phase_scan::LAWS),
    ("raw_capture", raw_capture::LAWS),
    ("registers", registers::LAWS),
    ("safety", safety::LAWS),
    ("sample_total", sample_total::LAWS),
    ("sequencer", sequencer::LAWS),
    ("source", source::LAWS),
    ("spi_slave", spi_slave::LAWS),
    ("synchroniser", synchroniser::LAWS),
    ("watchdog", watchdog::LAWS),
    ("window", window::LAWS),
];

/// Files without a bench here: `equivalence` tests the top, `stale` compares `register_map` with
/// `mcu/wire`, and `bundles` packs the bundles of `types` again.
const ELSEWHERE: &[&str] = &["core", "register_map", "types"];

/// Files that are not part of the core: the equivalence runs do not reach them.
pub const BESIDE_THE_CORE: &[&str] = &["loopback", "pattern_check", "phase_scan"];

/// The laws of one file.
pub fn laws(file: &str) -> &'static [Law] {
    BENCHES.iter().find(|(name, _)| *name == file).map_or(&[], |(_, laws)| laws)
}

#[test]
fn every_module_has_a_bench() {
    for name in files(&folder("rtl")).into_keys() {
        let benched = !laws(&name).is_empty();
        assert!(benched != ELSEWHERE.contains(&name.as_str()), "{name}.veryl has no bench");
    }
}
