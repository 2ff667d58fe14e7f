"""Recordings: frames with their times, whole or cut short, as tables."""

import json

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("rec") / "rec.mcap"
    with ns.Camera("virtual", sampling=0.25) as camera:
        camera.record(path, frames=30)
    return path


def test_a_recording_holds_what_the_camera_gave(path):
    with ns.Camera("virtual", sampling=0.25) as camera:
        expected = camera.read(30)
    recording = ns.Recording(path)
    assert (recording.y == expected).all() and len(recording) == 30
    assert recording.sequence.tolist() == list(range(30))
    assert (np.diff(recording.device_time_us) > 0).all() and (np.diff(recording.time_ns) >= 0).all()
    assert recording.account["received"] == 30 and recording.counted == ns.Account(received=30)
    assert recording.identity["board"] == "virtual" and recording.settling["adc_latency"] == 6
    assert any("run 1 has ended: 30 frames" in text for _time, text in recording.events)
    assert recording.cut_short is None


def test_the_frames_are_read_when_they_are_asked_for(path):
    recording = ns.Recording(path)
    assert "_frames" not in vars(recording)
    assert recording.y is not None and "_frames" in vars(recording)


def test_a_recording_that_was_cut_gives_what_is_before_the_cut(path, tmp_path):
    whole = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    recording = ns.Recording(cut)
    assert 0 < len(recording) < 30 and recording.cut_short and recording.account is None
    assert (recording.y == ns.Recording(path).y[: len(recording)]).all()
    assert any("cut short" in note for note in recording.measurement().notes)
    with pytest.warns(RuntimeWarning, match="the recording is not whole: [0-9]+ received, 0 lost.*cut short"):
        assert any("cut short" in note for note in ns.load(cut).notes)


def test_the_measurement_of_a_recording_is_that_of_the_capture(path, tmp_path):
    with ns.Camera("virtual", sampling=0.25) as camera:
        captured = camera.record(tmp_path / "again.mcap", frames=30)
    found = ns.Recording(path).measurement()
    # Settling is kept as a decimal text.
    assert np.allclose(found.d, captured.d, rtol=1e-12) and (found.rows == captured.rows).all()
    assert found.unit == "ADC counts" and found.frames.received == 30
    assert ns.Recording(path).measurement(index="all").d.shape == (30, 256)


def test_recordings_of_every_version_open():
    for old in sorted((ROOT / "host/tests/recordings").glob("*.mcap")):
        recording = ns.Recording(old)
        assert recording.y.shape == (len(recording), len(recording.rows)), old


def test_a_dataset_of_xarray(path):
    pytest.importorskip("xarray")
    data = ns.Recording(path).to_xarray()
    assert data.y.dims == ("time", "pattern") and data.y.shape == (30, 256)
    assert data.y.attrs["units"] == "summed ADC counts" and "row" in data.coords
    assert json.loads(data.attrs["identity"])["board"] == "virtual"


def test_a_parquet_table(path, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    recording = ns.Recording(path)
    recording.to_parquet(tmp_path / "r.parquet")
    table = pq.read_table(tmp_path / "r.parquet")
    assert (np.stack(table["y"].to_numpy()) == recording.y).all()
    assert json.loads(table.schema.metadata[b"rows"]) == recording.rows.tolist()


def test_what_is_no_recording_is_refused(tmp_path):
    (tmp_path / "text.mcap").write_text("hello")
    with pytest.raises(ns.Error, match="expected a nirspi recording"):
        ns.Recording(tmp_path / "text.mcap")
    with pytest.raises(FileNotFoundError):
        ns.Recording(tmp_path / "gone.mcap")
    with pytest.raises(ns.Error, match="a folder"):
        ns.Recording(tmp_path)
