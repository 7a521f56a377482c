import sys
from math import acos, asin, atan, cos, exp, fabs, floor, log, sin, sqrt, tan

import build123d as bd


def one(shape):
    return bd.Compound(list(shape)) if isinstance(shape, list) else shape


def half_space(n, d):
    """Points p with n . p + d >= 0, up to far away."""
    n = bd.Vector(*n)
    sides = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    return bd.Plane(n * (-d / n.dot(n)), z_dir=n) * bd.Box(2 * far, 2 * far, far, align=sides)


def block(low, high):
    size = [b - a for a, b in zip(low, high)]
    return bd.Pos(*low) * bd.Box(*size, align=(bd.Align.MIN,) * 3)


def rod(at, way, radius):
    return bd.Plane(at, z_dir=way) * bd.Cylinder(radius, 2 * far)


def ball(at, radius):
    return bd.Pos(*at) * bd.Sphere(radius)


def ring(at, way, circle, tube):
    return bd.Plane(at, z_dir=way) * bd.Torus(circle, tube)


def cones(at, way, slope):
    sides = (bd.Align.CENTER, bd.Align.CENTER)
    up = bd.Cone(0, slope * far, far, align=(*sides, bd.Align.MIN))
    down = bd.Cone(slope * far, 0, far, align=(*sides, bd.Align.MAX))
    place = bd.Plane(at, z_dir=way)
    return union(place * up, place * down)


def union(first, *others):
    for other in others:
        first = one(first.fuse(other))
    return first


def common(first, *others):
    for other in others:
        first = one(first.intersect(other))
    return first


def cut(first, *others):
    for other in others:
        first = one(first.cut(other))
    return first
