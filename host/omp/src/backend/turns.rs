//! Work of many items, batch after batch: on a device as long as that works, else on the processor.
//!
//! # Invariant
//! Every item is done once, in its order, by work that ran to its end: what a device began and did not finish is done again
//! (`tests::whatever_a_device_refuses_each_item_is_done_once`).

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A device that cannot do this number of items gets none after that.
const FEWEST: usize = 16;

/// The fewest items by which a device and the processor are compared.
const COMPARED: usize = 64;

/// Who does the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Who {
    Processor,
    /// The device; the number is the most items that it gets at a time.
    Device(usize),
    /// The first batch decides.
    Undecided,
}

/// Who does the next items, the device or the processor, and why.
#[derive(Debug, Clone)]
pub struct Turns {
    who: Who,
    device: Arc<str>,
    said: Option<Arc<str>>,
}

impl Turns {
    /// All work is the processor's.
    #[must_use]
    pub fn of_processor() -> Self {
        Self { who: Who::Processor, device: "".into(), said: None }
    }

    /// The device of this name works until it fails.
    #[must_use]
    pub fn on_device(device: &str) -> Self {
        Self { who: Who::Device(usize::MAX), device: device.into(), said: None }
    }

    /// The first batch of 64 items or more decides by its time.
    #[must_use]
    pub fn by_time(device: &str) -> Self {
        Self { who: Who::Undecided, ..Self::on_device(device) }
    }

    /// The device could not even begin.
    #[must_use]
    pub fn without(device: &str, why: &str) -> Self {
        let said = format!("{device} cannot compute, so the processor did: {why}");
        Self { said: Some(said.into()), ..Self::of_processor() }
    }

    /// Whether the device does the next items.
    #[must_use]
    pub fn has_device(&self) -> bool {
        self.who != Who::Processor
    }

    /// Whether the device works because it was asked for.
    #[must_use]
    pub fn is_asked_for(&self) -> bool {
        matches!(self.who, Who::Device(_))
    }

    /// The name of the device.
    #[must_use]
    pub fn device(&self) -> &Arc<str> {
        &self.device
    }

    /// Why the device or the processor does the work, in one line, where that was not the user's choice.
    #[must_use]
    pub fn said(&self) -> Option<&Arc<str>> {
        self.said.as_ref()
    }

    /// Does all items, and returns their results and how many of them, the first ones, are the device's. `device` and
    /// `processor` each do the items of a range. A device that fails gets half as many items the next time, and the
    /// processor does what the device cannot.
    ///
    /// # Errors
    /// Those of `processor`, and those of `device` that are not [its own failures](Failure).
    pub fn work<T, E: Failure>(
        &mut self,
        items: usize,
        mut device: impl FnMut(Range<usize>) -> Result<Vec<T>, E>,
        mut processor: impl FnMut(Range<usize>) -> Result<Vec<T>, E>,
    ) -> Result<(Vec<T>, usize), E> {
        let (mut done, mut by_device) = (Vec::with_capacity(items), 0);
        // A few items decide nothing, and are not worth a device's start.
        if self.who == Who::Undecided && items >= COMPARED {
            by_device = self.decide(items, &mut done, &mut device, &mut processor)?;
        }
        if let Who::Device(_) = self.who {
            self.on(items, &mut done, &mut device)?;
            by_device = done.len();
        }
        if done.len() < items {
            done.append(&mut processor(done.len()..items)?);
        }
        Ok((done, by_device))
    }
}

/// An error of which a part are failures of a device.
pub trait Failure: ToString {
    /// Whether the device failed, so that the processor may do what it could not.
    fn is_of_device(&self) -> bool;
}

impl Turns {
    /// Lets the device do the items up to this one, or as many as it can.
    fn on<T, E: Failure>(
        &mut self,
        end: usize,
        done: &mut Vec<T>,
        device: &mut impl FnMut(Range<usize>) -> Result<Vec<T>, E>,
    ) -> Result<(), E> {
        while let Who::Device(most) = self.who
            && done.len() < end
        {
            let some = most.min(end - done.len());
            match device(done.len()..done.len() + some) {
                Ok(mut made) => done.append(&mut made),
                Err(error) if !error.is_of_device() => return Err(error),
                Err(_) if some > FEWEST => self.who = Who::Device(some / 2),
                Err(error) => {
                    let (device, why) = (&self.device, error.to_string());
                    let said = format!("{device} failed, so the processor took over: {why}");
                    (self.who, self.said) = (Who::Processor, Some(said.into()));
                }
            }
        }
        Ok(())
    }

    /// Lets both do some of the items, and keeps the faster one. Returns how many of those that are done are the device's.
    fn decide<T, E: Failure>(
        &mut self,
        items: usize,
        done: &mut Vec<T>,
        device: &mut impl FnMut(Range<usize>) -> Result<Vec<T>, E>,
        processor: &mut impl FnMut(Range<usize>) -> Result<Vec<T>, E>,
    ) -> Result<usize, E> {
        let part = items / 4;
        self.who = Who::Device(usize::MAX);
        // At first a device compiles.
        self.on(part, done, device)?;
        let before = Instant::now();
        self.on(2 * part, done, device)?;
        let (of_device, at) = (before.elapsed(), done.len());
        if at < 2 * part || self.who == Who::Processor {
            return Ok(at);
        }
        let before = Instant::now();
        let mut made = processor(at..at + part)?;
        let of_processor = before.elapsed();
        let ms = |time: Duration| 1e3 * time.as_secs_f64();
        let times = format!(
            "{:.1} ms for {part} on {}, {:.1} ms on the processor",
            ms(of_device),
            self.device,
            ms(of_processor)
        );
        let chosen = if of_device <= of_processor { &*self.device } else { "the processor" };
        self.said = Some(format!("{chosen} computed, the faster one: {times}").into());
        if of_processor < of_device {
            self.who = Who::Processor;
            done.append(&mut made);
        }
        Ok(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::thread::sleep;

    #[derive(Debug, PartialEq)]
    enum Wrong {
        Device,
        Item,
    }

    impl std::fmt::Display for Wrong {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("out of memory")
        }
    }

    impl Failure for Wrong {
        fn is_of_device(&self) -> bool {
            *self == Self::Device
        }
    }

    /// Results of a device that does what `can` allows, which is given the number of the call and the items.
    fn device(
        can: impl Fn(usize, usize) -> bool,
    ) -> impl FnMut(Range<usize>) -> Result<Vec<usize>, Wrong> {
        let calls = RefCell::new(0);
        move |items| {
            *calls.borrow_mut() += 1;
            match can(*calls.borrow(), items.len()) {
                true => Ok(items.collect()),
                false => Err(Wrong::Device),
            }
        }
    }

    fn processor(items: Range<usize>) -> Result<Vec<usize>, Wrong> {
        Ok(items.collect())
    }

    /// A device that refuses its n-th call, all from its n-th call on, and batches of more than n items.
    #[test]
    fn whatever_a_device_refuses_each_item_is_done_once() {
        let all: Vec<usize> = (0..500).collect();
        for n in 0..40 {
            let refusals: [Box<dyn Fn(usize, usize) -> bool>; 3] = [
                Box::new(move |call, _| call != n),
                Box::new(move |call, _| call < n),
                Box::new(move |_, items| items <= n),
            ];
            for (kind, can) in refusals.into_iter().enumerate() {
                for start in [Turns::on_device("a card"), Turns::by_time("a card")] {
                    let (mut turns, mut work) = (start, device(&can));
                    for _ in 0..2 {
                        let (made, on_device) = turns.work(500, &mut work, processor).unwrap();
                        assert_eq!(made, all, "{kind}, {n}");
                        assert!(on_device <= 500);
                    }
                }
            }
        }
    }

    #[test]
    fn a_device_without_memory_gets_half_as_much_and_then_nothing() {
        let mut turns = Turns::on_device("a card");
        let (made, on_device) = turns.work(100, device(|_, items| items <= 30), processor).unwrap();
        assert_eq!((made.len(), on_device), (100, 100));
        assert_eq!((turns.who, turns.said()), (Who::Device(25), None));
        let (made, on_device) = turns.work(100, device(|call, _| call < 3), processor).unwrap();
        assert_eq!((made.len(), on_device), (100, 50));
        let said = turns.said().unwrap();
        assert_eq!(&**said, "a card failed, so the processor took over: out of memory");
        // From then on it is not asked again.
        let never = |_| -> Result<Vec<usize>, Wrong> { panic!("asked") };
        assert_eq!(turns.work(100, never, processor).unwrap().1, 0);
        assert!(!turns.has_device());
    }

    #[test]
    fn an_error_of_an_item_is_no_failure_of_the_device() {
        let wrong = |_| -> Result<Vec<usize>, Wrong> { Err(Wrong::Item) };
        let mut turns = Turns::on_device("a card");
        assert_eq!(turns.work(100, wrong, processor), Err(Wrong::Item));
        assert!(turns.has_device());
    }

    #[test]
    fn the_faster_one_is_kept() {
        let slowly = |items: Range<usize>| {
            sleep(Duration::from_millis(20));
            processor(items)
        };
        let mut turns = Turns::by_time("a card");
        // A few items decide nothing.
        assert_eq!(turns.work(10, slowly, processor).unwrap().1, 0);
        assert_eq!(turns.who, Who::Undecided);
        let (_, on_device) = turns.work(100, slowly, processor).unwrap();
        assert_eq!((on_device, turns.who), (50, Who::Processor));
        assert!(turns.said().unwrap().starts_with("the processor computed, the faster one: "));
        let mut turns = Turns::by_time("a card");
        let (made, on_device) = turns.work(100, processor, slowly).unwrap();
        assert_eq!((made.len(), on_device), (100, 100));
        assert!(turns.said().unwrap().starts_with("a card computed, the faster one: "));
    }
}
