import sys
from math import acos, asin, atan, cos, exp, fabs, floor, log, sin, sqrt, tan

import cadquery as cq


def half_space(n, d):
    """Points p with n . p + d >= 0, up to far away."""
    n = cq.Vector(*n)
    plane = cq.Plane(n * (-d / n.dot(n)), normal=n)
    return cq.Workplane(plane).box(2 * far, 2 * far, far, centered=(True, True, False)).val()


def block(low, high):
    size = [b - a for a, b in zip(low, high)]
    return cq.Solid.makeBox(*size, cq.Vector(*low))


def rod(at, way, radius):
    way = cq.Vector(*way).normalized()
    return cq.Solid.makeCylinder(radius, 2 * far, cq.Vector(*at) - way * far, way)


def ball(at, radius):
    return cq.Solid.makeSphere(radius, cq.Vector(*at), cq.Vector(0, 0, 1), -90, 90, 360)


def ring(at, way, circle, tube):
    return cq.Solid.makeTorus(circle, tube, cq.Vector(*at), cq.Vector(*way))


def cones(at, way, slope):
    at, way = cq.Vector(*at), cq.Vector(*way)
    up = cq.Solid.makeCone(0, slope * far, far, at, way)
    return union(up, cq.Solid.makeCone(0, slope * far, far, at, way * -1))


def union(first, *others):
    for other in others:
        first = first.fuse(other)
    return first


def common(first, *others):
    for other in others:
        first = first.intersect(other)
    return first


def cut(first, *others):
    for other in others:
        first = first.cut(other)
    return first
