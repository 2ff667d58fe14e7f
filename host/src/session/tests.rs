//! A camera of fixed words.

use super::*;
use nirspi_wire::{Event, EventKind, Fault, State};
use std::io;

/// Answers each request with the next of these chunks.
struct Scripted(Vec<Vec<u8>>);

impl Link for Scripted {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }
    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        if self.0.is_empty() {
            return Ok(Received::Closed);
        }
        let chunk = self.0.remove(0);
        buffer[..chunk.len()].copy_from_slice(&chunk);
        Ok(Received::Bytes(chunk.len()))
    }
}

fn packet(message: DeviceMessage<'_>) -> Vec<u8> {
    let mut buffer = vec![0; MAX_DEVICE_PACKET + 1];
    encode(&message, &mut buffer).unwrap().to_vec()
}

fn event(kind: EventKind) -> Vec<u8> {
    packet(DeviceMessage::Event(Event { device_time_us: 0, kind }))
}

#[test]
fn what_a_camera_reports_with_its_greeting_is_kept_and_an_earlier_hosts_mess_is_not() {
    let identity = Identity {
        protocol: PROTOCOL_VERSION,
        firmware: Version(0, 1, 0),
        gateware: Version(0, 1, 0),
        board: "test",
        serial: "1",
        side: 32,
        adc_hz: 0,
        adc_bits: 14,
        wavelength_nm: 1550,
    };
    let status = Status {
        state: State::Idle,
        fault: None,
        uptime_us: 0,
        run: 0,
        frames_made: 0,
        frames_sent: 0,
        frames_dropped: 0,
        fpga_frames_lost: 0,
        fpga_frames_corrupt: 0,
        commands_damaged: 1,
        temperature_centi_celsius: 0,
        duty_permille: 0,
        leds_on: false,
        interlock_closed: true,
    };
    let reply = |id, answer| packet(DeviceMessage::Reply(Reply { id, outcome: Ok(answer) }));
    let greeting = [
        event(EventKind::CommandDamaged),
        reply(0, Answer::Hello(identity)),
        event(EventKind::Fault(Fault::HostSilent)),
    ];
    let later = [event(EventKind::Fault(Fault::Duty)), reply(1, Answer::Status(status))].concat();
    let link = Scripted(vec![greeting.concat(), later]);
    let mut session = Session::open(Box::new(link)).unwrap();
    assert_eq!(session.reports().len(), 1, "{:?}", session.reports());
    let reports = session.await_reports().unwrap();
    assert!(reports[0].contains("no command") && reports[1].contains("lit over time"), "{reports:?}");
}
