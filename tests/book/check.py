"""Every link of the rendered books leads somewhere: to a file, and to the place in it that the link names.

    python3 check.py FOLDER [FOLDER NOT CHECKED...]

Links to other sites are not followed. Prints each link that leads nowhere, and then exits with 1.
"""

import os
import sys
import urllib.parse
from html.parser import HTMLParser
from pathlib import Path


class Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.anchors.update(values[name] for name in ("id", "name") if values.get(name))
        self.links += [values[name] for name in ("href", "src") if values.get(name)]


def main():
    root = Path(sys.argv[1]).resolve()
    left_out = [root / name for name in sys.argv[2:]]
    # The page of a wrong address has links from the root of a site.
    files = [file for file in root.rglob("*.html") if file.name != "404.html"]
    files = [file for file in files if not any(file.is_relative_to(folder) for folder in left_out)]
    pages = {file: Page(file.read_text()) for file in files}
    checked, broken = 0, []
    for file, page in pages.items():
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            checked += 1
            path = urllib.parse.unquote(parts.path)
            target = Path(os.path.normpath(file.parent / path)) if path else file
            if any(target == folder or target.is_relative_to(folder) for folder in left_out):
                continue
            if target.is_dir():
                target /= "index.html"
            anchor = urllib.parse.unquote(parts.fragment)
            if not target.is_file():
                broken.append(f"{file.relative_to(root)}: {link}")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                broken.append(f"{file.relative_to(root)}: {link}: no such anchor")
    print("\n".join(sorted(set(broken))))
    print(f"{checked} links in {len(pages)} pages, {len(broken)} lead nowhere")
    if broken or checked < 1000:
        sys.exit(1)


if __name__ == "__main__":
    main()
