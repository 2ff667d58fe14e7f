"""Runs tests of the package under Valgrind, and lists what it finds in the compiled part: reads and writes of memory
that is not there, and decisions on values that nothing has set.

    python tests/memory.py [what pytest takes]

Python's and NumPy's own parts are left out: an error counts if a function of ``_nirspi`` is on its stack.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

HERE = pathlib.Path(__file__).parent
# Children of fork, signals after a time and pools of processes are not slower programs but other ones.
LEFT_OUT = "not fork and not ctrl_c and not process"
TESTS = [
    "test_bad_input.py",
    "test_hadamard.py",
    "test_measurement.py",
    "test_images.py",
    "test_reconstruct.py",
]


def errors_of(report, library="_nirspi"):
    """Each error of a report with our library on its stack: what it is, and the stack. Valgrind lists leaks in every
    XML report, whatever `--leak-check` says. They are left out: types and threads live until Python ends.
    """
    found = []
    for error in ET.parse(report).getroot().iter("error"):
        if (error.findtext("kind") or "").startswith("Leak_"):
            continue
        frames = list(error.iter("frame"))
        if any(library in (frame.findtext("obj") or "") for frame in frames):
            what = error.findtext("what") or error.findtext("xwhat/text") or error.findtext("kind")
            stack = [frame.findtext("fn") or frame.findtext("ip") or "?" for frame in frames[:12]]
            found.append(f"{what}\n    " + "\n    ".join(stack))
    return found


def main(words):
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.xml"
        valgrind = ["valgrind", "--quiet", "--leak-check=no", "--num-callers=30", "--xml=yes"]
        chosen = words or [*(str(HERE / name) for name in TESTS), "-k", LEFT_OUT]
        # Each block of memory is malloc's, so that Valgrind knows its ends.
        environment = os.environ | {"PYTHONMALLOC": "malloc", "RAYON_NUM_THREADS": "2"}
        ran = subprocess.run(
            [
                *valgrind,
                f"--xml-file={report}",
                sys.executable,
                "-m",
                "pytest",
                "-p",
                "no:cacheprovider",
                *chosen,
            ],
            cwd=HERE.parent,
            env=environment,
            check=False,
        )
        found = errors_of(report)
    for error in found:
        print(error)
    print(f"{len(found)} errors of memory in the compiled part")
    return 1 if found or ran.returncode else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
