//! Wire packets on both sides, frames and packets of the FPGA, accesses of its host port, the tunnel.

use crate::{Law, MIB, is_one_line, seeds};
use nirspi::events;
use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_virtual::serve_tunnel;
use nirspi_wire::fpga::{CRC_BYTES, FpgaFrame, HEADER_BYTES, MAX_FRAME_BYTES, Sums, frame_bytes};
use nirspi_wire::host_port::{self, READ_FRAME, READ_REGISTER, WRITE_REGISTER, seal, unseal};
use nirspi_wire::packet::{
    MAX_DEVICE_PACKET, hello_of_any_version, overhead, parse, request_id, unseal as open_packet,
};
use nirspi_wire::ready::{self, Head, Reader, packet_in};
use nirspi_wire::register::{Register, control};
use nirspi_wire::samples::Width;
use nirspi_wire::tunnel::{self, Lines, REPLY_HEAD_BYTES, REQUEST_BYTES};
use nirspi_wire::{
    Deframed, Deframer, DeviceMessage, Frame, FrameFlags, PacketError, Request, crc32, encode,
    packet, version,
};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::AtomicBool;

pub const LAWS: &[Law] = &[
    Law {
        name: "packets",
        reads: "a byte stream, cut into packets: whole, byte by byte and in pieces alike",
        readers: &["mcu/wire/src/packet.rs", "mcu/wire/src/stuffing.rs", "mcu/wire/src/crc32.rs"],
        holds: packets,
        seeds: || vec![seeds::camera_says(), seeds::commands(3).concat(), vec![1; 300]],
        longest: 16_384,
        most_memory: MIB,
    },
    Law {
        name: "messages",
        reads: "the bytes of a command or of a camera's message",
        readers: &[
            "mcu/wire/src/message.rs",
            "mcu/wire/src/samples.rs",
            "host/camera/src/events.rs",
        ],
        holds: messages,
        seeds: message_seeds,
        longest: 4096,
        most_memory: MIB,
    },
    Law {
        name: "fpga-frames",
        reads: "a frame of the FPGA's host port, its checksum right or as it comes",
        readers: &["mcu/wire/src/fpga.rs"],
        holds: fpga_frames,
        seeds: || vec![frame_of(&[]), frame_of(&[(1, 2)]), frame_of(&[(3, 4); 16])],
        longest: 2048,
        most_memory: MIB,
    },
    Law {
        name: "fpga-packets",
        reads: "a packet that the FPGA has made of a frame, among zeros",
        readers: &["mcu/wire/src/ready.rs", "mcu/wire/src/samples.rs"],
        holds: fpga_packets,
        seeds: || vec![vec![0; 8], (0..120).collect(), [&[1, 2, 0x80][..], &[7; 60]].concat()],
        longest: 1024,
        most_memory: MIB,
    },
    Law {
        name: "spi",
        reads: "register writes and reads of the FPGA's host port, sound and damaged, among clocks",
        readers: &[
            "mcu/wire/src/host_port.rs",
            "hdl/model/src/gateware.rs",
            "hdl/model/src/registers.rs",
            "hdl/model/src/settings.rs",
            "hdl/model/src/safety.rs",
        ],
        holds: spi,
        seeds: spi_seeds,
        longest: 1024,
        most_memory: 4 * MIB,
    },
    Law {
        name: "tunnel",
        reads: "accesses of an emulated board over TCP",
        readers: &["mcu/wire/src/tunnel.rs", "host/virtual/src/tunnel.rs"],
        holds: tunnel_line,
        seeds: tunnel_seeds,
        longest: 512,
        most_memory: 8 * MIB,
    },
];

/// What a deframer finds when it is given these pieces, each packet with its bytes.
fn found<'p>(pieces: impl Iterator<Item = &'p [u8]>) -> (Vec<Option<Vec<u8>>>, usize) {
    let mut deframer = Deframer::<MAX_DEVICE_PACKET>::new();
    let mut all = Vec::new();
    for piece in pieces {
        let mut rest = piece;
        while let Some(one) = deframer.next(&mut rest) {
            all.push(match one {
                Deframed::Packet(packet) => Some(packet.to_vec()),
                Deframed::TooLong => None,
            });
        }
        assert!(rest.is_empty(), "bytes left over");
    }
    (all, deframer.pending())
}

fn packets(bytes: &[u8]) {
    let whole = found(std::iter::once(bytes));
    assert_eq!(found(bytes.chunks(1)), whole, "byte by byte");
    assert_eq!(found(bytes.chunks(61)), whole, "in pieces");
    for packet in whole.0.iter().flatten() {
        assert!(packet.len() <= MAX_DEVICE_PACKET && !packet.contains(&0));
        let mut copy = packet.clone();
        // What is taken for a payload makes the same packet again, if it came in the shortest form.
        let Ok(payload) = open_packet(&mut copy) else { continue };
        let payload = payload.to_vec();
        let mut room = vec![0; payload.len() + overhead(payload.len())];
        let again = packet::seal(&payload, &mut room).expect("room for the overhead");
        assert_eq!(again.split_last(), Some((&0, &packet[..])), "another packet");
        message(&payload);
    }
}

/// Both directions of one payload.
fn message(payload: &[u8]) {
    let mut room = vec![0; 2 * MAX_DEVICE_PACKET];
    if let Ok(request) = parse::<Request<'_>>(payload) {
        assert_eq!(request_id(payload), Some(request.id));
        let mut again = encode(&request, &mut room).expect("it fitted").to_vec();
        again.pop();
        assert_eq!(nirspi_wire::open::<Request<'_>>(&mut again), Ok(request));
    }
    let content = parse::<DeviceMessage<'_>>(payload);
    if let Ok(message) = content {
        let mut again = encode(&message, &mut room).expect("it fitted").to_vec();
        again.pop();
        let read_again = nirspi_wire::open::<DeviceMessage<'_>>(&mut again);
        // Bytes that no camera sends hold NaN, which differs from itself.
        assert!(same(&read_again, &message), "{read_again:?} of {message:?}");
        if let Some((_, line)) = events::line(&message) {
            is_one_line(&line);
        }
        if let DeviceMessage::Frame(frame) = message {
            assert_eq!(frame.samples.iter().len(), frame.samples.len());
            assert!(frame.samples.iter().all(|sample| sample.unsigned_abs() < 1 << 50));
        }
    }
    if let Some((id, _)) = hello_of_any_version(payload) {
        assert_eq!(payload.first(), Some(&0));
        if let Ok(DeviceMessage::Reply(reply)) = content {
            assert_eq!(reply.id, id);
        }
    }
}

fn same(a: &Result<DeviceMessage<'_>, PacketError>, b: &DeviceMessage<'_>) -> bool {
    a.is_ok_and(|a| a == *b || format!("{a:?}") == format!("{b:?}"))
}

fn messages(payload: &[u8]) {
    let mut room = vec![0; payload.len() + overhead(payload.len())];
    let sealed = packet::seal(payload, &mut room).expect("room for the overhead").to_vec();
    let (one, pending) = found(sealed.chunks(7));
    let [Some(packet)] = &one[..] else { panic!("{} packets of one", one.len()) };
    assert_eq!(pending, 0);
    let mut packet = packet.clone();
    assert_eq!(open_packet(&mut packet), Ok(payload), "another payload");
    message(payload);
}

fn message_seeds() -> Vec<Vec<u8>> {
    let camera = seeds::camera_says();
    let mut all: Vec<Vec<u8>> = seeds::packets(&camera).iter().map(|p| seeds::payload(p)).collect();
    all.extend(seeds::commands(3).iter().map(|packet| seeds::payload(packet)));
    all
}

/// A sound frame of these sums.
fn frame_of(sums: &[(u64, u64)]) -> Vec<u8> {
    let header = nirspi_wire::fpga::Header {
        patterns: sums.len() as u16,
        flags: FrameFlags(0),
        sequence: 5,
        sweeps: 1,
        over_range: 0,
        lost: 0,
        clock: 99,
    };
    let mut bytes = header.to_bytes().to_vec();
    for &(positive, negative) in sums {
        bytes.extend(Sums { positive, negative }.to_bytes());
    }
    bytes.extend(crc32(&bytes).to_le_bytes());
    bytes
}

fn fpga_frames(bytes: &[u8]) {
    one_frame(bytes);
    // The same with a right checksum, which no search finds.
    let mut mended = bytes.to_vec();
    if let Some(covered) = bytes.len().checked_sub(CRC_BYTES) {
        let crc = crc32(&bytes[..covered]);
        mended[covered..].copy_from_slice(&crc.to_le_bytes());
    }
    one_frame(&mended);
}

fn one_frame(bytes: &[u8]) {
    let header = FpgaFrame::parse_header(bytes);
    let Ok(frame) = FpgaFrame::parse(bytes) else { return };
    assert_eq!(Some(frame.header), header);
    assert_eq!(bytes.len(), frame_bytes(frame.header.patterns));
    assert_eq!(frame.sums().len(), usize::from(frame.header.patterns));
    let mut again = frame.header.to_bytes().to_vec();
    assert_eq!(again.len(), HEADER_BYTES);
    for sums in frame.sums() {
        assert!(sums.difference().unsigned_abs() < 1 << 48);
        again.extend(sums.to_bytes());
    }
    again.extend(crc32(&again).to_le_bytes());
    assert_eq!(again, bytes, "another frame");
}

fn fpga_packets(bytes: &[u8]) {
    let Some((&[patterns, lead, form], rest)) = bytes.split_first_chunk() else { return };
    let width = if form & 0x80 == 0 { Width::Bits32 } else { Width::Bits24 };
    let patterns = u16::from(patterns % 32);
    // As they come.
    if let Some(range) = packet_in(rest, patterns, width) {
        assert_eq!(rest[range.end - 1], 0, "the end");
        assert_ne!(rest[range.start], 0, "the beginning");
        assert!(rest[..range.start].iter().all(|byte| *byte == 0));
        let mut reader = Reader::new(&rest[range], patterns);
        for _ in 0..patterns {
            let _ = reader.sample();
        }
        let _ = reader.is_intact();
    }
    // As the FPGA would make them of a frame with these samples.
    let Some((&numbers, samples)) = rest.split_first_chunk::<8>() else { return };
    let number = u64::from_le_bytes(numbers);
    let length = usize::from(patterns) * width.bytes();
    let samples = samples.get(..length).unwrap_or(&[]);
    if samples.len() < length {
        return;
    }
    let head = Head {
        run: number as u16,
        sequence: (number >> 8) as u32,
        device_time_us: number,
        sweeps: (number >> 32) as u32,
        flags: FrameFlags((number >> 16) as u16),
        patterns,
        width,
    };
    let payload = [&head.to_bytes()[..], samples].concat();
    let mut room = vec![0; payload.len() + overhead(payload.len())];
    let sealed = packet::seal(&payload, &mut room).expect("room").to_vec();
    let read = [&vec![0; usize::from(lead % 65)][..], &sealed, &[0; 9]].concat();
    let range = packet_in(&read, patterns, width).expect("a packet among zeros");
    assert_eq!(read[range.clone()], sealed[..]);
    let (run, sequence) = ready::numbers(sealed.first_chunk().expect("ten bytes"));
    assert_eq!((run, sequence), (head.run, head.sequence));
    let mut opened = sealed.clone();
    opened.pop();
    let message = nirspi_wire::open::<DeviceMessage<'_>>(&mut opened);
    let Ok(DeviceMessage::Frame(frame)) = message else { panic!("{message:?} of a frame") };
    let Frame { run, sequence, device_time_us, sweeps, flags, samples } = frame;
    assert_eq!((run, sequence, device_time_us), (head.run, head.sequence, head.device_time_us));
    assert_eq!((sweeps, flags), (head.sweeps, head.flags));
    let mut reader = Reader::new(&sealed, patterns);
    assert_eq!((reader.sequence, reader.flags), (head.sequence, head.flags));
    for sample in samples.iter() {
        assert_eq!(i64::from(reader.sample()), sample);
    }
    assert!(reader.is_intact(), "a sound packet");
}

/// Bytes of one access: opcode, address, value and check, clocks afterwards.
const ACCESS: usize = 10;
/// The most accesses of one input.
const ACCESSES: usize = 100;

fn spi(bytes: &[u8]) {
    let mut gateware = Gateware::new();
    for access in bytes.chunks_exact(ACCESS).take(ACCESSES) {
        let &[what, a0, a1, v0, v1, v2, v3, c0, c1, clocks] = access else { continue };
        let address = u16::from_le_bytes([a0, a1]);
        match what {
            READ_REGISTER => {
                let value = gateware.read(address);
                let register = Register::at(address);
                assert!(value.is_some() || register.is_none(), "{register:?} does not answer");
                let value = value.unwrap_or(0);
                assert_eq!(unseal(address, seal(address, value)), Some(value));
            }
            READ_FRAME => delivered(&mut gateware),
            host_port::READ_RAW => {
                let burst = gateware.raw().map(<[u8]>::len);
                assert!(burst.is_none_or(|length| length <= MAX_FRAME_BYTES), "{burst:?}");
            }
            // The interlock is a line of its own.
            1 => gateware.set_interlock(v0 & 1 == 0),
            2 => gateware.set_adc_clock((v0 & 1 == 0).then_some(125_000_000)),
            WRITE_REGISTER => take(&mut gateware, address, [v0, v1, v2, v3, c0, c1]),
            // The same with a right check, which a search hardly finds.
            _ => take(&mut gateware, address, seal(address, u32::from_be_bytes([v0, v1, v2, v3]))),
        }
        let closed_before = gateware.read(Register::Status.address());
        for _ in 0..if gateware.has_adc_clock() { u32::from(clocks) } else { 0 } {
            gateware.tick(AdcSample { code: u16::from(v0) << 6, over_range: c1 == 0x55 });
            let lines = gateware.lines();
            assert!(!lines.enable || gateware.running(), "lit without a run");
        }
        let interlock = nirspi_wire::register::status::INTERLOCK_CLOSED;
        let open = closed_before.is_some_and(|status| status & interlock == 0);
        assert!(!open || !gateware.lines().enable, "lit with an open interlock");
    }
}

/// A write takes effect if its check is right.
fn take(gateware: &mut Gateware, address: u16, sealed: [u8; 6]) {
    let Some(value) = unseal(address, sealed) else { return };
    assert_eq!(seal(address, value), sealed, "two writes with one check");
    let before = gateware.read(Register::Writes.address());
    let has_clock = gateware.has_adc_clock();
    gateware.write(address, value);
    let after = gateware.read(Register::Writes.address());
    if has_clock {
        assert_eq!(after, before.map(|count| count.wrapping_add(1)), "a write that is not counted");
    }
}

/// A frame that is delivered is sound.
fn delivered(gateware: &mut Gateware) {
    let Some(frame) = gateware.frame() else { return };
    let mut packet = frame.to_vec();
    packet.pop();
    let is_frame = FpgaFrame::parse(frame).is_ok();
    let is_packet = nirspi_wire::open::<DeviceMessage<'_>>(&mut packet).is_ok();
    assert!(is_frame || is_packet, "a frame of {} bytes that is not sound", frame.len());
}

fn spi_seeds() -> Vec<Vec<u8>> {
    let write = |register: Register, value: u32, clocks: u8| {
        let [a0, a1] = register.address().to_le_bytes();
        let [v0, v1, v2, v3, c0, c1] = seal(register.address(), value);
        vec![WRITE_REGISTER, a0, a1, v0, v1, v2, v3, c0, c1, clocks]
    };
    let close = vec![1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    let frame = vec![READ_FRAME, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    let run = [
        close.clone(),
        write(Register::Patterns, 4, 0),
        write(Register::Frames, 2, 0),
        write(Register::DutyLimit, u32::MAX, 0),
        write(Register::Watchdog, 100_000, 0),
        write(Register::Control, control::START, 200),
        frame.clone(),
        write(Register::Control, control::RELEASE, 200),
        frame,
    ];
    let burst = [
        close,
        write(Register::RawLength, 16, 0),
        write(Register::Control, control::START_RAW, 250),
        vec![host_port::READ_RAW, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        vec![READ_REGISTER, 4, 0, 0, 0, 0, 0, 0, 0, 0],
    ];
    vec![run.concat(), burst.concat()]
}

fn tunnel_line(bytes: &[u8]) {
    for request in bytes.as_chunks::<REQUEST_BYTES>().0 {
        let crc = crc32(&request[..REQUEST_BYTES - tunnel::CRC_BYTES]).to_le_bytes();
        let mut mended = *request;
        mended[REQUEST_BYTES - tunnel::CRC_BYTES..].copy_from_slice(&crc);
        for bytes in [request, &mended] {
            let Some(request) = tunnel::Request::from_bytes(bytes) else { continue };
            assert_eq!(request.to_bytes(), *bytes, "another request");
            assert!(request.reply_data() <= MAX_FRAME_BYTES);
        }
        let head = *request.first_chunk::<REPLY_HEAD_BYTES>().expect("as long");
        let (number, lines) = Lines::from_reply_head(head);
        let again = Lines::from_reply_head(lines.to_reply_head(number));
        assert_eq!(again, (number, lines));
    }
    // The first byte says which requests get a right checksum, so that the search need not find it.
    let Some((&mended, rest)) = bytes.split_first() else { return };
    let mut line = Vec::new();
    for (at, request) in rest.chunks(REQUEST_BYTES).enumerate() {
        line.extend(request);
        if let (Some((head, _)), true) =
            (request.split_last_chunk::<{ tunnel::CRC_BYTES }>(), mended >> (at % 8) & 1 == 1)
        {
            line.truncate(line.len() - tunnel::CRC_BYTES);
            line.extend(crc32(head).to_le_bytes());
        }
    }
    answered(&line);
}

/// Serves these bytes, then checks that the replies are those of the requests among them.
fn answered(line: &[u8]) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let mut board = TcpStream::connect(listener.local_addr().expect("its address")).expect("open");
    let (served, _) = listener.accept().expect("the board");
    board.write_all(line).expect("room for a few requests");
    board.shutdown(std::net::Shutdown::Write).expect("the end");
    let mut fpga = seeds::optics().fpga(1).expect("an FPGA");
    let reading = std::thread::spawn(move || {
        let mut replies = Vec::new();
        board.read_to_end(&mut replies).expect("replies");
        replies
    });
    serve_tunnel(served, &mut fpga, &AtomicBool::new(true)).expect("a board that hangs up");
    let replies = reading.join().expect("no panic");
    let (mut rest, mut at) = (&replies[..], 0);
    while let Some(bytes) = line.get(at..).and_then(<[u8]>::first_chunk) {
        let Some(request) = tunnel::Request::from_bytes(bytes) else {
            at += 1;
            continue;
        };
        at += REQUEST_BYTES;
        let length = REPLY_HEAD_BYTES + request.reply_data();
        let (head, after) = rest.split_at_checked(length).expect("a whole reply");
        let (crc, after) = after.split_first_chunk().expect("its checksum");
        assert_eq!(crc32(head), u32::from_le_bytes(*crc), "a damaged reply");
        assert_eq!(head[0], request.number, "the reply to another request");
        rest = after;
    }
    assert!(rest.is_empty(), "{} bytes after the last reply", rest.len());
}

fn tunnel_seeds() -> Vec<Vec<u8>> {
    let ask = |opcode, number, address, argument| {
        let board_enable = number % 2 == 0;
        tunnel::Request { opcode, number, address, argument, board_enable }.to_bytes().to_vec()
    };
    let identity = ask(READ_REGISTER, 1, Register::Identity.address(), 0);
    let run = [
        vec![0xFF],
        ask(WRITE_REGISTER, 2, Register::Patterns.address(), 4),
        ask(WRITE_REGISTER, 3, Register::DutyLimit.address(), u32::MAX),
        ask(WRITE_REGISTER, 4, Register::Control.address(), control::START),
        ask(tunnel::LOOK, 5, 0, 0),
        ask(READ_FRAME, 6, 0, frame_bytes(4) as u32),
    ];
    let noise = [vec![0], vec![9, 9, 9], identity.clone(), vec![version::CURRENT as u8; 5]];
    vec![[vec![0], identity].concat(), run.concat(), noise.concat()]
}
