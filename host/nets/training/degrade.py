"""Characters from train.npz, degraded as the camera does it (nirspi.train.optics)."""
import glob

import numpy as np
import torch
from nirspi.train.optics import Degrader


class Characters(Degrader):
    """A seeded stream of sharp images and of their degradations."""

    SHARE = dict(fnt=0.08, fnt_aug=0.08, ren=0.11, hnd=0.06, hnd_aug=0.13, img=0.24, comp=0.06, other=0.06, nat=0.18)
    PHOTOGRAPHS = ("img", "comp", "other", "nat")

    def __init__(self, seed, folder=".", device="cpu"):
        torch.manual_seed(seed)
        file = np.load(f"{folder}/train.npz")
        super().__init__(device)
        self.images = torch.from_numpy(np.concatenate([file[kind] for kind in self.SHARE])).to(device)
        counts = [len(file[kind]) for kind in self.SHARE]
        self.counts = torch.tensor(counts, device=device)
        self.first = self.counts.cumsum(0) - self.counts
        self.upto = torch.tensor(list(self.SHARE.values()), device=device).cumsum(0)
        self.photographs = torch.tensor([kind in self.PHOTOGRAPHS for kind in self.SHARE], device=device)
        labels = [file[f"{kind}_label"] if f"{kind}_label" in file else np.full(n, -1) for kind, n in zip(self.SHARE, counts)]
        self.labels = torch.from_numpy(np.concatenate(labels).astype(np.int64)).to(device)
        # Pairs made by the virtual camera (`nirspi dev pairs`), where there are some: pairs*.npz.
        files = [np.load(path) for path in sorted(glob.glob(f"{folder}/pairs*.npz"))]
        self.pairs = None
        if files:
            sharp, seen = (np.concatenate([file[key] for file in files]).astype(np.float32) for key in ("x", "y"))
            self.pairs = tuple(torch.from_numpy(a)[:, None].clamp(0, 1).to(device) for a in (sharp, seen))

    def picks(self, count):
        """Indices of images, each kind with its share."""
        kind = torch.bucketize(self.uniform(0, 0.99999, count), self.upto).clamp(max=len(self.counts) - 1)
        return kind, self.first[kind] + (self.uniform(0, 0.99999, count) * self.counts[kind]).long()

    def batch(self, count):
        """Sharp images (B, 1, 64, 64). Photographs and what is no letter are mirrored, turned, inverted, stretched and moved."""
        kind, at = self.picks(count)
        x = self.images[at].float() / 255

        def some(p, changed, of):
            return torch.where((self.chance(p, count) & of)[:, None, None], changed, x)

        free = self.photographs[kind]
        x = some(0.5, x.flip(2), free)
        x = some(0.5, x.flip(1), free)
        x = some(0.3, x.transpose(1, 2), free)
        x = some(0.4, 1 - x, free)
        gain, offset = self.uniform(0.5, 1.2, count, 1, 1), self.uniform(-0.15, 0.15, count, 1, 1)
        x = some(0.3, ((x - 0.5) * gain + 0.5 + offset).clamp(0, 1), free)
        x = some(0.3, self.turned(x), free)
        x = some(0.3, self.moved(x, 4), free)
        # A character keeps its dark edge, so it can go where there is room.
        edge = torch.stack([x[:, :6].amax((1, 2)), x[:, -6:].amax((1, 2)), x[..., :6].amax((1, 2)), x[..., -6:].amax((1, 2))]).amax(0)
        return some(0.12, self.moved(x, 5), ~free & (edge < 0.1))[:, None]


def held_out(optics, kind, sigma_px, noise, count=60, folder=".", seed=5):
    """Sharp images of groups that training never sees, and what the camera gives of them (32 x 32)."""
    device = optics.sample.device
    x = torch.from_numpy(np.load(f"{folder}/val.npz")[kind][: count * 3 : 3].astype(np.float32) / 255)[:, None].to(device)
    y = optics.sampled(optics.blurred(x[:, 0], torch.full((len(x),), sigma_px, device=device)))
    gauss = torch.from_numpy(np.random.default_rng(seed).standard_normal(y.shape).astype(np.float32)).to(device)
    return x, (y + noise * gauss).clamp(0, 1)[:, None]
