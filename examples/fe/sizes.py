"""Sizes for the next mesh, out of the errors of the elements of the last one."""
import csv

import numpy as np

# Elements become no more than this many times smaller or larger from one mesh to the next: an error
# estimate of a coarse mesh knows little of a much finer one.
SMALLER, LARGER = 4.0, 1.5
# Size asked for, in edges of a regular tetrahedron with the mean volume that comes of it. Smaller ones
# win around a place, so that with less there are more elements than wanted.
ASKED = 1.5


def wanted(volumes, errors, growth, order):
    """Edge lengths, one per element, of the mesh with `growth` times as many elements that should
    have the least error.

    The error of an element of edge length h is some c h^(p + 3/2) for polynomials of degree p, in
    three dimensions: the sum of the squares is least, for a number of elements, where all are equal
    (Zienkiewicz and Zhu 1987).
    """
    h = (6 * np.sqrt(2) * volumes) ** (1 / 3)
    rate = order + 1.5
    relative = (errors / np.sqrt(np.mean(errors**2)) + 1e-12) ** (-1 / rate)
    count = lambda scale: np.sum(np.clip(scale * relative, 1 / SMALLER, LARGER) ** -3.0)
    low, high = 1e-3, 1e3
    while high > 1.001 * low:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if count(middle) > growth * len(h) else (low, middle)
    return ASKED * h * np.clip(low * relative, 1 / SMALLER, LARGER)


def write(path, places, lengths):
    """The table that `isoform mesh --sizes` reads."""
    with open(path, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["x", "y", "z", "length"])
        out.writerows(np.column_stack([places, lengths]).tolist())
