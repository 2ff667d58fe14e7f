//! Bitstreams on their way into the chip whose pieces are damaged, doubled, left out, mixed and wrongly numbered.

use super::fake_ecp5::{FakeEcp5, Illness};
use crate::ecp5::SlaveSpi;
use crate::gateware::{Loading, take};
use crate::staging::{StagingLoader, stored};
use crate::{BusError, GatewareLoader, Micros};
use core::cell::RefCell;
use nirspi_wire::message::GATEWARE_CHUNK_MAX;
use nirspi_wire::{GatewareChunk, Refusal, crc32};
use proptest::prelude::*;
use proptest::sample::Index;
use std::rc::Rc;
use std::vec;
use std::vec::Vec;

/// The longest bitstream that the firmware has memory for.
const ROOM: usize = 2_000;

/// A chip that the test looks at too.
#[derive(Clone)]
struct Chip(Rc<RefCell<FakeEcp5>>);

impl SlaveSpi for Chip {
    fn program(&mut self, low: bool) {
        self.0.borrow_mut().program(low);
    }

    fn done(&mut self) -> bool {
        self.0.borrow_mut().done()
    }

    fn select(&mut self, selected: bool) {
        self.0.borrow_mut().select(selected);
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        self.0.borrow_mut().write(bytes)
    }

    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError> {
        self.0.borrow_mut().read(into)
    }
}

/// What is wrong with a piece.
#[derive(Debug, Clone)]
enum Damage {
    None,
    Flip(Index, u8),
    Cut(Index),
    Longer(u8),
    LeftOut,
    Twice,
    Offset(u32),
    Total(u32),
    Crc(u32),
}

fn damage() -> impl Strategy<Value = Damage> {
    let near = || prop_oneof![0..4_000u32, any::<u32>()];
    prop_oneof![
        12 => Just(Damage::None),
        1 => (any::<Index>(), 1..=255u8).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        1 => any::<Index>().prop_map(Damage::Cut),
        1 => any::<u8>().prop_map(Damage::Longer),
        1 => Just(Damage::LeftOut),
        1 => Just(Damage::Twice),
        1 => near().prop_map(Damage::Offset),
        1 => near().prop_map(Damage::Total),
        1 => any::<u32>().prop_map(Damage::Crc),
    ]
}

/// A host, the firmware's part, and the chip.
struct Bench {
    chip: Chip,
    loading: Option<Loading>,
    loader: StagingLoader<'static, Chip>,
    now: Micros,
}

impl Bench {
    fn new(illness: Option<Illness>) -> Self {
        let chip = illness.map_or_else(FakeEcp5::default, FakeEcp5::ill);
        let chip = Chip(Rc::new(RefCell::new(chip)));
        let loader = StagingLoader::new(chip.clone(), vec![0; ROOM].leak(), None);
        Self { chip, loading: None, loader, now: Micros(0) }
    }

    /// The firmware takes this piece, and has time for all that follows.
    fn take(&mut self, chunk: &GatewareChunk<'_>) -> Result<u32, Refusal> {
        let before = self.chip.0.borrow().restarts;
        let taken = take(&mut self.loading, chunk, &mut self.loader);
        assert_eq!(self.chip.0.borrow().restarts, before, "the chip keeps its gateware meanwhile");
        let mut steps = 0;
        while self.loader.step(self.now) {
            self.now.0 += 1_000;
            self.chip.0.borrow_mut().pass(self.now);
            steps += 1;
            assert!(steps < 10_000, "ten seconds");
        }
        taken
    }
}

/// The piece of this bitstream from `at` on.
fn piece(bitstream: &[u8], at: usize, length: usize) -> GatewareChunk<'_> {
    let end = (at + length).min(bitstream.len());
    GatewareChunk {
        offset: at as u32,
        total: bitstream.len() as u32,
        crc: crc32(bitstream),
        data: &bitstream[at..end],
    }
}

fn bitstream() -> impl Strategy<Value = Vec<u8>> {
    let body = prop_oneof![4 => 1..600usize, 2 => 1..ROOM, 1 => ROOM..ROOM + 500];
    body.prop_flat_map(|length| prop::collection::vec(any::<u8>(), length))
}

proptest! {
    /// Whatever comes, the chip runs a whole bitstream or none; and a host that does what a refusal says gets its
    /// bitstream loaded afterwards.
    #[test]
    fn damaged_bitstreams_never_reach_the_chip_and_a_right_one_does(
        streams in [bitstream(), bitstream()],
        deliveries in prop::collection::vec(
            (prop::bool::weighted(0.2), prop_oneof![1 => 1..60usize, 3 => 60..=GATEWARE_CHUNK_MAX], damage()),
            0..40,
        ),
        illness in prop_oneof![
            6 => Just(None), 1 => Just(Some(Illness::BadCrc)), 1 => Just(Some(Illness::Stuck)),
            1 => Just(Some(Illness::Fails)), 1 => Just(Some(Illness::Unplugged)),
        ],
    ) {
        let mut bench = Bench::new(illness);
        let mut next = [0; 2];
        for (which, length, damage) in deliveries {
            let which = usize::from(which);
            let stream = &streams[which];
            let right = piece(stream, next[which], length);
            let mut data = right.data.to_vec();
            let mut chunk = GatewareChunk { data: &[], ..right };
            match damage {
                Damage::None | Damage::Twice => {}
                Damage::Flip(_, _) if data.is_empty() => {}
                Damage::Flip(at, bits) => data[at.index(right.data.len())] ^= bits,
                Damage::Cut(at) => data.truncate(at.index(right.data.len() + 1)),
                Damage::Longer(byte) => data.push(byte),
                Damage::LeftOut => {
                    next[which] += data.len();
                    continue;
                }
                Damage::Offset(offset) => chunk.offset = offset,
                Damage::Total(total) => chunk.total = total,
                Damage::Crc(crc) => chunk.crc = crc,
            }
            chunk.data = &data;
            let mut taken = bench.take(&chunk);
            if matches!(damage, Damage::Twice) && taken.is_ok() && chunk.offset > 0 {
                taken = bench.take(&chunk);
                prop_assert!(taken.is_err(), "a piece that comes twice is no further piece");
            }
            next[which] = match taken {
                Ok(end) => {
                    prop_assert_eq!(end, chunk.offset + data.len() as u32);
                    end as usize
                }
                Err(Refusal::GatewareOffset { expected }) => expected as usize,
                Err(_) => 0,
            }
            .min(stream.len());
            if next[which] == stream.len() {
                next[which] = 0;
            }
            let chip = bench.chip.0.borrow();
            let whole = chip.runs.is_none() || streams.iter().any(|s| chip.runs.as_ref() == Some(s));
            prop_assert!(whole, "the chip runs a bitstream that the host has not sent");
            let known = bench.loader.running();
            prop_assert!(known.is_none() || known == chip.runs.as_deref().map(crc32));
        }
        // A host that follows the refusals.
        let stream = &streams[0];
        let (mut at, mut rounds) = (0, 0);
        let end = loop {
            rounds += 1;
            prop_assert!(rounds < 3_000, "no end");
            match bench.take(&piece(stream, at, 60)) {
                Ok(end) if end as usize == stream.len() => break Ok(()),
                Ok(end) => at = end as usize,
                Err(Refusal::GatewareOffset { expected }) => at = expected as usize,
                Err(refusal) => break Err(refusal),
            }
        };
        prop_assert_eq!(end.is_ok(), stream.len() <= ROOM, "{:?}", end);
        let runs = bench.chip.0.borrow().runs.clone();
        let failure = bench.loader.take_failure();
        if end.is_ok() && illness.is_none() {
            prop_assert_eq!(runs.as_ref(), Some(stream));
            prop_assert_eq!(bench.loader.running(), Some(crc32(stream)));
            prop_assert_eq!(failure, None);
        } else if end.is_ok() {
            prop_assert_eq!((runs, bench.loader.running()), (None, None));
            prop_assert!(failure.is_some() && bench.loader.take_failure().is_none());
        }
    }

    #[test]
    fn a_bitstream_is_found_in_flash_memory_with_the_clocks_behind_it_and_nothing_else(
        head in prop_oneof![
            Just(vec![0xFF, 0x00]), Just(vec![0xFF, 0xFF, 0xBD, 0xB3]), prop::collection::vec(any::<u8>(), 0..5),
        ],
        body in prop::collection::vec(prop_oneof![any::<u8>(), Just(0xFF)], 0..300),
        erased in 0..100usize,
    ) {
        let region = [&head[..], &body, &vec![0xFF; erased]].concat();
        let begins = region.starts_with(&[0xFF, 0]) || region.starts_with(&[0xFF, 0xFF, 0xBD, 0xB3]);
        let last = region.iter().rposition(|&byte| byte != 0xFF);
        let expected = last.filter(|_| begins).map(|last| &region[..(last + 33).min(region.len())]);
        prop_assert_eq!(stored(&region), expected);
    }
}
