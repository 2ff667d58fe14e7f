//! The search: libFuzzer on one law, which the variable `FUZZ_LAW` names. `search.py` starts it.
//!
//! * `FUZZ_LAW=list` prints the laws: name, what it reads, longest input, files of the reader,
//! * `FUZZ_SEEDS=FOLDER` writes the law's seeds there and ends,
//! * `FUZZ_REACHED=FILE` tries the inputs in the arguments' folders and writes the places of all
//!   edges that they reach.
#![no_main]

mod reached;

use libfuzzer_sys::fuzz_target;
use nirspi_fuzz::{Law, all, memory::Counting, named};
use std::env;
use std::path::Path;
use std::process::exit;
use std::sync::OnceLock;

#[global_allocator]
static MEMORY: Counting = Counting;

static LAW: OnceLock<&'static Law> = OnceLock::new();

fn law() -> &'static Law {
    LAW.get_or_init(|| {
        let name = env::var("FUZZ_LAW").unwrap_or_default();
        named(&name).unwrap_or_else(|| {
            eprintln!("FUZZ_LAW is {name:?}, expected `list` or a law of it");
            exit(2)
        })
    })
}

fn begin() {
    if env::var("FUZZ_LAW").as_deref() == Ok("list") {
        for Law { name, reads, longest, readers, .. } in all() {
            println!("{name}\t{reads}\t{longest}\t{}", readers.join(" "));
        }
        exit(0);
    }
    if let Ok(folder) = env::var("FUZZ_SEEDS") {
        for (number, seed) in (law().seeds)().into_iter().enumerate() {
            let path = Path::new(&folder).join(format!("seed-{number}"));
            std::fs::write(path, seed).expect("a seed's file");
        }
        exit(0);
    }
    // What a law makes once is no memory of an input.
    nirspi_fuzz::seeds::optics();
    nirspi_fuzz::seeds::identity();
    (law().holds)(&[]);
    if let Ok(file) = env::var("FUZZ_REACHED") {
        let folders: Vec<String> = env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
        reached::write(Path::new(&file), &folders, law());
        exit(0);
    }
}

fuzz_target!(init: begin(), |bytes: &[u8]| {
    law().check(bytes);
});
