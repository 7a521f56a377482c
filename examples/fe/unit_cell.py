#!/usr/bin/env python3
"""A unit cell of two materials with scikit-fem: how well a cubic array of balls conducts heat.

  python unit_cell.py [FOLDER]

Balls that conduct ten times as well as what is around them fill a fifth of space, one in each cube.
Opposite sides of the mesh have one and the same nodes, so that the temperature is made periodic by
giving each pair one unknown. Where the cell begins must not matter: once the ball is in the middle
of the cell, once it goes over all of its sides. Rayleigh's series for such arrays (1892, as
corrected by Runge) is right to 1e-3 here. Needs isoform on the PATH, and numpy, scipy, meshio,
scikit-fem. Files go to FOLDER [fe-unit-cell].
"""
import itertools
import pathlib
import subprocess
import sys

import meshio
import numpy as np
import skfem as fem
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from skfem.helpers import dot, grad

SHARE = 0.2  # of the volume that is balls
CONDUCTS = {"ball": 10.0, "rest": 1.0}
SIZE = 0.12
CELLS = {"middle": (0.5, 0.5, 0.5), "sides": (0.1, 0.95, 0.0)}


def model(center):
    """A program of the balls that reach into the unit cube, and of a matrix around them."""
    radius = (SHARE * 3 / 4 / np.pi) ** (1 / 3)
    shifts = itertools.product((-1, 0, 1), repeat=3)
    places = [[c + d for c, d in zip(center, shift)] for shift in shifts]
    balls = [
        f"({radius**2} - " + " - ".join(f"(x[{i + 1}] - ({v}))^2" for i, v in enumerate(place)) + ")"
        for place in places
    ]
    return (
        "ball(x[3], a[1]) { ball = " + " | ".join(balls) + "; }\n"
        "cell(x[3], a[1]) { array c[3]; c = [-1, -1, -1]; cell = hfBlock(x, c, 3, 3, 3); }\n"
    )


def rayleigh():
    """The conductivity of a simple cubic array, in that of the matrix."""
    k = CONDUCTS["ball"] / CONDUCTS["rest"]
    far = 0.523 * (1 - k) / (4 / 3 + k) * SHARE ** (10 / 3)
    return 1 - 3 * SHARE / ((2 + k) / (1 - k) + SHARE - far)


def meshed(folder, name, center):
    """Tetrahedra of second order, and the conductivity of each."""
    source, path = folder / f"{name}.hf", folder / f"{name}.vtu"
    source.write_text(model(center))
    command = ["isoform", "mesh", source, "--object", "cell", "--regions", "ball", "--quiet"]
    command += ["--box=0,0,0,1,1,1", "--periodic", "xyz", "--order", 2, "--size", SIZE, "-o", path]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    read = meshio.read(path)
    at = [k for k, cells in enumerate(read.cells) if cells.type == "tetra10"][0]
    region = np.asarray(read.cell_data["region"][at]).ravel()
    mesh = fem.MeshTet2(read.points.T.copy(), read.cells[at].data.T.copy())
    return mesh, np.array([CONDUCTS["ball"], CONDUCTS["rest"]])[region.astype(int) - 1]


def conductivity(mesh, conducts):
    """What the cell conducts along x: the least energy of a unit gradient with periodic waves."""
    basis = fem.Basis(mesh, fem.ElementTetP2(), intorder=4)
    values = np.repeat(conducts[:, None], basis.X.shape[1], axis=1)
    form = fem.BilinearForm(lambda u, v, w: w["k"] * dot(grad(u), grad(v)))
    stiffness = form.assemble(basis, k=values)
    # Unknowns that are one lie at one place of the torus.
    place = np.round(basis.doflocs.T, 9) % 1.0
    _, one = np.unique(place, axis=0, return_inverse=True)
    one = one.ravel()
    many = np.arange(len(one))
    joined = coo_matrix((np.ones(len(one)), (many, one))).tocsr()
    slope = basis.doflocs[0]
    reduced = (joined.T @ stiffness @ joined).tocsc()
    right = -joined.T @ (stiffness @ slope)
    wave = np.zeros(reduced.shape[0])
    wave[1:] = spsolve(reduced[1:, 1:], right[1:])
    whole = slope + joined @ wave
    return whole @ (stiffness @ whole), joined.shape


def main(folder):
    folder.mkdir(exist_ok=True)
    wanted = rayleigh()
    print(f"Rayleigh's series: {wanted:.5f}")
    found = []
    for name, center in CELLS.items():
        mesh, conducts = meshed(folder, name, center)
        value, (many, ones) = conductivity(mesh, conducts)
        found.append(value)
        print(
            f"{name}: {mesh.nelements} tetrahedra, {many} unknowns of which {many - ones} are those"
            f" of another side, conducts {value:.5f}"
        )
    off = max(abs(value / wanted - 1) for value in found)
    print(f"off by {off:.1e} at most; the cells differ by {abs(found[0] - found[1]):.1e}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-unit-cell"))
