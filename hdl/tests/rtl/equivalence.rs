//! Random scenarios through RTL and model.

use crate::project::Project;
use crate::rig::Rig;
use crate::scenario;

/// Scenarios that one simulation lives through, one after the other.
const SCENARIOS: u64 = 64;

/// Runs scenarios on one simulated FPGA; the first difference, if there is one.
pub fn first_difference(project: &Project, seeds: std::ops::Range<u64>) -> Option<String> {
    let mut rig = Rig::new(project, seeds.start);
    for seed in seeds {
        scenario::run(&mut rig, seed);
        if let Some(mismatch) = rig.mismatch {
            return Some(format!("scenario {seed}: {mismatch}"));
        }
    }
    None
}

/// `NIRSPI_RTL_SCENARIOS` asks for more of them.
#[test]
fn random_scenarios_agree_bit_for_bit() {
    let asked = std::env::var("NIRSPI_RTL_SCENARIOS").ok().and_then(|n| n.parse().ok());
    let last: u64 = asked.unwrap_or(256);
    let project = Project::read();
    for first in (0..last).step_by(SCENARIOS as usize) {
        let seeds = first..last.min(first + SCENARIOS);
        if let Some(difference) = first_difference(&project, seeds) {
            panic!("{difference}");
        }
    }
}
