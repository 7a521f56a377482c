//! Base points opened: the directions in which a base point is approached, and the points of its
//! seam curves that they lead to.
//!
//! A direction and its opposite lead to the same point (C. L. Bajaj, A. Royappa, 1994, Theorem 1),
//! so directions are kept up to sign, and those that bound the region or lie on a curve that is
//! drawn are among them: the tangents there.
//!
//! Where other base points are infinitely near, each of them is a node of a tree, with directions
//! of its own. A small circle around the base point, lifted to the blow-ups, walks along all
//! exceptional lines, on both sides of each: along the first line to the direction of a near point,
//! from there along half of that point's line, and on (`Fan::walk`). The stations of this walk are
//! rays from the base point, straight in the coordinates of their node; where the walk goes from
//! one exceptional line to the next, it passes the point in which the two meet: a corner, which
//! belongs to both seams.

use crate::base::{BasePoint, BinaryForm, Near, Seam};
use crate::cover::Involution;
use crate::field::{Algebraic, exact};
use crate::finding::{Finding, Unopened};
use crate::region::Region;
use crate::surface::Point3;
use crate::tangents::{real_zeros, tangent_form};
use isoform_algebra::{Poly, QUADRANTS, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::{dot, sub};
use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// How far from its node the bend of a ray is found, and the largest.
const BENT: f64 = 1e-3;
const MOST_BENT: f64 = 8.0;

/// What names a point of a seam: the node, and the direction.
pub(crate) type Key = (usize, [u64; 2]);

/// A direction (a, b) of length 1 in the local coordinates of a node, b > 0 or b = 0 < a.
#[derive(Clone, Debug)]
pub(crate) struct Direction {
    pub(crate) node: usize,
    pub(crate) at: [f64; 2],
    /// Faces of the box that the seam crosses there, as bits.
    pub(crate) faces: u8,
    /// Factors of the region with this tangent.
    pub(crate) factors: Vec<usize>,
    /// How the ray bends to the left of the direction: the rest is forward or backward along it,
    /// this times the square of the distance beside it.
    bend: f64,
}

impl Direction {
    fn new(node: usize, at: [f64; 2]) -> Self {
        let length = at[0].hypot(at[1]);
        let sign = if at[1] < 0.0 || (at[1] == 0.0 && at[0] < 0.0) {
            -1.0
        } else {
            1.0
        };
        // No negative zeros: a direction names a vertex.
        Self {
            node,
            at: at.map(|x| sign * x / length + 0.0),
            faces: 0,
            factors: Vec::new(),
            bend: 0.0,
        }
    }
    /// Whether both are one but for rounding.
    fn is_same(&self, other: &Self) -> bool {
        (self.at[0] * other.at[1] - self.at[1] * other.at[0]).abs() < 1e-12
    }
    fn angle(&self) -> f64 {
        self.at[1].atan2(self.at[0])
    }
    /// What names the point of the seam.
    pub(crate) fn key(&self) -> Key {
        (self.node, self.at.map(f64::to_bits))
    }
    /// A point of the ray or, with the distance beside it, of its neighbourhood.
    fn at_distance(&self, backward: bool, distance: f64, off: f64) -> [f64; 2] {
        let [a, b] = self.at;
        let along = if backward { -distance } else { distance };
        let off = off + self.bend * distance * distance;
        [along * a - off * b, along * b + off * a]
    }
    /// ± (a, b).
    pub(crate) fn signed(&self, backward: bool) -> [f64; 2] {
        if backward {
            self.at.map(|x| -x)
        } else {
            self.at
        }
    }
}

/// A blow-up in the direction (1 : v), or in the direction (0 : 1).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// (u, v) = (u′, u′(v₀ + v′)).
    Along(f64),
    /// (u, v) = (u′v′, v′).
    Across,
}

impl Step {
    fn to(near: &Near) -> Self {
        match near.direction[0].is_zero() {
            true => Self::Across,
            false => Self::Along(near.direction[1].to_f64()),
        }
    }
    fn is_finite(self) -> bool {
        match self {
            Self::Along(v) => v.is_finite(),
            Self::Across => true,
        }
    }
}

/// What is in a direction of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mark {
    /// A ray: the direction's number.
    Station(usize),
    /// A base point infinitely near: its node.
    Near(usize),
    /// Another exceptional line.
    Corner,
}

/// A base point, or one infinitely near to it.
#[derive(Clone)]
struct Node {
    /// Blow-ups that lead to it.
    chain: Vec<Step>,
    curve: [Vec<f64>; 4],
    /// Whether the seam is one point only.
    constant: bool,
    /// The pairs of directions with one image, if the seam runs twice through its points. Partners
    /// of directions are directions.
    cover: Option<Involution>,
    /// Whether two directions have one image everywhere.
    is_double: bool,
    /// What is in which direction, ascending by angle in [0, π), and whether the seam is in the box
    /// between this and the next.
    marks: Vec<(Direction, Mark, bool)>,
    /// X, Y, Z and W there, without what vanishes on exceptional lines; empty if there is no other
    /// node.
    forms: [Form; 4],
}

/// A polynomial in the local coordinates, to rounding.
#[derive(Clone, Debug, Default)]
pub(crate) struct Form {
    pub(crate) terms: Vec<([usize; 2], f64)>,
    pub(crate) order: usize,
}

/// A seam with the blow-ups that lead to it, the axes that are exceptional lines, and the numbers
/// of the seams near to it.
type Found<'a> = (Vec<&'a Near>, [bool; 2], &'a Seam, Vec<usize>);

/// The blow-ups that lead to the last one of base points, each infinitely near to the one before.
fn steps_of(chain: &[&Near]) -> Vec<Step> {
    chain.iter().map(|near| Step::to(near)).collect()
}

/// Whether the first axis, and the second one, of a base point lead to the last one of these too.
fn lifts(chain: &[Step]) -> [bool; 2] {
    [Step::Across, Step::Along(0.0)].map(|along| chain.iter().all(|step| *step == along))
}

/// All seams of a base point with the blow-ups that lead to them, parents first.
fn collect<'a>(
    seam: &'a Seam,
    chain: &[&'a Near],
    exceptional: [bool; 2],
    found: &mut Vec<Found<'a>>,
) {
    let place = found.len();
    found.push((chain.to_vec(), exceptional, seam, Vec::new()));
    for near in &seam.near {
        let exceptional = match near.direction[0].is_zero() {
            true => [exceptional[0], true],
            false => [true, exceptional[1] && near.direction[1].is_zero()],
        };
        let child = found.len();
        found[place].3.push(child);
        collect(&near.seam, &[chain, &[near]].concat(), exceptional, found);
    }
}

/// What proves that a polynomial keeps its sign on a triangle, of which the first corner may be the
/// origin.
type Proof<'a> = &'a dyn Fn(&Form, [[f64; 2]; 3], bool) -> bool;

/// Two rays next to each other, counterclockwise in the local coordinates of the base point.
#[derive(Clone, Debug)]
pub(crate) struct Sector {
    /// Directions, and whether they are backward.
    pub(crate) rays: [(usize, bool); 2],
    /// The mark after the first ray, and that before the second one, each in the coordinates of the
    /// ray's node: the other ray if both have one node and nothing is between them.
    marks: [[f64; 2]; 2],
    /// Where the rays belong to the seams of two nodes: the point that these have in common, as a
    /// direction.
    pub(crate) corner: Option<Direction>,
    /// Whether the seam is in the box there.
    pub(crate) inside: bool,
}

/// A base point and its directions.
#[derive(Clone)]
pub(crate) struct Fan {
    /// Why it cannot be opened.
    pub(crate) problem: Option<Finding>,
    /// Homogeneous coordinates (s, t, w).
    pub(crate) point: [f64; 3],
    variables: [usize; 2],
    one: usize,
    pub(crate) multiplicity: usize,
    half_width: f64,
    nodes: Vec<Node>,
    is_tree: bool,
    /// All rays, up to sign.
    pub(crate) directions: Vec<Direction>,
    /// Around the base point once.
    pub(crate) sectors: Vec<Sector>,
}

fn eval(form: &[f64], [a, b]: [f64; 2]) -> f64 {
    let d = form.len() - 1;
    form.iter()
        .enumerate()
        .map(|(j, c)| c * a.powi((d - j) as i32) * b.powi(j as i32))
        .sum()
}

/// Whether a seam is in the box in a direction, exact for the direction rounded.
fn is_in_box(curve: &[BinaryForm; 4], half_width: &RBig, at: [f64; 2]) -> bool {
    let [a, b] = at.map(exact);
    let [x, y, z, w] = curve.each_ref().map(|f| f.eval(&a, &b));
    let plus = |x: &Algebraic, b: &RBig| {
        Algebraic::new(x.field(), x.root(), x.element().add(&w.element().scaled(b))).sign()
    };
    !w.is_zero()
        && [x, y, z].iter().all(|x| {
            let (low, high) = (plus(x, half_width), plus(x, &-half_width.clone()));
            low != high || low == Ordering::Equal
        })
}

/// A vector as a direction, and whether it is backward.
fn directed(node: usize, x: [f64; 2]) -> (Direction, bool) {
    let d = Direction::new(node, x);
    let backward = d.at[0] * x[0] + d.at[1] * x[1] < 0.0;
    (d, backward)
}

/// A station of the walk around a base point.
struct Station {
    ray: (usize, bool),
    /// The marks before and after it, and whether the seam is in the box between.
    before: ([f64; 2], bool),
    after: ([f64; 2], bool),
}

enum Event {
    Station(Station),
    Corner(Direction),
}

impl Fan {
    /// The directions that matter from the start: of the curves that bound the region or are drawn
    /// in it, and of the sides of the unit triangles.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn new(
        base: &BasePoint,
        region: &Region,
        w_form: &Poly,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut all = Vec::new();
        collect(&base.seam, &[], [false; 2], &mut all);
        let ([u, v], one) = base.chart.variables();
        let point = base.to_f64();
        let mut fan = Self {
            problem: None,
            point,
            variables: [u, v],
            one,
            multiplicity: base.multiplicity(),
            half_width: region.half_width.to_f64().value(),
            nodes: Vec::new(),
            is_tree: false,
            directions: Vec::new(),
            sectors: Vec::new(),
        };
        let mut steps = all.iter().flat_map(|found| steps_of(&found.0));
        if !point.iter().all(|x| x.is_finite()) || steps.any(|step| !step.is_finite()) {
            fan.problem = fan.left_open(Unopened::BeyondDoubles);
            return Ok(fan);
        }
        if all.len() > 1 {
            fan.multiplicity = tangent_form(base, &[], w_form, control)?.degree();
        }
        for found in all {
            let place = fan.nodes.len();
            let seam = found.2;
            let cover = Involution::of(&seam.curve, control)?;
            let marks = fan.marks(base, place, &found, cover, region, control)?;
            // Where other seams begin their vertices have other names.
            let begins = |k: usize| {
                matches!(marks[k].1, Mark::Near(_))
                    && (marks[k].2 || marks[(k + marks.len() - 1) % marks.len()].2)
            };
            let is_double = cover.is_some();
            let cover = cover.filter(|_| !(0..marks.len()).any(begins));
            let forms = seam.forms.each_ref().map(|f| {
                let terms: Vec<([usize; 2], f64)> =
                    f.iter().map(|(e, c)| (*e, c.to_f64())).collect();
                Form {
                    order: terms.iter().map(|([i, j], _)| i + j).min().unwrap_or(0),
                    terms,
                }
            });
            let curve = seam.curve.each_ref().map(BinaryForm::to_f64);
            let constant = curve[0].len() == 1;
            fan.nodes.push(Node {
                chain: steps_of(&found.0),
                curve,
                constant,
                cover,
                is_double,
                marks,
                forms,
            });
        }
        fan.arrange();
        fan.leave_out(region);
        let mut open = fan.sectors.iter().filter(|s| s.inside);
        let first = open
            .clone()
            .next()
            .map(|s| fan.directions[s.rays[0].0].node);
        fan.is_tree = open.any(|s| {
            s.corner.is_some()
                || s.rays
                    .iter()
                    .any(|r| Some(fan.directions[r.0].node) != first)
        });
        fan.directions = fan.directions.iter().map(|d| fan.bent(d.clone())).collect();
        // What is outside of the box need not be opened.
        if !fan.sectors.iter().any(|s| s.inside) {
            fan.problem = None;
        }
        Ok(fan)
    }

    /// What is in which direction of a node.
    fn marks(
        &mut self,
        base: &BasePoint,
        node: usize,
        (chain, exceptional, seam, children): &Found,
        cover: Option<Involution>,
        region: &Region,
        control: &Control<'_>,
    ) -> Result<Vec<(Direction, Mark, bool)>, Stopped> {
        let mut marks: Vec<(Direction, Option<Mark>)> = Vec::new();
        let add_to = |marks: &mut Vec<(Direction, Option<Mark>)>,
                      at: [f64; 2],
                      faces: u8,
                      factors: &[usize],
                      mark: Option<Mark>| {
            let new = Direction::new(node, at);
            let place = marks
                .iter()
                .position(|d| d.0.is_same(&new))
                .unwrap_or_else(|| {
                    marks.push((new, mark));
                    marks.len() - 1
                });
            let d = &mut marks[place].0;
            d.faces |= faces;
            d.factors.extend(
                factors
                    .iter()
                    .filter(|f| !d.factors.contains(f))
                    .copied()
                    .collect::<Vec<_>>(),
            );
        };
        let mut add =
            |at, faces, factors: &[usize], mark| add_to(&mut marks, at, faces, factors, mark);
        // Exact ones first.
        for (near, &child) in seam.near.iter().zip(children) {
            let at = if near.direction[0].is_zero() {
                [0.0, 1.0]
            } else {
                [1.0, near.direction[1].to_f64()]
            };
            add(at, 0, &[], Some(Mark::Near(child)));
        }
        for (at, is_one) in [([0.0, 1.0], exceptional[0]), ([1.0, 0.0], exceptional[1])] {
            if is_one {
                add(at, 0, &[], Some(Mark::Corner));
            }
        }
        let [u, v] = self.variables;
        let lifts = lifts(&steps_of(chain));
        for (k, at, lifts) in [(u, [0.0, 1.0], lifts[0]), (v, [1.0, 0.0], lifts[1])] {
            if base.point[k].is_zero() && lifts {
                add(at, 0, &[], None);
            }
        }
        let mut numbers = seam.curve.iter().flat_map(BinaryForm::to_f64);
        if numbers.any(|c| !c.is_finite()) {
            self.problem = self.left_open(Unopened::BeyondDoubles);
        }
        let mut in_face = false;
        for face in 0..6 {
            let b = if face % 2 == 0 {
                region.half_width.clone()
            } else {
                -region.half_width.clone()
            };
            let sum = seam.curve[face / 2].plus(&seam.curve[3], &b);
            if sum.is_zero() {
                in_face = true;
                continue;
            }
            let factors: Vec<usize> = (0..region.factors.len())
                .filter(|&f| region.faces[f].contains(&face))
                .collect();
            for at in real_zeros(&sum, control)? {
                add(at, 1 << face, &factors, None);
            }
        }
        for f in region
            .extra
            .iter()
            .flatten()
            .copied()
            .chain(region.folds())
            .filter(|&f| region.faces[f].is_empty())
        {
            let form = tangent_form(base, chain, &region.factors[f], control)?;
            for at in real_zeros(&form, control)? {
                add(at, 0, &[f], None);
            }
        }
        // At least three, so that the two sides of the seam are two.
        for k in 0..4 {
            let angle = PI * (0.13 + 0.25 * f64::from(k));
            add([angle.cos(), angle.sin()], 0, &[], None);
        }
        marks.sort_by(|a, b| a.0.angle().total_cmp(&b.0.angle()));
        // A ray at least between two near points or exceptional lines.
        let n = marks.len();
        for k in (0..n).rev() {
            let (first, second) = (&marks[k], &marks[(k + 1) % n]);
            if first.1.is_some() && second.1.is_some() {
                let sign = if k + 1 == n { -1.0 } else { 1.0 };
                let middle =
                    Direction::new(node, [0, 1].map(|i| first.0.at[i] + sign * second.0.at[i]));
                marks.push((middle, None));
            }
        }
        if let Some(cover) = cover {
            // Before the partners of others, so that near ones are known to be these.
            cover
                .fixed()
                .into_iter()
                .for_each(|at| add_to(&mut marks, at, 0, &[], None));
            // Twice: for those that were there already.
            for _ in 0..2 {
                for (d, _) in marks.clone() {
                    add_to(&mut marks, cover.partner(d.at), d.faces, &[], None);
                }
            }
        }
        marks.sort_by(|a, b| a.0.angle().total_cmp(&b.0.angle()));
        let n = marks.len();
        let inside: Vec<bool> = (0..n)
            .map(|k| {
                let sign = if k + 1 == n { -1.0 } else { 1.0 };
                let middle = [0, 1].map(|i| marks[k].0.at[i] + sign * marks[(k + 1) % n].0.at[i]);
                is_in_box(&seam.curve, &region.half_width, middle)
            })
            .collect();
        if in_face && inside.contains(&true) {
            self.problem = self.left_open(Unopened::SeamInFace);
        }
        for (k, (d, mark)) in marks.iter().enumerate() {
            if mark.is_some() && (inside[k] || inside[(k + n - 1) % n]) && d.faces != 0 {
                self.problem = self.left_open(Unopened::SeamsMeetInFace);
            }
        }
        let mut found = Vec::new();
        for ((d, mark), inside) in marks.into_iter().zip(inside) {
            let mark = mark.unwrap_or_else(|| {
                self.directions.push(d.clone());
                Mark::Station(self.directions.len() - 1)
            });
            found.push((d, mark, inside));
        }
        Ok(found)
    }

    fn left_open(&self, why: Unopened) -> Option<Finding> {
        let point = self.point;
        Some(Finding::Unopened { point, why })
    }

    /// The sectors, from the marks of all nodes.
    fn arrange(&mut self) {
        let mut events = Vec::new();
        let whole = 2 * self.nodes[0].marks.len();
        self.walk(0, 0, whole, 1, &mut events);
        let mut stations: Vec<(Station, Vec<Direction>)> = Vec::new();
        let mut first = Vec::new();
        for event in events {
            match event {
                Event::Station(s) => stations.push((s, Vec::new())),
                Event::Corner(d) => stations.last_mut().map_or(&mut first, |s| &mut s.1).push(d),
            }
        }
        if let Some(last) = stations.last_mut() {
            last.1.append(&mut first);
        }
        let n = stations.len();
        self.sectors = (0..n)
            .map(|k| {
                let ((a, corners), (b, _)) = (&stations[k], &stations[(k + 1) % n]);
                debug_assert!(corners.len() <= 1, "a ray between two corners");
                Sector {
                    rays: [a.ray, b.ray],
                    marks: [a.after.0, b.before.0],
                    corner: corners.first().cloned(),
                    inside: a.after.1 && b.before.1,
                }
            })
            .collect();
        let torn = (0..n).any(|k| stations[k].0.after.1 != stations[(k + 1) % n].0.before.1);
        if torn && self.problem.is_none() {
            self.problem = self.left_open(Unopened::SeamsMeetInFace);
        }
    }

    /// Sectors outside of a fundamental domain are not inside.
    fn leave_out(&mut self, region: &Region) {
        let is_held = |s: &Sector| region.is_fundamental(&self.beside(s, 0, true));
        let inside: Vec<bool> = self
            .sectors
            .iter()
            .map(|s| s.inside && is_held(s))
            .collect();
        let all = self.sectors.iter_mut().zip(inside);
        all.for_each(|(s, inside)| s.inside = inside);
    }
    /// A parameter (s : t : w) next to the seam, or to one of the two seams, of a sector: in it, or on
    /// the other hand of the seam.
    fn beside(&self, sector: &Sector, piece: usize, within: bool) -> [RBig; 3] {
        /// How far from the seam, in the coordinates of its node: farther than rounding, nearer than
        /// where what borders the sector turns.
        const NEAR: f64 = 1e-5;
        let (node, [a, b]) = self.piece(sector, piece);
        let (d, backward) = directed(node, [a[0] + b[0], a[1] + b[1]]);
        let off = self.lowered(node, d.at_distance(backward == within, NEAR, 0.0));
        let mut p = self.point.map(exact);
        (0..2).for_each(|i| p[self.variables[i]] += exact(off[i]));
        p
    }
    /// The nodes whose seams are on the border of a fundamental domain.
    pub(crate) fn border_nodes(&self, region: &Region) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        for sector in self.sectors.iter().filter(|s| s.inside) {
            for piece in 0..2 {
                let node = self.piece(sector, piece).0;
                if !self.nodes[node].constant
                    && !region.is_fundamental(&self.beside(sector, piece, false))
                {
                    found.insert(node);
                }
            }
        }
        found
    }
    /// Whether a seam runs twice through its points.
    pub(crate) fn is_double_seam(&self, node: usize) -> bool {
        self.nodes[node].is_double
    }
    /// Points of the seam of a node.
    pub(crate) fn seam_points(&self, node: usize, count: usize) -> Vec<Point3> {
        let direction = |k: usize| {
            let angle = PI * (k as f64 + 0.31) / count as f64;
            Direction::new(node, [angle.cos(), angle.sin()])
        };
        (0..count).map(|k| self.seam(&direction(k))).collect()
    }

    /// From a position of a node to another one, counterclockwise or clockwise: positions count its
    /// marks, and then those in the opposite directions. Both ends are exceptional lines, of which
    /// the walk is on one side; all around the first node they are one and the same.
    fn walk(&self, node: usize, start: usize, end: usize, turn: i64, events: &mut Vec<Event>) {
        let marks = &self.nodes[node].marks;
        let n = marks.len();
        let at = |p: i64| {
            let p = p.rem_euclid(2 * n as i64) as usize;
            (p % n, p >= n)
        };
        let vector = |p: i64| {
            let (k, backward) = at(p);
            marks[k].0.signed(backward)
        };
        // Between a position and the next higher one.
        let inside = |p: i64| marks[at(p).0].2;
        let length = (turn * (end as i64 - start as i64)).rem_euclid(2 * n as i64);
        let whole = length == 0;
        let length = if whole { 2 * n as i64 } else { length };
        for step in 0..=length {
            let p = start as i64 + turn * step;
            let (k, backward) = at(p);
            let (is_first, is_last) = (step == 0, step == length);
            match marks[k].1 {
                Mark::Station(direction) if !(whole && is_last) => {
                    let (before, after) = if turn > 0 {
                        (inside(p - 1), inside(p))
                    } else {
                        (inside(p), inside(p - 1))
                    };
                    events.push(Event::Station(Station {
                        ray: (direction, backward),
                        before: (vector(p - turn), before),
                        after: (vector(p + turn), after),
                    }));
                }
                Mark::Station(_) => {}
                Mark::Corner => events.push(Event::Corner(marks[k].0.clone())),
                Mark::Near(child) => {
                    let [x, y] = vector(p);
                    let o = turn as f64;
                    let (start, middle, end, sign) = match self.nodes[child].chain.last() {
                        Some(Step::Across) => ([o, 0.0], [0.0, y.signum()], [-o, 0.0], y),
                        _ => ([0.0, -o], [x.signum(), 0.0], [0.0, o], x),
                    };
                    let turn = if sign < 0.0 { -turn } else { turn };
                    let place = |v: [f64; 2]| self.position(child, v);
                    // Half of the line, or a quarter where an exceptional line of before goes
                    // through the near point. The first node has none.
                    match (node > 0 && is_first, node > 0 && is_last) {
                        (true, _) => self.walk(child, place(middle), place(end), turn, events),
                        (_, true) => self.walk(child, place(start), place(middle), turn, events),
                        _ if whole && is_last => {}
                        _ => self.walk(child, place(start), place(end), turn, events),
                    }
                }
            }
        }
    }

    /// The position of an axis.
    fn position(&self, node: usize, v: [f64; 2]) -> usize {
        let marks = &self.nodes[node].marks;
        let place = marks
            .iter()
            .position(|m| m.0.at == v.map(f64::abs))
            .expect("an exceptional line is marked");
        if v[0] + v[1] < 0.0 {
            place + marks.len()
        } else {
            place
        }
    }

    /// Whether a piece of a sector has a corner, and the two vectors between which piece 0 or 1 of
    /// it lies, in the coordinates of its ray's node.
    fn piece(&self, sector: &Sector, piece: usize) -> (usize, [[f64; 2]; 2]) {
        let (k, backward) = sector.rays[piece];
        let d = &self.directions[k];
        (d.node, [d.signed(backward), sector.marks[piece]])
    }
    /// The sector between two rays, in either order.
    pub(crate) fn sector_between(
        &self,
        first: (Key, bool),
        second: (Key, bool),
    ) -> Option<&Sector> {
        let name = |r: (usize, bool)| (self.directions[r.0].key(), r.1);
        self.sectors.iter().find(|s| {
            let [a, b] = s.rays.map(name);
            (a, b) == (first, second) || (b, a) == (first, second)
        })
    }
    /// In the middle of a sector's seam, or of one of its two seams, and whether it is backward.
    pub(crate) fn between(&self, sector: &Sector, piece: usize) -> (Direction, bool) {
        let (node, [a, b]) = self.piece(sector, piece);
        let (d, backward) = directed(node, [a[0] + b[0], a[1] + b[1]]);
        (self.bent(d), backward)
    }
    /// The ray of a sector's seam, or of one of its two seams, to a point of a unit triangle.
    pub(crate) fn toward(
        &self,
        quadrant: usize,
        at: [f64; 2],
        sector: &Sector,
        piece: usize,
    ) -> Option<(Direction, bool)> {
        let (node, [a, b]) = self.piece(sector, piece);
        let x = self.lifted(quadrant, at, node);
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        (cross(a, x) * cross(a, b) > 0.0 && cross(x, b) * cross(a, b) > 0.0).then(|| {
            let (d, backward) = directed(node, x);
            (self.bent(d), backward)
        })
    }
    /// Puts one more direction there, and its partner if it has one.
    pub(crate) fn split(&mut self, d: Direction) {
        let partner = self.nodes[d.node]
            .cover
            .map(|c| Direction::new(d.node, c.partner(d.at)));
        for d in [Some(d), partner].into_iter().flatten() {
            self.insert(d);
        }
        self.arrange();
    }
    fn insert(&mut self, d: Direction) {
        let marks = &mut self.nodes[d.node].marks;
        let n = marks.len();
        let at = marks.partition_point(|m| m.0.angle() < d.angle());
        let inside = marks[(at + n - 1) % n].2;
        marks.insert(
            at,
            (d.clone(), Mark::Station(self.directions.len()), inside),
        );
        self.directions.push(d);
    }
    /// The seams that run twice through their points: directions, ascending by angle, and whether
    /// the seam is in the box between each and the next.
    pub(crate) fn doubled(&self) -> impl Iterator<Item = Vec<(&Direction, bool)>> {
        self.nodes
            .iter()
            .filter(|n| n.cover.is_some())
            .map(|n| n.marks.iter().map(|(d, _, inside)| (d, *inside)).collect())
    }
    /// Whether the seam turns back in a direction.
    pub(crate) fn is_fold(&self, d: &Direction) -> bool {
        self.nodes[d.node].cover.is_some_and(|c| {
            c.fixed()
                .into_iter()
                .map(|at| Direction::new(d.node, at))
                .any(|f| f.is_same(d))
        })
    }

    /// The lines s = 0, t = 0, w = 0 that lead through the base point in a direction.
    pub(crate) fn sides_along(&self, d: &Direction) -> impl Iterator<Item = usize> {
        let at = d.at;
        let [u, v] = self.variables;
        let lifts = lifts(&self.nodes[d.node].chain);
        let sides = [(u, at[0], lifts[0]), (v, at[1], lifts[1])].into_iter();
        sides
            .filter(|&(k, x, lifts)| self.point[k] == 0.0 && x == 0.0 && lifts)
            .map(|s| s.0)
            .collect::<Vec<_>>()
            .into_iter()
    }
    pub(crate) fn is_side(&self, d: &Direction) -> bool {
        self.sides_along(d).next().is_some()
    }
    /// The ray along a side toward a point of it.
    pub(crate) fn ray_along(
        &self,
        quadrant: usize,
        side: usize,
        to: [f64; 2],
    ) -> Option<(Key, bool)> {
        let d = self
            .directions
            .iter()
            .find(|d| self.sides_along(d).any(|s| s == side))?;
        let x = self.lifted(quadrant, to, d.node);
        Some((d.key(), d.at[0] * x[0] + d.at[1] * x[1] < 0.0))
    }

    fn forms(&self, d: &Direction) -> [f64; 4] {
        self.nodes[d.node].curve.each_ref().map(|f| eval(f, d.at))
    }
    /// The point of the seam, put on the faces of the box that it is known to be on.
    pub(crate) fn seam(&self, d: &Direction) -> Point3 {
        let [x, y, z, w] = self.forms(d);
        let mut p = [x / w, y / w, z / w];
        for face in (0..6).filter(|f| d.faces >> f & 1 == 1) {
            p[face / 2] = if face % 2 == 0 {
                -self.half_width
            } else {
                self.half_width
            };
        }
        p
    }
    /// The points that whole seams are.
    pub(crate) fn contracted(&self) -> impl Iterator<Item = Point3> {
        self.sectors
            .iter()
            .filter(|s| s.inside)
            .flat_map(|s| s.rays)
            .map(|r| &self.directions[r.0])
            .filter(|d| self.nodes[d.node].constant)
            .map(|d| self.seam(d))
    }
    /// Whether the point of the seam in a direction is all of a seam: of the direction's node, or
    /// of one that it meets there.
    pub(crate) fn is_contracted(&self, d: &Direction) -> bool {
        let meets = |s: &Sector| {
            s.corner.as_ref().is_some_and(|c| c.key() == d.key())
                && s.rays
                    .iter()
                    .any(|r| self.nodes[self.directions[r.0].node].constant)
        };
        self.nodes[d.node].constant || self.sectors.iter().any(meets)
    }
    /// The sign that (s, t, w) needs to be in a quadrant, if it is in it.
    fn sign_in(&self, quadrant: usize) -> Option<f64> {
        let y = self.signed(quadrant, self.point);
        [1.0, -1.0]
            .into_iter()
            .find(|sign| y.iter().all(|y| sign * y >= 0.0))
    }
    fn signed(&self, quadrant: usize, x: [f64; 3]) -> [f64; 3] {
        let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
        [s * x[0], t * x[1], x[2]]
    }
    /// u and v in the unit triangle of a quadrant, if the point is in it.
    pub(crate) fn place(&self, quadrant: usize) -> Option<[f64; 2]> {
        let sign = self.sign_in(quadrant)?;
        let y = self.signed(quadrant, self.point).map(|y| sign * y);
        let sum: f64 = y.iter().sum();
        Some([y[0] / sum, y[1] / sum])
    }
    /// A displacement in the coordinates of the base point as one in the unit triangle, up to a
    /// positive factor, if it leads into it or along its sides.
    fn displaced(&self, quadrant: usize, [a, b]: [f64; 2]) -> Option<[f64; 2]> {
        let sign = self.sign_in(quadrant)?;
        let y = self.signed(quadrant, self.point).map(|y| sign * y);
        let mut x = [0.0; 3];
        x[self.variables[0]] = a;
        x[self.variables[1]] = b;
        let dy = self.signed(quadrant, x).map(|y| sign * y);
        if (0..3).any(|k| y[k] == 0.0 && dy[k] < 0.0) {
            return None;
        }
        let (sum, rate): (f64, f64) = (y.iter().sum(), dy.iter().sum());
        let [u, v] = [0, 1].map(|k| (dy[k] - y[k] / sum * rate) / sum);
        // Along the third side.
        if y[2] == 0.0 && dy[2] == 0.0 {
            Some([u, -u])
        } else {
            Some([u, v])
        }
    }
    /// The direction ± d in the unit triangle of a quadrant, if it leads into it or along its
    /// sides. For the base point's own directions.
    pub(crate) fn direction_in(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
    ) -> Option<[f64; 2]> {
        self.displaced(quadrant, d.signed(backward))
    }
    /// Where the beginning of a ray is in the unit triangle, if it is in it: a small displacement
    /// up to a positive factor.
    pub(crate) fn beginning(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
    ) -> Option<[f64; 2]> {
        if d.node == 0 {
            return self.direction_in(quadrant, d, backward);
        }
        self.displaced(
            quadrant,
            self.lowered(d.node, d.signed(backward).map(|x| x / 1024.0)),
        )
    }
    /// Whether counterclockwise in the coordinates of the base point is so in a unit triangle.
    pub(crate) fn keeps_turn(&self, quadrant: usize) -> bool {
        let y = self.signed(quadrant, self.point);
        let sign = if y.iter().sum::<f64>() < 0.0 {
            -1.0
        } else {
            1.0
        };
        let sum: f64 = y.iter().map(|y| sign * y).sum();
        let [a, b] = [0, 1].map(|k| {
            let mut x = [0.0; 3];
            x[self.variables[k]] = 1.0;
            let dy = self.signed(quadrant, x).map(|y| sign * y);
            let rate: f64 = dy.iter().sum();
            [0, 1].map(|k| dy[k] - sign * y[k] / sum * rate)
        });
        a[0] * b[1] - a[1] * b[0] > 0.0
    }
    /// Whether seams of several base points that are infinitely near have to be opened together.
    pub(crate) fn is_tree(&self) -> bool {
        self.is_tree
    }
    /// From the coordinates of a node to those of the base point.
    fn lowered(&self, node: usize, mut at: [f64; 2]) -> [f64; 2] {
        for step in self.nodes[node].chain.iter().rev() {
            let [x, y] = at;
            at = match step {
                Step::Along(v) => [x, x * (v + y)],
                Step::Across => [x * y, y],
            };
        }
        at
    }
    /// A point of a unit triangle in the coordinates of a node.
    pub(crate) fn lifted(&self, quadrant: usize, [u, v]: [f64; 2], node: usize) -> [f64; 2] {
        let x = self.signed(quadrant, [u, v, 1.0 - u - v]);
        let mut local = self.variables.map(|k| x[k] / x[self.one] - self.point[k]);
        for step in &self.nodes[node].chain {
            let [x, y] = local;
            local = match step {
                Step::Along(v) => [x, y / x - v],
                Step::Across => [x / y, y],
            };
        }
        local
    }
    /// X, Y, Z and W at a point of a node.
    fn value(&self, node: usize, [u, v]: [f64; 2]) -> [f64; 4] {
        let value = |f: &Form| {
            f.terms
                .iter()
                .map(|([i, j], c)| c * u.powi(*i as i32) * v.powi(*j as i32))
                .sum::<f64>()
        };
        self.nodes[node].forms.each_ref().map(value)
    }
    /// Bends a ray of a tree, so that its image leaves the seam at a right angle: others sweep
    /// along the seam, the faster the deeper in the tree.
    fn bent(&self, mut d: Direction) -> Direction {
        if !self.is_tree || d.node == 0 || self.nodes[d.node].constant || self.is_side(&d) {
            return d;
        }
        let point = |x: [f64; 4]| [x[0] / x[3], x[1] / x[3], x[2] / x[3]];
        let curve = |at: [f64; 2]| point(self.nodes[d.node].curve.each_ref().map(|f| eval(f, at)));
        let [a, b] = d.at;
        let ends = [1e-4, -1e-4].map(|x| curve([a - x * b, b + x * a]));
        let (tangent, foot) = (sub(ends[0], ends[1]), curve(d.at));
        let rest = |off: f64| {
            dot(
                sub(
                    point(self.value(d.node, [BENT * a - off * b, BENT * b + off * a])),
                    foot,
                ),
                tangent,
            )
        };
        let (mut off, step) = (0.0, 1e-3 * BENT);
        for _ in 0..8 {
            off -= rest(off) * 2.0 * step / (rest(off + step) - rest(off - step));
        }
        let bend = off / (BENT * BENT);
        if bend.abs() < MOST_BENT {
            d.bend = bend;
        }
        d
    }

    /// The image of a point of a ray at a distance in the coordinates of its node, if that is not
    /// the only one; or beside it, on a face of the box.
    pub(crate) fn image_on_ray(
        &self,
        d: &Direction,
        backward: bool,
        distance: f64,
        face: Option<usize>,
    ) -> Point3 {
        let value = |off: f64| self.value(d.node, d.at_distance(backward, distance, off));
        let mut off = 0.0;
        let bound = |face: usize| {
            if face.is_multiple_of(2) {
                -self.half_width
            } else {
                self.half_width
            }
        };
        if let Some(face) = face {
            let rest = |off: f64| {
                let x = value(off);
                x[face / 2] - bound(face) * x[3]
            };
            let step = 1e-6 * distance;
            for _ in 0..20 {
                let slope = (rest(off + step) - rest(off - step)) / (2.0 * step);
                off -= rest(off) / slope;
            }
        }
        let [x, y, z, w] = value(off);
        let mut p = [x / w, y / w, z / w];
        if let Some(face) = face {
            p[face / 2] = bound(face);
        }
        p
    }
    /// The point of a ray at a distance in the coordinates of its node, if it is in the unit
    /// triangle.
    pub(crate) fn on_ray(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
        distance: f64,
    ) -> Option<[f64; 2]> {
        let at = self.lowered(d.node, d.at_distance(backward, distance, 0.0));
        let mut x = self.point;
        x[self.variables[0]] += at[0];
        x[self.variables[1]] += at[1];
        let y = self.signed(quadrant, x);
        let sign = [1.0, -1.0]
            .into_iter()
            .find(|sign| y.iter().all(|y| sign * y >= 0.0))?;
        let sum: f64 = y.iter().map(|y| sign * y).sum();
        Some([sign * y[0] / sum, sign * y[1] / sum])
    }

    /// Whether W keeps its sign between the two rays of a sector, from the base point to points of
    /// the unit triangle: those on the chord between the rays, and others that the sector reaches
    /// to. In the coordinates of the node farther away from the base point, where W is divided by
    /// what vanishes on exceptional lines.
    pub(crate) fn keeps_sign(
        &self,
        quadrant: usize,
        sector: &Sector,
        points: &[[f64; 2]],
        proof: Proof<'_>,
    ) -> bool {
        let nodes = sector.rays.map(|r| self.directions[r.0].node);
        let deep = if self.nodes[nodes[0]].chain.len() > self.nodes[nodes[1]].chain.len() {
            0
        } else {
            1
        };
        let node = &self.nodes[nodes[deep]];
        let mut points: Vec<[f64; 2]> = points
            .iter()
            .map(|&x| self.lifted(quadrant, x, nodes[deep]))
            .collect();
        if points.iter().flatten().any(|x| !x.is_finite()) {
            return false;
        }
        let form = &node.forms[3];
        let o = [0.0; 2];
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        if nodes[0] == nodes[1] {
            // A triangle that the points are in.
            let [a, b] = sector
                .rays
                .map(|(k, backward)| self.directions[k].signed(backward));
            let turn = cross(a, b).signum();
            let (mut p, mut q) = (a, b);
            points.extend([a, b].map(|x| x.map(|x| 1e-9 * x)));
            for x in &points {
                let x = x.map(|c| c / x[0].hypot(x[1]));
                if turn * cross(x, p) > 0.0 {
                    p = x;
                }
                if turn * cross(q, x) > 0.0 {
                    q = x;
                }
            }
            let area = cross(p, q);
            let reach = points
                .iter()
                .map(|&x| cross(x, q) / area + cross(p, x) / area)
                .fold(0.0, f64::max)
                * 1.02;
            return turn * area > 0.0
                && proof(form, [o, p.map(|x| reach * x), q.map(|x| reach * x)], true);
        }
        // Along the exceptional line of the other node.
        let along = sector.marks[deep];
        let (k, backward) = sector.rays[deep];
        let ray = self.directions[k].signed(backward);
        let beside = if along[0] == 0.0 {
            [ray[0].signum(), 0.0]
        } else {
            [0.0, ray[1].signum()]
        };
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let slope = |x: [f64; 2]| dot(x, along) / dot(x, beside);
        let points: Vec<[f64; 2]> = points
            .iter()
            .map(|&x| [dot(x, along), dot(x, beside)])
            .collect();
        if points.iter().any(|x| x[1] < 0.0) {
            return false;
        }
        let low = points
            .iter()
            .filter(|x| x[1] > 0.0)
            .map(|x| x[0] / x[1])
            .fold(slope(ray), f64::min);
        let far = |i: usize| points.iter().map(|x| x[i]).fold(0.0, f64::max) * 1.02;
        let (high, wide) = (far(0).max(low * far(1)), far(1));
        let at = |x: f64, y: f64| [0, 1].map(|i| x * along[i] + y * beside[i]);
        let (p, q, r) = (at(low * wide, wide), at(high, wide), at(high, 0.0));
        (low * wide >= high || proof(form, [o, p, q], true)) && proof(form, [o, q, r], true)
    }
}
