//! The functions that the page calls.
//!
//! ```text
//! room(n) -> address          the page writes n bytes there: a text, or 32-bit numbers
//! ...(...) -> ok              one step; the answer is 64-bit numbers, or a problem in one line
//! answer(), answer_bytes()    address and length of the answer or of the problem
//! ```
//!
//! A function whose name ends in `_named` reads a text from the room.

#![allow(unsafe_code, reason = "the names of functions that another language calls are exported")]

use crate::lesson::{Lesson, Made, Reading, drawn, named};
use crate::{Problem, Pursuit, in_one_line, sight};
use nirspi_recon::{Basis, Image};
use std::cell::RefCell;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Takes a panic's message from the memory of the program.
    safe fn panicked(text: *const u8, bytes: usize);
}

/// The lesson and its buffers. A browser calls from one thread.
#[derive(Default)]
struct Program {
    lesson: Option<Lesson>,
    pursuit: Option<Pursuit>,
    asked: Vec<u8>,
    numbers: Vec<f64>,
    problem: String,
}

thread_local! {
    static PROGRAM: RefCell<Program> = RefCell::default();
}

impl Program {
    fn lesson(&mut self) -> Result<&mut Lesson, Problem> {
        self.lesson.as_mut().ok_or_else(|| "no scene was chosen".to_owned())
    }

    fn text(&mut self) -> String {
        String::from_utf8_lossy(&std::mem::take(&mut self.asked)).into_owned()
    }

    fn choose(&mut self, scene: Image) -> Result<Vec<f64>, Problem> {
        let light: f64 = scene.pixels().iter().map(|&v| f64::from(v)).sum();
        let numbers = of_image(&scene).chain([light]).collect();
        match &mut self.lesson {
            Some(lesson) => lesson.look_at(scene),
            None => self.lesson = Some(Lesson::new(scene)?),
        }
        Ok(numbers)
    }

    fn basis(&mut self) -> Result<Basis, Problem> {
        self.text().parse().map_err(in_one_line)
    }
}

/// Takes a step, and keeps its numbers or its problem.
fn step(work: impl FnOnce(&mut Program) -> Result<Vec<f64>, Problem>) -> bool {
    PROGRAM.with_borrow_mut(|program| {
        let done = work(program);
        let is_done = done.is_ok();
        program.numbers.clear();
        match done {
            Ok(numbers) => program.numbers = numbers,
            Err(problem) => program.problem = problem,
        }
        is_done
    })
}

fn of_image(image: &Image) -> impl Iterator<Item = f64> {
    image.pixels().iter().map(|&v| v.into())
}

/// An image, then its error.
fn of_made(made: &Made) -> Vec<f64> {
    of_image(&made.image).chain([made.error]).collect()
}

fn widened(values: Vec<f32>) -> Vec<f64> {
    values.into_iter().map(f64::from).collect()
}

/// Makes room for bytes of the page. Returns their address.
#[unsafe(no_mangle)]
extern "C" fn room(bytes: usize) -> *mut u8 {
    PROGRAM.with_borrow_mut(|program| {
        program.asked.clear();
        program.asked.resize(bytes, 0);
        program.asked.as_mut_ptr()
    })
}

/// Tells the page of a panic from now on.
#[unsafe(no_mangle)]
extern "C" fn begin() {
    std::panic::set_hook(Box::new(|info| {
        let text = info.to_string();
        panicked(text.as_ptr(), text.len());
    }));
}

/// Chooses the scene in the room, a name. The answer is the scene, then its light.
#[unsafe(no_mangle)]
extern "C" fn scene_named() -> bool {
    step(|program| {
        let name = program.text();
        program.choose(named(&name)?)
    })
}

/// Chooses the scene in the room, a drawing of 32-bit numbers. The answer is the scene, then its light.
#[unsafe(no_mangle)]
extern "C" fn scene_drawn() -> bool {
    step(|program| {
        let asked = std::mem::take(&mut program.asked);
        let levels = asked.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
        program.choose(drawn(levels)?)
    })
}

/// What the camera sees of the scene in the weather in the room, then its error. The lesson goes on
/// with the scene itself.
#[unsafe(no_mangle)]
extern "C" fn weather_named(distance_mm: f64, seed: u32) -> bool {
    step(|program| {
        let weather = program.text();
        let lesson = program.lesson()?;
        let seen = sight::seen(lesson.scene(), distance_mm, &weather, seed.into())?;
        lesson.compared(seen).map(|made| of_made(&made))
    })
}

/// Shows the patterns in the order in the room. The answer is the Hadamard rows.
#[unsafe(no_mangle)]
extern "C" fn order_named() -> bool {
    step(|program| {
        let order = program.text();
        let lesson = program.lesson()?;
        lesson.show_in(&order)?;
        Ok(lesson.rows().iter().map(|&row| row.into()).collect())
    })
}

/// Adds noise to the readings. The answer is empty.
#[unsafe(no_mangle)]
extern "C" fn noise(share: f64, seed: u32) -> bool {
    step(|program| program.lesson()?.add_noise(share, seed.into()).map(|()| Vec::new()))
}

/// The pattern at this place of the order.
#[unsafe(no_mangle)]
extern "C" fn pattern(place: usize) -> bool {
    step(|program| program.lesson()?.pattern(place).map(widened))
}

/// The light of the pattern at this place on the scene.
#[unsafe(no_mangle)]
extern "C" fn light(place: usize) -> bool {
    step(|program| program.lesson()?.light(place).map(widened))
}

/// The readings in the order shown: of a pattern, of its negative, and their difference.
#[unsafe(no_mangle)]
extern "C" fn readings() -> bool {
    step(|program| {
        let readings = program.lesson()?.readings()?;
        let numbers = |read: Reading| [read.pattern, read.negative, read.difference()];
        Ok(readings.into_iter().flat_map(numbers).collect())
    })
}

/// The running sum of the first patterns, then its error.
#[unsafe(no_mangle)]
extern "C" fn sum(count: usize) -> bool {
    step(|program| program.lesson()?.sum(count).map(|made| of_made(&made)))
}

/// The image by the method in the room, then its error.
#[unsafe(no_mangle)]
extern "C" fn image_named(share: f64) -> bool {
    step(|program| {
        let method = program.text();
        program.lesson()?.image(&method, Basis::Dct, share).map(|made| of_made(&made))
    })
}

/// Pursues the readings in the basis in the room. The answer is the residuals.
#[unsafe(no_mangle)]
extern "C" fn pursue_named(share: f64, atoms: usize) -> bool {
    step(|program| {
        let basis = program.basis()?;
        let pursuit = Pursuit::new(program.lesson()?, basis, share, atoms)?;
        let residuals = pursuit.residuals().to_vec();
        program.pursuit = Some(pursuit);
        Ok(residuals)
    })
}

/// An atom of the pursuit among the first `count`.
#[unsafe(no_mangle)]
extern "C" fn atom(at: usize, count: usize) -> bool {
    step(|program| {
        let pursuit = program.pursuit.as_ref().ok_or("no pursuit yet")?;
        pursuit.atom(at, count).map(widened)
    })
}

/// The image of the pursuit's first atoms, then its error.
#[unsafe(no_mangle)]
extern "C" fn atoms(count: usize) -> bool {
    step(|program| {
        let pursuit = program.pursuit.take().ok_or("no pursuit yet")?;
        let made = program.lesson().and_then(|lesson| pursuit.image(lesson, count));
        program.pursuit = Some(pursuit);
        Ok(of_made(&made?))
    })
}

/// The address of the answer, or of the problem if there is no answer.
#[unsafe(no_mangle)]
extern "C" fn answer(is_done: bool) -> *const u8 {
    PROGRAM.with_borrow(|program| match is_done {
        true => program.numbers.as_ptr().cast(),
        false => program.problem.as_ptr(),
    })
}

/// The number of bytes of the answer, or of the problem.
#[unsafe(no_mangle)]
extern "C" fn answer_bytes(is_done: bool) -> usize {
    PROGRAM.with_borrow(|program| match is_done {
        true => size_of_val(&program.numbers[..]),
        false => program.problem.len(),
    })
}
