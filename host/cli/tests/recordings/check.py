"""Checks that other programs read what nirspi records and exports: the Python packages mcap,
mcap-protobuf-support, numpy, Pillow and, where there is one, rerun.

Usage: check.py path/to/nirspi
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

# No compiled files beside the sources.
sys.dont_write_bytecode = True
import fields

nirspi = str(Path(sys.argv[1]).resolve())
folder = Path(tempfile.mkdtemp())


def run(*arguments):
    done = subprocess.run([nirspi, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (arguments, done.stderr)
    return done.stdout


def messages(name):
    """Every message of a file, decoded where its channel is protobuf."""
    with open(folder / name, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        topics = ["/telemetry", "/log", "/image", "/calibration", "/depth", "/enhanced", "/spread", "/interval"]
        decoded = list(reader.iter_decoded_messages(topics=topics))
        raw = list(reader.iter_messages(topics=["/wire"]))
        return decoded, raw, reader.get_summary()


run("capture", "--frames", "12", "--sampling", "0.5", "--out", "rec.mcap")
for kind in ("mcap", "npz", "npy", "csv", "apng"):
    run("recording", "export", "rec.mcap", "--to", kind, "--out", f"out.{kind}")
run("reconstruct", "rec.mcap", "--out", "sum", "--no-flat-field")

# The image channel holds the image of `reconstruct`, scaled from 0 to 1 in float32.
recorded, wire, summary = messages("rec.mcap")
exported, wire_again, _ = messages("out.mcap")
assert [m.data for _, _, m in wire] == [m.data for _, _, m in wire_again]
assert [m.log_time for _, _, m in wire] == [m.log_time for _, _, m in wire_again]
images = [image for _, channel, _, image in exported if channel.topic == "/image"]
assert len(images) == 1, len(images)
image = images[0]
assert (image.width, image.height, image.encoding, image.step) == (32, 32, "32FC1", 128)
pixels = np.frombuffer(image.data, "<f4").reshape(32, 32)
truth = np.load(folder / "sum" / "image.npy").reshape(32, 32)
least, most = truth.min(), truth.max()
scaled = (truth - least) * (np.float32(1) / (most - least))
assert np.array_equal(pixels, scaled), np.abs(pixels - scaled).max()
assert pixels.min() == 0 and abs(pixels.max() - 1) < 1e-6
print(f"image: {pixels.shape} float32 from {pixels.min()} to {pixels.max()}, as reconstructed")

# Telemetry and log are in the recording itself.
for found in (recorded, exported):
    telemetry = [m for _, c, _, m in found if c.topic == "/telemetry"]
    log = [m for _, c, _, m in found if c.topic == "/log"]
    assert telemetry and telemetry[0].timestamp.seconds > 1_500_000_000
    assert any("has ended: 12 frames made" in line.message for line in log), log
    assert all(line.level == 2 for line in log)
calibration = [m for _, c, _, m in exported if c.topic == "/calibration"]
assert len(calibration) == 1 and calibration[0].K[2] == 16 and calibration[0].K[0] > 16
names = sorted(schema.name for schema in summary.schemas.values())
print("schemas:", ", ".join(names))
assert names[-1] == "nirspi.wire.v1" and summary.chunk_indexes
assert summary.statistics.message_count >= len(wire)

frames = np.load(folder / "out.npy")
npz = np.load(folder / "out.npz")
assert frames.shape == (12, 512) and np.array_equal(npz["frames"], frames)
assert npz["sequence"].tolist() == list(range(12)) and npz["simulated"] == 1

csv = np.genfromtxt(folder / "out.csv", delimiter=",", names=True, skip_header=2)
assert np.array_equal(csv["d"], npz["d"]) and np.array_equal(csv["h_row"], npz["h_row"])

parts, wire_times = fields.recording(folder / "rec.mcap", 12)
fields.telemetry(recorded, 12)
fields.arrays(folder, parts, wire_times)
fields.pictures(folder)

# The camera's time is longer than that of one depth map.
run("capture", "--frames", "1100", "--sampling", "0.02", "--sweeps", "60", "--out", "long.mcap")
run("recording", "export", "long.mcap", "--to", "mcap", "--out", "long-out.mcap")

# Depth maps are in the exported file alone, at the times of their packets.
recorded, wire, _ = messages("long.mcap")
exported, _, _ = messages("long-out.mcap")
assert not any(channel.topic == "/depth" for _, channel, _, _ in recorded)
maps = [(m.log_time, decoded) for _, c, m, decoded in exported if c.topic == "/depth"]
assert maps and {time for time, _ in maps} <= {m.log_time for _, _, m in wire}
depth_m = np.frombuffer(maps[0][1].data, "<f4").reshape(32, 32)
assert maps[0][1].encoding == "32FC1" and 0.25 < np.median(depth_m) < 0.35, np.median(depth_m)
print(f"depth: {len(maps)} maps, median {np.median(depth_m):.3f} m (simulated)")

# Enhanced images are those of `reconstruct --enhance`, each with its spread and its intervals.
run("recording", "export", "rec.mcap", "--to", "mcap", "--enhance", "--out", "enhanced.mcap")
run("reconstruct", "rec.mcap", "--enhance", "--out", "enhanced", "--no-flat-field")
made = {c.topic: m for _, c, _, m in messages("enhanced.mcap")[0]}
topics = ("/enhanced", "/spread", "/interval")
enhanced, spread, interval = (np.frombuffer(made[topic].data, "<f4").reshape(64, 64) for topic in topics)
assert np.array_equal(enhanced, np.load(folder / "enhanced" / "enhanced.npy").reshape(64, 64))
assert 0 < spread.max() < 0.5 and spread.min() >= 0, (spread.min(), spread.max())
# No half-width is below what a bench can hold.
assert 0.004 <= interval.min() and interval.max() <= 1, (interval.min(), interval.max())
print(f"spread: median {np.median(spread):.4f}, greatest {spread.max():.3f} of white (simulated)")
print(f"interval: median {np.median(interval):.4f}, greatest {interval.max():.3f} of white (simulated)")


def image_in_rerun(name):
    """The pixels of the only image of a file, as Rerun reads and serves them."""
    import rerun as rr

    converted = (folder / name).with_suffix(".rrd")
    subprocess.run([rerun, "mcap", "convert", folder / name, "-o", converted], check=True, timeout=120)
    with rr.server.Server(host="127.0.0.1", datasets={"seen": [converted]}) as server:
        seen = server.client().get_dataset("seen").filter_contents(["/image"])
        table = seen.reader(index="message_log_time").to_arrow_table()
    ((pixels,),) = table["/image:Image:buffer"].to_pylist()
    ((form,),) = table["/image:Image:format"].to_pylist()
    return np.frombuffer(bytes(pixels), "<f4").reshape(form["height"], form["width"])


rerun = Path(sys.executable).with_name("rerun")
if rerun.exists():
    for name in ("rec.mcap", "out.mcap"):
        subprocess.run([rerun, "mcap", "check", folder / name], check=True, timeout=120)
    assert np.array_equal(image_in_rerun("out.mcap"), scaled)
    print("rerun: both files are sound, and the image is as reconstructed")
else:
    print("skipped: rerun is not here")
