"""The loss of each network, and its score on held-out examples (larger is better)."""

from __future__ import annotations

import torch
import torch.nn as nn
import torch.nn.functional as F

from .._nirspi import Error
from .networks import FSRCNN, Classifier, Discriminator, Estimator, UNet
from .optics import conditions, psnr

# The 500 steps of the ancestral sampler, as its shipped weights have them.
STEPS, BETA_START, BETA_END = 500, 2e-4, 0.025
DISCRIMINATOR_RATE = 2e-4
# Share of the bridge's examples at the start of its path, because one step from there is the usual case.
AT_START = 0.6


def charbonnier(error):
    """The absolute error, smooth at 0."""
    return (error.square() + 1e-6).sqrt().mean()


class Task:
    """What a network learns. `parts` are the networks that are trained and their highest rates; the first one
    is kept."""

    widths: tuple[int, ...] = ()
    steps, rate, unit = 20_000, 1e-3, "dB"
    # Whether it learns from readings that an FSRCNN has enlarged.
    enlarges = False

    def __init__(self, scenes, widths, enlarge=None):
        self.scenes, self.enlarge = scenes, enlarge
        self.net = self.network(tuple(widths) or self.widths).to(scenes.device)

    @classmethod
    def refuse(cls, widths):
        """Refuses widths that the network cannot have."""
        if len(widths) not in (0, len(cls.widths)) or not all(1 <= width <= 1024 for width in widths):
            raise Error(f"width is {list(widths)}, expected {len(cls.widths)} numbers of 1 to 1024")

    def network(self, widths):
        raise NotImplementedError

    def parts(self, rate):
        return {"net": (self.net, rate)}

    def losses(self, count):
        """The loss of each part, of so many new examples."""
        raise NotImplementedError

    def score(self, net, count):
        """Mean score of so many held-out examples."""
        raise NotImplementedError

    def about(self):
        """What users of the weights need to know beside their name."""
        return {}


class Fuse(Task):
    """FSRCNN: the scene as light showed it, from readings and depth."""

    widths, steps, rate = (48, 12), 8_000, 2e-3

    def network(self, widths):
        return FSRCNN(*widths)

    def losses(self, count):
        batch = self.scenes.readings(count)
        return {"net": charbonnier(self.net(torch.cat((batch.y, batch.depth), 1)) - batch.optical)}

    def score(self, net, count):
        batch = self.scenes.readings(count, held=True)
        return psnr(net(torch.cat((batch.y, batch.depth), 1)), batch.optical)


class Regression(Task):
    """One step from the enlarged reading to the scene."""

    widths, steps = (32, 64, 128), 20_000
    enlarges = True

    @classmethod
    def refuse(cls, widths):
        if len(widths) > 5 or not all(1 <= width <= 1024 for width in widths):
            raise Error(f"width is {list(widths)}, expected up to 5 levels of 1 to 1024 channels")

    def network(self, widths):
        return UNet(widths)

    def times(self, count):
        return torch.ones(count, device=self.scenes.device)

    def out(self, net, start, raw, told):
        return start + net(start, raw, conditions(torch.ones_like(told[0]), *told))

    def losses(self, count):
        x, y, raw, *told = self.scenes.starts(count, self.enlarge)
        t = self.times(count)
        at = t[:, None, None, None]
        return self.learned(x, y, y + self.net((1 - at) * x + at * y, raw, conditions(t, *told)))

    def learned(self, x, _y, out):
        return {"net": charbonnier(out - x)}

    def score(self, net, count):
        x, y, raw, *told = self.scenes.starts(count, self.enlarge, held=True)
        return psnr(self.out(net, y, raw, told), x)


class Bridge(Regression):
    """The deblurrer: from any point between scene and enlarged reading to the scene (InDI)."""

    widths = (48, 96, 192)

    def times(self, count):
        return torch.where(self.scenes.chance(AT_START, count), 1.0, self.scenes.uniform(0, 1, count))


class Adversarial(Regression):
    """The generator of a GAN, against a PatchGAN that learns beside it; 100 parts L1 to one of the judge."""

    steps, rate = 12_000, 5e-4

    def parts(self, rate):
        self.judge = Discriminator().to(self.scenes.device)
        return {"net": (self.net, rate), "judge": (self.judge, DISCRIMINATOR_RATE)}

    def learned(self, x, y, out):
        real, fake = self.judge(y, x), self.judge(y, out.detach())
        fooled = (self.judge(y, out) - 1).square().mean()
        judged = (real - 1).square().mean() + fake.square().mean()
        return {"net": 10 * (out - x).abs().mean() + 0.1 * fooled, "judge": judged}


class Ancestral(Regression):
    """The noise in a noisy scene, of one of 500 steps (Eq. 8)."""

    steps, rate = 20_000, 5e-4

    def __init__(self, *args):
        super().__init__(*args)
        betas = torch.linspace(BETA_START, BETA_END, STEPS)
        self.alpha_bar = torch.cumprod(1 - betas, 0).to(self.scenes.device)

    def noisy(self, x, raw, told, k):
        alpha, epsilon = self.alpha_bar[k], torch.randn_like(x)
        path = torch.stack((alpha.sqrt(), (1 - alpha).sqrt()), 1)
        told = torch.cat((path, conditions(torch.zeros_like(alpha), *told)[:, 2:]), 1)
        share = alpha[:, None, None, None]
        return share.sqrt() * (2 * x - 1) + (1 - share).sqrt() * epsilon, 2 * raw - 1, told, share, epsilon

    def losses(self, count):
        x, _, raw, *told = self.scenes.starts(count, self.enlarge)
        k = torch.randint(STEPS, (count,), device=self.scenes.device)
        current, raw, told, _, epsilon = self.noisy(x, raw, told, k)
        return {"net": (self.net(current, raw, told) - epsilon).square().mean()}

    def score(self, net, count):
        """Of the scene as it is seen half way, in one step."""
        x, _, raw, *told = self.scenes.starts(count, self.enlarge, held=True)
        k = torch.full((count,), STEPS // 2, device=self.scenes.device)
        current, raw, told, share, _ = self.noisy(x, raw, told, k)
        seen = (current - (1 - share).sqrt() * net(current, raw, told)) / share.sqrt()
        return psnr((seen + 1) / 2, x)

    def about(self):
        return {"steps": str(STEPS), "beta_start": str(BETA_START), "beta_end": str(BETA_END)}


class Estimate(Task):
    """Blur and noise, of readings and of images of 64 x 64."""

    widths, steps = (16, 32, 48, 64), 6_000

    def network(self, widths):
        return Estimator(widths)

    def examples(self, count, held, sampled):
        if sampled:
            batch = self.scenes.readings(count, held)
            y, sigma, noise = batch.y, batch.sigma_px, batch.noise
        else:
            y, _, sigma, noise = self.scenes.degrade(self.scenes.draw(count, held)[0], sampled=False)
        # A pixel of the 32 grid is two of the 64 grid.
        return y, torch.stack((sigma / (8 if sampled else 4), noise * 10), 1)

    def losses(self, count):
        both = [(count - count // 2, True)] + [(count // 2, False)] * (count > 1)
        errors = []
        for part, sampled in both:
            y, truth = self.examples(part, False, sampled)
            errors.append((self.net(y) - truth).abs().sum())
        return {"net": sum(errors) / (2 * count)}

    def score(self, net, count):
        y, truth = self.examples(count, True, True)
        return float(-10 * torch.log10((net(y) - truth).square().mean()))


class Classify(Task):
    """The 62 characters, nearly sharp."""

    widths, steps, unit = (32, 64, 128), 6_000, "%"

    def __init__(self, scenes, *args):
        super().__init__(scenes, *args)
        if not scenes.stacks or any(labels is None for labels in scenes.labels):
            raise Error(
                "images without labels, expected a class for each: an array label in every file of --data"
            )

    def network(self, widths):
        return Classifier(widths)

    def losses(self, count):
        x, labels = self.scenes.draw(count, letters_only=True)
        # A judge must not need perfect edges.
        sigma = self.scenes.uniform(0, 1.2, count) * self.scenes.chance(0.5, count)
        x = self.scenes.optics.blurred(x[:, 0], sigma)
        x = x + torch.randn_like(x) * 0.02 * self.scenes.chance(0.3, count)[:, None, None]
        return {"net": F.cross_entropy(self.net(x.clamp(0, 1)[:, None]), labels)}

    def score(self, net, count):
        x, labels = self.scenes.draw(count, held=True)
        return float((net(x).argmax(1) == labels).float().mean() * 100)


TASKS: dict[str, type[Task]] = {
    "fsrcnn": Fuse,
    "diffusion": Bridge,
    "ancestral": Ancestral,
    "gan": Adversarial,
    "regression": Regression,
    "estimator": Estimate,
    "classifier": Classify,
}


def enlarger(path, state, device) -> nn.Module:
    """The FSRCNN of the weights in the file `path`, which enlarges readings and is not trained."""
    try:
        maps = sum(name.startswith("map.") and name.endswith(".weight") for name in state)
        net = FSRCNN(len(state["feature.weight"]), len(state["shrink.weight"]), maps)
        net.load_state_dict(state)
    except (KeyError, TypeError, RuntimeError):
        raise Error(f"{path}: weights of another network, expected those of fsrcnn") from None
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise Error(f"{path}: {name} holds a value that is not finite, expected weights of fsrcnn")
    return net.to(device).eval().requires_grad_(False)
