"""The graph of the mesh and its spectrum (paper Sec. 2.3, Eq. 9 to 12).

Sign convention: L = D - A is positive semi-definite.
"""

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh

from intervis.arrays import BoolArray, Float64Array, IntArray

DENSE_LIMIT = 400
"""Up to this many nodes a dense eigenvalue solver is faster, and it always converges."""


def adjacency(edges: IntArray, weights: Float64Array, nodes: int) -> csr_array:
    """(V, V) symmetric adjacency matrix A of undirected edges."""
    row = np.concatenate([edges[:, 0], edges[:, 1]])
    column = np.concatenate([edges[:, 1], edges[:, 0]])
    return csr_array((np.concatenate([weights, weights]), (row, column)), shape=(nodes, nodes))


def laplacian(adjacency_matrix: csr_array) -> csr_array:
    """L = D - A (Eq. 9): symmetric, positive semi-definite, rows that sum to zero.

    For any f, f^T L f = 1/2 sum over r, c of w_rc (f_r - f_c)^2 (Eq. 11).

    Examples
    --------
    >>> laplacian(adjacency(np.array([[0, 1]]), np.array([2.0]), 2)).toarray()
    array([[ 2., -2.],
           [-2.,  2.]])
    """
    return csr_array(diags_array(degrees(adjacency_matrix)) - adjacency_matrix)


def normalized_laplacian(adjacency_matrix: csr_array) -> csr_array:
    """D^-1/2 L D^-1/2 (Eq. 10), with D^-1/2 = 0 for a node without edges.

    Equal to I - D^-1/2 A D^-1/2 on the nodes that have edges. Eigenvalues lie between 0 and 2.
    """
    degree = degrees(adjacency_matrix)
    root = diags_array(np.divide(1.0, np.sqrt(degree), out=np.zeros_like(degree), where=degree > 0))
    return csr_array(root @ laplacian(adjacency_matrix) @ root)


def degrees(adjacency_matrix: csr_array) -> Float64Array:
    """(V,) weighted degrees: the row sums of A, the diagonal of D."""
    return np.asarray(adjacency_matrix.sum(axis=1), dtype=np.float64).ravel()


def cut(edges: IntArray, weights: Float64Array, chosen: BoolArray) -> float:
    """The decomposition SD (Eq. 12): half the weight of the edges between `chosen` and the rest.

    Examples
    --------
    >>> path = np.array([[0, 1], [1, 2]])
    >>> cut(path, np.array([3.0, 5.0]), np.array([True, True, False]))
    2.5
    """
    crossing = chosen[edges[:, 0]] != chosen[edges[:, 1]]
    return float(weights[crossing].sum()) / 2


def fiedler_side(adjacency_matrix: csr_array) -> BoolArray:
    """(V,) sides of the cut by the signs of the Fiedler vector.

    That is the second eigenvector of the normalised Laplacian, here of the largest connected
    component; nodes outside of it are False. The component's lowest-numbered node is False.
    """
    side = np.zeros(adjacency_matrix.shape[0], bool)
    if not len(side):
        return side
    component = connected_components(adjacency_matrix, directed=False)[1]
    largest = np.flatnonzero(component == np.bincount(component).argmax())
    if len(largest) < 2:
        return side
    matrix = normalized_laplacian(csr_array(adjacency_matrix[largest][:, largest]))
    if len(largest) <= DENSE_LIMIT:
        vector = np.linalg.eigh(matrix.toarray())[1][:, 1]
    else:
        start = np.random.default_rng(0).standard_normal(len(largest))
        value, vectors = eigsh(matrix, k=2, sigma=-1e-3, v0=start)  # those nearest to sigma
        vector = vectors[:, np.argmax(value)]
    positive = vector > 0
    side[largest] = positive != positive[0]
    return side
