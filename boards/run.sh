#!/usr/bin/env bash
# Builds a board's firmware, flashes it and shows its log; an emulated board starts in its emulator.
#   bash boards/run.sh NAME [more arguments for cargo run]
# The target and the program that flashes or emulates are in boards/NAME/.cargo/config.toml.
set -euo pipefail
. "$(dirname "$0")/facts.sh"
if [ $# = 0 ]; then
    echo "usage: bash boards/run.sh NAME, with one of: $(boards | tr '\n' ' ')" >&2
    exit 2
fi
name=$1
shift
fact "$name" target >/dev/null
cd "$boards_folder/$name"
# As build.sh builds it, so that neither compiles again what the other has.
CARGO_ENCODED_RUSTFLAGS=$(same_bytes)
export CARGO_ENCODED_RUSTFLAGS
exec cargo run --locked --release --bin "$name" --target-dir ../target "$@"
