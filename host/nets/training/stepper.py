"""A training by the clock: the rate falls along a cosine to nothing when the time is over. On CUDA a whole step, examples and
optimizer with it, is captured once as a graph and repeated."""
import copy
import math
import time

import torch

REPEATS = 20


def device_from(name):
    """`cuda` where there is one, else the CPU on one thread; what `name` says if it says anything."""
    device = name or ("cuda" if torch.cuda.is_available() else "cpu")
    if device == "cpu":
        torch.set_num_threads(1)
    torch.backends.cudnn.benchmark = True
    torch.backends.cuda.matmul.allow_tf32 = True
    return device


class Stepper:
    """`losses()` draws examples and returns a dict of losses; each entry of `parts`, (network, rate), is trained by the loss of
    its name. The mean of a network's weights over time (EMA) is in `mean`."""

    def __init__(self, device, parts, losses, minutes, decay=1e-4, betas=(0.9, 0.99), keep=0.999):
        self.device, self.losses, self.minutes, self.keep = device, losses, minutes, keep
        self.nets = {name: net for name, (net, _) in parts.items()}
        self.top = {name: rate for name, (_, rate) in parts.items()}
        self.rates = {name: torch.tensor(0.0, device=device) for name in parts}
        cuda = device == "cuda"
        self.optimizers = {
            name: torch.optim.AdamW(net.parameters(), self.rates[name], betas=betas, weight_decay=decay, fused=True, capturable=cuda)
            for name, net in self.nets.items()
        }
        self.mean = {name: copy.deepcopy(net) for name, net in self.nets.items()}
        self.following = torch.tensor(0.0, device=device)
        self.step, self.spent, self.graph, self.last = 0, 0.0, None, {}

    def once(self):
        losses = self.losses()
        for name, net in self.nets.items():
            for parameter in net.parameters():
                parameter.grad = None
        # One graph may hold several losses: each network gets the gradient of its own alone.
        for name, net in self.nets.items():
            parameters = list(net.parameters())
            gradients = torch.autograd.grad(losses[name], parameters, retain_graph=name != list(self.nets)[-1])
            for parameter, gradient in zip(parameters, gradients):
                parameter.grad = gradient
        for name, net in self.nets.items():
            torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            self.optimizers[name].step()
            with torch.no_grad():
                mean, now = list(self.mean[name].parameters()), list(net.parameters())
                torch._foreach_mul_(mean, 1 - self.following)
                torch._foreach_add_(mean, torch._foreach_mul(now, self.following))
        for name in self.nets:
            self.sums[name] += losses[name].detach()

    def schedule(self):
        done = min(1.0, self.spent / (60 * self.minutes))
        for name, rate in self.rates.items():
            rate.fill_(self.top[name] * min(1, (self.step + 1) / 500) * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-7)
        self.following.fill_(1 - min(self.keep, (1 + self.step) / (20 + self.step)))

    def capture(self):
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                self.once()
        torch.cuda.current_stream().wait_stream(side)
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph):
            self.once()

    def run(self, every_s, report):
        """Trains until the time is over; `report(steps, minutes, mean losses)` every so many seconds and at the end."""
        self.sums = {name: torch.zeros((), device=self.device) for name in self.nets}
        self.schedule()
        if self.device == "cuda" and self.graph is None:
            self.capture()
        since, counted = time.time(), 0
        before, start = self.spent, time.time()
        while self.spent < 60 * self.minutes:
            self.schedule()
            for _ in range(REPEATS):
                self.graph.replay() if self.graph else self.once()
                if not self.graph and self.step % REPEATS == 0:
                    self.schedule()
                self.step += 1
            counted += REPEATS
            if self.graph:
                torch.cuda.synchronize()
            self.spent = before + time.time() - start
            if time.time() - since > every_s or self.spent >= 60 * self.minutes:
                losses = {name: float(total) / counted for name, total in self.sums.items()}
                report(self.step, self.spent / 60, losses)
                if not all(map(math.isfinite, losses.values())):
                    raise SystemExit(f"a loss is not finite: {losses}")
                for total in self.sums.values():
                    total.zero_()
                since, counted = time.time(), 0

    def state(self):
        kinds = dict(net=self.nets, mean=self.mean, optimizer=self.optimizers)
        state = {f"{kind}.{name}": part.state_dict() for kind, parts in kinds.items() for name, part in parts.items()}
        return state | dict(step=self.step, spent=self.spent)

    def resume(self, state):
        for kind, parts in dict(net=self.nets, mean=self.mean).items():
            for name, part in parts.items():
                part.load_state_dict(state[f"{kind}.{name}"])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(state[f"optimizer.{name}"])
            for group in optimizer.param_groups:
                group["lr"] = self.rates[name]
        self.step, self.spent = state["step"], state["spent"]
