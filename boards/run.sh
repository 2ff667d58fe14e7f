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
if [ "$(fact "$name" kind)" = emulated ]; then
    # Where install-qemu.sh has unpacked it.
    PATH=$PATH:$boards_folder/../target/qemu
    if ! command -v qemu-system-arm >/dev/null; then
        echo "qemu-system-arm is not on the PATH: bash boards/$name/install-qemu.sh gets it" >&2
        exit 1
    fi
    echo "the camera of $name will be at tcp:127.0.0.1:1550, its FPGA's bus at 1551; Ctrl-C ends it" >&2
fi
cd "$boards_folder/$name"
# As build.sh builds it, so that neither compiles again what the other has.
CARGO_ENCODED_RUSTFLAGS=$(same_bytes)
export CARGO_ENCODED_RUSTFLAGS
exec cargo run --locked --release --bin "$name" --target-dir ../target "$@"
