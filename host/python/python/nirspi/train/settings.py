"""The settings of a run, without PyTorch: the command lists them where there is none."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .._nirspi import Error

NETWORKS = ("fsrcnn", "diffusion", "ancestral", "gan", "regression", "estimator", "classifier")


@dataclass(frozen=True)
class Settings:
    """A run's settings, on which its result depends; `data` is the digest of what it learns from."""

    network: str
    steps: int
    rate: float
    width: tuple[int, ...] = ()
    batch: int = 16
    seed: int = 1
    average: float = 0.999
    log_every: int = 50
    judge_every: int = 500
    judged: int = 96
    patience: int = 12
    shapes: float = 0.15
    camera_share: float = 0.2
    held_out: float = 0.1
    data: str = ""

    def check(self):
        """Refuses what is outside its range."""
        if self.network not in NETWORKS:
            raise Error(f"network is {self.network}, expected one of {', '.join(NETWORKS)}")
        for name in ("steps", "batch", "log_every", "judge_every", "judged", "patience"):
            if getattr(self, name) < 1:
                raise Error(f"{name} is {getattr(self, name)}, expected at least 1")
        if not 0 < self.rate < 1:
            raise Error(f"rate is {self.rate:g}, expected more than 0 and less than 1")
        if not 0 <= self.average < 1:
            raise Error(f"average is {self.average:g}, expected 0 to less than 1")
        for name in ("shapes", "camera_share"):
            if not 0 <= getattr(self, name) <= 1:
                raise Error(f"{name} is {getattr(self, name):g}, expected 0 to 1")
        if not 0 < self.held_out < 1:
            raise Error(f"held_out is {self.held_out:g}, expected more than 0 and less than 1")

    def same_run(self, other: dict[str, Any]) -> list[str]:
        """Names of what differs and would make another run of it."""
        own = {
            name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()
        }
        return [name for name in own if name not in ("steps", "rate") and own[name] != other.get(name)]
