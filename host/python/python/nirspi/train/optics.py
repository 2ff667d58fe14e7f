"""The camera as formulas: images are (B, 1, 64, 64) in [0, 1], sigma is in pixels of the 64 grid.

Everything is drawn on the device, without a branch that waits for it, so that a whole step of training can be
one CUDA graph.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import torch
import torch.nn.functional as F

STEP_PX = 0.02
TOP_PX = 13.0
# Pixels beyond each edge that a point of light reaches at most.
REACH_PX = 32


@functools.cache
def blur_matrices(side=64):
    """For sigma = 0, 0.02, ...: the matrix that blurs a line of pixels, edges reflected; both sides of an
    image are blurred by it."""
    out = []
    for k in range(int(TOP_PX / STEP_PX) + 1):
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


def rank(cost, changes):
    """Place of each pattern in the order of a cost, ties by the first factor's sequency."""
    return torch.argsort(torch.argsort((cost * 100 + changes[:, None]).flatten())).view(32, 32)


class Optics:
    """Blur, the camera's grid and its patterns, on a device."""

    def __init__(self, device):
        h = hadamard(32)
        changes = (h[:, 1:] != h[:, :-1]).sum(1)
        self.blur = blur_matrices().to(device)
        self.sample = torch.kron(torch.eye(32), torch.full((1, 2), 0.5)).to(device)
        self.hadamard = h.to(device)
        costs = (changes[:, None] + changes[None], (changes[:, None] + 1) * (changes[None] + 1))
        self.orders = torch.stack([rank(cost, changes) for cost in costs]).to(device)

    def blurred(self, x, sigma_px):
        """(B, 64, 64) blurred by (B) sigmas."""
        matrix = self.blur[(sigma_px / STEP_PX).round().clamp(0, len(self.blur) - 1).long()]
        return matrix @ x @ matrix.transpose(1, 2)

    def spread(self, x, kernels):
        """(B, 64, 64), edges reflected, each with its own kernel (B, 2 REACH_PX, 2 REACH_PX), whose middle is
        at REACH_PX."""
        grid = torch.arange(-REACH_PX, 64 + REACH_PX, device=x.device)
        grid = torch.where(grid < 0, -1 - grid, torch.where(grid > 63, 127 - grid, grid))
        wide = x[:, grid][:, :, grid]
        size = wide.shape[-1]
        out = torch.fft.irfft2(
            torch.fft.rfft2(wide) * torch.fft.rfft2(kernels, s=(size, size)), s=(size, size)
        )
        # The kernel's middle lies at REACH_PX, so the image has moved by as much.
        return out[:, 2 * REACH_PX :, 2 * REACH_PX :]

    def sampled(self, optical):
        """(B, 64, 64) to the camera's (B, 32, 32): means of 2 x 2."""
        return self.sample @ optical @ self.sample.T

    def partly(self, y, order, count):
        """What (B) counts of the patterns say of (B, 32, 32), in the zig-zag (0) or cake-cutting (1) order;
        the others taken as 0."""
        shown = self.orders[order] < count[:, None, None]
        h = self.hadamard
        return h @ ((h @ y @ h) * shown) @ h / 1024


def disc(radius_px, grid):
    """Kernels of a lens out of focus, (B, n, n)."""
    across, down = grid[None, None, :], grid[None, :, None]
    weights = (radius_px[:, None, None] + 0.5 - (across.square() + down.square()).sqrt()).clamp(0, 1)
    return weights / weights.sum((1, 2), keepdim=True)


def streak(length_px, angle, grid):
    """Kernels of a scene that moves along a line, (B, n, n)."""
    across, down = grid[None, None, :], grid[None, :, None]
    c, s = angle.cos()[:, None, None], angle.sin()[:, None, None]
    weights = (1 - (across * s - down * c).abs()).clamp(0, 1)
    weights = weights * (length_px[:, None, None] / 2 + 0.5 - (across * c + down * s).abs()).clamp(0, 1)
    return weights / weights.sum((1, 2), keepdim=True)


class Degrader:
    """Draws degradations of sharp images, from the device's own random numbers."""

    def __init__(self, device="cpu"):
        self.device, self.optics = device, Optics(device)

    def uniform(self, low, high, *shape):
        return torch.rand(shape, device=self.device) * (high - low) + low

    def chance(self, p, count):
        return torch.rand(count, device=self.device) < p

    def moved(self, x, most):
        """Moved by up to `most` pixels, the edge repeated."""
        grid = torch.arange(64, device=self.device)
        shifts = torch.randint(-most, most + 1, (2, len(x), 1), device=self.device)
        rows, columns = ((grid + shift).clamp(0, 63) for shift in shifts)
        return x.gather(1, rows[:, :, None].expand_as(x)).gather(2, columns[:, None, :].expand_as(x))

    def turned(self, x):
        """Turned by some 5 degrees and brought 10 % nearer or farther."""
        count = len(x)
        turn = torch.randn(count, device=self.device) * math.radians(5)
        zoom = torch.exp(torch.randn(count, device=self.device) * 0.1)
        zero = torch.zeros_like(turn)
        theta = torch.stack(
            (turn.cos() * zoom, -turn.sin() * zoom, zero, turn.sin() * zoom, turn.cos() * zoom, zero), 1
        ).view(count, 2, 3)
        grid = F.affine_grid(theta, (count, 1, 64, 64), align_corners=False)
        return F.grid_sample(
            x[:, None], grid, mode="bicubic", padding_mode="reflection", align_corners=False
        )[:, 0].clamp(0, 1)

    def levels(self, count):
        """Blur (pixels) and noise (rms) of each image: blur 0 to 4.2, noise none to 25 %, more than 10 % in
        one of 16."""
        wide = torch.where(
            self.chance(0.4, count), self.uniform(0.3, 2.2, count), self.uniform(0.3, 4.2, count)
        )
        sigma = torch.where(self.chance(0.12, count), self.uniform(0, 0.4, count), wide)
        u = torch.rand(count, device=self.device)
        much = torch.where(u < 0.80, self.uniform(0, 0.06, count), self.uniform(0.05, 0.10, count))
        much = torch.where(u > 0.94, self.uniform(0.10, 0.25, count), much)
        return sigma, torch.where(u < 0.12, 0, much)

    def blurred(self, x, sigma):
        """A Gaussian for six of ten; a lens out of focus or a motion of as much variance for the others."""
        count = len(x)
        grid = torch.arange(-REACH_PX, REACH_PX, device=self.device, dtype=torch.float32)
        # Variance of a disc: a fourth of its radius squared in each direction; of a line: a twelfth of its
        # length squared in one.
        moved = streak(24**0.5 * sigma, self.uniform(0, math.pi, count), grid)
        kernels = torch.where(
            (self.chance(0.3, count) & (sigma < 2.8))[:, None, None], moved, disc(2 * sigma, grid)
        )
        shaped = self.optics.blurred(self.optics.spread(x, kernels), self.uniform(0, 0.5, count))
        return torch.where(
            (self.chance(0.4, count) & (sigma > 0.3))[:, None, None], shaped, self.optics.blurred(x, sigma)
        )

    def degrade(self, x, sampled):
        """(what is measured, the optical image before sampling, sigma, noise). `sampled`: on the camera's 32
        x 32 grid, some with
        part of the patterns only; else on the 64 x 64 grid."""
        count = len(x)
        sigma, noise = self.levels(count)
        optical = self.blurred(x[:, 0], sigma)
        # Rain, fog and the projector's edge: a second, wider blur takes some of the light.
        share = torch.where(self.chance(0.2, count), self.uniform(0.02, 0.25, count), 0)[:, None, None]
        wider = torch.where(self.chance(0.6, count), self.uniform(1, 2.5, count), self.uniform(2.5, 8, count))
        optical = (1 - share) * optical + share * self.optics.blurred(x[:, 0], sigma + wider)
        y = self.optics.sampled(optical) if sampled else optical
        y = y + torch.randn_like(y) * noise[:, None, None]
        if sampled:
            order = self.chance(0.5, count).long()
            partly = self.optics.partly(y, order, 1024 * self.uniform(0.3, 1, count))
            y = torch.where(self.chance(0.12, count)[:, None, None], partly, y)
        return y[:, None].clamp(0, 1), optical[:, None], sigma, noise

    def depth(self, x):
        """Depth / 3 m and validity, (B, 2, 32, 32): 8, 16 or 32 zones a side; the target before something
        farther or nothing;
        none at all for two in five."""
        count = len(x)
        pick, out = self.uniform(0, 1, count, 1, 1), torch.zeros(count, 2, 32, 32, device=self.device)
        near, beyond = self.uniform(0.25, 1.3, count, 1, 1), self.uniform(0.1, 1.5, count, 1, 1)
        beyond = beyond * self.chance(0.5, count)[:, None, None]
        lost, only = self.uniform(0, 0.2, count, 1, 1), self.chance(0.2, count)[:, None, None]
        for n, low, high in ((8, 0, 0.5), (16, 0.5, 0.75), (32, 0.75, 1.01)):
            target = F.avg_pool2d(x, 64 // n)[:, 0] > 0.3
            depth_m = near + beyond * ~target + torch.randn(count, n, n, device=self.device) * 0.01
            valid = (torch.rand(count, n, n, device=self.device) >= lost) & (target | ~only)
            maps = torch.stack(((depth_m / 3).clamp(0, 1) * valid, valid.float()), 1)
            maps = maps.repeat_interleave(32 // n, 2).repeat_interleave(32 // n, 3)
            out = torch.where(((pick >= low) & (pick < high))[:, None], maps, out)
        return out * self.chance(0.6, count)[:, None, None, None]


def conditions(t, sigma_px, noise):
    """What the UNet is told, (B, 6)."""
    s = (sigma_px / 4).clamp(0, 1.5)
    n = (noise * 10).clamp(0, 1.5)
    return torch.stack((t, t * t, s, s * s, n, n * n), 1)


def psnr(image, x):
    """Mean over images, dB; at most 110, so that no image counts without limit."""
    error = (image.clamp(0, 1) - x).square().mean((1, 2, 3))
    return float((-10 * torch.log10(error.clamp(min=1e-11))).mean())
