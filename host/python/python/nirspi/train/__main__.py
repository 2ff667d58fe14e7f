"""``python -m nirspi.train``."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from dataclasses import fields
from pathlib import Path

from .._nirspi import Error
from . import train
from .settings import NETWORKS, Settings


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
        help="pairs of nirspi dev pairs, of the same --data",
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
    add("--batch", type=int, default=Settings.batch, help="examples in a step (%(default)s)")
    add(
        "--width",
        type=_numbers,
        default=(),
        metavar="N,N",
        help="channels; default: as in the shipped weights",
    )
    add("--seed", type=int, default=Settings.seed, help="of first weights, split and examples (%(default)s)")
    add(
        "--held-out",
        type=float,
        default=Settings.held_out,
        metavar="SHARE",
        help="of each file's groups, never trained on (%(default)s)",
    )
    add(
        "--shapes",
        type=float,
        default=Settings.shapes,
        metavar="SHARE",
        help="of the scenes that are no letters (%(default)s)",
    )
    add(
        "--camera-share",
        type=float,
        default=Settings.camera_share,
        metavar="SHARE",
        help="of the examples from --pairs (%(default)s)",
    )
    add("--log-every", type=int, default=Settings.log_every, metavar="STEPS", help="(%(default)s)")
    add(
        "--judge-every",
        type=int,
        default=Settings.judge_every,
        metavar="STEPS",
        help="between held-out scores and checkpoints (%(default)s)",
    )
    add(
        "--judged",
        type=int,
        default=Settings.judged,
        metavar="N",
        help="held-out examples of a score (%(default)s)",
    )
    add(
        "--patience",
        type=int,
        default=Settings.patience,
        metavar="N",
        help="scores in a row without a better one that end the run (%(default)s)",
    )
    add("--device", default="auto", help="auto, cpu, cuda, or another device of PyTorch")
    add("--json", action="store_true", help="the report as JSON")
    return made


# Signals that end a run in order. Windows has no SIGHUP.
ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
# The options that are settings of a run.
SETTINGS = tuple(field.name for field in fields(Settings) if field.name not in ("network", "average", "data"))


def _train(arguments: argparse.Namespace, halt: list[int]) -> dict:
    """Trains as the arguments say, until a signal, which is added to `halt`. Returns the report."""
    given = {name: getattr(arguments, name) for name in SETTINGS}

    def told(entry):
        score = (
            f", held out {entry['held_out']:.2f} {entry['score']}" if entry["held_out"] is not None else ""
        )
        print(
            f"step {entry['step']} of {entry['steps']}, {entry['seconds']:.0f} s, "
            f"loss {entry['loss']:.5f}{score}",
            file=sys.stderr,
            flush=True,
        )

    # What is ignored stays ignored: under nohup a run outlives its terminal.
    heeded = [number for number in ENDING if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, lambda number, _: halt.append(number)) for number in heeded}
    try:
        return train(
            arguments.network,
            arguments.out,
            data=arguments.data,
            pairs=arguments.pairs,
            fsrcnn=arguments.fsrcnn,
            resume=arguments.resume,
            device=arguments.device,
            told=told,
            stopped=lambda: bool(halt),
            **{name: value for name, value in given.items() if value is not None},
        )
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(argv: list[str] | None = None) -> int:
    arguments = parser().parse_args(argv)
    halt: list[int] = []
    try:
        report = _train(arguments, halt)
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if arguments.json:
        print(json.dumps(report))
    else:
        best = (
            f", best held-out score {report['best']:.2f} {report['unit']}"
            if report["best"] is not None
            else ""
        )
        go_on = "; the same command with --resume goes on" if report["ended"] == "stopped" else ""
        print(f"{report['ended']} at step {report['step']}{best}: {report['out']}{go_on}")
    # Ctrl-C is the user's wish; the system's end of a run is a failure.
    return 1 if report["ended"] == "stopped" and halt[0] != signal.SIGINT else 0


if __name__ == "__main__":
    sys.exit(main())
