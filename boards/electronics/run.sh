#!/usr/bin/env bash
# The electronics, as far as simulation goes: ngspice decks beside the simulator's constants, and the 8 x 8 tile's
# netlist under its rules. What is missing on this machine is skipped aloud. Computed, never built.
#
#   bash boards/electronics/run.sh            compare; 1 if a figure is off, a rule is broken or a file is stale
#   bash boards/electronics/run.sh --write    write camera.toml, the README's table, step.svg, tile.net.txt and bom.csv
set -euo pipefail
cd "$(dirname "$0")/../.."
export PYTHONDONTWRITEBYTECODE=1
failed=0

if ! command -v ngspice >/dev/null; then
    echo "skipped: the decks, no ngspice (Debian: apt-get install ngspice)"
elif ! python3 -c 'import tomllib' 2>/dev/null; then
    echo "skipped: the decks, Python is older than 3.11"
else
    python3 boards/electronics/check.py "$@" || failed=1
fi

venv=target/skidl
if ! ls "$venv"/lib/python*/site-packages/skidl/__init__.py >/dev/null 2>&1; then
    { python3 -m venv "$venv" && "$venv/bin/pip" install --quiet skidl==3.0.0; } || rm -rf "$venv"
fi
if [ -x "$venv/bin/python" ]; then
    "$venv/bin/python" boards/electronics/tile.py "$@" || failed=1
else
    echo "skipped: the tile, skidl cannot be had from PyPI"
fi
exit "$failed"
