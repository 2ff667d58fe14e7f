"""The UNet in one of its roles, on the outputs of trained FSRCNN and estimator.

usage: train_unet.py bridge|ancestral|gan FOLDER MINUTES [--init FILE]

The learning rate follows the clock, so a run ends when it was said to; a checkpoint every two minutes is resumed when there.
The weights written are a running mean (EMA).
"""
import argparse
import copy
import json
import math
import os
import time

import numpy as np
import torch
import torch.nn.functional as F
from degrade import Characters, conditions, held_out, psnr
from networks import FSRCNN, Discriminator, Estimator, UNet
from safetensors.torch import load_file, save_file

FILES = dict(bridge="diffusion", ancestral="ancestral", gan="gan")
STEPS, BETA_START, BETA_END = 500, 2e-4, 0.025
ALPHA_BAR = torch.cumprod(1 - torch.linspace(BETA_START, BETA_END, STEPS), 0)


class Chain:
    """What stands before the UNet: estimates, and the start of its path."""

    def __init__(self, folder):
        self.fsrcnn, self.estimator = FSRCNN(), Estimator()
        self.fsrcnn.load_state_dict(load_file(f"{folder}/out/fsrcnn.safetensors"))
        self.estimator.load_state_dict(load_file(f"{folder}/out/estimator.safetensors"))

    def estimate(self, y, sampled):
        found = self.estimator(y)
        return found[:, 0] * (8 if sampled else 4), found[:, 1] / 10

    def start(self, y, depth):
        return self.fsrcnn(torch.cat((y, depth), 1)).clamp(0, 1)


def sample(characters, chain, count):
    """x, the start of the path y, the raw input, and blur and noise: estimated, or the truth off by as much as a user's guess."""
    r = characters.rng
    sampled = round(count * 0.75)
    x = characters.batch(count)
    with torch.no_grad():
        y, _, sigma, noise = characters.degrade(x[:sampled], sampled=True)
        if characters.pairs is not None:
            for i in range(sampled):
                if r.random() < 0.1:
                    k = r.integers(len(characters.pairs[0]))
                    x[i, 0] = torch.from_numpy(characters.pairs[0][k].astype(np.float32))
                    y[i, 0] = torch.from_numpy(characters.pairs[1][k].astype(np.float32)).clamp(0, 1)
                    sigma[i] = -1
        full, _, full_sigma, full_noise = characters.degrade(x[sampled:], sampled=False)
        start = torch.cat((chain.start(y, characters.depth(x[:sampled])), full))
        found = [torch.cat(pair) for pair in zip(chain.estimate(y, True), chain.estimate(full, False))]
    raw = torch.cat((F.interpolate(y, scale_factor=2, mode="nearest"), full))
    sigma, noise = torch.cat((sigma, full_sigma)), torch.cat((noise, full_noise))
    told = torch.from_numpy(r.random(count) < 0.12) & (sigma >= 0)
    off = [torch.from_numpy(np.exp(r.normal(0, spread, count)).astype(np.float32)) for spread in (0.1, 0.2)]
    return x, start, raw, torch.where(told, sigma * off[0], found[0]), torch.where(told, noise * off[1], found[1])


def held_out_psnr(net, chain, folder):
    """One step, noise 3 %, for blur 1, 2, 3 px."""
    out = {}
    with torch.no_grad():
        for kind in ("fnt", "hnd", "img"):
            row = []
            for sigma in (1.0, 2.0, 3.0):
                x, y = held_out(kind, sigma, 0.03, folder=folder)
                start = chain.start(y, torch.zeros(len(y), 2, 32, 32))
                raw = F.interpolate(y, scale_factor=2, mode="nearest")
                told = conditions(torch.ones(len(x)), *chain.estimate(y, True))
                row.append(round(psnr(start + net(start, raw, told), x), 2))
            out[kind] = row
    return out


def main(args):
    folder, name = args.folder, FILES[args.role]
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    characters, chain, net = Characters(args.seed, folder), Chain(folder), UNet()
    if args.init:
        net.load_state_dict(load_file(args.init))
    mean = copy.deepcopy(net)
    optimizer = torch.optim.AdamW(net.parameters(), args.rate, weight_decay=1e-3, betas=(0.9, 0.99))
    judge = Discriminator() if args.role == "gan" else None
    judge_optimizer = torch.optim.Adam(judge.parameters(), 2e-4, betas=(0.5, 0.9)) if judge else None
    parts = dict(net=net, mean=mean, optimizer=optimizer)
    if judge:
        parts |= dict(judge=judge, judge_optimizer=judge_optimizer)
    step, before, checkpoint = 0, 0.0, f"{folder}/checkpoint_{name}.pt"
    if os.path.exists(checkpoint):
        state = torch.load(checkpoint)
        for key, part in parts.items():
            part.load_state_dict(state[key])
        step, before = state["step"], state["spent"]
        characters.rng = np.random.default_rng(args.seed * 1000003 + step)
    net = net.to(memory_format=torch.channels_last)
    start, saved, losses, total = time.time(), time.time(), [], args.minutes * 60
    while (spent := before + time.time() - start) < total:
        rate = args.rate * min(1, (step + 1) / 500) * (0.5 + 0.5 * math.cos(math.pi * spent / total)) + 1e-6
        for group in optimizer.param_groups:
            group["lr"] = rate
        x, y, raw, sigma, noise = sample(characters, chain, args.batch)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            if args.role == "ancestral":
                k = torch.from_numpy(characters.rng.integers(0, STEPS, len(x)))
                alpha, epsilon = ALPHA_BAR[k][:, None, None, None], torch.randn_like(x)
                told = conditions(torch.zeros(len(x)), sigma, noise)
                told[:, 0], told[:, 1] = ALPHA_BAR[k].sqrt(), (1 - ALPHA_BAR[k]).sqrt()
                current = alpha.sqrt() * (2 * x - 1) + (1 - alpha).sqrt() * epsilon
                loss = (net(current, 2 * raw - 1, told).float() - epsilon).square().mean()  # Eq. (8)
            else:
                t = torch.ones(len(x))
                if args.role == "bridge":
                    along = torch.from_numpy(characters.rng.uniform(0.02, 1, len(x)).astype(np.float32))
                    t = torch.where(torch.from_numpy(characters.rng.random(len(x)) < 0.7), t, along)
                at = t[:, None, None, None]
                out = y + net((1 - at) * x + at * y, raw, conditions(t, sigma, noise)).float()
                error = out - x
                # The logarithm makes every image count alike, as the mean of PSNRs does.
                loss = 0.1 * torch.log(error.square().mean((1, 2, 3)) + 2e-4).mean() + 3 * error.abs().mean()
                if judge:
                    real, fake = judge(y, x), judge(y, out.detach())
                    judge_loss = (real - 1).square().mean() + fake.square().mean()
                    judge_optimizer.zero_grad()
                    judge_loss.backward()
                    judge_optimizer.step()
                    loss = 10 * error.abs().mean() + 0.1 * (judge(y, out) - 1).square().mean()
        optimizer.zero_grad()
        loss.backward()
        if torch.isfinite(torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)):
            optimizer.step()
        step += 1
        losses.append(float(loss.detach()))
        keep = min(0.9995, (1 + step) / (20 + step))
        with torch.no_grad():
            torch._foreach_lerp_(list(mean.parameters()), list(net.parameters()), 1 - keep)
        spent = before + time.time() - start
        if time.time() - saved > 120 or spent >= total:
            saved = time.time()
            state = {key: part.state_dict() for key, part in parts.items()}
            torch.save(state | dict(step=step, spent=spent), f"{checkpoint}.part")
            os.replace(f"{checkpoint}.part", checkpoint)
            recipe = f"host/nets/training/train_unet.py {args.role}, seed {args.seed}, {step} steps of {args.batch}"
            about = dict(model=name, version="1", recipe=recipe)
            if args.role == "ancestral":
                about |= dict(steps=str(STEPS), beta_start=str(BETA_START), beta_end=str(BETA_END))
            save_file({k: v.contiguous() for k, v in mean.state_dict().items()}, f"{folder}/out/{name}.safetensors", about)
            line = dict(step=step, minutes=round(spent / 60, 1), loss=round(float(np.mean(losses[-1000:])), 4))
            if args.role != "ancestral":
                line["held_out_psnr_db"] = held_out_psnr(mean, chain, folder)
            with open(f"{folder}/{name}.jsonl", "a") as log:
                log.write(json.dumps(line) + "\n")
            print(line, flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("role", choices=FILES)
    parser.add_argument("folder")
    parser.add_argument("minutes", type=float)
    parser.add_argument("--init")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--batch", type=int, default=16)
    main(parser.parse_args())
