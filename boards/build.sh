#!/usr/bin/env bash
# Builds the firmware of every board into boards/target (`cargo test --test budgets` then prints the sizes). With rustup's targets where rustup can get
# them; else (Debian and Ubuntu, no network but the package mirror) with Debian's compiler and its library's sources,
# unpacked into boards/target, nothing installed. NIRSPI_FALLBACK=1 takes the second way in any case.
set -euo pipefail
cd "$(dirname "$0")"
declare -A target_of=(
    [mps2-an505]=thumbv8m.main-none-eabihf
    [nucleo-u5a5zj-q]=thumbv8m.main-none-eabihf
    [nucleo-h7s3l8]=thumbv7em-none-eabihf
)
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
    export CARGO_TARGET_THUMBV8M_MAIN_NONE_EABIHF_LINKER=$linker CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER=$linker
    extra=(-Zbuild-std=core,alloc)
}

if [ -n "${NIRSPI_FALLBACK:-}" ] || ! rustup target add $(printf '%s\n' "${target_of[@]}" | sort -u) >&2; then
    fall_back
fi
for board in "${!target_of[@]}"; do
    (cd "$board" && cargo build --locked --release --target-dir ../target "${extra[@]}")
done
