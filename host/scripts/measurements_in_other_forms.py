"""Measurements of `.npz` files in the forms in which other groups keep theirs, and what to say to open each.

    python host/scripts/measurements_in_other_forms.py DATA/spi OUT

DATA/spi has opar_ala1.npz (64 x 64, raw pairs in zig-zag order) and scheidt_car.npz (32 x 32, differences of 33 detectors in natural
order). OUT gets the files, and cases.json: for each the arguments of `nirspi reconstruct`, and the image expected (.npy).
Needs numpy, scipy and h5py.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import scipy.io

data, out = Path(sys.argv[1]), Path(sys.argv[2])
out.mkdir(parents=True, exist_ok=True)
wing, car = np.load(data / "opar_ala1.npz"), np.load(data / "scheidt_car.npz")
cases = []


def hadamard(d, rows, n):
    """The image of measurements placed at their rows, over n * n."""
    grid = np.zeros(n * n)
    grid[rows] = d
    step = 1
    while step < n * n:
        grid = grid.reshape(-1, 2, step)
        grid = np.stack((grid[:, 0] + grid[:, 1], grid[:, 0] - grid[:, 1]), 1).reshape(-1)
        step *= 2
    return grid.reshape(n, n) / (n * n)


def case(name, image, *arguments):
    image_name = f"{len(cases):02}.npy"
    np.save(out / image_name, np.asarray(image, dtype=np.float64))
    cases.append({"file": name, "arguments": list(arguments), "image": image_name})


def matlab73(path, arrays):
    """As MATLAB's save -v7.3: a block of 512 bytes with its name, axes in reverse, complex numbers as (real, imag)."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            array = np.atleast_2d(np.asarray(array)).T
            if np.iscomplexobj(array):
                pair = np.empty(array.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
                pair["real"], pair["imag"] = array.real, array.imag
                array = pair
            big = array.size > 1
            file.create_dataset(name, data=array, chunks=True if big else None, compression="gzip" if big else None)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


y, rows, n = wing["y"].astype(np.float64), wing["h_row"].astype(np.int64), 64
full = hadamard(y[0::2] - y[1::2], rows, n)
d_all, car_rows, m = car["d"].astype(np.float64), car["h_row"].astype(np.int64), 32
first = 5
d = d_all[first].copy()
d[car_rows == 0] = d[1:].max()
car_image = hadamard(d, car_rows, m)

# MATLAB: level 5, plain and compressed, vectors as columns; 7.3.
for compressed in (False, True):
    name = f"wing_v5_{compressed}.mat"
    scipy.io.savemat(out / name, {"n": n, "h_row": rows, "y": y, "recon": full}, do_compression=compressed, oned_as="column")
    case(name, full)
matlab73(out / "wing_v73.mat", {"n": n, "h_row": rows, "y": y.reshape(-1, 1), "recon": full})
case("wing_v73.mat", full)
matlab73(out / "car_v73.mat", {"n": m, "h_row": car_rows, "d": d_all[:, :].T})
case("car_v73.mat", hadamard(d_all[first], car_rows, m), "--patterns-first", "--index", str(first))
with h5py.File(out / "wing.h5", "w") as file:
    file["n"], file["h_row"], file["y"] = n, rows, y
case("wing.h5", full)
# Filters and types of HDF5; the wing's readings in steps of a thousandth of their range.
counts = np.rint(30_000 * (y - y.min()) / np.ptp(y)).astype(np.int16)
counted = hadamard(counts[0::2].astype(np.float64) - counts[1::2], rows, n)
for name, options in {
    "lzf": {"compression": "lzf", "shuffle": True},
    "gzip": {"compression": "gzip", "shuffle": True, "fletcher32": True},
    "fletcher32": {"fletcher32": True},
    "scaleoffset": {"scaleoffset": 0},
    "big-endian": {"dtype": ">i2"},
}.items():
    with h5py.File(out / f"{name}.h5", "w", libver="latest" if name == "gzip" else None) as file:
        file["run/n"], file["run/h_row"] = n, rows
        file.create_dataset("run/adc", data=counts, chunks=(1000,), **options)
    case(f"{name}.h5", counted, "--field", "run/adc")
# Structures and cells of MATLAB, and its level 4.
scipy.io.savemat(out / "struct.mat", {"run": {"n": n, "h_row": rows, "adc": {"y": y}}})
case("struct.mat", full, "--field", "run.adc.y,h_row=run.h_row,n=run.n")
scipy.io.savemat(out / "v4.mat", {"n": n, "h_row": rows.astype(np.float64), "y": y}, format="4")
case("v4.mat", full)
# Types, byte orders and axes of NumPy.
whole = counts.astype(np.int64) + 1
for at, array in enumerate([
    counts,
    whole.astype(np.uint16),
    whole.astype(">f4"),
    whole.astype(np.uint64) + 2**40,
    np.asfortranarray(whole.reshape(-1, 2)),
    whole.reshape(-1, 1),
    whole.reshape(1, 1, -1, 1),
]):
    np.save(out / f"array{at}.npy", array)
    case(f"array{at}.npy", counted, "--shown", "zig-zag")
scipy.io.savemat(out / "named.mat", {"measurements": y, "order": rows})
case("named.mat", full, "--field", "measurements", "--shown", "zig-zag")

# Text, with decimal points, decimal commas and a heading.
np.savetxt(out / "wing.csv", y, fmt="%.9g")
case("wing.csv", full, "--shown", "zig-zag")
text = "\n".join(f"{v:.9g}".replace(".", ",") for v in y)
(out / "wing_comma.txt").write_text(text + "\n")
case("wing_comma.txt", full, "--shown", "zig-zag")
lines = "\r\n".join(f"{r};{v:.9g}".replace(".", ",") for r, v in zip(car_rows, d))
(out / "car_heading.csv").write_text("h_row;d\r\n" + lines + "\r\n")
case("car_heading.csv", car_image, "--side", str(m))
np.savetxt(out / "car_rows.csv", d_all, delimiter=",", fmt="%.9g")
case("car_rows.csv", hadamard(d_all[first], car_rows, m), "--shown", "natural", "--readings", "differences", "--index", str(first))

# NumPy: readings alone, halves, pattern-major, stacks of stacks.
np.save(out / "wing.npy", y)
case("wing.npy", full, "--shown", "zig-zag")
np.save(out / "halves.npy", np.concatenate((y[0::2], y[1::2])))
case("halves.npy", full, "--shown", "zig-zag", "--readings", "halves")
# Patterns alone, of a detector with a dark level: half of the sum of the scene and its differences.
whole = d[car_rows == 0].item()
np.save(out / "single.npy", (d + whole) / 2 + 0.1 * abs(whole))
case("single.npy", car_image, "--shown", "natural", "--readings", "single")
np.savez(out / "transposed.npz", n=m, h_row=car_rows, d=np.ascontiguousarray(d_all.T))
case("transposed.npz", hadamard(d_all[first], car_rows, m), "--patterns-first", "--index", str(first))
np.savez(out / "stacks.npz", n=m, h_row=car_rows, d=d_all.astype(np.int32).reshape(3, 11, -1))
case("stacks.npz", hadamard(d_all[14], car_rows, m), "--index", "14")

# Patterns that were not read: NaN, negative and NaN rows.
missing = np.arange(0, 1024, 97)
holes = d.copy()
holes[missing] = np.nan
np.savez(out / "nan.npz", n=m, h_row=car_rows, d=holes)
zeroed = np.where(np.isnan(holes), 0, holes)
case("nan.npz", hadamard(zeroed, car_rows, m))
torn = y.copy()
torn[2 * missing] = np.nan
pairs = np.where(np.isnan(torn[0::2] - torn[1::2]), 0, torn[0::2] - torn[1::2])
np.savez(out / "nan_pairs.npz", n=n, h_row=rows, y=torn)
case("nan_pairs.npz", hadamard(pairs, rows, n))
unread = car_rows.astype(np.float64)
unread[missing] = np.where(np.arange(missing.size) % 2, -1, np.nan)
np.savez(out / "rows.npz", n=m, h_row=unread, d=d)
case("rows.npz", hadamard(zeroed, car_rows, m))

# Complex readings: magnitude, and each part.
other = d_all[first + 1].copy()
other[car_rows == 0] = 0
both = (d + 1j * other).astype(np.complex64)
parts = hadamard(both.real.astype(np.float64), car_rows, m), hadamard(both.imag.astype(np.float64), car_rows, m)
np.savez(out / "complex.npz", n=m, h_row=car_rows, d=both, recon=parts[0] + 1j * parts[1])
case("complex.npz", np.hypot(*parts))
case("complex.npz", parts[0], "--part", "real")
case("complex.npz", parts[1], "--part", "imaginary")
scipy.io.savemat(out / "complex.mat", {"n": m, "h_row": car_rows, "d": both.astype(complex)})
case("complex.mat", np.hypot(*parts))
matlab73(out / "complex73.mat", {"n": m, "h_row": car_rows, "d": both.astype(complex)})
case("complex73.mat", np.hypot(*parts))

# Shown in another package's order, and MATLAB's pixels down the columns.
def sequency_row(s, count):
    bits = count.bit_length() - 1
    return int(format(s ^ (s >> 1), f"0{bits}b")[::-1], 2)


raster = np.array([sequency_row(i, m) * m + sequency_row(j, m) for i in range(m) for j in range(m)])
by_row = np.empty(m * m)
by_row[car_rows] = d
pair = np.stack((whole + by_row[raster], whole - by_row[raster]), 1).ravel() / 2
np.save(out / "spyrit.npy", pair.reshape(1, 1, -1).astype(np.float32))
case("spyrit.npy", car_image, "--shown", "walsh-2d")
np.save(out / "part.npy", by_row[raster][:600])
case("part.npy", hadamard(by_row[raster][:600], raster[:600], m), "--shown", "walsh-2d", "--side", str(m), "--readings", "differences")
np.savez(out / "columns.npz", n=m, h_row=(car_rows % m) * m + car_rows // m, d=d)
case("columns.npz", car_image, "--transpose")

(out / "cases.json").write_text(json.dumps(cases))
print(f"{len(cases)} cases")
