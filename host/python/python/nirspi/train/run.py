"""One run of training.

Invariant: what a run learns follows from its settings, its data and the number of steps. All random numbers
of step k follow
from the seed and k, so that a run which was stopped goes on to the same weights as one which was not
(test_train.py).
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import torch

from .._nirspi import Error
from .settings import Settings
from .tasks import TASKS

WARM_UP_STEPS = 200
# Seeds of held-out examples and of first weights; steps have their own numbers.
HELD_OUT, FIRST = -1, -2


def seeded(seed: int, number: int) -> None:
    torch.manual_seed((seed * 1_000_003 + number) % 2**63)


class Run:
    """A run at some step, in memory. `keep(run, better)` stores it; `told(entry)` hears of its progress."""

    def __init__(self, settings: Settings, scenes, enlarge=None):
        settings.check()
        TASKS[settings.network].refuse(settings.width)
        self.settings = settings
        seeded(settings.seed, FIRST)
        self.task = TASKS[settings.network](scenes, settings.width, enlarge)
        self.nets, self.top, self.optimizers = {}, {}, {}
        for name, (net, rate) in self.task.parts(settings.rate).items():
            self.nets[name], self.top[name] = net, rate
            self.optimizers[name] = torch.optim.AdamW(
                net.parameters(), rate, betas=(0.9, 0.99), weight_decay=1e-4
            )
        self.mean = copy.deepcopy(self.nets["net"])
        self.step, self.seconds, self.worse = 0, 0.0, 0
        self.best: float | None = None
        # The losses since the last entry of the log.
        self.total, self.counted = 0.0, 0
        self.log: list[dict[str, Any]] = []

    def rate(self) -> float:
        """The share of the highest rate: it rises over the first steps and falls along a cosine."""
        done = min(1.0, self.step / self.settings.steps)
        return min(1.0, (self.step + 1) / WARM_UP_STEPS) * (0.5 + 0.5 * math.cos(math.pi * done))

    def once(self) -> float:
        seeded(self.settings.seed, self.step)
        losses = self.task.losses(self.settings.batch)
        # One graph may hold several losses: each network gets the gradient of its own alone.
        for i, (name, net) in enumerate(self.nets.items()):
            parameters = list(net.parameters())
            gradients = torch.autograd.grad(losses[name], parameters, retain_graph=i + 1 < len(self.nets))
            for parameter, gradient in zip(parameters, gradients, strict=True):
                parameter.grad = gradient
        for name, net in self.nets.items():
            torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            for group in self.optimizers[name].param_groups:
                group["lr"] = self.top[name] * self.rate()
            self.optimizers[name].step()
        # The first steps are forgotten faster, so that the average does not begin with the first weights.
        keep = min(self.settings.average, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for mean, now in zip(self.mean.parameters(), self.nets["net"].parameters(), strict=True):
                mean.lerp_(now, 1 - keep)
        self.step += 1
        return float(losses["net"].detach())

    def judge(self) -> float:
        seeded(self.settings.seed, HELD_OUT)
        with torch.no_grad():
            return round(self.task.score(self.mean, self.settings.judged), 4)

    def run(
        self,
        keep: Callable[[Run, bool], None],
        told: Callable[[dict[str, Any]], None] = lambda entry: None,
        stopped: Callable[[], bool] = lambda: False,
    ) -> str:
        """Trains to the end. Returns why it ended: complete, stopped, or no longer better."""
        settings = self.settings
        since = time.monotonic() - self.seconds
        while self.step < settings.steps:
            loss = self.once()
            if not math.isfinite(loss):
                raise Error(
                    f"the loss is {loss} at step {self.step}: the last checkpoint is valid, resume it with a"
                    " lower rate"
                )
            self.total, self.counted = self.total + loss, self.counted + 1
            self.seconds = time.monotonic() - since
            ending, halted = self.step == settings.steps, stopped()
            judged = ending or self.step % settings.judge_every == 0
            if judged or self.step % settings.log_every == 0:
                score = self.judge() if judged else None
                better = score is not None and (self.best is None or score > self.best)
                self.worse = 0 if better else self.worse + judged
                self.best = score if better else self.best
                rate = settings.rate * self.rate()
                entry = {
                    "step": self.step,
                    "steps": settings.steps,
                    "loss": self.total / self.counted,
                    "held_out": score,
                    "score": self.task.unit,
                }
                self.log.append(entry | {"rate": rate, "seconds": round(self.seconds, 2)})
                self.total, self.counted = 0.0, 0
                if judged:
                    keep(self, better)
                told(self.log[-1])
                if not ending and self.worse >= settings.patience:
                    return "no longer better"
            if halted and not ending:
                if not judged:
                    keep(self, False)
                return "stopped"
        return "complete"

    def state(self) -> dict[str, Any]:
        parts = {f"net.{name}": net.state_dict() for name, net in self.nets.items()}
        parts |= {f"optimizer.{name}": optimizer.state_dict() for name, optimizer in self.optimizers.items()}
        settings = {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self.settings).items()}
        parts |= {"total": self.total, "counted": self.counted}
        about = {
            "step": self.step,
            "seconds": self.seconds,
            "worse": self.worse,
            "best": self.best,
            "log": self.log,
        }
        return parts | about | {"mean": self.mean.state_dict(), "settings": settings}

    def resume(self, state: dict[str, Any]) -> None:
        """Goes on from a state of the same run."""
        other = self.settings.same_run(state["settings"])
        if other:
            raise Error(
                f"checkpoint: another {', '.join(other)}, expected the same settings but steps and rate"
            )
        for name, net in self.nets.items():
            net.load_state_dict(state[f"net.{name}"])
            self.optimizers[name].load_state_dict(state[f"optimizer.{name}"])
        self.mean.load_state_dict(state["mean"])
        self.step, self.seconds, self.worse = state["step"], state["seconds"], state["worse"]
        self.best, self.log = state["best"], state["log"]
        self.total, self.counted = state["total"], state["counted"]
