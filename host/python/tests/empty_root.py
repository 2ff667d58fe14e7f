"""Runs a wheel, and the program, where nothing is installed.

    python3 empty_root.py WHEEL [PROGRAM]

For Linux alone. Both run in a root folder that holds Python, NumPy and their libraries: no /proc, no /dev, no shell,
no compiler, and no library beyond those of Python and of manylinux. The program uses none of Python's. The script
needs the right to `chroot`, as root or by `unshare`. It exits with 1 if something does not run.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import venv

# Libraries that every manylinux wheel may use. Python brings the others of its own.
MANYLINUX = ("libdl.so.2", "libgcc_s.so.1", "libm.so.6", "libpthread.so.0", "librt.so.1", "libstdc++.so.6")

SCRIPT = """
import numpy as np
import nirspi as ns

with ns.Camera("virtual", scene="letter:R", sampling=0.5) as camera:
    measurement = camera.capture(40)
image = ns.reconstruct(measurement, method="tv")
print(image.shape, image.report["words"])
assert image.shape == (32, 32) and image.std() > 0
"""


def libraries(*files):
    """The shared libraries that these need, and the loader."""
    found = set()
    for file in files:
        said = subprocess.run(["ldd", file], capture_output=True, text=True).stdout
        found |= {word for word in said.split() if word.startswith("/")}
    return {path.rstrip(":") for path in found}


def copy(path, root):
    """Copies a file to the same place below the root, and what a link names."""
    place = root / str(path).lstrip("/")
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, place)


def python_into(root):
    """Python itself, with its library and what its modules need."""
    base = pathlib.Path(sys.base_prefix)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    library = base / "lib" / version
    leave = shutil.ignore_patterns(
        "__pycache__", "site-packages", "dist-packages", "test", "idlelib", "*.a", "config-*"
    )
    shutil.copytree(library, root / str(library).lstrip("/"), ignore=leave)
    interpreter = pathlib.Path(os.path.realpath(sys.executable))
    copy(interpreter, root)
    for path in libraries(interpreter, *library.glob("lib-dynload/*.so")):
        copy(path, root)


def manylinux_into(root, near):
    """The few libraries that a manylinux wheel may expect beside Python's."""
    for folder in {pathlib.Path(path).parent for path in near}:
        for name in MANYLINUX:
            if (folder / name).exists():
                copy(folder / name, root)


def inside(root, *command):
    """Runs a command in the root."""
    enter = ["chroot"] if os.geteuid() == 0 else ["unshare", "--map-root-user", "chroot"]
    environment = {"PATH": "", "HOME": "/tmp", "LC_ALL": "C.UTF-8"}
    # The program that enters comes from outside.
    tool = [shutil.which(enter[0]), *enter[1:]]
    print("$", *command, flush=True)
    subprocess.run([*tool, root, *map(str, command)], env=environment, check=True, cwd="/", timeout=300)


def main():
    wheel, *programs = (pathlib.Path(path).resolve() for path in sys.argv[1:])
    with tempfile.TemporaryDirectory(prefix="nirspi-root-") as folder:
        folder = pathlib.Path(folder)
        installed = folder / "venv"
        venv.create(installed, with_pip=True, symlinks=False)
        pip = [installed / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "numpy", wheel], check=True)
        root = folder / "root"
        (root / "tmp").mkdir(parents=True)
        python_into(root)
        manylinux_into(root, libraries(installed / "bin/python"))
        shutil.copytree(installed, root / str(installed).lstrip("/"), symlinks=True)
        nirspi = installed / "bin/nirspi"
        inside(root, nirspi, "--version")
        inside(root, nirspi, "demo", "--out", "/tmp/demo")
        inside(root, installed / "bin/python", "-c", SCRIPT)
        assert (root / "tmp/demo/side_by_side.png").stat().st_size > 10_000
        for program in programs:
            shutil.copy(program, root / "nirspi")
            inside(root, "/nirspi", "demo", "--out", "/tmp/program")
            made = [(root / "tmp" / name / "deblurred.npy").read_bytes() for name in ("demo", "program")]
            assert made[0] == made[1], "the wheel's program makes another image"
    print("runs in a root where nothing is installed")


if __name__ == "__main__":
    main()
