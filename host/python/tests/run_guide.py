"""Runs the Python blocks of a page one after another, each with the packages that the page names before it and no others.

    python -I run_guide.py docs/python.md

A page says of a block what it needs beside nirspi and NumPy: "needs `torch` and `deepinv`", in the text between the block before
and this one. Every other package that is installed here is hidden from the block. Prints a line for each block that needs
a package that is not here; ends with an exception where a block does.
"""

import importlib.metadata
import pathlib
import re
import sys

ALWAYS = {"nirspi", "numpy"}


def blocks(text):
    """Line, code and named packages of each block."""
    end = 0
    for block in re.finditer(r"^```python\n(.*?)^```", text, re.S | re.M):
        said = " ".join(text[end : block.start()].split())
        named = re.findall(r"needs? ((?:`[\w-]+`(?:, and |, | and )?)+)", said)
        end = block.end()
        yield text[: block.start(1)].count("\n"), block[1], set(re.findall(r"`([\w-]+)`", " ".join(named)))


def plain(name):
    """A package's name as packages name each other, with one kind of dash."""
    return re.sub(r"[-_.]+", "-", name).lower()


def with_theirs(names):
    """These packages and all that they need themselves."""
    found, todo = set(), set(map(plain, names))
    while todo:
        name = todo.pop()
        found.add(name)
        try:
            wanted = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:
            continue
        todo |= {plain(re.match(r"[\w.-]+", one)[0]) for one in wanted if "extra ==" not in one} - found
    return found


class Hidden:
    """Finds no module of a package that the page has not named."""

    def __init__(self):
        self.allowed, self.owners = set(), importlib.metadata.packages_distributions()

    def find_spec(self, name, path=None, target=None):
        owners = {plain(owner) for owner in self.owners.get(name.split(".")[0], [])}
        if owners and not owners & self.allowed:
            raise ModuleNotFoundError(f"the page does not say that this block needs {name}", name=name)


def main():
    page = pathlib.Path(sys.argv[1]).resolve()
    hidden, names, seen = Hidden(), {}, set(ALWAYS)
    sys.meta_path.insert(0, hidden)
    for line, code, named in blocks(page.read_text()):
        place = f"{page.name}:{line}"
        # What an earlier block has imported lies there still.
        for used in sorted(seen - ALWAYS - named):
            if re.search(rf"\b{used}\b", code):
                sys.exit(f"{place}: uses {used}, and the text before it does not say that it needs `{used}`")
        seen |= named
        missing = [name for name in sorted(named) if not is_here(name)]
        if missing:
            print(f"skipped: {place} needs {', '.join(missing)}", flush=True)
            continue
        hidden.allowed = with_theirs(ALWAYS | named)
        exec(compile("\n" * line + code, str(page), "exec"), names)
        print(f"ran: {place}", flush=True)


def is_here(name):
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


if __name__ == "__main__":
    main()
