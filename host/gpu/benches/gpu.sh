#!/usr/bin/env bash
# OMP and networks on a machine that has a GPU and no Rust.
#
#   bash host/gpu/benches/gpu.sh pack              where there is Rust: program, tests and batched-omp into .gpu/
#   bash host/gpu/benches/gpu.sh run OUT [PART]    on the GPU's machine: a part, or all of them, into OUT/
#
# Parts, each of which ends within seven minutes, with what it has not reached by then skipped:
#
#   correctness    tests of every kernel, GPU against processor on whole images, compute-sanitizer
#   speed          OMP, networks and pipeline
#   peers          the same networks in PyTorch, and batched-omp, with ours beside them
#   profile        time of each kernel of the networks (ncu)
#
# OUT/ has a file for each step. A step that fails or is missing says so, and the next one goes on; the last lines, in
# OUT/summary.txt too, have each step and its result. `run` ends with 1 if a step of `correctness` failed.
#
# .gpu/ is not tracked, and no part of the repository.
set -euo pipefail
cd "$(dirname "$0")/../../.."

# Largest size of .gpu/ in MiB: with the repository, 64 MiB are carried to the other machine at once.
limit=32

pack() {
    local target=${CARGO_TARGET_DIR:-target}
    rm -rf .gpu
    mkdir -p .gpu
    cargo build --locked --release -p nirspi-cli
    strip -o .gpu/nirspi "$target/release/nirspi"
    # Of profile dev: its debug assertions fill buffers with NaN, so that a number that no kernel writes is seen.
    # The packages that have tests on a GPU, in one build with one set of features.
    cargo test --locked --no-run --lib -p nirspi-omp -p nirspi-recon -p nirspi-nets --features nirspi-nets/gpu 2>&1 | tee .gpu/log
    local crate built
    for crate in omp recon nets; do
        built=$(sed -n "s/.*(\(.*nirspi_$crate-[0-9a-f]*\)).*/\1/p" .gpu/log)
        strip -o ".gpu/tests-$crate" "$built"
    done
    rm .gpu/log
    # One archive with one dictionary: several of the programs hold the same weights.
    tar -C .gpu -c nirspi tests-omp tests-recon tests-nets | xz --lzma2=preset=9,dict=128MiB >.gpu/programs.tar.xz
    rm .gpu/nirspi .gpu/tests-omp .gpu/tests-recon .gpu/tests-nets
    # As it is: pip would build it, and its compiled helpers are for another variant than ours.
    python3 - <<'END' || echo "skipped: no batched-omp from PyPI, peers.py will say so"
import re, urllib.request
page = urllib.request.urlopen("https://pypi.org/simple/orthogonal-matching-pursuit-gpu/", timeout=60).read().decode()
address = re.search(r'href="([^"#]*/([^"/#]*-0\.1\.3\.tar\.gz))', page)
urllib.request.urlretrieve(address[1], f".gpu/{address[2]}")
END
    local size
    size=$(du -sm .gpu | cut -f1)
    ls -l .gpu
    if [ "$size" -gt "$limit" ]; then
        echo ".gpu/ has $size MiB, expected at most $limit" >&2
        return 1
    fi
}

# Seconds of a part; PART_S in the environment changes them.
part_s=${PART_S:-400}

# left SECONDS NAME: the seconds that a step may take, no more than its part has left; else a line about the step.
left() {
    local seconds=$((ends - SECONDS))
    if [ $seconds -lt 5 ]; then
        echo "skipped: $2, $part_s s of this part are over" | tee -a "$out/summary.txt" >&2
        return 1
    fi
    echo $((seconds < $1 ? seconds : $1))
}

# step NAME SECONDS COMMAND...: runs a command, shows the end of its output and keeps all of it.
step() {
    local name=$1 seconds result=0 began=$SECONDS
    seconds=$(left "$2" "$name") || return
    shift 2
    timeout --kill-after=5 "$seconds" "$@" >"$out/$name.txt" 2>&1 || result=$?
    case $result in
    0) result=passed ;;
    124 | 137) result="stopped after $seconds s" ;;
    *) result="failed with $result" ;;
    esac
    echo "== $name: $result, $((SECONDS - began)) s"
    tail -n "${lines:-15}" "$out/$name.txt"
    echo "$name: $result" >>"$out/summary.txt"
    [ "$result" = passed ]
}

# needs PROGRAM NAME: whether this machine has a program, else a line about the step.
needs() {
    command -v "$1" >/dev/null && return
    echo "skipped: $2, no $1" | tee -a "$out/summary.txt"
    return 1
}

# bench NAME ARGUMENTS...: one line of JSON into OUT/NAME.jsonl, and what matters of it here.
bench() {
    local name=$1 seconds result=0
    shift
    seconds=$(left 60 "$*") || return 0
    timeout --kill-after=5 "$seconds" "$work/nirspi" dev bench "$@" >"$work/report" 2>"$work/error" || result=$?
    case $result in
    0) ;;
    124 | 137)
        echo "$*: stopped after $seconds s" | tee -a "$out/summary.txt"
        return 0
        ;;
    *)
        echo "$*: failed: $(tail -n 2 "$work/error" | tr '\n' ' ')" | tee -a "$out/summary.txt"
        return 0
        ;;
    esac
    tr -d '\n' <"$work/report" >>"$out/$name.jsonl"
    echo >>"$out/$name.jsonl"
    # Notes, such as networks without tensor cores.
    [ ! -s "$work/error" ] || sed 's/^/  /' "$work/error"
    echo "$*: $(grep -E '"(device|first_ms|median_ms|fastest_ms|slowest_ms|frames_per_s|of_fastest_sweeps|solved_in_f64)"' "$work/report" | tr -d '\n' | tr -s ' ')"
}

correctness() {
    local failed=0
    # The same tests as on software Vulkan.
    NIRSPI_TEST_BACKEND=cuda step tests-omp 120 "$work/tests-omp" --nocapture || failed=1
    NIRSPI_TEST_BACKEND=cuda step tests-recon 120 "$work/tests-recon" omp:: --nocapture || failed=1
    step tests-nets 200 "$work/tests-nets" gpu:: networks:: enhance::device --nocapture || failed=1
    if grep -h '^skipped: .*CUDA' "$out/tests-omp.txt" "$out/tests-recon.txt" "$out/tests-nets.txt" | sort | uniq -c | grep .; then
        echo "tests on CUDA: skipped" | tee -a "$out/summary.txt"
        failed=1
    fi
    for precision in f32 f16; do
        step "apart-$precision" 60 python3 host/gpu/benches/apart.py "$work/nirspi" --precision "$precision" || failed=1
    done
    if needs compute-sanitizer memcheck; then
        # Accesses outside buffers: kernels do not check their indices.
        step memcheck 90 compute-sanitizer --tool memcheck --error-exitcode 9 \
            "$work/nirspi" dev bench pipeline --frames 4 --repeats 1 --backend cuda || failed=1
        step memcheck-f16 90 compute-sanitizer --tool memcheck --error-exitcode 9 \
            "$work/nirspi" dev bench enhance --frames 4 --repeats 1 --backend cuda --precision f16 || failed=1
        # Units that do not wait for each other: software Vulkan takes them in turns.
        for precision in f32 f16; do
            step "racecheck-$precision" 120 compute-sanitizer --tool racecheck --error-exitcode 9 \
                "$work/nirspi" dev bench enhance --frames 1 --repeats 1 --backend cuda --no-consistency --precision "$precision" ||
                failed=1
        done
        NIRSPI_TEST_BACKEND=cuda step racecheck-omp 60 compute-sanitizer --tool racecheck --error-exitcode 9 \
            "$work/tests-omp" images_are || failed=1
    fi
    return $failed
}

speed() {
    local precision frames sparsity measurements consistency
    echo "== the first run compiles the kernels, the second one loads them"
    rm -rf "$work/cold"
    for _ in 1 2; do
        NIRSPI_KERNEL_CACHE=$work/cold bench first enhance --frames 64 --repeats 1 --backend cuda --no-consistency
    done
    echo "== networks, from host memory to host memory"
    for precision in f32 f16; do
        for frames in 1 64 256 1024 4096; do
            bench enhance enhance --backend cuda --precision $precision --no-consistency --frames $frames
        done
        bench enhance enhance --backend cuda --precision $precision --frames 4096 --repeats 5
    done
    echo "== OMP and networks, images staying on the GPU: all and half of the patterns"
    for precision in f32 f16; do
        for measurements in 1024 512; do
            for consistency in --no-consistency ""; do
                # shellcheck disable=SC2086 # nothing, or one option
                bench pipeline pipeline --backend cuda --precision $precision --measurements $measurements --frames 4096 \
                    --repeats 3 $consistency
            done
        done
    done
    bench pipeline pipeline --backend cuda --frames 1

    echo "== OMP, with the transfer of measurements, solutions and images"
    for precision in f32 auto; do
        for frames in 1 64 256 1024 4096 16384; do
            bench omp omp --backend cuda --precision $precision --frames $frames
        done
    done
    for sparsity in 16 256; do
        for frames in 1 1024; do
            bench omp omp --backend cuda --precision f32 --sparsity $sparsity --frames $frames
        done
    done
    # The processor beside, for the number of frames from which `auto` takes a GPU.
    for frames in 1 64 4096; do bench omp omp --backend cpu --precision f32 --frames $frames; done
}

peers() {
    local precision frames
    echo "== our networks, on the same card"
    for precision in f32 f16; do
        for frames in 1 4096; do
            bench enhance enhance --backend cuda --precision $precision --no-consistency --frames $frames
        done
    done
    if needs python3 peer; then
        echo "== the same networks in PyTorch on the same card"
        for frames in 1 4096; do
            lines=40 step "peer-$frames" 60 python3 host/nets/scripts/peer.py --device cuda --frames $frames || true
        done
        lines=40 step peer-graph 60 python3 host/nets/scripts/peer.py --device cuda --frames 4096 --compile graph || true
        lines=40 step peer-graph-1024 60 \
            python3 host/nets/scripts/peer.py --device cuda --frames 4096 --batch 1024 --compile graph || true
        lines=40 step peer-max-autotune 150 \
            python3 host/nets/scripts/peer.py --device cuda --frames 4096 --compile max-autotune || true
    fi

    if needs python3 batched-omp && tar -xzf .gpu/orthogonal_matching_pursuit_gpu-*.tar.gz -C "$work"; then
        echo "== batched-omp on the same card"
        PYTHONPATH=$(echo "$work"/orthogonal_matching_pursuit_gpu-*/src) \
            step peers-omp 90 python3 host/recon/benches/peers.py --device cuda --nirspi "$work/nirspi" --rounds 3 \
            --json "$out/peers-omp.json" || true
    fi
}

profile() {
    local precision
    for precision in f32 f16; do
        local what=("$work/nirspi" dev bench enhance --frames 256 --repeats 1 --backend cuda --no-consistency --precision "$precision")
        if needs ncu "ncu-$precision" && needs python3 "kernels-$precision"; then
            # Every kernel, those of the comparison with the plain ones too. The clock is left as it is.
            step "ncu-$precision" 150 ncu --clock-control none --metrics "$(metrics)" --csv --page raw \
                --log-file "$out/ncu-$precision.csv" "${what[@]}" || true
            lines=60 step "kernels-$precision" 10 python3 host/gpu/benches/kernels.py "$out/ncu-$precision.csv" || true
        fi
    done
}

# Time, share of the time in which the f32 units work, warps, registers: names that ncu 2025.3 knows for an H100.
metrics() {
    local all=(
        gpu__time_duration.sum
        sm__inst_executed_pipe_fma.avg.pct_of_peak_sustained_active
        sm__warps_active.avg.pct_of_peak_sustained_active
        launch__registers_per_thread
    )
    local IFS=,
    echo "${all[*]}"
}

run() {
    out=$1
    shift
    local part result=0
    mkdir -p "$out"
    out=$(cd "$out" && pwd)
    : >"$out/summary.txt"
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    tar -xJf .gpu/programs.tar.xz -C "$work"
    # NVRTC is looked for by name: CUDA's own folder is seldom among those searched.
    export LD_LIBRARY_PATH=${CUDA_PATH:-/usr/local/cuda}/lib64${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
    export PATH=$PATH:${CUDA_PATH:-/usr/local/cuda}/bin
    # Kernels are compiled once for all steps.
    export NIRSPI_KERNEL_CACHE=$work/kernels
    nvidia-smi 2>&1 | tee "$out/nvidia-smi.txt" || true
    if [ $# = 0 ]; then set -- correctness speed peers profile; fi
    for part; do
        echo "== $part ($(date -u +%H:%M:%S))"
        ends=$((SECONDS + part_s))
        "$part" || result=1
    done
    echo "== all steps ($(date -u +%H:%M:%S))"
    cat "$out/summary.txt"
    return $result
}

usage() {
    sed -n '3,15s/^# *//p' "$0"
    exit 2
}

case ${1-} in
pack) pack ;;
run)
    [ -n "${2-}" ] || usage
    for part in "${@:3}"; do
        case $part in correctness | speed | peers | profile) ;; *) usage ;; esac
    done
    run "${@:2}"
    ;;
*) usage ;;
esac
