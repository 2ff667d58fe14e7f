#!/usr/bin/env bash
# Makes the pictures of the pages anew: docs/pictures.sh [quick | long | all] [DATA]
#
# quick (default): the pictures of `nirspi` commands, a minute. long: those of studies on DATA (docs/data.md; default
# $NIRSPI_DATA), about an hour on two cores. Notebooks: .ci/run python with NIRSPI_BLESS=1. docs/serve.png and docs/browser.png:
# host/cli/tests/browser/check.py and host/web/build.sh.
# First: cargo build --release, and for long: cargo build --release -p nirspi-eval --examples. NIRSPI_CLI is another program
# than that of the target folder; its examples lie beside it.
set -euo pipefail
cd "$(dirname "$0")/.."
docs=$PWD/docs
what=${1:-quick}
data=${2:-${NIRSPI_DATA:-}}
target=${CARGO_TARGET_DIR:-target}
nirspi=$(realpath "${NIRSPI_CLI:-$target/release/nirspi}")
examples=$(dirname "$nirspi")/examples
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Commands are as the gallery names them: pictures state them.
quick() {
    cd "$work"
    "$nirspi" demo
    cp demo/side_by_side.png "$docs/demo.png"
    "$nirspi" demo --sampling 0.25 --out out/quarter
    cp out/quarter/side_by_side.png "$docs/how-it-works/quarter.png"
    "$nirspi" demo --distance-m 0.6 --light 100ms --out out/far
    cp out/far/side_by_side.png "$docs/how-it-works/distance.png"
    "$nirspi" demo --scene word:STOP --rain heavy --out out/word
    cp out/word/side_by_side.png "$docs/gallery/word.png"
    "$nirspi" capture --scene word:HI --frames 60 --out hi.mcap --picture out/hi
    cp out/hi/enhanced.png "$docs/gallery/capture.png"
    "$nirspi" example wing --out wing.npz
    "$nirspi" inspect wing.npz --out ways.png
    cp ways.png "$docs/gallery/ways.png"
    "$nirspi" physics range --out out/range
    cp out/range/{resolution,snr,assumptions}.png "$docs/cameras"
    "$nirspi" physics rain --out out/rain
    cp out/rain/extinction_rate.png "$docs/gallery/rain.png"
}

long() {
    [ -n "$data" ] || { echo "expected DATA, or NIRSPI_DATA"; exit 2; }
    data=$(realpath "$data")
    cd "$work"
    "$examples/video" video
    cp video/{video,video_curves}.png video/image.apng "$docs/reconstruction"
    mv "$docs/reconstruction/image.apng" "$docs/reconstruction/video.apng"
    "$examples/trust" judge "$data" "$docs/../host/nets/weights/intervals.json" trust
    cp trust/{coverage,intervals}.png "$docs/quality"
    # Measurements with a known order: those of random patterns have none.
    mkdir spi
    for file in "$data"/spi/*.npz; do
        case $file in */random_*) ;; *) ln -s "$file" spi/ ;; esac
    done
    "$nirspi" eval quality --count 100 --sampler-count 8 --data "$data/chars74k" --scenes "$data/scenes" \
        --spi spi --out quality
    cp quality/{blur,noise,steps,others}.png "$docs/quality"
    "$examples/learned_prior" "$data" prior natural pictures
    cp prior/{prior_curves,prior_pictures}.png "$docs/reconstruction"
}

case $what in
    quick) (quick) ;;
    long) (long) ;;
    all) (quick) && (long) ;;
    *) echo "expected quick, long or all, found $what"; exit 2 ;;
esac
