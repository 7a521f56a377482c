//! The topology of a real plane algebraic curve in the projective plane, from its arrangements in
//! the four unit triangles.

use crate::arrangement::{Arrangement, ArrangementError};
use crate::poly::Poly;
use dashu_ratio::RBig;
use isoform_control::Control;
use std::collections::BTreeMap;

/// Components of a real curve, counted by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurveTopology {
    /// Number of closed components without branching that do not change the sides of the plane:
    /// each bounds a disc. Cusps do not count as branching.
    pub ovals: usize,
    /// Number of closed components without branching along which the plane is a Möbius strip, such
    /// as lines.
    pub pseudolines: usize,
    /// Number of components with points where more than two branches end.
    pub singular: usize,
    /// Number of isolated points.
    pub isolated: usize,
}

/// Signs of s and t in the four unit triangles: (s : t : w) = (±u : ±v : 1 − u − v).
pub const QUADRANTS: [[i64; 2]; 4] = [[1, 1], [-1, 1], [-1, -1], [1, -1]];

/// Returns a form in variables 0, 1, 2 (s, t, w) as a polynomial in u, v (0, 1) of one of the unit
/// triangles.
pub fn in_triangle(form: &Poly, quadrant: usize) -> Poly {
    let [s, t] = QUADRANTS[quadrant];
    let (u, v) = (Poly::var(0), Poly::var(1));
    let w = Poly::one() - &u - &v;
    form.compose(&[u.scale(&RBig::from(s)), v.scale(&RBig::from(t)), w])
}

/// Points of the curve, with one name in all triangles to which they belong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum CurveNode {
    /// Point inside a triangle: wall and point.
    Inner(usize, usize, usize),
    /// Point on a side: on s = 0, by the sign of t and the order; on t = 0, by that of s; on w = 0,
    /// by that of s t.
    Side(usize, i64, usize),
    /// Corner (0:0:1), (1:0:0) or (0:1:0).
    Corner(usize),
}

/// Returns the components of the zero set of a form in variables 0, 1, 2; multiple components count
/// once.
///
/// ```
/// use isoform_algebra::{Poly, curve_topology};
/// use isoform_control::Control;
///
/// // An elliptic curve with three real roots: an oval, and a branch that is closed at infinity.
/// let form = Poly::parse("y^2*w - x^3 + x*w^2", &["x", "y", "w"])?;
/// let found = curve_topology(&form, &Control::default())?;
/// assert_eq!((found.ovals, found.pseudolines, found.singular), (1, 1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ArrangementError`].
pub fn curve_topology(
    form: &Poly,
    control: &Control<'_>,
) -> Result<CurveTopology, ArrangementError> {
    let mut graph = CurveGraph::default();
    if !form.is_constant() {
        for quadrant in 0..4 {
            let arrangement = Arrangement::new(&[in_triangle(form, quadrant)], control)?;
            graph.add(&arrangement, quadrant);
        }
    }
    Ok(graph.components())
}

/// Point of one triangle: index of its wall, and index on the wall.
type TrianglePoint = (usize, usize);

/// Point of the curve in the coordinates of one triangle.
#[derive(Clone, Copy)]
struct NamedPoint {
    node: CurveNode,
    /// True if the triangle represents the point by −(s, t, w): points with w = 0 are counted with
    /// s > 0, or s = 0 and t > 0.
    is_opposite: bool,
}

/// Part of a curve in one triangle.
struct CurveInTriangle<'a> {
    arrangement: &'a Arrangement,
    quadrant: usize,
}

impl CurveInTriangle<'_> {
    /// Returns true if a point of a wall lies on the curve.
    fn has(&self, (k, p): TrianglePoint) -> bool {
        let wall = &self.arrangement.walls[k];
        wall.points[p].curves.contains(&0) || wall.vertical.contains(&0)
    }

    /// Returns all points of walls, ascending. Points on sides have one name in both triangles.
    fn points(&self) -> BTreeMap<TrianglePoint, NamedPoint> {
        let mut on_sides = [0; 3];
        let spots = self.arrangement.walls.iter().enumerate();
        spots
            .flat_map(|(k, wall)| (0..wall.points.len()).map(move |p| (k, p)))
            .map(|spot| (spot, self.seen(spot, &mut on_sides)))
            .collect()
    }

    /// Returns the name of the next point; `on_sides` counts the points of the curve on each side
    /// so far.
    fn seen(&self, (k, p): TrianglePoint, on_sides: &mut [usize; 3]) -> NamedPoint {
        let [s, t] = QUADRANTS[self.quadrant];
        let walls = &self.arrangement.walls;
        let top = walls[k].points.len() - 1;
        let mut on_side = |side: usize, sign: i64| {
            on_sides[side] += usize::from(self.has((k, p)));
            CurveNode::Side(side, sign, on_sides[side])
        };
        let (node, is_opposite) = if k == walls.len() - 1 {
            (CurveNode::Corner(1), s < 0)
        } else if k == 0 && p == 0 {
            (CurveNode::Corner(0), false)
        } else if k == 0 && p == top {
            (CurveNode::Corner(2), t < 0)
        } else if k == 0 {
            (on_side(0, t), false)
        } else if p == 0 {
            (on_side(1, s), false)
        } else if p == top {
            (on_side(2, s * t), s < 0)
        } else {
            (CurveNode::Inner(self.quadrant, k, p), false)
        };
        NamedPoint { node, is_opposite }
    }

    /// Returns the pairs of points that an arc, or a part of a vertical line, joins.
    fn inner_edges(&self) -> Vec<[TrianglePoint; 2]> {
        let mut edges = Vec::new();
        for (k, slab) in self.arrangement.slabs.iter().enumerate() {
            let arcs = slab.arcs.iter().filter(|a| a.curve == 0);
            edges.extend(arcs.map(|arc| [(k, arc.left), (k + 1, arc.right)]));
        }
        let walls = self.arrangement.walls.iter().enumerate();
        for (k, wall) in walls.filter(|(_, w)| w.vertical.contains(&0)) {
            edges.extend((1..wall.points.len()).map(|p| [(k, p - 1), (k, p)]));
        }
        edges
    }

    /// Returns the pairs of neighbours on sides that belong to the curve, each side from one of its
    /// two triangles.
    fn side_edges(&self) -> Vec<[TrianglePoint; 2]> {
        let [s, _] = QUADRANTS[self.quadrant];
        let walls = &self.arrangement.walls;
        let sides = self.arrangement.sides[0];
        let mut edges = Vec::new();
        if sides[0] && self.quadrant.is_multiple_of(2) {
            edges.extend(self.along((0..walls[0].points.len()).map(|p| (0, p)).collect()));
        }
        if sides[1] && self.quadrant < 2 {
            edges.extend(self.along((0..walls.len()).map(|k| (k, 0)).collect()));
        }
        if sides[2] && s > 0 {
            let tops = walls.iter().map(|w| w.points.len() - 1);
            edges.extend(self.along(tops.enumerate().collect()));
        }
        edges
    }

    /// Returns the pairs of neighbours among the corners and the points of other components on a
    /// side.
    fn along(&self, mut side: Vec<TrianglePoint>) -> Vec<[TrianglePoint; 2]> {
        let ends = [side[0], side[side.len() - 1]];
        side.retain(|spot| self.has(*spot) || ends.contains(spot));
        side.windows(2).map(|w| [w[0], w[1]]).collect()
    }
}

/// Curve as a graph of points and arcs.
#[derive(Default)]
struct CurveGraph {
    nodes: BTreeMap<CurveNode, usize>,
    /// Ends, with true if the path from one to the other changes between (s, t, w) and −(s, t, w).
    edges: Vec<(usize, usize, bool)>,
}

impl CurveGraph {
    fn node(&mut self, node: CurveNode) -> usize {
        let next = self.nodes.len();
        *self.nodes.entry(node).or_insert(next)
    }

    /// Adds the part of the curve in one triangle.
    fn add(&mut self, arrangement: &Arrangement, quadrant: usize) {
        let triangle = CurveInTriangle {
            arrangement,
            quadrant,
        };
        let points = triangle.points();
        for (_, seen) in points.iter().filter(|(spot, _)| triangle.has(**spot)) {
            self.node(seen.node);
        }
        for edge in [triangle.inner_edges(), triangle.side_edges()].concat() {
            let [a, b] = edge.map(|spot| points[&spot]);
            let (from, to) = (self.node(a.node), self.node(b.node));
            let turns = a.is_opposite != b.is_opposite;
            self.edges.push((from, to, turns));
        }
    }

    /// Returns the component to which each node belongs, as the index of one of its nodes.
    fn component_of_nodes(&self) -> Vec<usize> {
        let mut of: Vec<usize> = (0..self.nodes.len()).collect();
        for &(a, b, _) in &self.edges {
            let (from, to) = (of[a], of[b]);
            of.iter_mut()
                .for_each(|c| *c = if *c == from { to } else { *c });
        }
        of
    }
    /// Counts the components by kind: a component of nodes with two edges each is a closed curve,
    /// an oval if it crosses the line at infinity an even number of times.
    fn components(&self) -> CurveTopology {
        let n = self.nodes.len();
        let of = self.component_of_nodes();
        let mut degree = vec![0usize; n];
        for &(a, b, _) in &self.edges {
            degree[a] += 1;
            degree[b] += 1;
        }
        let mut out = CurveTopology::default();
        for c in 0..n {
            let members: Vec<usize> = (0..n).filter(|&v| of[v] == c).collect();
            if members.is_empty() {
                continue;
            }
            let turns = self.edges.iter().filter(|e| of[e.0] == c && e.2).count();
            if members.iter().all(|&v| degree[v] == 0) {
                out.isolated += 1;
            } else if members.iter().any(|&v| degree[v] != 2) {
                out.singular += 1;
            } else if turns % 2 == 1 {
                out.pseudolines += 1;
            } else {
                out.ovals += 1;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(form: &str) -> [usize; 4] {
        let form = Poly::parse(form, &["s", "t", "w"]).expect("a polynomial");
        assert!(form.is_homogeneous());
        let t = curve_topology(&form, &Control::default()).expect("a curve");
        [t.ovals, t.pseudolines, t.singular, t.isolated]
    }

    #[test]
    fn lines_and_conics() {
        assert_eq!(topology("w"), [0, 1, 0, 0]);
        assert_eq!(topology("s"), [0, 1, 0, 0]);
        assert_eq!(topology("3*s - 5*t + 7*w"), [0, 1, 0, 0]);
        assert_eq!(topology("s - w"), [0, 1, 0, 0]);
        assert_eq!(topology("s^2 + t^2 - w^2"), [1, 0, 0, 0]);
        assert_eq!(topology("s*t - w^2"), [1, 0, 0, 0]);
        assert_eq!(topology("s^2 + t^2 + w^2"), [0, 0, 0, 0]);
        assert_eq!(topology("s^2 + t^2"), [0, 0, 0, 1]);
        assert_eq!(topology("s*t"), [0, 0, 1, 0]);
        assert_eq!(
            topology("(s^2 + t^2 - w^2)^2*(s^2 + t^2 - 4*w^2)"),
            [2, 0, 0, 0]
        );
    }

    #[test]
    fn singular_cubics_and_quartics() {
        assert_eq!(topology("t^2*w - s^3"), [0, 1, 0, 0], "a cusp");
        assert_eq!(topology("t^2*w - s^3 - s^2*w"), [0, 0, 1, 0], "a node");
        assert_eq!(
            topology("t^2*w - s^3 + s^2*w"),
            [0, 1, 0, 1],
            "an isolated point"
        );
        assert_eq!(topology("t^2*w - s^3 + s*w^2"), [1, 1, 0, 0], "an oval");
        assert_eq!(
            topology("(t*w - s^2)*(t*w - 2*s^2)"),
            [0, 0, 1, 0],
            "two parabolas that touch"
        );
        assert_eq!(
            topology("(s^2 + 4*t^2 - 4*w^2)*(4*s^2 + t^2 - 4*w^2)*10000 + w^4"),
            [4, 0, 0, 0],
            "four ovals"
        );
        assert_eq!(
            topology("(s^2 + 4*t^2 - 4*w^2)*(4*s^2 + t^2 - 4*w^2)*10000 - w^4"),
            [2, 0, 0, 0],
            "two ovals, nested"
        );
    }

    #[test]
    fn near_degeneracies_are_told_apart() {
        // An oval of radius 1e-4, and a node opened by 1e-6 either way.
        assert_eq!(
            topology("100000000*((3*s - w)^2 + (3*t - w)^2) - w^2"),
            [1, 0, 0, 0]
        );
        assert_eq!(
            topology("1000000*(t^2*w - s^3 - s^2*w) + w^3"),
            [1, 1, 0, 0]
        );
        assert_eq!(
            topology("1000000*(t^2*w - s^3 - s^2*w) - w^3"),
            [0, 1, 0, 0]
        );
    }

    /// The pole curves of the zoo have the topology that was computed independently, by an exact
    /// sweep in another frame.
    #[test]
    fn pole_curves_of_the_zoo() {
        let mut compared = 0;
        for file in isoform_testdata::files("zoo", "json") {
            let map: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(&file).expect("readable"))
                    .expect("JSON");
            let known = &map["pole_topology"];
            let Some(w) = map["W"].as_str().filter(|_| known.is_object()) else {
                continue;
            };
            let degree = map["degree"].as_u64().expect("a degree") as usize;
            let form = Poly::parse(w, &["s", "t"])
                .expect("a polynomial")
                .homogenise(2, degree);
            let t = curve_topology(&form, &Control::default()).expect("a curve");
            let count = |key: &str| known[key].as_u64().expect("a count") as usize;
            let expected = [
                count("n_ovals"),
                count("n_pseudolines"),
                count("n_singular_components"),
                count("n_isolated_points"),
            ];
            assert_eq!(
                [t.ovals, t.pseudolines, t.singular, t.isolated],
                expected,
                "{}: {w}",
                file.display()
            );
            compared += 1;
        }
        assert_eq!(compared, 34, "the valid surfaces of the zoo");
    }
}
