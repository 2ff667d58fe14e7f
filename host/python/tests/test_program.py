"""The program that the package installs: the script ``nirspi`` and ``python -m nirspi``."""

import os
import signal
import subprocess
import sys
from importlib.metadata import entry_points

import numpy as np
import pytest

PROGRAM = [sys.executable, "-m", "nirspi"]


def run(*arguments, code=0, folder=None):
    done = subprocess.run(
        [*PROGRAM, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == code, done
    return done


def test_the_script_is_the_program():
    (script,) = entry_points(group="console_scripts", name="nirspi")
    assert script.value == "nirspi.__main__:main"
    said = run("--version").stdout
    assert said.startswith("nirspi ") and "protocol: version" in said


def test_its_exit_codes_are_those_of_the_program(tmp_path):
    assert "Usage: nirspi demo" in run("demo", "-h").stdout
    assert "--bogus" in run("demo", "--bogus", code=2).stderr
    assert "none.npz" in run("reconstruct", "none.npz", code=1, folder=tmp_path).stderr


def test_its_images_are_those_of_the_program(cli, tmp_path):
    run("example", "wing", folder=tmp_path)
    for program, out in [(PROGRAM, "script"), ([cli], "binary")]:
        line = [*program, "reconstruct", "wing.npz", "--sampling", "30%", "--out", out]
        subprocess.run(line, cwd=tmp_path, check=True, capture_output=True)
    script, binary = (np.load(tmp_path / out / "image.npy") for out in ("script", "binary"))
    assert np.array_equal(script, binary)
    assert '"command": "nirspi reconstruct wing.npz' in (tmp_path / "script/report.json").read_text()


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_it_as_it_ends_the_program(tmp_path):
    line = [*PROGRAM, "capture", "--camera", "virtual", "--out", "rec.mcap"]
    with subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        while not (tmp_path / "rec.mcap").exists() and process.poll() is None:
            pass
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert "received" in run("camera", "info", "rec.mcap", folder=tmp_path).stdout
