"""A run's files: checkpoint, weights, log, and who is held out. Each is whole or the one before, whenever the
run is killed."""

from __future__ import annotations

import hashlib
import io
import json
import os
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from .._nirspi import Error

SHA_BYTES = 32


def whole(path: Path, data: bytes) -> None:
    """Writes a file that is whole or the one before."""
    part = path.with_name(path.name + ".part")
    try:
        with open(part, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise Error(f"{path}: cannot write it: {error.strerror}") from None


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise Error(f"{path}: cannot read it: {error.strerror}") from None


def weights(state: dict[str, torch.Tensor], about: dict[str, str]) -> bytes:
    """A file of safetensors in single precision, with a checksum of all that stands behind its header."""
    parts = {name: tensor.detach().float().contiguous().cpu() for name, tensor in state.items()}
    bare = save(parts)
    body = bare[8 + int.from_bytes(bare[:8], "little") :]
    return save(parts, about | {"sha256": hashlib.sha256(body).hexdigest()})


def tensors(path: Path) -> dict[str, torch.Tensor]:
    """The tensors of a file of safetensors, in single precision."""
    data = _read(path)
    try:
        return {name: tensor.float() for name, tensor in load(data).items()}
    except (SafetensorError, KeyError):
        raise Error(f"{path}: no weights, expected a file of safetensors") from None


class Folder:
    """The folder of a run."""

    def __init__(self, path: Path):
        self.path = Path(path)
        self.checkpoint = self.path / "checkpoint.pt"

    def begin(self, resume: bool, held_out: dict[str, Any]) -> None:
        """Makes the folder. Refuses to begin where a run is kept."""
        if self.checkpoint.exists() and not resume:
            raise Error(f"{self.path}: a run is kept there, expected to resume it, or another folder")
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"{self.path}: cannot make the folder: {error.strerror}") from None
        whole(self.path / "data.json", json.dumps(held_out, indent=1).encode())

    def load(self, device: str) -> dict[str, Any]:
        """The state that was kept last."""
        if not self.checkpoint.exists():
            raise Error(f"{self.path}: no checkpoint to resume")
        data = _read(self.checkpoint)
        if hashlib.sha256(data[SHA_BYTES:]).digest() != data[:SHA_BYTES]:
            raise Error(
                f"{self.checkpoint}: damaged or cut short, expected a whole checkpoint of nirspi.train"
            )
        return torch.load(io.BytesIO(data[SHA_BYTES:]), map_location=device, weights_only=True)

    def keep(self, run, better: bool) -> None:
        """Stores the run as it is, its log, and its averaged weights where they are the best so far."""
        settings = run.settings
        if better:
            recipe = (
                f"nirspi.train {settings.network}: {run.step} of {settings.steps} steps of {settings.batch}"
            )
            recipe += f", rate {settings.rate:g}, seed {settings.seed}, data {settings.data[:16]}"
            recipe += f"; {run.best:g} {run.task.unit} on held-out examples"
            about = {"model": settings.network, "version": "1", "recipe": recipe} | run.task.about()
            whole(self.path / "weights.safetensors", weights(run.mean.state_dict(), about))
        file = io.BytesIO()
        torch.save(run.state(), file)
        data = file.getvalue()
        whole(self.checkpoint, hashlib.sha256(data).digest() + data)
        whole(self.path / "log.jsonl", "".join(json.dumps(entry) + "\n" for entry in run.log).encode())
