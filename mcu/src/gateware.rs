//! Receives a bitstream from the host, piece by piece.
//!
//! # Invariant
//! The loader's `finish` is called only when every byte has come in order
//! (`tests::loading::pieces_in_order_make_a_bitstream`,
//! `tests::loading::a_piece_out_of_order_is_refused_and_the_right_one_still_taken`) and the
//! checksum over all bytes is right
//! (`tests::loading::a_wrong_checksum_is_found_at_the_end_and_nothing_is_finished`). The pieces
//! outlive their session: a host that comes back goes on with the next one
//! (`tests::loading::a_bitstream_goes_on_where_a_lost_link_stopped_it`).

use crate::{GatewareLoader, LoadError};
use nirspi_wire::{Crc32, GatewareChunk, Refusal};

/// A bitstream whose first bytes have come.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Loading {
    total: u32,
    crc: u32,
    next_offset: u32,
    received: Crc32,
}

#[cfg(test)]
impl Loading {
    /// What the pieces that follow depend on.
    pub const fn key(&self) -> (u32, u32, u32) {
        (self.total, self.crc, self.next_offset)
    }
}

/// Takes a piece and returns the offset of the next piece. A piece at offset 0 starts a new
/// bitstream. A refused piece changes nothing; a loader's error or a wrong checksum discards the
/// bitstream.
pub(crate) fn take(
    loading: &mut Option<Loading>,
    chunk: &GatewareChunk<'_>,
    loader: &mut impl GatewareLoader,
) -> Result<u32, Refusal> {
    let expected = match loading {
        Some(Loading { total, crc, next_offset, .. })
            if (*total, *crc) == (chunk.total, chunk.crc) =>
        {
            *next_offset
        }
        _ => 0,
    };
    let end = u32::try_from(chunk.data.len()).ok().and_then(|n| chunk.offset.checked_add(n));
    let end = match end {
        Some(end) if end <= chunk.total && (chunk.offset == 0 || chunk.offset == expected) => end,
        _ => return Err(Refusal::GatewareOffset { expected }),
    };
    let progress = step(loading, chunk, end, loader);
    if progress.is_err() || end == chunk.total {
        *loading = None;
    }
    progress.map(|()| end)
}

fn step(
    loading: &mut Option<Loading>,
    chunk: &GatewareChunk<'_>,
    end: u32,
    loader: &mut impl GatewareLoader,
) -> Result<(), Refusal> {
    if chunk.offset == 0 {
        loader.begin(chunk.total).map_err(refusal)?;
        let &GatewareChunk { total, crc, .. } = chunk;
        *loading = Some(Loading { total, crc, next_offset: 0, received: Crc32::new() });
    }
    let Some(loading) = loading else {
        return Err(Refusal::GatewareOffset { expected: 0 });
    };
    loader.write(chunk.data).map_err(refusal)?;
    loading.received.update(chunk.data);
    loading.next_offset = end;
    if end < chunk.total {
        return Ok(());
    }
    if loading.received.value() != chunk.crc {
        return Err(Refusal::GatewareCrc);
    }
    loader.finish().map_err(refusal)
}

fn refusal(error: LoadError) -> Refusal {
    match error {
        LoadError::Unsupported => Refusal::Unsupported,
        LoadError::Device => Refusal::Bus,
    }
}
