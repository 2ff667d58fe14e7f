"""The lesson in a browser: each step on a screen and on a phone, its numbers beside an own computation.

    python3 lesson.py FOLDER [--screenshots DIR]

FOLDER is that of `host/web/build.sh`. Needs playwright (PyPI) and chromium (Debian). Says what is wrong and exits 1, or prints what
it saw.
"""

import argparse
import gzip
import pathlib
import re
import sys

from playwright.sync_api import expect, sync_playwright

# No compiled files beside the sources.
sys.dont_write_bytecode = True
sys.path.append(str(pathlib.Path(__file__).parents[2] / "cli/tests/browser"))
import folder
from folder import LIMIT_MS, served, watched
from pictures import LEVELS, fits, levels, looks_like

SIDE, PATTERNS = 32, 1024
STEPS = ["scene", "pattern", "share", "noise", "atoms", "weather", "exercises"]
# Name, width, height and colours.
SCREENS = [("wide", 1440, 900, "light"), ("wide-dark", 1440, 900, "dark"), ("phone", 390, 844, "light"), ("phone-dark", 390, 844, "dark")]


class Files(folder.Files):
    """A file server. Under /missing the lesson's program is missing."""

    def do_GET(self):
        if self.path.startswith("/missing/"):
            self.path = self.path.removeprefix("/missing")
            if self.path.endswith("nirspi_lesson.wasm"):
                return self.send_error(404)
        super().do_GET()


def sign(row, pixel):
    """Entry of the Sylvester Hadamard matrix."""
    return -1 if (row & pixel).bit_count() % 2 else 1


def walsh(sequency):
    """The row of the 32 x 32 Hadamard matrix with so many changes of sign."""
    changes = [sum(sign(row, at) != sign(row, at + 1) for at in range(SIDE - 1)) for row in range(SIDE)]
    return changes.index(sequency)


def cake_cutting():
    """Rows by their number of blocks; of equal ones the lower first."""
    runs = {walsh(sequency): sequency + 1 for sequency in range(SIDE)}
    return sorted(range(PATTERNS), key=lambda row: (runs[row // SIDE] * runs[row % SIDE], row))


def number(page, name):
    return float(page.locator(f"#{name}").text_content().replace("−", "-"))


def error(page, name):
    """The error beside a picture, in parts of white."""
    return float(page.locator(f"#{name}").text_content().removeprefix("error ").split(" ")[0]) / 100


def changes(page, name, do, before=None):
    """Does something, and waits until a text is another one."""
    element = page.locator(f"#{name}")
    before = element.text_content() if before is None else before
    do()
    expect(element).not_to_have_text(before)
    return element.text_content()


def slide(page, name, value):
    page.locator(f"#{name}").fill(str(value))


def go(page, name):
    page.locator(f"#{name}").scroll_into_view_if_needed()


def opened(page, address):
    page.goto(address)
    expect(page.locator("#dead")).to_be_hidden()
    expect(page.locator("#all-light")).not_to_have_text("0")


def ask(page, name, given=None, *rest):
    """The numbers that the lesson's program answers, asked past the page's controls."""
    return page.evaluate(
        """async ([name, given, rest]) => {
          const { ask, askWith } = await import("./lesson/program.js");
          return Array.from(await (given === null ? ask(name, ...rest) : askWith(name, given, ...rest)));
        }""",
        [name, given, list(rest)],
    )


def patterns(page):
    """Step 2 beside an own computation: pattern, light, readings, running sum."""
    go(page, "pattern")
    *scene, light = ask(page, "scene_named", "letter:R")
    assert abs(sum(scene) - light) < 1e-6 and max(scene) == 1 and min(scene) == 0
    rows = cake_cutting()
    assert ask(page, "order_named", "cake-cutting") == rows, "the order"
    ask(page, "noise", None, 0, 1)
    numbers = []
    for place in range(12):
        signs = [sign(rows[place], pixel) for pixel in range(PATTERNS)]
        on = sum(level for level, lit in zip(scene, signs) if lit > 0)
        off = sum(level for level, lit in zip(scene, signs) if lit < 0)
        numbers.append(on - off)
        if place:
            changes(page, "pattern-place", page.locator("#step").click)
        expect(page.locator("#pattern-place")).to_have_text(f"{place + 1} of 1024")
        shown = [number(page, f"reading-{name}") for name in ("pattern", "negative", "number")]
        assert all(abs(got - own) < 0.051 for got, own in zip(shown, [on, off, on - off])), (place, shown, on, off)
        assert levels(page, "pattern-picture") == [255 if lit > 0 else 0 for lit in signs], place
        assert all(abs(got - 255 * level * (lit > 0)) <= 0.51 for got, level, lit in zip(levels(page, "pattern-light"), scene, signs))
    sums = [sum(d * sign(row, pixel) for row, d in zip(rows, numbers)) / PATTERNS for pixel in range(PATTERNS)]
    got = ask(page, "sum", None, len(numbers))
    assert max(abs(a - b) for a, b in zip(got, sums)) < 1e-6, "the running sum"
    own = (sum((a - b) ** 2 for a, b in zip(sums, scene)) / PATTERNS) ** 0.5
    assert abs(got[-1] - own) < 1e-6 and abs(error(page, "pattern-error") - own) < 6e-4, (got[-1], own)
    assert all(abs(a - min(255, max(0, 255 * b))) <= 0.51 for a, b in zip(levels(page, "pattern-sum"), sums))
    # Playing goes on by itself, and stops at the end, where the sum is the scene.
    slide(page, "speed", 8)
    page.locator("#play").click()
    expect(page.locator("#pattern-place")).to_have_text("1024 of 1024")
    expect(page.locator("#play")).to_have_text("Play")
    expect(page.locator("#step")).to_be_disabled()
    expect(page.locator("#pattern-error")).to_have_text("error 0.0 % of white")
    page.locator("#restart").click()
    expect(page.locator("#pattern-place")).to_have_text("none yet")
    expect(page.locator("#back")).to_be_disabled()
    print(f"12 patterns: readings and sum as computed here; error {100 * own:.1f} %")


def shares(page):
    """Step 3: more patterns, smaller error; a shuffled order has about three times the error."""
    go(page, "share")
    errors = []
    for share in [5, 10, 25, 50, 100]:
        slide(page, "share-range", share)
        expect(page.locator("#share-text")).to_have_text(f"{share} %: {round(share / 100 * PATTERNS)}")
        errors.append(error(page, "share-error"))
    assert errors == sorted(errors, reverse=True) and errors[-1] == 0, errors
    slide(page, "share-range", 25)
    expect(page.locator("#share-text")).to_have_text("25 %: 256")
    assert sum(level > 200 for level in levels(page, "share-map")) == 256
    coarse = error(page, "share-error")
    changes(page, "share-error", lambda: page.locator("#order-3").select_option("shuffled"))
    shuffled = error(page, "share-error")
    assert 2.5 < shuffled / coarse < 3.5, (coarse, shuffled)
    # The order is one for the whole page.
    assert page.locator("#order-2").input_value() == "random:1"
    changes(page, "share-error", lambda: page.locator("#order-3").select_option("few blocks first"))
    print(f"a quarter of the patterns: error {coarse:.3f}, shuffled {shuffled:.3f}")


def noise(page):
    """Step 4: the plain sum has the noise that was asked for, Tikhonov less."""
    go(page, "noise")
    for size in [10, 20, 40]:
        changes(page, "noise-text", lambda size=size: slide(page, "noise-range", size), "")
        expect(page.locator("#noise-text")).to_have_text(f"{size} % of white")
        plain, calm = error(page, "noise-sum-error"), error(page, "noise-calm-error")
        assert abs(plain - size / 100) < 0.06 * size / 100, (size, plain)
        assert calm < 0.9 * plain, (plain, calm)
    changes(page, "noise-sum-error", page.locator("#noise-again").click)
    print(f"noise of 40 %: error {plain:.3f}, Tikhonov {calm:.3f}")


def atoms(page):
    """Step 5: the residual falls with each atom."""
    go(page, "atoms")
    expect(page.locator("#atom-count")).to_have_text("5 atoms")
    residual = lambda: float(page.locator("#atom-residual").text_content().split(" ")[0])
    seen = [residual()]
    for count in range(6, 14):
        page.locator("#atom-step").click()
        expect(page.locator("#atom-count")).to_have_text(f"{count} atoms")
        seen.append(residual())
    assert all(after < before for before, after in zip(seen, seen[1:])), seen
    page.locator("#atom-back").click()
    expect(page.locator("#atom-count")).to_have_text("12 atoms")
    for basis in ["dct", "haar"]:
        residuals = ask(page, "pursue_named", basis, 0.4, 100)
        assert len(residuals) == 101 and residuals[0] == 1 and residuals[-1] < 0.2, residuals
        assert all(after <= before for before, after in zip(residuals, residuals[1:]))
    print(f"atoms 5 to 13: residual {seen[0]} % to {seen[-1]} %")


def weather(page):
    """Step 6: distance blurs, rain hardly matters, the window does."""
    go(page, "weather")

    def at(distance, rain, window):
        for name, value in [("distance", distance), ("rain", rain), ("window", window)]:
            slide(page, name, value)
        expect(page.locator("#distance-text")).to_have_text(f"{distance / 100:.2f} m")
        expect(page.locator("#window-text")).to_have_text(f"{window} %" if window else "none")
        parts = [f"rain:{rain},mono:1"] * (rain > 0) + [f"window:{window / 100}"] * (window > 0)
        return ask(page, "weather_named", "+".join(parts) or "none", 10 * distance, 1)[-1]

    sharp, rain, far, window = at(30, 0, 0), at(30, 100, 0), at(60, 0, 0), at(30, 0, 30)
    expect(page.locator("#weather-error")).to_have_text(f"error {100 * window:.1f} % of white")
    assert sharp < 1e-3 and 0 < rain < 0.2 * far and far > 0.15 and window > 0.15, (sharp, rain, far, window)
    print(f"error of the best picture: rain {rain:.3f}, 0.6 m {far:.3f}, drops on the window {window:.3f}")


def deblurred(page):
    """The live camera's networks, loaded from the same folder."""
    for name, value in [("distance", 50), ("window", 0)]:
        slide(page, name, value)
    scene = levels(page, "drawing")
    large = [scene[row // 2 * SIDE + column // 2] for row in range(2 * SIDE) for column in range(2 * SIDE)]
    page.locator("#deblur").click()
    page.wait_for_function("() => document.getElementById('deblurred').width === 64")
    looks_like(page, "deblurred", large, 0.85)
    expect(page.locator("#deblurred-says")).to_have_text("")


def answers(page):
    """What the answers of the exercises say."""
    assert page.locator("#exercises li").count() == 10
    for at, answer in enumerate(page.locator("#exercises details").all()):
        answer.locator("summary").click()
        assert answer.locator("p").is_visible() and len(answer.locator("p").text_content()) > 80, at
    assert page.locator("#exercises details[open]").count() == 10
    # A white sheet: only the first number is not 0. The two readings add up to all light.
    go(page, "scene")
    changes(page, "all-light", page.locator("#white").click)
    light = number(page, "all-light")
    readings = ask(page, "readings")
    differences = readings[2::3]
    assert abs(differences[0] - light) < 0.06 and max(map(abs, differences[1:])) < 1e-6
    assert all(abs(on + off - differences[0]) < 1e-6 for on, off in zip(readings[0::3], readings[1::3]))
    # One square: all numbers have one size; single squares need one atom, waves more than 100.
    changes(page, "all-light", page.locator("#dot").click)
    expect(page.locator("#all-light")).to_have_text("1.0")
    assert all(abs(abs(d) - 1) < 1e-6 for d in ask(page, "readings")[2::3])
    assert ask(page, "pursue_named", "pixel", 0.4, 100) == [1, 0]
    assert ask(page, "pursue_named", "dct", 0.4, 100)[100] > 0.3
    # Rain of 100 mm an hour takes about a hundredth of the light.
    *_, light = ask(page, "scene_named", "white")
    kept = [sum(ask(page, "weather_named", "rain:100,mono:1", 300, seed)[:PATTERNS]) / light for seed in range(1, 9)]
    assert 0.985 < sum(kept) / len(kept) < 1, kept


def keyboard(page):
    """The scene by keys alone, and a name that there is not."""
    go(page, "scene")
    changes(page, "all-light", page.locator("#clear").click)
    expect(page.locator("#all-light")).to_have_text("0.0")
    page.locator("#drawing").focus()
    page.keyboard.press("Space")
    expect(page.locator("#all-light")).not_to_have_text("0.0")
    one = number(page, "all-light")
    for _ in range(5):
        page.keyboard.press("Shift+ArrowRight")
    page.wait_for_function("one => Number(document.getElementById('all-light').textContent) > 1.5 * one", arg=one)
    expect(page.locator("#drawing-says")).to_have_text("brush at row 16, column 21")
    page.locator("#letter").fill("漢")
    page.locator("#letter").press("Enter")
    expect(page.locator("#scene-problem")).to_contain_text("the font has no shape for it")
    page.locator("#letter").fill("NIR")
    page.locator("#letter").press("Enter")
    expect(page.locator("#scene-problem")).to_have_text("")


def touched(page):
    """A stroke of a finger, on the phone: the scene has it, and the page stays where it is."""
    go(page, "scene")
    changes(page, "all-light", page.locator("#clear").click)
    page.locator("#drawing").scroll_into_view_if_needed()
    box, top = page.locator("#drawing").bounding_box(), page.evaluate("scrollY")
    session = page.context.new_cdp_session(page)
    place = lambda part: [{"x": box["x"] + 0.5 * box["width"], "y": box["y"] + part * box["height"]}]
    session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": place(0.2)})
    for step in range(1, 13):
        session.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": place(0.2 + 0.05 * step)})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function("() => Number(document.getElementById('all-light').textContent) > 40")
    drawn = levels(page, "drawing")
    lit = [at for at, level in enumerate(drawn) if level > 128]
    assert {at % SIDE for at in lit} <= {14, 15, 16, 17} and len({at // SIDE for at in lit}) >= 19, lit
    assert page.evaluate("scrollY") == top, "the page has moved under the finger"
    go(page, "share")
    slide(page, "share-range", 100)
    expect(page.locator("#share-error")).to_have_text("error 0.0 % of white")
    looks_like(page, "share-sum", drawn, 0.999)


def sizes(folder):
    """The pages of the book say how much a server sends that compresses files."""
    folder = pathlib.Path(folder)
    docs = pathlib.Path(__file__).parents[3] / "docs"

    def megabytes(start, rest, compress=lambda data: gzip.compress(data, 6)):
        files = [folder / start, *sorted((folder / rest).iterdir())]
        return sum(len(compress(file.read_bytes())) for file in files) / 1e6

    def says(name, sentence, within=docs):
        found = re.search(sentence, " ".join((within / name).read_text().split()))
        assert found, f"{within / name} has no sentence {sentence!r}: name the new one here"
        return [float(part) for part in found.groups()]

    lesson, camera = megabytes("lesson.html", "lesson"), megabytes("index.html", "page")
    everything = sum(megabytes(*part, lambda data: data) for part in [("lesson.html", "lesson"), ("index.html", "page")])
    print(f"compressed: lesson {lesson:.2f} MB, camera {camera:.2f} MB; the folder {everything:.2f} MB")
    # Each change of the program changes its size a little.
    def is_near(shown, found):
        assert abs(shown / found - 1) < 0.1, f"a page says {shown} MB, it is {found:.2f} MB"

    is_near(*says("lesson.md", r"with its networks, about (\d+) MB"), camera)
    is_near(*says("lesson.html", r"Deblur: loads (\d+) MB", folder), camera)
    is_near(*says("browser.md", r"A server that compresses sends about (\d+) MB"), camera)
    assert lesson < says("lesson.md", r"The other steps load less than (\d+) MB")[0]
    table = says("browser.md", r"size of the folder, compressed \| ([\d.]+) MB, ([\d.]+) MB")
    for shown, found in zip(table, [everything, lesson + camera], strict=True):
        is_near(shown, found)


def screens(browser, base, folder):
    for name, width, height, scheme in SCREENS:
        context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": height}, has_touch=width < 500)
        page = context.new_page()
        page.set_default_timeout(LIMIT_MS)
        _, problems = watched(page)
        opened(page, f"{base}/lesson.html")
        for _ in range(14):
            page.locator("#step").click()
        for step in STEPS:
            go(page, step)
            fits(page)
        expect(page.locator("#weather-error")).to_contain_text("error")
        # What a finger presses is large enough.
        small = page.locator("button").evaluate_all("all => all.filter(one => one.getBoundingClientRect().height < 40).map(one => one.id)")
        assert not small, small
        if width < 500:
            touched(page)
        if folder:
            page.screenshot(path=f"{folder}/lesson-{name}.png", full_page=True)
        assert not problems, problems
        context.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder")
    parser.add_argument("--screenshots")
    given = parser.parse_args()
    sizes(given.folder)
    base = served(Files, given.folder)
    expect.set_options(timeout=LIMIT_MS)
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(LIMIT_MS)
        asked, problems = watched(page)
        opened(page, f"{base}/lesson.html")
        for step in [patterns, shares, noise, atoms, weather]:
            step(page)
        # The large program of the live page comes only for those who ask for networks.
        assert not any("nirspi_web" in url for url in asked), asked
        for step in [deblurred, answers, keyboard]:
            step(page)
        assert all(url.startswith(base) for url in asked), asked
        assert not problems, problems
        # From the lesson to the live camera and back.
        page.get_by_role("link", name="the live camera").first.click()
        page.get_by_role("link", name="lesson", exact=True).click()
        expect(page.locator("h1")).to_have_text("One pixel makes a picture")
        page.close()
        screens(browser, base, given.screenshots)
        page = browser.new_page()
        page.goto(f"{base}/missing/lesson.html")
        expect(page.locator("#scene-problem")).to_have_text("nirspi_lesson.wasm cannot be read: the server answers 404")
        expect(page.locator("#dead")).to_be_visible()
        browser.close()
    print("the lesson: as it should be")


main()
