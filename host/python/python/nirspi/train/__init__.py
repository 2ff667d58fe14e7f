"""Trains the networks of nirspi on your own characters: :func:`train`, or
``python -m nirspi.train NETWORK --out RUN``.

Needs PyTorch (``pip install torch safetensors``), which nothing else in nirspi does. ``docs/training.md`` is
the manual.

| module | contents |
|---|---|
| `data` | stacks of characters, the groups held out from training, pairs from the virtual camera |
| `optics` | the camera as formulas |
| `scenes` | examples: scenes, degraded |
| `networks` | the networks |
| `tasks` | the loss and the held-out score of each network |
| `settings` | the settings of a run |
| `run` | one run: learning rate, running average, log, checkpoints, early end |
| `folder` | a run's files |
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from .._nirspi import Error
from .settings import NETWORKS, Settings

__all__ = ["NETWORKS", "Settings", "train"]


def train(
    network: str,
    out: str | Path,
    *,
    data: Sequence[str | Path] = (),
    pairs: Sequence[str | Path] = (),
    fsrcnn: str | Path | None = None,
    resume: bool = False,
    device: str = "auto",
    told: Callable[[dict[str, Any]], None] = lambda entry: None,
    stopped: Callable[[], bool] = lambda: False,
    **settings: Any,
) -> dict[str, Any]:
    """Trains a network, and keeps the run in a folder.

    Parameters
    ----------
    network : str
        One of :data:`NETWORKS`.
    out : path
        The run's folder: checkpoint, weights, log, and who is held out.
    data : sequence of paths
        ``letters.npz``, or folders of such files. Without any, scenes are shapes.
    pairs : sequence of paths
        Files of ``nirspi dev pairs``, of the same data.
    fsrcnn : path, optional
        Weights that enlarge the readings, for the deblurring networks.
    resume : bool
        Go on with the run in ``out``.
    device : str
        ``auto``, ``cpu``, ``cuda``, or another device of PyTorch.
    told : callable
        Hears of each entry of the log.
    stopped : callable
        Whether the run should end, asked after each step. It can be resumed.
    **settings
        Other fields of :class:`Settings`; ``steps`` and ``rate`` are by default what the network needs.

    Returns
    -------
    dict
        ``network``, ``ended`` (complete, stopped, or no longer better), ``step``, ``best`` held-out score,
        its ``unit``, and ``out``.

    Raises
    ------
    Error
        If PyTorch or safetensors is missing, or a file or setting is wrong.
    """
    try:
        import safetensors  # noqa: F401
        import torch
    except ImportError:
        raise Error("training needs PyTorch and safetensors: pip install torch safetensors") from None
    from . import data as stacked
    from .folder import Folder, tensors
    from .run import Run
    from .scenes import Scenes
    from .tasks import TASKS, enlarger

    if network not in NETWORKS:
        raise Error(f"network is {network}, expected one of {', '.join(NETWORKS)}")
    task, device = TASKS[network], _device(torch, device)
    if task.enlarges and fsrcnn is None:
        raise Error(
            f"{network} needs the weights of an fsrcnn: those of a run, or"
            " host/nets/weights/fsrcnn.safetensors"
        )
    stacks = stacked.read(list(data))
    chosen = Settings(network, **{"steps": task.steps, "rate": task.rate} | settings)
    chosen.check()
    masks = stacked.split(stacks, chosen.held_out, chosen.seed)
    read = stacked.pairs(list(pairs), stacks, masks) if pairs else None
    weights = tensors(Path(fsrcnn)) if fsrcnn else {}
    enlarging = {f"fsrcnn {name}": tensor.numpy() for name, tensor in weights.items()}
    chosen = replace(chosen, data=stacked.digest(stacks, {**(read or {}), **enlarging}))
    scenes = Scenes(
        stacks, masks, read, shapes=chosen.shapes, camera_share=chosen.camera_share, device=device
    )
    run = Run(chosen, scenes, enlarger(fsrcnn, weights, device) if fsrcnn else None)
    folder = Folder(Path(out))
    if resume:
        run.resume(folder.load(device))
    groups = [
        {
            "name": stack.name,
            "images": len(mask),
            "held_out_images": int(mask.sum()),
            "held_out": sorted({int(g) for g in stack.groups[mask]}),
        }
        for stack, mask in zip(stacks, masks, strict=True)
    ]
    folder.begin(resume, {"stacks": groups, "pairs": len(read["x"]) if read else 0})
    ended = run.run(folder.keep, told, stopped)
    about = {"network": network, "ended": ended, "step": run.step, "best": run.best}
    return about | {"unit": task.unit, "out": str(out)}


def _device(torch, name: str) -> str:
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise Error(
            f"device {name}: {str(error).splitlines()[0]}, expected a device of PyTorch, such as cpu"
        ) from None
    return name
