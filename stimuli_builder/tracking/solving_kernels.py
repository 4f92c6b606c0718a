"""Compiled loops of the normal equations of one step: the Hessian from its forms, and Cholesky; float64."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import numpy as np

from stimuli_builder.compiled import compiled


@compiled
def quadratic(forms, c, out):
    """out (M,) = sum over pairs i <= j of c_i c_j forms (pairs, M), with c_0 = 1."""
    pairs = forms.shape[0]
    weights = np.empty(pairs)
    pair = 0
    for i in range(c.shape[0] + 1):
        for j in range(i, c.shape[0] + 1):
            weights[pair] = (1.0 if i == 0 else c[i - 1]) * (1.0 if j == 0 else c[j - 1])
            pair += 1
    out[:] = 0.0
    pair = 0
    while pair + 4 <= pairs:
        w0, w1, w2, w3 = weights[pair], weights[pair + 1], weights[pair + 2], weights[pair + 3]
        f0, f1, f2, f3 = forms[pair], forms[pair + 1], forms[pair + 2], forms[pair + 3]
        for x in range(out.shape[0]):
            out[x] += (w0 * f0[x] + w1 * f1[x]) + (w2 * f2[x] + w3 * f3[x])
        pair += 4
    while pair < pairs:
        f0, w0 = forms[pair], weights[pair]
        for x in range(out.shape[0]):
            out[x] += w0 * f0[x]
        pair += 1


@compiled
def hessian(forms, c, out):
    """Lower triangle of the Hessian (K, K) at c, from forms float64 (pairs, K (K + 1) / 2)."""
    flat = np.empty(forms.shape[1])
    quadratic(forms, c, flat)
    entry = 0
    for row in range(out.shape[0]):
        for column in range(row + 1):
            out[row, column] = flat[entry]
            entry += 1


@compiled
def solve(matrix, right):
    """Solve matrix x = right in place by Cholesky, lower triangle given; False if not positive definite."""
    size = right.shape[0]
    for j in range(size):
        diagonal = matrix[j, j]
        for k in range(j):
            diagonal -= matrix[j, k] * matrix[j, k]
        if not diagonal > 0.0:
            return False
        root = np.sqrt(diagonal)
        matrix[j, j] = root
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / root
    for i in range(size):
        value = right[i]
        for k in range(i):
            value -= matrix[i, k] * right[k]
        right[i] = value / matrix[i, i]
    for i in range(size - 1, -1, -1):
        value = right[i]
        for k in range(i + 1, size):
            value -= matrix[k, i] * right[k]
        right[i] = value / matrix[i, i]
    return True
