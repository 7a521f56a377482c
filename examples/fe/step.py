#!/usr/bin/env python3
"""Runs the step that stands at the end of decks as comments, in CalculiX, and draws the stresses.

  python step.py [FOLDER]                stresses of a lug, and a check of the forces in a block
  python step.py JOB.frd MESH.vtu PNG    a picture of the stresses in the results of a job

Needs ccx (Debian: calculix-ccx) and isoform on the PATH, and numpy, meshio, matplotlib. Files go to
FOLDER [fe-step].
"""
import pathlib
import re
import subprocess
import sys

import meshio
import numpy as np

from calculix import stresses
from part import picture, von_mises

LUG = pathlib.Path(__file__).parent / "lug.hf"
# A block of two materials: what lies below z = 0.5 is its core. Its sides are 4, 1 and 1 long.
BLOCK = """-- @unit mm
core(x[3], a[1]) { core = 0.5 - x[3]; }
block(x[3], a[1]) { array c[3]; c = [0, 0, 0]; block = hfBlock(x, c, 4, 1, 1); }
"""
AREAS = {"X": 1, "Y": 4, "Z": 4}


def run(folder, job, *command):
    """Writes the deck of a model with its step, and runs it."""
    deck = folder / f"{job}.inp"
    subprocess.run(["isoform", "mesh", *map(str, command), "-o", str(deck), "-o", str(deck.with_suffix(".vtu")), "-q"],
                   check=True, stdout=subprocess.DEVNULL)
    mesh, step = re.split(r"(?<=\n)\*\* STEP.*\n", deck.read_text())
    deck.write_text(mesh + re.sub(r"^\*\*", "", step, flags=re.M))
    said = subprocess.run(["ccx", job], cwd=folder, capture_output=True, text=True).stdout
    assert "Job finished" in said and "*ERROR" not in said, said
    return step


def reaction(path):
    """The sum of the forces on the held nodes."""
    rows = (line.split() for line in open(path))
    return sum(np.array([float(v) for v in row[1:]]) for row in rows if len(row) == 4 and row[0].isdigit())


def draw(results, mesh, path):
    mesh = meshio.read(mesh)
    stress = von_mises(stresses(results, len(mesh.points)))
    triangles = mesh.cells_dict.get("triangle6", mesh.cells_dict.get("triangle"))
    picture(mesh.points, triangles, stress, path, "the load of the deck")


def main(folder):
    folder.mkdir(exist_ok=True)
    for order in "12":
        (folder / "block.hf").write_text(BLOCK)
        step = run(folder, "block", folder / "block.hf", "--object", "block", "--regions", "core",
                   "--size", "0.25", "--order", order)
        pressed = re.search(r"DSLOAD\n\*\*(\w+), P, ", step)[1]
        axis = re.search("[XYZ](?=_M)", pressed)[0]
        force = reaction(folder / "block.dat")
        error = abs(np.linalg.norm(force) - AREAS[axis])
        print(f"order {order}: 1 N/mm^2 on {pressed} of {AREAS[axis]} mm^2, {np.linalg.norm(force):.6f} N on the support")
        assert error < 1e-3 and abs(abs(force["XYZ".index(axis)]) - AREAS[axis]) < 1e-3, force
    run(folder, "lug", LUG, "--size", "3", "--order", "2")
    draw(folder / "lug.frd", folder / "lug.vtu", folder / "stress.png")


if __name__ == "__main__":
    if len(sys.argv) == 4:
        draw(*sys.argv[1:])
    else:
        main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-step"))
