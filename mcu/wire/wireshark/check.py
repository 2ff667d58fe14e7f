"""Runs the dissector on a recording: `python3 check.py RECORDING.mcap [TSHARK]`.

The packets of the recording become the payload of a TCP stream from port 1550, cut into segments at arbitrary places; some
packets are damaged. tshark must then show every packet, with the sequence numbers that the frames have, and every damaged
packet as damaged.
"""

import json
import struct
import subprocess
import sys
import tempfile

MESSAGE = 0x05  # MCAP: message record
HEADER_BYTES = 22  # channel, sequence, two times


def packets(path):
    """Every wire packet of a recording, delimiter included."""
    data = open(path, "rb").read()
    at = 8
    while at + 9 <= len(data):
        opcode, length = data[at], struct.unpack_from("<Q", data, at + 1)[0]
        if opcode == MESSAGE:
            yield data[at + 9 + HEADER_BYTES : at + 9 + length]
        at += 9 + length


def pcap(segments):
    """A capture of these TCP segments from port 1550 to port 50000."""
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 18, 101)  # raw IP
    sequence = 1
    for number, data in enumerate(segments):
        tcp = struct.pack(">HHIIBBHHH", 1550, 50000, sequence, 1, 5 << 4, 0x18, 65535, 0, 0) + data
        ip = struct.pack(
            ">BBHHHBBH4s4s", 0x45, 0, 20 + len(tcp), number, 0, 64, 6, 0, bytes([127, 0, 0, 1]), bytes([127, 0, 0, 1])
        )
        out += struct.pack("<IIII", number, 0, len(ip + tcp), len(ip + tcp)) + ip + tcp
        sequence += len(data)
    return out


def shown(tshark, script, capture):
    """What tshark shows of each packet: message, sequence, damage."""
    command = [tshark, "-X", f"lua_script:{script}", "-r", capture, "-T", "json", "-J", "nirspi", "--no-duplicate-keys"]
    found = []
    for segment in json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout):
        layer = segment["_source"]["layers"].get("nirspi", [])
        found.extend(layer if isinstance(layer, list) else [layer])
    return found


def main():
    recording, tshark = sys.argv[1], (sys.argv[2:] or ["tshark"])[0]
    script = __file__.replace("check.py", "nirspi.lua")
    whole = list(packets(recording))
    damaged = [bytes([*packet[:5], packet[5] ^ 0x41 or 1, *packet[6:]]) for packet in whole[:2]]
    stream = b"".join(whole + damaged)
    segments = [stream[at : at + 997] for at in range(0, len(stream), 997)]
    with tempfile.NamedTemporaryFile(suffix=".pcap") as capture:
        capture.write(pcap(segments))
        capture.flush()
        layers = shown(tshark, script, capture.name)
    frames = [int(layer["nirspi.sequence"]) for layer in layers if layer.get("nirspi.message") == "Frame"]
    broken = [layer for layer in layers if "nirspi.damaged" in layer]
    print(f"{len(layers)} packets of {len(whole) + len(damaged)}: {len(frames)} frames, {len(broken)} damaged")
    assert len(layers) == len(whole) + len(damaged), "packets are missing"
    assert len(broken) == len(damaged), "damage was not seen"
    assert frames and frames == list(range(len(frames))), f"sequence numbers {frames}"


if __name__ == "__main__":
    main()
