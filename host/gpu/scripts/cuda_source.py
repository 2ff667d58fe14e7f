#!/usr/bin/env python3
"""Compile the CUDA source of every GPU kernel, without a GPU, and say what each kernel needs.

    python3 host/gpu/scripts/cuda_source.py                     kernels of the networks and of OMP, for three GPUs
    python3 host/gpu/scripts/cuda_source.py --cards 90          for an H100 or H200 alone
    python3 host/gpu/scripts/cuda_source.py --only '*tensor*'   kernels whose name matches
    python3 host/gpu/scripts/cuda_source.py --folder FOLDER     files that are there: FOLDER/sm_90/*.cu

The example `cuda_source` of nirspi-nets writes the source as CubeCL gives it to NVRTC. NVRTC compiles
the source to PTX with the options that CubeCL uses, `ptxas` compiles the PTX as the driver does, and
`cuobjdump` shows the machine instructions. All of them come from PyPI, into `target/cuda-source`
(300 MB). PTX, cubin and instructions of each kernel stay beside its source, in `target/cuda-source/kernels`.

A new kernel appears here by itself as soon as the networks or OMP launch it. For another one,
launch it in host/nets/examples/cuda_source.rs.

CubeCL's text of a kernel is not the same in each run: arrays in shared memory stand in another order, and with it
registers and spills change a little. To compare two versions, take the numbers of several runs.

Columns of the table:

    regs         registers of a thread
    stack        bytes of a thread's arrays that are in memory, where they should be in registers
    spill st/ld  bytes that a thread stores to memory and loads again for want of registers
    shared       bytes of shared memory of a workgroup
    groups       workgroups that an SM holds at once, by registers, shared memory and threads
    warps        warps that an SM holds at once
    HMMA, LDSM, FFMA, LDS, LDG, LDGSTS
                 instructions in the text of the kernel: products on tensor cores, loads of matrices, products
                 and sums in f32, loads from shared memory, loads from memory, copies to shared memory
    launches     launches while the example ran

The script fails if a kernel does not compile, has a stack or spills. With `--allow NAME=BYTES`, kernels
whose name matches NAME may spill that many bytes.
"""

import argparse
import concurrent.futures
import ctypes
import dataclasses
import fnmatch
import os
import pathlib
import re
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parents[3]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
HOME = TARGET / "cuda-source"

# Without their dependencies, of which nothing here needs NVVM's 100 MB.
PACKAGES = [
    "nvidia-cuda-nvrtc==13.5.37",
    "nvidia-cuda-runtime==13.5.37",
    "nvidia-cuda-cccl==13.3.5.0.6",
    "nvidia-cuda-crt==13.5.37",
    "nvidia-cuda-nvcc==13.5.37",
    "nvidia-cuda-cuobjdump==13.5.37",
    "nvidia-cuda-nvdisasm==13.5.37",
]

# T4 and RTX 20, A100, H100 and H200.
CARDS = ["75", "80", "90"]

# Of an SM: bytes of shared memory, warps, workgroups (tables of NVIDIA's programming guide, "compute capabilities").
SM = {
    "75": (64 << 10, 32, 16),
    "80": (164 << 10, 64, 32),
    "86": (100 << 10, 48, 16),
    "89": (100 << 10, 48, 24),
    "90": (228 << 10, 64, 32),
}
REGISTERS = 65536
# Shared memory of a workgroup that the system takes, from compute capability 8.0 on.
RESERVED = 1024

OPCODES = ["HMMA", "LDSM", "FFMA", "LDS", "LDG", "LDGSTS"]


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


def write_source(folder: pathlib.Path, cards: list[str]) -> None:
    """The files of the example."""
    command = ["cargo", "run", "--quiet", "--locked", "-p", "nirspi-nets", "--features", "gpu,nirspi-gpu/source"]
    command += ["--example", "cuda_source", "--", str(folder.resolve()), *cards]
    subprocess.run(command, check=True, cwd=ROOT)


@dataclasses.dataclass
class Kernel:
    """What the compilers say about a kernel."""

    card: str
    name: str
    error: str = ""
    threads: int = 0
    shared: int = 0
    launches: int = 0
    registers: int = 0
    stack: int = 0
    stores: int = 0
    loads: int = 0
    instructions: dict[str, int] = dataclasses.field(default_factory=dict)

    def groups(self) -> int:
        """Workgroups that an SM holds at once; 0 for a card that this script has no numbers of."""
        if self.card not in SM:
            return 0
        shared, warps, groups = SM[self.card]
        own = -(-self.threads // 32)
        # A warp's registers come in units of 256.
        by_registers = REGISTERS // (-(-self.registers * 32 // 256) * 256 * own)
        reserved = RESERVED if int(self.card) >= 80 else 0
        by_shared = shared // max(self.shared + reserved, 1)
        return min(by_registers, by_shared, warps // own, groups)


def nvrtc(home: pathlib.Path, text: bytes, architecture: str) -> tuple[bytes, str]:
    """The PTX of a kernel, or no PTX and NVRTC's messages, with the options of cubecl-cuda's context.rs."""
    (path,) = home.glob("lib/libnvrtc.so.*")
    library = ctypes.CDLL(str(path))
    options = [
        f"--gpu-architecture={architecture}",
        f"--include-path={home}/include",
        "-lineinfo",
        f"--include-path={home}/include/cccl",
    ]
    given = (ctypes.c_char_p * len(options))(*(option.encode() for option in options))
    program = ctypes.c_void_p()
    if library.nvrtcCreateProgram(ctypes.byref(program), text, None, 0, None, None):
        return b"", "NVRTC made no program"
    failed = library.nvrtcCompileProgram(program, len(options), given)

    def read(size_of: str, read_to: str) -> bytes:
        size = ctypes.c_size_t()
        getattr(library, size_of)(program, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        getattr(library, read_to)(program, buffer)
        return buffer.value

    messages = read("nvrtcGetProgramLogSize", "nvrtcGetProgramLog").decode()
    return (b"", messages) if failed else (read("nvrtcGetPTXSize", "nvrtcGetPTX"), messages)


def compile_kernel(home: pathlib.Path, card: str, path: pathlib.Path) -> Kernel:
    """Compile a file and read what the compilers say."""
    # From 9.0 on, CubeCL asks for the features of exactly this GPU.
    architecture = f"sm_{card}a" if int(card) >= 90 else f"sm_{card}"
    text = path.read_bytes()
    facts = dict(re.findall(r"^// ([a-z ]+): (.*)$", text.decode(), re.MULTILINE))
    kernel = Kernel(card, path.stem)
    kernel.threads = int(facts.get("units", 0))
    kernel.shared = int(facts.get("shared bytes", 0))
    kernel.launches = int(facts.get("launches", 0))
    ptx, messages = nvrtc(home, text, architecture)
    if not ptx:
        kernel.error = messages
        return kernel
    path.with_suffix(".ptx").write_bytes(ptx)
    cubin = path.with_suffix(".cubin")
    ptxas = [home / "bin" / "ptxas", "-v", f"-arch={architecture}", path.with_suffix(".ptx"), "-o", cubin]
    made = subprocess.run(ptxas, capture_output=True, text=True)
    said = made.stdout + made.stderr
    if made.returncode:
        kernel.error = said
        return kernel
    number = re.search(r"Used (\d+) registers", said)
    frame = re.search(r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", said)
    if not number or not frame:
        kernel.error = f"ptxas said something else than expected: {said}"
        return kernel
    kernel.registers = int(number[1])
    kernel.stack, kernel.stores, kernel.loads = map(int, frame.groups())
    # Shared memory whose size the source has, besides that which the launch asks for.
    if fixed := re.search(r"(\d+) bytes smem", said):
        kernel.shared += int(fixed[1])
    path_with_tools = os.pathsep.join([str(home / "bin"), os.environ.get("PATH", "")])
    dumped = subprocess.run(
        [home / "bin" / "cuobjdump", "-sass", cubin],
        capture_output=True,
        text=True,
        env={**os.environ, "PATH": path_with_tools},
    )
    path.with_suffix(".sass").write_text(dumped.stdout)
    opcodes = re.findall(r"^\s*/\*[0-9a-f]{4,}\*/\s+(?:@!?U?P\w+\s+)?([A-Z][A-Z0-9]*)", dumped.stdout, re.MULTILINE)
    if dumped.returncode or not opcodes:
        kernel.error = f"cuobjdump shows no instructions: {dumped.stderr}"
    kernel.instructions = {opcode: opcodes.count(opcode) for opcode in OPCODES}
    return kernel


def table(kernels: list[Kernel]) -> None:
    """Print the table of one card."""
    width = max(len(kernel.name) for kernel in kernels)
    counts = " ".join(f"{opcode:>6}" for opcode in OPCODES)
    head = f"{'kernel':{width}} regs stack spill st/ld shared groups warps {counts} launches"
    print(f"\nsm_{kernels[0].card}\n{head}")
    for k in kernels:
        if k.error:
            print(f"{k.name:{width}} does not compile")
            continue
        groups = k.groups()
        warps = groups * -(-k.threads // 32)
        counts = " ".join(f"{k.instructions[opcode]:6}" for opcode in OPCODES)
        spill = f"{k.stores}/{k.loads}"
        print(
            f"{k.name:{width}} {k.registers:4} {k.stack:5} {spill:>11} {k.shared:6} "
            f"{groups or '-':>6} {warps or '-':>5} {counts} {k.launches:8}"
        )


def main() -> int:
    """Compile everything and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cards", default=",".join(CARDS), help="compute capabilities (default: %(default)s)")
    parser.add_argument("--only", default="*", help="kernels whose name matches (default: %(default)s)")
    parser.add_argument("--folder", type=pathlib.Path, help="source that is there, in FOLDER/sm_CARD/*.cu")
    parser.add_argument("--allow", action="append", default=[], metavar="NAME=BYTES", help="bytes of spills and stack")
    arguments = parser.parse_args()
    cards = arguments.cards.split(",")
    allowed = [(name, int(size)) for name, _, size in (text.rpartition("=") for text in arguments.allow)]
    home = toolkit()
    folder = arguments.folder
    if folder is None:
        folder = HOME / "kernels"
        for old in folder.glob("sm_*/*"):
            old.unlink()
        write_source(folder, cards)
    wrong = []
    for card in cards:
        paths = sorted((folder / f"sm_{card}").glob("*.cu"))
        paths = [path for path in paths if fnmatch.fnmatch(path.stem, arguments.only)]
        if not paths:
            print(f"no kernel {arguments.only} in {folder}/sm_{card}", file=sys.stderr)
            return 2
        with concurrent.futures.ProcessPoolExecutor() as pool:
            kernels = list(pool.map(compile_kernel, [home] * len(paths), [card] * len(paths), paths))
        table(kernels)
        for kernel in kernels:
            most = max((size for name, size in allowed if fnmatch.fnmatch(kernel.name, name)), default=0)
            if kernel.error:
                wrong.append(f"sm_{card} {kernel.name} does not compile:\n{kernel.error}")
            elif max(kernel.stack, kernel.stores, kernel.loads) > most:
                wrong.append(
                    f"sm_{card} {kernel.name}: {kernel.stack} bytes of stack, {kernel.stores} of spill stores, "
                    f"{kernel.loads} of spill loads; expected at most {most}"
                )
    print()
    for line in wrong:
        print(line, file=sys.stderr)
    if not wrong:
        spilled = f", with no more spills than {' and '.join(arguments.allow)}" if allowed else ", without spills"
        print(f"every kernel compiles{spilled}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
