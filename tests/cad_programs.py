#!/usr/bin/env python3
"""Runs the CAD programs that `isoform recover` writes, and compares their volumes.

    cad_programs.py build123d|cadquery|openscad PROGRAM

A part of known volume is meshed, recovered from the vertices without a template, and written as a
program, which is run here (build123d, CadQuery) or by `openscad`.
"""
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# Each part with its volume.
PARTS = {
    "plate": (
        """m(x[3], a[1]) {
          array c[3];
          c[1] = 8; c[2] = 6; c[3] = 0; bore = hfCylinderZ(x, c, 3);
          c[1] = 22; one = hfCylinderZ(x, c, 2);
          m = (x[1] & (30 - x[1]) & x[2] & (12 - x[2]) & x[3] & (5 - x[3])) \\ bore \\ one;
        }""",
        30 * 12 * 5 - math.pi * (9 + 4) * 5,
    ),
    "nozzle": (
        """m(x[3], a[1]) {
          array c[3];
          c[1] = 0; c[2] = 0; c[3] = 20;
          cone = hfDConeZ(x, c, 0.5) & (20 - x[3]);
          hole = hfCylinderZ(x, c, 2);
          m = (cone & x[3] & (10 - x[3])) \\ hole;
        }""",
        math.pi * 10 / 3 * (100 + 50 + 25) - math.pi * 4 * 10,
    ),
    "ring": (
        """m(x[3], a[1]) {
          array c[3];
          c[1] = 0; c[2] = 0; c[3] = 0;
          ring = hfTorusZ(x, c, 8, 2);
          c[3] = 12; ball = hfSphere(x, c, 4);
          m = ring | (ball & (13 - x[3]));
        }""",
        2 * math.pi**2 * 8 * 4 + math.pi * 25 * (12 - 5) / 3,
    ),
}


def of_facets(path):
    """Returns the volume within the facets of a text STL file."""
    numbers = re.findall(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)", path.read_text())
    points = [tuple(map(float, p)) for p in numbers]
    return sum(
        (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
         + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6
        for a, b, c in zip(points[::3], points[1::3], points[2::3])
    )


def run(command):
    """Returns what a command prints; an error where it fails."""
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


def volumes(dialect, programs):
    """Returns the volumes of the solids of CAD programs; those of Python share a process, since
    their library takes seconds to load."""
    if dialect == "openscad":
        facets = [program.with_suffix(".stl") for program in programs]
        for program, stl in zip(programs, facets):
            run(["openscad", "-q", "-o", stl, program])
        return [of_facets(stl) for stl in facets]
    all_of_them = "import runpy, sys\nfor p in sys.argv[1:]: runpy.run_path(p, run_name='__main__')"
    told = run([sys.executable, "-c", all_of_them, *programs])
    return [float(volume) for volume in re.findall(r"volume (\S+)", told)]


def write_program(dialect, isoform, name, folder):
    """Returns the program of a part."""
    model, scan = folder / f"{name}.hf", folder / f"{name}.ply"
    model.write_text(PARTS[name][0])
    run([isoform, "mesh", model, "--surface-only", "-o", scan, "-q"])
    program = folder / f"{name}.{'scad' if dialect == 'openscad' else 'py'}"
    recover = [isoform, "recover", scan, "-o", program, "--units", "mm", "-q"]
    if dialect != "openscad":
        recover += ["--dialect", dialect]
    run(recover)
    return program


def doubled(program):
    """Returns the program with all free lengths doubled: so is the part."""
    lines = program.read_text().split("\n")
    first = next(k for k, line in enumerate(lines) if "Dimensions" in line) + 1
    last = next(k for k, line in enumerate(lines) if line.startswith("far ="))
    for k in range(first, last + 1):
        if "_angle" not in lines[k]:
            lines[k] = re.sub(r"^(\w+) = (-?[0-9.e-]+)", lambda m: f"{m[1]} = 2*{m[2]}", lines[k])
    larger = program.with_stem(f"{program.stem}_larger")
    larger.write_text("\n".join(lines))
    return larger


def main():
    dialect, isoform = sys.argv[1], Path(sys.argv[2]).resolve()
    # Polygons of 64 sides lose 0.16 % of a disc, and balls and tubes twice that. STL files of
    # OpenSCAD have six digits.
    limit, digits = (5e-3, 1e-4) if dialect == "openscad" else (1e-6, 1e-6)
    with tempfile.TemporaryDirectory() as folder:
        written = {name: write_program(dialect, isoform, name, Path(folder)) for name in PARTS}
        # The place of the nozzle's cone is a number.
        larger = {name: doubled(written[name]) for name in PARTS if name != "nozzle"}
        all_of_them = [*written.values(), *larger.values()]
        found = dict(zip(all_of_them, volumes(dialect, all_of_them), strict=True))
    is_right = True
    for name, (_, wanted) in PARTS.items():
        volume = found[written[name]]
        is_good = abs(volume / wanted - 1) <= limit
        if name in larger:
            is_good &= abs(found[larger[name]] / volume / 8 - 1) <= digits
        print(f"{'ok  ' if is_good else 'FAIL'}  {dialect} {name}: {volume} for {wanted}")
        is_right &= is_good
    sys.exit(0 if is_right else 1)


if __name__ == "__main__":
    main()
