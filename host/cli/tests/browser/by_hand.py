"""Pages that the test tells a state by hand: each number, unit and warning in its place, what each control sends, and what a
page does when the program falls silent and comes back. No camera takes part, so every number is known."""

import base64
import copy
import json
import math
import re
import struct

from pictures import levels, numbers, png, rows
from playwright.sync_api import expect

# In place of the program's answers to "what is next?" and of the browser's canvas: the test tells the messages, and sees what is
# written. The message that was told last is told again and again, as the program does, until the test silences it.
IN_PLACE = """
window.asks = [];
window.asked = 0;
window.told = null;
window.isSilent = false;
const fetchBefore = window.fetch;
window.fetch = (address, options) => !String(address).includes("api/next") ? fetchBefore(address, options)
  : new Promise((answer, fail) => {
    window.asked++;
    const ask = { answer };
    window.asks.push(ask);
    options.signal.addEventListener("abort", () => {
      window.asks = window.asks.filter(other => other !== ask);
      fail(options.signal.reason);
    });
  });
window.tell = (message, age = 0) => {
  [window.told, window.toldAt] = [message, performance.now()];
  for (const ask of window.asks.splice(0)) ask.answer(new Response(message, { headers: { "State-Age-Ms": age } }));
};
window.toldAt = 0;
setInterval(() => {
  if (window.told && !window.isSilent && performance.now() - window.toldAt > 1300) window.tell(window.told);
}, 100);
window.written = [];
const fillText = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) { written.push(text); fillText.call(this, text, ...rest); };
"""

# What the told images are: (32, 32) and (64, 64), left to right and top to bottom.
COUNTS = [float(at) for at in range(1024)]
READINGS = [math.nan if at == 33 else at - 100.0 for at in range(1024)]
ENHANCED = [at / 4096 for at in range(4096)]
INTERVAL = [at / 8192 for at in range(4096)]
DEPTH_M = [0.25 + at / 1024 for at in range(1024)]


def packed(values):
    return base64.b64encode(struct.pack(f"<{len(values)}f", *values)).decode()


def message(given):
    """A message in which no two numbers are equal."""
    state = copy.deepcopy(given)
    percentiles = [{"p50_ms": p50, "p99_ms": p99} for p50, p99 in [(1.2, 2.5), (3.4, 5.6), (7.8, 34.2), (12.4, 1234.5)]]
    state["camera"] |= {"phase": "measuring", "leds": "on", "line": "measuring", "simulated": True, "address": "usb:77", "leds_age_ms": 0}
    state["camera"]["identity"] |= {
        "board": "bench",
        "serial": "77",
        "wavelength_nm": 1551,
        "adc_hz": 125_000_000,
        "adc_bits": 14,
    }
    state["camera"]["versions"] = [
        {"name": "firmware", "camera": "1.2.3", "expected": "1.3.0", "advice": "update the firmware"},
        {"name": "gateware", "camera": "0.4.0", "expected": "0.4.0", "advice": None},
    ]
    state["camera"]["measurement"] = {
        "patterns": 512,
        "order": "zig-zag",
        "differential": True,
        "sweeps": 3,
        "frame_us": 122.88,
        "calibrated": True,
    }
    state["light"] |= {"allowed": True}
    state["frames"] |= {"received": 12345, "lost": 7, "corrupt": 5, "late": 3}
    state["run_frames"] |= {"received": 2345, "lost": 1, "corrupt": 0, "late": 2}
    state["images"] |= {"shown": 11, "failed": 2}
    state["rates"] |= {"camera_frames_per_s": 4882.6, "images_per_s": 24.3}
    state["viewers"] = 4
    state["offered"]["records"] = True
    state["delays"] |= dict(zip(["counted", "reconstructed", "enhanced", "sent"], percentiles))
    state["overload"] |= {"camera_thread": 0.42, "recording_queue": 0.17, "enhancement_off": False, "line": None}
    state["settings"] |= {
        "method": "tv",
        "strength": 0.5,
        "warm_start": True,
        "enhance": True,
        "model": "gan",
        "frames": 64,
        "order": "zig-zag",
        "sampling": 0.25,
        "sweeps": 3,
        "record": False,
    }
    state["picture"] = {
        "n": 32,
        "height": 32,
        "width": 32,
        "unit": "ADC counts",
        "arrived_unix_ms": 1_764_000_000_123,
        "method": "tv",
        "order": "natural",
        "patterns": 256,
        "sweeps": 4,
        "run_frames": {"received": 640, "lost": 3, "corrupt": 2, "late": 1},
        "past": None,
        "frames": 64,
        "white_counts": 1000.0,
        "reconstruct_ms": 6.7,
        "warnings": [],
        "frame_warnings": [],
        "short_warnings": [],
        "enhancement": {"model": "gan", "enhance_ms": 8.9, "depth": True, "blur_px": 1.23, "noise": 0.045, "inconsistency": 0.87},
    }
    state["problem"] = None
    state["scene"] = {"name": "letter R", "distance_m": 0.3, "weather": "none", "changing": False, "problem": None}
    state["line"] = {"damage": 0, "bytes": 123456, "flipped": 21, "dropped": 9}
    state["events"] = [{"unix_ms": 1000 * at, "level": "info", "text": f"event {at}"} for at in range(3)]
    return {
        "state": state,
        "image": packed(COUNTS),
        "readings": packed(READINGS),
        "enhanced": packed(ENHANCED),
        "interval": packed(INTERVAL),
        "depth": packed(DEPTH_M),
    }


class Told:
    """A page, the message that it is told next, and what it has sent."""

    def __init__(self, browser, address, **options):
        self.page = browser.new_page(viewport={"width": 1200, "height": 960}, timezone_id="UTC", **options)
        given = json.loads(self.page.request.get(f"{address}/api/state").body())
        self.message = message(given)
        self.sent, self.answer, self.state_number = [], {"json": {}}, 0
        self.page.add_init_script(IN_PLACE)
        self.page.route("**/api/**", self.asked)
        self.page.goto(address)
        self.tell()

    def asked(self, route):
        request = route.request
        if request.method == "POST":
            body = request.post_data
            self.sent.append((request.url.split("/api/")[1], json.loads(body) if body else None))
        route.fulfill(**self.answer)

    def tell(self, **changes):
        """Tells the page its message, of which parts of the state change for good. What it then says of the LEDs at once."""
        for part, change in changes.items():
            state = self.message["state"]
            state[part] = state[part] | change if isinstance(change, dict) and state[part] else change
        self.state_number += 1
        self.message["state"]["number"] = self.state_number
        # The page asks again when it has shown what it was told.
        return self.page.evaluate(
            """async message => {
          const until = async is => { while (!is()) await new Promise(done => setTimeout(done, 5)); };
          await until(() => asks.length);
          const before = asked;
          tell(message);
          await until(() => asked > before);
          return document.getElementById("leds").innerText;
        }""",
            json.dumps(self.message),
        )

    def sends(self, *expected):
        """What the page has sent since the last look."""
        for _ in range(100):
            if len(self.sent) >= len(expected):
                break
            self.page.wait_for_timeout(50)
        # One more than expected would come now.
        self.page.wait_for_timeout(50)
        assert self.sent == list(expected), f"sent {self.sent}, expected {list(expected)}"
        self.sent.clear()

    def stops(self):
        """The page has sent a stop, and nothing else. On a busy machine it may send a second one before the first is confirmed."""
        for _ in range(100):
            if self.sent:
                break
            self.page.wait_for_timeout(50)
        assert self.sent and set(self.sent) == {("stop", None)}, f"sent {self.sent}, expected a stop"
        self.sent.clear()

    def will_have(self, name, words):
        """The same once the page has the answer to its last command."""
        for _ in range(100):
            self.tell()
            if self.page.locator(f"#{name}").inner_text() == words:
                break
            self.page.wait_for_timeout(50)
        self.has(name, words)

    def has(self, name, words):
        found = self.page.locator(f"#{name}").inner_text()
        assert found == words, f"#{name}: found {found!r}, expected {words!r}"


def facts(browser, address):
    """Every number with its name and unit, and every line that says what is wrong."""
    told = Told(browser, address)
    page = told.page
    assert page.title() == "nirspi 77", page.title()
    told.has("camera", "bench 77")
    told.has("losses", "this run: 2\u202f345 received, 1 lost, 0 corrupt, 2 late")
    expect(page.locator("#losses")).to_have_class("loss")
    told.tell(run_frames={"lost": 0, "late": 0})
    told.has("losses", "this run: 2\u202f345 received, 0 lost, 0 corrupt, 0 late")
    expect(page.locator("#losses")).not_to_have_class("loss")
    told.has("since", "of all runs")
    assert rows(page, "account") == [
        ["received", "12\u202f345", ""],
        ["lost", "7", "loss"],
        ["corrupt", "5", "loss"],
        ["late", "3", "loss"],
        ["shown", "11 of 12\u202f345", ""],
        ["frames without an image", "2", "loss"],
    ], rows(page, "account")
    rates = rows(page, "rates")
    # The one image of this page, in the second in which it came.
    assert float(rates[2][1]) <= 1, rates
    assert rates == [
        ["frames from the camera", "4\u202f883", ""],
        ["images reconstructed", "24.3", ""],
        ["images on this page", rates[2][1], ""],
        ["open pages", "4", ""],
    ], rates
    delays = [
        ["counted", "1.2, 2.5 ms", ""],
        ["reconstructed", "3.4, 5.6 ms", ""],
        ["enhanced", "7.8, 34 ms", ""],
        ["sent", "12, 1\u202f235 ms", ""],
        ["load", "42 %", ""],
    ]
    assert rows(page, "delays") == delays, rows(page, "delays")
    assert rows(page, "estimates") == [
        ["blur", "1.23 of 64 px", ""],
        ["noise", "0.045 of white", ""],
        ["inconsistency", "0.87", ""],
        ["white", "1000.0 ADC counts", ""],
    ], rows(page, "estimates")
    assert rows(page, "identity") == [
        ["address", "usb:77", ""],
        ["firmware", "1.2.3, expected 1.3.0", "loss"],
        ["gateware", "0.4.0", ""],
        ["LEDs", "1551 nm", ""],
        ["ADC", "125 MS/s, 14 bit", ""],
        ["patterns", "512 of 1\u202f024", ""],
        ["order", "zig-zag", ""],
        ["light for one frame", "122.9 µs", ""],
        ["settling", "corrected", ""],
    ], rows(page, "identity")
    told.has("about-image", "tv, 64 frames, 6.7 ms")
    told.has("about-enhanced", "gan, 8.9 ms")
    told.has("scene-name", "letter R, 0.3 m, none")
    told.has("line-bytes", "123\u202f456 bytes passed, 21 flipped, 9 lost")
    # What is wrong is said where it belongs, as text, and goes when it is over.
    told.has("notes", "update the firmware")
    told.tell(
        problem="no image: <b>light</b>\u202e",
        picture={
            "warnings": ["the noise is high"],
            "short_warnings": ["noisy"],
            "frame_warnings": ["over range"],
            "past": "its past",
        },
    )
    told.has("notes", "no image: <b>light</b>\\u{202e}; the noise is high; update the firmware")
    told.has("doubt", "noisy")
    told.has("alert", "over range")
    told.has("about-image", "tv, recursive, 64 frames, 6.7 ms")
    told.tell(problem=None, picture={"warnings": [], "short_warnings": [], "frame_warnings": [], "past": None})
    told.has("notes", "update the firmware")
    for name in ["doubt", "alert"]:
        expect(page.locator(f"#{name}")).to_be_hidden()
    # While a recording is made, the first delay is that to the recording.
    told.tell(settings={"record": True})
    delays[0][0] = "recorded"
    assert rows(page, "delays") == [*delays, ["recording queue", "17 %", ""]], rows(page, "delays")
    # Events come newest first, and as many others in their place are shown.
    events = page.locator("#events li").all_text_contents
    assert events() == ["00:00:02event 2", "00:00:01event 1", "00:00:00event 0"], events()
    told.tell(events=[{"unix_ms": 3_601_000 + 1000 * at, "level": "info", "text": f"later {at}"} for at in range(3)])
    assert events() == ["01:00:03later 2", "01:00:02later 1", "01:00:01later 0"], events()
    # Frames that were lost before the page was there are no losses of these two minutes; the next ones are.
    plots = {
        "frames": "frames a second: now 4\u202f883",
        "images": "images a second: now 24.3",
        "delay": "delay, p99, ms: now 1235",
        "losses": "frames not received: now 3.0",
        "signal": "signal: now 1000.0",
        "snr": "signal to noise: now 22.2",
    }
    page.wait_for_timeout(600)
    told.tell(frames={"lost": 9, "late": 4})
    for name, words in plots.items():
        label = page.locator(f"#{name}-plot").get_attribute("aria-label")
        assert label.startswith(words), f"{name}: {label}"
    assert "between 0.0 and 3.0" in page.locator("#losses-plot").get_attribute("aria-label")
    counted_anew(told)
    page.close()


def counted_anew(told):
    """A person sets the counters of this page to 0: what was lost before is no loss any more, what is lost then is."""
    page = told.page
    page.locator("#reset").click()
    assert re.fullmatch(r"since \d\d:\d\d:\d\d", page.locator("#since").inner_text()), page.locator("#since").inner_text()
    assert rows(page, "account") == [
        ["received", "0", ""],
        ["lost", "0", ""],
        ["corrupt", "0", ""],
        ["late", "0", ""],
        ["shown", "0 of 0", ""],
    ], rows(page, "account")
    told.tell(frames={"received": 12400, "lost": 10}, images={"shown": 13})
    assert [row[1] for row in rows(page, "account")] == ["55", "1", "0", "0", "2 of 55"], rows(page, "account")
    assert rows(page, "account")[1][2] == "loss"
    # A program that was started again has counted less.
    told.tell(frames={"received": 5, "lost": 0, "corrupt": 0, "late": 0}, images={"shown": 1, "failed": 0})
    told.has("since", "of all runs")
    assert [row[1] for row in rows(page, "account")] == ["5", "0", "0", "0", "1 of 5"], rows(page, "account")


def pointed(page, name, side, x, y, height=None):
    """What the page says of the pixel under the cursor, in an image of this side, or of this width and height."""
    box = page.locator(f"#{name}").bounding_box()
    at = {"x": (x + 0.5) * box["width"] / side, "y": (y + 0.5) * box["height"] / (height or side)}
    page.locator(f"#{name}").hover(position=at)
    return page.locator(f"#{name}-value").inner_text()


def pictures(browser, address):
    """Every image with its scale and units, earlier images, and what is saved."""
    told = Told(browser, address)
    page = told.page
    reading = sorted(abs(value) for value in READINGS if not math.isnan(value))[971]
    for name, side, words, ends in [
        ("readings", 32, "pattern 652: 552.00 ADC counts", [f"-{reading:.2f} ADC counts", f"{reading:.2f} ADC counts"]),
        ("image", 32, "row 20, column 12: 652.0 ADC counts, 65 % of white", ["0.0 ADC counts", "1000.0 ADC counts"]),
        ("enhanced", 64, "row 20, column 12: 31.5 % of white", ["0.0 % of white", "100.0 % of white"]),
        ("interval", 64, "row 20, column 12: 15.8 % of white", ["0.0 % of white", "50.0 % of white"]),
        ("depth", 32, "row 20, column 12: 0.887 m", ["0.250 m", "1.249 m"]),
    ]:
        found = pointed(page, name, side, 12, 20)
        assert found == words, f"{name}: found {found!r}, expected {words!r}"
        bar = page.locator(f"#{name}-bar span").all_inner_texts()
        assert bar == ends, f"{name}: found {bar}, expected {ends}"
    assert pointed(page, "readings", 32, 1, 1) == "pattern 33: not measured"
    seen = levels(page, "image")
    assert all(abs(level - min(255, 255 * at / 1000)) <= 1 for at, level in enumerate(seen)), "grey is in proportion to counts"
    page.locator("#range").select_option("fixed")
    page.locator("#low").fill("20")
    page.locator("#high").fill("80")
    bar = page.locator("#image-bar span").all_inner_texts()
    assert bar == ["200.0 ADC counts", "800.0 ADC counts"], bar
    page.locator("#range").select_option("white")
    saved(told)
    history(told)
    # A state without images shows none.
    told.message |= dict.fromkeys(["image", "readings", "enhanced", "interval", "depth"])
    told.tell(picture=None, images={"shown": 0}, settings={"enhance": False})
    for name in ["image", "enhanced", "readings"]:
        expect(page.locator(f"#no-{name}")).to_be_visible()
        expect(page.locator(f"#{name}-bar")).to_be_hidden()
    for name in ["interval", "depth"]:
        expect(page.locator(f"#{name}-panel")).to_be_hidden()
    told.has("about-image", "")
    assert set(levels(page, "image")) == {0}, "an image that is gone is still drawn"
    page.close()


def saved(told):
    """The sheet says whose image it is, and the arrays have the numbers that were told."""
    page = told.page
    doubt = "the readings contradict the image, so its strokes are not to be trusted"
    told.tell(picture={"warnings": [doubt]})
    page.evaluate("written.length = 0")
    with page.expect_download():
        page.locator("#save").click()
    lines = [line for line in page.evaluate("written") if not re.fullmatch(r"[\d.\u202f]+(, at most [\d.\u202f]+)?", line)]
    assert lines == [
        "simulated; bench 77, 2025-11-24T16:00:00.123Z, scene letter R, 0.30 m, none",
        "natural order, 256 of 1024 patterns, sweeps in a frame: 4, 64 frames",
        "tv, white 1000.0 ADC counts; enlarged and deblurred: blur 1.23 px, noise 0.045 of white",
        "this run: 640 received, 3 lost, 2 corrupt, 1 late",
        f"warning: {doubt}",
    ], lines
    told.tell(picture={"warnings": []})
    files = []
    page.on("download", lambda file: files.append(file))
    page.locator("#save-npy").click()
    for _ in range(100):
        if len(files) < 2:
            page.wait_for_timeout(50)
    found = {file.suggested_filename: numbers(file.path()) for file in files}
    assert sorted(side for side, _ in found.values()) == [32, 64], found.keys()
    assert all(list(values) == (COUNTS if side == 32 else ENHANCED) for side, values in found.values()), "other numbers"
    assert all(name.startswith("nirspi-") and name.endswith(".npy") for name in found), found.keys()


def history(told):
    """Earlier images stay while newer ones arrive, and as many are kept as the page says."""
    page = told.page

    def image(number):
        told.message["image"] = packed([1000.0 * (at == number) for at in range(1024)])
        told.tell(images={"shown": 100 + number})

    for number in [1, 2, 3]:
        image(number)
    lit = lambda: [at for at, level in enumerate(levels(page, "image")) if level == 255]
    assert lit() == [3], lit()
    page.locator("#scrub").press("ArrowLeft")
    assert lit() == [2], lit()
    expect(page.locator("#scrub-text")).to_have_text(re.compile(r"^1 image back, \d\.\d s ago$"))
    image(4)
    assert lit() == [2], lit()
    expect(page.locator("#scrub-text")).to_have_text(re.compile(r"^2 images back, \d\.\d s ago$"))
    page.locator("#live").click()
    assert lit() == [4], lit()
    page.evaluate(
        """async message => {
      for (let number = 1000; number < 1310; number++) {
        message.state.images.shown = number;
        while (!asks.length) await new Promise(done => setTimeout(done, 1));
        tell(JSON.stringify(message));
      }
    }""",
        told.message,
    )
    assert page.locator("#scrub").get_attribute("max") == "299"
    # The images on this page are counted in whole seconds. Those of a busy machine may come in the second after.
    found = []
    for number in range(5, 15):
        page.wait_for_timeout(1100)
        image(number)
        found.append(float(dict(row[:2] for row in rows(page, "rates"))["images on this page"]))
        if 0.1 <= found[-1] < 1:
            break
    assert 0.1 <= found[-1] < 1, f"one image in somewhat over a second: {found} a second"


def controls(browser, address):
    """What each control shows, and what it sends."""
    told = Told(browser, address)
    page = told.page
    for name, value in {
        "strength": "0.5",
        "sampling": "25",
        "sweeps": "3",
        "frames": "6",
        "order": "zig-zag",
        "model": "gan",
        "distance": "0.3",
        "weather": "none",
    }.items():
        expect(page.locator(f"#{name}")).to_have_value(value)
    told.has("frames-text", "64 frames")
    for name in ["warm-start", "enhance"]:
        expect(page.locator(f"#{name}")).to_be_checked()
    expect(page.get_by_label("tv", exact=True)).to_be_checked()
    told.has("record", "Record")
    told.tell(settings={"frames": 1, "strength": None, "order": "order.txt", "record": True})
    told.has("frames-text", "1 frame")
    expect(page.locator("#strength")).to_have_value("")
    expect(page.locator("#order")).to_have_value("order.txt")
    told.has("record", "End the recording")
    # Every method and order says what it is.
    state = told.message["state"]
    about = dict(zip(state["offered"]["methods"], state["offered"]["about"]))
    for method, words in about.items():
        assert page.get_by_label(method, exact=True).locator("..").get_attribute("title") == words, method

    def enters(name, text, *expected):
        page.locator(f"#{name}").fill(text)
        page.locator(f"#{name}").press("Enter")
        told.sends(*expected)

    page.get_by_label("omp", exact=True).check()
    told.sends(("settings", {"method": "omp"}))
    enters("strength", "300", ("settings", {"strength": 300}))
    enters("strength", "", ("settings", {"strength": "auto"}))
    enters("sampling", "30", ("settings", {"sampling": 0.3}))
    enters("sweeps", "2", ("settings", {"sweeps": 2}))
    page.locator("#order").select_option("natural")
    told.sends(("settings", {"order": "natural"}))
    page.locator("#model").select_option("diffusion")
    told.sends(("settings", {"model": "diffusion"}))
    page.locator("#warm-start").uncheck()
    told.sends(("settings", {"warm_start": False}))
    page.locator("#frames").fill("3")
    told.sends(("settings", {"frames": 8}))
    told.has("frames-text", "8 frames")
    page.locator("#record").click()
    told.sends(("settings", {"record": False}))
    # A message that was under way does not set a control back; a later one does.
    page.locator("#enhance").uncheck()
    told.sends(("settings", {"enhance": False}))
    told.tell()
    expect(page.locator("#enhance")).not_to_be_checked()
    page.wait_for_timeout(1100)
    told.tell()
    expect(page.locator("#enhance")).to_be_checked()
    # A field in which a person types keeps what is typed.
    page.locator("#sampling").fill("77")
    told.tell()
    expect(page.locator("#sampling")).to_have_value("77")
    page.locator("#sampling").press("Enter")
    told.sends(("settings", {"sampling": 0.77}))
    # What is refused is said until something is accepted.
    told.answer = {"status": 400, "content_type": "text/plain", "body": "sweeps is 9, expected less"}
    enters("sweeps", "9", ("settings", {"sweeps": 9}))
    told.will_have("notes", "sweeps is 9, expected less; update the firmware")
    told.answer = {"json": {}}
    enters("sweeps", "4", ("settings", {"sweeps": 4}))
    told.will_have("notes", "update the firmware")
    lights(told)
    scene(told, enters)
    # The line, held and let go.
    page.locator("#damage").fill("2")
    told.sends(("line", {"damage": 0.0001}))
    told.tell(line={"damage": 0.0001})
    told.has("damage-text", "1 byte in 10\u202f000 is damaged")
    page.locator("#shake").focus()
    page.keyboard.down("Enter")
    told.sends(("line", {"damage": 0.001}))
    page.keyboard.up("Enter")
    told.sends(("line", {"damage": 0.0001}))
    page.close()


def lights(told):
    """What is said of the LEDs in every phase, which buttons there are, and what they send."""
    page = told.page
    for phase, leds, allowed, words, button in [
        ("measuring", "on", True, "LEDs on", None),
        ("preparing", "off", True, "LEDs off", None),
        ("measuring", "on", False, "stopping", "start"),
        ("stopped", "off", False, "LEDs off, stopped", "start"),
        ("fault", "off", False, "LEDs off, stopped", "resume"),
        ("uncalibrated", "off", False, "LEDs off, stopped", "try-again"),
        ("lost", "unknown", True, "LEDs unknown, last seen 0 s ago: no answer from the camera", None),
    ]:
        told.answer = {"json": {"run": False, "command": 50}}
        told.tell(camera={"phase": phase, "leds": leds, "line": f"it is {phase}"}, light={"allowed": allowed})
        told.has("leds", words)
        told.has("line", f"it is {phase}")
        assert page.locator("body").get_attribute("data-leds") == leds
        for each in ["start", "resume", "try-again"]:
            if each != button:
                expect(page.locator(f"#{each}")).to_be_hidden()
        if phase == "fault":
            told.has("wavelength", "1551")
        if button:
            page.locator(f"#{button}").click()
            told.sends(("start", None))
        for stop in [page.locator("#stop").click, lambda: page.keyboard.press("Escape"), lambda: page.keyboard.press("Space")]:
            stop()
            told.stops()
            # A confirmed stop is not sent again.
            told.tell(camera={"leds": "off"}, light={"allowed": False, "commands": 50})
    told.sent.clear()
    page.wait_for_timeout(1100)
    told.sends()
    expect(page.locator("#alarm")).to_be_hidden()
    # A stop that the camera does not confirm is said after a second, and sent again; a state from before it confirms nothing.
    told.answer = {"json": {"run": False, "command": 51}}
    page.keyboard.press("Escape")
    told.stops()
    told.tell()
    page.wait_for_timeout(1300)
    expect(page.locator("#alarm")).to_contain_text("The camera has not confirmed that its LEDs are off")
    told.stops()
    told.tell(light={"commands": 51})
    expect(page.locator("#alarm")).to_be_hidden()
    told.answer = {"json": {}}
    told.tell(camera={"phase": "measuring", "leds": "on", "line": "measuring"}, light={"allowed": True})


def scene(told, enters):
    """What each control of the scene sends, and what cannot be shown."""
    page = told.page
    page.locator("#scene summary").click()
    enters("letter", "A", ("scene", {"scene": "letter:A"}))
    enters("letter", "AB", ("scene", {"scene": "word:AB"}))
    page.locator("#white").click()
    told.sends(("scene", {"scene": "white"}))
    enters("distance", "0.4", ("scene", {"distance_m": 0.4}))
    enters("weather", "fog:5m", ("scene", {"weather": "fog:5m"}))
    enters("weather", "", ("scene", {"weather": "none"}))
    # A spot of half the light in the middle.
    page.locator("#brush-level").fill("0.5")
    page.locator("#brush-size").fill("8")
    page.locator("#drawing").focus()
    page.keyboard.press("Space")
    drawn = levels(page, "drawing")
    assert drawn[32 * 64 + 32] == 128 and drawn[32 * 64 + 40] == 0, drawn[32 * 64 + 24 : 32 * 64 + 42]
    told.sends(("scene", {"scene": {"side": 64, "levels": base64.b64encode(bytes(drawn)).decode()}}))
    # A picture that is wider than it is high lies in the middle, whole.
    page.locator("#picture").set_input_files(
        {"name": "wide.png", "mimeType": "image/png", "buffer": png(64, lambda x, y: 255, 32)}
    )
    expected = [255 if 16 <= at // 64 < 48 else 0 for at in range(4096)]
    told.sends(("scene", {"scene": {"side": 64, "levels": base64.b64encode(bytes(expected)).decode()}}))
    # A picture that cannot be read is named until the next scene; what the camera refuses is said as text.
    page.locator("#picture").set_input_files({"name": "bad.png", "mimeType": "image/png", "buffer": b"no picture"})
    expect(page.locator("#scene-problem")).to_have_text("bad.png is not a picture that this browser can read")
    told.tell()
    told.has("scene-problem", "bad.png is not a picture that this browser can read")
    page.locator("#white").click()
    told.sends(("scene", {"scene": "white"}))
    told.tell()
    told.has("scene-problem", "")
    told.tell(scene={"problem": "too dark <i>\u202e"})
    told.has("scene-problem", "too dark <i>\\u{202e}")


def stream(browser, address):
    """What a page does when the program does not answer, when it comes back, and while the tab is hidden."""
    told = Told(browser, address)
    page = told.page
    told.tell(camera={"phase": "stopped", "leds": "off"}, light={"allowed": False})
    expect(page.locator("#start")).to_be_visible()
    # What the program refuses is said.
    page.evaluate(
        """() => { isSilent = true; for (const ask of asks.splice(0)) ask.answer(new Response("nirspi needs its token\\n", { status: 401 })); }"""
    )
    expect(page.locator("#line")).to_have_text("nirspi needs its token")
    assert re.fullmatch(r"LEDs unknown, last seen \d s ago: no answer from nirspi serve", page.locator("#leds").inner_text())
    for attribute, value in [("data-phase", "unserved"), ("data-leds", "unknown")]:
        assert page.locator("body").get_attribute(attribute) == value, attribute
    expect(page.locator("#start")).to_be_hidden()
    # The page asks again.
    page.wait_for_function("() => asks.length === 1")
    page.evaluate("() => { isSilent = false; }")
    told.answer = {"json": {}}
    # The program has started again: its counters begin anew, and its first image has the number of an earlier one.
    told.message["image"] = packed([1000.0 * (at < 512) for at in range(1024)])
    told.message["state"]["frames"] = {"received": 1, "lost": 0, "corrupt": 0, "late": 0}
    told.message["state"]["run_frames"] = {"received": 1, "lost": 0, "corrupt": 0, "late": 0}
    told.tell(
        camera={"phase": "measuring", "leds": "on"},
        light={"allowed": True},
        images={"shown": 1, "failed": 0},
        events=[{"unix_ms": 0, "level": "info", "text": "again"}],
    )
    told.has("line", "measuring")
    told.has("leds", "LEDs on")
    told.has("losses", "this run: 1 received, 0 lost, 0 corrupt, 0 late")
    assert page.locator("#events li").all_text_contents() == ["00:00:00again"]
    assert [row[2] for row in rows(page, "account")] == [""] * 5, rows(page, "account")
    assert levels(page, "image") == [255] * 512 + [0] * 512
    page.wait_for_timeout(600)
    told.tell()
    assert page.locator("#losses-plot").get_attribute("aria-label").startswith("frames not received: now 0.0, between 0.0 and 0.0 ")
    silent(told)
    # A hidden page asks for nothing, and asks again when it is shown.
    for is_hidden in [True, False]:
        page.evaluate(
            """is => { Object.defineProperty(document, "hidden", { value: is, configurable: true });
          document.dispatchEvent(new Event("visibilitychange")); }""",
            is_hidden,
        )
        page.wait_for_timeout(300)
        assert page.evaluate("asks.length") <= (0 if is_hidden else 1)
        before = page.evaluate("asked")
        page.wait_for_timeout(1600)
        assert (page.evaluate("asked") > before) is not is_hidden
    # A command that does not arrive says so too.
    page.route("**/api/settings", lambda route: route.abort())
    page.locator("#sweeps").fill("5")
    page.locator("#sweeps").press("Enter")
    expect(page.locator("body")).to_have_attribute("data-phase", "unserved")
    page.close()


def silent(told):
    """A link on which nothing comes any more, without an end: the page says how old its state is, and believes no old message."""
    page, leds = told.page, told.page.locator("#leds")
    assert told.tell(camera={"phase": "stopped", "leds": "off"}, light={"allowed": False}) == "LEDs off, stopped"
    page.evaluate("() => { isSilent = true; }")
    page.wait_for_timeout(1000)
    told.has("leds", "LEDs off, stopped")
    page.wait_for_timeout(1600)
    assert re.fullmatch(r"LEDs unknown, last seen \d s ago: no answer from nirspi serve", leds.inner_text()), leds.inner_text()
    told.has("line", "nirspi serve does not answer; trying again")
    assert page.locator("body").get_attribute("data-phase") == "unserved"
    assert re.fullmatch(r"last seen \d s ago", page.locator("#scrub-text").inner_text())
    assert {row[1] for row in rows(page, "rates")} == {"–"}, rows(page, "rates")
    expect(page.locator("#start")).to_be_hidden()
    page.wait_for_timeout(2000)
    assert re.fullmatch(r"LEDs unknown, last seen \d s ago.*", leds.inner_text()), leds.inner_text()
    # A message that is old when it comes, as one that waited in a proxy, says nothing of now.
    page.wait_for_function("() => asks.length")
    page.evaluate("() => tell(told, 9000)")
    page.wait_for_timeout(100)
    # On a busy machine a little later.
    assert re.fullmatch(r"LEDs unknown, last seen (9|1\d) s ago.*", leds.inner_text()), leds.inner_text()
    # What comes in time holds again, the same image too.
    page.evaluate("() => { isSilent = false; }")
    expect(leds).to_have_text("LEDs off, stopped")
    expect(page.locator("#scrub-text")).to_have_text("live")
    # The camera's word was old when the state brought it: both ages together count.
    assert told.tell(camera={"leds": "off", "leds_age_ms": 1500}) == "LEDs off, stopped"
    page.evaluate("() => { isSilent = true; }")
    expect(leds).to_have_text(re.compile(r"LEDs unknown, last seen [23] s ago: no answer from the camera"), timeout=2000)
    page.evaluate("() => { isSilent = false; }")
    # The LEDs are on in a message that was two seconds old when it came, and nothing follows. Its age counts before the question
    # without an answer is given up.
    told.tell(camera={"phase": "measuring", "leds": "on", "leds_age_ms": 0}, light={"allowed": True})
    page.evaluate("() => { isSilent = true; }")
    page.wait_for_function("() => asks.length")
    page.evaluate("() => tell(told, 2000)")
    expect(leds).to_have_text(re.compile(r"LEDs unknown, last seen [23] s ago: no answer from nirspi serve"), timeout=1500)
    assert {row[1] for row in rows(page, "rates")} == {"–"}, rows(page, "rates")
    page.evaluate("() => { isSilent = false; }")
    # The server's own link to the camera is silent.
    told_of = told.tell(camera={"leds": "unknown", "leds_age_ms": 4100})
    assert told_of == "LEDs unknown, last seen 4 s ago: no answer from the camera", told_of
    told.tell(camera={"phase": "measuring", "leds": "on", "leds_age_ms": 0}, light={"allowed": True})


def feed(browser, address):
    """A bench that is no camera: its side and unit, and no word and no key for LEDs."""
    told = Told(browser, address)
    page = told.page
    account = {"frames": 9, "empty_frames": 0, "refused": 2, "not_read": 0, "cut": 0}
    bench = {"name": "DMD of room 3", "unit": "V", "height": 16, "width": 16, "order": "zig-zag", "patterns": 200}
    bench |= {"readings": "pairs", "account": account}
    told.message |= {name: packed([at / 512 for at in range(16 * 16)]) for name in ["image", "readings"]}
    told.message |= {"enhanced": None, "interval": None, "depth": None}
    told.tell(
        camera={"address": "feed:-", "identity": None, "leds": "none", "versions": [], "measurement": None, "feed": bench},
        offered={"fixed": True},
        scene=None,
        images={"shown": 12},
        picture={"n": 16, "height": 16, "width": 16, "unit": "V", "white_counts": 0.5, "enhancement": None},
    )
    told.has("camera", "DMD of room 3")
    expect(page).to_have_title("nirspi DMD of room 3")
    expect(page.locator(".leds")).to_be_hidden()
    page.keyboard.press("Escape")
    page.keyboard.press("Space")
    told.sends()
    expect(page.locator("#alarm")).to_be_hidden()
    for name in ["order", "sampling", "sweeps"]:
        expect(page.locator(f"#{name}")).to_be_hidden()
    found = pointed(page, "image", 16, 3, 8)
    assert found == "row 8, column 3: 0.256 V, 51 % of white", found
    expect(page.locator("#about-image").locator("xpath=..")).to_contain_text("reconstructed, 16 × 16")
    told.has("no-enhanced", "off: the networks take 32 × 32 and 64 × 64")
    identity = rows(page, "identity")
    assert identity == [
        ["address", "feed:-", ""],
        ["patterns", "200, 16 × 16", ""],
        ["order", "zig-zag", ""],
        ["readings", "pairs", ""],
        ["numbers refused", "2", "loss"],
        ["readings not read", "0", ""],
    ], identity
    told.tell(camera={"phase": "silent", "line": "no data for 3 s"})
    told.has("line", "no data for 3 s")
    # Patterns of the bench's own: an oblong image, and nothing that knows Hadamard patterns.
    told.message |= {"image": packed([at / 512 for at in range(6 * 8)]), "readings": None}
    del told.message["state"]["picture"]["n"]
    told.tell(
        camera={"phase": "measuring", "line": "measuring", "feed": bench | {"height": 6, "width": 8, "order": "own"}},
        offered={"models": [], "with_warm_start": []},
        images={"shown": 13},
        picture={"height": 6, "width": 8},
    )
    found = pointed(page, "image", 8, 7, 5, height=6)
    assert found == "row 5, column 7: 0.0918 V, 18 % of white", found
    expect(page.locator("#about-image").locator("xpath=..")).to_contain_text("reconstructed, 6 × 8")
    for name in ["enhanced", "readings", "enhance", "model", "warm-start"]:
        expect(page.locator(f"#{name}")).to_be_hidden()
    assert [row[0] for row in rows(page, "estimates")] == ["white"], rows(page, "estimates")
    assert rows(page, "identity")[1] == ["patterns", "200, 6 × 8", ""], rows(page, "identity")
    page.close()


PARTS = [facts, pictures, controls, stream, feed]
