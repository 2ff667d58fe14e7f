"""``python -m nirspi.train``."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from pathlib import Path

from .._nirspi import Error

NETWORKS = ("fsrcnn", "diffusion", "ancestral", "gan", "regression", "estimator", "classifier")
DEBLURRERS = ("diffusion", "ancestral", "gan", "regression")


class _Parser(argparse.ArgumentParser):
    """Wrong arguments are one line, as every refusal of nirspi."""

    def error(self, message):
        self.exit(2, f"error: {message} (--help lists the options)\n")


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def parser() -> argparse.ArgumentParser:
    made = _Parser(
        prog="python -m nirspi.train",
        description="Trains a network of nirspi anew. docs/training.md is the manual.",
    )
    add = made.add_argument
    add("network", choices=NETWORKS)
    add("--out", type=Path, required=True, metavar="DIR", help="the run's folder")
    add(
        "--data",
        action="append",
        default=[],
        metavar="PATH",
        help="letters.npz, or a folder of such files; may be given again",
    )
    add(
        "--pairs",
        action="append",
        default=[],
        metavar="FILE",
        help="pairs of nirspi train degrade, of the same --data",
    )
    add(
        "--fsrcnn",
        type=Path,
        metavar="FILE",
        help="weights that enlarge the readings, for the deblurring networks",
    )
    add("--resume", action="store_true", help="go on with the run in --out")
    add("--steps", type=int, help="default: as the network needs")
    add("--rate", type=float, help="highest learning rate")
    add("--batch", type=int, default=16, help="examples in a step (%(default)s)")
    add(
        "--width",
        type=_numbers,
        default=(),
        metavar="N,N",
        help="channels; default: as in the shipped weights",
    )
    add("--seed", type=int, default=1, help="of first weights, split and examples (%(default)s)")
    add(
        "--held-out",
        type=float,
        default=0.1,
        metavar="SHARE",
        help="of each file's groups, never trained on (%(default)s)",
    )
    add(
        "--shapes",
        type=float,
        default=0.15,
        metavar="SHARE",
        help="of the scenes that are no letters (%(default)s)",
    )
    add(
        "--camera-share",
        type=float,
        default=0.2,
        metavar="SHARE",
        help="of the examples from --pairs (%(default)s)",
    )
    add("--log-every", type=int, default=50, metavar="STEPS", help="(%(default)s)")
    add(
        "--judge-every",
        type=int,
        default=500,
        metavar="STEPS",
        help="between held-out scores and checkpoints (%(default)s)",
    )
    add("--judged", type=int, default=96, metavar="N", help="held-out examples of a score (%(default)s)")
    add(
        "--patience",
        type=int,
        default=12,
        metavar="N",
        help="scores in a row without a better one that end the run (%(default)s)",
    )
    add("--device", default="auto", help="auto, cpu, cuda, or another device of PyTorch")
    add("--json", action="store_true", help="the report as JSON")
    return made


def _device(torch, name: str) -> str:
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise Error(
            f"--device {name}: {str(error).splitlines()[0]}, expected a device of PyTorch, such as cpu"
        ) from None
    return name


def train(arguments: argparse.Namespace) -> dict:
    """Trains as the arguments say; returns the report."""
    try:
        import torch
    except ImportError:
        raise Error("training needs PyTorch, which is not installed: pip install torch") from None
    from . import data
    from .folder import Folder, tensors
    from .run import Run, Settings
    from .scenes import Scenes
    from .tasks import TASKS, enlarger

    task, device = TASKS[arguments.network], _device(torch, arguments.device)
    if arguments.network in DEBLURRERS and arguments.fsrcnn is None:
        raise Error(
            f"{arguments.network} needs --fsrcnn FILE: weights of fsrcnn, of a run "
            "or host/nets/weights/fsrcnn.safetensors"
        )
    stacks = data.read(arguments.data)
    settings = Settings(
        network=arguments.network,
        steps=task.steps if arguments.steps is None else arguments.steps,
        rate=task.rate if arguments.rate is None else arguments.rate,
        **{
            name: getattr(arguments, name)
            for name in ("width", "batch", "seed", "held_out", "shapes", "camera_share")
        },
        **{name: getattr(arguments, name) for name in ("log_every", "judge_every", "judged", "patience")},
    )
    settings.check()
    masks = data.split(stacks, settings.held_out, settings.seed)
    pairs = data.pairs(arguments.pairs, stacks, masks) if arguments.pairs else None
    weights = tensors(arguments.fsrcnn) if arguments.fsrcnn else {}
    digest = data.digest(
        stacks, {**(pairs or {}), **{f"fsrcnn {name}": tensor.numpy() for name, tensor in weights.items()}}
    )
    settings = Settings(**{**vars(settings), "data": digest})
    scenes = Scenes(
        stacks, masks, pairs, shapes=settings.shapes, camera_share=settings.camera_share, device=device
    )
    run = Run(settings, scenes, enlarger(weights, device) if weights else None)
    folder = Folder(arguments.out)
    if arguments.resume:
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
    folder.begin(arguments.resume, {"stacks": groups, "pairs": 0 if pairs is None else len(pairs["x"])})

    halt = []
    before = signal.signal(signal.SIGINT, lambda *_: halt.append(True))

    def told(entry):
        score = "" if entry["held_out"] is None else f", held out {entry['held_out']:.2f} {entry['score']}"
        print(
            f"step {entry['step']} of {settings.steps}, {entry['seconds']:.0f} s, "
            f"loss {entry['loss']:.5f}{score}",
            file=sys.stderr,
            flush=True,
        )

    try:
        ended = run.run(folder.keep, told, lambda: bool(halt))
    finally:
        signal.signal(signal.SIGINT, before)
    return {
        "network": settings.network,
        "ended": ended,
        "step": run.step,
        "best": run.best,
        "unit": task.unit,
        "out": str(arguments.out),
    }


def main(argv: list[str] | None = None) -> int:
    arguments = parser().parse_args(argv)
    try:
        report = train(arguments)
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if arguments.json:
        print(json.dumps(report))
    else:
        best = (
            "" if report["best"] is None else f", best held-out score {report['best']:.2f} {report['unit']}"
        )
        go_on = "; the same command with --resume goes on" if report["ended"] == "stopped" else ""
        print(f"{report['ended']} at step {report['step']}{best}: {report['out']}{go_on}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
