//! The topology of a real plane algebraic curve in the projective plane, from its arrangements in
//! the four unit triangles.

use crate::arrangement::{Arrangement, ArrangementError};
use crate::poly::Poly;
use dashu_ratio::RBig;
use isoform_control::Control;
use std::collections::BTreeMap;

/// What a curve consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurveTopology {
    /// Closed components without branching that do not change the sides of the plane: each bounds a
    /// disk. Cusps do not count as branching.
    pub ovals: usize,
    /// Closed components without branching along which the plane is a Möbius strip, such as lines.
    pub pseudolines: usize,
    /// Components with points where more than two branches end.
    pub singular: usize,
    /// Isolated points.
    pub isolated: usize,
}

/// Signs of s and t in the four unit triangles: (s : t : w) = (±u : ±v : 1 − u − v).
pub const QUADRANTS: [[i64; 2]; 4] = [[1, 1], [-1, 1], [-1, -1], [1, -1]];

/// A form in variables 0, 1, 2 (s, t, w) as a polynomial in u, v (0, 1) of one of the unit
/// triangles.
pub fn in_triangle(form: &Poly, quadrant: usize) -> Poly {
    let [s, t] = QUADRANTS[quadrant];
    let (u, v) = (Poly::var(0), Poly::var(1));
    let w = Poly::one() - &u - &v;
    form.compose(&[u.scale(&RBig::from(s)), v.scale(&RBig::from(t)), w])
}

/// Points of the curve, the same in every triangle that they belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Node {
    /// Inside a triangle: wall and point.
    Inner(usize, usize, usize),
    /// On s = 0, by the sign of t and the order; on t = 0, by that of s; on w = 0, by that of s t.
    Side(usize, i64, usize),
    /// (0:0:1), (1:0:0), (0:1:0).
    Corner(usize),
}

/// The components of the zero set of a form in variables 0, 1, 2; multiple components count once.
///
/// # Errors
/// [`ArrangementError`].
pub fn curve_topology(
    form: &Poly,
    control: &Control<'_>,
) -> Result<CurveTopology, ArrangementError> {
    let mut graph = Graph::default();
    if !form.is_constant() {
        for quadrant in 0..4 {
            let arrangement = Arrangement::new(&[in_triangle(form, quadrant)], control)?;
            graph.add(&arrangement, quadrant);
        }
    }
    Ok(graph.components())
}

#[derive(Default)]
struct Graph {
    nodes: BTreeMap<Node, usize>,
    /// Ends, and whether the way from one to the other changes between (s, t, w) and −(s, t, w).
    edges: Vec<(usize, usize, bool)>,
}

impl Graph {
    fn node(&mut self, node: Node) -> usize {
        let next = self.nodes.len();
        *self.nodes.entry(node).or_insert(next)
    }

    /// The part of the curve in one triangle; what lies on sides is the same from both sides of
    /// them.
    fn add(&mut self, arrangement: &Arrangement, quadrant: usize) {
        let [s, t] = QUADRANTS[quadrant];
        let walls = &arrangement.walls;
        let last = walls.len() - 1;
        let on = |k: usize, p: usize| {
            walls[k].points[p].curves.contains(&0) || walls[k].vertical.contains(&0)
        };
        // Names of the points, and whether they are taken as −(s, t, w) here: those with w = 0 have
        // s > 0, or s = 0 and t > 0.
        let mut names: BTreeMap<(usize, usize), (Node, bool)> = BTreeMap::new();
        let (mut on_left, mut on_lower, mut on_upper) = (0, 0, 0);
        for (k, wall) in walls.iter().enumerate() {
            let top = wall.points.len() - 1;
            for p in 0..=top {
                let name = if k == last {
                    (Node::Corner(1), s < 0)
                } else if k == 0 && p == 0 {
                    (Node::Corner(0), false)
                } else if k == 0 && p == top {
                    (Node::Corner(2), t < 0)
                } else if k == 0 {
                    on_left += usize::from(on(k, p));
                    (Node::Side(0, t, on_left), false)
                } else if p == 0 {
                    on_lower += usize::from(on(k, p));
                    (Node::Side(1, s, on_lower), false)
                } else if p == top {
                    on_upper += usize::from(on(k, p));
                    (Node::Side(2, s * t, on_upper), s < 0)
                } else {
                    (Node::Inner(quadrant, k, p), false)
                };
                names.insert((k, p), name);
                if on(k, p) {
                    self.node(name.0);
                }
            }
        }
        let edge = |graph: &mut Self, a: (usize, usize), b: (usize, usize)| {
            let ((a, x), (b, y)) = (names[&a], names[&b]);
            let (a, b) = (graph.node(a), graph.node(b));
            graph.edges.push((a, b, x != y));
        };
        for (k, slab) in arrangement.slabs.iter().enumerate() {
            for arc in slab.arcs.iter().filter(|a| a.curve == 0) {
                edge(self, (k, arc.left), (k + 1, arc.right));
            }
        }
        for (k, wall) in walls
            .iter()
            .enumerate()
            .filter(|(_, w)| w.vertical.contains(&0))
        {
            (1..wall.points.len()).for_each(|p| edge(self, (k, p - 1), (k, p)));
        }
        // Sides that belong to the curve, each from one of its two triangles.
        let sides = arrangement.sides[0];
        let along = |graph: &mut Self, points: Vec<(usize, usize)>| {
            let ends = [points[0], points[points.len() - 1]];
            let points: Vec<_> = points
                .into_iter()
                .filter(|&(k, p)| on(k, p) || ends.contains(&(k, p)))
                .collect();
            points.windows(2).for_each(|w| edge(graph, w[0], w[1]));
        };
        if sides[0] && quadrant.is_multiple_of(2) {
            along(self, (0..walls[0].points.len()).map(|p| (0, p)).collect());
        }
        if sides[1] && quadrant < 2 {
            along(self, (0..=last).map(|k| (k, 0)).collect());
        }
        if sides[2] && s > 0 {
            along(
                self,
                (0..=last).map(|k| (k, walls[k].points.len() - 1)).collect(),
            );
        }
    }

    fn components(&self) -> CurveTopology {
        let n = self.nodes.len();
        let mut of: Vec<usize> = (0..n).collect();
        let mut degree = vec![0usize; n];
        for &(a, b, _) in &self.edges {
            degree[a] += 1;
            degree[b] += 1;
            let (from, to) = (of[a], of[b]);
            of.iter_mut()
                .for_each(|c| *c = if *c == from { to } else { *c });
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

    /// The pole curves of the zoo, whose topology was computed elsewhere, by an exact sweep in
    /// another frame.
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
