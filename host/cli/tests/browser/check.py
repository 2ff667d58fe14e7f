#!/usr/bin/env python3
"""The page of `nirspi serve` in a real browser: every control, the LEDs' switch, a fault, states told by hand, bad links, people
with their screens, keyboards and colours, proxies, the token, a phone, the end.

    python3 check.py target/release/nirspi [--screenshot docs/serve.png]

Needs playwright (PyPI) and chromium (Debian). Says what is wrong and exits 1, or prints what it saw.
"""

import argparse
import json
import re
import signal
import struct
import subprocess
import sys
import tempfile

from playwright.sync_api import expect, sync_playwright

# No compiled files beside the sources.
sys.dont_write_bytecode = True
import by_hand
import controls
import links
import people
import proxies
from pictures import LEVELS, fits, levels, seen

# No wait takes longer, on a busy machine either.
LIMIT_MS = 40_000


def live(page, address, screenshot):
    page.goto(address)
    seen(page, "image", 32)
    seen(page, "enhanced", 64)
    expect(page.locator("#simulated")).to_be_visible()
    expect(page.locator("#line")).to_have_text("measuring")
    before = levels(page, "image")
    page.wait_for_function(f"before => String(({LEVELS})(document.getElementById('image'))) !== before",
                           arg=",".join(map(str, before)))
    account = page.locator("#account")
    for name in ["received", "lost", "corrupt", "late", "shown"]:
        expect(account).to_contain_text(name)
    expect(page.locator("#rates dd").nth(2)).not_to_have_text("0.0")
    expect(page.locator("#estimates")).to_contain_text("of 64 px")
    delays = page.locator("#delays")
    for name in ["counted", "reconstructed", "enhanced", "sent"]:
        expect(delays).to_contain_text(re.compile(rf"{name}\d[\d.]*, \d[\d.]* ms"))
        assert delays.get_by_text(name, exact=True).get_attribute("title"), f"no tooltip for {name}"
    expect(page.locator("#overload")).to_be_hidden()
    fits(page)
    if screenshot:
        # Wide enough for all pictures in one row.
        page.set_viewport_size({"width": 1500, "height": 960})
        # Rates are those of whole seconds.
        page.wait_for_timeout(4000)
        page.screenshot(path=screenshot, full_page=True)


def saved(page):
    with page.expect_download() as saved:
        page.locator("#save").click()
    png = open(saved.value.path(), "rb").read()
    width, height = struct.unpack(">II", png[16:24])
    # Two pictures and their lines, of which there are more with warnings.
    assert width == 1072 and height >= 648 and (height - 560) % 22 == 0, f"the saved picture has {width} x {height} pixels"


def leds(page, browser, address):
    """Stop by button, by Escape and by space; start by a person; two pages show the same."""
    other = browser.new_page()
    other.goto(address)

    def both(words, phase):
        for each in [page, other]:
            expect(each.locator("#leds")).to_have_text(words)
            expect(each.locator("body")).to_have_attribute("data-phase", phase)

    both("LEDs on", "measuring")
    expect(page.locator("#stop")).to_contain_text("Esc")
    page.locator("#stop").click()
    both("LEDs off, stopped", "stopped")
    other.locator("#start").click()
    both("LEDs on", "measuring")
    # A control has the focus: Escape stops all the same, and space presses the control.
    page.get_by_label("hadamard").focus()
    page.keyboard.press("Escape")
    both("LEDs off, stopped", "stopped")
    page.locator("#start").click()
    both("LEDs on", "measuring")
    page.get_by_label("omp").focus()
    page.keyboard.press("Space")
    expect(page.locator("#about-image")).to_contain_text("omp")
    both("LEDs on", "measuring")
    # After a click the button does not keep the focus.
    with page.expect_download():
        page.locator("#save").click()
    page.keyboard.press("Space")
    both("LEDs off, stopped", "stopped")
    # A stop that does not arrive is said, and sent again.
    page.locator("#start").click()
    both("LEDs on", "measuring")
    page.route("**/api/stop", lambda route: route.abort())
    page.keyboard.press("Escape")
    expect(page.locator("#alarm")).to_be_visible()
    both_on = page.locator("#leds")
    expect(both_on).to_have_text("LEDs on")
    # The alarm covers neither the button nor what is known of the LEDs.
    for width, height in [(1280, 800), (1366, 768), (1440, 900), (390, 844), (844, 390), (320, 480)]:
        page.set_viewport_size({"width": width, "height": height})
        for share in [0, 0.5, 1]:
            page.evaluate("share => scrollTo(0, share * document.body.scrollHeight)", share)
            for name in ["stop", "leds", "alarm"]:
                box = page.locator(f"#{name}").bounding_box()
                on_top = page.evaluate("([x, y]) => document.elementFromPoint(x, y)?.closest('#stop, #leds, #alarm')?.id",
                                       [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
                assert on_top == name, f"{on_top} covers {name} at {width} x {height}, scrolled by {share}"
    page.evaluate("() => scrollTo(0, 0)")
    page.set_viewport_size({"width": 1200, "height": 960})
    page.unroute("**/api/stop")
    both("LEDs off, stopped", "stopped")
    expect(page.locator("#alarm")).to_be_hidden()
    other.locator("#start").click()
    both("LEDs on", "measuring")
    other.close()


def fault(browser, address):
    """A camera that has switched its LEDs off, told to a page by hand."""
    page = browser.new_page()
    state = json.loads(page.request.get(f"{address}/api/state").body())
    hostile = "<img src=x onerror=alert(1)>\u202egnp"
    state["camera"] |= {"phase": "fault", "leds": "off", "line": f"the camera switched its LEDs off: {hostile}"}
    state["camera"]["identity"] |= {"board": hostile, "serial": hostile}
    state["light"]["allowed"] = False
    state["frames"]["lost"] = 7
    state["run_frames"]["lost"] = 2
    state["overload"] |= {"show_every": 8, "enhancement_off": True, "line": f"the page shows every 8th image {hostile}"}
    state["events"] = [{"unix_ms": 0, "text": f"<b>not markup</b> {hostile}"}]
    message = json.dumps({"state": state, "image": None, "enhanced": None})
    page.route("**/api/next*", lambda route: route.fulfill(body=message, headers={"State-Age-Ms": "0"}))
    wishes = []
    page.on("dialog", lambda dialog: wishes.append(dialog.message))
    page.route("**/api/st*", lambda route: (
        wishes.append(route.request.url) if route.request.method == "POST" else None, route.fulfill(json={})))
    page.goto(address)
    expect(page.locator("#account .loss")).to_have_text("7")
    expect(page.locator("#losses")).to_contain_text("2 lost, 0 corrupt")
    expect(page.locator("#overload")).to_contain_text("the page shows every 8th image <img")
    expect(page.locator("#no-enhanced")).to_have_text("off: this computer is too slow")
    expect(page.locator("#events")).to_contain_text("<b>not markup</b>")
    # The names are text, and cannot turn the direction of other text.
    for name in ["camera", "events"]:
        expect(page.locator(f"#{name}")).to_contain_text("<img src=x onerror=alert(1)>\\u{202e}gnp")
    expect(page.locator("#start")).to_be_hidden()
    page.locator("#resume").click()
    page.wait_for_timeout(100)
    assert wishes == [f"{address}/api/start"], wishes
    assert page.locator("img").count() == 0
    page.close()


def token(browser, program):
    """The printed address opens the page of a server that other machines reach; without its token nothing does."""
    server = subprocess.Popen([program, "serve", "--listen", "0.0.0.0:0"], stdout=subprocess.PIPE, text=True)
    try:
        address = next(word for word in server.stdout.readline().split() if word.startswith("http://"))
        plain = address.split("/?token=")[0]
        page = browser.new_context().new_page()
        page.goto(plain)
        expect(page.locator("body")).to_contain_text("needs its token")
        page.goto(address)
        assert page.url == f"{plain}/", page.url
        seen(page, "image", 32)
        page.keyboard.press("Escape")
        expect(page.locator("#leds")).to_have_text("LEDs off, stopped")
        page.context.close()
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(10)


def phone(browser, address):
    page = browser.new_page(viewport={"width": 360, "height": 740}, color_scheme="dark")
    page.goto(address)
    seen(page, "image", 32)
    fits(page)
    page.close()


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("nirspi")
    arguments.add_argument("--screenshot")
    arguments = arguments.parse_args()
    folder = tempfile.TemporaryDirectory()
    server = subprocess.Popen([arguments.nirspi, "serve", "--listen", "127.0.0.1:0", "--record-to", folder.name],
                              stdout=subprocess.PIPE, text=True)
    try:
        address = next(word for word in server.stdout.readline().split() if word.startswith("http://"))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox", *proxies.BROWSER])
            page = browser.new_page(viewport={"width": 1200, "height": 960})
            page.set_default_timeout(LIMIT_MS)
            expect.set_options(timeout=LIMIT_MS)
            complaints = []
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
            live(page, address, arguments.screenshot)
            leds(page, browser, address)
            # The browser itself reports the request that was cut off.
            complaints = [said for said in complaints if "ERR_FAILED" not in said]
            saved(page)
            controls.picture(page)
            controls.measurement(page, folder.name)
            controls.display(page)
            controls.scene(page)
            controls.names(page)
            # The browser itself reports answers that refuse.
            complaints = [said for said in complaints if "400 (Bad Request)" not in said]
            assert not complaints, complaints
            fault(browser, address)
            for part in by_hand.PARTS + links.PARTS + people.PARTS:
                part(browser, address)
            token(browser, arguments.nirspi)
            proxies.proxies(browser, arguments.nirspi)
            phone(browser, address)
            server.send_signal(signal.SIGTERM)
            expect(page.locator("#line")).to_contain_text("does not answer")
            expect(page.locator("#leds")).to_have_text(re.compile(r"^LEDs unknown, last seen \d+ s ago: no answer from nirspi serve$"))
            browser.close()
        said = server.stdout.read()
        assert server.wait(10) == 0 and said.splitlines()[-1].startswith("stopped: "), said
        print(f"the page works in a browser; {said.strip()}")
    finally:
        server.kill()


if __name__ == "__main__":
    main()
