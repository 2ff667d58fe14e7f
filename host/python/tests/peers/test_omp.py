"""Orthogonal matching pursuit beside scikit-learn (its own test cases) and SPAMS."""

import warnings

import numpy as np
import pytest

import nirspi as ns

sklearn = pytest.importorskip("sklearn")
from sklearn.datasets import make_sparse_coded_signal  # noqa: E402
from sklearn.linear_model import orthogonal_mp as theirs  # noqa: E402

N_SAMPLES, N_FEATURES, N_NONZERO, N_TARGETS = 25, 35, 5, 3


pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


@pytest.fixture(scope="module")
def problem():
    y, X, gamma = make_sparse_coded_signal(
        n_samples=N_TARGETS,
        n_components=N_FEATURES,
        n_features=N_SAMPLES,
        n_nonzero_coefs=N_NONZERO,
        random_state=0,
    )
    # As scikit-learn's tests: columns are atoms, and not of norm 1.
    y, X, gamma = y.T, X.T, gamma.T
    return 10 * y, 10 * X, gamma


def test_correct_shapes(problem):
    y, X, _ = problem
    assert ns.omp.orthogonal_mp(X, y[:, 0], n_nonzero_coefs=5).shape == (N_FEATURES,)
    assert ns.omp.orthogonal_mp(X, y, n_nonzero_coefs=5).shape == (N_FEATURES, 3)


def test_n_nonzero_coefs(problem):
    y, X, _ = problem
    assert np.count_nonzero(ns.omp.orthogonal_mp(X, y[:, 0], n_nonzero_coefs=5)) <= 5


def test_tol(problem):
    y, X, _ = problem
    tol = 0.5
    gamma = ns.omp.orthogonal_mp(X, y[:, 0], tol=tol)
    assert np.sum((y[:, 0] - X @ gamma) ** 2) <= tol
    most = ns.omp.orthogonal_mp(X, y, tol=1e9)
    assert np.allclose(most, theirs(X, y, tol=1e9)) and ((most != 0).sum(axis=0) == 1).all()


@pytest.mark.parametrize("precompute", [True, False, "auto"])
def test_the_same_coefficients(problem, precompute):
    y, X, _ = problem
    for options in ({"n_nonzero_coefs": 5}, {"tol": 0.5}, {}):
        ours = ns.omp.orthogonal_mp(X, y, precompute=precompute, **options)
        assert np.allclose(ours, theirs(X, y, precompute=precompute, **options)), options


def test_longer_atoms_win_as_in_scikit_learn(problem, random):
    y, X, _ = problem
    X = X * random.uniform(0.2, 5, N_FEATURES)
    expected = theirs(X, y, n_nonzero_coefs=4)
    assert np.allclose(ns.omp.orthogonal_mp(X, y, n_nonzero_coefs=4), expected)
    dictionary = ns.omp.Dictionary(X, normalised=False)
    assert np.allclose(dictionary.solve(y, n_nonzero_coefs=4).toarray(), expected)
    by_correlation = ns.omp.Dictionary(X).solve(y, n_nonzero_coefs=4).toarray()
    assert ((by_correlation != 0) != (expected != 0)).any()


def test_paths_and_numbers_of_atoms(problem):
    y, X, _ = problem
    for options in ({"n_nonzero_coefs": 5}, {"tol": 0.5}):
        ours = ns.omp.orthogonal_mp(X, y, return_path=True, return_n_iter=True, **options)
        other = theirs(X, y, return_path=True, return_n_iter=True, **options)
        assert ours[0].shape == other[0].shape and np.allclose(ours[0], other[0])
        assert list(ours[1]) == list(other[1])
    one = ns.omp.orthogonal_mp(X, y[:, 0], n_nonzero_coefs=5, return_path=True)
    assert np.allclose(one, theirs(X, y[:, 0], n_nonzero_coefs=5, return_path=True))


@pytest.mark.parametrize(
    "arguments", [{"tol": -1}, {"n_nonzero_coefs": -1}, {"n_nonzero_coefs": 0}, {"n_nonzero_coefs": 36}]
)
def test_bad_input(problem, arguments):
    y, X, _ = problem
    with pytest.raises(ValueError):
        ns.omp.orthogonal_mp(X, y, **arguments)


def test_perfect_signal_recovery(problem):
    y, X, gamma = problem
    (idx,) = gamma[:, 0].nonzero()
    found = ns.omp.orthogonal_mp(X, y[:, 0], n_nonzero_coefs=5)
    assert (idx == np.flatnonzero(found)).all() and np.allclose(gamma[:, 0], found, atol=1e-7)


def test_identical_regressors(problem):
    _, X, _ = problem
    twins = X.copy()
    twins[:, 1] = twins[:, 0]
    gamma = np.zeros(N_FEATURES)
    gamma[0] = gamma[1] = 1.0
    with pytest.warns(RuntimeWarning, match="ended prematurely"):
        ns.omp.orthogonal_mp(twins, twins @ gamma, n_nonzero_coefs=2)


def test_swapped_regressors(problem):
    _, X, _ = problem
    gamma = np.zeros(N_FEATURES)
    gamma[21], gamma[0] = 1.0, 0.5
    y = X @ gamma
    y_of = ns.omp.orthogonal_mp(X, X @ (X.T @ y), n_nonzero_coefs=2)
    assert np.allclose(y_of, theirs(X, X @ (X.T @ y), n_nonzero_coefs=2))
    found = ns.omp.orthogonal_mp(X, y, n_nonzero_coefs=2)
    assert np.flatnonzero(found).tolist() == [0, 21]


def test_no_atoms(problem):
    _, X, _ = problem
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert (ns.omp.orthogonal_mp(X, np.zeros(N_SAMPLES), n_nonzero_coefs=3) == 0).all()


def test_an_atom_that_nothing_sees_is_never_chosen(problem):
    y, X, _ = problem
    X = X.copy()
    X[:, 4] = 0
    found = ns.omp.orthogonal_mp(X, y, n_nonzero_coefs=5)
    assert np.isfinite(found).all() and (found[4] == 0).all()


@pytest.mark.parametrize("frames", [1, 16, 256])
@pytest.mark.parametrize("precision", ["mixed", "double"])
def test_the_supports_of_a_large_problem_are_scikit_learns(frames, precision, random):
    X = random.standard_normal((256, 512))
    X /= np.linalg.norm(X, axis=0)
    Y = random.standard_normal((256, frames))
    solution = ns.omp.Dictionary(X, precision=precision).solve(Y, n_nonzero_coefs=32)
    expected = theirs(X, Y, n_nonzero_coefs=32).reshape(512, frames)
    assert np.allclose(solution.toarray(), expected, atol=1e-4 if precision == "mixed" else 1e-9)
    assert ((expected != 0) == (solution.toarray() != 0)).all()
    assert np.allclose(solution.tocsc().toarray(), solution.toarray())
    left = np.linalg.norm(Y - X @ solution.toarray(), axis=0) / np.linalg.norm(Y, axis=0)
    assert np.allclose(solution.residual, left, atol=1e-5)


def test_one_measurement_and_a_batch_give_the_same(random):
    dictionary = ns.omp.Dictionary(random.standard_normal((64, 128)))
    Y = random.standard_normal((64, 20))
    batch = dictionary.solve(Y, n_nonzero_coefs=10)
    for k in range(20):
        alone = dictionary.solve(Y[:, k], n_nonzero_coefs=10)
        assert (alone.support == batch.support[k]).all() and (alone.coef == batch.coef[k]).all()
        assert alone.stop == "sparsity" and alone.toarray().shape == (128,)


def test_a_residual_ends_the_pursuit(random):
    X = random.standard_normal((64, 128))
    Y = random.standard_normal((64, 3))
    solution = ns.omp.Dictionary(X).solve(Y, residual=[0.5, 0.3, 0.1])
    assert (np.asarray(solution.residual) <= [0.5, 0.3, 0.1]).all()
    assert solution.stop == ["residual"] * 3 and (np.diff((solution.support >= 0).sum(1)) > 0).all()


def test_spams_begins_with_our_atom_and_is_another_pursuit(random):
    """SPAMS chooses the atom after which the least remains (ORMP), scikit-learn and nirspi the atom that correlates
    best with what remains. The first atom is the same."""
    spams = pytest.importorskip("spams")
    X = np.asfortranarray(random.standard_normal((128, 256)))
    X /= np.linalg.norm(X, axis=0)
    Y = np.asfortranarray(random.standard_normal((128, 200)))
    dictionary = ns.omp.Dictionary(X)
    # Without eps=0. SPAMS returns at once with nothing.
    first = spams.omp(Y, X, L=1, eps=0.0, numThreads=1).toarray()
    assert np.allclose(first, dictionary.solve(Y, n_nonzero_coefs=1).toarray(), atol=1e-6)
    many = spams.omp(Y, X, L=20, eps=0.0, numThreads=1).toarray()
    left = [
        np.linalg.norm(Y - X @ found) for found in (many, dictionary.solve(Y, n_nonzero_coefs=20).toarray())
    ]
    assert 0.9 < left[0] / left[1] <= 1.0
