"""Checks that another program sees a live camera over the Foxglove WebSocket protocol: the Python
packages websockets, mcap-protobuf-support and numpy.

Usage: live.py path/to/nirspi
"""

import asyncio
import base64
import io
import json
import re
import struct
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

import numpy as np
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

server = subprocess.Popen(
    [Path(sys.argv[1]).resolve(), "serve", "--listen", "127.0.0.1:0", "--foxglove", "0"],
    stdout=subprocess.PIPE,
    text=True,
    cwd=tempfile.gettempdir(),
)
page = re.search(r"http://\S+", server.stdout.readline())[0]
url = re.search(r"ws://\S+", server.stdout.readline())[0]


def ask(path, data=None):
    with urllib.request.urlopen(page + path, data=data, timeout=60) as answer:
        return answer.read()


class Viewer:
    """A connection, and what its channels are."""

    def __init__(self, socket):
        self.socket = socket
        self.topics = {}

    async def greet(self):
        info = json.loads(await self.socket.recv())
        assert info["op"] == "serverInfo" and "simulated" in info["name"], info
        advertised = json.loads(await self.socket.recv())
        assert advertised["op"] == "advertise", advertised
        for channel in advertised["channels"]:
            self.topics[channel["topic"]] = channel
        subscriptions = [{"id": 100 + c["id"], "channelId": c["id"]} for c in advertised["channels"]]
        await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    def decoded(self, data):
        """Topic and message of a frame with data."""
        operation, subscription, time_ns = struct.unpack_from("<BIQ", data)
        assert operation == 1, operation
        channel = next(c for c in self.topics.values() if c["id"] == subscription - 100)
        schema = Schema(
            id=channel["id"],
            name=channel["schemaName"],
            encoding=channel["schemaEncoding"],
            data=base64.b64decode(channel["schema"]),
        )
        decode = DecoderFactory().decoder_for(channel["encoding"], schema)
        message = decode(data[13:])
        assert message.timestamp.seconds * 10**9 + message.timestamp.nanos == time_ns
        return channel["topic"], message

    async def until(self, is_enough):
        """The newest message of each topic, and all lines of the log."""
        newest, log = {}, []
        while not is_enough(newest, log):
            topic, message = self.decoded(await asyncio.wait_for(self.socket.recv(), 60))
            newest[topic] = message
            if topic == "/log":
                log.append(message)
        return newest, log


def pixels(image):
    assert image.encoding == "32FC1" and image.step == 4 * image.width
    return np.frombuffer(image.data, "<f4").reshape(image.height, image.width)


async def main():
    # While the camera runs: all topics, and images one after the other.
    async with connect(url, subprotocols=["foxglove.sdk.v1"], compression=None) as socket:
        viewer = Viewer(socket)
        await viewer.greet()
        names = ["/image", "/enhanced", "/depth", "/telemetry", "/log", "/calibration"]
        newest, log = await viewer.until(lambda newest, _: all(name in newest for name in names))
        assert any("connected to virtual" in line.message for line in log), log
        telemetry, calibration = newest["/telemetry"], newest["/calibration"]
        assert telemetry.received > 0 and telemetry.lost == 0, telemetry
        assert calibration.K[2] == 16 and calibration.K[0] > 16, calibration
        depth = pixels(newest["/depth"])
        assert depth.shape == (32, 32) and 0.2 < np.median(depth) < 0.5, np.median(depth)
        times = []
        while len(times) < 20:
            topic, message = viewer.decoded(await asyncio.wait_for(socket.recv(), 60))
            if topic == "/image":
                times.append(message.timestamp.seconds + message.timestamp.nanos * 1e-9)
        assert times == sorted(times), times
        print(f"live: 20 images in {times[-1] - times[0]:.2f} s; topics {', '.join(sorted(newest))}")

    # After a stop the image stands still: a viewer has the pixels of the page, to the bit.
    ask("/api/stop", b"")
    for _ in range(600):
        before = json.loads(ask("/api/state"))
        if before["camera"]["phase"] == "stopped" and before["images"]["waiting"] == 0:
            break
        await asyncio.sleep(0.1)
    async with connect(url, subprotocols=["foxglove.websocket.v1"], compression=None) as socket:
        viewer = Viewer(socket)
        await viewer.greet()
        names = ("/image", "/enhanced")
        newest, _ = await viewer.until(lambda newest, _: all(name in newest for name in names))
        counts = np.load(io.BytesIO(ask("/image.npy")))
        white = np.float32(json.loads(ask("/api/state"))["picture"]["white_counts"])
        shares = np.clip(counts * (np.float32(1) / white), 0, 1)
        assert np.array_equal(pixels(newest["/image"]), shares)
        assert np.array_equal(pixels(newest["/enhanced"]), np.load(io.BytesIO(ask("/enhanced.npy"))))
        print("live: /image and /enhanced are those of the page, to the bit")

        # Bad input closes its own connection.
        async with connect(url, subprotocols=["foxglove.sdk.v1"]) as bad:
            await bad.send("nonsense")
            try:
                while True:
                    await asyncio.wait_for(bad.recv(), 60)
            except ConnectionClosed as closed:
                assert closed.rcvd.code == 1007, closed
        await socket.send(json.dumps({"op": "getParameters", "parameterNames": []}))
        while not isinstance(told := await asyncio.wait_for(socket.recv(), 60), str):
            pass
        assert json.loads(told)["op"] == "status", told
    for headers, protocols in (({"Origin": "https://evil.example"}, ["foxglove.sdk.v1"]), ({}, None)):
        try:
            await connect(url, subprotocols=protocols, additional_headers=headers)
            raise AssertionError((headers, protocols))
        except InvalidStatus as refused:
            print("live: refused:", refused.response.body.decode().strip())
    state = json.loads(ask("/api/state"))["foxglove"]
    assert state["images_sent"] > 40 and state["viewers"] == 0, state


try:
    asyncio.run(main())
finally:
    server.terminate()
    server.wait()
