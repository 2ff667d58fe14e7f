"""Every control of the page, by clicks and keys."""

import os
import re

from pictures import levels, looks_like, numbers, png, seen
from playwright.sync_api import expect


def picture(page):
    """Method, strength, network, number of frames."""
    about = page.locator("#about-image")
    for method in ["hadamard", "omp", "pseudo-inverse", "fista", "tv", "tikhonov"]:
        page.get_by_label(method, exact=True).check()
        expect(about).to_contain_text(f"{method}, ")
    page.get_by_label("hadamard", exact=True).check()
    expect(page.locator("#strength")).to_be_disabled()
    page.get_by_label("tv", exact=True).check()
    expect(about).to_contain_text("tv, ")
    page.locator("#strength").fill("300")
    page.locator("#strength").press("Enter")
    settled(page, "strength", 300)
    page.locator("#strength").fill("")
    page.locator("#strength").press("Enter")
    settled(page, "strength", None)
    page.locator("#frames").fill("3")
    expect(about).to_contain_text("tv, 8 frames")
    page.locator("#frames").fill("6")
    page.locator("#model").select_option("gan")
    expect(page.locator("#about-enhanced")).to_contain_text("gan, ")
    page.locator("#model").select_option("diffusion")
    expect(page.locator("#about-enhanced")).to_contain_text("diffusion, ")
    page.get_by_label("enhance", exact=True).uncheck()
    expect(page.locator("#no-enhanced")).to_have_text("switched off")
    expect(page.locator("#no-enhanced")).to_be_visible()
    expect(page.locator("#model")).to_be_disabled()
    page.get_by_label("enhance", exact=True).check()
    seen(page, "enhanced", 64)
    expect(page.locator("#warm-start")).to_be_enabled()
    page.get_by_label("hadamard", exact=True).check()
    expect(page.locator("#warm-start")).to_be_disabled()
    page.get_by_label("tikhonov", exact=True).check()
    expect(about).to_contain_text("tikhonov, ")
    page.locator("#warm-start").check()
    settled(page, "warm_start", True)
    expect(about).to_contain_text("tikhonov, recursive, ")
    page.locator("#warm-start").uncheck()
    settled(page, "warm_start", False)


def settled(page, name, value):
    """Waits until the server has this setting."""
    page.wait_for_function(
        """async ([name, value]) => (await (await fetch("/api/state")).json()).settings[name] === value""", arg=[name, value]
    )


def measurement(page, folder):
    """Order, sampling, sweeps, and recording."""
    facts = page.locator("#identity")
    page.locator("#order").select_option("zig-zag")
    expect(facts).to_contain_text("zig-zag")
    page.locator("#sampling").fill("25")
    page.locator("#sampling").press("Enter")
    expect(facts).to_contain_text("256 of")
    page.locator("#sweeps").fill("2")
    page.locator("#sweeps").press("Enter")
    settled(page, "sweeps", 2)
    # What is refused is said.
    page.locator("#sweeps").fill("100000")
    page.locator("#sweeps").press("Enter")
    expect(page.locator("#notes")).to_contain_text("sweeps is 100000, expected 1 to 4096")
    page.locator("#sweeps").fill("1")
    page.locator("#sweeps").press("Enter")
    expect(page.locator("#notes")).not_to_contain_text("sweeps")
    page.locator("#order").select_option("cake-cutting")
    page.locator("#sampling").fill("50")
    page.locator("#sampling").press("Enter")
    expect(facts).to_contain_text("512 of")
    expect(page.locator("#no-record")).to_be_hidden()
    page.locator("#record").click()
    expect(page.locator("#record")).to_have_attribute("aria-pressed", "true")
    page.wait_for_timeout(500)
    page.locator("#record").click()
    expect(page.locator("#events")).to_contain_text("in capture-1.mcap")
    assert os.listdir(folder) == ["capture-1.mcap"], os.listdir(folder)
    expect(page.locator("#line")).to_have_text("measuring")


def display(page):
    """Colours, range, the value under the cursor, earlier images, saved numbers."""
    page.locator("#colours").select_option("viridis")
    colours = page.locator("#image").evaluate("""canvas => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, 32, 32);
      return data.some((part, at) => at % 4 === 0 && part !== data[at + 2]);
    }""")
    assert colours, "viridis is grey"
    page.locator("#colours").select_option("grey")
    page.locator("#range").select_option("fixed")
    expect(page.locator("#limits")).to_be_visible()
    page.locator("#high").fill("1000")
    page.wait_for_function("() => document.getElementById('image-bar').innerText.includes('ADC counts')")
    assert max(levels(page, "image")) < 60, "ten times white is as bright as white"
    page.locator("#range").select_option("auto")
    ends = [level for level in levels(page, "image") if level in (0, 255)]
    assert {0, 255} == set(ends) and len(ends) < 0.05 * 1024, f"{len(ends)} pixels at the ends of the automatic range"
    page.locator("#range").select_option("white")
    expect(page.locator("#limits")).to_be_hidden()

    # An earlier image stays while newer ones arrive, and is what is saved.
    page.locator("#scrub").press("ArrowLeft")
    expect(page.locator("#scrub-text")).to_contain_text("back")
    before = levels(page, "image")
    shown = page.locator("#account dd").nth(4).text_content()
    expect(page.locator("#account dd").nth(4)).not_to_have_text(shown)
    assert levels(page, "image") == before
    files = []
    page.on("download", lambda file: files.append(file))
    page.locator("#save-npy").click()
    for _ in range(400):
        if len(files) < 2:
            page.wait_for_timeout(50)
    side, counts = numbers(files[0].path())
    assert side == 32 and numbers(files[1].path())[0] == 64
    box = page.locator("#image").bounding_box()
    x, y = 12, 20
    page.locator("#image").hover(position={"x": (x + 0.5) * box["width"] / 32, "y": (y + 0.5) * box["height"] / 32})
    expect(page.locator("#image-value")).to_contain_text(f"row {y}, column {x}: {counts[32 * y + x]:.1f} ADC counts")
    page.locator("h1").hover()
    expect(page.locator("#image-value")).to_have_text("")
    # By keys.
    page.locator("#image").focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#image-value")).to_contain_text("row 16, column 17: ")
    page.locator("#live").click()
    expect(page.locator("#scrub-text")).to_have_text("live")
    expect(page.locator("#live")).to_be_disabled()
    for plot in ["frames", "images", "losses", "signal", "snr"]:
        expect(page.locator(f"#{plot}-plot")).to_have_attribute("aria-label", re.compile("now [0-9]"))


def scene(page):
    """Letter, word, sheet, drawing by mouse and by keys, picture, distance, weather."""
    name, problem = page.locator("#scene-name"), page.locator("#scene-problem")
    page.get_by_label("hadamard", exact=True).check()
    page.locator("#scene summary").click()
    page.locator("#letter").fill("IO")
    page.locator("#letter").press("Enter")
    expect(name).to_contain_text("word IO")
    page.locator("#letter").fill("A")
    page.locator("#letter-form button").click()
    expect(name).to_contain_text("letter A")
    page.locator("#white").click()
    expect(name).to_contain_text("white")
    # A bar across the upper half, on a canvas that shows the scene until it is cleared.
    page.locator("#clear").click()
    expect(name).to_contain_text("drawing")
    box = page.locator("#drawing").bounding_box()
    page.locator("#brush-size").fill("16")
    page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 0.25 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.25 * box["height"], steps=5)
    page.mouse.up()
    expect(name).to_contain_text("drawing")
    looks_like(page, "image", [255 if 4 <= at // 32 < 12 else 0 for at in range(1024)])
    # The brush begins in the middle, and goes down.
    page.locator("#clear").click()
    page.locator("#drawing").focus()
    for _ in range(12):
        page.keyboard.press("Shift+ArrowDown")
    expect(page.locator("#drawing-says")).to_have_text("brush at row 56, column 32")
    looks_like(page, "image", [255 if at // 32 >= 13 and 12 <= at % 32 < 20 else 0 for at in range(1024)], 0.8)
    page.locator("#picture").set_input_files(
        {"name": "left.png", "mimeType": "image/png", "buffer": png(64, lambda x, y: 255 if x < 32 else 0)})
    looks_like(page, "image", [255 if at % 32 < 16 else 0 for at in range(1024)])
    page.locator("#picture").set_input_files({"name": "bad.png", "mimeType": "image/png", "buffer": b"no picture"})
    expect(problem).to_contain_text("bad.png is not a picture")
    page.locator("#distance").fill("0.4")
    page.locator("#distance").press("Enter")
    expect(name).to_contain_text("0.4 m")
    page.locator("#weather").fill("fog:5m")
    page.locator("#weather").press("Enter")
    expect(name).to_contain_text("fog:5m")
    page.locator("#weather").fill("hail")
    page.locator("#weather").press("Enter")
    expect(page.locator("#notes")).to_contain_text("weather: found hail")
    page.locator("#weather").fill("none")
    page.locator("#weather").press("Enter")
    page.locator("#distance").fill("0.3")
    page.locator("#distance").press("Enter")
    page.locator("#letter").fill("R")
    page.locator("#letter").press("Enter")
    expect(name).to_have_text("letter R, 0.3 m, none")
    expect(page.locator("#line")).to_have_text("measuring")
    seen(page, "image", 32)


def names(page):
    """Every control has a name for screen readers, and the keyboard reaches every control."""
    nameless = page.evaluate("""() => [...document.querySelectorAll("input, select, button, canvas[tabindex], [role=img]")]
      .filter(control => !(control.getAttribute("aria-label") || control.labels?.[0]?.innerText.trim() || control.innerText?.trim()
        || control.closest("[hidden], details:not([open])")))
      .map(control => control.outerHTML)""")
    assert not nameless, nameless
    unreached = page.evaluate("""() => [...document.querySelectorAll("input, select, button, summary")]
      .filter(control => control.tabIndex < 0).map(control => control.outerHTML)""")
    assert not unreached, unreached
