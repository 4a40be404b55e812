"""Least squares by its normal equations, for agents that fit something."""

import math

from upright.core.compiled import inlined


@inlined
def factorise(matrix, factor):
    """Set L, lower triangular, with L Lᵀ = A: the Cholesky factor of a positive definite matrix A.

    Only the lower triangle of A is read.
    """
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(total) if i == j else total / factor[j, j]


@inlined
def solve(factor, right_side, solution):
    """Solve A x = b, given the Cholesky factor L of A: L y = b forwards, Lᵀ x = y backwards."""
    for i in range(len(solution)):
        total = right_side[i]
        for k in range(i):
            total -= factor[i, k] * solution[k]
        solution[i] = total / factor[i, i]
    for i in range(len(solution) - 1, -1, -1):
        total = solution[i]
        for k in range(i + 1, len(solution)):
            total -= factor[k, i] * solution[k]
        solution[i] = total / factor[i, i]
