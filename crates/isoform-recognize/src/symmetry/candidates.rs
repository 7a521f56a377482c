//! Candidates for planes and axes of symmetries.

use crate::chart::{Primitive, PrimitiveKind, unit};
use crate::entity::{Layout, Pattern};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Tolerance for parallel directions, and for coincident places, in radians and diagonals.
const MAX_COINCIDENCE_ERROR: f64 = 0.02;

fn plane(place: Point3, normal: Point3) -> Primitive {
    Primitive::plane(place, unit(normal))
}

fn line(place: Point3, axis: Point3) -> Primitive {
    Primitive {
        kind: PrimitiveKind::Cylinder,
        ..plane(place, axis)
    }
}

fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|k| (a[k] + b[k]) / 2.0)
}

/// Returns planes that exchange two surfaces, or keep each, over all pairs with one of the first
/// `most`.
pub(super) fn mirrors(surfaces: &[Primitive], most: usize) -> Vec<Primitive> {
    let mut found = Vec::new();
    for (i, a) in surfaces.iter().enumerate().take(most) {
        for b in &surfaces[i + 1..] {
            if a.kind == b.kind {
                exchanging(a, b, &mut found);
            }
            if a.kind > PrimitiveKind::Sphere || b.kind > PrimitiveKind::Sphere {
                keeping(a, b, &mut found);
            }
        }
    }
    distinct(found)
}

/// Adds the planes whose reflections exchange two surfaces.
fn exchanging(a: &Primitive, b: &Primitive, found: &mut Vec<Primitive>) {
    let way = sub(b.place, a.place);
    match a.kind {
        PrimitiveKind::Plane => {
            let cosine = dot(a.axis, b.axis);
            if cosine.abs() > 1.0 - MAX_COINCIDENCE_ERROR * MAX_COINCIDENCE_ERROR {
                let there = dot(way, a.axis);
                let place = std::array::from_fn(|k| a.place[k] + there / 2.0 * a.axis[k]);
                found.push(plane(place, a.axis));
            } else if let Some(at) = common(a, b) {
                found.push(plane(at, sub(a.axis, b.axis)));
                found.push(plane(at, std::array::from_fn(|k| a.axis[k] + b.axis[k])));
            }
        }
        PrimitiveKind::Sphere if norm(way) > MAX_COINCIDENCE_ERROR => {
            found.push(plane(middle(a.place, b.place), way))
        }
        PrimitiveKind::Sphere => {}
        _ => exchanging_axes(a, b, found),
    }
}

fn exchanging_axes(a: &Primitive, b: &Primitive, found: &mut Vec<Primitive>) {
    let way = sub(b.place, a.place);
    if dot(a.axis, b.axis).abs() > 1.0 - MAX_COINCIDENCE_ERROR * MAX_COINCIDENCE_ERROR {
        let along = dot(way, a.axis);
        let across: Point3 = std::array::from_fn(|k| way[k] - along * a.axis[k]);
        let at = middle(a.place, b.place);
        if norm(across) > MAX_COINCIDENCE_ERROR {
            found.push(plane(at, across));
        }
        if along.abs() > MAX_COINCIDENCE_ERROR {
            // Exchanges two pieces, or ends, along their common axis.
            found.push(plane(apart(a, b), a.axis));
        }
    } else {
        let at = middle(a.place, b.place);
        found.push(plane(at, sub(a.axis, b.axis)));
        found.push(plane(at, std::array::from_fn(|k| a.axis[k] + b.axis[k])));
    }
}

/// Returns the middle of the points that fix two surfaces along their axes: apexes of cones.
fn apart(a: &Primitive, b: &Primitive) -> Point3 {
    let of = |s: &Primitive| {
        if s.kind == PrimitiveKind::Cone {
            s.apex()
        } else {
            s.place
        }
    };
    middle(of(a), of(b))
}

/// Adds the planes through the axis of one of two surfaces that keep the other.
fn keeping(a: &Primitive, b: &Primitive, found: &mut Vec<Primitive>) {
    for (s, t) in [(a, b), (b, a)] {
        if s.kind <= PrimitiveKind::Sphere {
            continue;
        }
        let normal = cross(s.axis, t.axis);
        let is_across = t.kind != PrimitiveKind::Sphere && norm(normal) > MAX_COINCIDENCE_ERROR;
        if is_across {
            found.push(plane(s.place, normal));
        }
        if t.kind != PrimitiveKind::Plane && !is_across {
            let way = sub(t.place, s.place);
            let normal = cross(s.axis, way);
            if norm(normal) > MAX_COINCIDENCE_ERROR {
                found.push(plane(s.place, normal));
            }
        }
        if s.kind == PrimitiveKind::Torus {
            found.push(plane(s.place, s.axis));
        }
    }
}

/// Returns a point on both of two planes, nearest to the first one's reference point.
fn common(a: &Primitive, b: &Primitive) -> Option<Point3> {
    let along = cross(a.axis, b.axis);
    let inwards = cross(along, a.axis);
    let slope = dot(inwards, b.axis);
    let h = -b.distance(a.place) / slope;
    let at: Point3 = std::array::from_fn(|k| a.place[k] + h * inwards[k]);
    at.iter().all(|x| x.is_finite()).then_some(at)
}

/// Returns the axes of the first `most` surfaces that have one.
pub(super) fn lines_of_surfaces(surfaces: &[Primitive], most: usize) -> Vec<Primitive> {
    let with = surfaces.iter().filter(|s| s.kind > PrimitiveKind::Sphere);
    distinct(with.take(most).map(|s| line(s.place, s.axis)).collect())
}

/// Returns the axes of circular patterns, which are in units of `unit` about `origin`.
pub(super) fn lines_of_patterns(patterns: &[Pattern], unit: f64, origin: Point3) -> Vec<Primitive> {
    let of = |p: &Pattern| match p.layout {
        Layout::Circle { center, axis, .. } => {
            let place = std::array::from_fn(|k| (center[k] - origin[k]) / unit);
            Some(line(place, axis))
        }
        Layout::Row { .. } => None,
    };
    distinct(patterns.iter().filter_map(of).collect())
}

/// Returns the lines of intersection of pairs of planes.
pub(super) fn lines_of_mirrors(planes: &[Primitive]) -> Vec<Primitive> {
    let mut found = Vec::new();
    for (i, a) in planes.iter().enumerate() {
        for b in &planes[i + 1..] {
            let along = cross(a.axis, b.axis);
            if norm(along) > MAX_COINCIDENCE_ERROR
                && let Some(at) = common(a, b)
            {
                found.push(line(at, along));
            }
        }
    }
    distinct(found)
}

/// Returns planes or lines without near duplicates: within a tenth of [`MAX_COINCIDENCE_ERROR`].
fn distinct(all: Vec<Primitive>) -> Vec<Primitive> {
    let mut found: Vec<Primitive> = Vec::new();
    for s in all {
        let s = s.about([0.0; 3]);
        let is_same = |f: &Primitive| {
            norm(cross(f.axis, s.axis)) < MAX_COINCIDENCE_ERROR / 10.0
                && norm(sub(f.place, s.place)) < MAX_COINCIDENCE_ERROR / 10.0
        };
        if !found.iter().any(is_same) {
            found.push(s);
        }
    }
    found
}
