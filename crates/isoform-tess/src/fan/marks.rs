//! The marks of the directions of a node: rays, points infinitely near, and other exceptional
//! lines.

use super::blow_up::{Line, lifts, steps_of};
use super::direction::Direction;
use crate::base::{BasePoint, BinaryForm};
use crate::cover::Involution;
use crate::field::{Algebraic, exact};
use crate::finding::Unopened;
use crate::region::Region;
use crate::tangents::{real_zeros, tangent_form};
use isoform_algebra::RBig;
use isoform_control::{Control, Stopped};
use std::cmp::Ordering;
use std::f64::consts::PI;

/// Angles of the directions that every node has, in half turns: the first one, and the step to the
/// next. Three are needed to separate the two sides of a seam; none is an axis or a diagonal, which
/// often coincide with special directions.
const GENERAL: [f64; 2] = [0.13, 0.25];

/// The target of a direction of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// A ray, by the index of its direction.
    Ray(usize),
    /// A base point infinitely near, by its node.
    Near(usize),
    /// An intersection with another exceptional line.
    Corner,
}

/// A direction of a node, with its target.
#[derive(Clone)]
pub(super) struct Mark {
    pub(super) direction: Direction,
    pub(super) target: Target,
    /// True if the seam is in the box between this mark and the next one.
    pub(super) is_inside: bool,
}

impl Mark {
    /// Returns true if a base point is infinitely near in this direction.
    pub(super) fn is_near(&self) -> bool {
        matches!(self.target, Target::Near(_))
    }
}

/// Input that determines the directions of a base point.
pub(super) struct FanInput<'a> {
    pub(super) base: &'a BasePoint,
    pub(super) region: &'a Region,
    pub(super) control: &'a Control<'a>,
}

/// Marks of the directions of one node.
pub(super) struct NodeMarks {
    /// Marks, ascending by angle in [0, π).
    pub(super) marks: Vec<Mark>,
    /// Reason why the node cannot be opened, if any.
    pub(super) problem: Option<Unopened>,
}

/// Returns the directions that are needed at a node, with rays numbered from `first_ray`: the
/// tangents of the curves that bound the region or are drawn in it, and of the sides of the unit
/// triangles.
///
/// # Errors
/// [`Stopped`].
pub(super) fn marks(
    node: usize,
    line: &Line<'_>,
    cover: Option<Involution>,
    around: &FanInput<'_>,
    first_ray: usize,
) -> Result<NodeMarks, Stopped> {
    let mut collected = MarkCollection {
        node,
        found: Vec::new(),
    };
    // Exact directions come first: rounded ones nearby are merged into them.
    collected.add_lines(line);
    collected.add_sides(line, around.base);
    let in_face = collected.add_faces(line, around)?;
    collected.add_curves(line, around)?;
    collected.add_general();
    collected.separate();
    if let Some(cover) = cover {
        collected.add_partners(cover);
    }
    let marks = collected.finish(line, around.region, first_ray);
    let problem = problem(&marks, line, in_face);
    Ok(NodeMarks { marks, problem })
}

/// Returns the reason why a node cannot be opened, if any; `in_face` is true if its seam lies in
/// the plane of a face.
fn problem(marks: &[Mark], line: &Line<'_>, in_face: bool) -> Option<Unopened> {
    let n = marks.len();
    let meets_in_face = (0..n).any(|k| {
        let is_inside = marks[k].is_inside || marks[(k + n - 1) % n].is_inside;
        !matches!(marks[k].target, Target::Ray(_)) && is_inside && marks[k].direction.faces != 0
    });
    let mut numbers = line.seam.curve.iter().flat_map(BinaryForm::to_f64);
    if meets_in_face {
        Some(Unopened::SeamsMeetInFace)
    } else if in_face && marks.iter().any(|m| m.is_inside) {
        Some(Unopened::SeamInFace)
    } else if numbers.any(|c| !c.is_finite()) {
        Some(Unopened::BeyondDoubles)
    } else {
        None
    }
}

/// Directions of one node without duplicates, while they are collected.
struct MarkCollection {
    node: usize,
    /// Directions, each with its target; `None` for a ray.
    found: Vec<(Direction, Option<Target>)>,
}

impl MarkCollection {
    /// Adds a direction; a known one keeps its target.
    fn add(&mut self, at: [f64; 2], target: Option<Target>) -> &mut Direction {
        let new = Direction::new(self.node, at);
        let known = self.found.iter().position(|d| d.0.is_same(&new));
        let place = known.unwrap_or(self.found.len());
        if known.is_none() {
            self.found.push((new, target));
        }
        &mut self.found[place].0
    }
    /// Adds the directions of points infinitely near, and of other exceptional lines.
    fn add_lines(&mut self, line: &Line<'_>) {
        for (near, &child) in line.seam.near.iter().zip(&line.children) {
            let at = if near.direction[0].is_zero() {
                [0.0, 1.0]
            } else {
                [1.0, near.direction[1].to_f64()]
            };
            self.add(at, Some(Target::Near(child)));
        }
        for (at, crosses) in [([0.0, 1.0], line.crosses[0]), ([1.0, 0.0], line.crosses[1])] {
            if crosses {
                self.add(at, Some(Target::Corner));
            }
        }
    }
    /// Adds the directions of the sides of the unit triangles.
    fn add_sides(&mut self, line: &Line<'_>, base: &BasePoint) {
        let ([u, v], _) = base.chart.variables();
        let lifts = lifts(&steps_of(&line.chain));
        for (k, at, lifts) in [(u, [0.0, 1.0], lifts[0]), (v, [1.0, 0.0], lifts[1])] {
            if base.point[k].is_zero() && lifts {
                self.add(at, None);
            }
        }
    }
    /// Adds the directions in which the seam crosses the faces of the box; returns true if the seam
    /// lies in the plane of one.
    fn add_faces(&mut self, line: &Line<'_>, around: &FanInput<'_>) -> Result<bool, Stopped> {
        let region = around.region;
        let curve = &line.seam.curve;
        let mut in_face = false;
        for face in 0..6 {
            let b = if face % 2 == 0 {
                region.half_width.clone()
            } else {
                -region.half_width.clone()
            };
            let sum = curve[face / 2].plus(&curve[3], &b);
            if sum.is_zero() {
                in_face = true;
                continue;
            }
            let factors: Vec<usize> = (0..region.factors.len())
                .filter(|&f| region.faces[f].contains(&face))
                .collect();
            for at in real_zeros(&sum, around.control)? {
                let d = self.add(at, None);
                d.faces |= 1 << face;
                d.touch(&factors);
            }
        }
        Ok(in_face)
    }
    /// Adds the tangents of other curves and of folds.
    fn add_curves(&mut self, line: &Line<'_>, around: &FanInput<'_>) -> Result<(), Stopped> {
        let (region, control) = (around.region, around.control);
        let drawn = region.extra.iter().flatten().copied();
        for f in drawn.chain(region.folds()) {
            if !region.faces[f].is_empty() {
                continue;
            }
            let form = tangent_form(around.base, &line.chain, &region.factors[f], control)?;
            for at in real_zeros(&form, control)? {
                self.add(at, None).touch(&[f]);
            }
        }
        Ok(())
    }
    fn add_general(&mut self) {
        // Four general directions.
        for k in 0..4 {
            let angle = PI * (GENERAL[0] + GENERAL[1] * f64::from(k));
            self.add([angle.cos(), angle.sin()], None);
        }
    }
    fn sort(&mut self) {
        self.found
            .sort_by(|a, b| a.0.angle().total_cmp(&b.0.angle()));
    }
    /// Returns the direction in the middle between one of the sorted directions and the next.
    fn middle(&self, k: usize) -> [f64; 2] {
        let n = self.found.len();
        let sign = if k + 1 == n { -1.0 } else { 1.0 };
        let [first, second] = [k, (k + 1) % n].map(|k| self.found[k].0.at);
        [0, 1].map(|i| first[i] + sign * second[i])
    }
    /// Inserts a ray between neighbours neither of which is a ray.
    fn separate(&mut self) {
        self.sort();
        let n = self.found.len();
        let is_ray = |k: usize| self.found[k % n].1.is_none();
        let without = (0..n).rev().filter(|&k| !is_ray(k) && !is_ray(k + 1));
        let middles: Vec<[f64; 2]> = without.map(|k| self.middle(k)).collect();
        for at in middles {
            self.found.push((Direction::new(self.node, at), None));
        }
    }
    /// Closes the directions under the involution of a seam that covers its image twice.
    fn add_partners(&mut self, cover: Involution) {
        // Fixed directions come before the partners of others, which are merged with them if
        // near.
        for at in cover.fixed() {
            self.add(at, None);
        }
        // The second round joins the faces of directions and partners that were known already.
        for _ in 0..2 {
            for (d, _) in self.found.clone() {
                self.add(cover.partner(d.at), None).faces |= d.faces;
            }
        }
    }
    /// Returns the sorted marks, with indices for the rays.
    fn finish(mut self, line: &Line<'_>, region: &Region, first_ray: usize) -> Vec<Mark> {
        self.sort();
        let middles: Vec<[f64; 2]> = (0..self.found.len()).map(|k| self.middle(k)).collect();
        let mut next_ray = first_ray;
        let mut marks = Vec::new();
        for ((direction, target), middle) in self.found.into_iter().zip(middles) {
            let target = target.unwrap_or_else(|| {
                next_ray += 1;
                Target::Ray(next_ray - 1)
            });
            marks.push(Mark {
                direction,
                target,
                is_inside: is_in_box(&line.seam.curve, &region.half_width, middle),
            });
        }
        marks
    }
}

/// Returns true if a seam is in the box in a direction; exact for the rounded direction.
fn is_in_box(curve: &[BinaryForm; 4], half_width: &RBig, at: [f64; 2]) -> bool {
    let [a, b] = at.map(exact);
    let [x, y, z, w] = curve.each_ref().map(|f| f.eval(&a, &b));
    let sign_plus = |x: &Algebraic, b: &RBig| {
        let sum = x.element().add(&w.element().scaled(b));
        Algebraic::new(x.field(), x.root(), sum).sign()
    };
    let is_between = |x: &Algebraic| {
        let low = sign_plus(x, half_width);
        let high = sign_plus(x, &-half_width.clone());
        low != high || low == Ordering::Equal
    };
    !w.is_zero() && [x, y, z].iter().all(is_between)
}
