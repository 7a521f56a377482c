//! Area, volume and first moments of solids by integrals along edges.
//!
//! By the theorem of Gauss the volume is the flux of x/3 through the faces, and the first moment
//! along axis k that of xₖ²/2 eₖ. On a face with the parameters u and v a flux is ∬ w du dv, and by
//! the theorem of Green −∮ W du around its loops with W = ∫ w dv. Both integrals use Gauss
//! quadrature; no mesh is involved.

use crate::arcs::Arcs;
use isoform_control::{Control, Stopped};
use isoform_geom::brep::{Brep, Coedge, Face, Surface};
use isoform_geom::{Point3, dot, norm, sub};
use isoform_num::gauss_legendre;
use std::f64::consts::TAU;

/// Share of an edge from a tip at which its angle is taken.
const TIP_SHARE: f64 = 1e-5;

/// Measures of a face, or of all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measure {
    /// The area.
    pub area: f64,
    /// Volume between the face and the centre that points are taken about; the volume of a solid if
    /// all of its faces are added.
    pub volume: f64,
    /// First moment ∫ x dV about the centre, over that volume.
    pub moment: Point3,
}

impl Measure {
    fn add(&mut self, other: &Self, factor: f64) {
        self.area += factor * other.area;
        self.volume += factor * other.volume;
        (0..3).for_each(|k| self.moment[k] += factor * other.moment[k]);
    }
}

/// Returns the sum of some measures.
pub fn total<'m>(measures: impl IntoIterator<Item = &'m Measure>) -> Measure {
    let mut sum = Measure::default();
    measures.into_iter().for_each(|m| sum.add(m, 1.0));
    sum
}

/// Returns the measure of the face within each of its loops; those of holes are negative.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn of_loops(
    brep: &Brep,
    face: &Face,
    center: Point3,
    control: &Control<'_>,
) -> Result<Vec<Measure>, Stopped> {
    let work = FaceQuadrature::new(brep, face, center);
    let loops = face.loops.iter();
    loops.map(|l| work.of_loop(l, control)).collect()
}

/// Returns the measure of a face.
///
/// # Errors
/// [`Stopped`].
pub fn of_face(
    brep: &Brep,
    face: usize,
    center: Point3,
    control: &Control<'_>,
) -> Result<Measure, Stopped> {
    let loops = of_loops(brep, &brep.faces[face], center, control)?;
    Ok(total(&loops))
}

struct FaceQuadrature<'a> {
    brep: &'a Brep,
    face: &'a Face,
    center: Point3,
    /// Start of the angles about the tube of a torus, and of v of a spline.
    start_of_v: f64,
    /// Nodes and weights of Gauss quadrature along a piece of an edge.
    outer: (Vec<f64>, Vec<f64>),
    /// Nodes and weights from the base of v to the edge.
    inner: (Vec<f64>, Vec<f64>),
    /// Nodes and weights from knot to knot of a graph.
    spans: (Vec<f64>, Vec<f64>),
}

impl<'a> FaceQuadrature<'a> {
    fn new(brep: &'a Brep, face: &'a Face, center: Point3) -> Self {
        Self {
            brep,
            face,
            center,
            start_of_v: start_of_v(brep, face),
            outer: gauss_legendre(10),
            inner: gauss_legendre(20),
            spans: gauss_legendre(6),
        }
    }

    fn of_loop(&self, around: &[Coedge], control: &Control<'_>) -> Result<Measure, Stopped> {
        let mut sum = Measure::default();
        for coedge in around {
            let sense = if coedge.forward { -1.0 } else { 1.0 };
            let breaks = self.breaks(coedge.edge);
            for piece in breaks.windows(2) {
                control.check()?;
                let width = piece[1] - piece[0];
                for (x, weight) in self.outer.0.iter().zip(&self.outer.1) {
                    let s = piece[0] + width * x;
                    let (p, velocity) = self.brep.along(coedge.edge, s);
                    let rate = self.face.surface.rate_of_u(p, velocity);
                    if rate != 0.0 {
                        let up = self.up_to(self.face.surface.parameters(p));
                        sum.add(&up, sense * rate * weight * width);
                    }
                }
            }
        }
        for tip in self.face.surface.tips() {
            self.add_tip(tip, around, &mut sum);
        }
        Ok(sum)
    }

    /// Adds the integral along a tip of the surface, which the loop passes in one point of space
    /// but along a line of parameters.
    fn add_tip(&self, tip: Point3, around: &[Coedge], sum: &mut Measure) {
        let surface = &self.face.surface;
        let v = surface.parameters(tip)[1];
        let widest = self.brep.vertices.iter().map(|p| norm(sub(*p, tip)));
        let near = 1e-9 * widest.fold(0.0, f64::max);
        for (i, coedge) in around.iter().enumerate() {
            let [_, end] = self.brep.ends_of(coedge);
            if norm(sub(self.brep.vertices[end as usize], tip)) > near {
                continue;
            }
            let angle = |c: &Coedge, share: f64| {
                let s = if c.forward { share } else { 1.0 - share };
                surface.parameters(self.brep.along(c.edge, s).0)[0]
            };
            // The angle exists near the tip, not at it.
            let before = angle(coedge, 1.0 - TIP_SHARE);
            let turn = angle(&around[(i + 1) % around.len()], TIP_SHARE) - before;
            for (x, weight) in self.outer.0.iter().zip(&self.outer.1) {
                sum.add(&self.up_to([before + turn * x, v]), -turn * weight);
            }
        }
    }

    /// Returns parameters between which the integrand along an edge is nearly smooth: on a spline
    /// pieces are at most half as long as the distance between two knots of u.
    fn breaks(&self, edge: u32) -> Vec<f64> {
        let breaks = self.brep.breaks(edge);
        let Surface::Graph(graph) = &self.face.surface else {
            return breaks;
        };
        let [first, last] = graph.domain()[0];
        let span = (last - first) / (graph.rows() - graph.degree) as f64;
        let u = |s: f64| self.face.surface.parameters(self.brep.along(edge, s).0)[0];
        let mut finer = vec![breaks[0]];
        for w in breaks.windows(2) {
            let half = 0.5 * (w[0] + w[1]);
            let far = (u(half) - u(w[0])).abs() + (u(w[1]) - u(half)).abs();
            let parts = (2.0 * far / span).ceil().clamp(1.0, 200.0) as usize;
            let at = |n: usize| w[0] + (w[1] - w[0]) * n as f64 / parts as f64;
            finer.extend((1..=parts).map(at));
        }
        finer
    }

    /// Returns the integrals along v from its base to a point with given parameters.
    fn up_to(&self, [u, mut v]: [f64; 2]) -> Measure {
        let surface = &self.face.surface;
        let mut base = surface.base_of_v();
        if matches!(surface, Surface::Torus(..)) {
            v = self.start_of_v + (v - self.start_of_v).rem_euclid(TAU);
            base = self.start_of_v;
        }
        let element: Box<dyn Fn(f64) -> (Point3, Point3)> = match surface {
            Surface::Graph(graph) => {
                let line = graph.line(u);
                Box::new(move |v| line.area_element(v))
            }
            _ => Box::new(move |v| (surface.point([u, v]), surface.area_vector([u, v]))),
        };
        let mut sum = Measure::default();
        // A spline is a polynomial only from knot to knot.
        let knots = match surface {
            Surface::Graph(graph) => Some(&graph.knots[1]),
            Surface::Revolved(turned) => Some(&turned.knots),
            _ => None,
        };
        if let Some(knots) = knots {
            base = self.start_of_v;
            let (lo, hi) = (base.min(v), base.max(v));
            let mut inner: Vec<f64> = knots.clone();
            inner.retain(|k| lo < *k && *k < hi);
            if v < base {
                inner.reverse();
            }
            for knot in inner {
                self.add_up(&element, [base, knot], &mut sum);
                base = knot;
            }
        }
        self.add_up(&element, [base, v], &mut sum);
        sum
    }

    /// Adds the integrals along v between two values.
    fn add_up(
        &self,
        element: &dyn Fn(f64) -> (Point3, Point3),
        [from, to]: [f64; 2],
        sum: &mut Measure,
    ) {
        let (nodes, weights) = if matches!(self.face.surface, Surface::Graph(_)) {
            &self.spans
        } else {
            &self.inner
        };
        for (x, weight) in nodes.iter().zip(weights) {
            let v = from + (to - from) * x;
            sum.add(&self.density(v, element(v)), weight * (to - from));
        }
    }

    /// Returns the integrands by du dv at v, from the point and the area vector there.
    fn density(&self, v: f64, (point, n): (Point3, Point3)) -> Measure {
        let p = sub(point, self.center);
        // Loops run counterclockwise seen from outside: if the surface's own normal points inward
        // they run clockwise in u and v, so that fluxes along the own normal are correct and the
        // area changes its sign.
        let sense = if self.face.agrees { 1.0 } else { -1.0 };
        Measure {
            area: sense * norm(n) * sign_of_area(&self.face.surface, v),
            volume: dot(n, p) / 3.0,
            moment: std::array::from_fn(|k| 0.5 * p[k] * p[k] * n[k]),
        }
    }
}

/// Returns −1 on the far side of an apex, where the area vector is reversed; faces do not extend
/// there.
fn sign_of_area(surface: &Surface, v: f64) -> f64 {
    match surface {
        Surface::Cone(..) if v < surface.base_of_v() => -1.0,
        _ => 1.0,
    }
}

/// Returns an angle about the tube of a torus that the face leaves free; for a spline the mean of v
/// along the border, far from which the spline is unreliable; 0 for other surfaces.
fn start_of_v(brep: &Brep, face: &Face) -> f64 {
    if face.surface.is_near_only() {
        let coedges = face.loops.iter().flatten();
        let starts = coedges.map(|c| face.surface.parameters(brep.along(c.edge, 0.0).0)[1]);
        let (sum, count) = starts.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        return sum / f64::max(count, 1.0);
    }
    if !matches!(face.surface, Surface::Torus(..)) {
        return 0.0;
    }
    let mut arcs = Arcs::default();
    for coedge in face.loops.iter().flatten() {
        let breaks = brep.breaks(coedge.edge);
        let n = 4 * (breaks.len() - 1);
        let v = |i: usize| {
            let s = i as f64 / n as f64;
            face.surface.parameters(brep.along(coedge.edge, s).0)[1]
        };
        (0..n).for_each(|i| arcs.add(v(i), v(i + 1)));
    }
    arcs.gap().0
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::brep::{Axes, Curve, Edge};
    use std::f64::consts::PI;

    /// Returns half of a cylinder's wall of radius 0.5 and height 2, its seam on the far side.
    fn half_wall() -> (Brep, Surface) {
        let axes = Axes::along([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).turned([-1.0, 0.0, 0.0]);
        let at = |y: f64, z: f64| [1.0, y, z];
        let up = Axes::along([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let top = Axes::along([1.0, 0.0, 2.0], [0.0, 0.0, -1.0]);
        let edge = |curve, ends| Edge { curve, ends };
        let brep = Brep {
            vertices: vec![at(-0.5, 0.0), at(0.5, 0.0), at(0.5, 2.0), at(-0.5, 2.0)],
            edges: vec![
                edge(Curve::Circle(up, 0.5), [0, 1]),
                edge(Curve::Line, [1, 2]),
                edge(Curve::Circle(top, 0.5), [2, 3]),
                edge(Curve::Line, [3, 0]),
            ],
            ..Brep::default()
        };
        (brep, Surface::Cylinder(axes, 0.5))
    }

    #[test]
    fn half_a_wall_has_its_area_and_its_flux() {
        let (brep, surface) = half_wall();
        let loops = |forward: bool| {
            let mut around: Vec<Coedge> = (0..4).map(|edge| Coedge { edge, forward }).collect();
            if !forward {
                around.reverse();
            }
            vec![around]
        };
        for agrees in [true, false] {
            let face = Face {
                surface: surface.clone(),
                agrees,
                part: 0,
                chart: 0,
                loops: loops(agrees),
            };
            let sum = total(
                &of_loops(&brep, &face, [1.0, 0.0, 0.0], &Control::default()).expect("a measure"),
            );
            let sense = if agrees { 1.0 } else { -1.0 };
            assert!((sum.area - PI).abs() < 1e-13, "{sum:?}");
            // x·n = 0.5 on the wall about the axis, and a third of that times the area.
            assert!((sum.volume - sense * PI / 6.0).abs() < 1e-13, "{sum:?}");
        }
    }
}
