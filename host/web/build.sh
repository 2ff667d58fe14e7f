#!/usr/bin/env bash
# Builds the camera and the lesson for a browser: one folder of plain files for any web server.
#
#   bash host/web/build.sh [FOLDER]      default: target/camera
#   python3 -m http.server -d target/camera
#
# Needs Rust's target: rustup target add wasm32-unknown-unknown
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
folder=$(realpath -m "${1:-$root/target/camera}")
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")

# Random numbers have seeds, so no source of randomness is linked. Vectors of 128 bits are in every browser since 2023.
export RUSTFLAGS='--cfg getrandom_backend="unsupported" -C target-feature=+simd128'
(cd "$root" && cargo build --locked --package nirspi-web --package nirspi-lesson --target wasm32-unknown-unknown --profile dist)

# The live page, with a program in the page in place of the server.
mkdir -p "$folder/page"
cp "$root"/host/serve/src/page/index.html "$folder/"
cp "$root"/host/serve/src/page/*.css "$root"/host/serve/src/page/*.js "$folder/page/"
cp "$here"/page/*.js "$folder/page/"
cp "$target/wasm32-unknown-unknown/dist/nirspi_web.wasm" "$folder/page/"

# The lesson, with a program of its own that needs no networks.
mkdir -p "$folder/lesson"
cp "$root/host/lesson/page/lesson.html" "$folder/"
cp "$root"/host/lesson/page/lesson/*.css "$root"/host/lesson/page/lesson/*.js "$folder/lesson/"
cp "$target/wasm32-unknown-unknown/dist/nirspi_lesson.wasm" "$folder/lesson/"
du -sh "$folder"
