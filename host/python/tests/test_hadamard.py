"""Orders, patterns and the operator, against their definitions."""

import pickle

import numpy as np
import pytest

import nirspi as ns
from conftest import asymmetric


def sylvester(n):
    """The natural-order Hadamard matrix by its definition."""
    i = np.arange(n * n)
    return np.array([[(-1.0) ** bin(a & b).count("1") for b in i] for a in i])


@pytest.mark.parametrize("name", [*ns.orders(), "random:3"])
@pytest.mark.parametrize("n", [2, 8, 64])
def test_an_order_is_a_permutation(name, n):
    assert sorted(ns.order(name, n)) == list(range(n * n))


def test_an_order_of_a_file_is_that_file(tmp_path):
    path = tmp_path / "mine.txt"
    path.write_text("3 1 0 2  # mine\n")
    assert ns.order(f"table:{path}", 2).tolist() == [3, 1, 0, 2]


def test_patterns_are_the_rows_and_their_complements():
    rows = ns.order("cake-cutting", 4)[:7]
    shown = ns.patterns(rows, 4)
    signed = sylvester(4)[rows].reshape(7, 4, 4)
    assert shown.dtype == np.uint8 and shown.shape == (14, 4, 4)
    assert (shown[0::2] == (signed > 0)).all() and (shown[0::2] + shown[1::2] == 1).all()
    assert (ns.patterns(rows, 4, split=False) == signed).all()


def test_a_few_patterns_of_a_large_image_take_little_memory():
    shown = ns.patterns([0, 1, 65535], 256)
    assert shown.shape == (6, 256, 256) and shown.nbytes < 1 << 20
    assert (
        shown[4]
        == (-1) ** np.array([[bin(r).count("1") + bin(c).count("1") for c in range(256)] for r in range(256)])
        + 1
        >> 1
    ).all()


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("scale", ["sum", "ortho"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n, m", [(2, 3), (8, 64), (16, 100), (64, 500)])
def test_the_operator_is_its_matrix(n, m, dtype, scale, split, random):
    rows = random.permutation(n * n)[:m]
    operator = ns.Hadamard(n, rows=rows, split=split, scale=scale)
    whole = operator.matrix(np.float64)
    assert whole.shape == operator.shape
    if n <= 8:
        signed = sylvester(n)[rows]
        lit = np.stack([signed > 0, signed < 0], 1).reshape(-1, n * n) if split else signed
        assert np.allclose(whole, lit / (n if scale == "ortho" else 1))
    x = random.random((2, 3, n, n)).astype(dtype)
    y = operator(x)
    assert y.dtype == dtype and y.shape == (2, 3, operator.shape[0])
    error = np.finfo(dtype).eps * n * n
    assert np.allclose(y, x.reshape(2, 3, -1) @ whole.T, atol=error, rtol=error)
    back = operator.adjoint(y)
    assert back.dtype == dtype and back.shape == x.shape
    expected = (y.astype(np.float64) @ whole).reshape(x.shape)
    assert np.allclose(back, expected, atol=error * abs(expected).max())


@pytest.mark.parametrize("split", [False, True])
def test_the_adjoint_is_the_transpose(split, random):
    operator = ns.Hadamard(32, rows=ns.order("zig-zag", 32)[:300], split=split)
    x, y = random.standard_normal((32, 32)), random.standard_normal(operator.shape[0])
    a, b = (operator(x) * y).sum(), (x * operator.adjoint(y)).sum()
    assert abs(a - b) < 1e-10 * abs(a)


@pytest.mark.parametrize("scale", ["sum", "ortho"])
def test_the_pseudo_inverse_is_numpys(scale, random):
    operator = ns.Hadamard(8, rows=random.permutation(64)[:30], scale=scale)
    y = random.random(30)
    assert np.allclose(operator.pinv(y).reshape(-1), np.linalg.pinv(operator.matrix(np.float64)) @ y)


def test_a_dark_level_cancels_in_the_pseudo_inverse_of_pairs():
    image = asymmetric(16)
    operator = ns.Hadamard(16, split=True)
    assert np.allclose(operator.pinv(operator(image) + 5.0), image)
    assert np.allclose(operator.unsplit(operator(image) + 5.0), ns.Hadamard(16)(image))


def test_one_image_and_a_batch_give_the_same_bits(random):
    operator = ns.Hadamard(64, rows=ns.order("sequency", 64)[:1000])
    batch = random.random((40, 64, 64), np.float32)
    assert (operator(batch) == np.stack([operator(one) for one in batch])).all()


def test_numbers_of_other_types_become_floats():
    operator, image = ns.Hadamard(4), np.arange(16).reshape(4, 4)
    for dtype, made in [(np.uint8, np.float32), (np.int64, np.float64), (bool, np.float32)]:
        found = operator(image.astype(dtype))
        assert found.dtype == made and np.allclose(found, operator(image.astype(dtype).astype(float)))
    complex_image = image + 2j * image.T
    assert np.allclose(operator(complex_image), operator(image) + 2j * operator(image.T))


def test_an_array_of_any_memory_order_gives_the_same(random):
    operator = ns.Hadamard(16)
    image = random.random((16, 16)).astype(np.float32)
    strided = np.zeros((32, 48), np.float32)[::2, ::3]
    strided[:] = image
    for other in [np.asfortranarray(image), strided, image.byteswap().view(image.dtype.newbyteorder())]:
        assert (operator(other) == operator(image)).all()


def test_a_contiguous_float32_array_is_not_copied(random):
    from nirspi import _arrays

    x = random.random((100, 32, 32), np.float32)
    assert np.shares_memory(_arrays.floating(x, "x"), x)
    x.flags.writeable = False
    assert ns.Hadamard(32)(x).shape == (100, 1024)


def test_a_copy_through_pickle_is_the_same_operator(random):
    operator = ns.Hadamard(8, rows=[3, 1, 60], split=True, scale="ortho")
    other = pickle.loads(pickle.dumps(operator))
    image = random.random((8, 8))
    assert (other(image) == operator(image)).all() and repr(other) == repr(operator)


def test_scipys_solvers_run_on_the_operator(random):
    linalg = pytest.importorskip("scipy.sparse.linalg")
    operator = ns.Hadamard(16, rows=random.permutation(256)[:200])
    linear = operator.scipy()
    assert np.allclose(linear @ np.eye(256)[:, :5], operator.matrix(np.float64)[:, :5])
    assert np.allclose(linear.H @ np.eye(200)[:, :5], operator.matrix(np.float64).T[:, :5])
    y = operator(asymmetric(16))
    assert np.allclose(linalg.lsqr(linear, y)[0], operator.pinv(y).reshape(-1))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("count", [1, 300])
def test_out_takes_the_result(count, split, dtype, random):
    operator = ns.Hadamard(16, rows=ns.order("zig-zag", 16)[:100], split=split)
    x = random.random((count, 16, 16)).astype(dtype)
    y = operator(x)
    for what, values in [("forward", x), ("adjoint", y), ("pinv", y)]:
        expected = getattr(operator, what)(values)
        out = np.full_like(expected, np.nan)
        assert getattr(operator, what)(values, out=out) is out
        assert (out == expected).all()


def test_an_out_that_does_not_fit_is_refused_and_stays_as_it_was(random):
    operator = ns.Hadamard(16)
    x = random.random((3, 16, 16))
    kept = np.zeros((3, 256))
    kept.flags.writeable = False
    for out, words in [
        (np.zeros((3, 255)), "out has shape (3, 255) of float64, expected (3, 256) of float64"),
        (np.zeros((3, 256), np.float32), "of float32"),
        (np.zeros((256, 3)).T, "not contiguous"),
        (kept, "read-only"),
        (x.reshape(3, 256), "out shares memory with x"),
        ([0.0] * 768, "out is a list, expected a NumPy array"),
    ]:
        before = np.array(out)
        with pytest.raises(ns.Error) as error:
            operator(x, out=out)
        assert words in str(error.value), error.value
        assert (np.asarray(out) == before).all()
    with pytest.raises(ns.Error, match="out beside complex numbers"):
        operator(x + 1j, out=np.zeros((3, 256), complex))


class OnlyDlpack:
    """An array of a library that offers DLPack alone."""

    def __init__(self, array):
        self._array = array

    def __dlpack__(self, **options):
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class OnGpu(OnlyDlpack):
    def __dlpack__(self, **options):
        raise BufferError("on a GPU")


def test_an_array_of_dlpack_alone_is_taken(random):
    operator = ns.Hadamard(16)
    x = random.random((2, 16, 16))
    assert (operator(OnlyDlpack(x)) == operator(x)).all()
    d = operator(x[0])
    m = ns.Measurement(d=OnlyDlpack(d), rows=operator.rows, n=16)
    assert (m.d == d).all()
    with pytest.raises(ns.Error, match="x is no array of the processor: on a GPU"):
        operator(OnGpu(x))
