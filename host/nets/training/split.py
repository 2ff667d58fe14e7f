"""What training never sees: ../weights/held_out.json, read and checked against the images.

usage: split.py CHARS74K_FOLDER

Groups are font families, writers and single photographs. Two font families of different names may share glyphs byte for byte, so
families that share an image are one family: no image of a held-out group is an image of training. Run alone, this file checks that.
"""
import json
import sys
from pathlib import Path

import numpy as np

HELD_OUT = json.loads((Path(__file__).parent / "../weights/held_out.json").read_text())
GROUPS = dict(fnt="family", hnd="writer", img=None)


def families(images, groups):
    """The family of each group, named by its smallest group: groups that share an image which is not blank are one family."""
    parent = {int(group): int(group) for group in np.unique(groups)}

    def root(group):
        while parent[group] != group:
            group = parent[group]
        return group

    first = {}
    for image, group in zip(images, groups):
        if image.min() == image.max():
            continue
        a, b = sorted((root(int(group)), root(first.setdefault(image.tobytes(), int(group)))))
        parent[b] = a
    return {group: root(group) for group in parent}


def characters(folder):
    """Chars74K's stacks and which of their images are held out: {kind: (file, mask)}. Refuses a list that takes a family apart."""
    stacks = {}
    for kind, name in GROUPS.items():
        file = np.load(f"{folder}/{kind}_train.npz")
        groups = file[name] if name else np.arange(len(file["x"]))
        listed = {int(group) for group in HELD_OUT[f"{kind}_train"]}
        of = families(file["x"], groups)
        seen = {family for group, family in of.items() if group not in listed}
        apart = sorted(group for group in listed if of[group] in seen)
        if apart:
            raise ValueError(f"{kind}_train: groups {apart} of held_out.json share images with groups of training, expected whole families")
        stacks[kind] = (file, np.isin(groups, sorted(listed)))
    images = {held: {image.tobytes() for file, mask in stacks.values() for image in file["x"][mask == held]} for held in (False, True)}
    twins = len(images[False] & images[True])
    if twins:
        raise ValueError(f"{twins} held-out images are byte for byte images of training in another stack")
    return stacks


def natural(count, name="natural"):
    """Which of `count` natural scenes are held out from the networks, or from the prior alone (`natural_of_prior`)."""
    return np.isin(np.arange(count), HELD_OUT[name])


if __name__ == "__main__":
    for kind, (file, held) in characters(sys.argv[1]).items():
        print(f"{kind}: {held.sum()} of {len(held)} images are held out, none of them in training")
