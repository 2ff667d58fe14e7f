#!/usr/bin/env python3
"""The camera in a browser: its numbers beside the native ones, an R drawn by mouse, a shaken line, a phone, a camera on USB,
and what breaks.

    python3 check.py FOLDER IN_TURNS NIRSPI [--screenshots DIR] [--least IMAGES_PER_S]

FOLDER is that of `host/web/build.sh`, IN_TURNS the program of `cargo build --example in_turns`, NIRSPI that of
`cargo build --release`. Needs playwright (PyPI) and chromium (Debian). Says what is wrong and exits 1, or prints what it saw.
"""

import argparse
import base64
import json
import math
import os
import pathlib
import socket
import struct
import subprocess
import sys
import threading
import time

from playwright.sync_api import expect, sync_playwright

# No compiled files beside the sources.
sys.dont_write_bytecode = True
sys.path.append(str(pathlib.Path(__file__).parents[2] / "cli/tests/browser"))
import folder
from folder import LIMIT_MS, served, watched
from pictures import LEVELS, fits, levels, looks_like, seen

# Commands between turns. The last image is fused with the depth map of the run's beginning.
SCRIPT = """POST /api/settings {"frames": FRAMES, "method": "METHOD", "order": "zig-zag", "sampling": SAMPLING}
turns 3
POST /api/scene {"scene": "word:NIR", "distance_m": 0.4, "weather": "heavy"}
turns 4
"""
# Method, frames in an image, share of the patterns. The learned prior enlarges the last bits of its network where there is
# much noise: with 8 frames and 30 % its images differ by 1e-4.
CASES = [(method, 8, 0.3) for method in ["tikhonov", "omp", "tv", "fista", "hadamard"]] + [("prior", 64, 0.5)]
# Greatest differences: of an image from 0 to 1, of counts in parts of white. WebAssembly adds numbers in another order than native
# code. The search for Tikhonov's strength enlarges that, and a network once more: 7e-6, 2e-5 and, of the prior, 3e-5 were seen.
CLOSE = {"readings": 1e-5, "image": 5e-5, "enhanced": 5e-5, "depth": 1e-5}


# A device as WebUSB shows it, for page and worker. Its transfers go to the file server, which hands them to a virtual camera.
DEVICE = """
{
  let last = Promise.resolve();
  // Transfers of one direction end in their order, their bytes too. One that failed is no reason for the next to fail.
  const ask = (...given) => last = last.catch(() => {}).then(async () => {
    const got = await fetch(...given);
    return { ok: got.ok, bytes: await got.arrayBuffer() };
  });
  const alternate = { interfaceClass: 0xff, interfaceSubclass: 0x53 };
  const device = {
    vendorId: 0x1209, productId: 1, configuration: null, claimed: [],
    async open() {
      if (!(await fetch("/usb/open", { method: "POST" })).ok) throw new DOMException("The device was disconnected.", "NotFoundError");
    },
    async close() { this.claimed = []; },
    async selectConfiguration(number) {
      if (number !== 1) throw new Error(`there is no configuration ${number}`);
      this.configuration = { interfaces: [{ interfaceNumber: 2, alternates: [alternate] }] };
    },
    async claimInterface(number) { this.claimed.push(number); },
    async transferOut(endpoint, data) {
      if (endpoint !== 1 || !this.claimed.includes(2)) throw new Error("the interface is not claimed");
      await fetch("/usb/out", { method: "POST", body: data });
      return { status: "ok", bytesWritten: data.byteLength };
    },
    async transferIn(endpoint, length) {
      if (endpoint !== 1 || !this.claimed.includes(2)) throw new Error("the interface is not claimed");
      const got = await ask(`/usb/in/${length}`, { cache: "no-store" });
      if (!got.ok) throw new DOMException("The device was disconnected.", "NetworkError");
      return { status: "ok", data: new DataView(got.bytes) };
    },
  };
  const usb = {
    async requestDevice(asked) { globalThis.askedFor = asked; return device; },
    async getDevices() { return [device]; },
  };
  Object.defineProperty(navigator, "usb", { value: usb });
}
"""


class Camera:
    """A virtual camera in a process of its own, behind TCP."""

    def __init__(self, program):
        self.process = subprocess.Popen(
            [program, "dev", "virtual", "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        address = self.process.stdout.readline().split("tcp:")[1].split(": ")[0]
        self.place = (address.rsplit(":", 1)[0], int(address.rsplit(":", 1)[1]))
        threading.Thread(target=self.process.stdout.read, daemon=True).start()
        self.socket = None

    def open(self):
        if self.socket:
            self.socket.close()
        self.socket = socket.create_connection(self.place)
        self.socket.settimeout(0.2)

    def read(self, most):
        try:
            return self.socket.recv(most) or None
        except TimeoutError:
            return b""
        except OSError:
            return None


class Files(folder.Files):
    """A file server. Under /missing, /cut and /panic it serves the same folder with one thing wrong, under /usb-camera
    with a device in place of the browser's own USB. /usb is that device's other side."""

    camera = None

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"] or 0))
        try:
            Files.camera.open() if self.path == "/usb/open" else Files.camera.socket.sendall(body)
            self.answer(b"")
        except OSError as error:
            self.send_error(503, str(error))

    def answer(self, content, kind="application/octet-stream"):
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def do_GET(self):
        _, *parts = self.path.split("?")[0].split("/")
        if parts[:2] == ["usb", "in"]:
            got = Files.camera.read(int(parts[2]))
            return self.send_error(503) if got is None else self.answer(got)
        wrong = parts.pop(0) if parts[0] in ("missing", "cut", "panic", "usb-camera") else None
        self.path = "/" + "/".join(parts)
        name = parts[-1]
        if wrong == "missing" and name.endswith(".wasm"):
            return self.send_error(404)
        if (wrong, name[-5:]) not in [("cut", ".wasm"), ("panic", "er.js"), ("usb-camera", "er.js")]:
            return super().do_GET()
        content = open(self.translate_path(self.path), "rb").read()
        if wrong == "usb-camera":
            return self.answer(content + DEVICE.encode(), "text/javascript")
        # No memory has so much room.
        content = content[: len(content) // 2] if wrong == "cut" else content.replace(b"patient(program.turn)()", b"program.room(-1)")
        self.answer(content, self.guess_type(self.path))


def in_the_browser(page, script):
    """The last message of these commands, by the WebAssembly alone."""
    return page.evaluate(
        """async script => {
          const bytes = await (await fetch("nirspi_web.wasm")).arrayBuffer();
          let panic = "", program = null;
          const text = (at, length) => new TextDecoder().decode(new Uint8Array(program.memory.buffer, at >>> 0, length));
          const none = () => { throw "a virtual camera needs no USB"; };
          const imports = { page: { now_ms: () => Date.now(), panicked: (at, length) => { panic = text(at, length); },
            usb_open: none, usb_send: none, usb_receive: none, usb_problem: none } };
          program = (await WebAssembly.instantiate(bytes, imports)).instance.exports;
          const answer = () => text(program.answer(), program.answer_bytes());
          if (!program.begin(1)) throw answer();
          for (const line of script.trim().split("\\n")) {
            const [verb, path, ...body] = line.split(" ");
            if (verb === "turns") { for (let at = 0; at < Number(path); at++) program.turn(); continue; }
            const bytes = new TextEncoder().encode(path + body.join(" "));
            new Uint8Array(program.memory.buffer).set(bytes, program.room(bytes.length) >>> 0);
            if (!program.command(path.length)) throw answer();
          }
          program.turn();
          const message = answer();
          // A panic is told in words before the program ends.
          try { program.room(-1); } catch (error) { return { message, panic, error: String(error) }; }
        }""",
        script,
    )


def numbers(text):
    data = base64.b64decode(text)
    return struct.unpack(f"<{len(data) // 4}f", data)


def equal(page, program):
    """WebAssembly and native code give the same numbers."""
    for method, frames, sampling in CASES:
        script = SCRIPT.replace("METHOD", method).replace("FRAMES", str(frames)).replace("SAMPLING", str(sampling))
        native = subprocess.run([program], input=f"{script}turns 1\n", stdout=subprocess.PIPE, text=True, check=True).stdout
        got = in_the_browser(page, script)
        assert "capacity overflow" in got["panic"], got
        ours, theirs = json.loads(got["message"]), json.loads(native)
        assert ours["state"]["frames"] == theirs["state"]["frames"], (ours["state"]["frames"], theirs["state"]["frames"])
        assert ours["state"]["picture"]["method"] == method and ours["state"]["problem"] is None, ours["state"]["problem"]
        white, worst = theirs["state"]["picture"]["white_counts"], {}
        for name, scale in [("readings", white), ("image", white), ("enhanced", 1), ("depth", 1)]:
            pairs = list(zip(numbers(ours[name]), numbers(theirs[name]), strict=True))
            assert [math.isnan(a) for a, _ in pairs] == [math.isnan(b) for _, b in pairs], name
            worst[name] = max(abs(a - b) / scale for a, b in pairs if not math.isnan(a))
        print(f"{method}: greatest difference from native code: " + ", ".join(f"{n} {d:.1e}" for n, d in worst.items()))
        assert all(found <= CLOSE[name] for name, found in worst.items()), worst


def measuring(page, address):
    page.goto(address)
    seen(page, "image", 32)
    seen(page, "enhanced", 64)
    expect(page.locator("#simulated")).to_be_visible()
    expect(page.locator("#line")).to_have_text("measuring")


def draw(page, strokes):
    """Draws with the mouse. Points are shares of the canvas."""
    box = page.locator("#drawing").bounding_box()
    for first, *rest in strokes:
        page.mouse.move(box["x"] + first[0] * box["width"], box["y"] + first[1] * box["height"])
        page.mouse.down()
        for x, y in rest:
            page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=8)
        page.mouse.up()


LETTER_R = [
    [(0.3, 0.85), (0.3, 0.15), (0.55, 0.15), (0.7, 0.22), (0.7, 0.4), (0.55, 0.48), (0.3, 0.48)],
    [(0.5, 0.48), (0.72, 0.85)],
]


def drawn(page):
    """An R is drawn, measured, reconstructed and enhanced."""
    page.locator("#clear").click()
    draw(page, LETTER_R)
    expect(page.locator("#scene-name")).to_contain_text("drawing")
    sides = {"image": 32, "enhanced": 64}
    for name, side in sides.items():
        # The drawing at the image's size: means of squares.
        wanted = page.locator("#drawing").evaluate(
            f"""canvas => {{
              const levels = ({LEVELS})(canvas), side = {side}, step = canvas.width / side;
              return Array.from({{ length: side * side }}, (_, at) => {{
                let sum = 0;
                for (let y = 0; y < step; y++) for (let x = 0; x < step; x++)
                  sum += levels[(Math.floor(at / side) * step + y) * canvas.width + at % side * step + x];
                return sum / step ** 2;
              }});
            }}"""
        )
        assert max(wanted) > 200 and min(wanted) == 0, "nothing is drawn"
        looks_like(page, name, wanted, 0.9)


def controls(page):
    """Method, order, share, rain and distance."""
    facts, about = page.locator("#identity"), page.locator("#about-image")
    for method in ["hadamard", "prior", "tikhonov"]:
        page.get_by_label(method, exact=True).check()
        expect(about).to_contain_text(f"{method}, ")
    page.locator("#order").select_option("zig-zag")
    expect(facts).to_contain_text("zig-zag")
    page.locator("#sampling").fill("25")
    page.locator("#sampling").press("Enter")
    expect(facts).to_contain_text("256 of")
    page.locator("#weather").fill("rain:20")
    page.locator("#weather").press("Enter")
    page.locator("#distance").fill("0.5")
    page.locator("#distance").press("Enter")
    expect(page.locator("#scene-name")).to_contain_text("0.5 m, rain:20")
    page.locator("#distance").fill("0")
    page.locator("#distance").press("Enter")
    expect(page.locator("#notes")).to_contain_text("distance_m is 0, expected 0.01 to 100")
    page.locator("#distance").fill("0.3")
    page.locator("#distance").press("Enter")
    page.locator("#weather").fill("none")
    page.locator("#weather").press("Enter")
    expect(page.locator("#scene-name")).to_contain_text("0.3 m, none")
    page.locator("#order").select_option("cake-cutting")
    page.locator("#sampling").fill("50")
    page.locator("#sampling").press("Enter")
    expect(facts).to_contain_text("512 of")
    page.locator("#letter").fill("R")
    page.locator("#letter").press("Enter")
    expect(page.locator("#scene-name")).to_contain_text("letter R")


def counters(page):
    losses = page.locator("#losses").text_content().removeprefix("this run: ")
    return [int(text.replace("\u202f", "").split(" ")[0]) for text in losses.split(", ")]


def pressed(page, button):
    """Holds a button down. A page whose pictures have just come may move between pointing and pressing."""
    for _ in range(5):
        page.locator(button).hover()
        page.mouse.down()
        try:
            return expect(page.locator(button)).to_have_attribute("aria-pressed", "true", timeout=5000)
        except AssertionError:
            page.mouse.up()
    raise AssertionError(f"{button} does not stay pressed")


def shaken(page):
    """Frames are lost while the line is shaken, and only then."""
    before = counters(page)
    assert before[1:] == [0, 0, 0], before
    pressed(page, "#shake")
    page.wait_for_function("() => !document.getElementById('losses').textContent.includes(' 0 corrupt')")
    page.mouse.up()
    expect(page.locator("#damage-text")).to_have_text("steady")
    # The losses of the last moments show with the next whole frame.
    page.wait_for_timeout(1000)
    received, *missed = counters(page)
    assert sum(missed) > 0, missed
    page.wait_for_function(
        "received => Number(document.getElementById('losses').textContent.split(' ')[2].replace('\\u202f', '')) > received",
        arg=received + 100,
    )
    assert counters(page)[1:] == missed, (counters(page), missed)
    expect(page.locator("#line-bytes")).not_to_contain_text(" 0 flipped")
    print(f"shaken: {missed[0]} lost, {missed[1]} corrupt, {missed[2]} late")


def stopped(page):
    """Escape switches the simulated LEDs off, and only a person switches them on."""
    page.keyboard.press("Escape")
    expect(page.locator("#leds")).to_have_text("LEDs off, stopped")
    page.locator("#start").click()
    expect(page.locator("#line")).to_have_text("measuring")


def on_usb(browser, base, program, wanted, folder):
    """A camera on USB: chosen by a person, shown, switched, unplugged, plugged in again."""
    Files.camera = Camera(program)
    page = browser.new_page(viewport={"width": 1300, "height": 900})
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.add_init_script(DEVICE)
    page.goto(f"{base}/usb-camera/index.html")
    page.get_by_role("button", name="Use a camera on USB").click()
    page.wait_for_url("**?camera=usb", wait_until="commit", timeout=LIMIT_MS)
    expect(page.locator("#line")).to_have_text("measuring", timeout=LIMIT_MS)
    seen(page, "image", 32)
    looks_like(page, "image", wanted, 0.9)
    expect(page.locator("#scene")).to_be_hidden()
    # Nothing is lost between camera, page and program.
    page.wait_for_timeout(3000)
    received, *missed = counters(page)
    assert received > 100 and missed == [0, 0, 0], (received, missed)
    page.get_by_label("hadamard", exact=True).check()
    expect(page.locator("#about-image")).to_contain_text("hadamard, ")
    shot(page, folder, "usb")
    stopped(page)
    # Unplugged: the page says so, and measures again when the camera is back.
    Files.camera.process.kill()
    expect(page.locator("#line")).to_contain_text("trying again")
    Files.camera = Camera(program)
    expect(page.locator("#line")).to_have_text("measuring")
    page.get_by_role("button", name="Use the virtual camera").click()
    page.wait_for_url(lambda address: "camera=usb" not in address, wait_until="commit", timeout=LIMIT_MS)
    expect(page.locator("#line")).to_have_text("measuring", timeout=LIMIT_MS)
    expect(page.locator("#scene")).to_be_visible()
    assert not problems, problems
    page.close()
    Files.camera.process.kill()
    print(f"a camera on USB, by a device in place of the browser's own: {received} frames, none lost")


def rate(page, seconds=10):
    """Enhanced images a second."""
    shown = "() => Number(document.querySelectorAll('#account dd')[4].textContent.split(' of ')[0].replaceAll('\\u202f', ''))"
    expect(page.locator("#about-enhanced")).to_contain_text(" ms")
    before, began = page.evaluate(shown), time.monotonic()
    page.wait_for_timeout(1000 * seconds)
    got = (page.evaluate(shown) - before) / (time.monotonic() - began)
    took = f"{page.locator('#about-image').text_content()}; {page.locator('#about-enhanced').text_content()}"
    load = ", ".join(f"{part:.1f}" for part in os.getloadavg())
    print(f"{got:.1f} enhanced images/s ({took}); load of this machine {load} on {os.cpu_count()} cores")
    return got


def broken(browser, base):
    """What is wrong is said in words on the page."""
    for path, words in [
        ("missing", "nirspi_web.wasm cannot be read: the server answers 404. Reload the page"),
        ("cut", "this browser cannot run the program"),
        ("panic", "has stopped because of a bug: panicked at"),
    ]:
        page = browser.new_page()
        page.goto(f"{base}/{path}/index.html")
        expect(page.locator("#line")).to_contain_text(words, timeout=LIMIT_MS)
        expect(page.locator("body")).to_have_attribute("data-phase", "unserved")
        page.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder")
    parser.add_argument("in_turns")
    parser.add_argument("nirspi")
    parser.add_argument("--screenshots")
    parser.add_argument("--least", type=float, default=0.0)
    given = parser.parse_args()
    base = served(Files, given.folder)
    expect.set_options(timeout=LIMIT_MS)
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1300, "height": 900})
        page.set_default_timeout(LIMIT_MS)
        page.goto(f"{base}/page/style.css")
        equal(page, given.in_turns)
        asked, problems = watched(page)
        measuring(page, f"{base}/index.html")
        got = rate(page)
        letter = page.locator("#image").evaluate(LEVELS)
        drawn(page)
        shot(page, given.screenshots, "light")
        controls(page)
        shaken(page)
        stopped(page)
        fits(page)
        assert all(url.startswith(base) for url in asked), asked
        assert not problems, problems
        page.close()
        for name, scheme, width in [("dark", "dark", 1300), ("phone", "light", 390)]:
            context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": 844})
            page = context.new_page()
            measuring(page, base)
            fits(page)
            page.wait_for_timeout(3000)
            shot(page, given.screenshots, name)
            context.close()
        on_usb(browser, base, given.nirspi, letter, given.screenshots)
        broken(browser, base)
        browser.close()
    assert got >= given.least, f"{got:.1f} enhanced images/s, expected {given.least}"
    print("the camera in the browser: as it should be")


def shot(page, folder, name):
    if folder:
        page.screenshot(path=f"{folder}/{name}.png", full_page=True)


main()
