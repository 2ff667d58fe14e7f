"""FSRCNN: from what the camera measures to the optical image before sampling. usage: train_fsrcnn.py FOLDER MINUTES [BATCH] [DEVICE] [INIT]"""
import sys

import torch
from degrade import Characters
from nirspi.train.optics import psnr
from nirspi.train.networks import FSRCNN
from safetensors.torch import load_file, save_file
from stepper import Stepper, device_from

SEED, RATE = 7, 2e-3


def main(folder, minutes, batch="16", device=None, init=None):
    device = device_from(device)
    characters, net = Characters(SEED, folder, device), FSRCNN().to(device)
    if init:
        net.load_state_dict(load_file(init))

    def example():
        x = characters.batch(int(batch))
        y, optical, _, _ = characters.degrade(x, sampled=True)
        return torch.cat((y, characters.depth(x)), 1), optical

    def losses():
        seen, optical = example()
        error = net(seen) - optical
        return dict(fsrcnn=error.abs().mean() + 5 * error.square().mean())

    stepper = Stepper(device, dict(fsrcnn=(net, RATE)), losses, float(minutes))

    def report(step, spent, losses):
        with torch.no_grad():
            seen, optical = example()
            quality = psnr(stepper.mean["fsrcnn"](seen), optical)
        print(f"{step} steps, {spent:.2f} minutes, loss {losses['fsrcnn']:.5f}, to the optical image {quality:.2f} dB", flush=True)

    stepper.run(20, report)
    recipe = f"host/nets/training/train_fsrcnn.py, seed {SEED}, {stepper.step} steps of {batch}"
    state = {name: tensor.contiguous().cpu() for name, tensor in stepper.mean["fsrcnn"].state_dict().items()}
    save_file(state, f"{folder}/out/fsrcnn.safetensors", dict(model="fsrcnn", version="3", recipe=recipe))


if __name__ == "__main__":
    main(*sys.argv[1:])
