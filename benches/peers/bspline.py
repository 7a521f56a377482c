#!/usr/bin/env python3
"""Numbers per patch at equal error: `isoform parameterize` beside OpenCASCADE's GeomAPI_PointsToBSplineSurface.

    bspline.py ISOFORM [FOLDER of sphere.json, schwarz12.json, torus.hf, two_pipes.hf]

For each surface one patch is grown with --tol. Its 40 x 40 grid of points, projected onto the surface, is what OpenCASCADE fits, with tolerances
from 1e-2 down; of these the B-spline with the fewest control points whose distance from the surface, at 200 x 200 points, is no larger
than that of the patch, or else the most exact one, is shown. A rational control point is four numbers, one of a B-spline three.
Needs numpy and cadquery-ocp.
"""
import json, os, subprocess, sys, tempfile
import numpy as np
from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface
from OCP.GeomAbs import GeomAbs_C2
from OCP.gp import gp_Pnt

try:
    from OCP.collections import Array2_gp_Pnt as Points
except ImportError:  # before OpenCASCADE 8
    from OCP.TColgp import TColgp_Array2OfPnt as Points

W = 2 * np.pi


def schwarz(p):
    """Sum of cosines of 2 pi x by Taylor polynomials of degree 12."""
    c = [(-1) ** k * W ** (2 * k) / float(np.prod(np.arange(1, 2 * k + 1))) for k in range(7)]
    return sum(np.polynomial.polynomial.polyval(p[..., i] ** 2, c) for i in range(3))


def pipes(p):
    a, b = 0.18 - np.hypot(p[..., 0], p[..., 1]), 0.18 - np.hypot(p[..., 1], p[..., 2])
    return 0.5 * (a + b + np.sqrt((a - b) ** 2 + 0.0064))


# File, function, degree, seed, tolerance.
CASES = [
    ("sphere.json", lambda p: (p * p).sum(-1) - 0.25, "2,2", "0,0,0.5", 1e-5),
    ("torus.hf", lambda p: 0.15 - np.hypot(np.hypot(p[..., 0], p[..., 1]) - 0.33, p[..., 2]), "2,2", "0.48,0,0", 2e-5),
    ("torus.hf", lambda p: 0.15 - np.hypot(np.hypot(p[..., 0], p[..., 1]) - 0.33, p[..., 2]), "3,3", "0.48,0,0", 2e-5),
    ("schwarz12.json", schwarz, "3,3", "0.25,0.25,0.25", 1e-5),
    ("two_pipes.hf", pipes, "3,3", "0.13,0.13,0.13", 2e-4),
    ("two_pipes.hf", pipes, "4,4", "0.13,0.13,0.13", 2e-4),
]


def gradient(f, p, h=1e-5):
    step = np.eye(3) * h
    return np.stack([(8 * (f(p + d) - f(p - d)) - f(p + 2 * d) + f(p - 2 * d)) / (12 * h) for d in step], -1)


def project(f, p):
    for _ in range(30):
        g = gradient(f, p)
        p = p - (f(p) / (g * g).sum(-1))[..., None] * g
    return p


def most(f, p):
    return float(np.linalg.norm(p - project(f, p), axis=-1).max())


def bernstein(n, t):
    b = np.ones((len(t), 1))
    for _ in range(n):
        b = np.pad(b, ((0, 0), (0, 1))) * (1 - t)[:, None] + np.pad(b, ((0, 0), (1, 0))) * t[:, None]
    return b


def points(control, n):
    c = np.array(control)
    t = np.linspace(0, 1, n)
    h = np.einsum("qi,rj,ijd->qrd", bernstein(c.shape[0] - 1, t), bernstein(c.shape[1] - 1, t), c)
    return h[..., :3] / h[..., 3:]


def fitted(grid, tol):
    """The number of control points of OpenCASCADE's B-spline through a grid, and 200 x 200 points of it."""
    array = Points(1, len(grid), 1, len(grid))
    for i, row in enumerate(grid):
        for j, p in enumerate(row):
            array.SetValue(i + 1, j + 1, gp_Pnt(*map(float, p)))
    fit = GeomAPI_PointsToBSplineSurface(array, 3, 8, GeomAbs_C2, tol)
    if not fit.IsDone():
        return None
    s = fit.Surface()
    u0, u1, v0, v1 = s.Bounds()
    at = [[s.Value(u, v) for v in np.linspace(v0, v1, 200)] for u in np.linspace(u0, u1, 200)]
    return s.NbUPoles() * s.NbVPoles(), np.array([[[p.X(), p.Y(), p.Z()] for p in row] for row in at])


def main():
    isoform, folder = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "."
    print("| surface | m,n | area | distance | numbers | B-spline: distance | numbers | times as many |")
    print("|---|---|---|---|---|---|---|---|")
    for file, f, degree, seed, tol in CASES:
        with tempfile.TemporaryDirectory() as out:
            path = os.path.join(out, "p.json")
            args = [isoform, "parameterize", os.path.join(folder, file), "--degree", degree, "--seed-point", seed, "--tol", str(tol)]
            area = json.loads(subprocess.run([*args, "-o", path, "--json"], capture_output=True, text=True).stdout)["patches"][0]["area"]
            control = json.load(open(path))["patches"][0]["control"]
        error = most(f, points(control, 200))
        grid = project(f, points(control, 40))
        fits = [(n, most(f, p)) for n, p in filter(None, (fitted(grid, 10.0 ** (-k / 3)) for k in range(6, 25)))]
        good = [fit for fit in fits if fit[1] <= error]
        n, reached = min(good) if good else min(fits, key=lambda fit: fit[1])
        own = 4 * len(control) * len(control[0])
        name = file.split(".")[0]
        print(f"| {name} | {degree} | {area:.3f} | {error:.1e} | {own} | {reached:.1e} | {3 * n} | {3 * n / own:.1f} |", flush=True)


main()
