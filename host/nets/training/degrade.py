"""Characters from train.npz, degraded as the camera does it; images are (B, 1, 64, 64) in [0, 1], sigma is in pixels of the 64 grid."""
import glob

import numpy as np
import torch

STEP_PX = 0.02


def blur_matrices(side=64, top_px=4.6):
    """For sigma = 0, 0.02, ...: the matrix that blurs a line of pixels, edges reflected; both sides of an image are blurred by it."""
    out = []
    for k in range(int(top_px / STEP_PX) + 1):
        sigma = k * STEP_PX
        reach = int(4 * sigma + 0.5)
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2) if reach else np.ones(1)
        weights /= weights.sum()
        reach = len(weights) // 2
        matrix = np.zeros((side, side))
        for i in range(side):
            for j in range(-reach, reach + 1):
                at = (i + j) % (2 * side)
                matrix[i, at if at < side else 2 * side - 1 - at] += weights[j + reach]
        out.append(matrix)
    return torch.tensor(np.stack(out), dtype=torch.float32)


def hadamard(n):
    matrix = torch.ones(1, 1)
    while len(matrix) < n:
        matrix = torch.cat((torch.cat((matrix, matrix), 1), torch.cat((matrix, -matrix), 1)))
    return matrix


BLUR = blur_matrices()
SAMPLE = torch.kron(torch.eye(32), torch.full((1, 2), 0.5))
H = hadamard(32)
CHANGES = (H[:, 1:] != H[:, :-1]).sum(1)


def rank(cost):
    """Place of each pattern in the order of a cost, ties by the first factor's sequency."""
    return torch.argsort(torch.argsort((cost * 100 + CHANGES[:, None]).flatten())).view(32, 32)


ORDERS = [rank(CHANGES[:, None] + CHANGES[None]), rank((CHANGES[:, None] + 1) * (CHANGES[None] + 1))]


def blurred(x, sigma_px):
    """(B, 64, 64) blurred by (B) sigmas."""
    matrix = BLUR[np.minimum(np.round(sigma_px / STEP_PX), len(BLUR) - 1).astype(int)]
    return matrix @ x @ matrix.transpose(1, 2)


class Characters:
    """A seeded stream of sharp images and of their degradations."""

    SHARE = dict(fnt=0.10, fnt_aug=0.08, ren=0.13, hnd=0.07, hnd_aug=0.16, img=0.30, comp=0.08, other=0.08)

    def __init__(self, seed, folder="."):
        file = np.load(f"{folder}/train.npz")
        self.images = {kind: file[kind] for kind in self.SHARE}
        self.rng = np.random.default_rng(seed)
        self.kinds = list(self.SHARE)
        self.share = np.array(list(self.SHARE.values()))
        self.folder = folder
        self.pairs = None
        self.load_pairs()

    def load_pairs(self):
        """Pairs made by the virtual camera (`nirspi train degrade`), where there are some: pairs*.npz."""
        files = [np.load(path) for path in sorted(glob.glob(f"{self.folder}/pairs*.npz"))]
        if files:
            self.pairs = tuple(np.concatenate([file[key] for file in files]) for key in ("x", "y"))

    def one(self):
        r = self.rng
        kind = self.kinds[r.choice(len(self.kinds), p=self.share)]
        x = self.images[kind][r.integers(len(self.images[kind]))].astype(np.float32) / 255
        if kind in ("img", "comp", "other"):
            if r.random() < 0.5:
                x = x[:, ::-1]
            if r.random() < 0.5:
                x = x[::-1]
            if r.random() < 0.3:
                x = x.T
            if r.random() < 0.4:
                x = 1 - x
            if r.random() < 0.3:
                x = np.clip((x - 0.5) * r.uniform(0.5, 1.2) + 0.5 + r.uniform(-0.15, 0.15), 0, 1)
            if r.random() < 0.3:
                dy, dx = r.integers(-4, 5, 2)
                x = np.pad(x, 4, "edge")[4 + dy : 68 + dy, 4 + dx : 68 + dx]
        elif r.random() < 0.12:
            dy, dx = r.integers(-5, 6, 2)
            if max(x[:6].max(), x[-6:].max(), x[:, :6].max(), x[:, -6:].max()) < 0.1:
                x = np.roll(x, (dy, dx), (0, 1))
        return np.ascontiguousarray(x)

    def batch(self, count):
        return torch.from_numpy(np.stack([self.one() for _ in range(count)]))[:, None]

    def levels(self, count):
        """Blur (pixels) and noise (rms) of each image: blur 0 to 4.2, noise none to 10 %."""
        r = self.rng
        some = np.where(r.random(count) < 0.3, r.uniform(0.3, 2.0, count), r.uniform(0.3, 4.2, count))
        sigma = np.where(r.random(count) < 0.1, r.uniform(0, 0.4, count), some)
        u = r.random(count)
        much = np.where(u < 0.85, r.uniform(0, 0.06, count), r.uniform(0.05, 0.10, count))
        return sigma.astype(np.float32), np.where(u < 0.12, 0, much).astype(np.float32)

    def degrade(self, x, sampled):
        """(what is measured, the optical image before sampling, sigma, noise). `sampled`: on the camera's 32 x 32 grid, some with
        part of the patterns only; else on the 64 x 64 grid."""
        r, count = self.rng, len(x)
        sigma, noise = self.levels(count)
        optical = blurred(x[:, 0], sigma)
        scattered = r.random(count) < 0.15
        if scattered.any():
            # Rain and the projector's edge: a second, wider blur takes some of the light.
            share = np.where(scattered, r.uniform(0.02, 0.25, count), 0).astype(np.float32)
            share = torch.from_numpy(share)[:, None, None]
            optical = (1 - share) * optical + share * blurred(x[:, 0], sigma + r.uniform(1, 2.5, count))
        y = SAMPLE @ optical @ SAMPLE.T if sampled else optical
        gauss = torch.from_numpy(r.standard_normal(y.shape).astype(np.float32))
        y = y + gauss * torch.from_numpy(noise)[:, None, None]
        if sampled:
            for i in np.nonzero(r.random(count) < 0.12)[0]:
                order = ORDERS[0 if r.random() < 0.5 else 1]
                shown = order < int(1024 * r.uniform(0.3, 1))
                y[i] = H @ ((H @ y[i] @ H) * shown) @ H / 1024
        return y[:, None].clamp(0, 1), optical[:, None], torch.from_numpy(sigma), torch.from_numpy(noise)

    def depth(self, x):
        """Depth / 3 m and validity, (B, 2, 32, 32): 8, 16 or 32 zones a side; the target before something farther or nothing."""
        r, out = self.rng, np.zeros((len(x), 2, 32, 32), np.float32)
        for i in range(len(x)):
            if r.random() < 0.4:
                continue
            n = int(r.choice([8, 8, 16, 32]))
            depth_m = np.full((n, n), r.uniform(0.25, 1.3))
            target = x[i, 0].reshape(n, 64 // n, n, 64 // n).mean((1, 3)).numpy() > 0.3
            if r.random() < 0.5:
                depth_m = np.where(target, depth_m, depth_m + r.uniform(0.1, 1.5))
            depth_m = depth_m + r.normal(0, 0.01, depth_m.shape)
            valid = r.random((n, n)) > r.uniform(0, 0.2)
            if r.random() < 0.2:
                valid &= target
            zone = np.ones((32 // n, 32 // n))
            out[i, 0] = np.kron(np.clip(depth_m / 3, 0, 1) * valid, zone)
            out[i, 1] = np.kron(valid, zone)
        return torch.from_numpy(out)


def conditions(t, sigma_px, noise):
    """What the UNet is told, (B, 6)."""
    s = (sigma_px / 4).clamp(0, 1.5)
    n = (noise * 10).clamp(0, 1.5)
    return torch.stack((t, t * t, s, s * s, n, n * n), 1)


def held_out(kind, sigma_px, noise, count=60, folder=".", seed=5):
    """Sharp images of groups that training never sees, and what the camera gives of them (32 x 32)."""
    x = torch.from_numpy(np.load(f"{folder}/val.npz")[kind][: count * 3 : 3].astype(np.float32) / 255)[:, None]
    y = SAMPLE @ blurred(x[:, 0], np.full(len(x), sigma_px)) @ SAMPLE.T
    gauss = torch.from_numpy(np.random.default_rng(seed).standard_normal(y.shape).astype(np.float32))
    return x, (y + noise * gauss).clamp(0, 1)[:, None]


def psnr(image, x):
    """Mean over images, dB."""
    return float((-10 * torch.log10((image.clamp(0, 1) - x).square().mean((1, 2, 3)))).mean())
