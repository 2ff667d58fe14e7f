"""The estimator of blur and noise, on both grids. usage: train_estimator.py FOLDER MINUTES [BATCH] [DEVICE] [INIT]"""
import sys

import torch
from degrade import Characters, held_out
from nirspi.train.networks import Estimator
from safetensors.torch import load_file, save_file
from stepper import Stepper, device_from

SEED, RATE = 7, 2e-3


def relative(found, true, floor):
    return ((found - true).abs() / (floor + true)).mean()


def main(folder, minutes, batch="40", device=None, init=None):
    device, batch = device_from(device), int(batch)
    characters, net = Characters(SEED, folder, device), Estimator().to(device)
    if init:
        net.load_state_dict(load_file(init))

    def losses():
        loss = 0
        # Three of five on the camera's grid.
        for sampled, count, share in ((True, batch * 3 // 5, 1), (False, batch * 2 // 5, 0.5)):
            y, _, sigma, noise = characters.degrade(characters.batch(count), sampled)
            found = net(y)
            # A pixel of the 32 grid is two of the 64 grid.
            loss = loss + share * relative(found[:, 0], sigma / (8 if sampled else 4), 0.06)
            loss = loss + share * relative(found[:, 1], noise * 10, 0.05)
        return dict(estimator=loss)

    stepper = Stepper(device, dict(estimator=(net, RATE)), losses, float(minutes))

    def report(step, spent, losses):
        seen = {}
        with torch.no_grad():
            for kind in ("fnt", "hnd", "img", "nat"):
                found = stepper.mean["estimator"](held_out(characters.optics, kind, 2.0, 0.03, folder=folder)[1])
                sigma = 8 * found[:, 0]
                seen[kind] = (round(float(sigma.mean()), 2), round(float(sigma.std()), 2), round(float(found[:, 1].mean()) / 10, 4))
        print(f"{step} steps, {spent:.2f} minutes, loss {losses['estimator']:.4f}; blur, its spread, noise at 2 px, 0.03: {seen}", flush=True)

    stepper.run(20, report)
    recipe = f"host/nets/training/train_estimator.py, seed {SEED}, {stepper.step} steps of {batch}"
    state = {name: tensor.contiguous().cpu() for name, tensor in stepper.mean["estimator"].state_dict().items()}
    save_file(state, f"{folder}/out/estimator.safetensors", dict(model="estimator", version="3", recipe=recipe))


if __name__ == "__main__":
    main(*sys.argv[1:])
