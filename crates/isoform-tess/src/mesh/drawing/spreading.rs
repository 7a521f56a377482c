//! Insertion of vertices into large triangles that differ from the surface: flips and splits by the
//! shapes of triangles in space are useful only where these resemble the surface.

use super::{Cdt, Drawing, center, is_sliver};
use crate::mesh::geometry::distance;
use crate::mesh::in_chart::InChart;
use crate::mesh::names::Node;
use crate::mesh::plane::{Measure, Shared, is_turned};
use crate::surface::Point3;
use spade::Triangulation;
use std::collections::BTreeSet;

/// Image of a vertex, with the point of the surface that it shares with others.
type VertexImage = (Point3, Option<Shared>);

impl Drawing<'_> {
    /// Returns the centres of triangles in the region that are to be split, except those that are
    /// `known` already.
    fn places_to_spread(
        &self,
        images: &[VertexImage],
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
    /// Inserts vertices into large triangles whose normal or area differs from that of the surface.
    pub(super) fn spread(&mut self, measure: &InChart<'_, '_>) {
        let mut images: Vec<VertexImage> = Vec::new();
        let mut known = BTreeSet::new();
        // At most twelve rounds of insertions.
        for _ in 0..12 {
            let new = self.cdt.vertices().skip(images.len());
            images.extend(new.map(|v| (measure.image(v.data()), measure.shared(v.data()))));
            let places = self.places_to_spread(&images, &mut known, measure);
            // At most 20 000 triangles, and a quarter of the maximum, before refinement in space.
            let enough = (self.glued.atlas.options.triangles / 4).min(20_000);
            if places.is_empty() || self.cdt.num_inner_faces() > enough {
                break;
            }
            self.cdt = with_more(&self.cdt, &places);
        }
    }
}

/// Returns the distance between two places in the parameters.
fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns true if a triangle is large and its normal or area differs from that of the surface.
fn is_to_be_split(
    at: [[f64; 2]; 3],
    [p, q, r]: [VertexImage; 3],
    measure: &InChart<'_, '_>,
) -> bool {
    let is_pinched = [(p.1, q.1), (q.1, r.1), (r.1, p.1)]
        .iter()
        .any(|(a, b)| a.is_some() && a == b);
    // Triangles with shorter edges in the parameters are refined in space.
    let is_long = (0..3).any(|i| length(at[i], at[(i + 1) % 3]) > 0.03);
    // Next to contracted curves, a triangle that is large in the parameters may be degenerate in
    // space.
    let is_apart = || {
        let there = measure.at(center(at));
        // Minimum distance of a new vertex from the corners of its triangle.
        let apart = 0.2 * measure.tolerance(there);
        [p.0, q.0, r.0].iter().all(|&x| distance(x, there) > apart)
    };
    is_long && !is_pinched && is_apart() && is_turned(at, [p.0, q.0, r.0], measure)
}

/// Returns a triangulation with more vertices. They are inserted before the constraints: in a
/// constrained triangulation, point location of spade may cycle and panic.
fn with_more(cdt: &Cdt, places: &[[f64; 2]]) -> Cdt {
    let mut next = Cdt::new();
    let known = cdt.vertices().map(|v| *v.data());
    for node in known.chain(places.iter().map(|&at| Node::inner(at, 0))) {
        // Existing vertices keep their indices; others without a position are left out.
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
