//! Vertices: points common to all surfaces that meet there.

use crate::curves::{CurveRequest, Jet, curve, jet};
use crate::locus::{Distance, Locus};
use crate::newton::{MEETING_ROUNDING, gap, meet};
use isoform_geom::brep::{BSpline, Brep, Coedge, Curve, Edge};
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::BTreeSet;

/// Maximum sine between a curve and a surface that are tested for contact: at such an angle their
/// intersection loses as many digits as it has left. Also the maximum length of a step towards the
/// contact, in sizes of the model.
const MAX_CONTACT_SINE: f64 = 1e-3;
/// Angle (radians) by which edges that would have one tangent leave a contact. It kept readers from
/// finding crossings in all solids tried; with a tenth they found some in most of them, with a
/// hundred times as much edges leave their surfaces by a reader's tolerance.
const CONTACT_ANGLE: f64 = 1e-6;
/// Share of a spline between a contact and the vertex at which it is divided.
const PARTING_SHARE: f64 = 1.0 / 32.0;
/// Number of pieces of a divided spline between points that its parts start with: enough for a
/// whole turn.
const SAMPLES_PER_PART: u32 = 32;

/// Returns the point near `start` that lies on all surfaces, and true if one of them touches the
/// curve of two others there. Then it is the point of contact, and all edges that end in it have
/// one tangent: as a common zero it is double, and would be accurate to only half the digits.
pub(crate) fn vertex(surfaces: &[Locus], start: Point3, size: f64) -> (Point3, bool) {
    let p = meet(surfaces, start);
    match contact(surfaces, p, size) {
        Some(contact) => (contact, true),
        None => (p, false),
    }
}

/// Returns the point at which one surface touches the curve of the two that meet at the largest
/// angle.
fn contact(surfaces: &[Locus], p: Point3, size: f64) -> Option<Point3> {
    let normals: Vec<Point3> = surfaces.iter().map(|s| s.distance(p).1).collect();
    let sine = |&(i, j): &(usize, usize)| norm(cross(normals[i], normals[j]));
    let pairs = (1..surfaces.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    let (i, j) = pairs.max_by(|a, b| sine(a).total_cmp(&sine(b)))?;
    let pair = [&surfaces[i], &surfaces[j]];
    let tangent = cross(normals[i], normals[j]).map(|v| v / sine(&(i, j)));
    let others = (0..surfaces.len()).filter(|k| *k != i && *k != j);
    let is_flat = |k: &usize| dot(tangent, normals[*k]).abs() <= MAX_CONTACT_SINE;
    if !others.clone().all(|k| is_flat(&k)) {
        return None;
    }
    let mut found = others.filter_map(|k| stationary(pair, &surfaces[k], p, size));
    // A curve that enters the surface by less crosses it twice within some 1e-6 of the size, which
    // readers do not resolve.
    found.find(|q| gap(surfaces, *q) <= MEETING_ROUNDING * size)
}

/// Returns the point of the curve of two surfaces, near `start`, at which the distance from a third
/// one is stationary: there the tangent lies in the third.
fn stationary(pair: [&Locus; 2], third: &Locus, start: Point3, size: f64) -> Option<Point3> {
    let (mut p, mut direction) = (start, [0.0; 3]);
    // Five steps suffice if the curve and the surface differ in curvature.
    for _ in 0..20 {
        let jet = jet(pair, p, direction)?;
        direction = jet.t;
        let normal = third.distance(p).1;
        let slope = dot(jet.t, normal);
        let bend = dot(jet.k, normal) + third.bending(p, jet.t);
        let step = slope / bend;
        // A curve that stays on the third surface has no stationary point.
        if step.is_nan() || step.abs() > MAX_CONTACT_SINE * size {
            return None;
        }
        let q = meet(pair, std::array::from_fn(|k| p[k] - step * jet.t[k]));
        let moved = norm(sub(q, p));
        p = q;
        if moved <= 4.0 * f64::EPSILON * norm(p) {
            break;
        }
    }
    Some(p)
}

/// Opens the angle between edges that end in a contact, where all have one tangent: splines are
/// divided near it, and the short parts leave it in directions of their own. Returns the divided
/// edges in the order of the edges that are added to the solid.
///
/// Readers compute curves in the parameters of the faces by interpolation between some twenty
/// points of an edge, whose tangents are then off by 1e-6; of edges with one tangent they find
/// crossings near the vertex, and cut the face in two there. Of short parts they know the tangents
/// to 1e-8, and find no crossings if they leave the vertex [`CONTACT_ANGLE`] apart.
pub(crate) fn open_contacts(
    contacts: &BTreeSet<u32>,
    brep: &mut Brep,
    meeting: &[[Locus; 2]],
    size: f64,
) -> Vec<usize> {
    let ends: Vec<[u32; 2]> = brep.edges.iter().map(|e| e.ends).collect();
    let mut parted = Vec::new();
    for (e, surfaces) in meeting.iter().enumerate() {
        for (v, is_end) in ends[e].into_iter().zip([false, true]) {
            if !contacts.contains(&v) {
                continue;
            }
            let others = (0..meeting.len()).filter(|o| *o != e && ends[*o].contains(&v));
            let others = others.map(|o| [&meeting[o][0], &meeting[o][1]]);
            let surfaces = [&surfaces[0], &surfaces[1]];
            let away = away(surfaces, others, brep.vertices[v as usize]);
            let added = brep.edges.len();
            if part(brep, [e, added], is_end, (surfaces, size)).is_none() {
                continue;
            }
            parted.push(e);
            let near = if is_end { added } else { e };
            if let (Curve::BSpline(spline), Some(away)) = (&mut brep.edges[near].curve, away) {
                open(spline, is_end, away);
            }
        }
    }
    parted
}

/// Returns the direction in which the curve of two surfaces leaves, from a common point with one
/// tangent, the nearest of the curves that share a surface with it.
fn away<'a>(
    own: [&Locus; 2],
    others: impl Iterator<Item = [&'a Locus; 2]>,
    p: Point3,
) -> Option<Point3> {
    // A curve that shares both surfaces is the continuation of this one.
    let shares = |o: &[&Locus; 2]| o.iter().filter(|s| own.contains(s)).count() == 1;
    let Jet { t, k, .. } = jet(own, p, [0.0; 3])?;
    let bends = others.filter(shares).filter_map(|o| Some(jet(o, p, t)?.k));
    let apart = bends.map(|other| sub(k, other));
    let apart = apart.min_by(|a, b| norm(*a).total_cmp(&norm(*b)))?;
    let length = norm(apart);
    (length > 0.0).then(|| apart.map(|v| v / length))
}

/// Turns a spline by [`CONTACT_ANGLE`] at its beginning or its end.
fn open(spline: &mut BSpline, is_end: bool, away: Point3) {
    let last = spline.control.len() - 1;
    let [end, next] = if is_end { [last, last - 1] } else { [0, 1] };
    let arm = norm(sub(spline.control[next], spline.control[end]));
    for (v, d) in spline.control[next].iter_mut().zip(away) {
        *v += CONTACT_ANGLE * arm * d;
    }
}

/// Divides the spline of the first edge near an end; the second part becomes the second edge.
/// `None` if the edge is not a spline.
fn part(
    brep: &mut Brep,
    [edge, added]: [usize; 2],
    is_end: bool,
    (surfaces, size): ([&Locus; 2], f64),
) -> Option<()> {
    let Edge { curve, ends } = &brep.edges[edge];
    let [first, last] = *ends;
    let Curve::BSpline(spline) = curve else {
        return None;
    };
    let share = if is_end {
        1.0 - PARTING_SHARE
    } else {
        PARTING_SHARE
    };
    let vertices = ends.map(|v| brep.vertices[v as usize]);
    let (middle, [before, behind]) = halves(spline, share, surfaces, vertices, size)?;
    let new = brep.vertices.len() as u32;
    brep.vertices.push(middle);
    brep.edges[edge] = Edge {
        curve: before,
        ends: [first, new],
    };
    brep.edges.push(Edge {
        curve: behind,
        ends: [new, last],
    });
    follow(brep, edge as u32, added as u32);
    Some(())
}

/// Returns a point at a share of a spline, and the curves before and behind it.
fn halves(
    spline: &BSpline,
    share: f64,
    surfaces: [&Locus; 2],
    [first, last]: [Point3; 2],
    size: f64,
) -> Option<(Point3, [Curve; 2])> {
    let length = spline.knots[spline.knots.len() - 1];
    let at = |t: f64| meet(surfaces, spline.evaluate(t * length).0);
    let middle = at(share);
    let between = |from: f64, to: f64| -> Vec<Point3> {
        let inner = 1..SAMPLES_PER_PART;
        let shares = inner.map(|k| from + (to - from) * f64::from(k) / f64::from(SAMPLES_PER_PART));
        shares.map(at).collect()
    };
    let part = |ends: [Point3; 2], between: &[Point3]| {
        curve(&CurveRequest {
            surfaces,
            ends,
            between,
            size,
        })
    };
    let near = part([first, middle], &between(0.0, share))?;
    let far = part([middle, last], &between(share, 1.0))?;
    Some((middle, [near, far]))
}

/// Inserts the edge `added` after `edge` into the loops that pass it.
pub(crate) fn follow(brep: &mut Brep, edge: u32, added: u32) {
    for edges in brep.faces.iter_mut().flat_map(|face| &mut face.loops) {
        if let Some(k) = edges.iter().position(|c| c.edge == edge) {
            let forward = edges[k].forward;
            let behind = k + usize::from(forward);
            edges.insert(
                behind,
                Coedge {
                    edge: added,
                    forward,
                },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::brep::{Axes, Surface};

    /// Returns a bore, its countersink, and a cross bore whose top touches the circle between them
    /// in (0.2, ±0.3, 0.2).
    fn touching() -> [Locus; 3] {
        let along = |z: f64, axis| Axes::along([0.2, 0.0, z], axis);
        let bore = Surface::Cylinder(along(0.0, [0.0, 0.0, 1.0]), 0.3);
        let sink = Surface::Cone(along(0.2, [0.0, 0.0, 1.0]), 0.3, 0.5f64.atan());
        let cross = Surface::Cylinder(along(0.0, [0.0, 1.0, 0.0]), 0.2);
        [bore, sink, cross].map(Locus::Exact)
    }

    #[test]
    fn a_cylinder_touches_the_border_of_a_countersink() {
        let surfaces = touching();
        for start in [[0.21, 0.3, 0.2], [0.2, 0.31, 0.19], [0.1999, 0.3, 0.2003]] {
            let (p, is_contact) = vertex(&surfaces, start, 3.0);
            assert!(is_contact && norm(sub(p, [0.2, 0.3, 0.2])) < 1e-14, "{p:?}");
        }
    }

    #[test]
    fn surfaces_that_cross_meet_where_they_cross() {
        // The plane cuts 1e-6 into the circle: it crosses it 1.4e-3 apart.
        let z = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let deep = 1e-6;
        let plane = Axes::along([1.0 - deep, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let all = [
            Surface::Cylinder(z, 1.0),
            Surface::Plane(z),
            Surface::Plane(plane),
        ];
        let surfaces = all.map(Locus::Exact);
        let y = (1.0 - (1.0 - deep).powi(2)).sqrt();
        let (p, is_contact) = vertex(&surfaces, [1.0, 1.1 * y, 0.0], 2.0);
        assert!(
            !is_contact && norm(sub(p, [1.0 - deep, y, 0.0])) < 1e-12,
            "{p:?}"
        );
    }

    #[test]
    fn edges_leave_a_contact_apart() {
        let [bore, sink, cross] = touching();
        let (contact, size) = ([0.2, 0.3, 0.2], 3.0);
        let ends = [
            contact,
            meet([&bore, &cross], [0.4, 0.22, 0.0]),
            [0.5, 0.0, 0.2],
        ];
        let edge = |surfaces: [&Locus; 2], last: u32, near: Point3| Edge {
            curve: curve(&CurveRequest {
                surfaces,
                ends: [contact, ends[last as usize]],
                between: &[meet(surfaces, near)],
                size,
            })
            .expect("a curve"),
            ends: [0, last],
        };
        let spline = edge([&bore, &cross], 1, [0.35, 0.26, 0.13]);
        let circle = edge([&bore, &sink], 2, [0.41, 0.21, 0.2]);
        let mut brep = Brep {
            vertices: ends.to_vec(),
            edges: vec![spline, circle],
            ..Brep::default()
        };
        let meeting = [[bore.clone(), cross.clone()], [bore.clone(), sink]];
        let parted = open_contacts(&BTreeSet::from([0]), &mut brep, &meeting, size);
        assert_eq!((parted, brep.edges.len()), (vec![0], 3));
        assert_eq!([brep.edges[0].ends, brep.edges[2].ends], [[0, 3], [3, 1]]);
        let Curve::BSpline(near) = &brep.edges[0].curve else {
            panic!("{:?}", brep.edges[0].curve)
        };
        // The cross bore lies below the circle, whose tangent is along x.
        let (_, tangent) = near.evaluate(0.0);
        let angle = -tangent[2] / tangent[0];
        assert!((angle / CONTACT_ANGLE - 1.0).abs() < 1e-3, "{angle}");
        let length = near.knots[near.knots.len() - 1];
        for i in 0..=100 {
            let (p, _) = near.evaluate(length * f64::from(i) / 100.0);
            assert!(gap([&bore, &cross], p) < 1e-9 * size, "{i}");
        }
    }
}
