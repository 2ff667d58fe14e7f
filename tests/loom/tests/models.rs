//! What holds in every order in which the threads of the live page and of a recording can run.

use loom::sync::Arc;
use loom::thread;
use nirspi_loom::account::LossCounters;
use nirspi_loom::recording::Recording;
use nirspi_loom::serve::light::LightSwitch;
use nirspi_loom::serve::slot::{Ledger, Slot};
use std::io::{self, Write};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(1);

fn received(frames: u64) -> LossCounters {
    LossCounters { received: frames, ..LossCounters::default() }
}

/// That each received frame is counted once.
fn check(ledger: Ledger) {
    let Ledger { frames, images, .. } = ledger;
    let counted = images.shown + images.passed_over + images.failed + images.waiting;
    assert_eq!(counted, frames.received, "{images:?}");
}

#[test]
fn every_frame_is_shown_passed_over_failed_or_waiting() {
    loom::model(|| {
        let slot = Arc::<Slot<u64>>::default();
        let camera = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || {
                for number in 1..=2 {
                    slot.offer(number, Default::default(), received(number));
                    check(slot.ledger());
                }
            })
        };
        // The imaging thread, which ends with the newest frame.
        let mut newest = 0;
        while newest < 2 {
            let number = slot.take(PATIENCE).expect("only a frame wakes this thread");
            assert!(number > newest, "in order, and none twice");
            newest = number;
            check(slot.ledger());
            slot.done(number == 2);
            check(slot.ledger());
        }
        camera.join().unwrap();
        let images = slot.ledger().images;
        assert_eq!((images.shown, images.waiting), (1, 0));
        assert_eq!(images.passed_over + images.failed, 1, "the first frame");
    });
}

#[test]
fn a_page_that_reads_the_account_never_sees_a_frame_twice_or_not_at_all() {
    loom::model(|| {
        let slot = Arc::<Slot<u64>>::default();
        let camera = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || slot.offer(1, Default::default(), received(1)))
        };
        let imaging = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || {
                slot.take(PATIENCE).expect("only a frame wakes this thread");
                slot.done(true);
            })
        };
        check(slot.ledger());
        camera.join().unwrap();
        imaging.join().unwrap();
        assert_eq!(slot.ledger().images.shown, 1);
    });
}

#[test]
fn news_wake_a_thread_that_waits_for_a_frame_and_lose_none() {
    loom::model(|| {
        let slot = Arc::<Slot<u64>>::default();
        let page = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || slot.wake())
        };
        let camera = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || slot.offer(1, Default::default(), received(1)))
        };
        // News and the frame may come together. What is left then is the news or nothing.
        let taken = slot.take(PATIENCE);
        if taken.is_none() {
            assert_eq!(slot.take(PATIENCE), Some(1), "the frame comes");
        }
        page.join().unwrap();
        camera.join().unwrap();
        assert_eq!(slot.take_now(), None);
    });
}

#[test]
fn news_wake_a_thread_that_waits_for_news_alone() {
    loom::model(|| {
        let slot = Arc::<Slot<u64>>::default();
        let page = {
            let slot = Arc::clone(&slot);
            thread::spawn(move || slot.wake())
        };
        slot.await_news(PATIENCE);
        page.join().unwrap();
    });
}

#[test]
fn a_command_that_was_announced_is_seen_by_the_thread_that_is_woken() {
    loom::model(|| {
        let shared = Arc::new((LightSwitch::on(), Slot::<u64>::default()));
        let person = {
            let shared = Arc::clone(&shared);
            // As the command "light off" of a page.
            thread::spawn(move || {
                let (light, slot) = &*shared;
                let command = light.set(false);
                slot.wake();
                command
            })
        };
        let (light, slot) = &*shared;
        slot.await_news(PATIENCE);
        assert_eq!(light.position(), (false, 1));
        assert_eq!(person.join().unwrap(), 1);
    });
}

#[test]
fn of_two_commands_the_later_one_counts() {
    loom::model(|| {
        let light = Arc::new(LightSwitch::on());
        let set = |on| {
            let light = Arc::clone(&light);
            thread::spawn(move || light.set(on))
        };
        let (on, off) = (set(true), set(false));
        // After the others, because loom gives a load the values that are there when it first runs.
        let page = {
            let light = Arc::clone(&light);
            thread::spawn(move || light.position())
        };
        let (on, off) = (on.join().unwrap(), off.join().unwrap());
        // What a page sees meanwhile is one of the positions that the commands have made.
        let (allowed, command) = page.join().unwrap();
        assert_eq!((on.max(off), on.min(off)), (2, 1), "each command has its own number");
        assert_eq!(light.position(), (on > off, 2));
        let expected = match command {
            0 => true,
            number => number == on,
        };
        assert_eq!(allowed, expected, "command {command}");
    });
}

/// A disk with so much room.
struct Disk {
    room: usize,
    taken: std::sync::Arc<std::sync::Mutex<Vec<u8>>>,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
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

/// A recording on a disk with so much room, and what the disk has taken.
fn recording(room: usize, most: usize) -> (Recording, std::sync::Arc<std::sync::Mutex<Vec<u8>>>) {
    let taken = std::sync::Arc::default();
    let disk = Disk { room, taken: std::sync::Arc::clone(&taken) };
    (Recording::new(disk, most), taken)
}

#[test]
fn what_is_recorded_reaches_the_disk_once_and_in_order() {
    loom::model(|| {
        let (mut recording, taken) = recording(usize::MAX, 1);
        for bytes in [b"ab", b"cd"] {
            recording.hand_over(bytes).unwrap();
        }
        recording.end().unwrap();
        assert_eq!(*taken.lock().unwrap(), b"abcd");
    });
}

#[test]
fn what_was_recorded_before_a_wait_is_on_the_disk_after_it() {
    loom::model(|| {
        let (mut recording, taken) = recording(usize::MAX, 2);
        recording.hand_over(b"ab").unwrap();
        recording.settle().unwrap();
        assert_eq!(*taken.lock().unwrap(), b"ab");
        recording.end().unwrap();
    });
}

/// The reason is told once, by what asks first; what asks later learns that there was one.
#[test]
fn a_full_disk_ends_every_wait_and_is_told_once() {
    loom::model(|| {
        let (mut recording, taken) = recording(3, 1);
        let mut told = Vec::new();
        for bytes in [b"ab", b"cd", b"ef"] {
            told.extend(recording.hand_over(bytes).err());
        }
        told.extend(recording.settle().err());
        told.extend(recording.end().err());
        let full = |error: &io::Error| error.kind() == io::ErrorKind::StorageFull;
        assert_eq!(told.iter().filter(|error| full(error)).count(), 1, "{told:?}");
        assert!(told.len() >= 2, "{told:?}");
        assert_eq!(*taken.lock().unwrap(), b"ab");
    });
}
