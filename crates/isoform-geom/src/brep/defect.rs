//! Validation of boundary representations as data: files may contain inconsistent ones.

use super::{Axes, BSpline, Brep, Curve, Edge, Ellipsoid, Face, Graph, Revolved, Surface};
use crate::{Point3, dot};
use std::f64::consts::FRAC_PI_2;
use std::fmt;

/// Upper bound of the magnitude of numbers; its inverse is the lower bound of lengths, in model
/// units. The cube of any such length, a volume, is within the range of doubles.
const MAX_MAGNITUDE: f64 = 1e100;
/// Tolerance of the squared lengths and of the cosine of a frame's directions. Larger deviations
/// are not rounding errors: the vectors were not meant as a frame.
const FRAME_TOLERANCE: f64 = 1e-9;
/// Maximum degree of the curve of an edge. Isoform makes curves of degree 5.
const MAX_CURVE_DEGREE: usize = 25;
/// Maximum degree of a graph: arrays of its B-splines have a fixed size.
const MAX_GRAPH_DEGREE: usize = 7;

/// Defect of a boundary representation, with its location.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Defect {
    /// Location, such as `edge 3` or `face 0, loop 1`; numbers count from 0.
    pub at: String,
    /// Description of the defect.
    pub problem: &'static str,
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.at, self.problem)
    }
}

impl std::error::Error for Defect {}

type CheckResult = Result<(), &'static str>;

/// Returns `problem` as an error unless the condition holds.
fn need(is: bool, problem: &'static str) -> CheckResult {
    if is { Ok(()) } else { Err(problem) }
}

fn at(place: impl FnOnce() -> String) -> impl FnOnce(&'static str) -> Defect {
    |problem| Defect {
        at: place(),
        problem,
    }
}

impl Brep {
    /// Checks that all numbers are finite and of a sane size, all indices in range, all frames
    /// orthonormal, all splines complete, all loops closed, each edge in two loops, once in each
    /// direction, and each face in one shell. All other functions rely on these conditions. The
    /// distance of edges from their faces is not checked.
    ///
    /// # Errors
    /// Returns the first [`Defect`] found.
    pub fn validate(&self) -> Result<(), Defect> {
        for (v, p) in self.vertices.iter().enumerate() {
            points(std::slice::from_ref(p)).map_err(at(|| format!("vertex {v}")))?;
        }
        for (e, edge) in self.edges.iter().enumerate() {
            self.check_edge(edge).map_err(at(|| format!("edge {e}")))?;
        }
        for (f, face) in self.faces.iter().enumerate() {
            let part = need(
                (face.part as usize) < self.parts.len(),
                "there is no such part",
            );
            part.and_then(|()| surface(&face.surface))
                .map_err(at(|| format!("face {f}")))?;
            self.check_loops(f, face)?;
        }
        self.check_uses()?;
        self.check_shells()
    }

    fn check_edge(&self, edge: &Edge) -> CheckResult {
        let exist = |v: &u32| (*v as usize) < self.vertices.len();
        need(edge.ends.iter().all(exist), "there is no such vertex")?;
        match &edge.curve {
            Curve::Line => need(
                edge.ends[0] != edge.ends[1],
                "a segment from a vertex to itself",
            ),
            Curve::Circle(axes, radius) => frame(axes).and_then(|()| length(*radius)),
            Curve::Ellipse(axes, a, b) => {
                frame(axes)?;
                length(*a)?;
                length(*b)
            }
            Curve::BSpline(spline) => curve(spline),
        }
    }

    fn check_loops(&self, f: usize, face: &Face) -> Result<(), Defect> {
        let place = |l: usize| move || format!("face {f}, loop {l}");
        need(!face.loops.is_empty(), "it has no loop").map_err(at(|| format!("face {f}")))?;
        for (l, around) in face.loops.iter().enumerate() {
            need(!around.is_empty(), "it is empty").map_err(at(place(l)))?;
            let exist = around.iter().all(|c| (c.edge as usize) < self.edges.len());
            need(exist, "there is no such edge").map_err(at(place(l)))?;
            let ends: Vec<[u32; 2]> = around.iter().map(|c| self.ends_of(c)).collect();
            let next = ends.iter().cycle().skip(1);
            let is_closed = ends.iter().zip(next).all(|(a, b)| a[1] == b[0]);
            need(is_closed, "its edges are no closed chain").map_err(at(place(l)))?;
        }
        Ok(())
    }

    /// Checks that each edge is in two loops, once in each direction.
    fn check_uses(&self) -> Result<(), Defect> {
        let mut uses = vec![[0usize; 2]; self.edges.len()];
        let faces = self.faces.iter();
        for coedge in faces.flat_map(|f| f.loops.iter().flatten()) {
            uses[coedge.edge as usize][usize::from(coedge.forward)] += 1;
        }
        match uses.iter().position(|u| *u != [1, 1]) {
            None => Ok(()),
            Some(e) => Err(Defect {
                at: format!("edge {e}"),
                problem: "it is not in two loops, once in each direction",
            }),
        }
    }

    /// Checks that there is a solid, that no shell is empty, and that each face is in exactly one
    /// shell.
    fn check_shells(&self) -> Result<(), Defect> {
        let whole = at(|| "the solids".to_owned());
        need(!self.solids.is_empty(), "there is none").map_err(whole)?;
        let mut seen = vec![false; self.faces.len()];
        for (s, body) in self.solids.iter().enumerate() {
            for shell in std::iter::once(&body.outer).chain(&body.voids) {
                let mut check = || {
                    need(!shell.is_empty(), "a shell has no face")?;
                    for f in shell {
                        let known = seen.get_mut(*f as usize);
                        let known = known.ok_or("there is no such face")?;
                        need(!std::mem::replace(known, true), "a face is in two shells")?;
                    }
                    Ok(())
                };
                check().map_err(at(|| format!("solid {s}")))?;
            }
        }
        match seen.iter().position(|is| !is) {
            None => Ok(()),
            Some(f) => Err(Defect {
                at: format!("face {f}"),
                problem: "it is in no shell",
            }),
        }
    }
}

fn number(v: f64) -> CheckResult {
    need(
        v.abs() <= MAX_MAGNITUDE,
        "a number is not finite, or too large",
    )
}

fn points(all: &[Point3]) -> CheckResult {
    all.iter().flatten().try_for_each(|v| number(*v))
}

fn length(v: f64) -> CheckResult {
    need(
        (1.0 / MAX_MAGNITUDE..=MAX_MAGNITUDE).contains(&v),
        "a length is not positive, or not of a sane size",
    )
}

fn frame(axes: &Axes) -> CheckResult {
    points(&[axes.origin])?;
    let Axes { z, x, .. } = axes;
    let right = [dot(*z, *z) - 1.0, dot(*x, *x) - 1.0, dot(*z, *x)];
    need(
        right.iter().all(|v| v.abs() <= FRAME_TOLERANCE),
        "the directions of a frame are not of length 1 and at right angles",
    )
}

fn surface(surface: &Surface) -> CheckResult {
    frame(surface.axes())?;
    match surface {
        Surface::Plane(_) => Ok(()),
        Surface::Cylinder(_, radius) | Surface::Sphere(_, radius) => length(*radius),
        Surface::Cone(_, radius, half_angle) => {
            let is_radius = *radius == 0.0 || length(*radius).is_ok();
            need(is_radius, "a radius is negative, or not of a sane size")?;
            need(
                (1e-9..FRAC_PI_2 - 1e-9).contains(&half_angle.abs()),
                "the half angle of a cone is not between 0 and a right angle",
            )
        }
        Surface::Torus(_, major, minor) => {
            length(*minor)?;
            length(*major)?;
            need(minor < major, "the tube of a torus reaches its axis")
        }
        Surface::Ellipsoid(Ellipsoid { half, sphere, .. }) => {
            half.iter().try_for_each(|h| length(*h))?;
            frame(sphere)?;
            need(
                sphere.origin == [0.0; 3],
                "the unit sphere of an ellipsoid is not about the origin",
            )
        }
        Surface::Revolved(turned) => check_revolved(turned),
        Surface::Graph(graph) => check_graph(graph),
    }
}

fn check_graph(graph: &Graph) -> CheckResult {
    let degree = graph.degree;
    need(
        (1..=MAX_GRAPH_DEGREE).contains(&degree),
        "the degree is not from 1 to 7",
    )?;
    for all in &graph.knots {
        all.iter().try_for_each(|t| number(*t))?;
        clamped(all, degree)?;
    }
    graph.heights.iter().try_for_each(|h| number(*h))?;
    let count = |k: usize| graph.knots[k].len() - degree - 1;
    need(
        count(0).checked_mul(count(1)) == Some(graph.heights.len()),
        "there are not as many heights as the knots ask for",
    )
}

fn check_revolved(turned: &Revolved) -> CheckResult {
    let Revolved {
        degree,
        knots,
        control,
        ..
    } = turned;
    need(
        (1..=MAX_GRAPH_DEGREE).contains(degree),
        "the degree is not from 1 to 7",
    )?;
    knots.iter().try_for_each(|t| number(*t))?;
    clamped(knots, *degree)?;
    control.iter().flatten().try_for_each(|v| number(*v))?;
    let last = control.len().saturating_sub(1);
    let is_off = |(i, c): (usize, &[f64; 2])| c[0] > 0.0 || (c[0] == 0.0 && (i == 0 || i == last));
    need(
        control.iter().enumerate().all(is_off),
        "a curve that is revolved reaches its axis between its ends",
    )?;
    need(
        knots.len() == control.len() + degree + 1,
        "there are not as many control points as the knots ask for",
    )
}

fn curve(spline: &BSpline) -> CheckResult {
    let BSpline {
        degree,
        knots,
        multiplicities,
        control,
    } = spline;
    need(
        (1..=MAX_CURVE_DEGREE).contains(degree),
        "the degree is not from 1 to 25",
    )?;
    points(control)?;
    knots.iter().try_for_each(|t| number(*t))?;
    need(
        knots.len() == multiplicities.len()
            && multiplicities.iter().all(|n| (1..=degree + 1).contains(n)),
        "the knots have no fitting multiplicities",
    )?;
    // The vector has at most 26 times the knots, by the check above: hostile multiplicities cannot
    // exhaust memory.
    clamped(&spline.flat_knots(), *degree)?;
    need(
        multiplicities.iter().sum::<usize>() == control.len() + degree + 1,
        "there are not as many control points as the knots ask for",
    )
}

/// Checks that a knot vector ascends, with degree + 1 equal knots at both ends and at most `degree`
/// equal ones inside.
fn clamped(knots: &[f64], degree: usize) -> CheckResult {
    let runs: Vec<&[f64]> = knots.chunk_by(|a, b| a == b).collect();
    let rises = runs.windows(2).all(|w| w[0][0] < w[1][0]);
    need(rises && runs.len() >= 2, "the knots do not rise")?;
    let is_end = |i: usize| i == 0 || i == runs.len() - 1;
    let fits = |(i, run): (usize, &&[f64])| {
        if is_end(i) {
            run.len() == degree + 1
        } else {
            run.len() <= degree
        }
    };
    need(
        runs.iter().enumerate().all(fits),
        "the ends do not count degree + 1 times, or a knot inside more often than the degree",
    )
}

#[cfg(test)]
mod tests {
    use super::super::tests::can;
    use super::*;
    use crate::brep::{Body, Coedge};

    #[test]
    fn what_is_broken_is_found_where_it_is() {
        let can = can();
        assert_eq!(can.validate(), Ok(()));
        type Break = fn(&mut Brep);
        let breaks: [(&str, Break); 16] = [
            ("vertex 1", |b| b.vertices[1][2] = f64::NAN),
            ("vertex 1", |b| b.vertices[1][2] = 1e101),
            ("edge 0", |b| b.edges[0].ends[1] = 9),
            ("edge 0", |b| b.edges[0].curve = Curve::Line),
            ("edge 1", |b| {
                b.edges[1].curve = Curve::Circle(Axes::along([0.0; 3], [0.0, 0.0, 2.0]), 1.0);
            }),
            ("face 0", |b| b.faces[0].part = 3),
            ("face 1", |b| b.faces[1].loops.clear()),
            ("face 0, loop 0", |b| b.faces[0].loops[0].clear()),
            ("face 2, loop 0", |b| b.faces[2].loops[0][0].edge = 7),
            ("face 2, loop 0", |b| b.faces[2].loops[0][1].forward ^= true),
            ("edge 0", |b| b.faces[0].loops[0][0].forward ^= true),
            ("face 1", |b| {
                b.faces[1].surface =
                    Surface::Torus(Axes::along([0.0; 3], [1.0, 0.0, 0.0]), 1.0, 1.0);
            }),
            ("the solids", |b| b.solids.clear()),
            ("solid 0", |b| b.solids[0].outer.push(0)),
            ("solid 1", |b| b.solids.push(Body::default())),
            ("face 2", |b| b.solids[0].outer.truncate(2)),
        ];
        for (at, change) in breaks {
            let mut broken = can.clone();
            change(&mut broken);
            assert_eq!(broken.validate().expect_err(at).at, at);
        }
    }

    #[test]
    fn knots_and_control_points_belong_together() {
        let spline = |knots: &[f64], multiplicities: &[usize], control: usize| {
            curve(&BSpline {
                degree: 2,
                knots: knots.to_vec(),
                multiplicities: multiplicities.to_vec(),
                control: vec![[0.0; 3]; control],
            })
        };
        assert_eq!(spline(&[0.0, 1.0, 2.0], &[3, 1, 3], 4), Ok(()));
        for (knots, multiplicities, control) in [
            (&[0.0, 1.0, 2.0][..], &[3, 1, 3][..], 5),
            (&[0.0, 1.0, 2.0], &[3, 3, 3], 6),
            (&[0.0, 1.0, 2.0], &[3, 0, 3], 3),
            (&[0.0, 1.0, 1.0], &[3, 1, 3], 4),
            (&[0.0, 2.0, 1.0], &[3, 1, 3], 4),
            (&[0.0, f64::NAN, 1.0], &[3, 1, 3], 4),
            (&[0.0, 1.0], &[3, usize::MAX], 4),
            (&[0.0], &[3], 0),
            (&[], &[], 0),
        ] {
            assert!(
                spline(knots, multiplicities, control).is_err(),
                "{knots:?} {multiplicities:?}"
            );
        }
    }

    #[test]
    fn a_coedge_runs_from_end_to_end() {
        let can = can();
        let passed = |forward| can.ends_of(&Coedge { edge: 2, forward });
        assert_eq!((passed(true), passed(false)), ([0, 1], [1, 0]));
    }
}
