"""Bad links and many windows: what the page says of the LEDs, and whether a stop gets through."""

import json
import socket
import threading
import time
import urllib.request

from playwright.sync_api import expect


class Relay:
    """Carries bytes between browser and server, until it is told to carry none: without an end, as a cable that is out."""

    def __init__(self, address):
        self.to = address.rsplit("/", 1)[1].split(":")
        self.carries = threading.Event()
        self.carries.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                ours = self.listener.accept()[0]
                theirs = socket.create_connection((self.to[0], int(self.to[1])))
            except OSError:
                return
            for pair in [(ours, theirs), (theirs, ours)]:
                threading.Thread(target=self.carry, args=pair, daemon=True).start()

    def carry(self, source, sink):
        try:
            while data := source.recv(65536):
                self.carries.wait()
                sink.sendall(data)
            self.carries.wait()
            sink.shutdown(socket.SHUT_WR)
        except OSError:
            pass


def leds(address):
    return json.load(urllib.request.urlopen(f"{address}/api/state"))["camera"]["leds"]


def post(address, path):
    urllib.request.urlopen(urllib.request.Request(f"{address}{path}", method="POST"))


def waits(address, what, seconds=30):
    """Waits until the camera's LEDs are so; returns after how many seconds."""
    since = time.time()
    while leds(address) != what:
        assert time.time() - since < seconds, f"the LEDs are {leds(address)}, expected {what} within {seconds} s"
        time.sleep(0.02)
    return time.time() - since


def silent(browser, address):
    """The network carries nothing any more, and somebody else switches the LEDs: the page does not go on saying what was."""
    relay = Relay(address)
    page = browser.new_page()
    page.goto(relay.address)
    says = page.locator("#leds")
    expect(says).to_have_text("LEDs on")
    page.keyboard.press("Escape")
    expect(says).to_have_text("LEDs off, stopped")
    relay.carries.clear()
    post(address, "/api/start")
    # 2.5 s, and a busy machine.
    page.wait_for_timeout(3000)
    assert says.inner_text().startswith("LEDs unknown, last seen "), says.inner_text()
    assert leds(address) == "on"
    # A stop that cannot arrive is said after a second, and arrives when the network is there again.
    page.keyboard.press("Escape")
    page.wait_for_timeout(1300)
    expect(page.locator("#alarm")).to_be_visible()
    relay.carries.set()
    waits(address, "off")
    expect(says).to_have_text("LEDs off, stopped")
    expect(page.locator("#alarm")).to_be_hidden()
    page.locator("#start").click()
    expect(says).to_have_text("LEDs on")
    # The browser itself has no network.
    page.context.set_offline(True)
    expect(says).to_contain_text("LEDs unknown, last seen ", timeout=3500)
    page.context.set_offline(False)
    expect(says).to_have_text("LEDs on")
    page.context.close()
    relay.listener.close()


# The median time from an answer to the next question of a page; none without two answers.
WAIT_MS = """() => {
  const asked = performance.getEntriesByType("resource").filter(of => of.name.includes("/api/next") && of.responseEnd);
  const waits = asked.slice(1).map((next, at) => next.startTime - asked[at].responseEnd).sort((a, b) => a - b);
  return waits.length ? waits[waits.length >> 1] : 9999;
}"""


def windows(browser, address):
    """Twenty windows of the page: each one loads, shows the LEDs and stops them; one gets every image."""
    context = browser.new_context()
    pages = []
    for _ in range(20):
        pages.append(context.new_page())
        pages[-1].goto(address, wait_until="domcontentloaded")
    for page in pages:
        expect(page.locator("#leds")).to_have_text("LEDs on")
    slowest = 0
    for page in [pages[0], pages[9], pages[-1]]:
        page.keyboard.press("Escape")
        slowest = max(slowest, waits(address, "off", 5))
        expect(page.locator("#leds")).to_have_text("LEDs off, stopped")
        expect(page.locator("#alarm")).to_be_hidden()
        page.locator("#start").click()
        waits(address, "on")
        expect(page.locator("#leds")).to_have_text("LEDs on")
    for page in pages:
        page.evaluate("() => performance.clearResourceTimings()")
    pages[0].wait_for_timeout(4000)
    rates = sorted(page.locator("#rates dd").nth(2).inner_text() for page in pages)
    # On a busy machine no window has many images. How long a window waits before it asks again is its own choice.
    waits_ms = sorted(page.evaluate(WAIT_MS) for page in pages)
    assert waits_ms[0] < 400 <= waits_ms[1], f"ms from an answer to the next question, of each window: {waits_ms}"
    context.close()
    print(f"20 windows: LEDs off {slowest:.2f} s after Escape; images a second of each window: {rates}")


PARTS = [silent, windows]
