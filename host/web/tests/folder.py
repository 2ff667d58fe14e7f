"""What the tests of the folder of pages share: a file server for it, and what a page asks for and complains of."""

import functools
import http.server
import threading

# No wait takes longer, on a busy machine either.
LIMIT_MS = 60_000


class Files(http.server.SimpleHTTPRequestHandler):
    """A plain file server that says nothing."""

    def log_message(self, *_):
        pass


def served(handler, folder):
    """The address of the folder, which this kind of server serves from now on."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(handler, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_address[1]}"


def watched(page):
    """The addresses that the page asks for from now on, and its errors."""
    asked, problems = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    return asked, problems
