#!/usr/bin/env python3
"""Faults that people make, planted in the page's JavaScript one at a time: does the page's check see them?

    python3 faults.py target/release/nirspi [WORD...]

Each fault is tried against the part of the check that looks at its place; words choose faults whose description has one of
them. Prints a line for each fault, and exits 1 if one is missed. docs/log/mutants.md has the results.
"""

import pathlib
import re
import signal
import subprocess
import sys

from playwright.sync_api import expect, sync_playwright

# No compiled files beside the sources.
sys.dont_write_bytecode = True
import by_hand
import check
import links
import people

PAGE = pathlib.Path(__file__).parents[3] / "serve/src/page"
# A part that passes takes less on a busy machine.
LIMIT_MS = 8_000

# Description; file; what the file has, once; what stands there instead; the part of the check.
FAULTS = [
    (
        "the share of white under the cursor is not in percent",
        "display.js",
        "(100 * value / white)",
        "(value / white)",
        "pictures",
    ),
    ("distances in m are called mm", "display.js", 'unit: "m"', 'unit: "mm"', "pictures"),
    (
        "row and column under the cursor are exchanged",
        "display.js",
        "`row ${y}, column ${x}`",
        "`row ${x}, column ${y}`",
        "pictures",
    ),
    (
        "the number of a pattern begins at 1",
        "display.js",
        "`pattern ${y * panel.side + x}`",
        "`pattern ${y * panel.side + x + 1}`",
        "pictures",
    ),
    ("the lower end of a fixed range is ignored", "display.js", '[$("low").value / 100 * white,', "[0,", "pictures"),
    (
        "warnings of the frames stand on the enhanced image",
        "display.js",
        "picture?.short_warnings",
        "picture?.frame_warnings",
        "facts",
    ),
    ("an image that is gone stays on the page", "display.js", "if (isNew) {", "if (isNew && message.image) {", "pictures"),
    ("images on this page are counted per millisecond", "display.js", "1000 * drawn", "drawn", "pictures"),
    (
        "the row of late frames has the corrupt ones",
        "account.js",
        '["late", whole(counted.late)',
        '["late", whole(counted.corrupt)',
        "facts",
    ),
    (
        "median and 99 % of a delay are exchanged",
        "facts.js",
        "`${ms(of.p50_ms)}, ${ms(of.p99_ms)} ms`",
        "`${ms(of.p99_ms)}, ${ms(of.p50_ms)} ms`",
        "facts",
    ),
    ("the ADC's rate in kS/s is called MS/s", "facts.js", "identity.adc_hz / 1e6", "identity.adc_hz / 1e3", "facts"),
    ("a refusal is not shown", "facts.js", "[answer.refused, state.problem,", "[state.problem,", "controls"),
    ("why there is no image is not shown", "facts.js", "[answer.refused, state.problem,", "[answer.refused,", "facts"),
    ("events come oldest first", "facts.js", "all.slice().reverse()", "all", "facts"),
    (
        "as many other events are not shown",
        "facts.js",
        "`${all.length} ${last.unix_ms} ${last.text}`",
        "`${all.length}`",
        "facts",
    ),
    ("an event is read as HTML", "facts.js", "span.textContent =", "span.innerHTML =", "fault"),
    (
        "notes may turn the direction of text",
        "facts.js",
        'foreign(notes.filter(Boolean).map(note => note.trim()).join("; "))',
        'notes.filter(Boolean).map(note => note.trim()).join("; ")',
        "facts",
    ),
    ("the age of an earlier image is in milliseconds", "history.js", " / 1000).toFixed(1)", ").toFixed(1)", "pictures"),
    ("an earlier image moves on with newer ones", "history.js", "if (back > 0) back", "if (back < 0) back", "pictures"),
    (
        "the image after the one chosen is shown",
        "history.js",
        "newest : kept[kept.length - 1 - back]",
        "newest : kept[kept.length - back]",
        "pictures",
    ),
    ("images are kept without end", "history.js", "if (kept.length > MOST) kept.shift();", "", "pictures"),
    ("the button that switches the LEDs off sends nothing", "light.js", '$("stop").onclick = stop;', "", "controls"),
    ("Escape does not stop", "light.js", 'event.key !== "Escape" && ', "", "controls"),
    (
        "the button of a missing calibration sends nothing",
        "light.js",
        '$("resume").onclick = $("try-again").onclick = start',
        '$("resume").onclick = start',
        "controls",
    ),
    (
        "a stop that does not arrive is not sent again",
        "light.js",
        "while (mine === stopping && !mine.isDone) {",
        "if (mine === stopping && !mine.isDone) {",
        "leds",
    ),
    (
        "a page without a program offers to start",
        "light.js",
        'unknown(age, GONE.leds);\n  $("start").hidden = true;',
        "unknown(age, GONE.leds);",
        "stream",
    ),
    (
        "a refusal stays after the next command",
        "requests.js",
        'answer.refused = got.ok ? "" : got.text;',
        "if (!got.ok) answer.refused = got.text;",
        "controls",
    ),
    ("a control is set back by a message under way", "requests.js", "touched = performance.now();", "", "controls"),
    ("a page asks no more after an error", "connection.js", "await pause(AGAIN_MS);\n      continue;", "return;", "stream"),
    ("the server's reason is not shown", "connection.js", "error.refusal ?? GONE.line", "GONE.line", "stream"),
    ("a hidden page goes on asking", "connection.js", "document.hidden || isHushed()", "isHushed()", "stream"),
    ("a state has no age", "main.js", "if (!why && age() <= FRESH_MS) return light.age(age());", "if (!why) return light.age(age());", "stream"),
    ("the age of the camera's word is left out", "light.js", "offAge + stateAge <= FRESH_MS", "stateAge <= FRESH_MS", "stream"),
    ("an old message counts as new", "connection.js", "asked.map(time => time - age)", "asked", "stream"),
    ("the rates of a silent program stay", "main.js", "facts.showGone();", "", "stream"),
    (
        "the alarm covers the stop button",
        "style.css",
        "#alarm { flex-basis: 100%;",
        "#alarm { position: fixed; top: 0; z-index: 2; width: 100%;",
        "leds",
    ),
    ("a stop that is not confirmed is not said", "light.js", "setTimeout(() => alarm(mine), ALARM_MS);", "", "controls"),
    ("a state from before a stop confirms it", "light.js", "light.commands >= stopping.command", "true", "controls"),
    ("every window asks for every image", "connection.js", "if (!isFirst()) await pause(SECOND_WINDOW_MS);", "", "windows"),
    ("the sampling is sent in percent", "controls.js", 'number("sampling") / 100', 'number("sampling")', "controls"),
    (
        "the field of the sampling shows the share",
        "controls.js",
        "+(100 * settings.sampling).toFixed(2)",
        "settings.sampling",
        "controls",
    ),
    (
        "the box of the recursive estimate sends that of enhancement",
        "controls.js",
        '{ warm_start: $("warm-start").checked }',
        '{ warm_start: $("enhance").checked }',
        "controls",
    ),
    (
        "the slider of the sum stands at the number of frames",
        "controls.js",
        "Math.round(Math.log2(settings.frames))",
        "settings.frames",
        "controls",
    ),
    (
        "a field is set back while a person types",
        "controls.js",
        "if (document.activeElement !== $(id)) $(id)",
        "$(id)",
        "controls",
    ),
    (
        "a picture that could not be read is named for ever",
        "scene.js",
        'function apply(wish) {\n  unread = "";',
        "function apply(wish) {",
        "controls",
    ),
    (
        "a wide picture is stretched",
        "scene.js",
        "[picture.width, picture.height].map(length => SIDE * length / side)",
        "[SIDE, SIDE]",
        "controls",
    ),
    ("the brush is always white", "brush.js", '255 * slider("brush-level")', "255", "controls"),
    (
        "the saved sheet exchanges lost and corrupt frames",
        "save.js",
        "${run.lost} lost, ${run.corrupt} corrupt",
        "${run.corrupt} lost, ${run.lost} corrupt",
        "pictures",
    ),
    ("a saved sheet has the time of saving", "save.js", "new Date(picture.arrived_unix_ms)", "new Date()", "pictures"),
    ("a saved sheet has no warnings", "save.js", "...picture.warnings", "...[]", "pictures"),
    ("the header has the losses of all runs", "facts.js", "run_frames: run", "frames: run", "facts"),
    ("counting from 0 forgets images", "account.js", "less(images, zero?.images)", "images", "facts"),
    ("a program that starts again shows fewer frames than none", "account.js", "frames.received < zero.frames.received", "false", "facts"),
    (
        "numbers of a saved array are big-endian",
        "save.js",
        "10 + head.length + 4 * at, value, true",
        "10 + head.length + 4 * at, value",
        "pictures",
    ),
    (
        "a program that starts again shows as frames less than none",
        "plots.js",
        "Math.max(0, total - before)",
        "total - before",
        "stream",
    ),
    ("letting the line go makes it steady", "line.js", "now ? HELD : chosen()", "now ? HELD : 0", "controls"),
    ("names of a camera may turn the direction of text", "dom.js", r"\u2028-\u202e", r"\u2028-\u2029", "fault"),
    (
        "a number that was bad news stays marked",
        "dom.js",
        'className = bad ? "loss" : "";',
        'className += bad ? "loss" : "";',
        "stream",
    ),
    ("the method is below the images on a phone", "style.css", "#methods { gap", "#methods { order: 1; gap", "screens"),
    ("settings are below the images on a laptop", "style.css", "(min-width: 60rem) {\n  .bench", "(min-width: 600rem) {\n  .bench", "screens"),
    ("nothing shows what has the focus", "style.css", "outline: 3px solid var(--accent)", "outline: none", "keyboard"),
    ("the header covers what has the focus", "style.css", "html { scroll-padding: 8rem 0 5rem; }", "", "keyboard"),
    ("words are explained to a mouse alone", "dom.js", "element.tabIndex = meaning ? 0 : -1;", "", "keyboard"),
    ("the focus explains nothing", "explain.js", "  explain(target);\n  if", "  if", "keyboard"),
    ("a finger on a word explains nothing", "explain.js", 'pointerType !== "mouse"', 'pointerType === "mouse"', "keyboard"),
    (
        "with colours of the user's own the LEDs have no dot",
        "style.css",
        "#leds::before, #line::before { forced-color-adjust: none; }",
        "",
        "colours",
    ),
    (
        "losses are told by their colour alone",
        "style.css",
        "#losses.loss { color: var(--bad); font-weight: 600; }",
        "#losses.loss { color: var(--bad); }",
        "colours",
    ),
    ("who asks for more contrast gets none", "style.css", "(prefers-contrast: more) { :root", "(prefers-contrast: less) { :root", "colours"),
    ("a screen reader says each change", "speech.js", "part.timer = setTimeout(() => speak(part), EVERY_MS);", "", "speech"),
    ("a screen reader says the age of the LEDs", "light.js", "`LEDs unknown: ${why}`", "`LEDs unknown, ${age}: ${why}`", "speech"),
    ("warnings are not said", "facts.js", 'say("notes",', 'void ("notes",', "speech"),
    ("a pixel is not said at its key", "display.js", "answer($(`${panel.id}-value`).textContent);", "", "speech"),
    ("the drawing is not the scene", "scene.js", "draw(scene, drawing, moment);", "", "scene"),
    ("a stroke is drawn over", "scene.js", " || isDrawing() || sending || asked ||", " ||", "scene"),
    ("a page without its script shows its controls", "index.html", "<main data-live hidden>", "<main data-live>", "dead"),
    ("the stop button looks alive without its script", "index.html", '<button id="stop" disabled', '<button id="stop"', "dead"),
    ("a page that loads goes on saying that it did not", "main.js", 'document.querySelectorAll(".dead")', "[]", "dead"),
    ("a proxy's own page counts as a line of the program", "connection.js", '?.startsWith("text/plain")', "", "dead"),
]


class Faulty:
    """A browser whose pages get the files of this source tree, one of them with a fault."""

    def __init__(self, browser, file, content):
        self.browser, self.file, self.content = browser, file, content

    def new_page(self, **options):
        page = self.browser.new_page(**options)
        page.set_default_timeout(LIMIT_MS)
        page.route("**/page/*", self.serve)
        page.route(re.compile(r"^http://[^/]+/$"), self.serve)
        return page

    def new_context(self, **options):
        return Faulty(self.browser.new_context(**options), self.file, self.content)

    def close(self):
        self.browser.close()

    def serve(self, route):
        """With the headers of the program, which keep scripts out of the page."""
        name = route.request.url.rsplit("/", 1)[1] or "index.html"
        content = self.content if name == self.file else (PAGE / name).read_text()
        route.fulfill(response=route.fetch(), body=content)


def leds(browser, address):
    """The switch of the LEDs before the simulated camera, whose LEDs are on at the end."""
    page = browser.new_page()
    page.goto(address)
    check.leds(page, browser, address)
    page.close()


PARTS = {part.__name__: part for part in [*by_hand.PARTS, *links.PARTS, *people.PARTS, leds, check.fault]}


def seen(browser, address, part):
    """What the check says of a fault; nothing if it passes."""
    try:
        PARTS[part](browser, address)
    except Exception as said:
        return next(line for line in str(said).splitlines() if line.strip()) if str(said) else "an assertion"
    finally:
        for context in list(browser.browser.contexts):
            context.close()
    return ""


def main():
    program, *words = sys.argv[1:]
    chosen = [fault for fault in FAULTS if not words or any(word in fault[0] for word in words)]
    server = subprocess.Popen([program, "serve", "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    missed = []
    try:
        address = next(word for word in server.stdout.readline().split() if word.startswith("http://"))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            expect.set_options(timeout=LIMIT_MS)
            for part in dict.fromkeys(fault[4] for fault in chosen):
                said = seen(Faulty(browser, "none", ""), address, part)
                if said:
                    sys.exit(f"{part}: fails without a fault: {said}")
            for what, file, old, new, part in chosen:
                content = (PAGE / file).read_text()
                if content.count(old) != 1:
                    sys.exit(f"{what}: found {content.count(old)} times in {file}, expected once: {old}")
                said = seen(Faulty(browser, file, content.replace(old, new)), address, part)
                print(f"{'caught by ' + part if said else 'MISSED'}: {what}{': ' + said[:120] if said else ''}", flush=True)
                if not said:
                    missed.append(what)
                # A fault may have left the LEDs off.
                browser.new_page().request.post(f"{address}/api/start")
            browser.close()
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(10)
    print(f"{len(chosen) - len(missed)} of {len(chosen)} faults caught")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
