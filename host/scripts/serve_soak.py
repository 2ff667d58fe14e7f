#!/usr/bin/env python3
"""`nirspi serve` among clients that misbehave: does the page of a good client go on, and does the memory stay flat?

    python3 serve_soak.py target/release/nirspi [--clients 1000] [--seconds 600] [--files 256] [--plot memory.svg]
        [--markdown]

Starts `nirspi serve` with the virtual camera, and a token. One good page reads its events for the
whole time, asks for the state each second and is opened anew every ten seconds. The other clients come from 40 addresses of
this machine, each does one of the things in KINDS at random, and again. Prints JSON: what became of the connections of each
kind, images a second, the longest silence on the page, memory, open files; with --markdown the two tables of
docs/log/reliability.md instead. Exits 1 if the page suffered, if a client without the token was answered, or if memory or files
grew. Linux; needs Python alone.
"""

import argparse
import asyncio
import collections
import json
import multiprocessing
import os
import random
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from live_speed import memory_mib, plot, processor_s

TOKEN = "a-token-for-the-soak-test"
# Addresses of the clients: the server counts connections by address.
ADDRESSES = [f"127.0.1.{last}" for last in range(1, 41)]
# The longest time that a client stays, beyond the 10 s after which the server closes silent connections.
STAYS_S = 20.0
# What the page may suffer, and what memory (MiB) and files may grow by.
MOST_SILENCE_S, MOST_WAIT_S, MOST_GROWTH_MIB, MOST_FILES = 5.0, 5.0, 4.0, 8


class Client:
    """One connection of a client that misbehaves. Nothing is read unless a method says so."""

    def __init__(self, loop, dice, place):
        self.loop, self.dice, self.place = loop, dice, place
        self.head = f"Host: {place[0]}:{place[1]}\r\n"
        self.left = time.monotonic() + dice.uniform(1, STAYS_S)
        self.socket = socket.socket()
        self.socket.setblocking(False)
        # What the system keeps for a client that does not read.
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.bind((dice.choice(ADDRESSES), 0))

    async def connect(self):
        await asyncio.wait_for(self.loop.sock_connect(self.socket, self.place), 10)

    async def send(self, data):
        if isinstance(data, str):
            data = data.encode()
        await asyncio.wait_for(self.loop.sock_sendall(self.socket, data), max(0.01, self.left - time.monotonic()))

    async def answer(self):
        """The status of the answer, or what happened instead."""
        try:
            begun = await asyncio.wait_for(self.loop.sock_recv(self.socket, 64), max(0.01, self.left - time.monotonic()))
        except TimeoutError:
            return "client left"
        if not begun:
            return "closed without an answer"
        return begun[9:12].decode("latin-1") if begun.startswith(b"HTTP/1.1 ") else "other bytes"

    async def unread(self):
        """Reads nothing until the server closes the connection, or the client has had enough."""
        poll = select.poll()
        poll.register(self.socket, select.POLLRDHUP)
        while time.monotonic() < self.left:
            if poll.poll(0):
                return "closed by the server"
            await asyncio.sleep(0.5)
        return "client left"


def request(client, line, *headers):
    return f"{line} HTTP/1.1\r\n{client.head}" + "".join(f"{header}\r\n" for header in headers) + "\r\n"


def authorised(client, line, *headers):
    return request(client, line, f"Authorization: Bearer {TOKEN}", *headers)


async def silent(client):
    return await client.answer()


async def half_a_request(client):
    await client.send(f"GET /api/state HTTP/1.1\r\n{client.head}X-Slow: a")
    return await client.answer()


async def a_byte_at_a_time(client):
    for byte in authorised(client, "GET /api/state").encode():
        await client.send(bytes([byte]))
        await asyncio.sleep(client.dice.uniform(0.05, 0.5))
    return await client.answer()


async def half_a_body(client):
    await client.send(authorised(client, "POST /api/settings", "Content-Length: 4000") + '{"enhance"')
    return await client.answer()


async def an_endless_body(client):
    await client.send(authorised(client, "POST /api/settings", "Transfer-Encoding: chunked"))
    for _ in range(1000):
        await client.send("400\r\n" + "a" * 1024 + "\r\n")
    return await client.answer()


async def pages_never_read(client):
    await client.send(authorised(client, "GET /page/main.js") * 200)
    return await client.unread()


async def events_never_read(client):
    await client.send(authorised(client, "GET /events"))
    return await client.unread()


async def huge_headers(client):
    line = "X-Large: " + "a" * 8000 + "\r\n"
    await client.send(f"GET /api/state HTTP/1.1\r\n{client.head}")
    for _ in range(128):
        await client.send(line)
    return await client.answer()


async def noise(client):
    await client.send(client.dice.randbytes(client.dice.randrange(1, 4000)))
    return await client.answer()


async def wrong_token(client):
    line = client.dice.choice(["GET /api/state", "GET /events", "POST /api/stop", "GET /image.npy", "GET /"])
    await client.send(request(client, line, f"Authorization: Bearer {TOKEN[:-1]}x", "Content-Length: 0"))
    return await client.answer()


async def page_of_another_site(client):
    await client.send(authorised(client, "POST /api/stop", "Origin: http://elsewhere.example", "Content-Length: 0"))
    return await client.answer()


async def leaves_at_once(client):
    if client.dice.random() < 0.5:
        # With a reset instead of an orderly end.
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    return "client left"


KINDS = [silent, half_a_request, a_byte_at_a_time, half_a_body, an_endless_body, pages_never_read, events_never_read,
         huge_headers, noise, wrong_token, page_of_another_site, leaves_at_once]
# The answers that clients without the token, or of another site, may get.
REFUSALS = {"wrong_token": "401", "page_of_another_site": "403"}


async def misbehave(number, page, ends, outcomes):
    """One client that comes again and again."""
    dice, loop = random.Random(number), asyncio.get_running_loop()
    while time.monotonic() < ends:
        kind = dice.choice(KINDS)
        client = Client(loop, dice, page)
        try:
            await client.connect()
            outcome = await kind(client)
        except TimeoutError:
            outcome = "client left"
        except ConnectionError:
            outcome = "closed while the client sent"
        except OSError as error:
            outcome = type(error).__name__
        client.socket.close()
        outcomes[kind.__name__, outcome] += 1
        await asyncio.sleep(dice.uniform(0.1, 1.0))


def misbehaving(clients, page, seconds, told):
    """All clients that misbehave, as a process of their own."""
    async def all_of_them():
        outcomes, ends = collections.Counter(), time.monotonic() + seconds
        await asyncio.gather(*(misbehave(number, page, ends, outcomes) for number in range(clients)))
        told.put(dict(outcomes))

    asyncio.run(all_of_them())


class Page(threading.Thread):
    """The page of a good client: reads the stream of states, as a browser does."""

    def __init__(self, place):
        super().__init__(daemon=True)
        self.place, self.times, self.breaks, self.shown = place, [], 0, 0

    def run(self):
        while True:
            try:
                for _ in events(self.place, self):
                    self.times.append(time.monotonic())
            except OSError:
                pass
            self.breaks += 1
            time.sleep(0.5)


def events(place, page=None):
    """The states that a page gets."""
    with socket.create_connection(place, timeout=30) as stream:
        client = argparse.Namespace(head=f"Host: {place[0]}:{place[1]}\r\n")
        stream.sendall(authorised(client, "GET /events").encode())
        for line in stream.makefile("rb"):
            if line.startswith(b"data: "):
                state = json.loads(line[6:])["state"]
                if page:
                    page.shown = state["images"]["shown"]
                yield state


def ask(place, path):
    """The body of an answer with status 200."""
    with socket.create_connection(place, timeout=30) as stream:
        client = argparse.Namespace(head=f"Host: {place[0]}:{place[1]}\r\n")
        stream.sendall(authorised(client, f"GET {path}", "Connection: close").encode())
        head, _, body = stream.makefile("rb").read().partition(b"\r\n\r\n")
    if not head.startswith(b"HTTP/1.1 200"):
        raise OSError(head[:40])
    return body


def new_page(place):
    """The first state of a page that is opened."""
    ask(place, "/")
    for state in events(place):
        return state
    raise OSError("the stream ended before the first state")


class Trials:
    """How long a good client waits, with as many attempts as it takes, for at most 30 s."""

    def __init__(self):
        self.waits_s, self.at_once, self.given_up = [], 0, 0

    def make(self, attempt):
        began, attempts = time.monotonic(), 0
        while time.monotonic() - began < 30:
            attempts += 1
            try:
                answer = attempt()
            except OSError:
                time.sleep(0.05)
                continue
            self.waits_s.append(time.monotonic() - began)
            self.at_once += attempts == 1
            return answer
        self.given_up += 1
        return None

    def report(self):
        ordered = sorted(self.waits_s)
        return {"made": len(ordered) + self.given_up, "at_once": self.at_once, "given_up": self.given_up,
                "median_s": round(ordered[len(ordered) // 2], 4), "worst_s": round(ordered[-1], 3)} if ordered else None


def open_files(pid):
    return len(os.listdir(f"/proc/{pid}/fd"))


def look(server, place, page, seconds, samples, asked, opened):
    """Looks once a second at a server that is in use. Returns images a second, and the processors used."""
    began, used, shown = time.monotonic(), processor_s(server.pid), page.shown
    since = samples[0][0] if samples else began
    while (passed := time.monotonic() - began) < seconds:
        samples.append((time.monotonic(), memory_mib(server.pid), open_files(server.pid)))
        asked.make(lambda: json.loads(ask(place, "/api/state")))
        if len(samples) % 10 == 0:
            opened.make(lambda: new_page(place))
        time.sleep(max(0, since + len(samples) - time.monotonic()))
    passed = time.monotonic() - began
    return (page.shown - shown) / passed, (processor_s(server.pid) - used) / passed


def soak(arguments):
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = arguments.clients + 100
    if limits[1] != resource.RLIM_INFINITY and limits[1] < needed:
        sys.exit(f"this user may open {limits[1]} files (ulimit -Hn), {arguments.clients} clients need {needed}")
    command = [arguments.nirspi, "serve", "--listen", "127.0.0.1:0", "--token", TOKEN]
    files = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (arguments.files, arguments.files))
    with tempfile.TemporaryFile("w+") as errors:
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, preexec_fn=files)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limits[1] if limits[1] != resource.RLIM_INFINITY else needed, limits[1]))
        try:
            report = watch(arguments, server)
        finally:
            server.send_signal(signal.SIGINT)
            try:
                said = server.communicate(timeout=30)[0].strip()
            except subprocess.TimeoutExpired:
                server.kill()
                said = "killed, because it did not end within 30 s"
        errors.seek(0)
        report |= {"nirspi_serve_said": said.splitlines()[-1:], "exit_code": server.returncode, "errors": errors.read()[:2000]}
    return report


def watch(arguments, server):
    line, scheme = server.stdout.readline(), "http://"
    found = [word for word in line.split() if word.startswith(scheme)]
    if not found:
        sys.exit(f"nirspi serve: found {line!r}, expected a line with an address {scheme}")
    host, port = found[0].removeprefix(scheme).split("/")[0].split(":")
    here = host, int(port)
    page = Page(here)
    page.start()
    deadline = time.monotonic() + 120
    while page.shown < 5:
        if time.monotonic() > deadline or server.poll() is not None:
            sys.exit("nirspi serve: found no 5 images after 120 s, expected them")
        time.sleep(0.2)
    alone, among, asked, opened = [], [], Trials(), Trials()
    images_alone, cores_alone = look(server, here, page, 10, alone, Trials(), Trials())
    commands = json.loads(ask(here, "/api/state"))["light"]["commands"]

    processes = multiprocessing.get_context("spawn")
    told = processes.Queue()
    crowd = processes.Process(target=misbehaving, daemon=True,
                              args=(arguments.clients, here, arguments.seconds, told))
    crowd.start()
    time.sleep(1)
    begun = time.monotonic()
    images, cores = look(server, here, page, arguments.seconds - 1, among, asked, opened)
    ended = time.monotonic()
    outcomes = told.get(timeout=STAYS_S + 30)
    crowd.join()
    # Connections that say nothing are closed after 10 s.
    time.sleep(12)
    state = json.loads(ask(here, "/api/state"))
    times = [begun, *(at for at in page.times if begun < at < ended), ended]
    kinds = collections.defaultdict(dict)
    for (kind, outcome), count in sorted(outcomes.items()):
        kinds[kind][outcome] = count
    # What the system keeps ready from the first clients on is not growth.
    tail = among[len(among) // 10:]
    quarter = max(1, len(tail) // 4)
    mean = lambda part: round(sum(mib for _, mib, _ in part) / len(part), 2)
    if arguments.plot:
        plot([(at - among[0][0], mib) for at, mib, _ in among], arguments.plot)
    return {
        "simulated": True,
        "seconds": round(ended - begun, 1),
        "clients": arguments.clients,
        "connections": sum(outcomes.values()),
        "connections_per_s": round(sum(outcomes.values()) / arguments.seconds, 1),
        "what_became_of_them": kinds,
        "images_per_s": {"before": round(images_alone, 1), "among_clients": round(images, 1)},
        "processor_cores": {"before": round(cores_alone, 2), "among_clients": round(cores, 2)},
        "states_on_the_page": len(times) - 2,
        "longest_silence_on_the_page_s": round(max(b - a for a, b in zip(times, times[1:])), 2),
        "breaks_of_the_page": page.breaks,
        "requests_of_the_page": asked.report(),
        "pages_opened_anew": opened.report(),
        "light_commands_of_others": state["light"]["commands"] - commands,
        "frames": state["frames"],
        "pages_at_the_end": state["viewers"],
        "memory_mib": {"before": mean(alone), "first_quarter": mean(tail[:quarter]), "last_quarter": mean(tail[-quarter:]),
                       "most": max(mib for _, mib, _ in among)},
        "files": {"allowed": arguments.files, "before": alone[-1][2], "most": max(files for *_, files in among),
                  "after": open_files(server.pid)},
        "machine_load": round(os.getloadavg()[0], 2),
    }


def unmet(report):
    """What a good client must not suffer, and what a bad one must not get."""
    requests, pages = report["requests_of_the_page"], report["pages_opened_anew"]
    growth = report["memory_mib"]["last_quarter"] - report["memory_mib"]["first_quarter"]
    silence = report["longest_silence_on_the_page_s"]
    told = {kind: {word for word in report["what_became_of_them"].get(kind, {}) if word.isdigit()} for kind in REFUSALS}
    missing = [kind.__name__ for kind in KINDS if kind.__name__ not in report["what_became_of_them"]]
    checks = [
        (missing, f"no client was of the kinds {missing}"),
        (report["breaks_of_the_page"] > 0, f"the page's stream ended {report['breaks_of_the_page']} times"),
        (silence > MOST_SILENCE_S, f"the page was silent for {silence} s, expected at most {MOST_SILENCE_S}"),
        (requests["given_up"] or requests["worst_s"] > MOST_WAIT_S, f"requests of the page waited: {requests}"),
        (pages and (pages["given_up"] or pages["worst_s"] > MOST_WAIT_S), f"pages opened anew waited: {pages}"),
        (report["light_commands_of_others"] != 0, "a client without the right to do so switched the LEDs"),
        (growth > MOST_GROWTH_MIB, f"memory grew by {growth:.1f} MiB, expected at most {MOST_GROWTH_MIB}"),
        (report["files"]["after"] > report["files"]["before"] + MOST_FILES, f"files are left open: {report['files']}"),
        (report["exit_code"] != 0, f"nirspi serve ended with {report['exit_code']}, expected 0"),
        (report["errors"], "nirspi serve wrote to standard error"),
    ]
    checks += [(words - {REFUSALS[kind]}, f"{kind} was answered {sorted(words)}, expected {REFUSALS[kind]} alone")
               for kind, words in told.items()]
    return [words for is_so, words in checks if is_so]


# The kinds in the order and words of docs/log/reliability.md.
WORDS = {
    "silent": "says nothing", "half_a_request": "sends half a request",
    "a_byte_at_a_time": "sends a request a byte at a time", "half_a_body": "sends half a body",
    "an_endless_body": "sends a body without end", "huge_headers": "sends headers of 1 MB", "noise": "sends noise",
    "pages_never_read": "asks for 200 files and reads none", "events_never_read": "opens the events and reads none",
    "leaves_at_once": "connects and leaves", "wrong_token": "has a wrong token",
    "page_of_another_site": "is a page of another site",
}


def thousands(number):
    return f"{number:,}".replace(",", " ")


def markdown(report):
    """The two tables of docs/log/reliability.md."""
    rows = ["| a client that | connections | answered | closed by the program | left by the client |", "| -- | -- | -- | -- | -- |"]
    for kind, words in WORDS.items():
        ends = report["what_became_of_them"].get(kind, {})
        answers = {status: count for status, count in ends.items() if status.isdigit()}
        closed = sum(count for end, count in ends.items() if end.startswith("closed"))
        left = ends.get("client left", 0)
        told = [f"{thousands(count)} with {status}" for status, count in answers.items()]
        # Errors of the clients' own system, such as no free address.
        if other := sum(ends.values()) - sum(answers.values()) - closed - left:
            told.append(f"{thousands(other)} with an error of the client")
        told = ", ".join(told) or "0"
        rows.append(f"| {words} | {thousands(sum(ends.values()))} | {told} | {thousands(closed)} | {thousands(left)} |")
    trials = lambda of: f"{of['at_once']} of {of['made']}; {of['median_s']} s, {of['worst_s']} s" if of else "none"
    memory, files, frames = report["memory_mib"], report["files"], report["frames"]
    made = frames["received"] + frames["lost"] + frames["corrupt"] + frames["late"]
    seen = [
        ("images a second", report["images_per_s"]["before"], report["images_per_s"]["among_clients"]),
        ("processors of `nirspi serve`", report["processor_cores"]["before"], report["processor_cores"]["among_clients"]),
        (f"frames lost, of {thousands(made)}", "", thousands(frames["lost"])),
        ("longest time without a new state on the page", "", f"{report['longest_silence_on_the_page_s']} s"),
        ("ends of the page's stream", "", report["breaks_of_the_page"]),
        ("requests of the page, answered at the first attempt; median and longest wait", "",
         trials(report["requests_of_the_page"])),
        ("pages opened anew, at the first attempt; median and longest wait", "", trials(report["pages_opened_anew"])),
        ("memory: mean before, in the first and in the last quarter", f"{memory['before']:.0f} MiB",
         f"{memory['first_quarter']:.0f} and {memory['last_quarter']:.0f} MiB"),
        ("open files: before, most, afterwards", files["before"], f"{files['most']}, then {files['after']}"),
    ]
    rows += ["", "| what a good page and the program saw | before | among the clients |", "| -- | -- | -- |"]
    rows += [f"| {what} | {before} | {among} |" for what, before, among in seen]
    return "\n".join(rows)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("nirspi")
    arguments.add_argument("--clients", type=int, default=1000)
    arguments.add_argument("--seconds", type=float, default=600)
    arguments.add_argument("--files", type=int, default=256, help="files that nirspi serve may open (ulimit -n)")
    arguments.add_argument("--plot", help="memory over time, SVG")
    arguments.add_argument("--markdown", action="store_true", help="print the tables of docs/log/reliability.md instead of JSON")
    arguments = arguments.parse_args()
    report = soak(arguments)
    report["unmet"] = unmet(report)
    print(markdown(report) if arguments.markdown else json.dumps(report, indent=2))
    if arguments.markdown and report["unmet"]:
        print("\n".join(report["unmet"]), file=sys.stderr)
    sys.exit(1 if report["unmet"] else 0)


if __name__ == "__main__":
    main()
