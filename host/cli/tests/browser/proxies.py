"""The page below a sub-path behind nginx and Caddy, with the very configurations of docs/live-page-network.md: the page's addresses, its
cookie, its token, and a stop that gets through."""

import contextlib
import pathlib
import re
import shutil
import socket
import ssl
import subprocess
import tempfile
import time
import urllib.request

from pictures import seen
from playwright.sync_api import expect

PAGE = pathlib.Path(__file__).parents[4] / "docs/live-page-network.md"
# The name in the page's examples. The browser finds it on this machine.
NAME = "camera.example.org"
BROWSER = [f"--host-resolver-rules=MAP {NAME} 127.0.0.1"]
STOP_S = 1.0


def block(language):
    """The page's one example in this language."""
    blocks = re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1, f"{len(blocks)} blocks in {language} in {PAGE}, expected one"
    return blocks[0]


def put(text, **places):
    """The text with each of these places, which it has once, exchanged."""
    for old, new in places.values():
        assert text.count(old) == 1, f"{text.count(old)} times {old!r}, expected once, in:\n{text}"
        text = text.replace(old, str(new))
    return text


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def listens(port, process, log):
    for _ in range(200):
        assert process.poll() is None, f"{process.args[0]} ended: {log.read_text()}"
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(0.05)
    raise AssertionError(f"{process.args[0]} does not listen: {log.read_text()}")


def nginx(folder, port, server):
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={NAME}", "-keyout", key, "-out", certificate],
        check=True,
        capture_output=True,
    )
    example = put(
        block("nginx"),
        port=("443", f"127.0.0.1:{port}"),
        server=("127.0.0.1:8080", server),
        certificate=("/etc/ssl/certs/camera.pem", certificate),
        key=("/etc/ssl/private/camera.key", key),
    )
    places = "".join(f"{kind}_temp_path {folder}/{kind};\n" for kind in ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"])
    (folder / "nginx.conf").write_text(
        f"daemon off;\npid {folder}/pid;\nerror_log {folder}/error.log;\nevents {{}}\n"
        f"http {{\naccess_log off;\n{places}{example}}}\n"
    )
    return ["nginx", "-p", folder, "-e", folder / "error.log", "-c", folder / "nginx.conf"]


def caddy(folder, port, server):
    example = put(block("caddyfile"), name=(NAME, f"{NAME}:{port}"), server=("127.0.0.1:8080", server))
    # The certificates of its own authority, which are not in the system's list.
    alone = f"{{\n\tadmin off\n\tlocal_certs\n\tskip_install_trust\n\tauto_https disable_redirects\n\tstorage file_system {folder}/storage\n}}\n"
    (folder / "Caddyfile").write_text(alone + example)
    return ["caddy", "run", "--adapter", "caddyfile", "--config", folder / "Caddyfile"]


@contextlib.contextmanager
def running(command, log, **options):
    with log.open("w") as said:
        process = subprocess.Popen(command, stdout=said, stderr=said, **options)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(10)


@contextlib.contextmanager
def serving(program):
    """`nirspi serve` with the options of the page's example. Returns its own address and its token."""
    server = subprocess.Popen([program, *options(), "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        address = next(word for word in server.stdout.readline().split() if word.startswith("http://"))
        yield address.split("?token=")
    finally:
        server.terminate()
        server.wait(10)


def options():
    """The page's command line for a server behind a proxy."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("nirspi serve --base-path")]
    assert len(lines) == 1, lines
    return lines[0].split("#")[0].split()[1:]


def leds(address, token):
    request = urllib.request.Request(f"{address}api/state", headers={"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request) as answer:
        return re.search(r'"leds": "(\w+)"', answer.read().decode()).group(1)


def behind(browser, program, name, configure):
    """A page behind this proxy."""
    folder = pathlib.Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    port, log = free_port(), folder / "log"
    try:
        with serving(program) as (address, token):
            server = address.split("/")[2]
            with running(configure(folder, port, server), log) as proxy:
                listens(port, proxy, log)
                place = f"https://{NAME}:{port}/camera1"
                context = browser.new_context(ignore_https_errors=True)
                page = context.new_page()
                problems = []
                page.on("pageerror", lambda error: problems.append(str(error)))
                page.on("response", lambda answer: problems.append(f"{answer.status} {answer.url}") if answer.status >= 400 else None)
                # Without its token the page is refused; with it, the address loses its token and gets its last '/'.
                refused = page.goto(f"{place}/").status
                assert refused == 401, f"without its token: {refused}, expected 401"
                page.goto("about:blank")
                problems.clear()
                page.goto(f"{place}?token={token}")
                assert page.url == f"{place}/", page.url
                cookies = [(cookie["path"], cookie["httpOnly"], cookie["sameSite"]) for cookie in context.cookies()]
                assert cookies == [("/camera1", True, "Strict")], cookies
                # State, image, a setting, a scene.
                seen(page, "image", 32)
                expect(page.locator("#leds")).to_have_text("LEDs on")
                page.get_by_label("hadamard", exact=True).check()
                expect(page.locator("#about-image")).to_contain_text("hadamard, ")
                page.locator("#scene summary").click()
                page.locator("#white").click()
                expect(page.locator("#scene-name")).to_contain_text("white")
                # A page without a '/' at its end, opened again by the cookie alone.
                other = context.new_page()
                other.goto(place)
                assert other.url == f"{place}/", other.url
                expect(other.locator("#leds")).to_have_text("LEDs on")
                # The camera itself is dark within a second, seen past the proxy.
                slowest = 0
                for each in [page, other, page]:
                    since = time.time()
                    each.keyboard.press("Escape")
                    while leds(address, token) != "off":
                        assert time.time() - since < 30, "no stop gets through"
                        time.sleep(0.01)
                    slowest = max(slowest, time.time() - since)
                    expect(each.locator("#leds")).to_have_text("LEDs off, stopped")
                    each.locator("#start").click()
                    expect(each.locator("#leds")).to_have_text("LEDs on")
                assert slowest < STOP_S, f"{name}: LEDs off {slowest:.2f} s after Escape, expected {STOP_S} s"
                streams(place, token)
                assert not problems, problems
                context.close()
            print(f"behind {name}: LEDs off {slowest:.2f} s after Escape")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def asked(place, token, method, path, *headers):
    """A connection through the proxy on which this was asked."""
    host = place.split("/")[2]
    trusting = ssl.create_default_context()
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    plain = socket.create_connection(("127.0.0.1", int(host.split(":")[1])))
    with trusting.wrap_socket(plain, server_hostname=NAME) as stream:
        stream.settimeout(10)
        lines = [f"{method} /camera1{path} HTTP/1.1", f"Host: {host}", f"Authorization: Bearer {token}", "Content-Length: 0", *headers]
        stream.sendall("\r\n".join([*lines, "", ""]).encode())
        yield stream


def streams(place, token):
    """Every state of `GET /events` comes at once, and a page of another site changes nothing through the proxy."""
    with asked(place, token, "GET", "/events") as stream:
        got, gaps, last = b"", [], time.time()
        while got.count(b"data: ") < 12:
            got += stream.recv(1 << 20)
            gaps.append(time.time() - last)
            last = time.time()
        assert max(gaps) < 1.5, f"states come {max(gaps):.1f} s apart"
    for origin, status in [(place.removesuffix("/camera1"), 200), ("https://evil.example", 403), (f"https://{NAME}", 403)]:
        with asked(place, token, "POST", "/api/start", f"Origin: {origin}") as stream:
            found = int(stream.recv(1 << 16).split()[1])
            assert found == status, f"{origin}: {found}, expected {status}"


def proxies(browser, program):
    for name, configure in [("nginx", nginx), ("caddy", caddy)]:
        if shutil.which(name):
            behind(browser, program, name, configure)
        else:
            print(f"skipped: the page behind {name}, no {name}")
