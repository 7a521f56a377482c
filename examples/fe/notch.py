#!/usr/bin/env python3
"""A notched bar in meshes that follow an error estimate, with CalculiX.

  python notch.py [FOLDER]

The stress at the bottom of a sharp notch has no bound: elements there decide how exact the energy
is. Each mesh has its elements where the error of the last one was. With equal elements the error
falls as their number to the power of -0.17, as the stress grows as the distance to the power of
-0.49; adapted elements, as long as they are wide, get to -0.51. Needs isoform and ccx (Debian:
calculix-ccx) on the PATH, and numpy, meshio, matplotlib. Files go to FOLDER [fe-notch].
"""
import os
import pathlib
import subprocess
import sys

import matplotlib
import meshio
import numpy as np

import sizes
from calculix import stresses

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MODEL = """-- a bar with a notch of 60 degrees to the middle of its height
bar(x[3], a[1])
{
  array v[3];
  v = [-2, 0, 0];
  block = hfBlock(x, v, 4, 1, 0.5);
  left = x[2] - 0.5 - sqrt(3)*x[1];
  right = x[2] - 0.5 + sqrt(3)*x[1];
  bar = block \\ (left & right);
}
"""
YOUNG, POISSON, PULL = 210000.0, 0.3, 100.0  # MPa
DECK = f"""*INCLUDE, INPUT=mesh.inp
*MATERIAL, NAME=STEEL
*ELASTIC
{YOUNG}, {POISSON}
*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL
*BOUNDARY
BLOCK_X_MIN, 1, 3
*STEP
*STATIC
*DSLOAD
BLOCK_X_MAX, P, {-PULL}
*EL FILE
S
*EL PRINT, ELSET=SOLID
S
*EL PRINT, ELSET=SOLID, TOTALS=ONLY
ELSE
*END STEP
"""
FIRST = 0.3  # edge length of the first mesh
GROWTH = 2.0  # elements of a mesh, in those of the mesh before
MOST = 12_000  # elements after which no other mesh is made
EXACT = 0.08334  # energy (N mm) that four adapted meshes of up to 82,000 elements tend to
# Where CalculiX knows the stress of a tetrahedron of ten nodes: barycentric coordinates.
NEAR, FAR = 0.585410196624969, 0.138196601125011
INNER = FAR + (NEAR - FAR) * np.eye(4)


def meshed(folder, *arguments):
    """Nodes, and tetrahedra of ten nodes."""
    outputs = [word for name in ("mesh.inp", "mesh.vtu") for word in ("-o", folder / name)]
    command = ["isoform", "mesh", folder / "bar.hf", "--quiet", "--order", 2, *outputs, *arguments]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    read = meshio.read(folder / "mesh.vtu")
    return read.points, read.cells_dict["tetra10"]


def solve(folder, points):
    """Stresses at the nodes, those in the elements, and the energy of the bar."""
    (folder / "job.inp").write_text(DECK)
    threads = {**os.environ, "OMP_NUM_THREADS": "2"}
    subprocess.run(["ccx", "job"], cwd=folder, check=True, stdout=subprocess.DEVNULL, env=threads)
    rows, energy, section = [], None, None
    for line in open(folder / "job.dat"):
        words = line.split()
        if words and words[0][0].isalpha():
            section = line.strip()
        elif words and section.startswith("stresses"):
            rows.append([float(word) for word in words[2:8]])
        elif words and section.startswith("total internal energy"):
            energy = float(words[-1])
    return stresses(folder / "job.frd", len(points)), np.array(rows).reshape(-1, 4, 6), energy


def estimate(volumes, tets, at_nodes, inside):
    """The error of each element: its stresses against those interpolated between the means at its
    corners, in the norm of the energy (Zienkiewicz and Zhu 1987)."""
    # The first point is the one next to the first corner, and so on.
    means = np.einsum("pc,ecs->eps", INNER, at_nodes[tets[:, :4]])
    d = inside - means
    normal, shear = d[:, :, :3], d[:, :, 3:]
    trace = normal.sum(axis=2)
    squares = np.sum(normal**2, axis=2) + 2 * np.sum(shear**2, axis=2)
    density = ((1 + POISSON) * squares - POISSON * trace**2) / YOUNG
    return np.sqrt(volumes * density.mean(axis=1))


def main(folder):
    folder.mkdir(exist_ok=True)
    (folder / "bar.hf").write_text(MODEL)
    for name in ("equal", "adapted"):
        found, arguments, size = [], ["--size", FIRST], FIRST
        while not found or found[-1][0] < MOST:
            points, tets = meshed(folder, *arguments)
            corners = points[tets[:, :4]]
            volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
            at_nodes, inside, energy = solve(folder, points)
            errors = estimate(volumes, tets, at_nodes, inside)
            # Less energy than the exact solution has is the square of the error.
            error, guess = np.sqrt(1 - energy / EXACT), np.sqrt(np.sum(errors**2) / (2 * energy))
            found.append((len(tets), error))
            said = f"{len(tets):6d} tetrahedra, error {error:.4f}, estimated {guess:.4f}"
            print(f"{name:8s} {said}", flush=True)
            size /= GROWTH ** (1 / 3)
            arguments = ["--size", size]
            if name == "adapted":
                lengths = sizes.wanted(volumes, errors, GROWTH, order=2)
                sizes.write(folder / "sizes.csv", corners.mean(axis=1), lengths)
                arguments = ["--size", 1.5 * FIRST, "--sizes", folder / "sizes.csv"]
        count, off = np.log(found).T
        print(f"{name}: error as the number to {np.polyfit(count, off, 1)[0]:.2f}")
        plt.loglog(*np.array(found).T, "o-", label=name)
    plt.xlabel("tetrahedra of ten nodes")
    plt.ylabel("error in the energy norm, as a share")
    plt.legend()
    plt.savefig(folder / "convergence.png", dpi=120, bbox_inches="tight")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-notch"))
