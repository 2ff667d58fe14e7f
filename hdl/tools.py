"""Where the gateware's tools are: a virtual environment under `target/`, made on first use.

Invariant: what runs is what `requirements.txt` pins; nothing is taken from the machine but Python.
"""

import subprocess
import sys
import venv
from pathlib import Path

HDL = Path(__file__).resolve().parent
ROOT = HDL.parent
TARGET = ROOT / "target" / "gateware"


def tool(name: str) -> str:
    """Path of one of the tools, installed if it is not there yet."""
    binaries = TARGET / "tools" / "bin"
    wanted = HDL / "requirements.txt"
    installed = TARGET / "tools" / "installed.txt"
    if not installed.exists() or installed.read_text() != wanted.read_text():
        print(f"installing {wanted.name} into {binaries.parent}", file=sys.stderr)
        venv.create(binaries.parent, with_pip=True, clear=True)
        subprocess.run([binaries / "pip", "install", "--quiet", "-r", wanted], check=True)
        installed.write_text(wanted.read_text())
    return str(binaries / name)
