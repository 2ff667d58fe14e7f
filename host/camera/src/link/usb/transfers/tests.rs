//! A simulated bus: an endpoint whose transfers end as a script says.

use super::*;

/// How a transfer of the script ends.
#[derive(Debug, Clone)]
enum Ends {
    /// With these bytes.
    With(Vec<u8>),
    /// With these bytes, then this.
    Badly(Vec<u8>, TransferProblem),
    /// The transfer is not complete at the first wait, then has these bytes.
    Late(Vec<u8>),
}

/// Plays the script in order, one step a transfer. After the script, no transfer completes.
#[derive(Default)]
struct Script {
    steps: VecDeque<Ends>,
    /// Submitted buffers, by number. [`Script::buffers`] gives the numbers.
    queued: VecDeque<Buffer>,
    cancelled: bool,
    halts_cleared: u32,
    most_queued: usize,
}

struct Buffer {
    number: usize,
    bytes: Vec<u8>,
}

impl Deref for Buffer {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.bytes
    }
}

fn buffers(count: usize) -> impl Iterator<Item = Buffer> {
    (0..count).map(|number| Buffer { number, bytes: Vec::new() })
}

impl Endpoint for Script {
    type Buffer = Buffer;

    fn submit(&mut self, buffer: Buffer) {
        assert!(self.queued.iter().all(|queued| queued.number != buffer.number), "submitted twice");
        self.queued.push_back(buffer);
        self.most_queued = self.most_queued.max(self.queued.len());
    }

    fn pending(&self) -> usize {
        self.queued.len()
    }

    fn complete(&mut self, _: Duration) -> Option<(Buffer, Result<(), TransferProblem>)> {
        assert!(!self.queued.is_empty(), "waits for a transfer that nobody submitted");
        let (bytes, outcome) = match self.steps.pop_front() {
            Some(Ends::With(bytes)) => (bytes, Ok(())),
            Some(Ends::Badly(bytes, problem)) => (bytes, Err(problem)),
            Some(Ends::Late(bytes)) => {
                self.steps.push_front(Ends::With(bytes));
                return None;
            }
            None if self.cancelled => (Vec::new(), Err(TransferProblem::Cancelled)),
            None => return None,
        };
        let buffer = self.queued.pop_front().unwrap();
        Some((Buffer { bytes, ..buffer }, outcome))
    }

    fn cancel_all(&mut self) {
        self.cancelled = true;
    }

    fn clear_halt(&mut self) -> io::Result<()> {
        assert!(self.queued.is_empty(), "cleared with transfers pending");
        self.cancelled = false;
        self.halts_cleared += 1;
        Ok(())
    }
}

fn stream(steps: Vec<Ends>) -> InStream<Script> {
    let script = Script { steps: steps.into(), ..Script::default() };
    InStream::new(script, buffers(TRANSFERS))
}

/// All bytes of the stream, read in pieces of at most `piece` bytes, and the result after the last
/// byte.
fn drain(stream: &mut InStream<Script>, piece: usize) -> (Vec<u8>, io::Result<Received>) {
    let mut all = Vec::new();
    let mut into = vec![0; piece];
    loop {
        match stream.receive(&mut into, Duration::ZERO) {
            Ok(Received::Bytes(length)) => {
                assert!(length > 0);
                all.extend_from_slice(&into[..length]);
            }
            other => return (all, other),
        }
    }
}

/// `count` distinct bytes from `first` on.
fn bytes(first: u8, count: u8) -> Vec<u8> {
    (first..first + count).collect()
}

#[test]
fn bytes_come_in_order_whatever_the_sizes_of_transfers_and_pieces() {
    let transfers = [(0, 7), (7, 1), (8, 30), (38, 2)];
    for piece in [1, 3, 100] {
        let steps = transfers.map(|(first, count)| Ends::With(bytes(first, count)));
        let mut stream = stream(steps.to_vec());
        let (all, end) = drain(&mut stream, piece);
        assert_eq!(all, bytes(0, 40), "pieces of {piece}");
        assert_eq!(end.unwrap(), Received::Nothing);
    }
}

#[test]
fn every_buffer_goes_back_to_the_queue() {
    let steps = (0..100).map(|n| Ends::With(vec![n])).collect();
    let mut stream = stream(steps);
    let (all, _) = drain(&mut stream, 64);
    assert_eq!(all, bytes(0, 100));
    assert_eq!(stream.endpoint.pending(), TRANSFERS);
    assert_eq!(stream.endpoint.most_queued, TRANSFERS);
}

#[test]
fn an_empty_packet_is_no_end_and_no_bytes() {
    let mut stream = stream(vec![
        Ends::With(vec![]),
        Ends::With(vec![1]),
        Ends::With(vec![]),
        Ends::With(vec![2]),
    ]);
    assert_eq!(drain(&mut stream, 8).0, [1, 2]);
    assert_eq!(stream.endpoint.pending(), TRANSFERS);
}

#[test]
fn nothing_yet_is_said_and_what_comes_later_is_not_lost() {
    let mut stream = stream(vec![Ends::With(vec![1]), Ends::Late(vec![2])]);
    let (all, end) = drain(&mut stream, 8);
    assert_eq!((all, end.unwrap()), (vec![1], Received::Nothing));
    assert_eq!(drain(&mut stream, 8).0, [2]);
}

#[test]
fn a_device_that_goes_in_the_middle_of_a_transfer_leaves_what_it_sent_then_closed() {
    let mut stream = stream(vec![
        Ends::With(bytes(0, 5)),
        Ends::Badly(bytes(5, 3), TransferProblem::Gone),
        Ends::Badly(vec![], TransferProblem::Gone),
    ]);
    let (all, end) = drain(&mut stream, 4);
    assert_eq!((all, end.unwrap()), (bytes(0, 8), Received::Closed));
    // The stream stays closed.
    assert_eq!(drain(&mut stream, 4).1.unwrap(), Received::Closed);
}

#[test]
fn a_stall_is_cleared_and_the_stream_goes_on_where_it_was() {
    let mut stream = stream(vec![
        Ends::With(bytes(0, 4)),
        Ends::Badly(vec![], TransferProblem::Stalled),
        // The transfer was already on its way when the endpoint halted.
        Ends::With(bytes(4, 4)),
    ]);
    let (all, end) = drain(&mut stream, 64);
    assert_eq!((all, end.unwrap()), (bytes(0, 8), Received::Nothing));
    assert_eq!(stream.endpoint.halts_cleared, 1);
    stream.endpoint.steps.push_back(Ends::With(bytes(8, 4)));
    assert_eq!(drain(&mut stream, 64).0, bytes(8, 4));
    assert_eq!(stream.endpoint.pending(), TRANSFERS);
}

#[test]
fn a_stall_in_the_middle_of_a_transfer_keeps_its_bytes() {
    let mut stream =
        stream(vec![Ends::Badly(bytes(0, 4), TransferProblem::Stalled), Ends::With(bytes(4, 4))]);
    assert_eq!(drain(&mut stream, 3).0, bytes(0, 8));
    assert_eq!((stream.endpoint.halts_cleared, stream.endpoint.pending()), (1, TRANSFERS));
}

#[test]
fn an_endpoint_that_keeps_stalling_is_an_error() {
    let stall = Ends::Badly(vec![], TransferProblem::Stalled);
    let script = Script { steps: vec![stall; 64].into(), ..Script::default() };
    // With a single transfer, each stall is a separate stall.
    let mut stream = InStream::new(script, buffers(1));
    let (all, end) = drain(&mut stream, 64);
    assert!(all.is_empty());
    assert!(end.unwrap_err().to_string().contains("stalling"));
}

#[test]
fn a_broken_transfer_is_an_error_after_its_bytes() {
    let broken = TransferProblem::Other("hardware fault".to_owned());
    let mut stream = stream(vec![Ends::Badly(vec![1, 2], broken)]);
    let (all, end) = drain(&mut stream, 64);
    assert_eq!(all, [1, 2]);
    assert!(end.unwrap_err().to_string().contains("hardware fault"));
}

#[test]
fn a_command_that_is_not_taken_times_out_and_leaves_nothing_queued() {
    let mut endpoint = Script::default();
    let buffer = Buffer { number: 0, bytes: vec![1, 2, 3] };
    let error = send(&mut endpoint, buffer).unwrap_err();
    assert_eq!((error.kind(), endpoint.pending()), (io::ErrorKind::TimedOut, 0));
}

#[test]
fn a_command_to_a_camera_that_has_gone_is_a_broken_pipe() {
    let gone = Ends::Badly(vec![], TransferProblem::Gone);
    let mut endpoint = Script { steps: vec![gone].into(), ..Script::default() };
    let error = send(&mut endpoint, Buffer { number: 0, bytes: vec![1] }).unwrap_err();
    assert_eq!(error.kind(), io::ErrorKind::BrokenPipe);
}
