//! Every module against its own law, in numbers of the test itself.
//!
//! The one law: a module has a bench, and every law of a bench is a test that `mutation` can ask too.

use crate::project::{Project, files, folder};

/// Lists the laws of a module, each a function of the RTL's text, and makes a test of each.
macro_rules! laws {
    ($($law:ident),+ $(,)?) => {
        /// By name.
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
mod control;
mod crc32;
mod crossing;
mod duty;
mod engine;
mod formatter;
mod frames;
mod leds;
mod order_table;
mod over_counter;
mod raw_capture;
mod registers;
mod safety;
mod sequencer;
mod source;
mod spi_slave;
mod synchroniser;
mod watchdog;
mod window;

/// What a module promises, and what panics when that is not so.
pub type Law = (&'static str, fn(&Project));

/// Files of `hdl/rtl` and the laws of the module in each.
pub const BENCHES: &[(&str, &[Law])] = &[
    ("accumulators", accumulators::LAWS),
    ("bank_ram", bank_ram::LAWS),
    ("byte_fifo", byte_fifo::LAWS),
    ("control", control::LAWS),
    ("crc32", crc32::LAWS),
    ("crossing", crossing::LAWS),
    ("duty", duty::LAWS),
    ("engine", engine::LAWS),
    ("formatter", formatter::LAWS),
    ("frames", frames::LAWS),
    ("leds", leds::LAWS),
    ("order_table", order_table::LAWS),
    ("over_counter", over_counter::LAWS),
    ("raw_capture", raw_capture::LAWS),
    ("registers", registers::LAWS),
    ("safety", safety::LAWS),
    ("sequencer", sequencer::LAWS),
    ("source", source::LAWS),
    ("spi_slave", spi_slave::LAWS),
    ("synchroniser", synchroniser::LAWS),
    ("watchdog", watchdog::LAWS),
    ("window", window::LAWS),
];

/// The top, whose bench is `equivalence`, and the packages: `stale` compares the one with `mcu/wire`, and the
/// other's bundles are packed anew in `bundles`.
const ELSEWHERE: &[&str] = &["core", "register_map", "types"];

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
