#!/usr/bin/env bash
# Finds qemu-system-arm, or gets it on Debian and Ubuntu, and prints its path. apt-get installs it where that removes
# nothing; else the packages are unpacked into target/qemu, where the tests look too. For CI; by hand any QEMU >= 7.2 does.
set -euo pipefail
cd "$(dirname "$0")/../.."

if command -v qemu-system-arm; then
    exit
fi
unpacked=$PWD/target/qemu/qemu-system-arm
if [ -x "$unpacked" ]; then
    echo "$unpacked"
    exit
fi
if [ "$(id -u)" = 0 ] && ! apt-get install --simulate --no-install-recommends qemu-system-arm | grep -q '^Remv'; then
    apt-get install --yes --no-install-recommends qemu-system-arm >&2
    command -v qemu-system-arm
    exit
fi

mkdir -p target/qemu/packages
cd target/qemu/packages
wanted=(qemu-system-arm)
# Until no library is missing: each package unpacked may ask for more.
for _ in 1 2 3 4 5; do
    apt-get download "${wanted[@]}" >&2
    for package in *.deb; do
        dpkg-deb -x "$package" ../root
    done
    missing=$(LD_LIBRARY_PATH=../root/usr/lib/$(uname -m)-linux-gnu:../root/lib/$(uname -m)-linux-gnu \
        ldd ../root/usr/bin/qemu-system-arm | sed -n 's/^\s*\(\S*\) => not found/\1/p' | sort -u)
    [ -z "$missing" ] && break
    # libfoo.so.1 is in libfoo1, libfoo-1.so.2 in libfoo-1-2: what depends on it says which.
    mapfile -t wanted < <(apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks \
        --no-replaces --no-enhances qemu-system-arm | grep -o '^lib\S*' | sort -u | while read -r package; do
        for library in $missing; do
            stem=${library%%.so.*}
            number=${library##*.so.}
            case $package in "$stem$number" | "$stem-$number") echo "$package" ;; esac
        done
    done)
done
cat >"$unpacked" <<'WRAPPER'
#!/bin/sh
root=$(dirname "$(readlink -f "$0")")/root
machine=$(uname -m)-linux-gnu
export LD_LIBRARY_PATH="$root/usr/lib/$machine:$root/lib/$machine"
exec "$root/usr/bin/qemu-system-arm" -L "$root/usr/share/qemu" "$@"
WRAPPER
chmod +x "$unpacked"
"$unpacked" --version >&2
echo "$unpacked"
