"""The UNet in one of its roles, on the outputs of trained FSRCNN and estimator.

usage: train_unet.py bridge|ancestral|gan|regression FOLDER MINUTES [--init FILE] [--stop-after MINUTES]

The learning rate follows the clock, so a run ends when it was said to; a checkpoint every minute is resumed when there.
The weights written are a running mean (EMA).
"""
import argparse
import json
import os
import time

import torch
import torch.nn.functional as F
from degrade import Characters, held_out
from nirspi.train.optics import conditions, psnr
from nirspi.train.networks import FSRCNN, Discriminator, Estimator, UNet
from safetensors.torch import load_file, save_file
from stepper import Stepper, device_from

FILES = dict(bridge="diffusion", ancestral="ancestral", gan="gan", regression="regression")
STEPS, BETA_START, BETA_END = 500, 2e-4, 0.025
ALPHA_BAR = torch.cumprod(1 - torch.linspace(BETA_START, BETA_END, STEPS), 0)


class Chain:
    """What stands before the UNet: estimates, and the start of its path."""

    def __init__(self, folder, device):
        self.fsrcnn, self.estimator = FSRCNN().to(device), Estimator().to(device)
        self.fsrcnn.load_state_dict(load_file(f"{folder}/out/fsrcnn.safetensors"))
        self.estimator.load_state_dict(load_file(f"{folder}/out/estimator.safetensors"))

    def estimate(self, y, sampled):
        found = self.estimator(y)
        return found[:, 0] * (8 if sampled else 4), found[:, 1] / 10

    def start(self, y, depth):
        return self.fsrcnn(torch.cat((y, depth), 1)).clamp(0, 1)


@torch.no_grad()
def sample(characters, chain, count):
    """x, the start of the path y, the raw input, and blur and noise: estimated, or the truth off by as much as a user's guess."""
    sampled = round(count * 0.75)
    x = characters.batch(count)
    y, _, sigma, noise = characters.degrade(x[:sampled], sampled=True)
    known = characters.chance(1, count)
    if characters.pairs is not None:
        # A tenth of what the camera's grid sees comes from the virtual camera, which tells no blur.
        pick = (characters.uniform(0, 0.99999, sampled) * len(characters.pairs[0])).long()
        virtual = characters.chance(0.1, sampled)
        y = torch.where(virtual[:, None, None, None], characters.pairs[1][pick], y)
        x = torch.cat((torch.where(virtual[:, None, None, None], characters.pairs[0][pick], x[:sampled]), x[sampled:]))
        known = torch.cat((~virtual, known[sampled:]))
    full, _, full_sigma, full_noise = characters.degrade(x[sampled:], sampled=False)
    start = torch.cat((chain.start(y, characters.depth(x[:sampled])), full))
    found = [torch.cat(pair) for pair in zip(chain.estimate(y, True), chain.estimate(full, False))]
    raw = torch.cat((F.interpolate(y, scale_factor=2, mode="nearest"), full))
    sigma, noise = torch.cat((sigma, full_sigma)), torch.cat((noise, full_noise))
    told = characters.chance(0.12, count) & known
    off = [torch.exp(torch.randn_like(sigma) * spread) for spread in (0.1, 0.2)]
    return x, start, raw, torch.where(told, sigma * off[0], found[0]), torch.where(told, noise * off[1], found[1])


@torch.no_grad()
def held_out_psnr(net, chain, optics, folder):
    """One step, noise 3 %, for blur 1, 2, 3 px."""
    out = {}
    for kind in ("fnt", "hnd", "img", "nat"):
        row = []
        for sigma in (1.0, 2.0, 3.0):
            x, y = held_out(optics, kind, sigma, 0.03, folder=folder)
            start = chain.start(y, torch.zeros(len(y), 2, 32, 32, device=y.device))
            raw = F.interpolate(y, scale_factor=2, mode="nearest")
            told = conditions(torch.ones(len(x), device=y.device), *chain.estimate(y, True))
            row.append(round(psnr(start + net(start, raw, told), x), 2))
        out[kind] = row
    return out


class Losses:
    """What each role learns from."""

    def __init__(self, role, characters, chain, net, judge, batch, device):
        self.role, self.characters, self.chain, self.net, self.judge = role, characters, chain, net, judge
        self.batch, self.device, self.alpha_bar = batch, device, ALPHA_BAR.to(device)

    def __call__(self):
        x, y, raw, sigma, noise = sample(self.characters, self.chain, self.batch)
        # A step captured as a graph must make its own half-precision weights each time.
        with torch.autocast(self.device, dtype=torch.bfloat16, cache_enabled=False):
            return dict(unet=self.noise(x, raw, sigma, noise)) if self.role == "ancestral" else self.image(x, y, raw, sigma, noise)

    def noise(self, x, raw, sigma, noise):
        k = (self.characters.uniform(0, 0.99999, len(x)) * STEPS).long()
        alpha, epsilon = self.alpha_bar[k][:, None, None, None], torch.randn_like(x)
        told = conditions(torch.zeros_like(sigma), sigma, noise)
        told = torch.cat((self.alpha_bar[k].sqrt()[:, None], (1 - self.alpha_bar[k]).sqrt()[:, None], told[:, 2:]), 1)
        current = alpha.sqrt() * (2 * x - 1) + (1 - alpha).sqrt() * epsilon
        return (self.net(current, 2 * raw - 1, told).float() - epsilon).square().mean()  # Eq. (8)

    def image(self, x, y, raw, sigma, noise):
        count = len(x)
        t = torch.ones_like(sigma)
        if self.role == "bridge":
            t = torch.where(self.characters.chance(0.7, count), t, self.characters.uniform(0.02, 1, count))
        at = t[:, None, None, None]
        out = y + self.net((1 - at) * x + at * y, raw, conditions(t, sigma, noise)).float()
        error = out - x
        if self.judge is None:
            # The logarithm makes every image count alike, as the mean of PSNRs does.
            return dict(unet=0.1 * torch.log(error.square().mean((1, 2, 3)) + 2e-4).mean() + 3 * error.abs().mean())
        real, fake = self.judge(y, x).float(), self.judge(y, out.detach()).float()
        # pix2pix: 100 to 1.
        fooled = (self.judge(y, out).float() - 1).square().mean()
        return dict(unet=10 * error.abs().mean() + 0.1 * fooled, judge=(real - 1).square().mean() + fake.square().mean())


def main(args):
    folder, name, device = args.folder, FILES[args.role], device_from(args.device)
    characters, chain = Characters(args.seed, folder, device), Chain(folder, device)
    widths = tuple(map(int, args.widths.split(",")))
    net = UNet(widths).to(device, memory_format=torch.channels_last)
    if args.init:
        net.load_state_dict(load_file(args.init))
    judge = Discriminator().to(device) if args.role == "gan" else None
    parts = dict(unet=(net, args.rate)) | (dict(judge=(judge, 2e-4)) if judge else {})
    losses = Losses(args.role, characters, chain, net, judge, args.batch, device)
    # The GAN's two losses go through one graph, whose buffers a compiled network would not keep.
    if args.compile and judge is None:
        losses.net = torch.compile(net)
    stepper = Stepper(device, parts, losses, args.minutes, decay=1e-3, keep=0.9995)
    checkpoint = f"{folder}/checkpoint_{name}.pt"
    if os.path.exists(checkpoint):
        stepper.resume(torch.load(checkpoint, map_location=device))
        torch.manual_seed(args.seed * 1000003 + stepper.step)
    began = time.time()

    def report(step, spent, losses):
        torch.save(stepper.state(), f"{checkpoint}.part")
        os.replace(f"{checkpoint}.part", checkpoint)
        mean = stepper.mean["unet"]
        recipe = f"host/nets/training/train_unet.py {args.role}, seed {args.seed}, {step} steps of {args.batch}"
        about = dict(model=name, version="3", recipe=recipe)
        if args.role == "ancestral":
            about |= dict(steps=str(STEPS), beta_start=str(BETA_START), beta_end=str(BETA_END))
        state = {key: tensor.contiguous().cpu() for key, tensor in mean.state_dict().items()}
        save_file(state, f"{folder}/out/{name}.safetensors", about)
        line = dict(step=step, minutes=round(spent, 2)) | {f"loss_{key}": round(loss, 4) for key, loss in losses.items()}
        if args.role != "ancestral":
            line["held_out_psnr_db"] = held_out_psnr(mean, chain, characters.optics, folder)
        with open(f"{folder}/{name}.jsonl", "a") as log:
            log.write(json.dumps(line) + "\n")
        print(line, flush=True)
        if args.stop_after and time.time() - began > 60 * args.stop_after:
            raise SystemExit("stopped; the same command goes on")

    stepper.run(args.every, report)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("role", choices=FILES)
    parser.add_argument("folder")
    parser.add_argument("minutes", type=float)
    parser.add_argument("--init")
    parser.add_argument("--stop-after", type=float, metavar="MINUTES", help="leave a checkpoint and end early")
    parser.add_argument("--every", type=float, default=60, metavar="SECONDS", help="between checkpoints")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--widths", default="48,96,192")
    parser.add_argument("--device")
    parser.add_argument("--compile", action="store_true", help="let PyTorch fuse the network's kernels first")
    main(parser.parse_args())
