# Short names for what contributors do most. `just` lists them (https://just.systems); each is one
# command that works without `just` too.

[private]
default:
    @just --list

# Show what the camera does, without hardware
demo *args:
    cargo run --release --locked -- demo {{ args }}

# Run every test but those of the RTL
test *args:
    cargo test --locked {{ args }}

# Format Rust
format:
    cargo fmt

# Lint what `test` builds
lint:
    cargo clippy --locked --all-targets -- -D warnings

# Write the generated documentation, register map and SystemVerilog again. Builds the Veryl simulator
bless:
    NIRSPI_BLESS=1 cargo test --locked -p nirspi-wire
    NIRSPI_BLESS=1 cargo test --locked --test all --test library -- boards glossary safety_page security_page
    NIRSPI_BLESS=1 cargo test --locked --test cli reference
    NIRSPI_BLESS=1 cargo test --locked --test all faults
    NIRSPI_BLESS=1 cargo test --locked -p nirspi-hdl-sim -p nirspi-tests-rtl --test rtl stale

# Build the book (needs mdBook) into target/book
book:
    mdbook build docs

# Build a board's firmware, or every board's
firmware *board:
    bash boards/build.sh {{ board }}

# Run steps of CI; without a name, all of them. `just ci --list` says what each one needs
ci *steps:
    bash .ci/run {{ steps }}
