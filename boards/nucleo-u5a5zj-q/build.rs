//! Linker scripts: cortex-m-rt's, defmt's, and this board's memory. And the facts of `board.toml` that the code needs.

fn main() {
    let folder = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo:rustc-link-search={folder}");
    println!("cargo:rerun-if-changed=memory.x");
    let facts = include_str!("board.toml");
    let staging = facts.lines().find_map(|line| line.strip_prefix("staging_bytes = "));
    let staging = staging.expect("board.toml has a line staging_bytes = BYTES");
    println!("cargo:rustc-env=STAGING_BYTES={}", staging.replace('_', ""));
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
