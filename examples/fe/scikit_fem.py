#!/usr/bin/env python3
"""From a scan to stresses with scikit-fem: scan, fit, tetrahedra, solution, picture.

  python scikit_fem.py [FOLDER]

Needs isoform on the PATH, and numpy, scipy, meshio, scikit-fem, matplotlib. Files go to FOLDER [fe-scikit].
"""
import pathlib
import sys

import numpy as np
import skfem as fem
from scipy.sparse.linalg import LinearOperator, cg
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from part import POISSON, PULL, YOUNG, picture, read, recover, von_mises


def facets(mesh, triangles):
    """Numbers of the facets with the corners of these triangles."""
    number = {tuple(f): i for i, f in enumerate(np.sort(mesh.facets, axis=0).T.tolist())}
    return np.array([number[tuple(t)] for t in np.sort(triangles, axis=1).tolist()])


def solve(basis, clamped, pulled):
    """Displacement under a pull along x."""
    stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
    face = fem.FacetBasis(basis.mesh, basis.elem, facets=pulled, intorder=4)
    load = fem.LinearForm(lambda v, w: PULL * dot(v, np.array([1.0, 0, 0])[:, None, None] * np.ones_like(v))).assemble(face)
    A, b, x, free = fem.condense(stiffness, load, D=basis.get_dofs(clamped))
    diagonal = A.diagonal()
    x[free], info = cg(A, b, rtol=1e-8, M=LinearOperator(A.shape, lambda r: r / diagonal))
    assert info == 0, "conjugate gradients did not converge"
    return x


def nodal_stress(basis, u):
    """Von Mises stress at the corners, the mean of the elements' values there."""
    lame, shear = lame_parameters(YOUNG, POISSON)
    g = basis.interpolate(u).grad.mean(axis=-1)
    strain = 0.5 * (g + g.transpose(1, 0, 2))
    s = 2 * shear * strain + lame * np.einsum("iie->e", strain) * np.eye(3)[:, :, None]
    stress = von_mises(np.array([s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[1, 2], s[2, 0]]).T)
    corners = basis.mesh.t
    weight = np.bincount(corners.ravel(), minlength=corners.max() + 1)
    return np.bincount(corners.ravel(), np.tile(stress, 4), corners.max() + 1) / np.maximum(weight, 1)


def main(folder):
    folder.mkdir(exist_ok=True)
    made = recover(folder, "part.vtu")
    points, tets, parts = read(folder / "part.vtu", made["parts"])
    # Corners first: scikit-fem numbers the mid-edge unknowns by itself.
    used, corner = np.unique(tets[:, :4], return_inverse=True)
    mesh = fem.MeshTet(points[used].T.copy(), corner.reshape(-1, 4).T.copy())
    new = np.zeros(len(points), int)
    new[used] = np.arange(len(used))
    triangles = {name: new[t[:, :3]] for name, t in parts.items()}
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTetP2()), intorder=2)
    u = solve(basis, facets(mesh, triangles["box.x_min"]), facets(mesh, triangles["box.x_max"]))
    picture(mesh.p.T, np.concatenate(list(triangles.values())), nodal_stress(basis, u), folder / "stress.png")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-scikit"))
