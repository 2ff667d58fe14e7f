"""The same function over many files or seeds, on a Ray cluster.

:func:`map` sends the items in batches to whichever worker is free, and gives the results in the order
of the items. A worker that dies costs time: Ray makes its batch again. What the results become is left
to others: ``pyarrow.Table.from_pylist`` and ``ray.data.from_items`` make tables of rows.

Workers read files where the program that calls :func:`map` reads them: in a file system that all nodes
share.
"""

from __future__ import annotations

import itertools
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from . import __version__
from ._nirspi import Error

# Longer than a node takes to install the packages of a job's runtime environment.
_ANSWER_S = 300.0


@dataclass(frozen=True)
class Mapped:
    """What became of an item.

    Attributes
    ----------
    item : Any
        The item: a path, a seed, ...
    value : Any
        What the function gave; None if it failed.
    error : str or None
        Why the function failed, in one line.
    """

    item: Any
    value: Any = None
    error: str | None = None


def _ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise Error(f"nirspi.ray needs Ray: pip install 'ray[data]' ({error})") from None
    return ray


def map(
    function: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    workers: int | None = None,
    cpus: float = 1,
    gpus: float = 0,
    batch: int = 16,
) -> Iterator[Mapped]:
    """``function(item)`` for each item, on the cluster to which this program is connected, or on a new
    one of this machine.

    Parameters
    ----------
    function : callable
        Takes an item. What it gives must be picklable. The same item must give the same value, because
        a batch whose worker dies is made again.
    items : iterable
        Paths, seeds, or anything that can be pickled.
    workers : int, optional
        Batches at a time. Default: as many as the cluster has processors for.
    cpus : float
        Processors, and threads, of each worker.
    gpus : float
        Share of a GPU for each worker.
    batch : int
        Items that a worker takes at a time. A worker that dies loses at most one batch.

    Yields
    ------
    Mapped
        In the order of the items. An item for which the function raises :class:`nirspi.Error` or
        ``OSError``, such as a damaged file, has the reason as its ``error``. Any other exception ends
        the iteration.

    Raises
    ------
    Error
        If a node that could run a worker has no package or another version: the error names each such
        node, before any item is sent. If the cluster or the function fails.
    """
    if batch < 1:
        raise Error(f"batch is {batch}, expected at least 1")
    if workers is not None and workers < 1:
        raise Error(f"workers is {workers}, expected at least 1")
    ray = _ray()
    if not ray.is_initialized():
        ray.init(log_to_driver=False)
    environment = {"env_vars": {"RAYON_NUM_THREADS": str(max(1, int(cpus)))}}
    _check_nodes(ray, cpus, gpus, environment)
    if workers is None:
        workers = _room(ray, cpus, gpus)
    work = ray.remote(_work).options(num_cpus=cpus, num_gpus=gpus or None, runtime_env=environment)
    return _results(ray, work, function, iter(items), workers, batch)


def _results(
    ray: Any, work: Any, function: Callable[[Any], Any], items: Iterator[Any], workers: int, batch: int
) -> Iterator[Mapped]:
    kept = ray.put(function)
    sent: deque[tuple[list[Any], Any]] = deque()
    try:
        while True:
            while len(sent) < workers and (some := list(itertools.islice(items, batch))):
                sent.append((some, work.remote(kept, some, __version__)))
            if not sent:
                return
            some, answer = sent.popleft()
            made = ray.get(answer)
            yield from (Mapped(item, *found) for item, found in zip(some, made, strict=True))
    except ray.exceptions.RayError as error:
        raise Error(f"the cluster failed: {_last_line(error)}") from error
    finally:
        for _some, answer in sent:
            ray.cancel(answer)


def _work(function: Callable[[Any], Any], items: list[Any], version: str) -> list[tuple[Any, str | None]]:
    """Value and error of each item, in a worker."""
    if version != __version__:
        # A node that came after the nodes were asked.
        raise Error(
            f"nirspi {__version__} on node {socket.gethostname()}, expected {version}:"
            " install the same package on every node"
        )
    made: list[tuple[Any, str | None]] = []
    for item in items:
        try:
            made.append((function(item), None))
        except (Error, OSError) as error:
            made.append((None, " ".join(str(error).split())))
    return made


def _room(ray: Any, cpus: float, gpus: float) -> int:
    """How many workers the cluster has room for."""
    there = ray.cluster_resources()
    workers = int(there.get("CPU", 1) // max(cpus, 0.01))
    if gpus > 0:
        workers = min(workers, int(there.get("GPU", 0) // gpus))
    return max(1, workers)


def _version_here() -> Callable[[], tuple[str | None, str, str]]:
    """A function that gives its process's version of nirspi, or why the import failed, and the interpreter.

    A function inside a function, because Ray sends the code of such a function, and of another one only
    the module and the name, which a node without the package does not know.
    """

    def version() -> tuple[str | None, str, str]:
        import sys

        try:
            import nirspi

            return nirspi.__version__, "", sys.executable
        except Exception as error:
            return None, f"{type(error).__name__}: {error}".splitlines()[0], sys.executable

    return version


def _check_nodes(ray: Any, cpus: float, gpus: float, environment: dict[str, Any]) -> None:
    """Refuses a cluster of which a node that could run a worker has another nirspi than this process."""
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    def alive() -> dict[str, str]:
        """Name of each node that has what a worker asks for."""
        found = {}
        for node in ray.nodes():
            there = node["Resources"]
            if node["Alive"] and there.get("CPU", 0) >= cpus and there.get("GPU", 0) >= gpus:
                name = f"node {node['NodeManagerHostname']} ({node['NodeManagerAddress']}"
                found[node["NodeID"]] = f"{name}, id {node['NodeID'][:8]})"
        return found

    asked = {}
    probe = ray.remote(_version_here())
    for node in alive():
        there = NodeAffinitySchedulingStrategy(node_id=node, soft=False)
        # A node whose processors are all taken answers too.
        options = {"num_cpus": 0, "scheduling_strategy": there, "runtime_env": environment}
        asked[probe.options(**options).remote()] = node
    done, _ = ray.wait(list(asked), num_returns=len(asked), timeout=_ANSWER_S) if asked else ([], [])
    wrong = []
    # A node that has gone meanwhile gets no part.
    names = alive()
    for answer, node in asked.items():
        if node not in names:
            continue
        if answer not in done:
            wrong.append(f"{names[node]} did not answer in {_ANSWER_S:.0f} s")
            continue
        try:
            version, reason, interpreter = ray.get(answer)
        except ray.exceptions.RayError as error:
            wrong.append(f"{names[node]}: {_last_line(error)}")
            continue
        if version is None:
            wrong.append(f"{names[node]}: {interpreter} has no nirspi ({reason})")
        elif version != __version__:
            wrong.append(f"{names[node]}: {interpreter} has nirspi {version}")
    if wrong:
        raise Error(f"{'; '.join(wrong)}; expected {__version__}: install the same package on every node")


def _last_line(error: Exception) -> str:
    """The innermost reason of a failure on the cluster."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__
