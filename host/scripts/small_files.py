"""One small measurement in each file format that holds several arrays, for the tests of the readers.

    python host/scripts/small_files.py

Writes host/files/src/small/: n = 2, h_row = 0, 3, 1 and y = 5, 1, 2, 3, 4, 4.5, a complex array z of 2 x 3,
and a text. Needs numpy, scipy and h5py. nested.mat and nested.h5 have n and h_row in a structure or group
`run`, y in `run.adc`. lzf.h5 is packed by h5py's own filter. claims.h5 claims an array that takes more memory
than a reader allows.
"""

from pathlib import Path

import h5py
import numpy as np
import scipy.io

OUT = Path(__file__).parent.parent / "files" / "src" / "small"
REAL = {"n": 2, "h_row": np.array([0, 3, 1]), "y": np.array([5, 1, 2, 3, 4, 4.5])}
COMPLEX = np.array([[1 + 10j, 2 + 20j, 3 + 30j], [4 + 40j, 5 + 50j, 6 + 60j]])


def matlab73(path):
    """As MATLAB's save -v7.3: a block of 512 bytes with its name, axes in reverse, complex numbers as (real, imag)."""
    with h5py.File(path, "w", userblock_size=512, libver="earliest") as file:
        for name, array in REAL.items():
            array = np.atleast_2d(np.asarray(array, dtype=np.float64)).T
            compressed = {"chunks": array.shape, "compression": "gzip"} if array.size > 1 else {}
            file.create_dataset(name, data=array, **compressed)
        pair = np.empty(COMPLEX.T.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
        pair["real"], pair["imag"] = COMPLEX.T.real, COMPLEX.T.imag
        file.create_dataset("z", data=pair)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


OUT.mkdir(exist_ok=True)
for name, compressed in (("level5.mat", False), ("level5_compressed.mat", True)):
    variables = REAL | {"z": COMPLEX, "text": "some words"}
    scipy.io.savemat(OUT / name, variables, do_compression=compressed, oned_as="column")
scipy.io.savemat(OUT / "level4.mat", REAL | {"z": COMPLEX}, format="4", oned_as="column")
NESTED = {"n": REAL["n"], "adc": {"text": "some words", "y": REAL["y"]}, "h_row": REAL["h_row"]}
scipy.io.savemat(OUT / "nested.mat", {"run": NESTED}, do_compression=True, oned_as="column")
with h5py.File(OUT / "nested.h5", "w") as file:
    file["run/n"], file["run/h_row"], file["run/adc/y"] = REAL["n"], REAL["h_row"], REAL["y"]
    # A group that holds itself.
    file["run/adc/again"] = file["run"]
matlab73(OUT / "level73.mat")
with h5py.File(OUT / "h5py.h5", "w") as file:
    for name, array in REAL.items():
        file[name] = array
    file["z"] = COMPLEX.astype(np.complex64)
    file["text"] = "some words"
with h5py.File(OUT / "lzf.h5", "w", libver="latest") as file:
    for name, array in (REAL | {"z": COMPLEX.astype(np.complex64)}).items():
        packed = {"chunks": array.shape, "compression": "lzf"} if np.size(array) > 1 else {}
        file.create_dataset(name, data=array, **packed)
    file["text"] = "some words"
with h5py.File(OUT / "claims.h5", "w", libver="latest") as file:
    # Never written: the file has no chunk of it.
    file.create_dataset("y", (2**27,), dtype="u1", chunks=(2**20,))
