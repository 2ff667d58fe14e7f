//! Tests that gateware arrives in order and whole, or not at all.

use super::support::*;
use nirspi_wire::{Answer, Command, GatewareChunk, Refusal, State, crc32, version};
use std::vec::Vec;

fn bitstream() -> Vec<u8> {
    (0..1000u32).map(|i| (i * 7) as u8).collect()
}

fn chunk(data: &[u8], offset: usize, length: usize) -> GatewareChunk<'_> {
    GatewareChunk {
        offset: offset as u32,
        total: data.len() as u32,
        crc: crc32(data),
        data: &data[offset..offset + length],
    }
}

#[test]
fn pieces_in_order_make_a_bitstream() {
    let data = bitstream();
    let mut bench = Bench::configured();
    for offset in (0..1000).step_by(250) {
        let next_offset = offset as u32 + 250;
        let answer = bench.ask(Command::LoadGateware(chunk(&data, offset, 250)));
        assert_eq!(answer, Ok(Answer::Gateware { next_offset }));
    }
    assert_eq!((bench.loader.data, bench.loader.finished), (data, 1));
    assert_eq!(bench.camera.state(), State::Idle, "the FPGA has forgotten its settings");
}

#[test]
fn a_piece_out_of_order_is_refused_and_the_right_one_still_taken() {
    let data = bitstream();
    let mut bench = Bench::open();
    let load = |bench: &mut Bench, chunk| bench.ask(Command::LoadGateware(chunk));
    assert_eq!(
        load(&mut bench, chunk(&data, 250, 250)),
        Err(Refusal::GatewareOffset { expected: 0 })
    );
    load(&mut bench, chunk(&data, 0, 500)).unwrap();
    let expected = Err(Refusal::GatewareOffset { expected: 500 });
    assert_eq!(load(&mut bench, chunk(&data, 750, 250)), expected);
    let too_long = GatewareChunk { data: &data[..501], ..chunk(&data, 500, 500) };
    assert_eq!(load(&mut bench, too_long), expected);
    let far = GatewareChunk { offset: u32::MAX, ..chunk(&data, 500, 500) };
    assert_eq!(load(&mut bench, far), expected);
    load(&mut bench, chunk(&data, 500, 500)).unwrap();
    assert_eq!(bench.loader.data, data);
}

#[test]
fn a_piece_of_another_bitstream_does_not_continue_this_one() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    let other = GatewareChunk { crc: 5, ..chunk(&data, 500, 500) };
    assert_eq!(
        bench.ask(Command::LoadGateware(other)),
        Err(Refusal::GatewareOffset { expected: 0 })
    );
}

#[test]
fn a_wrong_checksum_is_found_at_the_end_and_nothing_is_finished() {
    let data = bitstream();
    let mut bench = Bench::open();
    let wrong = |chunk| GatewareChunk { crc: 1, ..chunk };
    bench.ask(Command::LoadGateware(wrong(chunk(&data, 0, 999)))).unwrap();
    let end = bench.ask(Command::LoadGateware(wrong(chunk(&data, 999, 1))));
    assert_eq!(end, Err(Refusal::GatewareCrc));
    assert_eq!(bench.loader.finished, 0);
    let again = bench.ask(Command::LoadGateware(chunk(&data, 0, 1000)));
    assert_eq!(again, Ok(Answer::Gateware { next_offset: 1000 }));
    assert_eq!((bench.loader.data, bench.loader.finished), (data, 1));
}

#[test]
fn a_board_that_cannot_says_so() {
    let data = bitstream();
    let mut bench = Bench::configured();
    bench.loader.unsupported = true;
    let refused = bench.ask(Command::LoadGateware(chunk(&data, 0, 500)));
    assert_eq!(refused, Err(Refusal::Unsupported));
    assert_eq!(bench.camera.state(), State::Configured);
}

#[test]
fn an_fpga_that_is_away_while_it_loads_is_no_fault() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    bench.fpga.identity = 0;
    bench.after(1_000_000);
    assert_eq!(bench.camera.state(), State::Idle);
    bench.fpga.reset();
    bench.ask(Command::LoadGateware(chunk(&data, 500, 500))).unwrap();
    bench.fpga.identity = 0;
    bench.after(1_000_000);
    assert_eq!(bench.camera.state(), State::Fault, "checks are back");
}

#[test]
fn an_absent_fpga_can_be_given_its_gateware() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.fpga.identity = 0;
    bench.after(100_000);
    assert_eq!(bench.camera.state(), State::Fault);
    bench.ask(Command::LoadGateware(chunk(&data, 0, 1000))).unwrap();
    bench.fpga.reset();
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
}

#[test]
fn a_bitstream_goes_on_where_a_lost_link_stopped_it() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    bench.close_link();
    bench.ask(Command::Hello { protocol: version::CURRENT }).unwrap();
    // A piece that cannot be the next one asks for the next one.
    let question = bench.ask(Command::LoadGateware(chunk(&data, 1000, 0)));
    assert_eq!(question, Err(Refusal::GatewareOffset { expected: 500 }));
    let end = bench.ask(Command::LoadGateware(chunk(&data, 500, 500)));
    assert_eq!(end, Ok(Answer::Gateware { next_offset: 1000 }));
    assert_eq!((bench.loader.data, bench.loader.finished), (data, 1));
}

#[test]
fn with_no_host_the_fpga_is_checked_in_the_middle_of_a_bitstream_too() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    bench.close_link();
    bench.fpga.identity = 0;
    bench.after(1_000_000);
    assert_eq!(bench.camera.state(), State::Fault);
}

#[test]
fn a_configuration_gives_up_a_bitstream_half_way() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    let rest = bench.ask(Command::LoadGateware(chunk(&data, 500, 500)));
    assert_eq!(rest, Err(Refusal::GatewareOffset { expected: 0 }));
}

#[test]
fn the_same_bitstream_is_loaded_again_where_the_fpga_does_not_answer() {
    let data = bitstream();
    let mut bench = Bench::open();
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    assert_eq!(bench.loader.forgotten, 0);
    bench.fpga.identity = 0;
    bench.ask(Command::LoadGateware(chunk(&data, 500, 500))).unwrap();
    assert_eq!(bench.loader.forgotten, 0, "it may be half loaded");
    bench.ask(Command::LoadGateware(chunk(&data, 0, 500))).unwrap();
    assert_eq!(bench.loader.forgotten, 1);
}
