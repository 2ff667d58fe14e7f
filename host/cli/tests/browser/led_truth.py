#!/usr/bin/env python3
"""What the page says of the LEDs against the camera's own log, over random events: people, networks, servers, tabs, two hosts.

    python3 led_truth.py target/debug/nirspi target/debug/examples/led_log [--events 10000] [--seed 1] [--worlds 4]

The law: the page never says that the LEDs are off while they have been on for more than 2.5 s. Each world is a camera, a server
and a browser of its own, all at the same time. Prints what was seen, and exits 1 if the law or a world is broken. The same seed
gives the same events; when each one meets the programs depends on the machine.
"""

import argparse
import collections
import http.client
import itertools
import json
import multiprocessing
import pathlib
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request

from playwright.sync_api import sync_playwright

# No compiled files beside the sources.
sys.dont_write_bytecode = True
import links

LIMIT_S = 2.5
# The page's timer, and the look of this test, are late by a little on a busy machine.
LATE_S = 0.1
# A page whose timers stood still for so long was asleep. It may go on saying what it said until its next look, 250 ms later.
ASLEEP_S, WAKE_S = 0.25, 0.3
# A world that stands still for so long has failed: builds beside it keep a page from its timers for a minute and more.
PATIENCE_S = 240
# Events a world has at most between two looks at what the page has said.
LOOK_EVERY = 50

# In the page: what it says of the LEDs, at each change and twenty times a second.
RECORDER = """
(() => {
  let last = 0, said = "";
  window.ledsSaid = [];
  const look = () => {
    const now = Date.now(), says = `${document.getElementById("leds")?.textContent}|${document.body?.dataset.leds}`;
    if (says === said && now - last < 50) return;
    window.ledsSaid.push([now, now - last, says]);
    [last, said] = [now, says];
  };
  setInterval(look, 50);
  document.addEventListener("DOMContentLoaded", () => new MutationObserver(look).observe(document.body,
    { attributes: true, attributeFilter: ["data-leds"], characterData: true, childList: true, subtree: true }));
})();
"""


class Cable(links.Relay):
    """A relay that can also end connections, of both sides or of the far side alone, and be slow."""

    def __init__(self, address):
        self.pairs, self.is_cut, self.late_s = [], False, 0
        super().__init__(f"tcp/{address}")
        self.port = self.listener.getsockname()[1]

    def accept(self):
        while True:
            ours = self.listener.accept()[0]
            try:
                theirs = None if self.is_cut else socket.create_connection((self.to[0], int(self.to[1])), 1)
            except OSError:
                theirs = None
            if theirs is None:
                ours.close()
                continue
            theirs.settimeout(None)
            for each in [ours, theirs]:
                each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            pair = {"ours": ours, "theirs": theirs, "is_half": False, "up": [], "ended": threading.Lock()}
            self.pairs.append(pair)
            threading.Thread(target=self.pump, args=(pair, ours, theirs, pair["up"]), daemon=True).start()
            threading.Thread(target=self.pump, args=(pair, theirs, ours, None), daemon=True).start()

    def pump(self, pair, source, sink, kept):
        try:
            while data := source.recv(65536):
                self.carries.wait()
                time.sleep(self.late_s)
                # The greeting and the first commands of a host.
                if kept is not None and sum(map(len, kept)) < 20_000:
                    kept.append(data)
                if not pair["is_half"]:
                    sink.sendall(data)
            self.carries.wait()
        except OSError:
            pass
        # Of a connection that lost its far side, the near side notices nothing.
        if not pair["is_half"]:
            self.end(pair)

    def end(self, pair, sides=("ours", "theirs")):
        for side in sides:
            try:
                pair[side].shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
        # A descriptor that is closed while another thread reads it may be given to another connection.

    def steady(self):
        self.is_cut, self.late_s = False, 0
        self.carries.set()
        for pair in self.pairs:
            if pair["is_half"]:
                pair["is_half"] = False
                self.end(pair)
        del self.pairs[:-40]

    def silent(self):
        self.carries.clear()

    def cut(self):
        self.is_cut = True
        for pair in self.pairs:
            self.end(pair)

    def half(self):
        """The far side sees the end of its connections, the near side sees nothing."""
        for pair in self.pairs:
            if not pair["is_half"]:
                pair["is_half"] = True
                self.end(pair, ["theirs"])


class Camera:
    """The virtual camera, and its log of its own LEDs."""

    def __init__(self, program):
        self.process = subprocess.Popen([program], stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()
        self.edges = [(0.0, False)]
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            word, unix_ms = line.split()
            self.edges.append((int(unix_ms) / 1000, word == "on"))

    @property
    def is_on(self):
        return self.edges[-1][1]


class World:
    """A camera, a server before it, a second host, a browser, and the lines between them."""

    def __init__(self, nirspi, led_log, seed, browser):
        self.random, self.nirspi, self.browser = random.Random(seed), nirspi, browser
        self.camera = Camera(led_log)
        self.usb = Cable(self.camera.address)
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.server, self.second = None, None
        # How each thing that is broken becomes whole again.
        self.broken = {}
        self.net = Cable(f"127.0.0.1:{self.port}")
        self.tab, self.said, self.done = "awake", [], collections.Counter()
        # What was so when the world was last asked to obey.
        self.state = "not asked yet"

    def begin(self):
        self.start_server()
        until(lambda: self.camera.is_on, "the LEDs go on")
        # What a host sends until the LEDs are on is what the second host sends.
        self.greeting = b"".join(next(pair for pair in self.usb.pairs if pair["up"])["up"])
        self.page = self.browser.new_page()
        self.tools = self.page.context.new_cdp_session(self.page)
        self.page.add_init_script(RECORDER)
        self.page.set_default_timeout(1000 * PATIENCE_S)
        self.page.goto(self.net.address, wait_until="domcontentloaded")

    def start_server(self):
        # No calibration, few patterns and a cheap method: the work is not what is tested.
        self.server = subprocess.Popen(
            [self.nirspi, "serve", "--listen", f"127.0.0.1:{self.port}", "--camera", f"tcp:127.0.0.1:{self.usb.port}"]
            + "--no-calibration --adc-latency 7 --method tikhonov --warm-start --frames 200 --strength 1".split()
            + "--sampling 0.1 --sweeps 250".split(),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    # Events. Each one says in a word what it did.

    def press(self):
        if self.tab == "frozen":
            return "nothing"
        wish = self.random.choice(["stop", "start", "resume"])
        self.page.evaluate("id => document.getElementById(id).click()", wish)
        return wish

    def ask(self):
        """A script on the server's own machine."""
        wish = self.random.choice(["stop", "start"])
        return wish if self.post(wish) else "no answer"

    def post(self, wish):
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/api/{wish}", method="POST")
        try:
            urllib.request.urlopen(request, timeout=0.2).close()
            return True
        except (OSError, http.client.HTTPException):
            return False

    def network(self):
        wish = self.random.choice(["silent", "silent", "cut", "late"])
        if wish == "late":
            self.net.late_s = self.random.choice([0.3, 1, 3])
        else:
            getattr(self.net, wish)()
        self.broken["network"] = self.net.steady
        return wish

    def offline(self):
        self.page.context.set_offline(True)
        self.broken["offline"] = lambda: self.page.context.set_offline(False)
        return "offline"

    def cable(self):
        wish = self.random.choice(["silent", "cut", "half"])
        getattr(self.usb, wish)()
        self.broken["cable"] = self.usb.steady
        return wish

    def program(self):
        if self.random.random() < 0.3:
            self.end_server()
            self.start_server()
            return "kill"
        self.server.send_signal(signal.SIGSTOP)
        self.broken["program"] = lambda: self.server.send_signal(signal.SIGCONT)
        return "pause"

    def end_server(self):
        self.server.kill()
        self.server.wait()

    def sleep(self):
        self.tab = self.random.choice(["frozen", "hidden"])
        self.set_tab(True)
        self.broken["sleep"] = self.wake
        return self.tab

    def wake(self):
        self.set_tab(False)
        self.tab = "awake"

    def set_tab(self, asleep):
        if self.tab == "frozen":
            self.tools.send("Page.setWebLifecycleState", {"state": "frozen" if asleep else "active"})
        else:
            self.page.evaluate(
                """is => { Object.defineProperty(document, "hidden", { value: is, configurable: true });
                  document.dispatchEvent(new Event("visibilitychange")); }""", asleep)

    def other_host(self, ways=("waits", "cut", "half", "half")):
        """A second host takes the camera from the server, whose line may notice nothing, and switches the LEDs on."""
        way = self.random.choice(ways)
        if way != "waits":
            getattr(self.usb, way)()
            self.broken["cable"] = self.usb.steady
        try:
            self.second = socket.create_connection(self.camera.address.split(":"), 1)
            self.second.sendall(self.greeting)
            threading.Thread(target=drain, args=(self.second,), daemon=True).start()
        except OSError:
            # The camera has turned the host away.
            pass
        self.broken["other_host"] = self.leave
        return way

    def take_over(self):
        return self.other_host(["half", "half", "cut"])

    def leave(self):
        # A close alone ends nothing while a thread reads.
        try:
            self.second.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.second.close()

    EVENTS = [press, press, press, press, ask, network, offline, cable, program, sleep, other_host, other_host]

    def keep_running(self):
        """A server that finds no camera at its start ends, and is started again, as by systemd."""
        if self.server.poll() is not None:
            self.start_server()

    def event(self):
        self.keep_running()
        # More things are whole than broken, and what is broken does not break again.
        if self.random.random() < 0.45 * len(self.broken):
            self.mend(self.random.choice(sorted(self.broken)))
        elif self.random.random() < 0.06:
            self.story()
        else:
            self.do(self.random.choice([one for one in self.EVENTS if one.__name__ not in self.broken]))
        time.sleep(self.random.choice([0.02, 0.05, 0.1, 0.1, 0.2, 0.2, 0.3, 0.5, 1]))

    def do(self, one):
        self.done[f"{one.__name__} {one(self)}"] += 1

    def mend(self, name):
        self.broken.pop(name)()
        self.done[f"{name} ends"] += 1

    def story(self):
        """The law is nearest where a page that rightly says off hears no more, and another host switches the LEDs on: in any order,
        so near to each other that the page believes what was, and for so long that it must not."""
        for name in list(self.broken):
            self.mend(name)
        self.done["ask stop"] += 1
        since = time.time()
        while not self.is_said_off() and time.time() - since < 6:
            self.keep_running()
            self.post("stop")
            time.sleep(0.2)
        deaf = self.random.choice([World.network, World.offline, World.program, World.sleep])
        both = [World.take_over, deaf]
        self.random.shuffle(both)
        for one in both:
            self.do(one)
            time.sleep(self.random.choice([0, 0.3, 0.8, 1.3, 1.8, 2.3]))
        time.sleep(self.random.choice([1, 2.8, 2.8]))

    def is_said_off(self):
        return self.page.evaluate("document.getElementById('leds').textContent").startswith("LEDs off")

    def look(self):
        """Takes what the page has said. A frozen page answers later."""
        if self.tab != "frozen":
            self.said += self.page.evaluate("ledsSaid.splice(0)")

    def heal(self):
        for end in self.broken.values():
            end()
        self.broken.clear()

    def obeys(self, wish, words):
        self.keep_running()
        is_heard = self.post(wish)
        time.sleep(0.5)
        says = self.page.locator("#leds").inner_text()
        self.state = f"the page says {says!r}, LEDs are {'on' if self.camera.is_on else 'off'}, " \
            f"the server {'answers' if is_heard else 'does not answer'} within 0.2 s"
        return says == words and self.camera.is_on == (wish == "start")

    def close(self):
        if self.server:
            self.end_server()
        self.camera.process.kill()
        self.camera.process.wait()


def drain(host):
    try:
        while host.recv(65536):
            pass
    except OSError:
        pass


def until(is_so, what):
    since = time.time()
    while not is_so():
        assert time.time() - since < PATIENCE_S, f"not within {PATIENCE_S} s: {what}"
        time.sleep(0.02)


def judge(said, edges):
    """What breaks the law, the longest time that LEDs were on while the page said off, and how often the law was near: the page
    gave up "off" while the LEDs were on, which nothing but the state's age can have told it."""
    broken, worst, near, at = [], 0.0, 0, 0
    woke, before = -1.0, False
    for now_ms, gap_ms, says in said:
        now = now_ms / 1000
        if gap_ms / 1000 > ASLEEP_S:
            woke = now
        while at + 1 < len(edges) and edges[at + 1][0] <= now:
            at += 1
        since, is_on = edges[at]
        is_off = says.startswith("LEDs off") or says.endswith("|off")
        if before and not is_off and "unknown" in says and is_on:
            near += 1
        before = is_off
        if not is_off or not is_on:
            continue
        if now - woke <= WAKE_S:
            continue
        worst = max(worst, now - since)
        if now - since > LIMIT_S + LATE_S:
            broken.append(f"{says!r} while the LEDs were on for {now - since:.2f} s")
    return broken, worst, near


def live(arguments):
    """One world; returns what was seen."""
    nirspi, led_log, seed, events = arguments
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        world, failed = World(nirspi, led_log, seed, browser), []
        try:
            world.begin()
            for count in itertools.count():
                if world.done.total() >= events:
                    break
                world.event()
                if count % LOOK_EVERY == 0:
                    world.look()
            world.heal()
            # A page that never knew anything would keep the law. At the end it says what is, and does what a person says.
            for wish, words in [("stop", "LEDs off, stopped"), ("start", "LEDs on")]:
                until(lambda: world.obeys(wish, words), f"{words} after all events")
            world.look()
        except Exception as error:
            failed = [f"the world ended after {world.done.total()} events: {error!r}; {world.state}"]
        finally:
            world.close()
    broken, worst, near = judge(world.said, world.camera.edges)
    broken += failed
    passed = world.said[-1][0] - world.said[0][0] if world.said else 1
    shown = collections.Counter()
    for (now, _, says), (later, gap, _) in itertools.pairwise(world.said):
        shown["asleep" if gap > 1000 * ASLEEP_S else re.match(r"LEDs \w+|\w+", says)[0]] += (later - now) / passed
    return {"seed": seed, "broken": broken, "worst": worst, "near": near, "done": world.done, "shown": shown,
            "runs": sum(on for _, on in world.camera.edges)}


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("nirspi")
    arguments.add_argument("led_log")
    arguments.add_argument("--events", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--worlds", type=int, default=4)
    arguments = arguments.parse_args()
    began = time.time()
    paths = [str(pathlib.Path(path).resolve()) for path in [arguments.nirspi, arguments.led_log]]
    each = -(-arguments.events // arguments.worlds)
    tasks = [(*paths, 1000 * arguments.seed + world, each) for world in range(arguments.worlds)]
    with multiprocessing.get_context("spawn").Pool(arguments.worlds) as pool:
        seen = pool.map(live, tasks, chunksize=1)
    done, shown = sum((one["done"] for one in seen), collections.Counter()), collections.Counter()
    for one in seen:
        shown.update({says: share / len(seen) for says, share in one["shown"].items()})
    print(json.dumps(dict(sorted(done.items()))))
    print("the page said: " + ", ".join(f"{says} {share:.0%}" for says, share in sorted(shown.items())))
    near = sum(one["near"] for one in seen)
    print(f"{done.total()} events, seed {arguments.seed}, {arguments.worlds} worlds, {time.time() - began:.0f} s: "
          f"{sum(one['runs'] for one in seen)} runs; {near} times only its age ended an \"off\" while LEDs were on; "
          f"\"off\" while on for {max(one['worst'] for one in seen):.2f} s at most")
    broken = [f"world {one['seed']}: {what}" for one in seen for what in one["broken"]]
    for what in broken[:20]:
        print(what)
    if broken:
        sys.exit(f"{len(broken)} looks at the page broke the law, or worlds that ended early")


if __name__ == "__main__":
    main()
