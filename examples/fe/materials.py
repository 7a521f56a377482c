#!/usr/bin/env python3
"""Two materials in one mesh: a ball with a heated core, solved with scikit-fem.

  python materials.py [FOLDER]

The core conducts heat ten times as well as the shell and is heated evenly; the surface is kept at
0. Inside the core the temperature is a parabola of the radius, in the shell it falls as 1/r:
elements of second order whose faces lie on the interface follow the bend there. The energy that is
missing falls as the number of elements to the power of about -4/3, as for a smooth solution. Needs
isoform on the PATH, and numpy, scipy, meshio, scikit-fem. Files go to FOLDER [fe-materials].
"""
import pathlib
import subprocess
import sys

import meshio
import numpy as np
import skfem as fem
from scipy.sparse.linalg import spsolve
from skfem.helpers import dot, grad

MODEL = """-- a ball with a core
core(x[3], a[1]) { core = 0.5^2 - x[1]^2 - x[2]^2 - x[3]^2; }
ball(x[3], a[1]) { ball = 1 - x[1]^2 - x[2]^2 - x[3]^2; }
"""
CORE = 0.5  # radius of the core; that of the ball is 1
CONDUCTS = {"core": 10.0, "rest": 1.0}
HEAT = 6.0  # per volume of the core
SIZES = (0.4, 0.28, 0.2, 0.14)


def energy():
    """The integral of conductivity times the squared gradient of the exact solution.

    In the core T' = -q r / (3 k), in the shell T' = -q R^3 / (3 r^2) for a conductivity of 1.
    """
    inner = 4 * np.pi * (HEAT / 3) ** 2 / CONDUCTS["core"] * CORE**5 / 5
    outer = 4 * np.pi * (HEAT * CORE**3 / 3) ** 2 / CONDUCTS["rest"] * (1 / CORE - 1)
    return inner + outer


def meshed(folder, size):
    """Tetrahedra of second order, and the conductivity of each."""
    path = folder / "ball.vtu"
    command = ["isoform", "mesh", folder / "ball.hf", "--object", "ball", "--regions", "core"]
    command += ["--order", 2, "--size", size, "--quiet", "-o", path]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    read = meshio.read(path)
    at = [k for k, cells in enumerate(read.cells) if cells.type == "tetra10"][0]
    # Regions are numbered from 1 in the order of --regions; what is left is the last.
    region = np.asarray(read.cell_data["region"][at]).ravel()
    mesh = fem.MeshTet2(read.points.T.copy(), read.cells[at].data.T.copy())
    return mesh, np.array([CONDUCTS["core"], CONDUCTS["rest"]])[region.astype(int) - 1]


def solve(mesh, conductivity):
    """Energy of the solution by finite elements."""
    basis = fem.Basis(mesh, fem.ElementTetP2(), intorder=4)
    values = np.repeat(conductivity[:, None], basis.X.shape[1], axis=1)
    heated = (values == CONDUCTS["core"]) * HEAT
    form = fem.BilinearForm(lambda u, v, w: w["k"] * dot(grad(u), grad(v)))
    stiffness = form.assemble(basis, k=values)
    load = fem.LinearForm(lambda v, w: w["q"] * v).assemble(basis, q=heated)
    matrix, right, x, free = fem.condense(stiffness, load, D=basis.get_dofs())
    x[free] = spsolve(matrix, right)
    return x @ (stiffness @ x)


def main(folder):
    folder.mkdir(exist_ok=True)
    (folder / "ball.hf").write_text(MODEL)
    count, missing = [], []
    for size in SIZES:
        mesh, conductivity = meshed(folder, size)
        count.append(mesh.nelements)
        missing.append(abs(energy() - solve(mesh, conductivity)) / energy())
        print(f"size {size}: {count[-1]} tetrahedra, energy off by {missing[-1]:.2e}")
    order = np.polyfit(np.log(count), np.log(missing), 1)[0]
    print(f"the error falls as the number of elements to the power of {order:.2f}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-materials"))
