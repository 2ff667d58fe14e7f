"""The numbers of the package are those of the program, to the bit."""

import json
import subprocess

import numpy as np
import pytest

import nirspi as ns


def run(cli, *arguments):
    made = subprocess.run([cli, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return made.stdout


def same(a, b):
    return np.asarray(a).tobytes() == np.asarray(b, np.float32).tobytes()


@pytest.fixture(scope="module")
def wing(cli, tmp_path_factory):
    path = tmp_path_factory.mktemp("wing") / "wing.npz"
    run(cli, "example", "wing", "--out", path)
    return path


@pytest.mark.parametrize("method", ns.methods())
@pytest.mark.parametrize("sampling", ["1", "30%"])
def test_reconstruct(cli, wing, tmp_path, method, sampling):
    run(cli, "reconstruct", wing, "--method", method, "--sampling", sampling, "--out", tmp_path / "o")
    image = ns.reconstruct(ns.load(wing), method=method, sampling=sampling)
    assert same(image, np.load(tmp_path / "o/image.npy"))
    report = json.loads((tmp_path / "o/report.json").read_text())
    assert image.report["used"] == report["used"] and image.report["order"] == report["order"]
    section = next((s for s in ("penalty", method) if s in report), None)
    assert section is None or image.report[section] == report[section]


@pytest.mark.parametrize("method", ["hadamard", "tikhonov", "auto"])
def test_reconstruct_and_enhance(cli, wing, tmp_path, method):
    options = ["--method", method, "--sampling", "0.5"]
    run(cli, "reconstruct", wing, "--enhance", *options, "--out", tmp_path / "o")
    sharp = ns.enhance(ns.reconstruct(ns.load(wing), method=method, sampling=0.5))
    assert same(sharp, np.load(tmp_path / "o/enhanced.npy"))
    report = json.loads((tmp_path / "o/report.json").read_text())["enhancement"]
    assert sharp.report["inconsistency"] == pytest.approx(report["inconsistency"])
    assert sharp.warnings == report["warnings"]


def test_the_parts_of_a_split_capture_are_the_frames_of_one(cli, tmp_path):
    capture = ["capture", "--camera", "virtual", "--frames", "300", "--seed", "3", "--no-calibration"]
    capture += ["--adc-latency", "6", "--out"]
    run(cli, *capture, tmp_path / "whole.mcap")
    run(cli, *capture, tmp_path / "rec.mcap", "--split", "1MB")
    whole = ns.Recording(tmp_path / "whole.mcap")
    files = sorted(tmp_path.glob("rec-*.mcap"))
    parts = [ns.Recording(file) for file in files]
    assert len(parts) > 1 and all(len(part) for part in parts)
    for field in ("y", "sequence", "device_time_us"):
        assert (np.concatenate([getattr(part, field) for part in parts]) == getattr(whole, field)).all(), (
            field
        )
    # A program that reads exported files gets the same frames of each part.
    exported = []
    for file in [tmp_path / "whole.mcap", *files]:
        run(cli, "recording", "export", file, "--to", "npz", "--out", file.with_suffix(".npz"))
        exported.append(np.load(file.with_suffix(".npz"))["frames"])
    assert (np.concatenate(exported[1:]) == exported[0]).all()


@pytest.mark.parametrize("model", ["diffusion", "wiener"])
def test_deblur(cli, tmp_path, model, random):
    x = random.random((3, 64, 64), np.float32)
    np.save(tmp_path / "x.npy", x)
    run(cli, "deblur", tmp_path / "x.npy", "--model", model, "--backend", "cpu", "--out", tmp_path / "y.npy")
    assert same(ns.deblur(x, model=model), np.load(tmp_path / "y.npy"))


def test_enhance(cli, tmp_path, random):
    # Strokes: the networks leave an image of noise as it is, whatever the options.
    x = np.zeros((2, 32, 32), np.float32)
    x[:, 6:26, 8:12] = x[:, 6:10, 8:24] = 1
    x = np.clip(x + random.normal(0, 0.02, x.shape), 0, 1).astype(np.float32)
    np.save(tmp_path / "x.npy", x)
    options = ["--backend", "cpu", "--steps", "2", "--seed", "3"]
    run(cli, "enhance", tmp_path / "x.npy", *options, "--out", tmp_path / "y.npy")
    assert same(ns.enhance(x, steps=2, seed=3), np.load(tmp_path / "y.npy"))


def test_metrics(cli, tmp_path, random):
    a, b = random.random((2, 3, 32, 32), np.float32)
    np.save(tmp_path / "a.npy", a)
    np.save(tmp_path / "b.npy", b * 3 - 1)
    report = json.loads(
        run(cli, "metrics", tmp_path / "a.npy", tmp_path / "b.npy", "--align", "gain-offset", "--json")
    )
    found = ns.metrics.compare(a, b * 3 - 1, align="gain-offset")
    assert [one["psnr_db"] for one in report["each"]] == found["psnr_db"].tolist()
    assert [one["ssim"] for one in report["each"]] == found["ssim"].tolist()
    assert report["data_range"] == found["data_range"]


def test_a_recording_as_a_sum_and_frame_by_frame(cli, tmp_path):
    path = tmp_path / "rec.mcap"
    with ns.Camera("virtual", sampling=0.5, sweeps=20) as camera:
        camera.record(path, frames=4)
    run(cli, "reconstruct", path, "--out", tmp_path / "sum")
    assert same(ns.reconstruct(ns.load(path)), np.load(tmp_path / "sum/image.npy"))
    run(cli, "reconstruct", path, "--index", "all", "--method", "hadamard", "--out", tmp_path / "all")
    frames = ns.load(path, index="all")
    assert same(ns.reconstruct(frames, method="hadamard"), np.load(tmp_path / "all/image.npy"))


def test_pictures_name_the_commit_that_the_program_names(cli, wing):
    line = next(line for line in run(cli, "--version").splitlines() if line.startswith("commit: "))
    commit = line.removeprefix("commit: ")
    said = "null" if commit.startswith("not known") else f'"{commit}"'
    assert f'"commit":{said}'.encode() in ns.reconstruct(ns.load(wing), method="hadamard").png()


def test_rain_and_spheres(cli):
    report = json.loads(run(cli, "physics", "rain", "--rate-mm-h", "5.6", "--drops", "mono:2", "--json"))
    assert report.pop("provenance")["origin"] == "simulated"
    found = ns.rain.extinction(5.6, wavelengths_nm=[550, 850, 1550], drops="mono:2")
    assert found == report
    sphere = json.loads(
        run(cli, "physics", "sphere", "--x", "100", "--m-re", "1.33", "--m-im", "1e-4", "--json")
    )
    assert sphere.pop("provenance")["origin"] == "simulated"
    assert ns.rain.mie(100, 1.33 + 1e-4j) == sphere


def test_a_camera_description(cli):
    assert ns.CameraModel("one-metre").report == json.loads(
        run(cli, "camera", "model", "one-metre", "--json")
    )


def test_measurements_of_other_groups(cli, data, tmp_path):
    # Random patterns need --matrix.
    files = [path for path in sorted(data.glob("*.npz")) if "random" not in path.name][:4]
    for k, path in enumerate(files):
        run(
            cli,
            "reconstruct",
            path,
            "--index",
            0,
            "--part",
            "real",
            "--sampling",
            "0.3",
            "--out",
            tmp_path / str(k),
        )
        image = ns.reconstruct(ns.load(path, index=0, part="real"), sampling=0.3)
        assert same(image, np.load(tmp_path / str(k) / "image.npy")), path


def test_errors_have_the_programs_text(cli, wing, tmp_path):
    gone = tmp_path / "gone.npz"
    told = subprocess.run([cli, "reconstruct", gone], capture_output=True, text=True, check=False).stderr
    with pytest.raises(FileNotFoundError) as error:
        ns.load(gone)
    assert str(error.value) in told
    np.savez(tmp_path / "wrong.npz", n=32, h_row=[0, 5000], d=[1.0, 2.0])
    told = subprocess.run(
        [cli, "reconstruct", tmp_path / "wrong.npz"], capture_output=True, text=True, check=False
    ).stderr
    with pytest.raises(ns.Error) as error:
        ns.load(tmp_path / "wrong.npz")
    assert str(error.value) in told
