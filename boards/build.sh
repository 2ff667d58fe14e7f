#!/usr/bin/env bash
# Builds the firmware of every board, or of those that are named, into boards/target:
#   bash boards/build.sh [NAME...]
# FEATURES=parallel builds with that feature, into the same place.
# `cargo test --test all budgets` then prints the sizes. Uses rustup's targets where rustup can get them. Elsewhere (Debian and
# Ubuntu, no network but the package mirror) it uses Debian's compiler and the sources of its library, unpacked into
# boards/target, nothing installed. NIRSPI_FALLBACK=1 always uses Debian's compiler.
set -euo pipefail
cd "$(dirname "$0")"
. ./facts.sh
if [ $# = 0 ]; then mapfile -t names < <(boards); else names=("$@"); fi
targets=()
for name in "${names[@]}"; do
    target=$(fact "$name" target)
    targets+=("$target")
done
mapfile -t targets < <(printf '%s\n' "${targets[@]}" | sort -u)
extra=()

# The library's sources must be those of the compiler, so both are Debian's; linker and cargo are rustup's.
fall_back() {
    echo "no targets from rustup: Debian's compiler instead" >&2
    local root=$PWD/target/debian
    mkdir -p "$root/packages"
    (
        cd "$root/packages"
        release=$(apt-cache madison rustc-web | sed -n 's/^ *rustc-web | \([0-9]*\.[0-9]*\).*/\1/p' | sort -V | tail -1)
        llvm=$(apt-cache depends "libstd-rust-web-$release" | grep -o 'libllvm[0-9]*' | head -1)
        apt-get download rustc-web rust-web-src "libstd-rust-web-$release" libstd-rust-web-dev "$llvm" >&2
        for package in *.deb; do dpkg-deb -x "$package" ..; done
    )
    local machine
    machine=$(uname -m)-linux-gnu
    cat >"$root/rustc" <<WRAPPER
#!/bin/sh
export LD_LIBRARY_PATH="$root/usr/lib/$machine:$(dirname "$(find "$root/usr/lib" -name 'libLLVM*.so*' | head -1)")"
exec "$root/usr/bin/rustc" "\$@"
WRAPPER
    chmod +x "$root/rustc"
    # Whatever toolchain is there: rust-toolchain.toml would have rustup fetch what it cannot.
    RUSTUP_TOOLCHAIN=$(cd / && rustup show active-toolchain | cut -d' ' -f1)
    local linker
    linker=$(rustc "+$RUSTUP_TOOLCHAIN" --print sysroot)/lib/rustlib/$(uname -m)-unknown-linux-gnu/bin/rust-lld
    export RUSTUP_TOOLCHAIN RUSTC_BOOTSTRAP=1 RUSTC=$root/rustc
    local target variable
    for target in "${targets[@]}"; do
        variable=CARGO_TARGET_$(tr 'a-z.-' 'A-Z__' <<<"$target")_LINKER
        export "$variable=$linker"
    done
    extra=(-Zbuild-std=core,alloc)
}

if [ -n "${NIRSPI_FALLBACK:-}" ] || ! rustup target add "${targets[@]}" >&2; then
    fall_back
fi
CARGO_ENCODED_RUSTFLAGS=$(same_bytes)
export CARGO_ENCODED_RUSTFLAGS
for name in "${names[@]}"; do
    (cd "$name" && cargo build --locked --release --target-dir ../target ${FEATURES:+--features "$FEATURES"} "${extra[@]}")
done
