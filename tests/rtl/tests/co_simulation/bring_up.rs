//! Tests of a bring-up through the RTL: two boards without ADC, and an ADC without clock.

use crate::ideal;
use nirspi::check::{Check, Verdict};
use nirspi::fpga::{Fpga, Sampling};
use nirspi::selftest::{LinkDemands, SelfTest, run};
use nirspi::session::{IgnorePackets, Session};
use nirspi_tests_rtl::RtlFpga;
use nirspi_virtual::{MemoryLink, VirtualCamera};
use std::time::Duration;

fn session(fpga: RtlFpga) -> Session {
    let camera = VirtualCamera::new(fpga, ideal().depth(1).unwrap(), "co-simulated");
    Session::open(Box::new(MemoryLink::new(camera))).unwrap()
}

fn self_test(session: &mut Session) -> SelfTest {
    let demands = LinkDemands { min_frames_per_s: 0.0, duration: Duration::from_millis(50) };
    run(session, demands, &mut |_| {}).unwrap()
}

fn failures(found: &SelfTest) -> Vec<&Check> {
    found.checks.iter().filter(|check| check.verdict() == Verdict::Failed).collect()
}

#[test]
#[ignore = "long: three minutes of one processor; bash .ci/run rtl-long"]
fn the_self_test_passes_through_the_rtl_without_any_adc() {
    let mut fpga = RtlFpga::bring_up();
    // A window of the frequency meter: 0.4 ms.
    nirspi_virtual::SimulatedFpga::advance(&mut fpga, 60_000);
    let mut session = session(fpga);
    assert!(
        session.reports().lines.iter().any(|line| line.contains("bring-up")),
        "{:?}",
        session.reports()
    );
    let found = self_test(&mut session);
    assert!(failures(&found).is_empty(), "{:#?}", failures(&found));
    let checked = |name: &str| {
        let check = found.checks.iter().find(|check| check.name() == name).unwrap();
        assert_eq!(check.verdict(), Verdict::Passed, "{check:?}");
        check.note().to_owned()
    };
    checked("device: FPGA bus");
    checked("device: test frame");
    checked("LED lines");
    let clock = checked("device: ADC clock");
    assert!(
        clock.contains("129.") || clock.contains("128."),
        "125 MHz by a clock of 100 MHz: {clock}"
    );
}

#[test]
fn without_the_adc_clock_the_rtl_says_so_and_nothing_else_fails() {
    let mut fpga = RtlFpga::new(&ideal(), 1);
    fpga.adc_clock(false);
    let mut session = session(fpga);
    let asked = Fpga::ask(&mut session, &mut IgnorePackets).unwrap();
    let Sampling::Window { width_steps, phase_steps, .. } = asked.sampling() else {
        panic!("{:?}", asked.sampling())
    };
    assert_eq!((width_steps, phase_steps), (15, 17), "as the board of these tests says");
    let told = asked.to_string();
    assert!(told.contains("PLL not locked, ADC domain in reset"), "{told}");
    let found = self_test(&mut session);
    let failed = failures(&found);
    assert_eq!(failed.len(), 1, "{failed:#?}");
    assert_eq!(failed[0].name(), "device: ADC clock");
}
