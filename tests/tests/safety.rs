//! Tests that LEDs go off when they must: real firmware logic, the gateware's golden model, and
//! requests as a host sends them.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_optics::Scene;
use nirspi_virtual::{OpticalFpga, SimulatedFpga, VirtualCamera, VirtualOptics};
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{
    Command, Configuration, Deframed, Deframer, DeviceMessage, EventKind, Fault, PatternOrder,
    Refusal, Reply, Request, RunLength, SampleSource, encode, open, version,
};

/// 8 us, the step of the virtual camera.
const STEP_CLOCKS: u32 = 1000;

/// The messages that matter to these tests.
#[derive(Debug, PartialEq)]
enum Heard {
    Done,
    Refused(Refusal),
    Fault(Fault),
    RunEnded,
    Frame,
}

struct Bench {
    camera: VirtualCamera<OpticalFpga>,
    deframer: Box<Deframer<MAX_DEVICE_PACKET>>,
    next_id: u16,
}

impl Bench {
    fn new() -> Self {
        let scene = Scene::new(vec![0.5; 64], 8, 48.0).unwrap();
        let camera = VirtualOptics::new(scene, 300.0).unwrap().camera(1).unwrap();
        let mut bench = Self { camera, deframer: Box::default(), next_id: 0 };
        bench.ask(Command::Hello { protocol: version::CURRENT });
        bench
    }

    /// Sends a command and lets 80 us pass.
    fn ask(&mut self, command: Command<'_>) -> Vec<Heard> {
        let mut packet = [0; 4096];
        let id = self.next_id;
        self.next_id += 1;
        self.camera.receive(encode(&Request { id, command }, &mut packet).unwrap());
        self.pass(10)
    }

    /// Lets time pass; returns the messages of that time.
    fn pass(&mut self, steps: usize) -> Vec<Heard> {
        let mut heard = Vec::new();
        for _ in 0..steps {
            self.camera.step(STEP_CLOCKS);
            let waiting = self.camera.packets_out().waiting().to_vec();
            self.camera.packets_out().sent(waiting.len());
            let mut bytes = &waiting[..];
            while let Some(found) = self.deframer.next(&mut bytes) {
                let Deframed::Packet(packet) = found else { panic!("{found:?}") };
                match open::<DeviceMessage<'_>>(packet).unwrap() {
                    DeviceMessage::Reply(Reply { outcome: Ok(_), .. }) => heard.push(Heard::Done),
                    DeviceMessage::Reply(Reply { outcome: Err(refusal), .. }) => {
                        heard.push(Heard::Refused(refusal));
                    }
                    DeviceMessage::Event(event) => match event.kind {
                        EventKind::Fault(fault) => heard.push(Heard::Fault(fault)),
                        EventKind::RunEnded { .. } => heard.push(Heard::RunEnded),
                        other => panic!("{other:?}"),
                    },
                    DeviceMessage::Frame(_) => heard.push(Heard::Frame),
                    _ => {}
                }
            }
        }
        heard
    }

    fn configure(&mut self) -> Vec<Heard> {
        self.ask(Command::Configure(Configuration {
            order: PatternOrder::Sequency,
            patterns: 1024,
            differential: true,
            alternating: true,
            clocks_per_pattern: 5,
            blanked: 2,
            adc_latency: 6,
            sweeps: 1,
            source: SampleSource::Detector,
            over_range_trip: 0,
        }))
    }

    fn running() -> Self {
        let mut bench = Self::new();
        assert_eq!(bench.configure(), [Heard::Done]);
        let heard = bench.ask(Command::Start(RunLength::Continuous));
        assert_eq!(heard[0], Heard::Done);
        assert!(bench.lit());
        bench
    }

    fn lit(&self) -> bool {
        self.camera.fpga().running()
    }
}

#[test]
fn an_interlock_that_opens_in_mid_run_ends_it_until_it_is_closed_and_acknowledged() {
    let mut bench = Bench::running();
    assert!(bench.pass(100).contains(&Heard::Frame));
    bench.camera.set_interlock(false);
    let heard = bench.pass(1);
    assert!(!bench.lit(), "dark within one look of the firmware");
    let heard: Vec<_> = heard.into_iter().chain(bench.pass(100)).collect();
    assert!(heard.contains(&Heard::Fault(Fault::Interlock)), "{heard:?}");
    assert!(heard.contains(&Heard::RunEnded));

    // While the interlock is open, the camera refuses both a start and an acknowledgement.
    let heard = bench.ask(Command::Start(RunLength::Continuous));
    assert!(matches!(heard[..], [Heard::Refused(_)]), "{heard:?}");
    assert_eq!(bench.configure(), [Heard::Refused(Refusal::Fault(Fault::Interlock))]);
    bench.camera.set_interlock(true);
    bench.pass(10);
    assert!(!bench.lit(), "closing it alone lights nothing");
    assert_eq!(bench.configure(), [Heard::Done]);
    bench.ask(Command::Start(RunLength::Continuous));
    assert!(bench.lit());
}

#[test]
fn heat_and_a_broken_sensor_end_a_run() {
    for (reading, fault) in [
        (Some(7000), Fault::OverTemperature { centi_celsius: 7000 }),
        (None, Fault::TemperatureSensor),
    ] {
        let mut bench = Bench::running();
        bench.camera.set_temperature(reading);
        let heard = bench.pass(20);
        assert!(!bench.lit());
        assert!(heard.contains(&Heard::Fault(fault)), "{heard:?}");
    }
}

#[test]
fn a_host_that_unplugs_leaves_darkness() {
    let mut bench = Bench::running();
    bench.camera.link_closed();
    bench.pass(1);
    assert!(!bench.lit());
}

#[test]
fn the_gateware_goes_dark_when_the_firmware_hangs() {
    let optics = VirtualOptics::new(Scene::new(vec![0.5; 64], 8, 48.0).unwrap(), 300.0).unwrap();
    let mut fpga = optics.fpga(1).unwrap();
    use nirspi_mcu::FpgaBus;
    use nirspi_wire::register::{Register, control};
    fpga.write(Register::Watchdog.address(), 50_000).unwrap();
    fpga.write(Register::Control.address(), control::START).unwrap();
    fpga.advance(49_999);
    assert!(fpga.running());
    fpga.advance(2);
    assert!(!fpga.running());
}
