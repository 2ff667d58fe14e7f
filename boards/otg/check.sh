#!/usr/bin/env bash
# Checks that src/lib.rs is the release's with differences.patch, and nothing else:
#   bash boards/otg/check.sh [RELEASE]     with RELEASE, the unpacked crate, writes differences.patch anew
set -euo pipefail
cd "$(dirname "$0")"
if [ $# = 1 ]; then
    git diff --no-index --no-prefix "$1/src/lib.rs" src/lib.rs | sed -E "/^(diff --git|index) /d; s#^--- .*#--- a/src/lib.rs#; s#^\+\+\+ .*#+++ b/src/lib.rs#" >differences.patch || true
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r src "$work/src"
cp differences.patch "$work"
cd "$work"
git init -q
git apply -R differences.patch
# SHA-256 of the file in the crate embassy-usb-synopsys-otg 0.3.3 of crates.io.
sha256sum --quiet --check <<'SUMS'
7cdcdc95ddd564ea0f3f465be6b4ccb09a4fac3a1557f7d67e3767c982a8c4af  src/lib.rs
SUMS
echo "src/lib.rs is that of release 0.3.3 with differences.patch"
