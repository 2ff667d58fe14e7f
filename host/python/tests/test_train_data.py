"""What a training reads, what it never sees, and what it refuses: without PyTorch."""

import numpy as np
import pytest

import nirspi as ns
from nirspi.train import __main__ as command
from nirspi.train import data


def letters(path, groups=6, each=4, seed=3, **changed):
    """A file of characters: `each` images of `groups` groups."""
    random, count = np.random.default_rng(seed), groups * each
    x = np.zeros((count, 64, 64), np.uint8)
    x[:, 20:44, 20:44] = random.integers(0, 256, (count, 24, 24))
    arrays = {"x": x, "group": np.repeat(np.arange(groups), each), "label": np.arange(count) % 62} | changed
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


def pairs(path, stack, group):
    """Pairs as `nirspi dev pairs` writes them, of these stacks and groups."""
    count, random = len(stack), np.random.default_rng(5)
    image = {
        name: random.random((count, n, n), np.float32)
        for name, n in (("x", 64), ("optical", 64), ("y", 32), ("depth_m", 8))
    }
    number = {name: random.random(count, np.float32) for name in ("sigma_px", "noise_std")}
    np.savez(path, **image, **number, stack=np.array(stack), group=np.array(group))
    return path


def test_no_image_of_training_is_one_that_is_held_out_not_even_in_another_stack(tmp_path):
    one = data.read([letters(tmp_path / "one.npz")])[0]
    # The other stack has images of the first one in its groups 0 and 5.
    other = data.read([letters(tmp_path / "other.npz", seed=4)])[0]
    other.images[[0, 20]] = one.images[[5, 9]]
    for seed in range(20):
        masks = data.split([one, other], 0.2, seed)
        seen, held = (
            {
                image.tobytes()
                for stack, mask in zip([one, other], masks, strict=True)
                for image in stack.images[mask == side]
            }
            for side in (False, True)
        )
        assert not seen & held
        assert all(0 < mask.sum() < len(mask) for mask in masks)
        for stack, mask in zip([one, other], masks, strict=True):
            assert not set(stack.groups[mask]) & set(stack.groups[~mask])


def test_a_blank_image_connects_nothing(tmp_path):
    blank = data.read([letters(tmp_path / "a.npz")])[0]
    # The first image of each group shows nothing; two groups share a character.
    blank.images[::4] = 0
    blank.images[9] = blank.images[13]
    of = data.families([blank])
    assert len(set(of.values())) == 5 and of[(0, 2)] == of[(0, 3)]


def test_the_split_follows_from_the_seed_and_the_stack(tmp_path):
    stacks = data.read([letters(tmp_path / "a.npz", groups=40)])
    first = data.split(stacks, 0.1, 1)[0]
    assert len(set(stacks[0].groups[first])) == 4
    assert (data.split(stacks, 0.1, 1)[0] == first).all()
    assert (data.split(stacks, 0.1, 2)[0] != first).any()


def test_pairs_of_held_out_groups_are_left_out(tmp_path):
    stacks = data.read([letters(tmp_path / "a.npz")])
    masks = data.split(stacks, 0.2, 1)
    held = int(stacks[0].groups[masks[0]][0])
    other = (held + 1) % 6
    read = data.pairs([pairs(tmp_path / "p.npz", [0, 0, -1], [held, other, -1])], stacks, masks)
    with np.load(tmp_path / "p.npz") as file:
        assert (read["x"] == file["x"][1:]).all() and (read["y"] == file["y"][1:]).all()
    with pytest.raises(
        ns.Error, match="stack 1, group 0 is not in the data, expected pairs of the same --data"
    ):
        data.pairs([pairs(tmp_path / "q.npz", [1], [0])], stacks, masks)
    with pytest.raises(ns.Error, match="no pair is left"):
        data.pairs([pairs(tmp_path / "r.npz", [0], [held])], stacks, masks)


def test_values_of_0_to_1_and_of_0_to_255_are_the_same_characters(tmp_path):
    bytes_of = data.read([letters(tmp_path / "a.npz")])[0]
    with np.load(tmp_path / "a.npz") as file:
        np.savez(tmp_path / "b.npz", x=file["x"] / 255.0, font=np.array([f"font{g}" for g in file["group"]]))
    named = data.read([tmp_path / "b.npz"])[0]
    assert (named.images == bytes_of.images).all() and (named.groups == bytes_of.groups).all()
    assert named.labels is None and not named.photographs
    folder = data.read([tmp_path])
    assert [stack.name for stack in folder] == ["a", "b"]


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"x": None}, "no array x, expected (N, 64, 64)"),
        ({"x": np.zeros((24, 32, 32))}, "x has shape (24, 32, 32), expected (N, 64, 64)"),
        ({"x": np.full((24, 64, 64), np.nan)}, "x holds values outside 0 to 255"),
        ({"x": np.full((24, 64, 64), "a")}, "expected numbers"),
        ({"group": None}, "expected one of them: who drew each image"),
        ({"group": np.zeros(3, int)}, "the group has shape (3,), expected (24,)"),
        ({"label": np.full(24, 62)}, "label 62 to 62, expected 0 to 61"),
        ({"label": np.full(24, 0.5)}, "expected whole numbers"),
    ],
)
def test_a_bad_file_is_refused_in_a_line_that_names_it(tmp_path, changed, told):
    path = letters(tmp_path / "bad.npz", **changed)
    with pytest.raises(ns.Error) as refused:
        data.read([path])
    assert (
        str(refused.value).startswith(f"{path}: ")
        and told in str(refused.value)
        and "\n" not in str(refused.value)
    )


def test_files_that_cannot_be_read_are_named(tmp_path):
    (tmp_path / "text.npz").write_text("no archive")
    (tmp_path / "empty").mkdir()
    for name, told in (
        ("none.npz", "cannot read it"),
        ("text.npz", "expected a file of np.savez"),
        ("empty", "no .npz file"),
    ):
        with pytest.raises(ns.Error, match=f"{name}: .*{told}"):
            data.read([tmp_path / name])
    one = data.read([letters(tmp_path / "one.npz", groups=1)])
    with pytest.raises(ns.Error, match="one: all images are of one group"):
        data.split(one, 0.1, 1)


def test_without_torch_the_command_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    assert command.main(["fsrcnn", "--out", str(tmp_path / "run")]) == 1
    assert (
        capsys.readouterr().err
        == "error: training needs PyTorch and safetensors: pip install torch safetensors\n"
    )
    assert not (tmp_path / "run").exists()
