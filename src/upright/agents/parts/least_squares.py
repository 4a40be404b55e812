"""Least squares by its normal equations: what agents that fit something share."""

import math

from upright.core.compiled import compiled


@compiled
def factorise(matrix, factor):
    """Set the lower triangular Cholesky factor of a symmetric positive definite matrix."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(total) if i == j else total / factor[j, j]


@compiled
def solve(factor, right_side, solution):
    """Solve for the solution of the equations whose matrix was factorised."""
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
