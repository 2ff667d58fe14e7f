//! Tests of the configuration of an ECP5: the order of commands, and the error for a chip that
//! refuses the bitstream.

use super::fake_ecp5::{FakeEcp5, Illness};
use crate::ecp5::{Configuration, ConfigureError, IDCODE_LFE5UM5G_85F, PIECE_BYTES, must_load};
use crate::staging::StagingLoader;
use crate::{BusError, GatewareLoader, LoadError, Micros};
use nirspi_wire::crc32;
use std::vec;
use std::vec::Vec;

fn bitstream(length: usize) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0x00, b'x', 0x00, 0xFF, 0xFF, 0xFF, 0xBD, 0xB3];
    bytes.extend((bytes.len()..length).map(|i| (i * 31) as u8));
    bytes
}

/// Configures the chip with a poll every 100 us. The longest allowed configuration is far shorter
/// than a second for each command.
fn configure(chip: &mut FakeEcp5, bitstream: &[u8]) -> Result<(), ConfigureError> {
    configure_with(chip, bitstream, 100)
}

/// Configures the chip with a poll after each of so many microseconds.
fn configure_with(
    chip: &mut FakeEcp5,
    bitstream: &[u8],
    step_us: usize,
) -> Result<(), ConfigureError> {
    let mut configuration = Configuration::new(IDCODE_LFE5UM5G_85F);
    for now in (0..10_000_000).step_by(step_us) {
        chip.pass(Micros(now));
        if let Some(result) = configuration.poll(Micros(now), chip, bitstream) {
            assert_eq!(
                configuration.poll(Micros(now), chip, bitstream),
                Some(result),
                "it is over"
            );
            return result;
        }
    }
    panic!("no end");
}

#[test]
fn a_bitstream_is_taken_whole_and_started() {
    for length in [PIECE_BYTES - 1, PIECE_BYTES, PIECE_BYTES + 1, 5 * PIECE_BYTES] {
        let mut chip = FakeEcp5::default();
        assert_eq!(configure(&mut chip, &bitstream(length)), Ok(()));
        assert_eq!(chip.runs, Some(bitstream(length)));
    }
}

#[test]
fn a_chip_that_runs_something_else_is_cleared_first() {
    let mut chip = FakeEcp5::running(&[1, 2, 3]);
    assert_eq!(configure(&mut chip, &bitstream(2_000)), Ok(()));
    assert_eq!(chip.runs, Some(bitstream(2_000)));
}

#[test]
fn another_chip_or_none_is_left_to_its_own_configuration() {
    for found in [0, u32::MAX, 0x4111_3043] {
        let mut chip = FakeEcp5::with_idcode(found);
        let result = configure(&mut chip, &bitstream(100));
        assert_eq!(result, Err(ConfigureError::WrongDevice { found }));
        assert_eq!((chip.restarts, chip.commands), (2, vec![0xE0]), "nothing was written");
    }
}

#[test]
fn a_chip_that_stays_busy_is_given_up_and_restarted() {
    // The second is not over at a poll, and the next one comes long after it.
    for step_us in [100, 70_001, 300_000] {
        let mut chip = FakeEcp5::ill(Illness::Stuck);
        let result = configure_with(&mut chip, &bitstream(100), step_us);
        assert_eq!((result, chip.restarts), (Err(ConfigureError::Stuck), 2), "{step_us} us");
    }
}

/// Neither a chip that names no error and is not done, nor one that is done and names an error.
#[test]
fn a_chip_runs_a_bitstream_only_if_it_is_done_and_names_no_error() {
    let done = 1 << 8;
    assert_eq!(configure(&mut FakeEcp5::ill(Illness::Ends(done)), &bitstream(100)), Ok(()));
    let errors = [1 << 13, 1 << 23, 1 << 24, 1 << 25];
    for status in [0].into_iter().chain(errors.map(|error| done | error)) {
        let result = configure(&mut FakeEcp5::ill(Illness::Ends(status)), &bitstream(100));
        assert_eq!(result, Err(ConfigureError::Refused { status }), "{status:#x}");
    }
}

#[test]
fn a_bitstream_that_the_chip_refuses_is_an_error_with_its_status() {
    for (illness, bit) in [(Illness::BadCrc, 23), (Illness::Fails, 13)] {
        let mut chip = FakeEcp5::ill(illness);
        let result = configure(&mut chip, &bitstream(100));
        let Err(ConfigureError::Refused { status }) = result else { panic!("{result:?}") };
        assert_ne!(status & 1 << bit, 0);
        assert_eq!((chip.runs, chip.restarts), (None, 2));
    }
}

#[test]
fn a_transfer_that_fails_ends_it() {
    let mut chip = FakeEcp5::ill(Illness::Unplugged);
    let failed = Err(ConfigureError::Bus(BusError::Transfer));
    assert_eq!(configure(&mut chip, &bitstream(100)), failed);
}

#[test]
fn only_a_chip_that_is_well_and_known_to_run_it_is_left_alone() {
    assert!(!must_load(true, Some(7), 7));
    assert!(must_load(true, Some(8), 7), "another one runs");
    assert!(must_load(false, Some(7), 7), "it has lost its configuration");
    assert!(must_load(true, None, 7), "nobody knows what runs");
}

/// Loads the bitstream, and returns for how many polls the FPGA was busy.
fn load(loader: &mut StagingLoader<'_, FakeEcp5>, bitstream: &[u8]) -> usize {
    loader.begin(bitstream.len() as u32).unwrap();
    bitstream.chunks(300).for_each(|piece| loader.write(piece).unwrap());
    loader.finish().unwrap();
    (0u64..100_000).take_while(|step| loader.step(Micros(step * 1_000))).count()
}

#[test]
fn a_staged_bitstream_goes_to_the_chip_once() {
    let mut memory = vec![0; 4_000];
    let mut loader = StagingLoader::new(FakeEcp5::default(), &mut memory, None);
    assert!(!loader.step(Micros(0)), "nothing to do");
    assert!(load(&mut loader, &bitstream(3_000)) > 0);
    assert_eq!(loader.running(), Some(crc32(&bitstream(3_000))));
    assert_eq!(load(&mut loader, &bitstream(3_000)), 0, "it runs already");
    assert!(load(&mut loader, &bitstream(2_999)) > 0);
    assert_eq!(loader.running(), Some(crc32(&bitstream(2_999))));
}

#[test]
fn what_an_fpga_that_does_not_answer_runs_is_not_known() {
    let mut memory = vec![0; 4_000];
    let mut loader = StagingLoader::new(FakeEcp5::default(), &mut memory, None);
    load(&mut loader, &bitstream(3_000));
    loader.forget();
    assert!(load(&mut loader, &bitstream(3_000)) > 0, "loaded again");
}

#[test]
fn a_half_sent_bitstream_does_not_reach_the_chip() {
    let mut memory = vec![0; 4_000];
    let mut loader = StagingLoader::new(FakeEcp5::default(), &mut memory, Some(5));
    loader.begin(3_000).unwrap();
    loader.write(&bitstream(1_000)).unwrap();
    assert!(!loader.step(Micros(0)));
    assert_eq!(loader.running(), Some(5));
}

#[test]
fn a_bitstream_longer_than_the_memory_is_not_supported() {
    let mut memory = vec![0; 1_000];
    let mut loader = StagingLoader::new(FakeEcp5::default(), &mut memory, None);
    assert_eq!(loader.begin(1_001), Err(LoadError::Unsupported));
    assert_eq!(loader.begin(1_000), Ok(()));
    loader.write(&[0; 1_000]).unwrap();
    assert_eq!(loader.write(&[0]), Err(LoadError::Unsupported));
}

#[test]
fn a_failure_is_told_once_and_nothing_is_known_to_run() {
    let chip = FakeEcp5::ill(Illness::BadCrc);
    let mut memory = vec![0; 4_000];
    let mut loader = StagingLoader::new(chip, &mut memory, Some(5));
    load(&mut loader, &bitstream(3_000));
    assert_eq!(loader.running(), None);
    assert!(matches!(loader.take_failure(), Some(ConfigureError::Refused { .. })));
    assert_eq!(loader.take_failure(), None);
}
