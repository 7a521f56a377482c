//! Further vertices at given places, so that close sheets have them in common.

use super::shape::TriangleShape;
use super::step_counter::StepCounter;
use super::{Measure, NO_TRIANGLE, Plane, RefinementDefects, SPLIT_EXCESS};
use crate::mesh::geometry::{distance, longest};
use crate::mesh::matching::InsertionPlace;
use crate::mesh::names::Node;
use crate::surface::Point3;
use isoform_control::Control;
use isoform_geom::{cross, dot, norm, sub};
use robust::{Coord, orient2d};

/// Returns true if an edge lies on a side of the unit triangle.
fn is_on_side([a, b]: [[f64; 2]; 2]) -> bool {
    let sides = [a, b].map(|[u, v]| [u == 0.0, v == 0.0, v == 1.0 - u]);
    (0..3).any(|k| sides[0][k] && sides[1][k])
}

impl Plane {
    /// Inserts vertices at places, unless there are some nearby, and flips edges around them until
    /// the triangles are Delaunay triangles in space: close sheets with common vertices then have
    /// common edges.
    pub(in crate::mesh) fn insert(
        &mut self,
        places: &[InsertionPlace],
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> RefinementDefects {
        let counter = StepCounter::new(control);
        for place in places {
            if control.is_stopped() {
                break;
            }
            self.insert_one(place, measure);
        }
        let around = |t: u32| {
            self.adjacent[t as usize]
                .into_iter()
                .filter(|&n| n != NO_TRIANGLE)
        };
        let all = 0..self.triangles.len() as u32;
        let is_near = |t: u32| places.iter().any(|p| self.is_in_bounds(t, p.at));
        let near = all.filter(|&t| !counter.is_over() && is_near(t));
        let stack = near.flat_map(|t| around(t).chain([t])).collect();
        self.flip_to_delaunay(stack, measure);
        // The new triangles have to be as near to the surface as all others.
        self.work_off(most, false, measure, control);
        self.tell_apart(most, measure, control)
    }

    /// Returns true if a place is in the bounding rectangle of a triangle.
    fn is_in_bounds(&self, t: u32, place: [f64; 2]) -> bool {
        let at = self.corners(t);
        (0..2).all(|i| {
            let along = at.map(|p| p[i]);
            let lo = along.into_iter().fold(f64::INFINITY, f64::min);
            let hi = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            lo <= place[i] && place[i] <= hi
        })
    }
    /// Flips edges of triangles, and of those that flips change, until all are Delaunay triangles
    /// in space, with a limit on the number of flips.
    fn flip_to_delaunay(&mut self, mut stack: Vec<u32>, measure: &dyn Measure) {
        let mut left = 20 * stack.len() + 100;
        while let Some(t) = stack.pop() {
            for i in 0..3 {
                let n = self.adjacent[t as usize][i];
                if left > 0 && !self.fixed[t as usize][i] && self.make_delaunay(t, i, measure) {
                    left -= 1;
                    stack.extend([t, n]);
                    break;
                }
            }
        }
    }
    /// Flips the edge opposite to corner i if the sum of the angles opposite to it exceeds 180
    /// degrees.
    fn make_delaunay(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let quad = self.quad(t, i);
        let Some(made) = self.other_diagonal(&quad) else {
            return false;
        };
        let [p, q, r, s] = quad.corners.map(|v| self.images[v as usize]);
        if angle(p, q, s) + angle(r, q, s) <= std::f64::consts::PI * (1.0 + 1e-9) {
            return false;
        }
        let sound = made.map(|t| measure.is_sound(self.places(t)));
        let were = [t, quad.n].map(|t| self.shape(t, measure));
        let will_be = made.map(|t| self.shape_of(t, measure));
        let worst = were[0].quality.min(were[1].quality).min(0.0);
        if sound != [true; 2] || will_be.iter().any(|shape| shape.quality < worst) {
            return false;
        }
        // Not away from the surface, although new triangles are tested again.
        let is_off = |shape: &TriangleShape| self.off(shape, measure) > SPLIT_EXCESS;
        if self.is_coarser(&quad, were, will_be, measure) || will_be.iter().any(is_off) {
            return false;
        }
        self.turn(t, &quad, made, sound);
        true
    }

    /// Inserts a vertex at a place, unless there is one nearby, or no triangle contains the place.
    fn insert_one(&mut self, place: &InsertionPlace, measure: &dyn Measure) {
        let node = Node::inner(place.at, place.faces);
        let all = 0..self.triangles.len() as u32;
        let found = match place.faces {
            0 => all
                .map(|t| (t, None))
                .find(|&(t, _)| self.holds(t, place.at)),
            faces => {
                let edges = all.flat_map(|t| [0, 1, 2].map(|i| (t, i)));
                let off = |(t, i)| Some(((t, Some(i)), self.beside_border(t, i, place.at, faces)?));
                let near = edges.filter_map(off).min_by(|a, b| a.1.total_cmp(&b.1));
                near.map(|e| e.0)
            }
        };
        let Some((t, edge)) = found else { return };
        let (image, corners) = (measure.image(&node), self.images_of(t));
        let near = corners.map(|x| distance(x, image));
        // New vertices keep away from the corners of their triangle.
        if near.into_iter().fold(f64::INFINITY, f64::min) > 0.005 * longest(corners) {
            match edge {
                None => self.put_into(t, place.at, measure),
                Some(i) => self.split_border(t, i, node, measure).is_some(),
            };
        }
    }
    /// Returns true if a place is in a triangle.
    fn holds(&self, t: u32, at: [f64; 2]) -> bool {
        let [a, b, c] = self.corners(t).map(|[x, y]| Coord { x, y });
        let p = Coord { x: at[0], y: at[1] };
        [(a, b), (b, c), (c, a)]
            .iter()
            .all(|&(a, b)| orient2d(a, b, p) > 0.0)
    }
    /// Returns the distance of a place from the edge opposite to corner i, if the edge is a border
    /// in a face of the box and the perpendicular from the place meets its interior.
    fn beside_border(&self, t: u32, i: usize, at: [f64; 2], faces: u8) -> Option<f64> {
        let v = self.triangles[t as usize];
        let ends = [v[(i + 1) % 3], v[(i + 2) % 3]].map(|v| &self.nodes[v as usize]);
        // Edges on sides of the unit triangle have another unit triangle beyond them.
        let is_border = self.adjacent[t as usize][i] == NO_TRIANGLE
            && !self.is_rim(t, i)
            && !is_on_side(ends.map(|n| n.at))
            && ends.iter().all(|n| n.faces & faces != 0);
        let [x, y] = ends.map(|n| n.at);
        let (d, p) = ([y[0] - x[0], y[1] - x[1]], [at[0] - x[0], at[1] - x[1]]);
        let size = d[0] * d[0] + d[1] * d[1];
        let share = (d[0] * p[0] + d[1] * p[1]) / size;
        let off = (d[0] * p[1] - d[1] * p[0]).abs() / size.sqrt();
        // Borders in a face of the box are bent little.
        (is_border && share > 0.0 && share < 1.0 && off < 0.1 * size.sqrt()).then_some(off)
    }
}

/// Returns the angle at a point between the segments to two others.
#[inline]
fn angle(at: Point3, x: Point3, y: Point3) -> f64 {
    let (x, y) = (sub(x, at), sub(y, at));
    norm(cross(x, y)).atan2(dot(x, y))
}
