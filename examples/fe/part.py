"""What both examples share: a noisy scan of a part, its mesh by isoform, and a picture of stress."""
import json
import subprocess

import matplotlib
import meshio
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # noqa: E402

YOUNG, POISSON = 210e3, 0.3  # steel, in N and mm
PULL = 100.0  # MPa on the face x_max, away from the part; the face x_min is clamped
LOW, HIGH = np.array([-5.0, -4.0, -2.0]), np.array([5.0, 1.0, 2.0])
HOLES = [(-2.0, -1.5, 1.25), (3.0, 0.5, 1.5)]  # x, y, radius; the second one cuts the face y_max


def scan(path, count=10_000, noise=0.02, seed=1):
    """Points of a block with two holes, as a scanner would give them."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(LOW, HIGH, (4 * count, 3))
    face = rng.integers(0, 8, len(points))
    for k in range(6):
        points[face == k, k // 2] = (LOW, HIGH)[k % 2][k // 2]
    angle = rng.uniform(0, 2 * np.pi, len(points))
    for k, (x, y, r) in enumerate(HOLES):
        on = face == 6 + k
        points[on, 0], points[on, 1] = x + r * np.cos(angle[on]), y + r * np.sin(angle[on])
    seen = np.all((points >= LOW) & (points <= HIGH), axis=1)
    for k, (x, y, r) in enumerate(HOLES):
        seen &= (face == 6 + k) | (np.hypot(points[:, 0] - x, points[:, 1] - y) > r)
    np.savetxt(path, points[seen][:count] + rng.normal(0, noise, (min(count, seen.sum()), 3)))


def recover(folder, *files, size=0.5):
    """Scan, fit and mesh of second order in one command; the document that isoform prints."""
    scan(folder / "scan.xyz")
    out = [w for f in files for w in ("-o", folder / f)]
    command = ["isoform", "recover", folder / "scan.xyz", "testpart", "--size", str(size), "--order", "2", *out, "--json", "-q"]
    reply = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    counts, certificate = reply["mesh"]["counts"], reply["mesh"]["certificate"]
    print(f"{reply['n_points']} points, rms {reply['rms']:.3g}; {counts['tets']} tetrahedra, "
          f"angles {certificate['dihedral_angles'][0]:.0f} to {certificate['dihedral_angles'][1]:.0f} degrees")
    return reply["mesh"]


def read(path, parts):
    """(points, tets, {name of a part: its triangles}) of a .vtu file"""
    mesh = meshio.read(path)
    tags = mesh.cell_data_dict["part"]["triangle6"].ravel()
    triangles = mesh.cells_dict["triangle6"]
    return mesh.points, mesh.cells_dict["tetra10"], {p["name"]: triangles[tags == p["tag"]] for p in parts}


def von_mises(s):
    """from xx, yy, zz, xy, yz, zx in columns"""
    xx, yy, zz, xy, yz, zx = s.T
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + zx**2))


def picture(points, triangles, stress, path, load=f"a pull of {PULL:.0f} MPa"):
    """The surface coloured by a value per node."""
    corners = triangles[:, :3]
    value = stress[corners].mean(axis=1)
    axes = plt.figure(figsize=(9, 6)).add_subplot(projection="3d")
    color = plt.cm.viridis(value / value.max())
    axes.add_collection3d(Poly3DCollection(points[corners], facecolors=color, antialiased=False))
    axes.auto_scale_xyz(*points.T)
    axes.set_box_aspect(np.ptp(points, axis=0))
    axes.view_init(40, -60)
    bar = plt.cm.ScalarMappable(plt.Normalize(0, value.max()), "viridis")
    plt.colorbar(bar, ax=axes, shrink=0.6, label="von Mises stress, MPa")
    plt.savefig(path, dpi=150, bbox_inches="tight")
    print(f"largest stress {value.max():.3g} MPa under {load}; {path}")
