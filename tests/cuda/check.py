#!/usr/bin/env python3
"""Run the tests of the GPU kernels through CUDA on a machine without a GPU, and say what each kernel needs.

    python3 tests/cuda/check.py                         every test of GPU kernels, then the table
    python3 tests/cuda/check.py nirspi-nets products    tests of one package whose names match
    python3 tests/cuda/check.py --table                 the table of the last run alone

The package `nirspi-tests-cuda` is a CUDA driver that runs PTX on the processor; this script puts it where
NVIDIA's driver would be. CubeCL then gives the source of each kernel to NVRTC, and the driver writes the PTX
to `target/cuda/kernels`. `ptxas` compiles it for an H100 as NVIDIA's driver would, and `cuobjdump` shows the
machine instructions. NVRTC, `ptxas` and `cuobjdump` come from PyPI, into `target/cuda` (490 MB).

Columns of the table:

    regs         registers of a thread
    stack        bytes of a thread's arrays that are in memory, where they should be in registers
    spill st/ld  bytes that a thread stores to memory and loads again for want of registers
    HMMA, LDSM, FFMA, LDS, LDG
                 instructions in the text of the kernel: products on tensor cores, loads of matrices, products
                 and sums in f32, loads from shared memory, loads from memory

The script fails if a test fails, or if a kernel does not compile or spills. Kernels that imitate tensor cores
keep sums in a stack on purpose, and never run where there is a GPU.
"""

import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parents[2]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
HOME = TARGET / "cuda"
KERNELS = HOME / "kernels"

PACKAGES = [
    "nvidia-cuda-nvrtc==13.5.37",
    "nvidia-cuda-runtime==13.5.37",
    "nvidia-cuda-cccl==13.3.5.0.6",
    "nvidia-cuda-crt==13.5.37",
    "nvidia-cuda-nvcc==13.5.37",
    "nvidia-cuda-cuobjdump==13.5.37",
    "nvidia-cuda-nvdisasm==13.5.37",
]

# Packages with tests of kernels, and the names of those tests.
TESTS = {
    "nirspi-recon": ["omp::"],
    "nirspi-nets": ["gpu::"],
}

OPCODES = ["HMMA", "LDSM", "FFMA", "LDS", "LDG"]


def toolkit() -> pathlib.Path:
    """Folder of NVIDIA's compilers and headers, which are fetched the first time."""
    installed = HOME / "installed"
    if not installed.exists() or installed.read_text() != "\n".join(PACKAGES):
        venv.create(HOME, with_pip=True)
        pip = HOME / "bin" / "pip"
        subprocess.run([pip, "install", "--quiet", "--no-deps", *PACKAGES], check=True)
        installed.write_text("\n".join(PACKAGES))
    (found,) = HOME.glob("lib/python*/site-packages/nvidia/cu13")
    return found


def libraries(home: pathlib.Path) -> pathlib.Path:
    """A folder with the stand-in driver and NVRTC, by the names that a program looks for."""
    subprocess.run(["cargo", "build", "--locked", "-p", "nirspi-tests-cuda"], check=True, cwd=ROOT)
    folder = HOME / "libraries"
    folder.mkdir(exist_ok=True)
    (nvrtc,) = home.glob("lib/libnvrtc.so.*")
    links = {
        "libcuda.so": TARGET / "debug" / "libnirspi_cuda_driver.so",
        "libnvrtc.so": nvrtc,
        nvrtc.name: nvrtc,
    }
    links.update({path.name: path for path in home.glob("lib/libnvrtc-builtins.so.*")})
    for name, path in links.items():
        link = folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(path.resolve())
    return folder


def run_tests(home: pathlib.Path, tests: dict[str, list[str]]) -> bool:
    """Run tests through the stand-in driver; whether all passed."""
    folder = libraries(home)
    KERNELS.mkdir(exist_ok=True)
    for old in KERNELS.iterdir():
        old.unlink()
    environment = {
        **os.environ,
        "CUDA_PATH": str(home),
        "LD_LIBRARY_PATH": str(folder),
        "NIRSPI_CUDA_DUMP": str(KERNELS),
        # Each kernel must be compiled to be seen.
        "NIRSPI_KERNEL_CACHE": "off",
        # Tests that take one backend take this one.
        "NIRSPI_TEST_BACKEND": "cuda",
    }
    passed = True
    for package, names in tests.items():
        print(f"{package}: {' '.join(names)}", flush=True)
        command = ["cargo", "test", "--locked", "-p", package, "--features", "gpu", "--lib", "--", *names]
        passed &= subprocess.run(command, cwd=ROOT, env=environment).returncode == 0
    return passed


def compile_kernel(home: pathlib.Path, path: pathlib.Path) -> tuple[str, str]:
    """The line of the table for a PTX, and what is wrong with it."""
    text = path.read_text()
    entry = re.search(r"\.entry (\w+)", text)
    name = entry[1] if entry else path.stem
    cubin = path.with_suffix(".cubin")
    ptxas = [home / "bin" / "ptxas", "-v", "-arch=sm_90a", path, "-o", cubin]
    made = subprocess.run(ptxas, capture_output=True, text=True)
    said = made.stdout + made.stderr
    number = re.search(r"Used (\d+) registers", said)
    frame = re.search(r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", said)
    if made.returncode or not number or not frame:
        return f"{name:24} does not compile", said
    found = os.pathsep.join([str(home / "bin"), os.environ.get("PATH", "")])
    dump = [home / "bin" / "cuobjdump", "-sass", cubin]
    dumped = subprocess.run(dump, capture_output=True, text=True, env={**os.environ, "PATH": found})
    opcodes = re.findall(r"^\s*/\*[0-9a-f]{4,}\*/\s+(?:@!?U?P\w+\s+)?([A-Z][A-Z0-9]*)", dumped.stdout, re.MULTILINE)
    counts = " ".join(f"{opcodes.count(opcode):6}" for opcode in OPCODES)
    stack, stores, loads = map(int, frame.groups())
    wrong = f"spills {stores} and {loads} bytes" if stores or loads else ""
    return f"{name:24} {number[1]:>4} {stack:5} {f'{stores}/{loads}':>11} {counts}", wrong


def table(home: pathlib.Path) -> bool:
    """Print what each kernel of the last run needs; whether all compile without spills."""
    paths = sorted(KERNELS.glob("*.ptx"))
    if not paths:
        print(f"no kernel in {KERNELS}: no test has run through CUDA", file=sys.stderr)
        return False
    with concurrent.futures.ProcessPoolExecutor() as pool:
        lines = set(pool.map(compile_kernel, [home] * len(paths), paths))
    counts = " ".join(f"{opcode:>6}" for opcode in OPCODES)
    print(f"\nsm_90a\n{'kernel':24} regs stack spill st/ld {counts}")
    for line, _ in sorted(lines):
        print(line)
    for line, wrong in sorted(lines):
        if wrong:
            print(f"{line.split()[0]}: {wrong}", file=sys.stderr)
    return not any(wrong for _, wrong in lines)


def main() -> int:
    """Run tests, then print the table."""
    arguments = sys.argv[1:]
    if "--help" in arguments or "-h" in arguments:
        print(__doc__)
        return 0
    home = toolkit()
    passed = True
    if arguments != ["--table"]:
        tests = {arguments[0]: arguments[1:]} if arguments else TESTS
        passed = run_tests(home, tests)
    fits = table(home)
    if passed and fits:
        print("\nevery test passed, and no kernel spills")
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
