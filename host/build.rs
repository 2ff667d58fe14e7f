//! Makes the list in `src/boards.rs` from every `boards/NAME/board.toml`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[path = "src/boards/board.rs"]
mod board;

fn folders(boards: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(boards)? {
        let folder = entry?.path();
        if folder.join("board.toml").is_file() {
            found.push(folder);
        }
    }
    found.sort();
    Ok(found)
}

fn list(boards: &Path) -> Result<String, String> {
    let error = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    let mut list = String::from("&[\n");
    for folder in folders(boards).map_err(|e| error(boards, e))? {
        let file = folder.join("board.toml");
        println!("cargo:rerun-if-changed={}", file.display());
        let text = std::fs::read_to_string(&file).map_err(|e| error(&file, e))?;
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
        let board = board::Board::parse(name.unwrap_or_default().leak(), text.leak())?;
        // What `Debug` prints of texts, numbers and `Option`s is Rust.
        list += &format!("{board:?},\n");
    }
    Ok(list + "]\n")
}

fn main() -> ExitCode {
    let boards = Path::new(env!("CARGO_MANIFEST_DIR")).join("../boards");
    // A new board is a new package, and each package has an entry in this file.
    println!("cargo:rerun-if-changed={}", boards.join("Cargo.lock").display());
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default()).join("boards.rs");
    let written =
        list(&boards).and_then(|list| std::fs::write(out, list).map_err(|e| e.to_string()));
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
