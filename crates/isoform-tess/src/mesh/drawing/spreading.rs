//! Vertices in large triangles that do not look like the surface: flips and splits by what
//! triangles are in space are of use only where they do.

use super::{Cdt, Drawing, center, is_sliver};
use crate::mesh::geometry::distance;
use crate::mesh::in_chart::InChart;
use crate::mesh::names::Node;
use crate::mesh::plane::{Measure, Shared, is_turned};
use crate::surface::Point3;
use spade::Triangulation;
use std::collections::BTreeSet;

/// Rounds in which vertices are put into triangles.
const ROUNDS: usize = 12;
/// The number of triangles of a unit triangle at which no more vertices are put into them.
const ENOUGH: usize = 20_000;
/// The length of an edge in the parameters up to which a triangle is left to be split in space.
const LONG: f64 = 0.03;
/// The least distance of a further vertex from the corners of its triangle, in tolerances.
const APART: f64 = 0.2;

/// The image of a vertex, and what it shares with others.
type Seen = (Point3, Option<Shared>);

impl Drawing<'_> {
    /// The middles of triangles in the region that are to be split; triangles that are `known`
    /// already are passed over.
    fn places_to_spread(
        &self,
        images: &[Seen],
        known: &mut BTreeSet<[usize; 3]>,
        measure: &InChart<'_, '_>,
    ) -> Vec<[f64; 2]> {
        let mut places = Vec::new();
        for face in self.cdt.inner_faces() {
            let v = face.vertices();
            let mut sorted = v.map(|v| v.index());
            sorted.sort_unstable();
            let nodes = v.map(|v| *v.data());
            if !known.insert(sorted) || nodes.iter().any(|n| n.apex) || is_sliver(nodes) {
                continue;
            }
            let at = nodes.map(|n| n.at);
            let seen = v.map(|v| images[v.index()]);
            if is_to_be_split(at, seen, measure) && self.is_inside(center(at)) {
                places.push(center(at));
            }
        }
        places
    }
    /// Puts vertices into large triangles that do not face the way the surface does, or have
    /// another area.
    pub(super) fn spread(&mut self, measure: &InChart<'_, '_>) {
        let mut images: Vec<Seen> = Vec::new();
        let mut known = BTreeSet::new();
        for _ in 0..ROUNDS {
            let new = self.cdt.vertices().skip(images.len());
            images.extend(new.map(|v| (measure.image(v.data()), measure.shared(v.data()))));
            let places = self.places_to_spread(&images, &mut known, measure);
            let enough = ENOUGH.min(self.glued.atlas.options.triangles / 4);
            if places.is_empty() || self.cdt.num_inner_faces() > enough {
                break;
            }
            self.cdt = with_more(&self.cdt, &places);
        }
    }
}

/// The distance of two places in the parameters.
fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Whether a triangle is large and does not look like the surface.
fn is_to_be_split(at: [[f64; 2]; 3], [p, q, r]: [Seen; 3], measure: &InChart<'_, '_>) -> bool {
    let is_pinched = [(p.1, q.1), (q.1, r.1), (r.1, p.1)]
        .iter()
        .any(|(a, b)| a.is_some() && a == b);
    let is_long = (0..3).any(|i| length(at[i], at[(i + 1) % 3]) > LONG);
    // Next to contracted curves what is large in the parameters may be nothing in space.
    let is_apart = || {
        let there = measure.at(center(at));
        let apart = APART * measure.tolerance(there);
        [p.0, q.0, r.0].iter().all(|&x| distance(x, there) > apart)
    };
    is_long && !is_pinched && is_apart() && is_turned(at, [p.0, q.0, r.0], measure)
}

/// A triangulation with more vertices. They come before its constraints: in a constrained
/// triangulation spade may walk in a circle as it looks for their triangles, and panic.
fn with_more(cdt: &Cdt, places: &[[f64; 2]]) -> Cdt {
    let mut next = Cdt::new();
    let known = cdt.vertices().map(|v| *v.data());
    for node in known.chain(places.iter().map(|&at| Node::inner(at, 0))) {
        // Known ones keep their numbers; others without a position are left out.
        let _ = next.insert(node);
    }
    for edge in cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
        let [a, b] = edge.vertices().map(|v| v.fix());
        if next.can_add_constraint(a, b) {
            next.add_constraint(a, b);
        }
    }
    next
}
