//! Opening of base points: the directions in which a base point is approached, and the
//! corresponding points of its seam curves.
//!
//! A direction and its opposite lead to one point (C. L. Bajaj, A. Royappa, 1994, Theorem 1), so
//! directions are stored up to sign. They include the tangents of the curves that bound the region
//! or are drawn in it.
//!
//! Where other base points are infinitely near, each of them is a node of a tree, with directions
//! of its own. A small circle around the base point, lifted to the blow-ups, traverses all
//! exceptional lines on both sides: along the first line to the direction of a near point, from
//! there along half of the line of that point, and so on (`walk`). The stations of this walk are
//! rays from the base point, straight or bent in the coordinates of their node. Where the walk
//! changes from one exceptional line to another, it passes their point of intersection: a corner,
//! which belongs to both seams.
//!
//! - *node*: the base point, or a base point infinitely near to it; it has local coordinates (u,
//!   v).
//! - *exceptional line*: the projective line of directions to which a node is blown up; its image
//!   under the map is the *seam*, a curve of the surface or a point.
//! - *ray*: a curve from the node in a direction, forward or *backward*.
//! - *mark*: a direction of a node, with its target: a ray, a near point, or a corner.
//! - *sector*: the part between a ray and the next one.

mod blow_up;
mod direction;
mod image;
mod marks;
mod node;
mod place;
mod sign;
mod walk;

pub(crate) use direction::{Direction, Key};
pub(crate) use node::Form;

use crate::base::BasePoint;
use crate::cover::Involution;
use crate::field::exact;
use crate::finding::{Finding, Unopened};
use crate::region::Region;
use crate::surface::Point3;
use crate::tangents::tangent_form;
use blow_up::{Line, steps_of};
use isoform_algebra::{Poly, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::plane::cross;
use marks::{FanInput, Mark, NodeMarks, Target, marks};
use node::Node;
use std::collections::BTreeSet;

/// Two successive rays, counterclockwise in the local coordinates of the base point.
#[derive(Clone, Debug)]
pub(crate) struct Sector {
    /// Indices of the directions, each with true if the ray is backward.
    pub(crate) rays: [(usize, bool); 2],
    /// Marks after the first ray and before the second one, each in the coordinates of the ray's
    /// node: the respective other ray if both rays have one node and are adjacent marks.
    marks: [[f64; 2]; 2],
    /// Common point of the two seams, as a direction; `None` if both rays belong to one node.
    pub(crate) corner: Option<Direction>,
    /// True if the seam of the sector is in the box.
    pub(crate) inside: bool,
}

/// A base point with its directions and sectors.
#[derive(Clone)]
pub(crate) struct Fan {
    /// Reason why the base point cannot be opened, if any.
    pub(crate) problem: Option<Finding>,
    /// Homogeneous coordinates (s : t : w).
    pub(crate) point: [f64; 3],
    /// Indices of the variables among (s, t, w) that are the local coordinates.
    variables: [usize; 2],
    /// Index of the variable among (s, t, w) that is 1.
    one: usize,
    /// Order of W at the base point if other nodes are near to it, else the multiplicity of the
    /// base point.
    pub(crate) multiplicity: usize,
    half_width: f64,
    /// Nodes, parents before the nodes near to them; the first one is the base point.
    nodes: Vec<Node>,
    is_tree: bool,
    /// Directions of all rays, up to sign.
    pub(crate) directions: Vec<Direction>,
    /// Sectors, once around the base point.
    pub(crate) sectors: Vec<Sector>,
}

impl Fan {
    /// Creates the fan with the directions of the curves that bound the region or are drawn in it,
    /// and of the sides of the unit triangles.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn new(
        base: &BasePoint,
        region: &Region,
        w_form: &Poly,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let lines = Line::all(base);
        let mut fan = Self::closed(base, region);
        let mut steps = lines.iter().flat_map(|line| steps_of(&line.chain));
        if !fan.point.iter().all(|x| x.is_finite()) || steps.any(|step| !step.is_finite()) {
            fan.problem = fan.left_open(Unopened::BeyondDoubles);
            return Ok(fan);
        }
        if lines.len() > 1 {
            fan.multiplicity = tangent_form(base, &[], w_form, control)?.degree();
        }
        let around = FanInput {
            base,
            region,
            control,
        };
        for line in &lines {
            fan.add_node(line, &around)?;
        }
        fan.arrange();
        fan.leave_out(region);
        fan.is_tree = fan.opens_several_nodes();
        fan.directions = fan.directions.iter().map(|d| fan.bent(d.clone())).collect();
        // A base point whose seam is entirely outside of the box need not be opened.
        if !fan.sectors.iter().any(|s| s.inside) {
            fan.problem = None;
        }
        Ok(fan)
    }
    /// Returns a base point without directions.
    fn closed(base: &BasePoint, region: &Region) -> Self {
        let (variables, one) = base.chart.variables();
        Self {
            problem: None,
            point: base.to_f64(),
            variables,
            one,
            multiplicity: base.multiplicity(),
            half_width: region.half_width.to_f64().value(),
            nodes: Vec::new(),
            is_tree: false,
            directions: Vec::new(),
            sectors: Vec::new(),
        }
    }
    /// Adds the next node, with its directions.
    fn add_node(&mut self, line: &Line<'_>, around: &FanInput<'_>) -> Result<(), Stopped> {
        let cover = Involution::find(&line.seam.curve, around.control)?;
        let (node, first_ray) = (self.nodes.len(), self.directions.len());
        let NodeMarks { marks, problem } = marks(node, line, cover, around, first_ray)?;
        if let Some(why) = problem {
            self.problem = self.left_open(why);
        }
        let rays = marks.iter().filter(|m| matches!(m.target, Target::Ray(_)));
        self.directions.extend(rays.map(|m| m.direction.clone()));
        self.nodes.push(Node::new(line, marks, cover));
        Ok(())
    }
    fn left_open(&self, why: Unopened) -> Option<Finding> {
        let point = self.point;
        Some(Finding::Unopened { point, why })
    }
    /// Returns true if the seams in the box belong to several nodes.
    fn opens_several_nodes(&self) -> bool {
        let open = || self.sectors.iter().filter(|s| s.inside);
        let mut nodes = open()
            .flat_map(|s| s.rays)
            .map(|r| self.directions[r.0].node);
        let first = nodes.next();
        open().any(|s| s.corner.is_some()) || nodes.any(|node| Some(node) != first)
    }

    /// Marks the sectors outside of a fundamental domain as not inside.
    fn leave_out(&mut self, region: &Region) {
        let is_held = |s: &Sector| region.is_fundamental(&self.beside(s, 0, true));
        let held: Vec<bool> = self
            .sectors
            .iter()
            .map(|s| s.inside && is_held(s))
            .collect();
        for (sector, is_held) in self.sectors.iter_mut().zip(held) {
            sector.inside = is_held;
        }
    }
    /// Returns a parameter (s : t : w) next to the seam, or to one of the two seams, of a sector:
    /// in the sector if `within`, else on the other side of the seam.
    fn beside(&self, sector: &Sector, piece: usize, within: bool) -> [RBig; 3] {
        let (d, backward) = self.middle(sector, piece);
        // Distance from the seam, in coordinates of the node: larger than rounding, smaller than
        // the distance at which the borders of the sector turn.
        let off = self.lowered(d.node, d.at_distance(backward == within, 1e-5, 0.0));
        let mut p = self.point.map(exact);
        for (k, off) in self.variables.into_iter().zip(off) {
            p[k] += exact(off);
        }
        p
    }
    /// Returns the nodes whose seams are on the border of a fundamental domain.
    pub(crate) fn border_nodes(&self, region: &Region) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        for sector in self.sectors.iter().filter(|s| s.inside) {
            for piece in 0..2 {
                let node = self.piece(sector, piece).0;
                if !self.nodes[node].is_constant
                    && !region.is_fundamental(&self.beside(sector, piece, false))
                {
                    found.insert(node);
                }
            }
        }
        found
    }
    /// Returns true if the seam of a node covers its image twice.
    pub(crate) fn is_double_seam(&self, node: usize) -> bool {
        self.nodes[node].is_double
    }

    /// Returns the node of piece 0 or 1 of a sector, and the two vectors that bound the piece, in
    /// the coordinates of that node. Without a corner each piece is the whole sector.
    fn piece(&self, sector: &Sector, piece: usize) -> (usize, [[f64; 2]; 2]) {
        let (k, backward) = sector.rays[piece];
        let d = &self.directions[k];
        (d.node, [d.signed(backward), sector.marks[piece]])
    }
    /// Returns the direction in the middle of a piece, with true if it is backward.
    fn middle(&self, sector: &Sector, piece: usize) -> (Direction, bool) {
        let (node, [a, b]) = self.piece(sector, piece);
        Direction::of_vector(node, [a[0] + b[0], a[1] + b[1]])
    }
    /// Returns the sector between two rays, given in either order.
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
    /// Returns the direction in the middle of a sector's seam, or of one of its two seams, with
    /// true if it is backward; its ray is bent if needed.
    pub(crate) fn between(&self, sector: &Sector, piece: usize) -> (Direction, bool) {
        let (d, backward) = self.middle(sector, piece);
        (self.bent(d), backward)
    }
    /// Returns the ray to a point of a unit triangle, if it starts in the given piece of the
    /// sector.
    pub(crate) fn toward(
        &self,
        quadrant: usize,
        at: [f64; 2],
        sector: &Sector,
        piece: usize,
    ) -> Option<(Direction, bool)> {
        let (node, [a, b]) = self.piece(sector, piece);
        let x = self.lifted(quadrant, at, node);
        let is_between = cross(a, x) * cross(a, b) > 0.0 && cross(x, b) * cross(a, b) > 0.0;
        is_between.then(|| {
            let (d, backward) = Direction::of_vector(node, x);
            (self.bent(d), backward)
        })
    }
    /// Adds a direction, and its partner if it has one.
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
        let at = marks.partition_point(|m| m.direction.angle() < d.angle());
        let mark = Mark {
            direction: d.clone(),
            target: Target::Ray(self.directions.len()),
            is_inside: marks[(at + n - 1) % n].is_inside,
        };
        marks.insert(at, mark);
        self.directions.push(d);
    }
    /// Iterates over the seams that cover their images twice: their directions, ascending by angle,
    /// each with true if the seam is in the box up to the next one.
    pub(crate) fn doubled(&self) -> impl Iterator<Item = Vec<(&Direction, bool)>> {
        let doubled = self.nodes.iter().filter(|n| n.cover.is_some());
        doubled.map(|n| {
            n.marks
                .iter()
                .map(|m| (&m.direction, m.is_inside))
                .collect()
        })
    }
    /// Returns true if the seam turns back in a direction.
    pub(crate) fn is_fold(&self, d: &Direction) -> bool {
        let is_here = |at: [f64; 2]| Direction::new(d.node, at).is_same(d);
        let cover = &self.nodes[d.node].cover;
        cover.is_some_and(|c| c.fixed().into_iter().any(is_here))
    }
    /// Iterates over the images of seams that are single points.
    pub(crate) fn contracted(&self) -> impl Iterator<Item = Point3> {
        let open = self.sectors.iter().filter(|s| s.inside);
        open.flat_map(|s| s.rays)
            .map(|r| &self.directions[r.0])
            .filter(|d| self.nodes[d.node].is_constant)
            .map(|d| self.seam(d))
    }
    /// Returns true if a direction leads to a seam that is a single point: the seam of the
    /// direction's node, or one that it meets there.
    pub(crate) fn is_contracted(&self, d: &Direction) -> bool {
        let is_point = |r: &(usize, bool)| self.nodes[self.directions[r.0].node].is_constant;
        let meets_point = |s: &Sector| {
            s.corner.as_ref().is_some_and(|c| c.key() == d.key()) && s.rays.iter().any(is_point)
        };
        self.nodes[d.node].is_constant || self.sectors.iter().any(meets_point)
    }
    /// Returns true if seams of several infinitely near base points have to be opened together.
    pub(crate) fn is_tree(&self) -> bool {
        self.is_tree
    }
}
