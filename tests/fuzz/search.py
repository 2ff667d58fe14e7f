"""Searches for bytes that break a law of a reader: bash .ci/run fuzz

    python3 tests/fuzz/search.py [LAW...]           FUZZ_S seconds a law (4), all laws by default
    python3 tests/fuzz/search.py --try FILE LAW     tries one input, and prints what breaks

Builds the search with counters on stable Rust, tries each law's seeds and the inputs in found/LAW that once broke it, then
searches. A finding ends the run with one line: the law, the file, and how to try it again. Otherwise prints a table for
docs/log/security.md. What reached new code is kept in target/fuzz/LAW for the next run.
"""

import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TARGET = ROOT / "target" / "fuzz"
FOUND = HERE / "found"
# As cargo-fuzz on nightly Rust, less the sanitizer: the passes that count edges are in every compiler.
FLAGS = """--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
    -Cllvm-args=-sanitizer-coverage-trace-compares"""
# The longest time of one input in seconds, on a busy machine.
PATIENCE_S = 20
# Memory of the process in MiB. Each law's own bound is smaller.
MEMORY_MIB = 4096


def build() -> pathlib.Path:
    """The search, with counters in every crate but build scripts and macros."""
    host = re.search("host: (.*)", subprocess.check_output(["rustc", "-vV"], text=True))[1]
    environment = os.environ | {
        "RUSTFLAGS": " ".join(FLAGS.split()),
        "CARGO_TARGET_DIR": str(TARGET / "build"),
        # Edges are told apart by their lines, which CI's own setting leaves out.
        "CARGO_PROFILE_DEV_DEBUG": "line-tables-only",
    }
    command = ["cargo", "build", "--locked", "--target", host, "--manifest-path", str(HERE / "Cargo.toml")]
    subprocess.run(command, env=environment, check=True)
    return TARGET / "build" / host / "debug" / "search"


class Law:
    """A law, and what the search has done for it."""

    def __init__(self, line: str, search: pathlib.Path):
        self.name, self.reads, self.longest, readers = line.split("\t")
        self.readers = readers.split()
        for reader in self.readers:
            if not (ROOT / reader).is_file():
                sys.exit(f"the law {self.name} names {reader}, which is not there")
        self.search = search
        self.corpus = TARGET / self.name
        self.seconds = 0.0
        self.executions = 0
        self.problem = None

    def run(self, *arguments: str, **more: str) -> subprocess.CompletedProcess:
        """Runs the search of this law."""
        environment = os.environ | {"FUZZ_LAW": self.name, "RAYON_NUM_THREADS": "1"} | more
        command = [self.search, *arguments]
        memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
        with tempfile.TemporaryDirectory(prefix="nirspi-fuzz-", dir=memory) as place:
            environment["FUZZ_PLACE"] = place
            return subprocess.run(
                command, check=False, env=environment, capture_output=True, text=True, errors="replace"
            )

    def explore(self, seconds: int) -> None:
        """Tries seeds and known findings, then searches."""
        self.corpus.mkdir(parents=True, exist_ok=True)
        self.run(FUZZ_SEEDS=str(self.corpus)).check_returncode()
        findings = TARGET / "findings"
        findings.mkdir(exist_ok=True)
        folders = [str(self.corpus)] + [str(folder) for folder in [FOUND / self.name] if folder.is_dir()]
        begun = time.monotonic()
        done = self.run(
            f"-max_total_time={seconds}",
            f"-timeout={PATIENCE_S}",
            f"-rss_limit_mb={MEMORY_MIB}",
            f"-max_len={self.longest}",
            f"-artifact_prefix={findings}/{self.name}-",
            "-print_final_stats=1",
            *folders,
        )
        self.seconds = time.monotonic() - begun
        counted = re.search(r"number_of_executed_units: (\d+)", done.stderr)
        self.executions = int(counted[1]) if counted else 0
        if done.returncode:
            self.problem = self.told(done.stderr)

    def told(self, log: str) -> str:
        """One line about a finding."""
        saved = re.search(r"Test unit written to (\S+)", log)
        panicked = re.search(r"panicked at ([^\n]*):\n([^\n]*)", log)
        ended = re.search(r"ERROR: libFuzzer: ([^\n]*)", log)
        what = f"{panicked[1]}: {panicked[2]}" if panicked else ended[1] if ended else log[-300:].replace("\n", " ")
        file = saved[1] if saved else "no file"
        again = f"python3 tests/fuzz/search.py --try {file} {self.name}"
        return f"fuzz: law {self.name}, after {self.seconds:.0f} s: {what[:300]}; {file}; again: {again}"

    def edges(self) -> dict[str, bool]:
        """The program's edges by address, and whether an input of the corpus reaches them."""
        file = TARGET / f"{self.name}.edges"
        folders = [str(self.corpus)] + [str(folder) for folder in [FOUND / self.name] if folder.is_dir()]
        self.run(*folders, FUZZ_REACHED=str(file)).check_returncode()
        pairs = (line.split() for line in file.read_text().splitlines())
        return {address: reached == "1" for address, reached in pairs}


def sources(search: pathlib.Path, addresses: list[str]) -> dict[str, str]:
    """The source file of each address, by binutils."""
    tool = shutil.which("addr2line")
    if not tool:
        return {}
    done = subprocess.run([tool, "-e", search], input="\n".join(addresses), capture_output=True, text=True, check=True)
    return dict(zip(addresses, (line.rsplit(":", 1)[0] for line in done.stdout.splitlines())))


def table(laws: list[Law]) -> None:
    """Prints what each law has done and how far it has got."""
    reached = {law.name: law.edges() for law in laws}
    files = sources(laws[0].search, list(next(iter(reached.values()))))
    print("| law | reads | seconds | inputs tried | edges of the reader reached | of |")
    print("| -- | -- | -- | -- | -- | -- |")
    for law in laws:
        of_reader = {a for a, file in files.items() if any(file.endswith("/" + reader) for reader in law.readers)}
        known = sum(reached[law.name][address] for address in of_reader)
        share = f"{known} ({100 * known // len(of_reader)} %) | {len(of_reader)}" if of_reader else "- | -"
        print(f"| `{law.name}` | {law.reads} | {law.seconds:.0f} | {law.executions} | {share} |")


def main() -> None:
    """Searches, or tries one input."""
    search = build()
    listed = subprocess.run([search], env=os.environ | {"FUZZ_LAW": "list"}, capture_output=True, text=True, check=True)
    laws = [Law(line, search) for line in listed.stdout.splitlines()]
    if sys.argv[1:2] == ["--try"]:
        file, name = sys.argv[2:]
        law = next(law for law in laws if law.name == name)
        done = law.run(file)
        print(done.stderr)
        sys.exit(done.returncode)
    chosen = [law for law in laws if law.name in sys.argv[1:] or len(sys.argv) == 1]
    unknown = set(sys.argv[1:]) - {law.name for law in laws}
    if unknown:
        sys.exit(f"fuzz: no law {', '.join(sorted(unknown))}; the laws: {', '.join(law.name for law in laws)}")
    seconds = int(os.environ.get("FUZZ_S", "4"))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda law: law.explore(seconds), chosen))
    problems = [law.problem for law in chosen if law.problem]
    if problems:
        sys.exit("\n".join(problems))
    table(chosen)


if __name__ == "__main__":
    main()
