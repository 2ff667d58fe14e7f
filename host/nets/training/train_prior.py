"""The prior of `--method prior`: scenes of any kind from some of their Hadamard coefficients.

usage: train_prior.py DATA OUT_FOLDER MINUTES [--batch 16] [--seed 13] [--resume]

DATA holds natural/bsds_train.npz, chars74k/{fnt,hnd,img}_train.npz as ../weights/held_out.json splits them, and fonts/*.ttf, *.otf.
Every tenth natural scene (index 4, 14, 24, ...: natural_of_prior) is held out. The learning rate follows the clock; the weights written are a running
mean (EMA).
"""
import argparse
import glob
import json
import math
import os
import time

import numpy as np
import split
import torch
import torch.nn.functional as F
from PIL import Image, ImageDraw, ImageFilter, ImageFont
from prior import Prior, Seen, measured, shown, space_of
from safetensors.torch import save_file
from scipy.ndimage import gaussian_filter

PAGE = (160, 240)


def characters(data):
    """Chars74K without its held-out families, writers and photographs."""
    return [file["x"][~held] for file, held in split.characters(f"{data}/chars74k").values()]


class Pages:
    """Drawn scenes of the natural scenes' size: text, single characters, shapes, on plain, shaded and natural ground."""

    def __init__(self, data, natural, stacks, rng):
        self.natural, self.stacks, self.rng = natural, stacks, rng
        self.fonts = sorted(p for end in ("ttf", "otf") for p in glob.glob(f"{data}/fonts/*.{end}"))

    def ground(self):
        rng, (h, w) = self.rng, PAGE
        y, x = np.mgrid[0:h, 0:w] / h
        kind = rng.integers(5)
        if kind == 0:
            image = np.asarray(Image.fromarray(self.natural[rng.integers(len(self.natural))]).filter(ImageFilter.GaussianBlur(rng.uniform(0, 6)))) / 255
            return rng.uniform(0, 0.6) + rng.uniform(0.1, 0.5) * (image - 0.5)
        level = 0.0 if kind == 1 else rng.uniform(0, 0.9)
        return level + (kind > 2) * (rng.normal(0, 0.3) * x + rng.normal(0, 0.3) * y)

    def text(self, draw, ink):
        rng = self.rng
        font = ImageFont.truetype(str(rng.choice(self.fonts)), int(4 * math.exp(rng.uniform(math.log(7), math.log(60)))))
        letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
        for _ in range(rng.integers(1, 10)):
            word = "".join(rng.choice(list(letters), rng.integers(1, 9)))
            draw.text((rng.integers(-40, 4 * PAGE[1]), rng.integers(-40, 4 * PAGE[0])), word, ink(), font=font)

    def shapes(self, draw, ink):
        rng = self.rng
        for _ in range(rng.integers(1, 25)):
            cx, cy = rng.integers(0, 4 * PAGE[1]), rng.integers(0, 4 * PAGE[0])
            size = math.exp(rng.uniform(math.log(6), math.log(260)))
            kind = rng.integers(4)
            box = [cx - size * rng.uniform(0.2, 1), cy - size * rng.uniform(0.2, 1), cx + size * rng.uniform(0.2, 1), cy + size * rng.uniform(0.2, 1)]
            if kind == 0:
                draw.ellipse(box, fill=ink())
            elif kind == 1:
                draw.rectangle(box, fill=ink())
            elif kind == 2:
                draw.line([tuple(rng.normal((cx, cy), 2 * size)) for _ in range(rng.integers(2, 5))], fill=ink(), width=int(rng.integers(2, 30)))
            else:
                draw.polygon([tuple(rng.normal((cx, cy), size)) for _ in range(rng.integers(3, 7))], fill=ink())

    def page(self):
        rng = self.rng
        out = self.ground()
        for _ in range(rng.integers(1, 4)):
            big = Image.new("L", (4 * PAGE[1], 4 * PAGE[0]))
            draw = ImageDraw.Draw(big)
            one = rng.random() < 0.5
            level = int(rng.integers(60, 256))
            ink = lambda: level if one else int(rng.integers(20, 256))
            (self.text if rng.random() < 0.5 else self.shapes)(draw, ink)
            layer = np.asarray(big.resize((PAGE[1], PAGE[0]), Image.BOX)) / 255
            out = out + rng.choice([1, 1, -1]) * rng.uniform(0.2, 1) * layer
        for _ in range(rng.integers(0, 6)):
            stack = self.stacks[rng.integers(len(self.stacks))]
            side = int(rng.integers(12, 110))
            glyph = np.asarray(Image.fromarray(stack[rng.integers(len(stack))]).resize((side, side), Image.BOX if side < 48 else Image.BICUBIC)) / 255
            r, c = rng.integers(0, PAGE[0] - side), rng.integers(0, PAGE[1] - side)
            out[r : r + side, c : c + side] = (1 - glyph) * out[r : r + side, c : c + side] + glyph * rng.uniform(0, 1)
        out = np.clip(out, 0, 1)
        if rng.random() < 0.25:
            out = np.asarray(Image.fromarray((255 * out).astype(np.uint8)).filter(ImageFilter.GaussianBlur(rng.uniform(0.4, 2)))) / 255
        return (255 * out).astype(np.uint8)


class Scenes:
    """Random crops: two thirds natural, the rest pages and whole characters; turned, scaled, of other contrast, some blurred."""

    def __init__(self, data, seed):
        self.rng = rng = np.random.default_rng(seed)
        natural = np.load(f"{data}/natural/bsds_train.npz")["x"]
        keep = ~split.natural(len(natural), "natural_of_prior")
        self.natural, self.test, self.stacks = natural[keep], natural[~keep], characters(data)
        pages = Pages(data, self.natural, self.stacks, rng)
        self.pages = np.stack([pages.page() for _ in range(400)])

    def crop(self, canvas, n):
        rng = self.rng
        widest = min(canvas.shape) / n
        scale = 1.0 if rng.random() < 0.6 else rng.uniform(1, min(widest, 2.5)) if rng.random() < 0.8 else rng.uniform(0.6, 1)
        side = min(round(scale * n), min(canvas.shape))
        r, c = rng.integers(0, canvas.shape[0] - side + 1), rng.integers(0, canvas.shape[1] - side + 1)
        part = canvas[r : r + side, c : c + side]
        return part if side == n else np.asarray(Image.fromarray(part).resize((n, n), Image.LANCZOS if rng.random() < 0.5 else Image.BOX if side > n else Image.BICUBIC))

    def scene(self, n):
        rng = self.rng
        u = rng.random()
        if u < 0.68:
            x = self.crop(self.natural[rng.integers(len(self.natural))], n)
        elif u < 0.88:
            x = self.crop(self.pages[rng.integers(len(self.pages))], n)
        else:
            stack = self.stacks[rng.integers(len(self.stacks))]
            x = stack[rng.integers(len(stack))]
            x = x if n == 64 else np.asarray(Image.fromarray(x).resize((n, n), Image.BOX if n < 64 else Image.BICUBIC))
        x = np.rot90(x, rng.integers(4))
        x = (x[:, ::-1] if rng.random() < 0.5 else x).astype(np.float32) / 255
        if rng.random() < 0.12:
            x = gaussian_filter(x, rng.uniform(0.5, 4))
            if rng.random() < 0.4:
                r, c = np.mgrid[0:n, 0:n] / n
                glow = np.exp(-((r - rng.uniform(0, 1)) ** 2 + (c - rng.uniform(0, 1)) ** 2) / 2 / rng.uniform(0.15, 0.6) ** 2)
                x = rng.uniform(0.03, 0.5) * x + glow * 0.5
        if rng.random() < 0.3:
            x = x * rng.uniform(0.25, 1) + rng.uniform(0, 0.2)
        return np.ascontiguousarray(x, np.float32)

    def batch(self, count):
        n = int(self.rng.choice([64, 32, 128], p=[0.74, 0.12, 0.14]))
        count = max(2, count * 64 * 64 // (n * n)) if n > 32 else 2 * count
        x = torch.from_numpy(np.stack([self.scene(n) for _ in range(count)]))
        return x, measured(x, self.rng)


def psnr(a, b):
    return (-10 * (a - b).square().mean((1, 2)).log10()).mean().item()


@torch.no_grad()
def judged(net, test):
    """PSNR of the start and of the network on centre crops of held-out scenes, zig-zag, at 10, 20, 30 %, without and with 2 % noise."""
    rng, out = np.random.default_rng(5), {}
    x = torch.from_numpy(test[:, 48:112, 88:152] / np.float32(255))
    for noise in (0.0, 0.02):
        rows = []
        for share in (0.1, 0.2, 0.3):
            generator = torch.Generator().manual_seed(5)
            y = space_of(64).forward(x)
            y = y + noise * torch.randn(y.shape, generator=generator)
            mean = y[:, 0, 0].clone()[:, None, None] / 64
            mask = torch.from_numpy(shown("zigzag", 64, round(share * 4096), rng)).expand(len(x), -1, -1)
            seen = Seen(y, mask)
            rows.append([round(psnr(image[:, 0] * seen.unit + mean, x), 2) for image in (seen.images()[1], net(seen))])
        out[str(noise)] = rows
    return out


def main(args):
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    scenes, net = Scenes(args.data, args.seed), Prior().to(memory_format=torch.channels_last)
    mean = Prior().to(memory_format=torch.channels_last)
    mean.load_state_dict(net.state_dict())
    optimizer = torch.optim.AdamW(net.parameters(), 1e-9, betas=(0.9, 0.99), weight_decay=1e-4)
    step, spent, checkpoint = 0, 0.0, f"{args.out}/checkpoint_prior.pt"
    if args.resume:
        state = torch.load(checkpoint)
        net.load_state_dict(state["net"]), mean.load_state_dict(state["mean"]), optimizer.load_state_dict(state["optimizer"])
        step, spent = state["step"], state["spent"]
        scenes.rng = np.random.default_rng(args.seed + step)
    begun, reported, losses = time.time() - spent, time.time(), []
    while spent < 60 * args.minutes:
        spent = time.time() - begun
        rate = args.rate * min(1, (step + 1) / 200) * (0.5 + 0.5 * math.cos(math.pi * min(1, spent / 60 / args.minutes))) + 1e-7
        for group in optimizer.param_groups:
            group["lr"] = rate
        x, seen = scenes.batch(args.batch)
        mean_level = x.mean((1, 2), keepdim=True)
        target = (x - mean_level) / seen.unit.clamp(min=1e-6)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=not args.exact):
            found = net(seen, every=True)
        # The logarithm makes every image count alike, as the mean of PSNRs does.
        errors = [(image[:, 0] - target).square().mean((1, 2)) for image in found]
        loss = sum(w * torch.log(e + 2e-3).mean() for w, e in zip((0.1, 0.2, 0.7), errors))
        loss = loss + 0.3 * (found[-1][:, 0] - target).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        step += 1
        keep = min(0.999, (1 + step) / (20 + step))
        with torch.no_grad():
            for m, p in zip(mean.parameters(), net.parameters()):
                m.lerp_(p, 1 - keep)
        losses.append(loss.item())
        if time.time() - reported > args.every or spent >= 60 * args.minutes:
            line = dict(step=step, minutes=round(spent / 60, 2), loss=round(float(np.mean(losses)), 4), rate=round(rate, 6), held_out=judged(mean, scenes.test))
            print(json.dumps(line), flush=True)
            losses, reported = [], time.time()
            torch.save(dict(net=net.state_dict(), mean=mean.state_dict(), optimizer=optimizer.state_dict(), step=step, spent=spent), f"{checkpoint}.part")
            os.replace(f"{checkpoint}.part", checkpoint)
            recipe = f"host/nets/training/train_prior.py, seed {args.seed}, {step} steps of {args.batch}"
            data = "BSDS500 training and validation images (Arbelaez et al., TPAMI 2011: research and education, cite), Chars74K (de Campos et al., VISAPP 2009: research, cite), drawn pages; every tenth natural scene, and held_out.json, never seen"
            tensors = {name: tensor.contiguous() for name, tensor in mean.state_dict().items()}
            os.makedirs(f"{args.out}/out", exist_ok=True)
            save_file(tensors, f"{args.out}/out/prior.safetensors", dict(model="prior", version="1", recipe=recipe, data=data))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("data")
    parser.add_argument("out")
    parser.add_argument("minutes", type=float)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--seed", type=int, default=13)
    parser.add_argument("--rate", type=float, default=1.5e-3)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--every", type=float, default=120, metavar="SECONDS", help="between checkpoints")
    parser.add_argument("--exact", action="store_true", help="f32 throughout, not bfloat16")
    parser.add_argument("--resume", action="store_true")
    main(parser.parse_args())
