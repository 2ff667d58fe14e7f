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
    # 2.5 s, on a busy machine later.
    expect(says).to_contain_text("LEDs unknown, last seen ", timeout=6000)
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
    expect(says).to_contain_text("LEDs unknown, last seen ", timeout=6000)
    page.context.set_offline(False)
    expect(says).to_have_text("LEDs on")
    page.context.close()
    relay.listener.close()


# Counts the questions of a page for the next state, and the pauses of about half a second before a question. Times would
# be those of a busy machine, too.
COUNTS = """
  window.counts = { questions: 0, pauses: 0 };
  const ask = window.fetch, later = window.setTimeout;
  window.fetch = (address, ...rest) => {
    if (String(address).includes("/api/next")) counts.questions += 1;
    return ask(address, ...rest);
  };
  window.setTimeout = (call, ms, ...rest) => {
    if (ms >= 400 && ms <= 600) counts.pauses += 1;
    return later(call, ms, ...rest);
  };
"""


def pauses(pages):
    """How many pauses each window has made, while each has asked at least four times."""
    for page in pages:
        page.evaluate("() => Object.assign(counts, { questions: 0, pauses: 0 })")
    for page in pages:
        page.wait_for_function("() => counts.questions >= 4")
    return sorted(page.evaluate("() => counts.pauses") for page in pages)


def windows(browser, address):
    """Twenty windows of the page: each one loads, shows the LEDs and stops them; one gets every image."""
    context = browser.new_context()
    context.add_init_script(COUNTS)
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
    # The window that asks for every image may change while they are counted: it is the one that was looked at last.
    until = time.time() + 60
    while not (made := pauses(pages))[0] == 0 < made[1]:
        assert time.time() < until, f"pauses of each window, expected 0 of one alone: {made}"
    rates = sorted(page.locator("#rates dd").nth(2).inner_text() for page in pages)
    context.close()
    print(f"20 windows: LEDs off {slowest:.2f} s after Escape; images a second of each window: {rates}")


PARTS = [silent, windows]
