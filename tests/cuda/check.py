#!/usr/bin/env python3
"""Run the tests of the GPU kernels through CUDA, on a machine without a GPU.

    python3 tests/cuda/check.py                         every test of GPU kernels
    python3 tests/cuda/check.py nirspi-nets products    tests of one package whose names match

The package `nirspi-tests-cuda` is a CUDA driver that runs PTX on the processor; this script puts it where
NVIDIA's driver would be. CubeCL gives the source of each kernel to NVRTC, and the driver runs the PTX that NVRTC
makes of it, tensor cores included. NVRTC comes from PyPI, as for host/gpu/scripts/cuda_source.py.
"""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host" / "gpu" / "scripts"))

import cuda_source  # noqa: E402

FOLDER = cuda_source.TARGET / "cuda-driver"

# Packages with tests of kernels, and the names of those tests.
TESTS = {
    "nirspi-omp": [],
    "nirspi-recon": ["omp::"],
    "nirspi-nets": ["gpu::"],
}


def libraries(home: pathlib.Path) -> None:
    """Put the stand-in driver and NVRTC into a folder, by the names that a program looks for."""
    subprocess.run(["cargo", "build", "--locked", "-p", "nirspi-tests-cuda"], check=True, cwd=ROOT)
    FOLDER.mkdir(exist_ok=True)
    (nvrtc,) = home.glob("lib/libnvrtc.so.*")
    links = {
        "libcuda.so": cuda_source.TARGET / "debug" / "libnirspi_cuda_driver.so",
        "libnvrtc.so": nvrtc,
        nvrtc.name: nvrtc,
    }
    links.update({path.name: path for path in home.glob("lib/libnvrtc-builtins.so.*")})
    for name, path in links.items():
        link = FOLDER / name
        link.unlink(missing_ok=True)
        link.symlink_to(path.resolve())


def run_tests(home: pathlib.Path, package: str, names: list[str]) -> bool:
    """Run tests of a package through the stand-in driver; whether they ran and passed."""
    environment = {
        **os.environ,
        "CUDA_PATH": str(home),
        "LD_LIBRARY_PATH": str(FOLDER),
        # Kernels of this run are compiled in this run.
        "NIRSPI_KERNEL_CACHE": "off",
        # Tests that take one backend take this one.
        "NIRSPI_TEST_BACKEND": "cuda",
    }
    command = ["cargo", "test", "--locked", "-p", package, "--features", "gpu", "--lib"]
    command += ["--", *names, "--nocapture"]
    print(" ".join(command), flush=True)
    ran = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    print(ran.stdout, flush=True)
    # Vulkan, Metal and DirectX are not in this build.
    skipped = [line for line in ran.stdout.splitlines() if line.startswith("skipped:") and "wgpu" not in line]
    if skipped:
        print(f"{package}: a test did not run: {skipped[0]}", file=sys.stderr)
        return False
    return ran.returncode == 0 and " 0 passed" not in ran.stdout


def main() -> int:
    """Run the tests; 0 if all passed."""
    arguments = sys.argv[1:]
    if "--help" in arguments or "-h" in arguments:
        print(__doc__)
        return 0
    home = cuda_source.toolkit()
    libraries(home)
    tests = {arguments[0]: arguments[1:]} if arguments else TESTS
    passed = [run_tests(home, package, names) for package, names in tests.items()]
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
