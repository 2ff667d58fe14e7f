"""The judge of 62 characters: never part of the chain, only of its metrics. usage: train_classifier.py FOLDER MINUTES [BATCH] [DEVICE]"""
import sys

import numpy as np
import torch
import torch.nn.functional as F
from degrade import Characters
from nirspi.train.networks import Classifier
from safetensors.torch import save_file
from stepper import Stepper, device_from

SEED, RATE = 3, 2e-3


class Lettered(Characters):
    """Only what has a label."""

    SHARE = dict(fnt=0.15, fnt_aug=0.15, ren=0.2, hnd=0.12, hnd_aug=0.23, img=0.15)

    def examples(self, count):
        kind, at = self.picks(count)
        x = self.images[at].float() / 255
        # Half of them a little soft, a third a little noisy: a judge must not need perfect edges.
        x = self.optics.blurred(x, self.uniform(0, 1.2, count) * self.chance(0.5, count))
        x = x + torch.randn_like(x) * 0.02 * self.chance(0.3, count)[:, None, None]
        x = torch.where(self.chance(0.3, count)[:, None, None], self.turned(x), x)
        # A street photograph is as often dark on bright.
        dark = self.chance(0.5, count) & self.photographs[kind]
        return self.moved(torch.where(dark[:, None, None], 1 - x, x), 3).clamp(0, 1)[:, None], self.labels[at]


def main(folder, minutes, batch="64", device=None):
    device = device_from(device)
    characters, net, val = Lettered(SEED, folder, device), Classifier().to(device), np.load(f"{folder}/val.npz")

    def losses():
        x, labels = characters.examples(int(batch))
        return dict(classifier=F.cross_entropy(net(x), labels, label_smoothing=0.05))

    stepper = Stepper(device, dict(classifier=(net, RATE)), losses, float(minutes), decay=3e-2)

    def report(step, spent, losses):
        right = {}
        with torch.no_grad():
            for kind in ("fnt", "hnd", "img"):
                x = torch.from_numpy(val[kind].astype(np.float32) / 255)[:, None].to(device)
                found = stepper.mean["classifier"](x).argmax(1).cpu().numpy()
                right[kind] = round(float((found == val[f"{kind}_label"]).mean()), 3)
        print(f"{step} steps, {spent:.2f} minutes, loss {losses['classifier']:.3f}, held out: {right}", flush=True)

    stepper.run(20, report)
    state = {name: tensor.contiguous().cpu() for name, tensor in stepper.mean["classifier"].state_dict().items()}
    recipe = f"host/nets/training/train_classifier.py, seed {SEED}, {stepper.step} steps of {batch}"
    save_file(state, f"{folder}/out/classifier.safetensors", dict(model="classifier", version="2", recipe=recipe))


if __name__ == "__main__":
    main(*sys.argv[1:])
