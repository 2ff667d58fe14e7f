"""Bad input is one line; nothing ends the interpreter."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
import warnings

import numpy as np
import pytest

import nirspi as ns

H = ns.Hadamard(8)
GOOD = ns.Measurement(d=np.arange(64.0), rows="natural", n=8)

REFUSED = [
    (lambda: ns.order("spiral", 8), 'unknown order "spiral", expected natural'),
    (lambda: ns.order("random:x", 8), "unknown order"),
    (lambda: ns.order("natural", 12), "an image side of 12 pixels: expected a power of two"),
    (lambda: ns.order("natural", -8), "expected a power of two"),
    (lambda: ns.order("natural", 2**80), "expected a power of two"),
    (lambda: ns.order("natural", 8.5), "expected a power of two"),
    (lambda: ns.order("natural", None), "expected a power of two"),
    (lambda: ns.Hadamard(8, rows=[0, 64]), "h_row[1] is 64, expected 0 to 63"),
    (lambda: ns.Hadamard(8, rows=[-1]), "h_row[0] is -1"),
    (lambda: ns.Hadamard(8, rows=[3, 3]), "repeats row 3"),
    (lambda: ns.Hadamard(8, rows=[]), "h_row is empty"),
    (lambda: ns.Hadamard(8, rows=[0.5]), "expected whole numbers"),
    (lambda: ns.Hadamard(8, rows=[np.nan]), "expected whole numbers"),
    (lambda: ns.Hadamard(8, rows=[[0, 1]]), "expected one axis"),
    (lambda: ns.Hadamard(8, rows=["a"]), "expected real numbers"),
    (lambda: ns.Hadamard(8, rows=np.array([2**63 + 1], np.uint64)), "expected at most"),
    (lambda: ns.Hadamard(8, scale="unit"), 'expected "sum" or "ortho"'),
    (lambda: H(np.zeros((8, 9))), "x has shape (8, 9), expected (..., 8, 8)"),
    (lambda: H(np.zeros(64)), "expected (..., 8, 8)"),
    (lambda: H(3.0), "expected (..., 8, 8)"),
    (lambda: H(np.array([["a"] * 8] * 8)), "expected real numbers"),
    (lambda: H(np.array([[object()] * 8] * 8)), "expected real numbers"),
    (lambda: H(np.zeros((8, 8), "M8[s]")), "expected real numbers"),
    (lambda: H([[1, 2], [3]]), "x is no array"),
    (lambda: H.adjoint(np.zeros(63)), "y has shape (63,), expected (..., 64)"),
    (lambda: H.pinv(np.zeros(65)), "expected (..., 64)"),
    (lambda: H.unsplit(np.zeros(64)), "expected (..., 128)"),
    (lambda: ns.Hadamard.of(object()), "expected deepinv's SinglePixelCamera"),
    (lambda: ns.Measurement(), "expected d or y"),
    (lambda: ns.Measurement(d=[1], y=[1], rows=[0], n=8), "expected one of them"),
    (lambda: ns.Measurement(d=[1.0], rows=[0]), "expected the side of the image"),
    (lambda: ns.Measurement(d=[1.0], n=8), "no rows"),
    (lambda: ns.Measurement(d=[1.0], rows=[0, 1], n=8), "d has shape (1,), expected (..., 2)"),
    (lambda: ns.Measurement(d=[np.inf, 1], rows=[0, 1], n=8), "d is inf at [0], expected finite"),
    (lambda: ns.Measurement(y=[1.0, 2, 3], rows=[0], n=8), "y has shape (3,), expected (..., 2)"),
    (lambda: ns.Measurement(y=[np.nan, 2], rows=[0], n=8), "no pattern that was read"),
    (lambda: ns.Measurement(y=[1j, 2], rows=[0], n=8), "expected real readings"),
    (lambda: ns.Measurement(y=[1, 2], rows=[0], n=8, readings="triples"), "readings is 'triples'"),
    (
        lambda: ns.Measurement(d=np.zeros((0, 2)), rows=[0, 1], n=8).take(0),
        "count is 0, expected a whole number from 1",
    ),
    (lambda: ns.Measurement.from_trace("t.npy", rows="natural", n=8), "expected one of them"),
    (lambda: ns.Measurement.from_trace("t.npy", samples=0, rows="natural", n=8), "samples is 0"),
    (
        lambda: ns.Measurement.from_trace("t", samples=1, raw="i8", rows="natural", n=8),
        "expected f32, f64, i16 or i32",
    ),
    (lambda: ns.read("t.npy", skip=3), "skip without samples and trigger"),
    (lambda: ns.Measurement.from_table(np.zeros(4)), "table is ndarray, expected columns"),
    (lambda: ns.Measurement.from_table({"word": ["a", "b"]}), "the table: no `h_row`"),
    (lambda: ns.reconstruct(np.zeros(64)), "found ndarray, expected a Measurement"),
    (lambda: ns.reconstruct(GOOD, method="magic"), "unknown method"),
    (lambda: ns.reconstruct(GOOD, basis="fourier"), "unknown basis"),
    (lambda: ns.reconstruct(GOOD, sampling=0), "expected more than 0"),
    (lambda: ns.reconstruct(GOOD, sampling=float("nan")), "sampling is nan"),
    (lambda: ns.reconstruct(GOOD, sampling=1.5), "with its sign"),
    (lambda: ns.reconstruct(GOOD, first_of="spiral"), "unknown order"),
    (lambda: ns.reconstruct(GOOD, sparsity=4), "sparsity belongs to omp"),
    (lambda: ns.reconstruct(GOOD, method="omp", sparsity=0), "at least 1"),
    (
        lambda: ns.reconstruct(GOOD, method="omp", sparsity=-1),
        "sparsity is -1, expected a whole number from 0",
    ),
    (lambda: ns.reconstruct(GOOD, method="omp", residual=2.0), "residual is 2, expected 0 or more"),
    (lambda: ns.reconstruct(GOOD, method="tv", strength=-1.0), "strength is -1"),
    (lambda: ns.reconstruct(GOOD, method="omp", non_negative=True), "pixel basis"),
    (lambda: ns.reconstruct(GOOD, method="omp", dictionary=np.zeros((1, 4, 4))), "expected (N, 8, 8)"),
    (lambda: ns.reconstruct(GOOD, method="omp", dictionary=np.full((1, 8, 8), np.nan)), "NaN"),
    (lambda: ns.reconstruct(GOOD, method="hadamard", warm_start=True), "warm-start belongs to omp"),
    (lambda: ns.reconstruct(GOOD, as_printed=True, method="omp"), "as_printed needs sparsity"),
    (lambda: ns.reconstruct(GOOD, device="tpu"), "unknown backend"),
    (lambda: ns.reconstruct(np.zeros(3), matrix=np.zeros((3, 64))), "rank 0"),
    (lambda: ns.reconstruct(np.zeros(2), matrix=np.ones((3, 64))), "y has shape (2,), expected (..., 3)"),
    (lambda: ns.reconstruct(np.zeros(3), matrix=np.ones((3, 60))), "expected (M, 64), or n=(height, width)"),
    (lambda: ns.reconstruct(np.zeros(3), matrix=np.ones((3, 60)), n=(6, 9)), "expected (M, 6, 9) or (M, 54)"),
    (
        lambda: ns.reconstruct(np.zeros(3), matrix=np.ones((3, 6, 10)), n=60),
        "expected (M, 60, 60) or (M, 3600)",
    ),
    (
        lambda: ns.reconstruct(np.zeros(3), matrix=np.ones((3, 60)), n=(1, 2, 3)),
        "expected a side, or height and width",
    ),
    (lambda: ns.reconstruct(np.zeros(3), matrix=np.ones((3, 60)), n=(6.5, 2)), "n"),
    (lambda: ns.reconstruct(np.ones(3), matrix=np.ones((3, 12, 15)), basis="haar"), "expected dct or pixel"),
    (lambda: ns.reconstruct(np.ones(3), matrix=np.ones((3, 64)), method="hadamard"), "needs Hadamard rows"),
    (lambda: ns.reconstruct(ns.Measurement(d=[np.nan], rows=[0], n=8)), "no pattern that was read"),
    (lambda: ns.reconstruct(ns.Measurement(d=[1e300], rows=[0], n=8), method="hadamard"), "too large"),
    (lambda: ns.enhance(np.zeros((32, 31))), "expected (..., n, n)"),
    (lambda: ns.enhance(np.zeros((64, 64))), "expected (..., 32, 32)"),
    (lambda: ns.enhance(np.full((32, 32), 2.0)), "is 2, expected 0 to 1"),
    (lambda: ns.enhance(np.full((32, 32), np.nan)), "expected 0 to 1"),
    (lambda: ns.enhance(np.zeros((32, 32)), blur_px=99), "blur_px is 99, expected 0 to 16"),
    (lambda: ns.enhance(np.zeros((32, 32)), steps=0), "steps is 0"),
    (lambda: ns.enhance(np.zeros((32, 32)), steps=2**70), "a whole number from 0 to 4294967295"),
    (lambda: ns.enhance(np.zeros((0, 32, 32))), "expected (..., n, n)"),
    (lambda: ns.enhance(ns.Image(np.zeros((32, 32)))), "no light in the image"),
    (lambda: ns.enhance(ns.Image(np.ones((32, 32))), seed=3), "options beside an Image"),
    (lambda: ns.deblur(np.zeros((64, 64)), model="magic"), 'model is "magic"'),
    (lambda: ns.deblur(np.zeros((64, 64)), model="wiener", steps=3), "steps belongs to networks"),
    (lambda: ns.deblur(np.zeros((64, 64)), device="wgpu"), "this build is without the feature wgpu"),
    (lambda: ns.metrics.psnr(np.zeros((8, 8)), np.zeros((8, 9))), "expected (8, 8) as the reference"),
    (lambda: ns.metrics.psnr(np.zeros((8, 8)), np.full((8, 8), 2.0)), "or data_range= or align="),
    (lambda: ns.metrics.psnr(np.zeros((8, 8)), np.full((8, 8), np.nan), data_range=1), "finite"),
    (lambda: ns.metrics.ssim(np.zeros((8, 8)), np.zeros((8, 8))), "at least 11 x 11"),
    (lambda: ns.metrics.correlation(np.zeros((8, 8)), np.eye(8)), "flat"),
    (lambda: ns.metrics.psnr(np.eye(8), np.eye(8), align="affine"), 'expected "gain-offset"'),
    (lambda: ns.metrics.psnr(np.eye(8), np.eye(8), data_range=0), "data_range is 0"),
    (lambda: ns.omp.Dictionary(np.zeros(3)), "expected (M, N)"),
    (lambda: ns.omp.Dictionary(np.zeros((3, 0))), "expected (M, N)"),
    (lambda: ns.omp.Dictionary([[1, np.nan]]), "X is NaN at [0, 1]"),
    (lambda: ns.omp.Dictionary(np.eye(3), device="wgpu"), "this build is without the feature wgpu"),
    (lambda: ns.omp.Dictionary(np.eye(3), precision="half"), 'expected "mixed" or "double"'),
    (lambda: ns.omp.Dictionary(np.eye(3)).solve(np.zeros(4)), "Y has shape (4,), expected (3,)"),
    (lambda: ns.omp.Dictionary(np.eye(3)).solve([1, np.inf, 0]), "measurement[1] is inf"),
    (lambda: ns.omp.Dictionary(np.eye(3)).solve(np.ones(3), n_nonzero_coefs=4), "at most the 3 atoms"),
    (lambda: ns.omp.Dictionary(np.eye(3)).solve(np.ones(3), residual=-1.0), "a residual limit of -1"),
    (lambda: ns.omp.Dictionary(np.eye(3)).solve(np.ones((3, 2)), residual=[0.1] * 3), "3 residuals"),
    (lambda: ns.rain.extinction(-1), "-1"),
    (lambda: ns.rain.extinction(5, wavelengths_nm=[10]), "10"),
    (lambda: ns.rain.extinction(5, drops="hail"), "drops: "),
    (lambda: ns.rain.mie(-1, 1.3), "-1"),
    (lambda: ns.CameraModel("none"), "expected paper, fga015, one-metre or a TOML file"),
    (lambda: ns.CameraModel(toml="[leds]\npower_mw = -2"), "leds.power_mw is -2"),
]


@pytest.mark.parametrize("case", range(len(REFUSED)))
def test_what_does_not_fit_is_refused_in_one_line(case):
    use, words = REFUSED[case]
    with pytest.raises(ns.Error) as error:
        use()
    assert words in str(error.value) and "\n" not in str(error.value)


def test_an_error_is_a_value_error():
    assert issubclass(ns.Error, ValueError)
    with pytest.raises(ValueError):
        ns.order("spiral", 8)


@pytest.mark.parametrize("how", ["quick", "heavy", "long"])
def test_a_panic_is_a_runtime_error(how, capfd):
    from nirspi import _nirspi

    with pytest.raises(RuntimeError, match="a fault of nirspi, please report it: as asked"):
        _nirspi._panic_for_tests(how)
    assert H(np.eye(8)).shape == (64,)


def test_the_compiled_part_refuses_what_the_python_files_do_not_pass():
    from nirspi import _nirspi

    operator = _nirspi.Operator(8, np.arange(64), False, False)
    for wrong in (np.zeros(64, np.int32), np.zeros((8, 8)), np.zeros(128)[::2], np.zeros(65), "x", None):
        with pytest.raises((ns.Error, TypeError)):
            operator.forward(wrong)
    for use in (
        lambda: _nirspi.picture(np.zeros(3, np.float32), (2, 2), "", "of white", ([], []), None),
        lambda: _nirspi.picture(np.zeros(0, np.float32), (0, 0), "", "of white", ([], []), None),
        lambda: _nirspi.sheet(np.zeros(5, np.float32), 2, "", "of white", None),
        lambda: _nirspi.sheet(np.zeros(4, np.float32), 2, "", "volts", None),
        lambda: _nirspi.reconstruct(8, np.arange(3), np.zeros(4), {}),
    ):
        with pytest.raises((ns.Error, KeyError)):
            use()


def test_a_write_protected_array_and_an_array_that_changes_are_read():
    image = np.ones((8, 8), np.float32)
    image.flags.writeable = False
    assert H(image)[0] == 64


def work(seed):
    image = np.random.default_rng(seed).random((64, 16, 16))
    operator = ns.Hadamard(16)
    m = ns.Measurement(d=operator(image), rows=operator.rows, n=16)
    return float(ns.reconstruct(m, method="omp", sampling=0.3, sparsity=9).sum())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_of_fork_computes():
    expected = [work(seed) for seed in range(3)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        with multiprocessing.get_context("fork").Pool(2) as pool:
            assert pool.map_async(work, range(3)).get(timeout=60) == expected


@pytest.mark.skipif(sys.platform == "win32", reason="no signal of Ctrl-C to a process")
def test_ctrl_c_ends_long_work():
    program = """
        import os, signal, threading, time
        # A shell that runs the tests in the background has it ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        import numpy as np
        import nirspi as ns
        H = ns.Hadamard(32)
        m = ns.Measurement(d=H(np.random.default_rng(1).random((5000, 32, 32))), rows=H.rows, n=32)
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        began = time.monotonic()
        try:
            ns.reconstruct(m, method="tv", sampling=0.3)
        except KeyboardInterrupt:
            # The whole work takes a minute on two cores.
            assert time.monotonic() - began < 5
            print("interrupted")
    """
    made = subprocess.run(
        [sys.executable, "-X", "dev", "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert made.stdout == "interrupted\n", made.stderr
