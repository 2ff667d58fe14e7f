//! Writes to the disk on a thread of its own, so that a slow disk delays no frame.
//!
//! What is written goes through a queue of limited length. While the disk is slow, the queue fills
//! up; when the queue is full, the writer waits for the disk.
//!
//! # Invariant
//! The queue holds at most [`QUEUE`] buffers of [`BUFFER`] bytes, besides the one being filled and
//! the one being written (`tests::a_disk_that_stands_still_stops_the_writer_when_the_queue_is_full`).
//! Bytes reach the disk once and in order, or the writer learns why not
//! (`tests::an_error_of_the_disk_reaches_the_writer`), in every order of the two threads (`tests/loom`, which checks this
//! file).

use super::sync::{Arc, Condvar, JoinHandle, Mutex, MutexGuard, ThreadBuilder};
use std::collections::VecDeque;
use std::io::{self, Write};
use std::mem;
use std::sync::PoisonError;

/// Bytes of a buffer.
const BUFFER: usize = 1 << 20;
/// Buffers that wait for the disk at most: 16 s of frames at 4 MB/s.
pub(super) const QUEUE: usize = 64;
/// Empty buffers that are kept for later. A queue that was long gives its memory back.
const KEPT: usize = 2;

/// What both ends of the queue know.
#[derive(Debug, Default)]
struct Inner {
    /// Buffers that wait for the disk.
    queue: VecDeque<Vec<u8>>,
    /// Whether a buffer is being written.
    writing: bool,
    /// Empty buffers, for the next bytes.
    empty: Vec<Vec<u8>>,
    /// Whether nothing more comes.
    closed: bool,
    /// Why the disk takes no more.
    problem: Option<io::Error>,
    /// Whether the disk takes no more.
    ended: bool,
}

impl Inner {
    /// Buffers that are not on the disk.
    fn waiting(&self) -> usize {
        self.queue.len() + usize::from(self.writing)
    }

    /// Why the disk takes no more. The system tells a reason once, and so does this function.
    fn problem(&mut self) -> io::Error {
        let gone = || io::Error::other("the recording takes no more after an earlier error");
        self.problem.take().unwrap_or_else(gone)
    }
}

#[derive(Debug)]
struct Shared {
    inner: Mutex<Inner>,
    changed: Condvar,
    /// Most buffers in the queue.
    most: usize,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Inner)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    fn wait_while(&self, waits: impl FnMut(&mut Inner) -> bool) -> MutexGuard<'_, Inner> {
        self.changed.wait_while(self.lock(), waits).unwrap_or_else(PoisonError::into_inner)
    }

    /// The next buffer for the disk. `None`: nothing more comes.
    fn next(&self) -> Option<Vec<u8>> {
        let mut inner = self.wait_while(|inner| inner.queue.is_empty() && !inner.closed);
        let next = inner.queue.pop_front();
        inner.writing = next.is_some();
        drop(inner);
        self.changed.notify_all();
        next
    }
}

/// The end of the queue that is written to. Dropping the spool hands over its last bytes.
#[derive(Debug)]
pub(super) struct Spool {
    filling: Vec<u8>,
    shared: Arc<Shared>,
}

/// The thread at the other end. Dropping the disk waits for the thread, which ends after its spool.
#[derive(Debug)]
pub(super) struct Disk {
    thread: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
}

/// A spool in front of this file, and the disk behind it.
///
/// # Errors
/// If the system starts no thread.
pub(super) fn start(to: impl Write + Send + 'static) -> io::Result<(Spool, Disk)> {
    start_with(to, QUEUE)
}

/// As [`start`], with at most so many buffers in the queue.
pub(super) fn start_with(
    to: impl Write + Send + 'static,
    most: usize,
) -> io::Result<(Spool, Disk)> {
    let (inner, changed) = (Mutex::default(), Condvar::default());
    let shared = Arc::new(Shared { inner, changed, most });
    let thread = {
        let shared = Arc::clone(&shared);
        let work = move || write(to, &shared);
        ThreadBuilder::new().name("recording".to_owned()).spawn(work)?
    };
    let spool = Spool { filling: Vec::new(), shared: Arc::clone(&shared) };
    Ok((spool, Disk { thread: Some(thread), shared }))
}

/// Ends the queue where the thread panics, so that nothing waits for that thread.
struct EndOfPanic<'s>(&'s Shared);

impl Drop for EndOfPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.change(|inner| inner.ended = true);
        }
    }
}

/// Writes the buffers of the queue until the spool is dropped or the disk fails.
fn write(mut to: impl Write, shared: &Shared) {
    let _end = EndOfPanic(shared);
    while let Some(mut buffer) = shared.next() {
        if let Err(error) = to.write_all(&buffer).and_then(|()| to.flush()) {
            shared.change(|inner| (inner.problem, inner.ended) = (Some(error), true));
            return;
        }
        buffer.clear();
        shared.change(|inner| {
            inner.writing = false;
            if inner.empty.len() < KEPT {
                inner.empty.push(buffer);
            }
        });
    }
}

impl Spool {
    /// Hands the bytes over. Waits while the queue is full.
    fn hand_over(&mut self) -> io::Result<()> {
        let most = if self.filling.is_empty() { usize::MAX } else { self.shared.most };
        let waits = |inner: &mut Inner| inner.queue.len() >= most && !inner.ended;
        let mut inner = self.shared.wait_while(waits);
        if inner.ended {
            return Err(inner.problem());
        }
        if !self.filling.is_empty() {
            let empty = inner.empty.pop().unwrap_or_default();
            inner.queue.push_back(mem::replace(&mut self.filling, empty));
            drop(inner);
            self.shared.changed.notify_all();
        }
        Ok(())
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.filling.len() >= BUFFER {
            self.hand_over()?;
        }
        let taken = bytes.len().min(BUFFER - self.filling.len());
        self.filling.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    /// Hands the bytes over to the queue, and does not wait for the disk.
    fn flush(&mut self) -> io::Result<()> {
        self.hand_over()
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        // A drop cannot return an error. A writer that wants to know flushes first.
        let _ = self.hand_over();
        self.shared.change(|inner| inner.closed = true);
    }
}

impl Disk {
    /// Share of the queue that waits for the disk, 0 to 1.
    pub(super) fn queued(&self) -> f64 {
        (self.shared.lock().waiting() as f64 / self.shared.most as f64).min(1.0)
    }

    /// Waits until the disk has taken everything that was handed over.
    ///
    /// # Errors
    /// Why the disk takes no more.
    pub(super) fn settle(&self) -> io::Result<()> {
        let mut inner = self.shared.wait_while(|inner| inner.waiting() > 0 && !inner.ended);
        if inner.ended { Err(inner.problem()) } else { Ok(()) }
    }

    /// Waits until everything is written. The spool must be dropped before.
    ///
    /// # Errors
    /// Why the disk took no more.
    pub(super) fn end(mut self) -> io::Result<()> {
        self.join()?;
        let mut inner = self.shared.lock();
        if inner.ended { Err(inner.problem()) } else { Ok(()) }
    }

    fn join(&mut self) -> io::Result<()> {
        let joined = self.thread.take().map_or(Ok(()), JoinHandle::join);
        joined.map_err(|_| io::Error::other("writing the recording panicked"))
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // A panic of the thread was printed already.
        let _ = self.join();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::{self, Receiver};
    use std::time::Duration;

    /// A disk that takes a buffer for each permission, and fails without room.
    struct Slow {
        permissions: Receiver<()>,
        room: usize,
        taken: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.permissions.recv();
            let mut taken = self.taken.lock().unwrap();
            if taken.len() + bytes.len() > self.room {
                return Err(io::ErrorKind::StorageFull.into());
            }
            taken.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    type Lab = (Spool, Disk, mpsc::Sender<()>, Arc<Mutex<Vec<u8>>>);

    fn slow(room: usize, most: usize) -> Lab {
        let (allow, permissions) = mpsc::channel();
        let taken = Arc::<Mutex<Vec<u8>>>::default();
        let slow = Slow { permissions, room, taken: Arc::clone(&taken) };
        let (spool, disk) = start_with(slow, most).unwrap();
        (spool, disk, allow, taken)
    }

    #[test]
    fn a_disk_that_stands_still_stops_the_writer_when_the_queue_is_full() {
        const MOST: usize = 3;
        const PIECE: usize = BUFFER / 4;
        let (mut spool, disk, allow, taken) = slow(usize::MAX, MOST);
        let bytes: Vec<u8> = (0..12 * BUFFER).map(|at| (at * 7 % 251) as u8).collect();
        let accepted = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for piece in bytes.chunks(PIECE) {
                    spool.write_all(piece).unwrap();
                    accepted.fetch_add(PIECE, Ordering::Relaxed);
                }
                drop(spool);
            });
            // The writer goes on until nothing changes any more.
            let mut before = usize::MAX;
            while accepted.load(Ordering::Relaxed) != before {
                before = accepted.load(Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(300));
            }
            // Besides the queue, one buffer is being filled and one is being written.
            let most = (MOST + 2) * BUFFER;
            assert!((MOST * BUFFER..=most).contains(&before), "{before} bytes, at most {most}");
            assert_eq!(disk.queued(), 1.0);
            drop(allow);
            writer.join().unwrap();
        });
        disk.end().unwrap();
        assert!(*taken.lock().unwrap() == bytes, "bytes in another order");
    }

    #[test]
    fn an_error_of_the_disk_reaches_the_writer() {
        let (mut spool, disk, allow, taken) = slow(BUFFER, 2);
        drop(allow);
        let full = loop {
            if let Err(error) = spool.write_all(&[1; BUFFER / 2]).and_then(|()| spool.flush()) {
                break error;
            }
        };
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        assert!(disk.settle().is_err() && spool.flush().is_err(), "an error stays");
        drop(spool);
        assert!(disk.end().is_err());
        assert_eq!(taken.lock().unwrap().len(), BUFFER);
    }

    #[test]
    fn the_last_bytes_are_written_and_their_error_is_told_at_the_end() {
        for room in [10, 9] {
            let (mut spool, disk, allow, taken) = slow(room, 2);
            drop(allow);
            spool.write_all(&[7; 10]).unwrap();
            drop(spool);
            assert_eq!(disk.end().is_ok(), room == 10);
            assert_eq!(taken.lock().unwrap().len(), if room == 10 { 10 } else { 0 });
        }
    }

    #[test]
    fn settling_waits_for_the_disk() {
        let (mut spool, disk, allow, taken) = slow(usize::MAX, 2);
        spool.write_all(b"opening").unwrap();
        spool.flush().unwrap();
        assert!(disk.queued() > 0.0);
        drop(allow);
        disk.settle().unwrap();
        assert_eq!((taken.lock().unwrap().as_slice(), disk.queued()), (&b"opening"[..], 0.0));
        drop(spool);
        disk.end().unwrap();
    }

    #[test]
    fn a_disk_that_is_dropped_has_written_everything() {
        struct Late(Arc<Mutex<Vec<u8>>>);
        impl Write for Late {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                std::thread::sleep(Duration::from_millis(100));
                self.0.lock().unwrap().extend_from_slice(bytes);
                Ok(bytes.len())
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let taken = Arc::<Mutex<Vec<u8>>>::default();
        let (mut spool, disk) = start(Late(Arc::clone(&taken))).unwrap();
        spool.write_all(b"frames").unwrap();
        drop(spool);
        drop(disk);
        assert_eq!(*taken.lock().unwrap(), b"frames");
    }

    #[test]
    fn the_share_that_waits_is_of_the_whole_queue() {
        let (mut spool, disk, allow, _) = slow(usize::MAX, 4);
        let shares = [1, 2, 3, 4].map(|byte| {
            spool.write_all(&[byte]).unwrap();
            spool.flush().unwrap();
            disk.queued()
        });
        // The disk ends after its spool, so nothing is asserted before.
        drop((allow, spool));
        disk.end().unwrap();
        assert_eq!(shares, [0.25, 0.5, 0.75, 1.0]);
    }

    #[test]
    fn a_buffer_takes_as_much_as_it_has_room_for() {
        let (mut spool, disk, allow, taken) = slow(usize::MAX, 2);
        drop(allow);
        let bytes = vec![7; 3 * BUFFER];
        let parts = [&bytes[..BUFFER / 4], &bytes, &bytes];
        let took = parts.map(|part| spool.write(part).unwrap());
        // The disk ends after its spool, so nothing is asserted before.
        drop(spool);
        disk.end().unwrap();
        assert_eq!(took, [BUFFER / 4, BUFFER - BUFFER / 4, BUFFER]);
        assert_eq!(taken.lock().unwrap().len(), 2 * BUFFER);
    }

    /// Nothing waits for a thread that has ended: not the writer in front of a full queue, and not who waits for the disk.
    #[test]
    fn a_panic_of_the_disk_is_an_error_for_all_that_wait() {
        struct Broken;
        impl Write for Broken {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                panic!("a fault of the disk, as the test asks")
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let (mut spool, disk) = start_with(Broken, 1).unwrap();
        spool.write_all(b"frames").unwrap();
        drop(spool);
        assert!(disk.end().unwrap_err().to_string().contains("panicked"));

        let (mut spool, disk) = start_with(Broken, 1).unwrap();
        let mut hand_over = || spool.write_all(b"frames").and_then(|()| spool.flush());
        let refused = (0..4).find_map(|_| hand_over().err()).unwrap();
        assert!(refused.to_string().contains("earlier error"), "{refused}");
        assert!(disk.settle().is_err());
    }
}
