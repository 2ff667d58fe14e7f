"""Every field of a recording and of its exports, read by other programs: the packages mcap, numpy and Pillow."""

import json
import zlib

import numpy as np
from mcap.reader import make_reader
from PIL import Image

SIGNED = {"origin", "camera", "file", "program", "commit", "command", "date"}


def recording(path, frames):
    """The file itself: header, numbers and times of messages, channels, schemas, and each metadata record with its checksum."""
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        found = list(reader.iter_messages())
        records = list(reader.iter_metadata())
    assert header.profile == "nirspi" and header.library.startswith("mcap-rust/"), header
    assert summary.statistics.message_count == len(found) and summary.statistics.metadata_count == len(records)
    assert summary.statistics.message_start_time == min(m.log_time for _, _, m in found)
    assert summary.statistics.message_end_time == max(m.log_time for _, _, m in found)
    for topic in {channel.topic for _, channel, _ in found}:
        ours = [(schema, channel, m) for schema, channel, m in found if channel.topic == topic]
        schema, channel, _ = ours[0]
        # Each channel counts its own messages, and no time runs back.
        assert [m.sequence for _, _, m in ours] == list(range(len(ours))), topic
        times = [m.log_time for _, _, m in ours]
        assert times == sorted(times) == [m.publish_time for _, _, m in ours], topic
        assert len(ours) == summary.statistics.channel_message_counts[channel.id], topic
        wire = topic == "/wire"
        assert (schema.encoding, channel.message_encoding) == (("text", "nirspi-wire-v1") if wire else ("protobuf",) * 2)
        assert schema.data, topic
    texts = {}
    for record in records:
        text = record.metadata["json"]
        assert set(record.metadata) == {"json", "crc32"}, record
        assert int(record.metadata["crc32"], 16) == zlib.crc32(text.encode()), record
        # What stands before the packets stands once more at the end.
        assert texts.setdefault(record.name, text) == text, record.name
    parts = {name.removeprefix("nirspi."): json.loads(text) for name, text in texts.items()}
    assert set(parts) == {"identity", "setup", "settling", "run", "nirspi-provenance", "account"}, parts.keys()
    provenance = parts["nirspi-provenance"]
    assert provenance["origin"] == "simulated" and " capture " in provenance["command"], provenance
    identity, account = parts["identity"], parts["account"]
    assert (identity["board"], identity["serial"], identity["protocol"]) == ("virtual", "virtual-1", 1), identity
    assert (identity["adc_hz"], identity["adc_bits"], identity["wavelength_nm"]) == (125_000_000, 14, 1550), identity
    assert identity["firmware"] and identity["gateware"] and "depth" in identity["capabilities"], identity
    assert account == {"received": frames, "lost": 0, "corrupt": 0, "late": 0, "asked": frames, "made": frames, "missing": None}
    # How many samples the response has depends on the noise: it ends where it cannot be told from 1.
    response = parts["settling"]["response"]
    assert parts["settling"]["adc_latency"] == 6, parts["settling"]
    assert abs(response[0] - 0.53) < 0.05 and 0.97 < response[-1] < 1.02, parts["settling"]
    assert parts["run"] == 1 and parts["setup"]["order"] == "cake-cutting", parts
    return parts, [m.log_time for _, channel, m in found if channel.topic == "/wire"]


def telemetry(decoded, frames):
    """The last telemetry says what the account says."""
    last = [message for _, channel, _, message in decoded if channel.topic == "/telemetry"][-1]
    names = {field.name for field in last.DESCRIPTOR.fields}
    assert {"received", "lost", "corrupt", "late"} <= names, names
    assert last.received <= frames and (last.lost, last.corrupt, last.late) == (0, 0, 0), last


def signed(provenance, command):
    assert set(provenance) == SIGNED, provenance
    assert (provenance["origin"], provenance["file"]) == ("simulated", "rec.mcap"), provenance
    assert provenance["camera"]["serial"] == "virtual-1" and provenance["program"].startswith("nirspi "), provenance
    assert f" {command} rec.mcap" in provenance["command"], provenance
    assert np.datetime64(provenance["date"].rstrip("Z")) > np.datetime64("2026-01-01"), provenance


def arrays(folder, parts, wire_times):
    """The .npz, .npy and .csv say the same of the same frames."""
    npz = np.load(folder / "out.npz")
    frames = npz["frames"]
    assert set(npz) == {"n", "h_row", "d", "noise", "sequence", "device_time_us", "time_ns", "simulated", "provenance", "frames"}
    assert npz["n"] == 32 and npz["h_row"].tolist() == parts["setup"]["rows"]
    assert np.allclose(npz["d"], frames.mean(0), atol=1e-6)
    # The noise of the mean, from the spread of the frames: of as many patterns, known to a few per cent.
    spread = np.sqrt((frames.var(0, ddof=1) / len(frames)).mean())
    assert 0.7 < npz["noise"] / spread < 1.4, (npz["noise"], spread)
    steps = np.diff(npz["device_time_us"])
    assert (steps > 0).all() and np.ptp(steps) <= 1, steps
    assert set(npz["time_ns"].tolist()) <= set(wire_times)
    signed(json.loads(str(npz["provenance"])), "export")
    signed(json.loads((folder / "out.npy.json").read_text())["provenance"], "export")
    first, second, heading = (folder / "out.csv").read_text().splitlines()[:3]
    assert first == f"# mean of {len(frames)} frames, ADC counts, simulated", first
    signed(json.loads(second.removeprefix("# provenance: ")), "export")
    assert heading == "n,h_row,d,noise", heading
    csv = np.genfromtxt(folder / "out.csv", delimiter=",", names=True, skip_header=2)
    assert (csv["n"] == 32).all() and (csv["noise"] == npz["noise"]).all()


def pictures(folder):
    """Pillow reads the texts of pictures, and every image of a video."""
    report = json.loads((folder / "sum" / "report.json").read_text())
    signed(report["provenance"], "reconstruct")
    image = np.load(folder / "sum" / "image.npy").reshape(32, 32)
    assert (report["input"], report["n"], report["measurements"], report["used"]) == ("rec.mcap", 32, 512, 512), report
    assert report["sampling"] == 0.5 and report["frames"] == {"received": 12, "lost": 0, "corrupt": 0, "late": 0}, report
    (told,) = report["pictures"][0]["images"]
    assert np.allclose([told["least"], told["most"]], [image.min(), image.max()]), told
    assert np.allclose([told["black"], told["white"]], np.percentile(image, [0.5, 99.5]), rtol=0.02, atol=1), told
    with Image.open(folder / "sum" / "image.png") as picture:
        texts, pixels = dict(picture.info), np.asarray(picture.convert("L"), float)
    # A release build adds its commit.
    assert texts["Software"].startswith(report["provenance"]["program"]) and texts["Source"].startswith("simulated, camera virtual-1")
    assert texts["Creation Time"] == report["provenance"]["date"], texts
    assert json.loads(texts["nirspi-provenance"]) == report["provenance"]
    place = json.loads(texts["nirspi-picture"])
    assert place["size"] == list(pixels.shape[::-1]) and place["images"] == 1, place
    one = place["image"]
    # The middle of each cell is a pixel of the image, from black to white.
    rows, columns = (one[edge] + one["cell"] // 2 + one["cell"] * np.arange(32) for edge in ("top", "left"))
    shares = np.clip((image - told["black"]) / (told["white"] - told["black"]), 0, 1)
    assert np.abs(pixels[np.ix_(rows, columns)] - 255 * shares).max() < 1.5, place
    with Image.open(folder / "out.apng") as video:
        assert video.n_frames == 12 and video.info["Source"].startswith("simulated, camera virtual-1"), video.info
        signed(json.loads(video.info["nirspi-provenance"]), "export")
    print("fields: recording, metadata, arrays, report and texts of pictures are as told")
