"""The judge of 62 characters: never part of the chain, only of its metrics. usage: train_classifier.py FOLDER MINUTES"""
import math
import sys
import time

import numpy as np
import torch
import torch.nn.functional as F
from degrade import BLUR
from networks import Classifier
from safetensors.torch import save_file

SEED, BATCH, RATE = 3, 64, 2e-3
SHARE = dict(fnt=0.15, fnt_aug=0.15, ren=0.2, hnd=0.12, hnd_aug=0.23, img=0.15)


def main(folder, minutes):
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    rng = np.random.default_rng(SEED)
    train, val = np.load(f"{folder}/train.npz"), np.load(f"{folder}/val.npz")
    images = {kind: train[kind] for kind in SHARE}
    labels = {kind: train[f"{kind}_label"] for kind in SHARE}
    net = Classifier().to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(net.parameters(), RATE, weight_decay=1e-2)
    start, step = time.time(), 0
    while (done := (time.time() - start) / 60 / minutes) < 1:
        for group in optimizer.param_groups:
            group["lr"] = RATE * min(1, (step + 1) / 200) * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-6
        picks = [(kind, rng.integers(len(images[kind]))) for kind in rng.choice(list(SHARE), BATCH, p=list(SHARE.values()))]
        x = torch.from_numpy(np.stack([images[kind][i] for kind, i in picks]).astype(np.float32) / 255)[:, None]
        target = torch.tensor([int(labels[kind][i]) for kind, i in picks])
        # Half of them a little soft, a third a little noisy: a judge must not need perfect edges.
        blur = BLUR[torch.from_numpy(rng.integers(0, 60, BATCH) * (rng.random(BATCH) < 0.5)).long()]
        x[:, 0] = blur @ x[:, 0] @ blur.transpose(1, 2)
        noisy = torch.from_numpy((rng.random(BATCH) < 0.3).astype(np.float32))[:, None, None, None]
        x = (x + torch.randn_like(x) * 0.02 * noisy).clamp(0, 1)
        x = torch.roll(x, tuple(int(s) for s in rng.integers(-3, 4, 2)), (2, 3))
        with torch.autocast("cpu", dtype=torch.bfloat16):
            loss = F.cross_entropy(net(x).float(), target, label_smoothing=0.05)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        step += 1
        if step % 300 == 0:
            right = {}
            with torch.no_grad():
                for kind in ("fnt", "hnd", "img"):
                    found = net(torch.from_numpy(val[kind].astype(np.float32) / 255)[:, None]).argmax(1).numpy()
                    right[kind] = round(float((found == val[f"{kind}_label"]).mean()), 3)
            print(step, f"{done:.0%} loss {loss.item():.3f}, held out:", right, flush=True)
    state = {name: tensor.contiguous() for name, tensor in net.state_dict().items()}
    recipe = f"host/nets/training/train_classifier.py, seed {SEED}, {step} steps of {BATCH}"
    save_file(state, f"{folder}/out/classifier.safetensors", dict(model="classifier", version="1", recipe=recipe))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
