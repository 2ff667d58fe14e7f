"""Characters to train on, the groups that training never sees, and pairs from the virtual camera.

Invariant: no image of a held-out group is drawn in training, nor one that equals it byte for byte in another
group or stack
(test_train_data.py).
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._nirspi import Error

SIDE_PX = 64
CLASSES = 62
GROUPS = ("group", "family", "writer", "font")
PAIRS = ("x", "optical", "y", "depth_m", "sigma_px", "noise_std", "stack", "group")


@dataclass
class Stack:
    """Images of one file: (N, 64, 64) of 8 bit, a group for each, a class for each or none at all."""

    name: str
    images: np.ndarray
    groups: np.ndarray
    labels: np.ndarray | None

    @property
    def photographs(self):
        """Whether the rims are bright, as those of photographs are and those of characters are not."""
        rim = np.concatenate([self.images[:, [0, -1]], self.images[:, :, [0, -1]].swapaxes(1, 2)], 1)
        return float(rim.mean()) > 12.0


def _arrays(path):
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as error:
        raise Error(f"{path}: cannot read it: {error.strerror or error}") from None
    except Exception as error:
        raise Error(f"{path}: {str(error) or type(error).__name__}, expected a file of np.savez") from None


def _stack(path):
    arrays = _arrays(path)
    images = arrays.get("x")
    if images is None or images.ndim != 3 or images.shape[1:] != (SIDE_PX, SIDE_PX) or len(images) == 0:
        found = "no array x" if images is None else f"x has shape {images.shape}"
        raise Error(f"{path}: {found}, expected (N, {SIDE_PX}, {SIDE_PX})")
    if images.dtype.kind not in "uif":
        raise Error(f"{path}: x holds {images.dtype}, expected numbers")
    values = images.astype(np.float64)
    if not np.isfinite(values).all() or values.min() < 0 or values.max() > 255:
        raise Error(f"{path}: x holds values outside 0 to 255, expected 0 to 255 or 0 to 1")
    scale = 255 if values.max() <= 1 and images.dtype.kind == "f" else 1
    group = next((arrays[name] for name in GROUPS if name in arrays), None)
    if group is None:
        raise Error(f"{path}: no array {', '.join(GROUPS)}, expected one of them: who drew each image")
    for name, array in (("label", arrays.get("label")), ("the group", group)):
        if array is not None and array.shape != (len(images),):
            raise Error(f"{path}: {name} has shape {array.shape}, expected ({len(images)},): one an image")
    label = arrays.get("label")
    if label is not None and label.dtype.kind not in "iu":
        raise Error(f"{path}: label holds {label.dtype}, expected whole numbers of 0 to 61 (0-9, A-Z, a-z)")
    if label is not None and (label.min() < 0 or label.max() >= CLASSES):
        raise Error(f"{path}: label {label.min()} to {label.max()}, expected 0 to 61 (0-9, A-Z, a-z)")
    labels = None if label is None else label.astype(np.int64)
    # Groups may be names.
    groups = (
        np.unique(group, return_inverse=True)[1] if group.dtype.kind not in "iu" else group.astype(np.int64)
    )
    return Stack(Path(path).stem, np.rint(values * scale).astype(np.uint8), groups, labels)


def read(paths):
    """The stacks of these files, and of the `.npz` files of these folders."""
    stacks = []
    for path in map(Path, paths):
        files = sorted(path.glob("*.npz")) if path.is_dir() else [path]
        if not files:
            raise Error(f"{path}: no .npz file in the folder, expected at least one")
        stacks += [_stack(file) for file in files]
    return stacks


def families(stacks):
    """The family of each (stack, group): groups that share an image which is not blank are one family."""
    parent = {
        (i, int(group)): (i, int(group))
        for i, stack in enumerate(stacks)
        for group in np.unique(stack.groups)
    }

    def root(group):
        while parent[group] != group:
            group = parent[group]
        return group

    first = {}
    for i, stack in enumerate(stacks):
        for image, number in zip(stack.images, stack.groups, strict=True):
            if image.min() < image.max():
                group = (i, int(number))
                a, b = sorted((root(group), root(first.setdefault(image.tobytes(), group))))
                parent[b] = a
    return {group: root(group) for group in parent}


def split(stacks, share, seed):
    """Whether each image is held out, a mask a stack: of the families of each stack the share, at least one.

    Which ones follows from the seed, the stack's name and its groups. A family is held out in all stacks or
    in none.
    """
    of, held = families(stacks), set()
    for i, stack in enumerate(stacks):
        own = sorted({of[(i, int(group))] for group in np.unique(stack.groups)})
        if len(own) < 2:
            raise Error(
                f"{stack.name}: all images are of one group, or of groups that share images; "
                "expected two or more"
            )
        random = np.random.default_rng([seed, zlib.crc32(stack.name.encode())])
        chosen = random.permutation(len(own))[: max(1, round(share * len(own)))]
        held |= {own[k] for k in chosen}
    masks = [
        np.array([of[(i, int(group))] in held for group in stack.groups]) for i, stack in enumerate(stacks)
    ]
    for stack, mask in zip(stacks, masks, strict=True):
        if mask.all():
            raise Error(
                f"{stack.name}: every group is held out, expected one to train on: a smaller --held-out"
            )
    return masks


def pairs(paths, stacks, masks):
    """Scenes and the virtual camera's pictures of them, made by ``nirspi dev pairs``.

    Those of held-out groups are left out: `stack` and `group` of a file are those of the same data in the
    same order.
    """
    parts = []
    for path in paths:
        arrays = _arrays(path)
        missing = [name for name in PAIRS if name not in arrays]
        if missing:
            raise Error(f"{path}: no array {', '.join(missing)}, expected pairs of nirspi dev pairs")
        held = {(i, int(g)) for i, mask in enumerate(masks) for g in np.unique(stacks[i].groups[mask])}
        known = {(i, int(g)) for i, stack in enumerate(stacks) for g in np.unique(stack.groups)} | {(-1, -1)}
        places = list(zip(arrays["stack"].tolist(), arrays["group"].tolist(), strict=True))
        strange = next((place for place in places if place not in known), None)
        if strange is not None:
            told = f"{path}: stack {strange[0]}, group {strange[1]} is not in the data"
            raise Error(f"{told}, expected pairs of the same --data in the same order")
        keep = np.array([place not in held for place in places], bool)
        parts.append({name: arrays[name][keep].astype(np.float32) for name in PAIRS[:6]})
    whole = {name: np.concatenate([part[name] for part in parts]) for name in PAIRS[:6]}
    if len(whole["x"]) == 0:
        raise Error("no pair is left beside the held-out groups, expected at least one")
    return whole


def digest(stacks, pairs_of):
    """A SHA-256 of everything that a run learns from."""
    sha = hashlib.sha256()
    for stack in stacks:
        sha.update(stack.name.encode())
        for array in (stack.images, stack.groups, stack.labels):
            sha.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
    for name, array in sorted((pairs_of or {}).items()):
        sha.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()
