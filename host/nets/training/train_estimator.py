"""The estimator of blur and noise, on both grids. usage: train_estimator.py FOLDER MINUTES"""
import math
import sys
import time

import torch
from degrade import Characters, held_out
from networks import Estimator
from safetensors.torch import save_file

SEED, SAMPLED, FULL, RATE = 7, 24, 16, 2e-3


def relative(found, true, floor):
    return ((found - true).abs() / (floor + true)).mean()


def main(folder, minutes):
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    characters, net = Characters(SEED, folder), Estimator()
    optimizer = torch.optim.AdamW(net.parameters(), RATE, weight_decay=1e-4)
    start, step = time.time(), 0
    while (done := (time.time() - start) / 60 / minutes) < 1:
        for group in optimizer.param_groups:
            group["lr"] = RATE * min(1, (step + 1) / 200) * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-6
        loss = 0
        for sampled, count, share in ((True, SAMPLED, 1), (False, FULL, 0.5)):
            y, _, sigma, noise = characters.degrade(characters.batch(count), sampled)
            found = net(y)
            # A pixel of the 32 grid is two of the 64 grid.
            loss = loss + share * relative(found[:, 0], sigma / (8 if sampled else 4), 0.06)
            loss = loss + share * relative(found[:, 1], noise * 10, 0.05)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        step += 1
        if step % 400 == 0:
            with torch.no_grad():
                found = {kind: net(held_out(kind, 2.0, 0.03, folder=folder)[1]) for kind in ("fnt", "hnd", "img")}
            seen = {k: (round(8 * float(v[:, 0].mean()), 2), round(float(v[:, 1].mean()) / 10, 4)) for k, v in found.items()}
            print(step, f"{done:.0%} loss {loss.item():.4f}, held out at 2 px and 0.03:", seen, flush=True)
    recipe = f"host/nets/training/train_estimator.py, seed {SEED}, {step} steps of {SAMPLED + FULL}"
    save_file(net.state_dict(), f"{folder}/out/estimator.safetensors", dict(model="estimator", version="1", recipe=recipe))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
