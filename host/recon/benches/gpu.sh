#!/usr/bin/env bash
# OMP on a machine that has a GPU and no Rust.
#
#   bash host/recon/benches/gpu.sh pack       where there is Rust: program, tests and batched-omp into .gpu/
#   bash host/recon/benches/gpu.sh run OUT    on the GPU's machine: correctness, times, peers into OUT/
#
# .gpu/ is not tracked, and no part of the repository.
set -euo pipefail
cd "$(dirname "$0")/../../.."

pack() {
    mkdir -p .gpu
    cargo build --locked --release -p nirspi
    strip -o .gpu/nirspi target/release/nirspi
    # The library's own tests, kernels among them.
    cargo test --locked --release --no-run --lib -p nirspi-recon --features gpu 2>&1 | tee .gpu/log
    strip -o .gpu/tests "$(sed -n 's/.*(\(.*nirspi_recon-[0-9a-f]*\)).*/\1/p' .gpu/log)"
    xz -T0 -f .gpu/nirspi .gpu/tests
    # As it is: pip would build it, and its compiled helpers are for another variant than ours.
    python3 - <<'END' || echo "no batched-omp: peers.py will say so"
import re, urllib.request
page = urllib.request.urlopen("https://pypi.org/simple/orthogonal-matching-pursuit-gpu/", timeout=60).read().decode()
address = re.search(r'href="([^"#]*/([^"/#]*-0\.1\.3\.tar\.gz))', page)
urllib.request.urlretrieve(address[1], f".gpu/{address[2]}")
END
    rm .gpu/log
    du -sh .gpu
}

run() {
    local out=$1 work
    mkdir -p "$out"
    work=$(mktemp -d)
    xz -dc .gpu/nirspi.xz >"$work/nirspi"
    xz -dc .gpu/tests.xz >"$work/tests"
    chmod +x "$work/nirspi" "$work/tests"
    # NVRTC is looked for by name: CUDA's own folder is seldom among those searched.
    export LD_LIBRARY_PATH=${CUDA_PATH:-/usr/local/cuda}/lib64${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
    nvidia-smi 2>&1 | tee "$out/nvidia-smi.txt" || true

    echo "== correctness: the same tests as on software Vulkan"
    NIRSPI_TEST_BACKEND=cuda "$work/tests" omp:: 2>&1 | tee "$out/tests.txt" || true

    if command -v compute-sanitizer >/dev/null; then
        echo "== races between units: barriers that software Vulkan, which takes turns, does not need"
        NIRSPI_TEST_BACKEND=cuda timeout 120 compute-sanitizer --tool racecheck "$work/tests" images_are 2>&1 |
            tee "$out/racecheck.txt" || true
    fi

    echo "== times, with the transfer of measurements, solutions and images"
    : >"$out/bench.jsonl"
    bench() {
        timeout 60 "$work/nirspi" bench omp --backend "$@" >"$work/report" 2>"$work/error" || {
            echo "$*: $(cat "$work/error")"
            return 0
        }
        tr -d '\n' <"$work/report" >>"$out/bench.jsonl"
        echo >>"$out/bench.jsonl"
        echo "$*: $(grep -E '"(device|median_ms|fastest_ms|slowest_ms|frames_per_s|of_fastest_sweeps|solved_in_f64)"' "$work/report" | tr -d '\n')"
    }
    local precision frames sparsity
    for precision in f32 auto; do
        for frames in 1 64 256 1024 4096 16384; do bench cuda --precision $precision --frames $frames; done
    done
    for sparsity in 16 256; do
        for frames in 1 1024; do bench cuda --precision f32 --sparsity $sparsity --frames $frames; done
    done
    # Where Vulkan's loader is there as well: the same kernels through wgpu, and the processor beside.
    for frames in 1 4096; do
        bench wgpu --precision f32 --frames $frames
        bench cpu --precision f32 --frames $frames
    done

    echo "== batched-omp on the same card"
    tar -xzf .gpu/orthogonal_matching_pursuit_gpu-*.tar.gz -C "$work"
    PYTHONPATH=$(echo "$work"/orthogonal_matching_pursuit_gpu-*/src) \
        timeout 200 python3 host/recon/benches/peers.py --device cuda --nirspi "$work/nirspi" --rounds 3 --json "$out/peers.json" 2>&1 |
        tee "$out/peers.txt" || true
    rm -r "$work"
}

case ${1-} in
pack) pack ;;
run) run "${2:?where to: gpu.sh run OUT}" ;;
*)
    sed -n '3,6s/^# *//p' "$0"
    exit 2
    ;;
esac
