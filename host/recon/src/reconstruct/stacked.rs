//! A method for a stack of like measurements: what the method chooses for the first is kept for
//! those after it, because judging each one takes longer than making its image.

use super::{Reconstruct, ReconstructError, Reconstruction, Recursive, Report};
use crate::Measurements;
use std::sync::{Arc, Mutex, PoisonError};

/// A method whose [choice](Reconstruct::settled) is made for the first measurement, and again after
/// a number of images. Called from several threads, the first call chooses: for images that do not
/// depend on the order of the calls, [settle](Self::settle) first.
pub struct Stacked {
    method: Box<dyn Reconstruct>,
    /// Number of images after which the choice is made again.
    every: u32,
    choice: Mutex<Choice>,
}

#[derive(Default)]
struct Choice {
    /// Images until the next choice.
    left: u32,
    method: Option<Arc<dyn Reconstruct>>,
}

impl Stacked {
    /// A method for one stack.
    #[must_use]
    pub fn new(method: Box<dyn Reconstruct>) -> Self {
        Self::chosen_every(u32::MAX, method)
    }

    /// A method for a view that goes on for ever: the choice is made every `every` images.
    #[must_use]
    pub fn chosen_every(every: u32, method: Box<dyn Reconstruct>) -> Self {
        Self { method, every, choice: Mutex::default() }
    }

    /// Chooses for measurements like these, if the choice is due.
    ///
    /// # Errors
    /// As [`Reconstruct::settled`].
    pub fn settle(&self, first: &Measurements) -> Result<(), ReconstructError> {
        self.of(first).map(|_| ())
    }

    fn of(
        &self,
        measurements: &Measurements,
    ) -> Result<Option<Arc<dyn Reconstruct>>, ReconstructError> {
        let mut choice = self.choice.lock().unwrap_or_else(PoisonError::into_inner);
        if choice.left == 0 {
            choice.method = self.method.settled(measurements)?;
            choice.left = self.every;
        }
        choice.left -= 1;
        Ok(choice.method.clone())
    }

    /// Calls `with` the method of this measurement.
    fn by<T>(
        &self,
        measurements: &Measurements,
        with: impl FnOnce(&dyn Reconstruct) -> Result<T, ReconstructError>,
    ) -> Result<T, ReconstructError> {
        match self.of(measurements)? {
            Some(settled) => with(&*settled),
            None => with(&*self.method),
        }
    }
}

impl Reconstruct for Stacked {
    fn name(&self) -> &str {
        self.method.name()
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        self.by(measurements, |method| method.reconstruct(measurements))
    }

    fn reconstruct_into(
        &self,
        measurements: &Measurements,
        pixels: &mut [f32],
    ) -> Result<Report, ReconstructError> {
        self.by(measurements, |method| method.reconstruct_into(measurements, pixels))
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        self.method.begin_video()
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        self.by(frame, |method| method.next_frame(past, frame))
    }

    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        self.method.reconstruct_video(frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Order;
    use crate::reconstruct::{Method, MethodSettings};
    use crate::testing::{noisy, scene, side};

    /// Chooses `hadamard` for the first measurement of 1, and `omp` for others.
    struct Chooser;

    impl Reconstruct for Chooser {
        fn name(&self) -> &str {
            "chooser"
        }

        fn reconstruct(&self, _: &Measurements) -> Result<Reconstruction, ReconstructError> {
            Err(ReconstructError::Failed("the choice makes the image".to_owned()))
        }

        fn settled(
            &self,
            first: &Measurements,
        ) -> Result<Option<Arc<dyn Reconstruct>>, ReconstructError> {
            let method = if first.values()[0] == 1.0 { Method::HADAMARD } else { Method::OMP };
            method.prepare(&MethodSettings::default()).map(|method| Some(method.into()))
        }
    }

    #[test]
    fn the_choice_for_the_first_is_kept_until_it_is_due_again() {
        let rows = Order::ZigZag.rows(side(8)).unwrap();
        let of = |first: f64| {
            let values: Vec<f64> = (0..64).map(|k| if k == 0 { first } else { 0.25 }).collect();
            Measurements::from_differential(&rows, &values).unwrap()
        };
        let (one, other) = (of(1.0), of(2.0));
        let by = |stack: &Stacked, m: &Measurements| stack.reconstruct(m).unwrap().report.name;
        let [hadamard, omp] = [Method::HADAMARD, Method::OMP].map(Method::name);
        let stack = Stacked::new(Box::new(Chooser));
        assert_eq!([by(&stack, &one), by(&stack, &other)], [hadamard, hadamard]);
        let live = Stacked::chosen_every(2, Box::new(Chooser));
        let made = [by(&live, &one), by(&live, &other), by(&live, &other), by(&live, &one)];
        assert_eq!(made, [hadamard, hadamard, omp, omp]);
    }

    #[test]
    fn a_method_without_a_choice_makes_its_own_images() {
        let part = noisy(&Order::ZigZag.rows(side(16)).unwrap(), &scene(side(16), 1), 0.1, 4);
        for method in [Method::HADAMARD, Method::TIKHONOV] {
            let alone = method.prepare(&MethodSettings::default()).unwrap();
            let stack = Stacked::new(method.prepare(&MethodSettings::default()).unwrap());
            stack.settle(&part).unwrap();
            assert_eq!(stack.reconstruct(&part), alone.reconstruct(&part));
        }
    }
}
