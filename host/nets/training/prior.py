"""The network of `--method prior`, what it is given, and the measurements that it learns from.

Everything is in normalised units: the mean row is left out, coefficients are orthonormal, and the zero-filled image has a
standard deviation of 1. Coefficients stand in the order of sequencies (p down, q across) here and in natural order in Rust.
host/nets/src/prior (Rust) does the same; host/nets/tests/pytorch/make.py makes the fixture that holds them together.
"""
import math

import numpy as np
import torch
import torch.nn as nn
import torch.nn.functional as F
from nirspi.train.networks import Block

ITERATIONS = 20
ACCURACY = 1e-4
SIGMAS_PER_MEDIAN = 1.4826
WITHIN = 2.0
CONDITIONS = 8
GRID_BITS = 3


def walsh_rows(n):
    """Natural row of each sequency."""
    bits = n.bit_length() - 1
    gray = [s ^ (s >> 1) for s in range(n)]
    return [int(f"{g:0{bits}b}"[::-1], 2) for g in gray]


def hadamard(n):
    h = torch.ones(1, 1)
    while len(h) < n:
        h = torch.cat((torch.cat((h, h), 1), torch.cat((h, -h), 1)), 0)
    return h


class Space:
    """What depends on the side alone: Walsh functions by sequency, cosines, frequencies, order along the zig-zag."""

    def __init__(self, n):
        self.n = n
        self.walsh = hadamard(n)[walsh_rows(n)] / math.sqrt(n)
        k = torch.arange(n, dtype=torch.float64)
        cosines = torch.cos(math.pi * (2 * k[None] + 1) * k[:, None] / (2 * n)) * math.sqrt(2 / n)
        cosines[0] /= math.sqrt(2)
        self.cosines = self.walsh @ cosines.T.float()  # Walsh functions of each cosine
        p, q = torch.meshgrid(torch.arange(n), torch.arange(n), indexing="ij")
        self.down, self.across = p, q
        self.frequency = torch.hypot(p.float(), q.float())
        diagonal = p + q
        self.along = torch.where(diagonal % 2 == 1, p, q)
        self.rank = (diagonal * n + self.along).flatten()
        self.fineness = diagonal.float() / (2 * n)
        bits = [((torch.arange(n // 2) >> b) & 1).float() * 2 - 1 for b in range(GRID_BITS)]
        self.grid = torch.stack([b[:, None].expand(n // 2, n // 2) for b in bits] + [b[None].expand(n // 2, n // 2) for b in bits])[None]

    def forward(self, x):
        return self.walsh @ x @ self.walsh.T

    def back(self, c):
        return self.walsh.T @ c @ self.walsh

    def tikhonov(self, y, mask, noise):
        """Prediction of every coefficient with amplitudes as one over frequency: recon's Tikhonov at strength 1, the mean row being measured."""
        t = self.cosines
        energies = (t * t).T @ mask @ (t * t)
        scale = 1 / self.frequency.clamp(min=1)
        expected = (energies * scale**2 * (self.frequency > 0)).sum((1, 2), keepdim=True)
        scale = scale * ((y**2).sum((1, 2), keepdim=True) / expected).sqrt()
        noise = noise[:, None, None] ** 2

        def operate(z):
            return scale * (t.T @ (mask * (t @ (scale * z) @ t.T)) @ t) + noise * z

        right = scale * (t.T @ y @ t)
        z, residual = torch.zeros_like(right), right.clone()
        direction, energy = residual.clone(), (residual**2).sum((1, 2), keepdim=True)
        enough = ACCURACY**2 * energy
        for _ in range(ITERATIONS):
            image = operate(direction)
            step = energy / (direction * image).sum((1, 2), keepdim=True).clamp(min=1e-30) * (energy > enough)
            z, residual = z + step * direction, residual - step * image
            before, energy = energy, (residual**2).sum((1, 2), keepdim=True)
            direction = residual + energy / before.clamp(min=1e-30) * direction
        return t @ (scale * z) @ t.T


SPACES = {}


def space_of(n):
    if n not in SPACES:
        SPACES[n] = Space(n)
    return SPACES[n]


class Seen:
    """Measurements (N, n, n) by sequency with a mask of what was measured, the mean row counting as measured and 0: normalised,
    with what the network is told."""

    def __init__(self, y, mask):
        self.n = n = y.shape[-1]
        self.space = space = space_of(n)
        y = y * mask
        y[:, 0, 0] = 0
        mask = mask.clone()
        mask[:, 0, 0] = 1
        self.unit = (y**2).sum((1, 2), keepdim=True).sqrt() / n
        self.y, self.mask = y / self.unit.clamp(min=1e-12), mask
        quarters, shares = [], []
        order = space.rank.argsort()[1:]
        values, kept = self.y.flatten(1)[:, order].abs(), mask.flatten(1)[:, order] > 0
        for v, k in zip(values, kept):
            v = v[k]
            ends = [len(v) * i // 4 for i in range(5)]
            quarters.append(torch.stack([v[a:b].sort().values[(b - a) // 2] for a, b in zip(ends, ends[1:])]))
            shares.append((len(v) + 1) / n**2)
        quarters, shares = torch.stack(quarters), torch.tensor(shares)
        self.noise = SIGMAS_PER_MEDIAN * quarters[:, 3]
        logs = (quarters.clamp(min=1e-4).log() + 1) / 2
        places = [(mask * axis).sum((1, 2)) / mask.sum((1, 2)) * 4 / n - 1 for axis in (space.down, space.across)]
        self.told = torch.cat((logs, torch.stack([shares.log(), torch.full_like(shares, math.log2(n / 64)), *places], 1)), 1)
        self.start = space.tikhonov(self.y, mask, self.noise.clamp(min=1e-4))
        # What is measured stays in the start.
        self.start = self.start + mask * (self.y - self.start)

    def images(self):
        """Zero-filled image and start, (N, 1, n, n)."""
        return self.space.back(self.y)[:, None], self.space.back(self.start)[:, None]


class Prior(nn.Module):
    """Stages of residual blocks on 2 x 2 pixels as 4 channels, each ending with a step towards the measurements. Features go on from
    stage to stage."""

    def __init__(self, width=48, stages=3, blocks=3, embedding=32):
        super().__init__()
        self.embed1 = nn.Linear(CONDITIONS, embedding)
        self.embed2 = nn.Linear(embedding, embedding)
        self.input_conv = nn.ModuleList([nn.Conv2d(8 + (2 * GRID_BITS if k == 0 else 0), width, 3, padding=1) for k in range(stages)])
        self.blocks = nn.ModuleList([nn.ModuleList([Block(width, embedding) for _ in range(blocks)]) for _ in range(stages)])
        self.output_conv = nn.ModuleList([nn.Conv2d(width, 4, 3, padding=1) for _ in range(stages)])
        self.weight = nn.ModuleList([nn.Linear(embedding, 2) for _ in range(stages)])
        for output, weight in zip(self.output_conv, self.weight):
            output.weight.data.mul_(0.1)
            nn.init.zeros_(weight.weight)
            weight.bias.data.copy_(torch.tensor([2.0, 0.0]))

    def forward(self, seen, every=False):
        space = seen.space
        zero, x = seen.images()
        told = F.silu(self.embed2(F.silu(self.embed1(seen.told))))
        grid = space.grid.expand(len(x), -1, -1, -1)
        h, out = None, []
        for k, (enter, blocks, leave, weight) in enumerate(zip(self.input_conv, self.blocks, self.output_conv, self.weight)):
            given = [F.pixel_unshuffle(x, 2), F.pixel_unshuffle(zero, 2)] + ([grid] if k == 0 else [])
            entered = enter(torch.cat(given, 1).contiguous(memory_format=torch.channels_last))
            h = entered if h is None else h + entered
            for block in blocks:
                h = block(h, told)
            c = space.forward((x + F.pixel_shuffle(leave(h), 2)).float()[:, 0])
            level, slope = weight(told).float()[:, :, None, None].unbind(1)
            c = c + seen.mask * torch.sigmoid(level + slope * space.fineness) * (seen.y - c)
            if k == len(self.blocks) - 1:
                within = (WITHIN * seen.noise)[:, None, None]
                c = c + seen.mask * ((c - seen.y).clamp(min=-within, max=within) + seen.y - c)
                c[:, 0, 0] = 0
            x = space.back(c)[:, None]
            out.append(x)
        return out if every else out[-1]


def shown(kind, n, count, rng):
    """A mask by sequency of the first `count` patterns of some order."""
    p, q = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    noise = rng.random((n, n))
    key = dict(
        zigzag=lambda: space_of(n).rank.numpy().reshape(n, n).astype(float),
        cake=lambda: (p + 1) * (q + 1) + noise,
        square=lambda: np.maximum(p, q) + noise * rng.choice([0.5, 1]),
        circle=lambda: np.hypot(p, q) + noise,
        raster=lambda: p * n + q + 0.0,
        columns=lambda: q * n + p + 0.0,
        dense=lambda: noise * (1 + np.hypot(p, q)) ** rng.uniform(0.5, 2),
        random=lambda: noise,
        sums=lambda: 2 * n * (p + q) - (4 - 2 * math.sqrt(2)) * p * q + noise,
    )[kind]()
    if rng.random() < 0.97:
        key[0, 0] = -1
    mask = np.zeros(n * n, np.float32)
    mask[np.argsort(key, axis=None, kind="stable")[:count]] = 1
    return mask.reshape(n, n)


KINDS = ["zigzag", "cake", "square", "circle", "raster", "columns", "dense", "random", "sums"]
CHANCES = [0.42, 0.12, 0.1, 0.08, 0.05, 0.05, 0.06, 0.07, 0.05]


def measured(x, rng):
    """Random measurements of scenes (N, n, n) in [0, 1]: any order, 4 to 100 % of the patterns, noise up to 6 % of white, in a third
    of them some patterns left out."""
    count, n = len(x), x.shape[-1]
    masks, noise = [], []
    for _ in range(count):
        share = math.exp(rng.uniform(math.log(0.05), 0)) if rng.random() < 0.8 else rng.uniform(0.08, 0.5)
        mask = shown(rng.choice(KINDS, p=CHANCES), n, max(16, round(share * n * n)), rng)
        if rng.random() < 0.35:
            held = rng.random((n, n)) < rng.choice([0.02, 0.1, 0.125, 0.15, 0.25])
            held[0, 0] = False
            if (mask * ~held).sum() >= 16:
                mask = mask * ~held
        masks.append(mask)
        noise.append(0.0 if rng.random() < 0.35 else math.exp(rng.uniform(math.log(0.002), math.log(0.06))))
    y = space_of(n).forward(x)
    y = y + torch.tensor(noise, dtype=torch.float32)[:, None, None] * torch.randn_like(y)
    return Seen(y, torch.from_numpy(np.stack(masks).astype(np.float32)))
