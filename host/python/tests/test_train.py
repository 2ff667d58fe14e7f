"""python -m nirspi.train: short runs of tiny networks on the processor."""

import io
import json
import os
import signal
import subprocess

import numpy as np
import pytest
from test_train_data import letters, pairs

import nirspi as ns
import nirspi.train
from conftest import ROOT
from nirspi.train import __main__ as command

torch = pytest.importorskip("torch", reason="skipped: no torch (pip install torch)")

from safetensors import safe_open  # noqa: E402

from nirspi.train import data, folder, networks  # noqa: E402
from nirspi.train.optics import conditions  # noqa: E402
from nirspi.train.run import Run, Settings  # noqa: E402
from nirspi.train.scenes import Scenes  # noqa: E402
from nirspi.train.tasks import DISCRIMINATOR_RATE, TASKS  # noqa: E402

DEBLURRERS = [name for name, task in TASKS.items() if task.enlarges]
WIDTHS = {"fsrcnn": (8, 4), "estimator": (4, 6, 8, 8), "classifier": (6, 8, 12)} | dict.fromkeys(
    DEBLURRERS, (8, 8)
)


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def tiny(network, **changed):
    small = {
        "steps": 60,
        "batch": 4,
        "average": 0.9,
        "log_every": 10,
        "judge_every": 20,
        "judged": 4,
        "rate": 4e-3,
    }
    return Settings(network=network, width=WIDTHS[network], **small | changed)


class Memory:
    """Keeps a run in memory, each state through its bytes."""

    def __init__(self, stop_at=None):
        self.state, self.best, self.stop_at, self.run = None, None, stop_at, None

    def keep(self, run, better):
        file = io.BytesIO()
        torch.save(run.state(), file)
        file.seek(0)
        self.state = torch.load(file, weights_only=True)
        if better:
            self.best = {name: tensor.clone() for name, tensor in run.mean.state_dict().items()}

    def train(self, settings, scenes=None, state=None):
        torch.manual_seed(99)
        enlarge = networks.FSRCNN(8, 4).requires_grad_(False)
        self.run = Run(settings, scenes or Scenes([], []), enlarge)
        if state:
            self.run.resume(state)
        return self.run.run(self.keep, stopped=lambda: self.run.step == self.stop_at)


def told(run):
    return [(entry["step"], entry["loss"], entry["held_out"]) for entry in run.log]


@pytest.mark.parametrize("network", [name for name in TASKS if name != "classifier"])
def test_every_network_learns_in_a_short_run(network):
    kept = Memory()
    steps = 160 if network == "ancestral" else 60
    assert kept.train(tiny(network, steps=steps)) == "complete"
    losses = [entry["loss"] for entry in kept.run.log]
    assert losses[-1] < 0.9 * losses[0], losses
    judged = {entry["step"]: entry["held_out"] for entry in kept.run.log if entry["held_out"] is not None}
    assert list(judged) == list(range(20, steps + 1, 20))


@pytest.mark.parametrize("network", ["diffusion", "regression", "gan"])
def test_a_network_that_knows_the_scene_has_next_to_no_loss_and_the_best_score(network):
    torch.manual_seed(5)
    scenes, seen = Scenes([], []), []
    task = TASKS[network](scenes, (8, 8), networks.FSRCNN(8, 4))
    task.parts(1e-3)
    starts = scenes.starts

    def remembered(*args, **options):
        seen[:] = starts(*args, **options)
        return seen

    scenes.starts = remembered
    task.net = lambda current, raw, told: seen[0] - seen[1]
    # The GAN's generator is judged too: 0.1 of at most 1.
    assert task.losses(8)["net"] < (0.3 if network == "gan" else 2e-3)
    assert task.score(task.net, 8) == pytest.approx(110)
    task.net = lambda current, raw, told: seen[1] - seen[0]
    assert task.losses(8)["net"] > 0.03 and task.score(task.net, 8) < 50


def squares(tmp_path):
    """Ten pages with a small square or a large one: two classes that are easy to tell apart."""
    x = np.zeros((10, 64, 64), np.uint8)
    for i in range(10):
        half = (4 if i % 2 == 0 else 20) + i // 2
        x[i, 32 - half : 32 + half, 32 - half : 32 + half] = 255
    return letters(tmp_path / "squares.npz", x=x, label=np.arange(10) % 2, group=np.arange(10) // 2)


def test_a_classifier_learns_classes_and_refuses_scenes_without(tmp_path):
    stacks = data.read([squares(tmp_path)])
    kept = Memory()
    settings = tiny("classifier", steps=240, judge_every=40, rate=1e-2)
    kept.train(settings, Scenes(stacks, data.split(stacks, 0.2, 1)))
    assert kept.run.best == 100.0, told(kept.run)
    with pytest.raises(ns.Error, match="images without labels"):
        Memory().train(tiny("classifier"))


def test_the_classifier_learns_from_characters_and_not_from_the_cameras_pictures(tmp_path, monkeypatch):
    stacks = data.read([letters(tmp_path / "a.npz")])
    read = data.pairs([pairs(tmp_path / "p.npz", [-1] * 3, [-1] * 3)], [], [])
    masks, known = data.split(stacks, 0.2, 1), {image.tobytes() for image in read["x"]}
    scenes = Scenes(stacks, masks, read, shapes=0.9, camera_share=1.0)
    # The others do learn from the camera's pictures.
    assert all(image.numpy().tobytes() in known for image in scenes.readings(4).x[:, 0])
    monkeypatch.delattr(Scenes, "readings")
    task = TASKS["classifier"](scenes, (4, 4, 4))
    assert 3 < float(task.losses(32)["net"].detach()) < 6


def gan(widths=(8, 8)):
    torch.manual_seed(5)
    task = TASKS["gan"](Scenes([], []), widths, networks.FSRCNN(8, 4).requires_grad_(False))
    task.parts(1e-3)
    return task


def test_the_gans_losses_are_the_error_and_least_squares_of_what_the_judge_says():
    task, seen = gan(), []

    def judge(degraded, image):
        seen.append(float(degraded.mean()))
        return 2 * image[:, :, ::8, ::8]

    task.judge = judge
    x, y = torch.full((2, 1, 64, 64), 0.25), torch.full((2, 1, 64, 64), 0.5)
    out = torch.full_like(x, 0.75, requires_grad=True)
    losses = task.learned(x, y, out)
    # It says 0.5 of the scene, which should be 1, and 1.5 of the generator's image, which should be 0.
    assert float(losses["judge"]) == pytest.approx(0.5**2 + 1.5**2)
    # The image is off by 0.5, and the judge should say 1 of it.
    assert float(losses["net"].detach()) == pytest.approx(10 * 0.5 + 0.1 * 0.5**2)
    assert set(seen) == {0.5}
    # The judge's own loss moves the judge alone.
    assert not losses["judge"].requires_grad and losses["net"].requires_grad


def test_the_gans_judge_learns_to_tell_scenes_from_what_the_generator_makes():
    task = gan()
    optimizer = torch.optim.AdamW(task.judge.parameters(), DISCRIMINATOR_RATE)
    told = []
    for _ in range(60):
        loss = task.losses(8)["judge"]
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        told.append(float(loss.detach()))
    # One that says the same of all images has 0.5 at best.
    assert np.mean(told[:5]) > 0.5 > np.mean(told[-10:]) + 0.1, told


@pytest.mark.parametrize("network", ["diffusion", "gan"])
def test_a_run_that_was_stopped_goes_on_to_the_very_same_weights(network):
    settings = tiny(network, steps=24, judge_every=10, log_every=4)
    whole, first, rest = Memory(), Memory(stop_at=13), Memory()
    whole.train(settings)
    assert first.train(settings) == "stopped" and first.run.step == 13
    assert rest.train(settings, state=first.state) == "complete"
    assert told(rest.run) == told(whole.run)
    for a, b in zip(whole.run.mean.parameters(), rest.run.mean.parameters(), strict=True):
        assert torch.equal(a, b)


def test_the_same_seed_gives_the_same_weights_and_another_seed_others():
    def weights(seed):
        kept = Memory()
        kept.train(tiny("fsrcnn", steps=12, judge_every=12, seed=seed))
        return torch.cat([tensor.flatten() for tensor in kept.best.values()])

    first = weights(1)
    assert torch.equal(first, weights(1)) and not torch.equal(first, weights(2))


def test_a_loss_that_is_no_number_ends_the_run_and_the_last_checkpoint_is_good(monkeypatch):
    kept, settings = Memory(), tiny("fsrcnn", judge_every=5)
    losses = TASKS["fsrcnn"].losses

    def breaking(task, count):
        found = losses(task, count)
        return {"net": found["net"] * float("nan")} if kept.run.step == 12 else found

    monkeypatch.setattr(TASKS["fsrcnn"], "losses", breaking)
    with pytest.raises(ns.Error, match="the loss is nan at step 13: .*resume it with a lower rate"):
        kept.train(settings)
    monkeypatch.undo()
    assert kept.state["step"] == 10
    again = Memory()
    assert again.train(settings, state=kept.state) == "complete"
    assert all(np.isfinite(entry["loss"]) for entry in again.run.log)


def test_training_ends_when_held_out_examples_get_no_better():
    kept = Memory()
    assert (
        kept.train(tiny("estimator", rate=1e-12, average=0.0, judge_every=2, patience=3))
        == "no longer better"
    )
    assert kept.run.step == 8


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"batch": 0}, "batch is 0, expected at least 1"),
        ({"rate": float("nan")}, "rate is nan, expected more than 0 and less than 1"),
        ({"held_out": 1.0}, "held_out is 1, expected more than 0 and less than 1"),
        ({"camera_share": 1.5}, "camera_share is 1.5, expected 0 to 1"),
        ({"width": (1, 2, 3)}, r"width is \[1, 2, 3\], expected 2 numbers"),
    ],
)
def test_settings_that_cannot_be_are_named(wrong, line):
    with pytest.raises(ns.Error, match=line):
        Memory().train(Settings(**vars(tiny("fsrcnn")) | wrong))


def run(tmp_path, *more, network="fsrcnn", width="4,2"):
    small = ["--width", width, "--batch", "2", "--judge-every", "4", "--judged", "4", "--device", "cpu"]
    return command.main([network, "--out", str(tmp_path / "run"), *small, *map(str, more)])


def steps(tmp_path):
    lines = (tmp_path / "run/log.jsonl").read_text().splitlines()
    return [json.loads(line)["step"] for line in lines]


def test_a_run_is_kept_in_its_folder_and_gone_on_with_and_not_overwritten(tmp_path, capsys):
    assert run(tmp_path, "--steps", 8, "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["step"], report["ended"]) == (8, "complete")
    assert sorted(os.listdir(tmp_path / "run")) == [
        "checkpoint.pt",
        "data.json",
        "log.jsonl",
        "weights.safetensors",
    ]
    assert steps(tmp_path) == [4, 8]
    assert run(tmp_path, "--steps", 8) == 1
    assert "a run is kept there, expected to resume it" in capsys.readouterr().err
    assert run(tmp_path, "--steps", 12, "--resume") == 0
    assert steps(tmp_path) == [4, 8, 12]
    assert run(tmp_path, "--steps", 12, "--resume", "--seed", 2) == 1
    assert (
        "checkpoint: another seed, expected the same settings but steps and rate" in capsys.readouterr().err
    )


def test_a_program_trains_as_the_command_does(tmp_path):
    assert run(tmp_path, "--steps", 8, "--seed", 4) == 0
    heard = []
    settings = {"steps": 8, "seed": 4, "width": (4, 2), "batch": 2, "judge_every": 4, "judged": 4}
    report = nirspi.train.train("fsrcnn", tmp_path / "own", device="cpu", told=heard.append, **settings)
    assert (report["step"], report["ended"], [entry["step"] for entry in heard]) == (8, "complete", [4, 8])
    weights = [folder.tensors(tmp_path / name / "weights.safetensors") for name in ("run", "own")]
    assert all(torch.equal(tensor, weights[1][name]) for name, tensor in weights[0].items())
    with pytest.raises(ns.Error, match="network is pix2pix, expected one of fsrcnn, "):
        nirspi.train.train("pix2pix", tmp_path / "none")
    assert tuple(TASKS) == nirspi.train.NETWORKS


def test_a_checkpoint_with_a_wrong_bit_is_refused(tmp_path, capsys):
    assert run(tmp_path, "--steps", 4) == 0
    path = tmp_path / "run/checkpoint.pt"
    good = path.read_bytes()
    for bad in (good[:-1], good[:100] + bytes([good[100] ^ 1]) + good[101:], b""):
        path.write_bytes(bad)
        assert run(tmp_path, "--steps", 8, "--resume") == 1
        assert "damaged or cut short" in capsys.readouterr().err
    kept = folder.Folder(tmp_path / "run")
    for at in range(0, len(good), 997):
        for bad in (good[:at], good[:at] + bytes([good[at] ^ 16]) + good[at + 1 :]):
            path.write_bytes(bad)
            with pytest.raises(ns.Error, match="damaged or cut short"):
                kept.load("cpu")
    path.write_bytes(good)
    assert run(tmp_path, "--steps", 8, "--resume") == 0


def test_a_file_that_cannot_be_written_is_the_one_before(tmp_path, monkeypatch):
    path = tmp_path / "weights.safetensors"
    folder.whole(path, b"before")
    for call in ("fsync", "replace"):
        with monkeypatch.context() as full:

            def refuse(*_):
                raise OSError(28, "No space left on device")

            full.setattr(os, call, refuse)
            with pytest.raises(ns.Error, match="weights.safetensors: cannot write it: No space left"):
                folder.whole(path, b"after")
        assert path.read_bytes() == b"before"
    folder.whole(path, b"after")
    assert path.read_bytes() == b"after"


@pytest.mark.parametrize("network", ["estimator", "ancestral"])
def test_kept_weights_say_what_they_are_and_how_they_were_made(network, tmp_path):
    shipped = ROOT / "host/nets/weights/fsrcnn.safetensors"
    width = ",".join(map(str, WIDTHS[network]))
    assert run(tmp_path, "--steps", 4, "--fsrcnn", shipped, network=network, width=width) == 0
    with safe_open(tmp_path / "run/weights.safetensors", "pt") as file:
        about = file.metadata()
    recipe = f"nirspi.train {network}: 4 of 4 steps of 2, rate "
    assert about["model"] == network and about["recipe"].startswith(recipe)
    path = {"steps": "500", "beta_start": "0.0002", "beta_end": "0.025"}
    assert {key: about.get(key) for key in path} == (path if network == "ancestral" else dict.fromkeys(path))


def test_data_and_pairs_are_trained_on_and_told_and_other_data_are_another_run(tmp_path, capsys):
    a = letters(tmp_path / "a.npz")
    made = pairs(tmp_path / "pairs.npz", [0] * 12, np.arange(12) % 6)
    assert run(tmp_path, "--data", a, "--pairs", made, "--camera-share", 1, "--steps", 4) == 0
    (stack,) = json.loads((tmp_path / "run/data.json").read_text())["stacks"]
    assert stack["name"] == "a" and stack["held_out_images"] == 4 and len(stack["held_out"]) == 1
    other = letters(tmp_path / "b.npz", seed=9)
    assert run(tmp_path, "--data", other, "--camera-share", 1, "--steps", 8, "--resume") == 1
    assert "checkpoint: another data" in capsys.readouterr().err
    others = pairs(tmp_path / "others.npz", [0] * 11, np.arange(11) % 6)
    assert run(tmp_path, "--data", a, "--pairs", others, "--camera-share", 1, "--steps", 8, "--resume") == 1
    assert "checkpoint: another data" in capsys.readouterr().err


def test_another_fsrcnn_is_another_run(tmp_path, capsys):
    at = ROOT / "host/nets"
    more = {"network": "regression", "width": "4"}
    assert run(tmp_path, "--steps", 2, "--fsrcnn", at / "weights/fsrcnn.safetensors", **more) == 0
    other = at / "tests/pytorch/fsrcnn.safetensors"
    assert run(tmp_path, "--steps", 4, "--fsrcnn", other, "--resume", **more) == 1
    assert "checkpoint: another data" in capsys.readouterr().err


def test_examples_come_from_the_pairs_in_their_share(tmp_path):
    read = data.pairs([pairs(tmp_path / "p.npz", [-1] * 3, [-1] * 3)], [], [])
    known = {image.tobytes() for image in read["y"]}

    def virtual(share, held=False):
        batch = Scenes([], [], read, camera_share=share).readings(40, held)
        return sum(image.numpy().tobytes() in known for image in batch.y[:, 0])

    assert (virtual(0.0), virtual(1.0), virtual(1.0, held=True)) == (0, 40, 0)


def test_training_draws_from_no_held_out_image_the_other_way_round_and_from_each_stack_alike(tmp_path):
    stacks = data.read([letters(tmp_path / "a.npz"), letters(tmp_path / "b.npz", groups=40, seed=4)])
    masks = data.split(stacks, 0.2, 1)
    scenes = Scenes(stacks, masks)
    torch.manual_seed(5)
    for held in (False, True):
        stack, at = scenes.indices(4000, held)
        for i, mask in enumerate(masks):
            assert set(at[stack == i].tolist()) == set(np.flatnonzero(mask == held).tolist())
            assert 1800 < (stack == i).sum() < 2200
    x, _ = scenes.draw(50, held=True)
    shown = {
        image.tobytes() for stack, mask in zip(stacks, masks, strict=True) for image in stack.images[mask]
    }
    assert all((image * 255).round().to(torch.uint8).numpy().tobytes() in shown for image in x[:, 0])


def test_the_rate_rises_then_falls():
    run = Run(tiny("fsrcnn", steps=1000), Scenes([], []))
    rates = []
    for step in (0, 99, 199, 500, 999):
        run.step = step
        rates.append(run.rate())
    assert rates[0] == pytest.approx(0.005, rel=1e-3) and rates[1] == pytest.approx(0.5, rel=0.05)
    assert max(rates) == rates[2] > rates[3] == pytest.approx(0.5) and rates[4] < 1e-4


def test_a_zone_of_a_pair_without_depth_is_zero_and_marked(tmp_path):
    read = data.pairs([pairs(tmp_path / "p.npz", [-1], [-1])], [], [])
    read["depth_m"][0] = 1.5
    read["depth_m"][0, 2, 3], read["depth_m"][0, 7, 7] = 0, 4.5
    metres, valid = Scenes([], [], read, camera_share=1.0).readings(1).depth[0]
    lost = torch.zeros(32, 32, dtype=torch.bool)
    lost[8:12, 12:16] = True
    assert torch.equal(valid == 0, lost) and torch.equal(metres == 0, lost)
    # The network is given at most 3 m.
    assert set(metres[28:, 28:].flatten().tolist()) == {1.0}
    lost_or_far = lost.clone()
    lost_or_far[28:, 28:] = True
    assert set(metres[~lost_or_far].tolist()) == {0.5} and set(valid[~lost].tolist()) == {1.0}


def test_raw_is_the_reading_four_times_or_the_image_itself():
    scenes, drawn = Scenes([], []), []
    degrade = scenes.degrade

    def remembered(x, sampled):
        drawn.append(degrade(x, sampled)[0])
        return drawn[-1], *degrade(x, sampled)[1:]

    scenes.degrade = remembered
    torch.manual_seed(5)
    x, start, raw, sigma, noise = scenes.starts(8, networks.FSRCNN(8, 4))
    readings, images = drawn
    assert len(readings) == 6 and torch.equal(raw[:6, :, 1::2, ::2], readings)
    assert torch.equal(raw[6:], images) and torch.equal(start[6:], images)
    assert [len(part) for part in (x, start, raw, sigma, noise)] == [8] * 5


def test_what_cannot_be_trained_is_named_and_leaves_nothing(tmp_path, capsys):
    def refused(*more, **other):
        assert run(tmp_path, *more, **other) == 1
        (line,) = capsys.readouterr().err.splitlines()
        return line

    assert "no checkpoint to resume" in refused("--resume")
    assert "none.npz: cannot read it" in refused("--data", "none.npz")
    assert "rate is 7, expected more than 0 and less than 1" in refused("--rate", 7)
    assert "images without labels" in refused(network="classifier", width="4,4,4")
    assert "diffusion needs the weights of an fsrcnn" in refused(network="diffusion")
    assert "no weights, expected a file of safetensors" in refused("--fsrcnn", __file__, network="diffusion")
    assert "device abacus: " in refused("--device", "abacus")
    assert not (tmp_path / "run").exists()
    with pytest.raises(SystemExit):
        command.main(["fsrcnn"])
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_that_ends_a_run_keeps_it_and_it_goes_on(name, tmp_path, monkeypatch):
    number = getattr(signal, name)
    # A test run under nohup ignores SIGHUP, and what is ignored stays so.
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.SIG_DFL)
    once, before = Run.once, signal.getsignal(number)

    def interrupted(self):
        if self.step == 5:
            os.kill(os.getpid(), number)
        return once(self)

    monkeypatch.setattr(Run, "once", interrupted)
    # Ctrl-C is the user's wish; the others are not.
    assert run(tmp_path, "--steps", 12) == (0 if number == signal.SIGINT else 1)
    state = folder.Folder(tmp_path / "run").load("cpu")
    assert 6 <= state["step"] < 12
    assert signal.getsignal(number) is before
    monkeypatch.undo()
    assert run(tmp_path, "--steps", 12, "--resume") == 0
    assert steps(tmp_path) == [4, 8, 12]


def test_a_signal_that_is_ignored_stays_ignored(tmp_path, monkeypatch):
    once = Run.once

    def interrupted(self):
        os.kill(os.getpid(), signal.SIGTERM)
        return once(self)

    monkeypatch.setattr(Run, "once", interrupted)
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        assert run(tmp_path, "--steps", 4) == 0
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)
    assert steps(tmp_path) == [4]


def test_pairs_and_characters_that_the_program_makes_are_trained_on(tmp_path, cli):
    letters(tmp_path / "own.npz", groups=10)
    options = ["--held-out", "0.1", "--count", "6", "--characters", "letters", "--out", "pairs.npz"]
    command_line = [cli, "dev", "pairs", "--data", "own.npz", *options]
    subprocess.run(command_line, cwd=tmp_path, check=True, capture_output=True)
    (written,), (given,) = data.read([tmp_path / "letters"]), data.read([tmp_path / "own.npz"])
    assert (written.images == given.images).all() and (written.groups == given.groups).all()
    assert (written.labels == given.labels).all()
    made = tmp_path / "pairs.npz"
    with np.load(made) as file:
        assert file["x"].shape == (6, 64, 64) and file["y"].shape == (6, 32, 32)
    trained = ["--data", tmp_path / "letters", "--pairs", made, "--camera-share", 1, "--steps", 4]
    assert run(tmp_path, *trained) == 0


def test_the_program_computes_with_the_weights_of_a_run_what_pytorch_does(tmp_path, cli):
    first = tmp_path / "first"
    assert run(first, "--steps", 4) == 0
    told = ["--fsrcnn", first / "run/weights.safetensors", "--rate", 0.01]
    assert run(tmp_path, "--steps", 8, *told, network="regression", width="8,12") == 0
    weights = tmp_path / "run/weights.safetensors"
    net = networks.UNet((8, 12))
    net.load_state_dict(folder.tensors(weights))
    image = np.zeros((64, 64), np.float32)
    image[12:50, 20:30] = 0.6
    image[30:44, 24:58] = 0.9
    np.save(tmp_path / "in.npy", image)
    options = [
        "--blur-px",
        "2",
        "--noise",
        "0.03",
        "--no-consistency",
        "--backend",
        "cpu",
        "--weights",
        weights,
    ]
    command_line = [cli, "deblur", "in.npy", "--model", "regression", *options, "--out", "out.npy"]
    subprocess.run(command_line, cwd=tmp_path, check=True, capture_output=True)
    x = torch.from_numpy(image)[None, None]
    with torch.no_grad():
        told = conditions(torch.ones(1), torch.tensor([2.0]), torch.tensor([0.03]))
        expected = (x + net(x, x, told)).clamp(0, 1)[0, 0].numpy()
    found = np.load(tmp_path / "out.npy").reshape(64, 64)
    assert np.abs(expected - image).max() > 0.01
    assert np.abs(found - expected).max() < 1e-4
