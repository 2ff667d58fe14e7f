"""Which lines of each reader its random tests reach: bash .ci/run coverage

Every place where bytes come in has tests with random or damaged bytes that run on stable Rust. This runs the tests of each
place alone, in a build that counts lines, and prints a table for docs/log/security.md. Needs rustup's component llvm-tools.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = ROOT / "target" / "coverage"

# What comes in; the tests, as package, test binary (None: the unit tests) and filter; the files that read it.
PLACES = [
    (
        "packets, on both sides",
        [("nirspi-wire", "wire", "packets::any_bytes"), ("nirspi-wire", None, "any_bytes")],
        ["mcu/wire/src/packet.rs", "mcu/wire/src/stuffing.rs", "mcu/wire/src/samples.rs"],
    ),
    (
        "commands and register accesses at any time",
        [("nirspi-mcu", None, "nothing_panics")],
        ["mcu/src/commands.rs", "mcu/src/configure.rs", "mcu/src/machine.rs", "mcu/src/poll.rs", "mcu/src/run.rs"],
    ),
    ("requests of the tunnel", [("nirspi-tests", "all", "mutated_files::requests_of")], ["mcu/wire/src/tunnel.rs"]),
    (
        "order tables, tables of numbers",
        [("nirspi-tests", "all", "mutated_files::order_tables")],
        ["host/src/order_table.rs", "host/files/src/table.rs"],
    ),
    (
        "camera descriptions",
        [("nirspi-tests", "all", "mutated_files::camera_descriptions")],
        ["host/virtual/src/model.rs"],
    ),
    (
        "calibrations",
        [("nirspi-tests", "all", "mutated_files::calibrations")],
        ["host/camera/src/calibration/kept.rs", "host/camera/src/calibration/file.rs"],
    ),
    (
        "pictures",
        [("nirspi-tests", "all", "mutated_files::pictures"), ("nirspi-files", None, "image::tests::no_damage")],
        ["host/files/src/image.rs"],
    ),
    (
        "arrays",
        [
            ("nirspi-tests", "all", "mutated_files::pictures"),
            ("nirspi-files", None, "makes_the_reader_panic"),
        ],
        ["host/files/src/array.rs", "host/files/src/npy.rs"],
    ),
    (
        "measurements",
        [("nirspi-tests", "all", "mutated_files::measurements"), ("nirspi-files", None, "fields::tests")],
        [
            "host/files/src/archive.rs",
            "host/files/src/fields.rs",
            "host/files/src/hdf5.rs",
            "host/files/src/mat.rs",
            "host/files/src/mat4.rs",
            "host/files/src/text.rs",
            "host/files/src/measurement/layout.rs",
            "host/files/src/measurement/opened.rs",
            "host/files/src/measurement/plain.rs",
            "host/files/src/measurement/readings.rs",
            "host/files/src/measurement/rows.rs",
        ],
    ),
    (
        "recordings",
        [("nirspi-tests", "all", "mutated_files::recordings"), ("nirspi-record", None, "any_bytes_are_scanned")],
        ["host/record/src/recording/reader.rs", "host/record/src/recording/scan.rs", "host/record/src/recording/run.rs", "host/camera/src/tally.rs"],
    ),
    ("weights of networks", [("nirspi-tests", "all", "mutated_files::weights")], ["host/nets/src/weights.rs"]),
    ("settings that a page sends", [("nirspi-tests", "all", "mutated_files::what_a_page")], ["host/serve/src/settings.rs"]),
    ("bitstreams", [("nirspi-tests", "all", "mutated_files::bitstreams")], ["mcu/src/staging.rs"]),
]


def tools() -> pathlib.Path:
    """The folder of the compiler's own llvm-profdata and llvm-cov."""
    root = subprocess.check_output(["rustc", "--print", "sysroot"], text=True).strip()
    host = re.search("host: (.*)", subprocess.check_output(["rustc", "-vV"], text=True))[1]
    return pathlib.Path(root) / "lib/rustlib" / host / "bin"


def build() -> dict[tuple[str, str | None], str]:
    """The test binaries, by package and name of the test program."""
    wanted = {(package, binary) for _, tests, _ in PLACES for package, binary, _ in tests}
    command = ["cargo", "test", "--locked", "--no-run", "--message-format=json-render-diagnostics", "--lib"]
    command += [part for _, binary in sorted(wanted, key=str) if binary for part in ("--test", binary)]
    found = {}
    # All at once, so that each dependency has one set of features.
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    for line in done.stdout.splitlines():
        message = json.loads(line)
        if message.get("reason") != "compiler-artifact" or not message.get("executable"):
            continue
        # path+file:///folder#name@version, or without the name where the folder has the same.
        package = re.search(r"([a-z-]+)[@#][^@#/]*$", message["package_id"])[1]
        is_unit = "lib" in message["target"]["kind"]
        key = (package, None if is_unit else message["target"]["name"])
        if key in wanted and message["profile"]["test"]:
            found[key] = message["executable"]
    missing = wanted - found.keys()
    if missing:
        sys.exit(f"coverage: no test binary for {sorted(map(str, missing))}")
    return found


def reached(binaries: list[tuple[str, str]], sources: list[str]) -> tuple[int, int]:
    """Lines of these files that the tests reach, and all that there are."""
    counts = TARGET / "counts"
    shutil.rmtree(counts, ignore_errors=True)
    environment = os.environ | {"LLVM_PROFILE_FILE": str(counts / "%p-%m.profraw")}
    for binary, only in binaries:
        run = [binary, only, "--quiet"]
        done = subprocess.run(
            run, check=False, cwd=ROOT / "tests", env=environment, stdout=subprocess.PIPE, text=True
        )
        passed = re.search(r"(\d+) passed", done.stdout)
        if done.returncode or not passed or passed[1] == "0":
            sys.exit(f"coverage: {' '.join(run)}: expected a passing test, found {done.stdout[-400:]}")
    merged = counts / "merged.profdata"
    raw = [str(path) for path in counts.glob("*.profraw")]
    subprocess.run([tools() / "llvm-profdata", "merge", "--sparse", *raw, "-o", merged], check=True)
    names = [binary for binary, _ in binaries]
    objects = [part for name in names[1:] for part in ("--object", name)]
    report = [tools() / "llvm-cov", "export", "--summary-only", "--instr-profile", merged, names[0], *objects]
    files = [str(ROOT / source) for source in sources]
    told = subprocess.run([*report, "--sources", *files], stdout=subprocess.PIPE, text=True, check=True)
    lines = json.loads(told.stdout)["data"][0]["totals"]["lines"]
    return lines["covered"], lines["count"]


def main() -> None:
    os.environ["CARGO_TARGET_DIR"] = str(TARGET)
    os.environ["RUSTFLAGS"] = "-C instrument-coverage"
    # Build scripts and macros are counted too, and their counts are of no use.
    os.environ["LLVM_PROFILE_FILE"] = str(TARGET / "build-%m.profraw")
    binaries = build()
    print("| bytes | tests | lines reached | of |\n| -- | -- | -- | -- |")
    for what, tests, sources in PLACES:
        covered, count = reached([(binaries[package, binary], only) for package, binary, only in tests], sources)
        names = ", ".join(f"`{package}`: `{only}`" for package, _, only in tests)
        print(f"| {what} | {names} | {covered} ({100 * covered / count:.0f} %) | {count} |", flush=True)


main()
