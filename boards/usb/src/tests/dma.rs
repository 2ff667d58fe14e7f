//! The chip's driver by DMA, endpoint by endpoint: without the camera, on the simulated core.

use super::otg_core::{Answer, ENDPOINTS, OtgCore, Speed};
use crate::OutBuffer;
use core::pin::pin;
use core::task::Poll;
use embassy_futures::poll_once;
use embassy_usb::driver::{
    Bus as _, ControlPipe as _, Driver as _, EndpointAddress, EndpointError, EndpointIn as _,
    EndpointOut as _, EndpointType, Event,
};
use embassy_usb_synopsys_otg::otg_v1::Otg;
use embassy_usb_synopsys_otg::{
    Bus, Config, ControlPipe, Driver, Endpoint, In, OtgInstance, Out, PhyType, State, testing,
};
use std::boxed::Box;
use std::cell::RefCell;
use std::rc::Rc;
use std::string::String;
use std::vec::Vec;

const TO_HOST: u8 = 0x81;
const FROM_HOST: u8 = 0x01;
/// The device has no address of its own yet.
const NEW: u8 = 0;

/// A driver with DMA on the simulated core, with one bulk endpoint each way.
struct Lab {
    core: Rc<RefCell<OtgCore>>,
    registers: Otg,
    state: &'static State<ENDPOINTS>,
    bus: Bus<'static, ENDPOINTS>,
    pipe: ControlPipe<'static>,
    to_host: Endpoint<'static, In>,
    from_host: Endpoint<'static, Out>,
}

fn driver(
    buffer: &'static mut [u8],
) -> (Rc<RefCell<OtgCore>>, Otg, &'static State<ENDPOINTS>, Driver<'static, ENDPOINTS>) {
    let core: Rc<RefCell<OtgCore>> = Rc::default();
    let registers = testing::install(Rc::clone(&core) as Rc<_>, false);
    let state: &'static State<ENDPOINTS> = Box::leak(Box::new(State::new()));
    let instance = OtgInstance {
        regs: registers,
        state,
        fifo_depth_words: 1024,
        endpoint_count: ENDPOINTS,
        phy_type: PhyType::InternalHighSpeed,
        extra_rx_fifo_words: 30,
        calculate_trdt_fn: |_| 9,
    };
    let mut config = Config::default();
    config.dma = true;
    (core, registers, state, Driver::new(buffer, instance, config))
}

impl Lab {
    fn new(speed: Speed) -> Self {
        let OutBuffer(buffer) = Box::leak(Box::new(OutBuffer::new()));
        let (core, registers, state, mut driver) = driver(buffer);
        let bulk = EndpointType::Bulk;
        let to_host = driver.alloc_endpoint_in(bulk, Some(TO_HOST.into()), 512, 0).unwrap();
        let from_host = driver.alloc_endpoint_out(bulk, Some(FROM_HOST.into()), 512, 0).unwrap();
        let (bus, pipe) = driver.start(64);
        let mut lab = Self { core, registers, state, bus, pipe, to_host, from_host };
        assert_eq!(lab.event(), Some(Event::PowerDetected));
        lab.plug(speed);
        lab
    }

    fn event(&mut self) -> Option<Event> {
        self.interrupts();
        match poll_once(self.bus.poll()) {
            Poll::Ready(event) => Some(event),
            Poll::Pending => None,
        }
    }

    fn plug(&mut self, speed: Speed) {
        self.core.borrow_mut().reset();
        assert_eq!(self.event(), None);
        self.core.borrow_mut().enumerated(speed);
        assert_eq!(self.event(), Some(Event::Reset));
        for address in [TO_HOST, FROM_HOST] {
            self.bus.endpoint_set_enabled(EndpointAddress::from(address), true);
        }
    }

    fn interrupts(&self) {
        for _ in 0..100 {
            if !self.core.borrow_mut().interrupt() {
                return;
            }
            testing::interrupt(self.registers, self.state);
        }
        panic!("the interrupt does not end");
    }

    fn fetch(&self, endpoint: usize) -> Answer {
        let answer = self.core.borrow_mut().fetch(NEW, endpoint, true);
        self.interrupts();
        answer
    }

    fn send(&self, endpoint: usize, bytes: &[u8], toggle: u8) -> Answer {
        let answer = self.core.borrow_mut().send(NEW, endpoint, bytes, toggle);
        self.interrupts();
        answer
    }

    fn request(&self, request: [u8; 8]) {
        assert!(matches!(self.core.borrow_mut().setup(NEW, request), Answer::Data(..)));
        self.interrupts();
    }

    fn asked(&mut self) -> Option<[u8; 8]> {
        match poll_once(self.pipe.setup()) {
            Poll::Ready(request) => Some(request),
            Poll::Pending => None,
        }
    }

    fn assert_no_violation(&self) {
        assert_eq!(self.core.borrow().violations, Vec::<String>::new());
    }
}

/// Bytes at a multiple of four, as a place of the link has them.
fn words(bytes: usize) -> Vec<u32> {
    (0..bytes.div_ceil(4) as u32).map(|word| word.wrapping_mul(0x0101_4363)).collect()
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_ne_bytes()).collect()
}

/// Memory of words as bytes, at the same place.
struct Aligned(Box<[u8]>, usize);

impl Aligned {
    fn new(length: usize) -> Self {
        let mut memory: Box<[u8]> = std::vec![0; length + 4].into();
        let begin = memory.as_ptr().align_offset(4);
        memory[begin..][..length].copy_from_slice(&bytes(&words(length))[..length]);
        Self(memory, begin)
    }

    fn bytes(&self) -> &[u8] {
        &self.0[self.1..self.0.len() - 4 + self.1]
    }
}

#[test]
fn a_write_of_many_packets_ends_when_the_host_has_the_last() {
    for (speed, packet) in [(Speed::High, 512), (Speed::Full, 64)] {
        let mut lab = Lab::new(speed);
        let mut toggle = 0;
        for length in [1, packet, 3 * packet, 4132, 0] {
            let memory = Aligned::new(length);
            let sent = memory.bytes();
            let mut got = Vec::new();
            let Lab { to_host, core, registers, state, .. } = &mut lab;
            let mut write = pin!(to_host.write(sent));
            for _ in 0..length.div_ceil(packet).max(1) {
                assert!(poll_once(write.as_mut()).is_pending(), "{} of {length} bytes", got.len());
                let fetched = core.borrow_mut().fetch(NEW, 1, true);
                let Answer::Data(bytes, with) = fetched else { panic!("{fetched:?}") };
                assert_eq!(with, toggle);
                toggle ^= 1;
                got.extend(bytes);
                while core.borrow_mut().interrupt() {
                    testing::interrupt(*registers, state);
                }
            }
            assert_eq!(poll_once(write.as_mut()), Poll::Ready(Ok(())));
            assert!(got == sent, "{length} bytes");
            assert_eq!(core.borrow_mut().fetch(NEW, 1, true), Answer::Nak);
        }
        lab.assert_no_violation();
    }
}

#[test]
fn of_a_write_that_is_dropped_nothing_more_is_read_or_sent() {
    let mut lab = Lab::new(Speed::High);
    for fetched in 0..9 {
        let memory = Aligned::new(4132);
        let Lab { to_host, core, .. } = &mut lab;
        {
            let mut write = pin!(to_host.write(memory.bytes()));
            assert!(poll_once(write.as_mut()).is_pending());
            for _ in 0..fetched {
                assert!(matches!(core.borrow_mut().fetch(NEW, 1, true), Answer::Data(..)));
            }
        }
        assert!(!core.borrow().is_armed(1));
        assert_eq!(lab.fetch(1), Answer::Nak, "after {fetched} packets");
    }
    lab.assert_no_violation();
}

#[test]
fn a_reset_ends_a_write() {
    let mut lab = Lab::new(Speed::High);
    let memory = Aligned::new(4132);
    {
        let Lab { to_host, core, bus, .. } = &mut lab;
        let mut write = pin!(to_host.write(memory.bytes()));
        assert!(poll_once(write.as_mut()).is_pending());
        core.borrow_mut().reset();
        assert!(poll_once(bus.poll()).is_pending());
        assert_eq!(poll_once(write.as_mut()), Poll::Ready(Err(EndpointError::Disabled)));
        assert!(!core.borrow().is_armed(1));
    }
    lab.assert_no_violation();
}

#[test]
fn bytes_that_dma_cannot_read_are_refused() {
    let mut lab = Lab::new(Speed::Full);
    let memory = Aligned::new(64 * 1024);
    let bytes = memory.bytes();
    for (refused, what) in [(&bytes[1..9], "an odd place"), (bytes, "1024 packets")] {
        let outcome = poll_once(lab.to_host.write(refused));
        assert_eq!(outcome, Poll::Ready(Err(EndpointError::BufferOverflow)), "{what}");
        assert!(!lab.core.borrow().is_armed(1));
    }
    // The driver's own buffer, and a type of endpoint that DMA does not serve here.
    let shifted = &mut Box::leak(Box::new(OutBuffer::new())).0[1..];
    let (.., mut driver) = driver(shifted);
    assert!(driver.alloc_endpoint_out(EndpointType::Bulk, None, 64, 0).is_err());
    assert!(driver.alloc_endpoint_in(EndpointType::Isochronous, None, 64, 1).is_err());
    // 952 words of the FIFO memory, not 1024: 30, and 256 for each bulk endpoint of two packets.
    let OutBuffer(buffer) = Box::leak(Box::new(OutBuffer::new()));
    let (.., mut driver) = self::driver(buffer);
    let mut endpoint = |ep_type, bytes| driver.alloc_endpoint_in(ep_type, None, bytes, 1).is_ok();
    assert_eq!(
        [512; 4].map(|bytes| endpoint(EndpointType::Bulk, bytes)),
        [true, true, true, false]
    );
    let fits = [512, 64, 64].map(|bytes| endpoint(EndpointType::Interrupt, bytes));
    assert_eq!(fits, [true, true, false]);
    lab.assert_no_violation();
}

#[test]
fn packets_from_the_host_come_whole_and_once() {
    for (speed, packet) in [(Speed::High, 512), (Speed::Full, 64)] {
        let mut lab = Lab::new(speed);
        let mut into = [0; 512];
        for (length, toggle) in [(packet, 0), (1, 1), (0, 0), (packet - 1, 1), (3, 0)] {
            let sent = &bytes(&words(length))[..length];
            assert!(poll_once(lab.from_host.read(&mut into)).is_pending());
            assert!(matches!(lab.send(1, sent, toggle), Answer::Data(..)));
            assert_eq!(lab.send(1, sent, toggle ^ 1), Answer::Nak, "the packet has not been read");
            assert_eq!(poll_once(lab.from_host.read(&mut into)), Poll::Ready(Ok(length)));
            assert_eq!(&into[..length], sent);
            // Sent again, because the host has missed the acknowledgement.
            assert!(matches!(lab.send(1, sent, toggle), Answer::Data(..)));
        }
        // The endpoint is disabled with a transfer armed, and another configuration begins.
        for enabled in [false, true] {
            lab.bus.endpoint_set_enabled(EndpointAddress::from(FROM_HOST), enabled);
        }
        assert!(matches!(lab.send(1, &[7; 9], 0), Answer::Data(..)));
        assert_eq!(poll_once(lab.from_host.read(&mut into)), Poll::Ready(Ok(9)));
        lab.assert_no_violation();
    }
}

/// `GET_DESCRIPTOR`, `SET_ADDRESS` and a request with data from the host.
const READ: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 64, 0];
const NO_DATA: [u8; 8] = [0x00, 5, 7, 0, 0, 0, 0, 0];
const WRITE: [u8; 8] = [0x40, 1, 0, 0, 0, 0, 70, 0];

#[test]
fn the_control_endpoint_carries_requests_with_data_each_way_and_without() {
    let mut lab = Lab::new(Speed::High);
    for _ in 0..4 {
        // To the host, from memory that DMA need not reach.
        lab.request(READ);
        assert_eq!(lab.asked(), Some(READ));
        {
            let Lab { pipe, core, registers, state, .. } = &mut lab;
            let mut answer = pin!(pipe.data_in(&[1, 2, 3, 4, 5], true, true));
            assert!(poll_once(answer.as_mut()).is_pending());
            let fetched = core.borrow_mut().fetch(NEW, 0, true);
            assert!(matches!(&fetched, Answer::Data(bytes, _) if bytes == &[1, 2, 3, 4, 5]));
            assert!(matches!(core.borrow_mut().send(NEW, 0, &[], 1), Answer::Data(..)));
            while core.borrow_mut().interrupt() {
                testing::interrupt(*registers, state);
            }
            assert_eq!(poll_once(answer.as_mut()), Poll::Ready(Ok(())));
        }
        // Without data: the host asks for an empty packet, and the core takes none from the host.
        lab.request(NO_DATA);
        assert_eq!(lab.asked(), Some(NO_DATA));
        assert_eq!(lab.send(0, &[9; 8], 1), Answer::Nak);
        assert!(poll_once(lab.pipe.accept()).is_ready());
        assert!(matches!(lab.fetch(0), Answer::Data(bytes, _) if bytes.is_empty()));
        // From the host, two packets.
        lab.request(WRITE);
        assert_eq!(lab.asked(), Some(WRITE));
        let data = bytes(&words(72));
        for (part, last) in [(&data[..64], false), (&data[64..70], true)] {
            let mut into = [0; 64];
            assert!(poll_once(lab.pipe.data_out(&mut into, !last, last)).is_pending());
            assert!(matches!(lab.send(0, part, 1), Answer::Data(..)));
            let taken = poll_once(lab.pipe.data_out(&mut into, !last, last));
            assert_eq!(taken, Poll::Ready(Ok(part.len())));
            assert_eq!(&into[..part.len()], part);
        }
        assert!(poll_once(lab.pipe.accept()).is_ready());
        assert!(matches!(lab.fetch(0), Answer::Data(bytes, _) if bytes.is_empty()));
        // Refused, which ends with the next request.
        lab.request(READ);
        assert_eq!(lab.asked(), Some(READ));
        assert!(poll_once(lab.pipe.reject()).is_ready());
        assert_eq!(lab.fetch(0), Answer::Stall);
    }
    lab.assert_no_violation();
}

#[test]
fn a_request_comes_through_whatever_the_host_has_given_up() {
    let mut lab = Lab::new(Speed::High);
    // Two at once, of which the second counts: with a token after each, and with one after both.
    lab.core.borrow_mut().setup(NEW, READ);
    lab.request(NO_DATA);
    assert_eq!(lab.asked(), Some(NO_DATA));
    lab.core.borrow_mut().setup_alone(NEW, READ);
    lab.request(NO_DATA);
    assert_eq!(lab.asked(), Some(NO_DATA));
    // The host sends its next request before the status stage: first after it has fetched the data, then before.
    for fetches in [1, 0] {
        lab.request(READ);
        assert_eq!(lab.asked(), Some(READ));
        {
            let mut answer = pin!(lab.pipe.data_in(&[1; 64], true, true));
            assert!(poll_once(answer.as_mut()).is_pending());
            for _ in 0..fetches {
                assert!(matches!(lab.core.borrow_mut().fetch(NEW, 0, true), Answer::Data(..)));
            }
            assert!(matches!(lab.core.borrow_mut().setup(NEW, NO_DATA), Answer::Data(..)));
            while lab.core.borrow_mut().interrupt() {
                testing::interrupt(lab.registers, lab.state);
            }
            assert_eq!(poll_once(answer.as_mut()), Poll::Ready(Err(EndpointError::Disabled)));
        }
        assert_eq!(lab.asked(), Some(NO_DATA));
        assert!(poll_once(lab.pipe.accept()).is_ready());
        assert!(matches!(lab.fetch(0), Answer::Data(bytes, _) if bytes.is_empty()));
    }
    // The bus is reset within a request.
    lab.request(READ);
    lab.plug(Speed::High);
    lab.request(NO_DATA);
    assert_eq!(lab.asked(), Some(NO_DATA));
    lab.assert_no_violation();
}
