import numpy as np
import pytest

from upright.agents.parts.least_squares import factorise, solve


@pytest.fixture
def matrix():
    root = np.random.default_rng(9).normal(size=(11, 11))
    return root @ root.T + 0.1 * np.eye(11)


def test_the_factor_is_that_of_cholesky(matrix):
    factor = np.zeros((11, 11))
    factorise(matrix, factor)
    assert factor == pytest.approx(np.linalg.cholesky(matrix), rel=1e-9, abs=1e-12)


def test_only_the_lower_triangle_is_read(matrix):
    whole, lower = np.zeros((11, 11)), np.zeros((11, 11))
    factorise(matrix, whole)
    factorise(np.tril(matrix), lower)
    np.testing.assert_array_equal(whole, lower)


def test_solve_is_a_linear_solver(matrix):
    right_side = np.random.default_rng(2).normal(size=11)
    factor, solution = np.zeros((11, 11)), np.zeros(11)
    factorise(matrix, factor)
    solve(factor, right_side, solution)
    assert solution == pytest.approx(np.linalg.solve(matrix, right_side), rel=1e-9)
