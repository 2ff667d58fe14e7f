"""Archives and sweeps on a cluster, by Ray Data.

:func:`run` cuts the items of an :class:`nirspi.Archive` or :class:`nirspi.Sweep` into parts. Each
part is one table, written by whichever worker comes first. The bytes of a part follow from its items
and settings, so that a part that is made twice is the same part: a worker that dies costs time and
changes no result.

Workers read files where the program that calls :func:`run` reads them, and write to the same folder:
a file system that all nodes share.
"""

from __future__ import annotations

import json
import os
import socket
import tempfile
import time
from collections.abc import Callable
from typing import Any

from . import __version__
from ._nirspi import Error, devices
from .archive import Report, Work

_PLAN = "plan.json"
_REPORT = "report.json"
_KEY = b"nirspi.archive"
# Longer than a node takes to install the packages of a job's runtime environment.
_ANSWER_S = 300.0


class _Folder:
    """The folder of the parts, on a file system."""

    def __init__(self, out: str) -> None:
        from pyarrow import fs

        self.out = out
        if "://" in out:
            self.fs, self.path = fs.FileSystem.from_uri(out)
        else:
            self.fs, self.path = fs.LocalFileSystem(), os.path.abspath(out)

    def names(self) -> set[str]:
        from pyarrow import fs

        found = self.fs.get_file_info(fs.FileSelector(self.path, allow_not_found=True))
        return {one.base_name for one in found if one.is_file}

    def read(self, name: str) -> bytes:
        with self.fs.open_input_stream(f"{self.path}/{name}") as file:
            return file.read()

    def write(self, name: str, content: bytes) -> None:
        """A file, whole or not at all."""
        self.fs.create_dir(self.path)
        staged = f"{self.path}/.{name}.{os.getpid()}"
        if self._is_store():
            staged = f"{self.path}/{name}"
        with self.fs.open_output_stream(staged) as file:
            file.write(content)
        if staged != f"{self.path}/{name}":
            self.fs.move(staged, f"{self.path}/{name}")

    def _is_store(self) -> bool:
        return self.fs.type_name not in ("local", "hdfs")

    def skipped(self, name: str) -> tuple[int, list[dict[str, str]]]:
        """Rows of a part, and what has no row."""
        from pyarrow import parquet

        metadata = parquet.read_metadata(f"{self.path}/{name}", filesystem=self.fs)
        about = json.loads((metadata.metadata or {})[_KEY])
        return about["rows"], about["skipped"]

    def part(self, work: Work, name: str, start: int, end: int) -> Report:
        if self.fs.type_name == "local":
            return work.part(f"{self.path}/{name}", start, end)
        with tempfile.TemporaryDirectory() as here:
            report = work.part(f"{here}/{name}", start, end)
            with open(f"{here}/{name}", "rb") as file:
                self.write(name, file.read())
        return report


class _Worker:
    """Holds the method and the networks of one process, and makes parts."""

    def __init__(self, work: Work, out: str, version: str, on_gpu: bool) -> None:
        if version != __version__:
            raise Error(
                f"nirspi {__version__} on node {socket.gethostname()}, expected {version}:"
                " install the same package on every node"
            )
        if on_gpu:
            there = dict(devices())
            work.enhance_on(next((name for name in ("cuda", "wgpu") if name in there), "cpu"))
        self._work, self._folder = work, _Folder(out)
        self._work.table()

    def __call__(self, batch: dict[str, Any]) -> dict[str, list[str]]:
        made = []
        for name, start, end in zip(batch["name"], batch["start"], batch["end"], strict=True):
            report = self._folder.part(self._work, str(name), int(start), int(end))
            told = {"name": str(name), "rows": report.rows, "skipped": report.skipped}
            made.append(json.dumps(told | {"node": socket.gethostname(), "pid": os.getpid()}))
        return {"report": made}


def _ray() -> Any:
    try:
        import ray
        import ray.data
    except ImportError as error:
        raise Error(f"nirspi.ray needs Ray: pip install 'ray[data]' ({error})") from None
    return ray


def run(
    work: Work,
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    cpus: float = 1,
    gpus: float = 0,
    items: int = 64,
    resume: bool = False,
) -> Report:
    """Makes the table of an archive or a sweep on the cluster to which this program is connected, or
    on a new one of this machine.

    Parameters
    ----------
    work : Archive or Sweep
    out : path or URI
        Folder for the parts, ``part-000000.parquet`` and so on: together they have the rows of
        ``work.run("table.parquet")``, in the same order. ``report.json`` is written at the end.
    workers : int, optional
        Number of processes. Default: as many as the cluster has processors for.
    cpus : float
        Processors, and threads, of each worker.
    gpus : float
        Share of a GPU for each worker. The networks of ``enhance=True`` then run on the GPU, if the
        node's package was built with one. Numbers of a GPU differ from those of a processor by
        rounding.
    items : int
        Items of a part. A worker that dies loses at most one part.
    resume : bool
        Make the parts that are missing.

    Returns
    -------
    Report

    Raises
    ------
    Error
        If the folder holds parts and ``resume`` is False, if they are of other files or settings, or
        if a node that could run a worker has no package or another version. Then nothing has been
        written, and the error names each such node.
    """
    if not isinstance(work, Work):
        raise Error(f"work is {type(work).__name__}, expected nirspi.Archive(...) or nirspi.Sweep(...)")
    if items < 1:
        raise Error(f"items is {items}, expected at least 1")
    if workers is not None and workers < 1:
        raise Error(f"workers is {workers}, expected at least 1")
    ray = _ray()
    began = time.monotonic()
    folder = _Folder(os.fspath(out))
    plan: dict[str, Any] = {
        "nirspi": __version__,
        "settings": work.settings,
        "items": items,
        "names": work.names,
    }
    there = folder.names()
    if _PLAN in there:
        if not resume:
            raise Error(f"{folder.out}: parts of a run are there, expected resume=True or another folder")
        kept = json.loads(folder.read(_PLAN))
        for key in plan:
            if kept.get(key) != plan[key]:
                raise Error(f"{folder.out}: made with other {key}: use the same, or another folder")
    elif any(name.endswith(".parquet") for name in there):
        raise Error(f"{folder.out}: tables of something else are there, expected an empty folder")
    count = len(plan["names"])
    parts = {
        f"part-{start // items:06}.parquet": (start, min(start + items, count))
        for start in range(0, count, items)
    }
    missing = [name for name in parts if name not in there]
    rows, skipped, before = 0, [], 0
    for name in parts:
        if name not in missing:
            found = folder.skipped(name)
            rows, before = rows + found[0], before + parts[name][1] - parts[name][0]
            skipped.append((name, found[1]))
    environment = {"env_vars": {"RAYON_NUM_THREADS": str(max(1, int(cpus)))}}
    if missing:
        if not ray.is_initialized():
            ray.init(log_to_driver=False)
        _check_nodes(ray, cpus, gpus, environment)
    if _PLAN not in there:
        folder.write(_PLAN, json.dumps(plan).encode())
    if missing:
        for told in _distribute(ray, work, folder.out, parts, missing, workers, cpus, gpus, environment):
            rows += told["rows"]
            skipped.append((told["name"], told["skipped"]))
    report = Report(
        out=folder.out,
        files=count,
        files_before=before,
        rows=rows,
        skipped=[one for _, found in sorted(skipped, key=lambda part: part[0]) for one in found],
        seconds=time.monotonic() - began,
    )
    folder.write(_REPORT, json.dumps(report.__dict__, indent=1).encode())
    return report


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


def _distribute(
    ray: Any,
    work: Work,
    out: str,
    parts: dict[str, tuple[int, int]],
    missing: list[str],
    workers: int | None,
    cpus: float,
    gpus: float,
    environment: dict[str, Any],
) -> list[dict[str, Any]]:
    """What the workers tell of each part."""
    if workers is None:
        there = ray.cluster_resources()
        workers = int(there.get("CPU", 1) // max(cpus, 0.01))
        if gpus > 0:
            workers = min(workers, int(there.get("GPU", 0) // gpus))
    workers = max(1, min(workers, len(missing)))
    context = ray.data.DataContext.get_current().copy()
    context.enable_progress_bars = False
    try:
        with ray.data.DataContext.current(context):
            todo = ray.data.from_items(
                [{"name": name, "start": parts[name][0], "end": parts[name][1]} for name in missing],
                override_num_blocks=len(missing),
            )
            done = todo.map_batches(
                _Worker,
                fn_constructor_args=(work, out, __version__, gpus > 0),
                batch_size=1,
                compute=ray.data.ActorPoolStrategy(size=workers),
                num_cpus=cpus,
                num_gpus=gpus or None,
                runtime_env=environment,
            )
            return [json.loads(row["report"]) for row in done.iter_rows()]
    except ray.exceptions.RayError as error:
        raise Error(f"the cluster failed: {_last_line(error)}") from error


def _last_line(error: Exception) -> str:
    """The innermost reason of a failure on the cluster."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__
