"""FSRCNN: from what the camera measures to the optical image before sampling. usage: train_fsrcnn.py FOLDER MINUTES"""
import math
import sys
import time

import torch
from degrade import Characters, psnr
from networks import FSRCNN
from safetensors.torch import save_file

SEED, BATCH, RATE = 7, 16, 2e-3


def main(folder, minutes):
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    characters, net = Characters(SEED, folder), FSRCNN()
    optimizer = torch.optim.AdamW(net.parameters(), RATE, weight_decay=1e-4)
    start, step = time.time(), 0
    while (done := (time.time() - start) / 60 / minutes) < 1:
        for group in optimizer.param_groups:
            group["lr"] = RATE * min(1, (step + 1) / 200) * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-6
        x = characters.batch(BATCH)
        y, optical, _, _ = characters.degrade(x, sampled=True)
        out = net(torch.cat((y, characters.depth(x)), 1))
        loss = (out - optical).abs().mean() + 5 * (out - optical).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        step += 1
        if step % 400 == 0:
            print(step, f"{done:.0%} loss {loss.item():.5f}, to the optical image {psnr(out, optical):.2f} dB", flush=True)
    recipe = f"host/nets/training/train_fsrcnn.py, seed {SEED}, {step} steps of {BATCH}"
    save_file(net.state_dict(), f"{folder}/out/fsrcnn.safetensors", dict(model="fsrcnn", version="1", recipe=recipe))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
