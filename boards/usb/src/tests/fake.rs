//! A simulated bus: control transfers and events go in, answers come out.

use core::future::pending;
use embassy_usb::driver::{
    Bus, ControlPipe, Driver, Endpoint, EndpointAddress, EndpointAllocError, EndpointError,
    EndpointIn, EndpointInfo, EndpointOut, EndpointType, Event, Unsupported,
};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

/// The traffic of the simulated bus.
#[derive(Clone, Default)]
pub struct Wire(Rc<RefCell<Traffic>>);

#[derive(Default)]
struct Traffic {
    events: VecDeque<Event>,
    requests: VecDeque<[u8; 8]>,
    answer: Vec<u8>,
    refused: bool,
}

impl Wire {
    pub fn happen(&self, event: Event) {
        self.0.borrow_mut().events.push_back(event);
    }

    pub fn ask(&self, request_type: u8, request: u8, value: u16, index: u16, length: u16) {
        let [v0, v1] = value.to_le_bytes();
        let [i0, i1] = index.to_le_bytes();
        let [l0, l1] = length.to_le_bytes();
        let mut traffic = self.0.borrow_mut();
        traffic.requests.push_back([request_type, request, v0, v1, i0, i1, l0, l1]);
        traffic.answer.clear();
        traffic.refused = false;
    }

    pub fn answer(&self) -> Option<Vec<u8>> {
        let traffic = self.0.borrow();
        (!traffic.refused).then(|| traffic.answer.clone())
    }
}

pub struct FakeDriver(pub Wire);

pub struct FakeEndpoint(EndpointInfo);

impl FakeDriver {
    fn endpoint(
        ep_type: EndpointType,
        addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<FakeEndpoint, EndpointAllocError> {
        let addr = addr.ok_or(EndpointAllocError)?;
        Ok(FakeEndpoint(EndpointInfo { addr, ep_type, max_packet_size, interval_ms }))
    }
}

impl Driver<'static> for FakeDriver {
    type EndpointOut = FakeEndpoint;
    type EndpointIn = FakeEndpoint;
    type ControlPipe = FakeControl;
    type Bus = FakeBus;

    fn alloc_endpoint_out(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<FakeEndpoint, EndpointAllocError> {
        Self::endpoint(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn alloc_endpoint_in(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<FakeEndpoint, EndpointAllocError> {
        Self::endpoint(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn start(self, control_max_packet_size: u16) -> (FakeBus, FakeControl) {
        let control = FakeControl { wire: self.0.clone(), packet: control_max_packet_size.into() };
        (FakeBus(self.0), control)
    }
}

impl Endpoint for FakeEndpoint {
    fn info(&self) -> &EndpointInfo {
        &self.0
    }

    async fn wait_enabled(&mut self) {
        pending::<()>().await;
    }
}

impl EndpointOut for FakeEndpoint {
    async fn read(&mut self, _buf: &mut [u8]) -> Result<usize, EndpointError> {
        pending().await
    }
}

impl EndpointIn for FakeEndpoint {
    async fn write(&mut self, _buf: &[u8]) -> Result<(), EndpointError> {
        pending().await
    }
}

pub struct FakeBus(Wire);

impl Bus for FakeBus {
    async fn enable(&mut self) {}

    async fn disable(&mut self) {}

    async fn poll(&mut self) -> Event {
        let next = self.0.0.borrow_mut().events.pop_front();
        match next {
            Some(event) => event,
            None => pending().await,
        }
    }

    fn endpoint_set_enabled(&mut self, _ep_addr: EndpointAddress, _enabled: bool) {}

    fn endpoint_set_stalled(&mut self, _ep_addr: EndpointAddress, _stalled: bool) {}

    fn endpoint_is_stalled(&mut self, _ep_addr: EndpointAddress) -> bool {
        false
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

impl crate::BusSpeed for FakeControl {
    fn is_full_speed(&self) -> bool {
        false
    }
}

pub struct FakeControl {
    wire: Wire,
    packet: usize,
}

impl ControlPipe for FakeControl {
    fn max_packet_size(&self) -> usize {
        self.packet
    }

    async fn setup(&mut self) -> [u8; 8] {
        let next = self.wire.0.borrow_mut().requests.pop_front();
        match next {
            Some(request) => request,
            None => pending().await,
        }
    }

    async fn data_out(
        &mut self,
        _buf: &mut [u8],
        _first: bool,
        _last: bool,
    ) -> Result<usize, EndpointError> {
        Ok(0)
    }

    async fn data_in(
        &mut self,
        data: &[u8],
        _first: bool,
        _last: bool,
    ) -> Result<(), EndpointError> {
        self.wire.0.borrow_mut().answer.extend(data);
        Ok(())
    }

    async fn accept(&mut self) {}

    async fn reject(&mut self) {
        self.wire.0.borrow_mut().refused = true;
    }

    async fn accept_set_address(&mut self, _addr: u8) {}
}
