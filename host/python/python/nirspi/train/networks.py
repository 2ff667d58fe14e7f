"""The networks of nirspi in PyTorch. The names of their tensors are those of the weights that nirspi
reads."""

from __future__ import annotations

import itertools

import torch
import torch.nn as nn
import torch.nn.functional as F


class Block(nn.Module):
    """Residual block: convolution, scale and shift by the conditions (FiLM), convolution."""

    def __init__(self, channels, embedding):
        super().__init__()
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=1)
        self.film = nn.Linear(embedding, 2 * channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, padding=1)
        nn.init.zeros_(self.film.weight)
        nn.init.zeros_(self.film.bias)
        self.conv2.weight.data.mul_(0.3)

    def forward(self, x, embedding):
        scale, shift = self.film(embedding)[:, :, None, None].chunk(2, 1)
        return x + self.conv2(F.silu(self.conv1(F.silu(x)) * (1 + scale) + shift))


class UNet(nn.Module):
    """Deblurrer, 500-step baseline and generator of the GAN. Works on the 32 x 32 grid: 2 x 2 pixels are 4
    channels."""

    def __init__(self, widths=(32, 64, 128), blocks=2, embedding=64):
        super().__init__()
        self.embed1 = nn.Linear(6, embedding)
        self.embed2 = nn.Linear(embedding, embedding)
        self.input_conv = nn.Conv2d(8, widths[0], 3, padding=1)

        def level(width):
            return nn.ModuleList([Block(width, embedding) for _ in range(blocks)])

        steps = list(itertools.pairwise(widths))
        self.encoder = nn.ModuleList([level(width) for width in widths])
        self.reduce = nn.ModuleList([nn.Conv2d(fine, coarse, 2, stride=2) for fine, coarse in steps])
        self.expand = nn.ModuleList([nn.Conv2d(coarse, 4 * fine, 1) for fine, coarse in steps])
        self.decoder = nn.ModuleList([level(width) for width in widths[:-1]])
        self.output_conv = nn.Conv2d(widths[0], 4, 3, padding=1)
        self.output_conv.weight.data.mul_(0.1)

    def forward(self, current, raw, conditions):
        """current, raw: (N, 1, 64, 64); conditions: (N, 6); returns (N, 1, 64, 64)."""
        embedding = F.silu(self.embed2(F.silu(self.embed1(conditions))))
        h = self.input_conv(torch.cat((F.pixel_unshuffle(current, 2), F.pixel_unshuffle(raw, 2)), 1))
        skips = []
        for i, level in enumerate(self.encoder):
            for block in level:
                h = block(h, embedding)
            if i < len(self.reduce):
                skips.append(h)
                h = self.reduce[i](h)
        for i in reversed(range(len(self.decoder))):
            h = F.pixel_shuffle(self.expand[i](h), 2) + skips[i]
            for block in self.decoder[i]:
                h = block(h, embedding)
        return F.pixel_shuffle(self.output_conv(h), 2)


class Estimator(nn.Module):
    """Blur and noise of an image of any size: outputs sigma / 4 pixels of its own grid, and 10 times the
    noise's rms."""

    def __init__(self, widths=(16, 32, 48, 64), hidden=64):
        super().__init__()
        first, second, third, last = widths
        self.conv1 = nn.Conv2d(1, first, 3, padding=1)
        self.conv2 = nn.Conv2d(first, second, 3, 2, 1)
        self.conv3 = nn.Conv2d(second, third, 3, 2, 1)
        self.conv4 = nn.Conv2d(third, last, 3, 2, 1)
        self.fc1 = nn.Linear(last, hidden)
        self.fc2 = nn.Linear(hidden, 2)

    def forward(self, x):
        for conv in (self.conv1, self.conv2, self.conv3, self.conv4):
            x = F.relu(conv(x))
        # Noise is a small signal beside a letter: the logarithm lets both be seen.
        features = torch.log(x.mean((2, 3)) + 1e-3) + 3
        return F.softplus(self.fc2(F.relu(self.fc1(features))))


class FSRCNN(nn.Module):
    """(N, 3, 32, 32), intensity, depth and validity, to (N, 1, 64, 64) (Dong, Loy and Tang, ECCV 2016)."""

    def __init__(self, features=48, shrunk=12, maps=4):
        super().__init__()
        self.feature = nn.Conv2d(3, features, 5, padding=2)
        self.feature_act = nn.PReLU(features)
        self.shrink = nn.Conv2d(features, shrunk, 1)
        self.shrink_act = nn.PReLU(shrunk)
        self.map = nn.ModuleList([nn.Conv2d(shrunk, shrunk, 3, padding=1) for _ in range(maps)])
        self.map_act = nn.ModuleList([nn.PReLU(shrunk) for _ in range(maps)])
        self.expand = nn.Conv2d(shrunk, features, 1)
        self.expand_act = nn.PReLU(features)
        self.deconv = nn.ConvTranspose2d(features, 1, 9, 2, 4, output_padding=1)
        self.deconv.weight.data.mul_(0.05)

    def forward(self, x):
        h = self.shrink_act(self.shrink(self.feature_act(self.feature(x))))
        for conv, act in zip(self.map, self.map_act, strict=True):
            h = act(conv(h))
        return F.interpolate(x[:, :1], scale_factor=2, mode="nearest") + self.deconv(
            self.expand_act(self.expand(h))
        )


class Classifier(nn.Module):
    """62 characters; its 128 features are what the Frechet character distance compares."""

    def __init__(self, widths=(32, 64, 128)):
        super().__init__()
        inputs = 1
        for i, width in enumerate(widths):
            setattr(self, f"conv{2 * i + 1}", nn.Conv2d(inputs, width, 3, 2, 1))
            setattr(self, f"conv{2 * i + 2}", nn.Conv2d(width, width, 3, 1, 1))
            inputs = width
        self.fc = nn.Linear(inputs, 62)

    def features(self, x):
        for i in range(1, 7):
            x = F.relu(getattr(self, f"conv{i}")(x))
        return x.mean((2, 3))

    def forward(self, x):
        return self.fc(self.features(x))


class Discriminator(nn.Module):
    """PatchGAN on (degraded, image): 8 x 8 opinions (Isola et al., CVPR 2017)."""

    def __init__(self):
        super().__init__()
        self.conv1 = nn.Conv2d(2, 32, 4, 2, 1)
        self.conv2 = nn.Conv2d(32, 64, 4, 2, 1)
        self.conv3 = nn.Conv2d(64, 128, 4, 2, 1)
        self.conv4 = nn.Conv2d(128, 1, 3, 1, 1)

    def forward(self, degraded, image):
        h = torch.cat((degraded, image), 1)
        for conv in (self.conv1, self.conv2, self.conv3):
            h = F.leaky_relu(conv(h), 0.2)
        return self.conv4(h)
