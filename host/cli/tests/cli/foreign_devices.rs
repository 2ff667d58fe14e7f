//! What answers on a TCP port and is no camera that this program can use.

use crate::bench::Bench;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::{
    Answer, Capabilities, Deframed, Deframer, DeviceMessage, Identity, Refusal, Reply, Request,
    Version, encode, open,
};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// Whatever does not answer is given up within this.
const PATIENCE: Duration = Duration::from_secs(6);

/// Listens on a free port and lets `device` have the first host that comes.
fn device(device: impl FnOnce(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || device(listener.accept().unwrap().0));
    format!("tcp:{address}")
}

/// A capture fails in time, in one line that names the address, and records nothing.
#[track_caller]
fn refused(camera: &str, words: &[&str]) {
    let (bench, start) = (Bench::new(), Instant::now());
    let outcome = bench.run(&["capture", "--camera", camera, "--frames", "5", "--out", "rec.mcap"]);
    let took = start.elapsed();
    outcome.failed(1, &[&[camera], words].concat());
    assert!(took < PATIENCE, "{took:?}");
    assert!(bench.names().is_empty(), "{:?}", bench.names());
}

/// Answers each command by `answer`.
fn answering(answer: fn() -> Result<Answer<'static>, Refusal>) -> String {
    replying(move |id, packet| {
        let reply = DeviceMessage::Reply(Reply { id, outcome: answer() });
        encode(&reply, packet).unwrap().to_vec()
    })
}

/// Sends what `reply` makes of the number of each command and a buffer.
fn replying(reply: impl Fn(u16, &mut [u8]) -> Vec<u8> + Send + 'static) -> String {
    device(move |mut host| {
        let mut deframer = Deframer::<MAX_HOST_PACKET>::new();
        let mut buffer = [0; 4096];
        while let Ok(length @ 1..) = host.read(&mut buffer) {
            let mut bytes = &buffer[..length];
            while let Some(found) = deframer.next(&mut bytes) {
                let Deframed::Packet(packet) = found else { continue };
                let Ok(Request { id, .. }) = open::<Request<'_>>(packet) else { continue };
                let mut packet = vec![0; MAX_DEVICE_PACKET + 1];
                host.write_all(&reply(id, &mut packet)).unwrap();
            }
        }
    })
}

#[test]
fn what_answers_as_no_camera_of_this_version_is_refused_in_words() {
    let identity = || {
        Ok(Answer::Hello(Identity {
            protocol: 99,
            firmware: Version(9, 9, 9),
            gateware: Version(9, 9, 9),
            board: "future",
            serial: "1",
            side: 64,
            adc_hz: 250_000_000,
            adc_bits: 16,
            wavelength_nm: 1550,
            capabilities: Capabilities::default(),
        }))
    };
    let future = ["protocol version 99", "this program version 1:", "update this program"];
    refused(&answering(identity), &future);
    refused(&answering(|| Err(Refusal::Protocol { device: 99 })), &future);
    // DeviceMessage::Reply, the number, Ok, Answer::Hello, the version; then fields that nobody knows yet.
    let greeting = |id, packet: &mut [u8]| {
        encode(&(0u8, id, 0u8, 0u8, 99u16, [0xA5u8; 31]), packet).unwrap().to_vec()
    };
    refused(&replying(greeting), &future);
    let past = ["protocol version 0", "this program version 1:", "update the camera's firmware"];
    refused(&answering(|| Err(Refusal::Protocol { device: 0 })), &past);
    refused(&answering(|| Err(Refusal::Bus)), &["refused Hello", "FPGA does not answer"]);
    let web = device(|mut host| {
        let _ = host.read(&mut [0; 1000]);
        let _ = host.write_all(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n");
    });
    refused(&web, &["closed the link"]);
    refused(&device(drop), &["link closed before the camera answered", "another program"]);
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    refused(&format!("tcp:{free}"), &["no camera at", "refused"]);
}

#[test]
fn a_device_that_says_nothing_is_given_up() {
    let silent = device(|mut host| {
        let _ = std::io::copy(&mut host, &mut std::io::sink());
    });
    refused(&silent, &["no answer to Hello within 5 s", "is this a nirspi camera?"]);
}

#[test]
fn a_device_that_talks_nonsense_is_given_up() {
    let noise = device(|mut host| {
        let mut state = 1u32;
        let mut noise = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let bytes: Vec<u8> = (0..65_536).map(|_| noise()).collect();
        while host.write_all(&bytes).is_ok() {}
    });
    refused(&noise, &["no answer to Hello within 5 s"]);
}
