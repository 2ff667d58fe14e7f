"""A preprocessor of mdBook: a link of a page to a file outside of the two books becomes an address in the repository, and a picture
leads to its own file, which a phone shows in full size.

docs/book.toml and docs/log/book.toml name it. In the repository the same links lead from file to file.
"""

import json
import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
ADDRESS = "https://github.com/nirspi/nirspi"
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")
PICTURE = re.compile(r"^!\[[^\]]*\]\(([^)\s]+)\)$", re.MULTILINE)
# Pages that mdBook does not render, beside files outside of docs/.
NOT_RENDERED = {DOCS / "SUMMARY.md", DOCS / "log/SUMMARY.md"}


def address(path, anchor):
    """The address of a file or folder of the repository."""
    kind = "tree" if path.is_dir() else "blob"
    return f"{ADDRESS}/{kind}/main/{path.relative_to(ROOT).as_posix()}{anchor}"


def rewritten(text, folder):
    """The text of a page in this folder, with every link that leaves the books as an address."""

    def link(match):
        target, anchor = match[1], match[2] or ""
        if "://" in target or target.startswith("mailto:"):
            return match[0]
        path = Path(os.path.normpath(folder / target))
        if path.is_relative_to(DOCS) and path not in NOT_RENDERED:
            return match[0]
        if not path.exists():
            sys.exit(f"{folder}: a link leads to {path}, which does not exist")
        return f"]({address(path, anchor)})"

    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)

    def text_part(part):
        return PICTURE.sub(lambda match: f"[{match[0]}]({match[1]})", LINK.sub(link, part))

    return "".join(part if part.startswith("```") else text_part(part) for part in parts)


def visit(item, source):
    """Rewrites every chapter below this part of the book."""
    if isinstance(item, list):
        for part in item:
            visit(part, source)
    elif isinstance(item, dict):
        chapter = item.get("Chapter")
        if chapter and chapter.get("source_path"):
            folder = (source / chapter["source_path"]).parent
            chapter["content"] = rewritten(chapter["content"], folder)
        for part in item.values():
            visit(part, source)


def main():
    if sys.argv[1:2] == ["supports"]:
        return
    context, book = json.load(sys.stdin)
    visit(book, Path(context["root"]).resolve() / context["config"]["book"].get("src", "src"))
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
