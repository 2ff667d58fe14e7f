"""Prints how large the project is, beside the sizes that it is meant to have at most.

usage: python3 tests/size.py

Lines are lines of Rust in files that git knows. Those without tests leave out folders and files named `tests` or `testing`,
the files of every module behind `#[cfg(test)]`, and what stands behind `#[cfg(test)] mod tests {`. A locked crate is a name
in a Cargo.lock. That no two modules and no two crates use each other is a test: tests/tests/dependencies.rs.
"""
import pathlib
import re
import subprocess
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\n(?:pub(?:\(.*\))? )?mod (\w+);")
TESTS = re.compile(r"\n#\[cfg\(test\)\]\n(?:pub\(crate\) )?mod tests \{")


def tracked(*patterns: str) -> list[pathlib.Path]:
    """The files that git knows."""
    command = ["git", "ls-files", "-z", "--", *patterns]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    return [ROOT / name for name in names if name]


def test_modules(file: pathlib.Path) -> set[pathlib.Path]:
    """The modules of a file that are compiled for tests alone: each one's file without `.rs`, or its folder."""
    folder = file.parent if file.stem in ("lib", "main", "mod") else file.with_suffix("")
    return {folder / name for name in TEST_MODULE.findall(file.read_text())}


def lines_without_tests(crate: pathlib.Path) -> int:
    """Lines of a crate's sources."""
    files = tracked(f"{crate}/src/*.rs")
    tests = set().union(*map(test_modules, files))

    def is_test(file: pathlib.Path) -> bool:
        path = file.with_suffix("")
        named = {"tests", "testing"} & set(path.relative_to(ROOT / crate).parts)
        return bool(named) or not tests.isdisjoint({path, *path.parents})

    files = [file for file in files if not is_test(file)]
    return sum(TESTS.split(file.read_text())[0].count("\n") for file in files)


def main() -> None:
    manifests = {file: tomllib.loads(file.read_text()) for file in tracked("*Cargo.toml")}
    crates = [file.parent.relative_to(ROOT) for file, manifest in manifests.items() if "package" in manifest]
    # A crate whose folder holds others, such as `host`, has its own lines in `src`.
    sizes = sorted(((lines_without_tests(crate), str(crate)) for crate in crates), reverse=True)
    locked = {name for file in tracked("*Cargo.lock") for name in re.findall(r'(?m)^name = "(.*)"$', file.read_text())}
    found = [
        ("lines of Rust, with tests", sum(file.read_text().count("\n") for file in tracked("*.rs")), 150_000),
        (f"lines of the largest crate, {sizes[0][1]}, without tests", sizes[0][0], 12_000),
        ("locked crates, all workspaces", len(locked), 780),
        ("features declared", sum(len(manifest.get("features", {})) for manifest in manifests.values()), 25),
    ]
    for what, size, most in found:
        print(f"{size:8}  {what}; meant to be at most {most}")
    for size, crate in sizes:
        print(f"{size:8}  {crate}")


main()
