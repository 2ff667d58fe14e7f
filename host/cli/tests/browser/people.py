"""The page for people: what is on the screen together, the keyboard alone, colours of the user's own, what a screen reader says,
the drawing of the scene, and a page whose script did not load."""

import base64
import json

from by_hand import Told
from pictures import fits, levels, seen
from playwright.sync_api import expect

# Pixels, with what they are: three laptops and a phone.
SCREENS = [(1280, 800), (1366, 768), (1440, 900), (390, 844)]
# Whether an element is on the screen, whole, with nothing else above it.
ON_SCREEN = """element => {
  const box = element.getBoundingClientRect(), x = box.left + box.width / 2, y = box.top + box.height / 2;
  const top = document.elementFromPoint(x, y);
  return box.width > 0 && box.top >= 0 && box.left >= 0 && box.bottom <= innerHeight && box.right <= innerWidth
    && (element.contains(top) || !!top?.contains(element));
}"""
EVERY_S = 5


def screens(browser, address):
    """Image, LEDs, stop, start and method are on the screen together, without scrolling; on a laptop the settings, too."""
    for width, height in SCREENS:
        page = browser.new_page(viewport={"width": width, "height": height})
        page.goto(address)
        seen(page, "image", 32)
        seen(page, "enhanced", 64)
        expect(page.locator("#leds")).to_have_text("LEDs on")
        together = ["image", "leds", "stop", "methods"]
        # On a laptop all settings are beside the images.
        if width > 1000:
            together += ["enhanced", "strength", "frames", "order", "sampling", "sweeps", "colours", "range"]
        for words, more in [("LEDs on", []), ("LEDs off, stopped", ["start"])]:
            if more:
                page.keyboard.press("Escape")
            expect(page.locator("#leds")).to_have_text(words)
            for name in together + more:
                box = page.locator(f"#{name}").bounding_box()
                assert page.locator(f"#{name}").evaluate(ON_SCREEN), f"{name} is not on {width} x {height}, {words}: {box}"
        fits(page)
        page.locator("#start").click()
        expect(page.locator("#leds")).to_have_text("LEDs on")
        page.close()


# What has the focus: its number in the page, its name, whether the focus shows, and whether nothing covers it.
FOCUSED = """() => {
  const element = document.activeElement, style = getComputedStyle(element), box = element.getBoundingClientRect();
  const below = document.querySelector("header").contains(element) ? 0 : document.querySelector("header").getBoundingClientRect().bottom;
  const explains = document.getElementById("explains"), words = explains.hidden ? "" : explains.textContent;
  const above = explains.hidden ? innerHeight : explains.getBoundingClientRect().top;
  const titles = [];
  for (let at = element.closest("[title]"); at; at = at.parentElement.closest("[title]")) titles.push(at.title.replace(/\\s+/g, " "));
  return {
    is: element === document.body ? -1 : [...document.querySelectorAll("*")].indexOf(element), name: element.id || element.outerHTML,
    shows: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2,
    free: box.height > above - below || box.top >= below - 1 && box.bottom <= above + 1,
    explained: titles.join(" ") === words, words,
  };
}"""
# Everything that can be worked or explains itself, but for radio buttons that are not chosen.
REACHABLE = """() => [...document.querySelectorAll("button, input, select, summary, [tabindex='0'], [title]:not([title=''])")]
  .filter(one => one.checkVisibility() && !one.disabled && one.type !== "radio" && one.tagName !== "OPTION")
  // A label has the focus in its control.
  .map(one => one.tagName === "LABEL" ? one.querySelector("input, select") : one)
  .filter(one => !one.disabled && one.type !== "radio")
  .map(one => [[...document.querySelectorAll("*")].indexOf(one), one.id || one.outerHTML])"""


def keyboard(browser, address):
    """By the keyboard alone: every control and every explanation is reached, seen and not covered; a method is chosen; stop, start."""
    told = Told(browser, address)
    page = told.page
    page.set_viewport_size({"width": 1280, "height": 800})
    told.tell(picture={"past": "the scene has moved by 2 pixels", "warnings": ["the noise is high"]})
    page.locator("#scene summary").focus()
    page.keyboard.press("Enter")
    page.evaluate("() => { document.activeElement.blur(); scrollTo(0, 0); }")
    # The focus begins at the top again.
    page.locator("h1").click()
    for key in ["Tab", "Shift+Tab"]:
        reached = {}
        for _ in range(200):
            page.keyboard.press(key)
            found = page.evaluate(FOCUSED)
            if found["is"] == -1 or found["is"] in reached:
                break
            for what in ["shows", "free", "explained"]:
                assert found[what], f"{key}: {found['name']} has the focus: {what} is false: {found}"
            reached[found["is"]] = found["name"]
        missed = [name for at, name in page.evaluate(REACHABLE) if at not in reached]
        assert not missed, f"{key} does not reach {missed}"
        assert any("radio" in name for name in reached.values()), "no method is reached"
    names = [name for name in reached.values()][::-1]
    assert names.index("stop") < 2 and names.index("stop") < names.index("image"), names
    # Arrow keys choose a method, and say what it is.
    page.locator("#methods input:checked").focus()
    page.keyboard.press("ArrowDown")
    offered = told.message["state"]["offered"]
    following = offered["methods"][(offered["methods"].index("tv") + 1) % len(offered["methods"])]
    told.sends(("settings", {"method": following}))
    expect(page.locator("#explains")).to_have_text(dict(zip(offered["methods"], offered["about"]))[following])
    # Escape stops wherever the focus is, the explanation too; then Start is a button as others.
    page.keyboard.press("Escape")
    told.stops()
    told.tell(camera={"phase": "stopped", "leds": "off"}, light={"allowed": False, "commands": 90})
    page.locator("#start").focus()
    page.keyboard.press("Enter")
    told.sends(("start", None))
    page.close()
    touched(browser, address)


def touched(browser, address):
    """A finger on a word shows what the word means, and a finger elsewhere takes that away."""
    context = browser.new_context(has_touch=True, viewport={"width": 390, "height": 844})
    page = context.new_page()
    page.goto(address)
    seen(page, "image", 32)
    word = page.locator("#account dt").first
    word.tap()
    expect(page.locator("#explains")).to_have_text(word.get_attribute("title"))
    box = page.locator("#explains").bounding_box()
    assert box["y"] + box["height"] <= 844 and box["x"] >= 0 and box["width"] <= 390, box
    page.locator("#account dd").first.tap()
    expect(page.locator("#explains")).to_be_hidden()
    page.get_by_text("sampling", exact=True).tap()
    expect(page.locator("#explains")).to_contain_text("Share of all 1024 patterns that is shown.")
    context.close()


# Text on the page with less contrast than this to what is behind it (WCAG 2.2, 1.4.3), without text on pictures.
FAINT = """least => {
  const numbers = colour => colour.match(/[\\d.]+/g).map(Number);
  const light = colour => numbers(colour).slice(0, 3).map(part => part / 255)
    .map(part => part <= .04045 ? part / 12.92 : ((part + .055) / 1.055) ** 2.4)
    .reduce((sum, part, at) => sum + part * [.2126, .7152, .0722][at], 0);
  const behind = element => {
    for (let at = element; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if ((numbers(colour)[3] ?? 1) > .99) return colour;
    }
    return "rgb(255 255 255)";
  };
  return [...document.querySelectorAll("body *")]
    .filter(one => one.checkVisibility() && !one.closest(".picture, option, :disabled, .heard")
      && [...one.childNodes].some(node => node.nodeType === Node.TEXT_NODE && node.data.trim()))
    .map(one => {
      const [a, b] = [light(getComputedStyle(one).color), light(behind(one))].sort((a, b) => b - a);
      return [Math.round(100 * (a + .05) / (b + .05)) / 100, one.id || one.textContent.trim().slice(0, 40)];
    })
    .filter(([contrast]) => contrast < least);
}"""
# The middle of the dot before an element's words, and the ground beside it.
DOT = """(name) => {
  const element = document.getElementById(name), style = getComputedStyle(element, "::before"), box = element.getBoundingClientRect();
  return { fill: style.backgroundColor, edge: style.borderTopStyle, colour: style.borderTopColor, words: element.textContent };
}"""


def colours(browser, address):
    """Contrast by light and by dark, more of it for who asks, and the user's own colours: every state has words and a shape."""
    for contrast, least in [("no-preference", 4.5), ("more", 7)]:
        for scheme in ["light", "dark"]:
            told = Told(browser, address, contrast=contrast, color_scheme=scheme)
            told.tell(problem="no image", picture={"warnings": ["the noise is high"]}, overload={"line": "every 2nd image"})
            faint = told.page.evaluate(FAINT, least)
            assert not faint, f"{scheme}, contrast {contrast}: less than {least}: {faint}"
            told.page.close()
    told = Told(browser, address, forced_colors="active")
    page = told.page
    assert page.evaluate("matchMedia('(forced-colors: active)').matches")
    dots = {}
    for leds, allowed in [("on", True), ("off", False), ("unknown", True)]:
        # A word that is too old says nothing of LEDs that are off.
        age_ms = 4000 if leds == "unknown" else 0
        told.tell(camera={"leds": leds, "leds_age_ms": age_ms}, light={"allowed": allowed})
        dots[leds] = page.evaluate(DOT, "leds")
        assert page.locator("#leds").evaluate(ON_SCREEN)
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    # Filled, hollow, dashed.
    assert dots["on"]["fill"] not in (ground, "rgba(0, 0, 0, 0)"), dots
    assert dots["off"]["fill"] == "rgba(0, 0, 0, 0)" and dots["off"]["edge"] == "solid", dots
    assert dots["unknown"]["edge"] == "dashed" and dots["off"]["colour"] != ground, dots
    assert len({dot["words"] for dot in dots.values()}) == 3, dots
    # Losses and the alarm are not told by red alone.
    losses = page.locator("#losses")
    assert losses.evaluate("one => getComputedStyle(one).fontWeight") == "600"
    told.tell(run_frames={"lost": 0, "late": 0})
    assert losses.evaluate("one => getComputedStyle(one).fontWeight") == "400"
    told.answer = {"status": 503}
    page.keyboard.press("Escape")
    expect(page.locator("#alarm")).to_be_visible()
    edge = page.locator("#alarm").evaluate("one => [getComputedStyle(one).borderTopWidth, getComputedStyle(one).borderTopColor]")
    assert float(edge[0][:-2]) >= 3 and edge[1] != ground, edge
    # Images keep their colours.
    assert len(set(levels(page, "image"))) > 100 and page.locator("#readings").evaluate(
        "one => getComputedStyle(one).backgroundColor") == "rgb(39, 75, 143)"
    page.close()


# Every element of which a screen reader speaks when it changes, and the moments at which each one does.
HEAR = """() => {
  window.heard = [];
  const live = document.querySelectorAll("[aria-live]:not([aria-live=off]), [role=status], [role=alert], [role=log], output");
  for (const [at, element] of [...live].entries())
    new MutationObserver(() => heard.push([at, performance.now() / 1000, element.textContent]))
      .observe(element, { childList: true, characterData: true, subtree: true });
  return live.length;
}"""


def speech(browser, address):
    """A page that changes ten times a second says each part once in 5 s at most, and when it has changed; keys are answered."""
    told = Told(browser, address)
    page = told.page
    assert page.evaluate(HEAR) > 3
    # Nothing new is nothing to say, whatever the numbers do. On a busy machine the page may have missed a message before.
    for _ in range(4):
        page.evaluate("heard.length = 0")
        for at in range(20):
            told.tell(frames={"received": 20000 + at}, picture={"reconstruct_ms": at}, images={"shown": 200 + at})
            page.wait_for_timeout(250)
        heard = page.evaluate("heard")
        if not heard:
            break
    else:
        raise AssertionError(f"says what is not new: {heard}")
    for at in range(120):
        told.tell(
            camera={"line": f"line {at}", "leds": ["on", "off", "unknown"][at % 3], "leds_age_ms": 100 * at},
            picture={"warnings": [f"warning {at}"], "frame_warnings": [f"frame {at}"], "short_warnings": [f"short {at}"]},
            overload={"line": f"overload {at}"},
            scene={"problem": f"problem {at}"},
        )
        page.wait_for_timeout(100)
    # The last words come 5 s after the ones before, on a busy machine later.
    expected = ["LEDs unknown: no answer from the camera", "line 119", "problem 119", "overload 119; warning 119; update the firmware"]
    for _ in range(60):
        page.wait_for_timeout(250)
        told.tell()
        heard = page.evaluate("heard")
        said = {at: words for at, _, words in heard}.values()
        if set(expected) <= set(said):
            break
    else:
        raise AssertionError(f"said {said}, expected {expected} among them")
    for part in {at for at, _, _ in heard}:
        times = [time for at, time, _ in heard if at == part]
        assert len(times) >= 3, f"says too little: {heard}"
        assert all(later - time > EVERY_S - 0.1 for time, later in zip(times, times[1:])), f"said too often: {times}: {heard}"
    # The value of a pixel is said by each key, and not by each image.
    page.evaluate("heard.length = 0")
    page.locator("#image").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    told.tell(images={"shown": 900})
    assert [words.split(":")[0] for _, _, words in page.evaluate("heard")] == [f"row 16, column {x}" for x in [17, 18, 19]]
    page.close()


def scene(browser, address):
    """The drawing is the scene before the camera, also after another page has changed it, unless a person draws."""
    page = browser.new_page()
    page.goto(address)
    seen(page, "image", 32)
    page.locator("#scene summary").click()

    def in_force():
        answer = json.loads(page.request.get(f"{address}/api/next").body())
        return list(base64.b64decode(answer["drawing"]))

    def is_drawn(wanted):
        page.wait_for_function(
            "wanted => String(Array.from(document.getElementById('drawing').getContext('2d').getImageData(0, 0, 64, 64).data"
            ".filter((_, at) => at % 4 === 0))) === wanted", arg=",".join(map(str, wanted)))

    first = in_force()
    assert max(first) == 255 and 400 < sum(level > 128 for level in first) < 3000, "no letter"
    is_drawn(first)
    # Somebody else shows another scene.
    page.request.post(f"{address}/api/scene", data=json.dumps({"scene": "word:IO"}))
    expect(page.locator("#scene-name")).to_contain_text("word IO")
    page.wait_for_timeout(300)
    other = in_force()
    assert other != first
    is_drawn(other)
    # What a person draws stays, and becomes the scene.
    page.locator("#clear").click()
    box = page.locator("#drawing").bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    drawn = levels(page, "drawing")
    assert all(drawn[32 * 64 + at] == 255 for at in range(16, 48)), "the stroke is not on the canvas"
    page.wait_for_timeout(1500)
    assert levels(page, "drawing") == drawn, "a stroke under way is drawn over"
    page.mouse.up()
    expect(page.locator("#scene-name")).to_contain_text("drawing")
    page.wait_for_timeout(1000)
    assert in_force() == levels(page, "drawing") == drawn, "the drawing is not the scene"
    # A scene that is refused is not drawn.
    page.locator("#distance").fill("90")
    page.locator("#distance").press("Enter")
    expect(page.locator("#scene-problem")).not_to_have_text("")
    is_drawn(drawn)
    page.request.post(f"{address}/api/scene", data=json.dumps({"scene": "letter:R"}))
    is_drawn(first)
    page.close()


def dead(browser, address):
    """A page whose script did not load says so, and has no control that looks alive."""
    policy = "default-src 'none'; script-src 'none'; style-src 'self'"

    def gone(route):
        route.fulfill(status=404, body="<h1>404</h1>", content_type="text/html")

    def forbidden(route):
        answer = route.fetch()
        route.fulfill(response=answer, headers=answer.headers | {"content-security-policy": policy})

    for what, pattern, how, options in [
        ("its first script is refused", "**/page/main.js", gone, {}),
        ("one of its scripts is missing", "**/page/plots.js", gone, {}),
        ("a proxy passes only the page itself on", "**/page/*", gone, {}),
        ("a policy forbids scripts", f"{address}/", forbidden, {}),
        ("JavaScript is off", "**/nothing", gone, {"java_script_enabled": False}),
    ]:
        page = browser.new_page(**options)
        page.route(pattern, how)
        page.goto(address)
        says = page.locator("#dead")
        expect(says).to_be_visible()
        expect(says).to_contain_text("its buttons do nothing")
        assert ("JavaScript is off" in says.inner_text()) is bool(options), f"{what}: {says.inner_text()}"
        expect(page.locator("#stop")).to_have_text("Stop: does nothing", use_inner_text=True)
        expect(page.locator("#stop")).to_be_disabled()
        expect(page.locator("#leds")).to_have_text("LEDs unknown")
        alive = page.locator("button:enabled:visible, input:visible, select:visible, canvas:visible, summary:visible").count()
        assert alive == 0, f"{what}: {alive} controls look alive"
        page.close()
    # A page that loads says nothing of it, and a proxy's own error page is no line of the program.
    page = browser.new_page()
    page.goto(address)
    expect(page.locator("#leds")).to_have_text("LEDs on")
    expect(page.locator("#dead")).to_have_count(0)
    expect(page.locator("#stop")).to_contain_text("Stop: LEDs off")
    page.route("**/api/**", lambda route: route.fulfill(status=502, content_type="text/html", body="<html><h1>502 Bad Gateway</h1></html>"))
    expect(page.locator("#line")).to_have_text(
        "HTTP status 502, and not from nirspi serve: a server between this page and nirspi serve has answered")
    page.keyboard.press("Escape")
    expect(page.locator("#alarm")).to_be_visible()
    page.close()


PARTS = [screens, keyboard, colours, speech, scene, dead]
