"""The code of docs/python.md and docs/coming-from.md runs from top to bottom, in a fresh interpreter, with the packages alone that the page names."""

import pathlib
import subprocess
import sys

import pytest

from conftest import ROOT

RUNNER = pathlib.Path(__file__).with_name("run_guide.py")


def run(page, folder):
    command = [sys.executable, "-I", str(RUNNER), str(page)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900)


def test_the_code_for_users_of_other_packages_runs(tmp_path):
    done = run(ROOT / "docs/coming-from.md", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    ran, skipped = (done.stdout.count(f"{word}: ") for word in ("ran", "skipped"))
    assert ran + skipped == 3 and ran >= 2, done.stdout


def test_the_code_of_the_guide_runs(tmp_path):
    done = run(ROOT / "docs/python.md", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    ran = [line for line in lines if line.startswith("ran: ")]
    skipped = [line for line in lines if line.startswith("skipped: ")]
    assert len(ran) + len(skipped) >= 9 and len(ran) >= 7, lines
    if skipped:
        pytest.skip(f"{'; '.join(skipped)}; the {len(ran)} other blocks ran")


@pytest.mark.parametrize(
    ("page", "told"),
    [
        ("```python\nimport pytest\n```\n", "does not say that this block needs pytest"),
        (
            "It needs `pytest`.\n\n```python\nimport pytest\n```\n\n```python\npytest.skip\n```\n",
            "uses pytest",
        ),
        ("```python\nimport numpy\nnumpy.none\n```\n", "has no attribute 'none'"),
    ],
)
def test_a_block_that_needs_what_the_page_does_not_name_is_seen(page, told, tmp_path):
    (tmp_path / "page.md").write_text(page)
    done = run(tmp_path / "page.md", tmp_path)
    assert done.returncode != 0 and told in done.stdout + done.stderr, done
