#!/usr/bin/env python3
"""Meshes that follow an error estimate: solve, estimate, mesh again, with scikit-fem.

  python adaptive.py [FOLDER]

An L-shaped bar and the equation of Laplace, whose solution r^(2/3) sin(2/3 angle) has no bounded
gradient at the inner edge. With equal elements the error falls as their number to the power of
-2/9 there, whatever the order; with elements where the error is, as to -1/3, as for a smooth
solution. Needs isoform on the PATH, and numpy, scipy, meshio, scikit-fem, matplotlib. Files go to
FOLDER [fe-adaptive].
"""
import pathlib
import subprocess
import sys

import matplotlib
import meshio
import numpy as np
import skfem as fem
from scipy.sparse.linalg import LinearOperator, cg
from skfem.helpers import dot, grad

import sizes

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MODEL = """-- an L-shaped bar: its inner edge is the z axis
bar(x[3], a[1])
{
  array v[3], w[3];
  v = [-1, -1, 0]; w = [0, -1, -0.5];
  bar = hfBlock(x, v, 2, 2, 0.5) \\ hfBlock(x, w, 1, 1, 1.5);
}
"""
FIRST = 0.25  # edge length of the first mesh
GROWTH = 2.0  # elements of a mesh, in those of the mesh before
MOST = 60_000  # elements after which no other mesh is made


def exact(x):
    """The solution: 0 on both faces at the inner edge."""
    angle = np.mod(np.arctan2(x[1], x[0]), 2 * np.pi)
    return np.hypot(x[0], x[1]) ** (2 / 3) * np.sin(2 / 3 * angle)


def exact_gradient(x):
    r, angle = np.hypot(x[0], x[1]), np.mod(np.arctan2(x[1], x[0]), 2 * np.pi)
    scale = 2 / 3 * r ** (-1 / 3)
    return np.array([-scale * np.sin(angle / 3), scale * np.cos(angle / 3), 0 * r])


def meshed(folder, name, *arguments):
    """Tetrahedra of the model."""
    path = folder / f"{name}.vtu"
    command = ["isoform", "mesh", folder / "bar.hf", "--quiet", "-o", path, *arguments]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    read = meshio.read(path)
    return fem.MeshTet(read.points.T.copy(), read.cells_dict["tetra"].T.copy())


def solve(basis):
    """The finite element solution with the exact values on all of the boundary."""
    stiffness = fem.BilinearForm(lambda u, v, w: dot(grad(u), grad(v))).assemble(basis)
    x = exact(basis.doflocs)
    A, b, x, free = fem.condense(stiffness, x=x, D=basis.get_dofs())
    diagonal = A.diagonal()
    x[free], info = cg(A, b, rtol=1e-9, M=LinearOperator(A.shape, lambda r: r / diagonal))
    assert info == 0, "conjugate gradients did not converge"
    return x


def estimate(basis, u):
    """The error of each element: its gradient against the means of those around its corners
    (Zienkiewicz and Zhu 1987)."""
    mesh = basis.mesh
    gradients = basis.interpolate(u).grad[:, :, 0]
    volumes = basis.dx.sum(axis=1)
    weights = np.bincount(mesh.t.ravel(), np.tile(volumes, 4))
    means = [np.bincount(mesh.t.ravel(), np.tile(volumes * g, 4)) / weights for g in gradients]
    # The square of a linear function over a tetrahedron, from its values at the corners.
    d = np.array([m[mesh.t] - g for m, g in zip(means, gradients)])
    squares = (np.sum(d**2, axis=(0, 1)) + np.sum(d.sum(axis=1) ** 2, axis=0)) * volumes / 20
    return np.sqrt(squares)


def error(basis, u):
    """The true error of the gradient, as a share of it."""
    fine = fem.Basis(basis.mesh, basis.elem, intorder=6)
    g = exact_gradient(fine.global_coordinates().value)
    off = np.sum((fine.interpolate(u).grad - g) ** 2, axis=0)
    return np.sqrt(np.sum(off * fine.dx) / np.sum(np.sum(g**2, axis=0) * fine.dx))


def step(mesh):
    basis = fem.Basis(mesh, fem.ElementTetP1(), intorder=2)
    u = solve(basis)
    return basis, u, error(basis, u)


def adapted(folder):
    """Numbers of elements and errors of meshes that follow the estimate."""
    found, arguments = [], ["--size", FIRST]
    while not found or found[-1][0] < MOST:
        mesh = meshed(folder, f"adapted{len(found)}", *arguments)
        basis, u, off = step(mesh)
        found.append((mesh.t.shape[1], off))
        print(f"adapted  {found[-1][0]:7d} tetrahedra, error {off:.4f}", flush=True)
        lengths = sizes.wanted(basis.dx.sum(axis=1), estimate(basis, u), GROWTH, order=1)
        table = folder / f"sizes{len(found)}.csv"
        sizes.write(table, mesh.p[:, mesh.t].mean(axis=1).T, lengths)
        arguments = ["--size", 2 * FIRST, "--sizes", table]
    return found


def equal(folder):
    """The same of meshes of equal elements."""
    found, size = [], FIRST
    while not found or found[-1][0] < MOST:
        mesh = meshed(folder, f"equal{len(found)}", "--size", size)
        found.append((mesh.t.shape[1], step(mesh)[2]))
        print(f"equal    {found[-1][0]:7d} tetrahedra, error {found[-1][1]:.4f}", flush=True)
        size /= GROWTH ** (1 / 3)
    return found


def rate(found):
    """The power of the number of elements with which the error falls, over the last half."""
    count, off = np.log(np.array(found[len(found) // 2 :])).T
    return np.polyfit(count, off, 1)[0]


def main(folder):
    folder.mkdir(exist_ok=True)
    (folder / "bar.hf").write_text(MODEL)
    runs = {"equal": equal(folder), "adapted": adapted(folder)}
    for (name, found), optimal in zip(runs.items(), (-2 / 9, -1 / 3)):
        print(f"{name}: error as the number to {rate(found):.3f}, in theory {optimal:.3f}")
        plt.loglog(*np.array(found).T, "o-", label=name)
    plt.xlabel("tetrahedra")
    plt.ylabel("error of the gradient")
    plt.legend()
    plt.savefig(folder / "convergence.png", dpi=120, bbox_inches="tight")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-adaptive"))
