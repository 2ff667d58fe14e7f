"""Writes Cargo.toml beside this file: features of dependencies that a plain `cargo test` shares with the RTL's tests.

Cargo chooses the features of a dependency by the packages that a command names. The hardware simulator asks for more
features than the host does, so `.ci/run rtl` would compile the host's crates again. `nirspi-tests` depends on this package,
so both choose the same. Out of date, the list costs that step time and nothing else; run this again after dependencies
change:

    python3 tests/features/generate.py

cargo-hakari makes such lists too, for all features of a workspace at once: a plain `cargo test` would then compile what
belongs to the feature `flash`.
"""

import collections
import json
import os
import pathlib
import re
import subprocess
import sys

FOLDER = pathlib.Path(__file__).parent
WHOLE = ["test"]
RTL = ["-p", "nirspi-hdl-sim", "-p", "nirspi-tests-rtl", "--test", "rtl", "--test", "co_simulation"]
HEAD = """\
# Written by generate.py, which says what it is for.
[package]
name = "nirspi-tests-features"
description = "Features of dependencies that builds of the parts share"
version.workspace = true
edition.workspace = true
rust-version.workspace = true
license.workspace = true
repository.workspace = true
publish = false

[lints]
workspace = true
"""


def units(command):
    """What the command would compile: cargo's unit graph, which only its nightly versions print by themselves."""
    asked = ["cargo", *command, "-Z", "unstable-options", "--unit-graph"]
    environment = dict(os.environ, RUSTC_BOOTSTRAP="1")
    root = FOLDER.parents[1]
    done = subprocess.run(asked, cwd=root, env=environment, capture_output=True, check=False, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout)["units"]


def default_packages():
    """`-p` and its name for each package of a plain `cargo test`."""
    asked = ["bash", "-c", ". .ci/steps.sh; default_packages"]
    return subprocess.run(asked, cwd=FOLDER.parents[1], capture_output=True, check=True, text=True).stdout.split()


def features(graph):
    """Sets of features of each package of a registry: of those in programs, and of those that run in builds."""
    reached = {"dependencies": set(), "build-dependencies": set()}

    def walk(index, kind):
        if index in reached[kind]:
            return
        reached[kind].add(index)
        for dependency in graph[index]["dependencies"]:
            runs = graph[dependency["index"]]["target"]["kind"][0] in ("proc-macro", "custom-build")
            walk(dependency["index"], "build-dependencies" if runs else kind)

    for index, unit in enumerate(graph):
        if unit["pkg_id"].startswith("path") and unit["target"]["kind"] != ["custom-build"]:
            walk(index, "dependencies")
    found = {kind: collections.defaultdict(set) for kind in reached}
    for kind, indices in reached.items():
        for unit in (graph[index] for index in indices):
            is_library = unit["target"]["kind"][0] in ("lib", "proc-macro") and unit["mode"] == "build"
            if is_library and unit["pkg_id"].startswith("registry"):
                package = re.search(r"#(.+)@([0-9.]+)", unit["pkg_id"]).groups()
                found[kind][package].add(frozenset(unit["features"]))
    return found


def lines(packages):
    names = collections.Counter(name for name, _ in packages)
    for (name, version), wanted in sorted(packages.items()):
        # What semantic versioning holds to be compatible.
        version = re.match(r"0\.0\.\d+|0\.\d+|\d+", version).group()
        key, package = name, ""
        if names[name] > 1:
            key, package = f"{name}-{version.replace('.', '-')}", f'package = "{name}", '
        yield f'{key} = {{ {package}version = "{version}", default-features = false, features = {json.dumps(sorted(wanted))} }}'


def write(chosen):
    text = HEAD
    for kind, packages in chosen.items():
        # Found on Linux; elsewhere the parts need other packages.
        text += f"\n[target.'cfg(target_os = \"linux\")'.{kind}]\n" + "".join(f"{line}\n" for line in lines(packages))
    (FOLDER / "Cargo.toml").write_text(text)


chosen = {"dependencies": {}, "build-dependencies": {}}
write(chosen)
# Each feature may bring others, so until nothing changes.
while True:
    builds = [features(units(command)) for command in [WHOLE, ["test", *default_packages(), *RTL]]]
    before = {kind: dict(packages) for kind, packages in chosen.items()}
    for kind, packages in chosen.items():
        for package in builds[0][kind]:
            sets = set().union(*(build[kind].get(package, set()) for build in builds))
            if len(sets) > 1:
                packages[package] = frozenset().union(*sets)
    if chosen == before:
        break
    write(chosen)
print(*(f"{len(packages)} {kind}" for kind, packages in chosen.items()), sep=", ")
