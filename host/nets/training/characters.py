"""Builds train.npz and val.npz (64 x 64, 8 bit, by kind). ../weights/held_out.json names the groups that training never sees.

usage: characters.py CHARS74K_FOLDER FONTS_FOLDER NATURAL_FILE OUT_FOLDER

CHARS74K_FOLDER holds {fnt,hnd,img}_train.npz; NATURAL_FILE is bsds_train.npz;
FONTS_FOLDER a folder of .woff2, .ttf or .otf files for each family
(the shipped weights: 829 families of @fontsource from npm, under the OFL). Characters keep Chars74K's own form: bright on dark, centred,
48 pixels along their longer side. Everything is seeded.
"""
import glob
import io
import os
import sys

import numpy as np
import split
from fontTools.ttLib import TTFont
from PIL import Image, ImageDraw, ImageFilter, ImageFont
from scipy.ndimage import gaussian_filter

SEED = 20261120
CLASSES = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
rng = np.random.default_rng(SEED)


def centred(glyph, side, shift=(0, 0)):
    """A large 8-bit glyph in 64 x 64, its longer side `side` pixels; None where there is nothing to see."""
    box = glyph.point(lambda v: 255 if v > 60 else 0).getbbox()
    if not box:
        return None
    glyph = glyph.crop(box)
    scale = side / max(glyph.size)
    size = tuple(max(1, round(s * scale)) for s in glyph.size)
    glyph = glyph.resize(size, Image.BOX if scale < 0.5 else Image.LANCZOS)
    out = Image.new("L", (64, 64))
    out.paste(glyph, ((64 - size[0]) // 2 + int(shift[0]), (64 - size[1]) // 2 + int(shift[1])))
    return np.asarray(out)


def warped(character, strength):
    """Another hand's version: turned, sheared, stretched, thicker or thinner; worked out at four times the resolution, so that
    edges stay as sharp as they were."""
    big = Image.fromarray(character).resize((256, 256), Image.BICUBIC)
    turn = rng.normal(0, 5 * strength) * np.pi / 180
    shear = rng.normal(0, 0.12 * strength)
    across, along = np.exp(rng.normal(0, 0.12 * strength)), np.exp(rng.normal(0, 0.05))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix = rotation @ np.array([[1 / across, shear], [0, 1 / along]]) * 1.25
    offset = np.array([128, 128]) - matrix @ np.array([160, 160])
    coefficients = (*matrix[0], offset[0], *matrix[1], offset[1])
    big = big.transform((320, 320), Image.AFFINE, coefficients, Image.BICUBIC)
    if rng.random() < 0.5:
        big = big.filter(ImageFilter.GaussianBlur(rng.uniform(1, 4)))
    threshold = rng.uniform(0.25, 0.75) if rng.random() < 0.5 else 0.5
    big = big.point(lambda v: int(np.clip((v - 255 * threshold) * 4 + 128, 0, 255)))
    u = rng.random()
    side = 48 if u < 0.7 else rng.uniform(28, 58)
    return centred(big, side, (0, 0) if u < 0.8 else rng.integers(-4, 5, 2))


def variants(images, labels, count, strength):
    out, kept = [], []
    while len(out) < count:
        k = rng.integers(len(images))
        image = warped(images[k], strength)
        if image is not None:
            out.append(image)
            kept.append(labels[k])
    return np.stack(out), np.array(kept, np.uint8)


def rendered(folder):
    """Every class in every font of a folder."""
    images, labels = [], []
    for path in sorted(p for e in ("woff2", "ttf", "otf") for p in glob.glob(f"{folder}/**/*.{e}", recursive=True)):
        try:
            font = TTFont(path)
            font.flavor = None
            file = io.BytesIO()
            font.save(file)
            file.seek(0)
            face = ImageFont.truetype(file, 180)
        except Exception as error:
            print(f"left out: {path}: {error}")
            continue
        for label, character in enumerate(CLASSES):
            page = Image.new("L", (520, 520))
            try:
                ImageDraw.Draw(page).text((130, 130), character, 255, font=face)
            except OSError as error:
                print(f"left out from {character} on: {path}: {error}")
                break
            u = rng.random()
            shift = (0, 0) if u < 0.85 else rng.integers(-4, 5, 2)
            image = centred(page, 48 if u < 0.8 else rng.uniform(26, 58), shift)
            if image is not None:
                images.append(image)
                labels.append(label)
    return np.stack(images), np.array(labels, np.uint8)


def surface():
    """A wall, a sign, a shadow's edge: brightness, not clipped."""
    y, x = np.mgrid[0:64, 0:64] / 64
    kind = rng.integers(4)
    out = rng.uniform(0, 1) + rng.normal(0, 0.25) * x + rng.normal(0, 0.25) * y
    if kind == 1:
        out = out + rng.normal(0, 0.2) * (rng.normal() * x + rng.normal() * y > rng.normal(0, 0.5))
    if kind == 2:
        grain = rng.uniform(0.5, 4)
        out = out + gaussian_filter(rng.normal(0, 1, (64, 64)), grain) * 2 * grain * rng.uniform(0, 0.3)
    return out


def photograph(glyphs):
    """A character on a surface, a little out of focus, as on a sign in the street."""
    glyph = glyphs[rng.integers(len(glyphs))] / 255.0
    glyph = np.roll(glyph, tuple(rng.integers(-3, 4, 2)), (0, 1))
    back, front = surface(), surface() * 0.3 + rng.uniform(0, 1)
    if abs(front.mean() - back.mean()) < 0.12:
        front = front + np.sign(rng.normal()) * 0.3
    if rng.random() < 0.3:
        shadow = np.roll(glyph, tuple(rng.integers(-3, 4, 2)), (0, 1))
        back = back * (1 - shadow * rng.uniform(0.2, 1))
    image = gaussian_filter(back * (1 - glyph) + front * glyph, rng.uniform(0.3, 1.4))
    image = image + rng.normal(0, rng.uniform(0, 0.015), image.shape)
    if rng.random() < 0.5:
        image = (image - image.min()) / (np.ptp(image) + 1e-6)
    return (np.clip(image, 0, 1) * 255).astype("u1")


def page(glyphs):
    """Part of a page: lines of small characters, bright on dark or the other way round."""
    side = rng.uniform(7, 26)
    out = Image.new("L", (64, 64))
    y = rng.uniform(-side, 0)
    while y < 64:
        x = rng.uniform(-side, 0)
        while x < 64:
            if rng.random() > 0.12:
                glyph = Image.fromarray(glyphs[rng.integers(len(glyphs))][6:58, 6:58])
                out.paste(glyph.resize((round(side), round(side)), Image.BOX), (round(x), round(y)))
            x += side * rng.uniform(0.7, 0.95)
        y += side * rng.uniform(1.0, 1.6)
    image = np.asarray(out) / 255 * rng.uniform(0.3, 1)
    return ((1 - image if rng.random() < 0.6 else image) * 255).astype("u1")


def no_letter():
    """Leaves, polygons, surfaces, stars, gratings, dots, lines, clouds: what must come out without strokes of a letter."""
    side = 128
    kind = rng.integers(8)
    page = Image.new("L", (side, side), int(rng.integers(0, 256)) if kind < 3 else 0)
    draw = ImageDraw.Draw(page)
    y, x = np.mgrid[0:side, 0:side]
    if kind in (0, 1):
        for _ in range(rng.integers(1, 40)):
            centre, radius = rng.uniform(-10, side + 10, 2), min(60, 3 / rng.random() ** 0.7)
            if rng.random() < 0.5:
                draw.ellipse([*(centre - radius), *(centre + radius)], fill=int(rng.integers(0, 256)))
            else:
                corners = [tuple(centre + radius * rng.normal(0, 1, 2)) for _ in range(rng.integers(3, 7))]
                draw.polygon(corners, fill=int(rng.integers(0, 256)))
    elif kind == 2:
        page = Image.fromarray((np.clip(surface(), 0, 1) * 255).astype("u1")).resize((side, side))
    elif kind == 3:
        rays, centre = rng.integers(4, 24), rng.uniform(40, 88, 2)
        angle = np.arctan2(y - centre[0], x - centre[1])
        page = Image.fromarray(((np.sin(rays * angle + rng.uniform(0, 6)) > 0) * 255).astype("u1"))
    elif kind == 4:
        angle, period = rng.uniform(0, np.pi), rng.uniform(5, 60)
        wave = np.sin(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / period)
        page = Image.fromarray((255 * ((wave > 0) if rng.random() < 0.5 else (wave + 1) / 2)).astype("u1"))
    elif kind == 5:
        for _ in range(rng.integers(1, 60)):
            centre, radius = rng.uniform(0, side, 2), rng.uniform(0.7, 5)
            draw.ellipse([*(centre - radius), *(centre + radius)], fill=int(rng.integers(60, 256)))
    elif kind == 6:
        for _ in range(rng.integers(1, 12)):
            ends = [tuple(rng.uniform(0, side, 2)), tuple(rng.uniform(0, side, 2))]
            draw.line(ends, fill=int(rng.integers(60, 256)), width=int(rng.integers(1, 12)))
    else:
        cloud = gaussian_filter(rng.normal(0, 1, (side, side)), rng.uniform(1, 12))
        cloud = (cloud - cloud.min()) / np.ptp(cloud)
        page = Image.fromarray((cloud * 255 * rng.uniform(0.2, 1)).astype("u1"))
    return np.asarray(page.resize((64, 64), Image.BOX))


def natural(scenes, count):
    """Random parts of natural scenes, as sharp as those are or made smaller."""
    out = []
    for _ in range(count):
        scene = scenes[rng.integers(len(scenes))]
        side = 64 if rng.random() < 0.5 else int(rng.uniform(64, 160))
        row, column = (int(rng.integers(0, most - side + 1)) for most in scene.shape)
        part = Image.fromarray(scene[row : row + side, column : column + side])
        out.append(np.asarray(part if side == 64 else part.resize((64, 64), Image.BOX if rng.random() < 0.5 else Image.LANCZOS)))
    return np.stack(out)


def main(chars74k, fonts, natural_file, out):
    stacks = split.characters(chars74k)
    sources = {kind: file for kind, (file, _) in stacks.items()}
    held = {kind: mask for kind, (_, mask) in stacks.items()}
    os.makedirs(out, exist_ok=True)
    scenes = np.load(natural_file)["x"]
    hidden = split.natural(len(scenes))
    val = {kind: source["x"][held[kind]] for kind, source in sources.items()}
    val |= {f"{kind}_label": source["label"][held[kind]] for kind, source in sources.items()}
    # The middle of each held-out scene.
    np.savez(f"{out}/val.npz", **val, nat=scenes[hidden, 48:112, 88:152])
    images = {kind: source["x"][~held[kind]] for kind, source in sources.items()}
    labels = {kind: source["label"][~held[kind]] for kind, source in sources.items()}
    images["fnt_aug"], labels["fnt_aug"] = variants(images["fnt"], labels["fnt"], 14000, 0.6)
    images["hnd_aug"], labels["hnd_aug"] = variants(images["hnd"], labels["hnd"], 56000, 1.0)
    images["ren"], labels["ren"] = rendered(fonts)
    glyphs = np.concatenate([images[kind] for kind in ("ren", "fnt", "fnt_aug", "hnd")])
    images["comp"] = np.stack([photograph(glyphs) for _ in range(12000)])
    images["other"] = np.stack([no_letter() for _ in range(8000)] + [page(glyphs) for _ in range(6000)])
    images["nat"] = natural(scenes[~hidden], 24000)
    np.savez(f"{out}/train.npz", **images, **{f"{kind}_label": label for kind, label in labels.items()})
    print({kind: len(x) for kind, x in images.items()})


if __name__ == "__main__":
    main(*sys.argv[1:])
