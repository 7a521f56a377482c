#!/usr/bin/env python3
"""From a scan to stresses with CalculiX: scan, fit, tetrahedra, ccx, picture.

  python calculix.py [FOLDER]

Needs isoform and ccx (Debian: calculix-ccx) on the PATH, and numpy, meshio, matplotlib. Files go to FOLDER [fe-calculix].
"""
import pathlib
import subprocess
import sys

import numpy as np

from part import POISSON, PULL, YOUNG, picture, read, recover, von_mises

DECK = f"""*INCLUDE, INPUT=part.inp
*MATERIAL, NAME=STEEL
*ELASTIC
{YOUNG}, {POISSON}
*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL
*BOUNDARY
BOX_X_MIN, 1, 3
*STEP
*STATIC
*DSLOAD
BOX_X_MAX, P, {-PULL}
*NODE FILE
U
*EL FILE
S
*END STEP
"""


def stresses(frd, count):
    """Six components per node out of a result file of CalculiX; columns of fixed width."""
    s = np.zeros((count, 6))
    inside = False
    for line in open(frd):
        if line.startswith(" -4"):
            inside = line.split()[1] == "STRESS"
        elif inside and line.startswith(" -3"):
            break
        elif inside and line.startswith(" -1"):
            s[int(line[3:13]) - 1] = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(6)]
    return s


def main(folder):
    folder.mkdir(exist_ok=True)
    made = recover(folder, "part.inp", "part.vtu")
    (folder / "job.inp").write_text(DECK)
    subprocess.run(["ccx", "job"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    points, _, parts = read(folder / "part.vtu", made["parts"])
    stress = von_mises(stresses(folder / "job.frd", len(points)))
    picture(points, np.concatenate(list(parts.values())), stress, folder / "stress.png")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "fe-calculix"))
