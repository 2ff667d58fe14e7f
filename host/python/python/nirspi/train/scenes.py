"""Examples: scenes drawn from the data, and what the camera makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
import torch.nn.functional as F

from .optics import Degrader

# Share of an example's degradations that are the camera's own 32 x 32 readings; the others are 64 x 64 from
# the start.
READINGS = 0.75


@dataclass
class Batch:
    """Sharp scenes `x`, what the optics make of them, readings `y` (32 x 32), depth and validity, blur and
    noise."""

    x: torch.Tensor
    optical: torch.Tensor
    y: torch.Tensor
    depth: torch.Tensor
    sigma_px: torch.Tensor
    noise: torch.Tensor


class Scenes(Degrader):
    """Draws scenes: from the groups that training may see, or from those that are held out. Without stacks
    all are shapes."""

    def __init__(self, stacks, masks, pairs=None, *, shapes=0.15, camera_share=0.2, device="cpu"):
        super().__init__(device)
        self.shapes_share = shapes if stacks else 1.0
        self.camera_share = camera_share if pairs else 0.0
        self.stacks = [torch.from_numpy(stack.images).to(device) for stack in stacks]
        self.labels = [
            None if stack.labels is None else torch.from_numpy(stack.labels).to(device) for stack in stacks
        ]
        self.photographs = [stack.photographs for stack in stacks]
        self.places = {
            held: [torch.from_numpy((mask == held).nonzero()[0]).to(device) for mask in masks]
            for held in (False, True)
        }
        self.pairs = {name: torch.from_numpy(array).to(device) for name, array in (pairs or {}).items()}

    def indices(self, count, held):
        """Stack and image of each of so many scenes; each stack is drawn alike."""
        stack = torch.randint(len(self.stacks), (count,), device=self.device)
        at = torch.zeros_like(stack)
        for i, places in enumerate(self.places[held]):
            at = torch.where(stack == i, places[torch.randint(len(places), (count,), device=self.device)], at)
        return stack, at

    def characters(self, count, held):
        """Images (B, 64, 64) and their classes (-1 without); those of training are moved, turned and
        stretched."""
        stack, at = self.indices(count, held)
        x = torch.zeros(count, 64, 64, device=self.device)
        labels = torch.full((count,), -1, device=self.device)
        photograph = torch.zeros(count, dtype=torch.bool, device=self.device)
        for i, images in enumerate(self.stacks):
            own = stack == i
            x[own] = images[at[own]].float() / 255
            photograph |= own & self.photographs[i]
            if self.labels[i] is not None:
                labels[own] = self.labels[i][at[own]]
        if held:
            return x, labels
        x = self.moved(torch.where(self.chance(0.6, count)[:, None, None], self.turned(x), x), 4)
        negative = photograph & self.chance(0.5, count)
        x = torch.where(negative[:, None, None], 1 - x, x)
        # A fifth of the characters stand on a surface that is lit unevenly.
        lit = ~photograph & self.chance(0.2, count)
        surface = self.gradient(count) * self.uniform(0.1, 0.6, count, 1, 1)
        return torch.where(lit[:, None, None], torch.maximum(x, surface), x), labels

    def gradient(self, count):
        """Planes from 0 to 1, (B, 64, 64)."""
        angle, grid = (
            self.uniform(0, 2 * math.pi, count, 1, 1),
            torch.linspace(-0.5, 0.5, 64, device=self.device),
        )
        return (0.5 + (angle.cos() * grid[None, None] + angle.sin() * grid[None, :, None]) / 1.5).clamp(0, 1)

    def shapes(self, count):
        """Scenes without letters, (B, 64, 64): bars, discs, gradients, points, noise, nothing."""
        grid = torch.arange(64, device=self.device, dtype=torch.float32) - 31.5
        x = torch.zeros(count, 64, 64, device=self.device)
        for _ in range(3):
            angle, level = self.uniform(0, math.pi, count, 1, 1), self.uniform(0.2, 1, count, 1, 1)
            across, down = (
                grid[None, None] - self.uniform(-20, 20, count, 1, 1),
                grid[None, :, None] - self.uniform(-20, 20, count, 1, 1),
            )
            u, v = across * angle.cos() + down * angle.sin(), down * angle.cos() - across * angle.sin()
            wide, long = self.uniform(1, 14, count, 1, 1), self.uniform(1, 24, count, 1, 1)
            bar = torch.minimum(wide - u.abs(), long - v.abs()).add(0.5).clamp(0, 1)
            blob = (1 - ((u / wide) ** 2 + (v / long) ** 2).sqrt()).mul(wide).add(0.5).clamp(0, 1)
            x = torch.maximum(x, level * torch.where(self.chance(0.5, count)[:, None, None], bar, blob))
        points = (torch.rand(count, 64, 64, device=self.device) < 0.01).float()
        kind = torch.rand(count, 1, 1, device=self.device)
        for upto, other in (
            (0.3, self.gradient(count)),
            (0.2, points),
            (0.1, torch.rand_like(x)),
            (0.05, torch.zeros_like(x)),
        ):
            x = torch.where(kind < upto, other, x)
        return x

    def draw(self, count, held=False, letters_only=False):
        """Sharp scenes (B, 1, 64, 64) and their classes, -1 for those without."""
        if not self.stacks:
            return self.shapes(count)[:, None], torch.full((count,), -1, device=self.device)
        x, labels = self.characters(count, held)
        if held or letters_only:
            return x[:, None], labels
        shape = self.chance(self.shapes_share, count)
        x = torch.where(shape[:, None, None], self.shapes(count), x)
        return x[:, None], torch.where(shape, -1, labels)

    def readings(self, count, held=False):
        """Examples on the camera's grid; in training a share of them by the virtual camera, where there are
        pairs."""
        x, _ = self.draw(count, held)
        y, optical, sigma, noise = self.degrade(x, sampled=True)
        batch = Batch(x, optical, y, self.depth(x), sigma, noise)
        if held or not self.pairs:
            return batch
        pick = torch.randint(len(self.pairs["x"]), (count,), device=self.device)
        seen = {name: array[pick] for name, array in self.pairs.items()}
        zones = seen["depth_m"][:, None]
        depth = (
            torch.cat(((zones / 3).clamp(0, 1), (zones > 0).float()), 1)
            .repeat_interleave(4, 2)
            .repeat_interleave(4, 3)
        )
        images = [seen[name][:, None].clamp(0, 1) for name in ("x", "optical", "y")]
        virtual = self.chance(self.camera_share, count)
        theirs = Batch(*images, depth, seen["sigma_px"], seen["noise_std"])

        def chosen(name):
            a, b = getattr(theirs, name), getattr(batch, name)
            return torch.where(virtual.view(-1, *[1] * (a.dim() - 1)), a, b)

        return Batch(*map(chosen, ("x", "optical", "y", "depth", "sigma_px", "noise")))

    def starts(self, count, enlarge, held=False):
        """What a deblurrer learns from: x, the enlarged reading, the raw one, blur and noise. A quarter is 64
        x 64 from the start."""
        coarse = count if held else max(1, round(count * READINGS))
        batch = self.readings(coarse, held)
        with torch.no_grad():
            start = enlarge(torch.cat((batch.y, batch.depth), 1)).clamp(0, 1)
        raw = F.interpolate(batch.y, scale_factor=2, mode="nearest")
        if coarse == count:
            return batch.x, start, raw, batch.sigma_px, batch.noise
        x, _ = self.draw(count - coarse)
        full, _, sigma, noise = self.degrade(x, sampled=False)
        return (
            torch.cat((batch.x, x)),
            torch.cat((start, full)),
            torch.cat((raw, full)),
            torch.cat((batch.sigma_px, sigma)),
            torch.cat((batch.noise, noise)),
        )
