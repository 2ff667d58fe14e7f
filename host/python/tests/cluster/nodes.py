"""Ray clusters of two nodes of this machine: two `ray start`."""

import contextlib
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time

import ray


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@contextlib.contextmanager
def two_nodes(place, second=sys.executable):
    """Two nodes with one processor each, to which this process is connected: the process of the second
    node. The second node runs the interpreter `second`."""
    # Sockets have short paths.
    temporary = pathlib.Path("/tmp") / f"nirspi-ray-{os.getpid()}-{time.monotonic_ns() % 10**6}"
    port = free_port()
    address = f"127.0.0.1:{port}"
    common = ["--block", "--num-cpus", "1", "--object-store-memory", "100000000", "--disable-usage-stats"]
    head = ["--head", "--port", str(port), "--temp-dir", str(temporary), "--include-dashboard=false"]
    log = os.open(place / "log", os.O_WRONLY | os.O_CREAT)
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def start(interpreter, *words):
        program = [str(interpreter), "-m", "ray.scripts.scripts", "start", *common, *words]
        return subprocess.Popen(program, stdout=log, stderr=log, env=clean, start_new_session=True)

    nodes = [start(sys.executable, *head)]
    try:
        for _ in range(120):
            with socket.socket() as s:
                if s.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.5)
        nodes.append(start(second, "--address", address))
        ray.init(address=address, log_to_driver=False)
        for _ in range(240):
            if ray.cluster_resources().get("CPU", 0) == 2:
                break
            time.sleep(0.5)
        assert len(alive()) == 2, (place / "log").read_text()
        yield nodes[1]
    finally:
        ray.shutdown()
        # The head last: another node waits for it to say goodbye.
        for node in reversed(nodes):
            stop(node)
        shutil.rmtree(temporary, ignore_errors=True)


def alive():
    return [node for node in ray.nodes() if node["Alive"]]


def stop(node):
    """Ends a node with all its processes."""
    if node.poll() is not None:
        return
    os.killpg(node.pid, signal.SIGTERM)
    try:
        node.wait(20)
    except subprocess.TimeoutExpired:
        os.killpg(node.pid, signal.SIGKILL)
        node.wait(20)
