//! Which edges of the program inputs reach, from the counters that the compiler has put there.

#![expect(unsafe_code, reason = "counters and table are the compiler's, and have no names in Rust")]

use nirspi_fuzz::Law;
use std::fmt::Write as _;
use std::path::Path;

// The linker sets these names around the sections of the compiler's counters and of the table of
// places. Rust must not declare them: the pass that counts declares them too, and would call its own by
// another name.
std::arch::global_asm!(
    ".pushsection .data.rel.ro,\"aw\"",
    ".globl nirspi_fuzz_bounds",
    ".p2align 3",
    "nirspi_fuzz_bounds:",
    ".quad __start___sancov_cntrs",
    ".quad __stop___sancov_cntrs",
    ".quad __start___sancov_pcs",
    ".quad __executable_start",
    ".popsection",
);

unsafe extern "C" {
    /// Begin and end of the counters, begin of the table of places, begin of the program.
    #[link_name = "nirspi_fuzz_bounds"]
    safe static BOUNDS: [usize; 4];
}

/// Tries every file of the folders, and writes a line for each edge of the program: its address in
/// the executable in hexadecimal, and 1 if an input has reached it.
pub fn write(file: &Path, folders: &[String], law: &Law) {
    let [start, end, places, program] = BOUNDS;
    let count = end - start;
    let start = std::ptr::with_exposed_provenance_mut::<u8>(start);
    // Two words for each counter: address and flags.
    let places = std::ptr::with_exposed_provenance::<[usize; 2]>(places);
    let mut reached = vec![false; count];
    let clear = || {
        // SAFETY: the section has so many bytes, and no other thread needs their values.
        unsafe { start.write_bytes(0, count) }
    };
    for folder in folders {
        for entry in Path::new(folder).read_dir().expect("a folder of inputs") {
            let bytes = std::fs::read(entry.expect("an input").path()).expect("its bytes");
            clear();
            law.check(&bytes);
            for (at, reached) in reached.iter_mut().enumerate() {
                // SAFETY: within the section.
                let counter = unsafe { start.add(at).read_volatile() };
                *reached |= counter != 0;
            }
        }
    }
    let mut lines = String::new();
    for (at, reached) in reached.into_iter().enumerate() {
        // SAFETY: the table has an entry for each counter.
        let [address, _] = unsafe { places.add(at).read() };
        // The linker leaves no address where it has left the function out.
        if let Some(place) = address.checked_sub(program) {
            let _ = writeln!(lines, "{place:#x} {}", u8::from(reached));
        }
    }
    std::fs::write(file, lines).expect("the edges' file");
}
