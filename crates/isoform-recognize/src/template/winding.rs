//! Generalised winding number of oriented points, by a tree of dipoles (Barill et al., Fast winding
//! numbers for soups and clouds, ACM Trans. Graphics 37, 2018, to first order).

use isoform_geom::{Aabb, Point3, distance_squared, dot, norm, sub};
use std::f64::consts::PI;
use std::ops::Range;

/// Oriented points with their vector areas, sorted into a tree.
pub(super) struct DipoleTree {
    /// Points with their outward vector areas, in the order of the leaves.
    dipoles: Vec<(Point3, Point3)>,
    /// Nodes in depth-first order.
    nodes: Vec<DipoleSum>,
}

/// Node of the tree: the dipole of its points.
struct DipoleSum {
    /// Centroid of the points, weighted by their areas.
    center: Point3,
    /// Sum of the vector areas.
    area: Point3,
    /// Largest distance of a point from the centre.
    radius: f64,
    points: Range<usize>,
    /// Index of the next node that is not below this one.
    next: usize,
}

impl DipoleTree {
    /// Builds the tree of points with their outward vector areas.
    pub(super) fn new(dipoles: Vec<(Point3, Point3)>) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            dipoles,
        };
        tree.build(0..tree.dipoles.len());
        tree
    }

    /// Adds the node of a range of the points, and those below it.
    fn build(&mut self, range: Range<usize>) {
        let points = &mut self.dipoles[range.clone()];
        if points.is_empty() {
            return;
        }
        let mut node = DipoleSum::new(points, range.clone());
        let index = self.nodes.len();
        let is_leaf = points.len() <= 8 || node.radius == 0.0;
        let half = points.len() / 2;
        if !is_leaf {
            let size = Aabb::from_points(points.iter().map(|(p, _)| p)).size();
            let axis = (1..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
            points.select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]));
        }
        node.next = index + 1;
        self.nodes.push(node);
        if !is_leaf {
            self.build(range.start..range.start + half);
            self.build(range.start + half..range.end);
            self.nodes[index].next = self.nodes.len();
        }
    }

    /// Returns the winding number of the points around a place: near 1 inside of a closed surface,
    /// near 0 outside.
    pub(super) fn winding(&self, at: Point3) -> f64 {
        let mut sum = 0.0;
        let mut k = 0;
        while let Some(node) = self.nodes.get(k) {
            // From four radii on the points count as one dipole: winding numbers are off by at most
            // 0.02, and samples are decided by 0.25.
            if distance_squared(node.center, at) > (4.0 * node.radius).powi(2) {
                sum += solid_angle(node.center, node.area, at);
                k = node.next;
                continue;
            }
            let is_leaf = node.next == k + 1;
            if is_leaf {
                let points = &self.dipoles[node.points.clone()];
                let angle = |(p, area): &(Point3, Point3)| solid_angle(*p, *area, at);
                sum += points.iter().map(angle).sum::<f64>();
            }
            k += 1;
        }
        sum / (4.0 * PI)
    }
}

impl DipoleSum {
    /// Returns the node of some points, as a leaf.
    fn new(points: &[(Point3, Point3)], range: Range<usize>) -> Self {
        let (mut weight, mut center, mut area) = (0.0, [0.0; 3], [0.0; 3]);
        for (p, a) in points {
            let size = norm(*a);
            weight += size;
            for k in 0..3 {
                center[k] += size * p[k];
                area[k] += a[k];
            }
        }
        let center = match weight > 0.0 {
            true => center.map(|v| v / weight),
            false => points[0].0,
        };
        let squared = points.iter().map(|(p, _)| distance_squared(*p, center));
        Self {
            center,
            area,
            radius: squared.fold(0.0, f64::max).sqrt(),
            points: range,
            next: 0,
        }
    }
}

/// Returns the solid angle of a small vector area at `p`, seen from a place.
fn solid_angle(p: Point3, area: Point3, at: Point3) -> f64 {
    let d = sub(p, at);
    let r = norm(d);
    dot(area, d) / (r * r * r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;

    /// Points on the unit sphere, on a golden spiral, with equal areas.
    fn sphere(n: usize) -> Vec<(Point3, Point3)> {
        let on = |i: usize| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
            let (r, t) = ((1.0 - z * z).sqrt(), 2.4 * i as f64);
            [r * t.cos(), r * t.sin(), z]
        };
        let area = 4.0 * PI / n as f64;
        (0..n).map(|i| (on(i), on(i).map(|v| area * v))).collect()
    }

    #[test]
    fn dipoles_have_the_winding_number_of_their_points() {
        let points = sphere(3000);
        let tree = DipoleTree::new(points.clone());
        let mut random = Random::new(7);
        for _ in 0..300 {
            let at: Point3 = std::array::from_fn(|_| 3.0 * random.unit() - 1.5);
            if (norm(at) - 1.0).abs() < 0.1 {
                continue;
            }
            let angles = points.iter().map(|(p, a)| solid_angle(*p, *a, at));
            let direct = angles.sum::<f64>() / (4.0 * PI);
            let fast = tree.winding(at);
            assert!((fast - direct).abs() < 0.02, "{at:?}: {fast} for {direct}");
            let exact = f64::from(u8::from(norm(at) < 1.0));
            assert!((fast - exact).abs() < 0.03, "{at:?}: {fast} for {exact}");
        }
    }

    #[test]
    fn equal_points_and_none_end() {
        assert_eq!(DipoleTree::new(Vec::new()).winding([0.0; 3]), 0.0);
        let same = vec![([1.0, 0.0, 0.0], [0.1, 0.0, 0.0]); 100];
        let winding = DipoleTree::new(same).winding([0.0; 3]);
        assert!((winding - 10.0 / (4.0 * PI)).abs() < 1e-12);
    }
}
