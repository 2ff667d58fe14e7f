#!/usr/bin/env bash
# Checks that the fork is the release with differences.patch, and nothing else:
#   bash boards/otg/check.sh [RELEASE]     with RELEASE, the unpacked crate, writes differences.patch anew
set -euo pipefail
cd "$(dirname "$0")"
if [ $# = 1 ]; then
    for file in lib.rs otg_v1.rs; do
        git diff --no-index --no-prefix "$1/src/$file" "src/$file" | sed -E "s#^(diff --git|---|\+\+\+) .*#&#; /^(diff --git|index) /d; s#^--- .*#--- a/src/$file#; s#^\+\+\+ .*#+++ b/src/$file#" || true
    done >differences.patch
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r src "$work/src"
cp differences.patch "$work"
cd "$work"
git init -q
git apply -R differences.patch
# SHA-256 of the files in the crate embassy-usb-synopsys-otg 0.3.3 of crates.io.
sha256sum --quiet --check <<'SUMS'
7cdcdc95ddd564ea0f3f465be6b4ccb09a4fac3a1557f7d67e3767c982a8c4af  src/lib.rs
00766c3a77f2f51862a0f70b925eef2c1b4430f98151c118f57dfcbc021a01f0  src/otg_v1.rs
29efbba075d0bcf8acd4c3f3228bbe5ab3be735c48d3894c86a957d15bab0f12  src/fmt.rs
SUMS
echo "the fork is release 0.3.3 with differences.patch"
