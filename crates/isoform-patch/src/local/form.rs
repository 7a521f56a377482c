//! Coefficients ⟨pₐ, p_b⟩ of the first fundamental form with their derivatives by z.

use crate::node::Node;
use isoform_geom::{Point3, dot};

/// Indices a, b ∈ {0, 1} of a coefficient, 0 for u and 1 for v.
pub(super) type Pair = (usize, usize);

/// Derivatives of ⟨pₐ, p_b⟩ by z; the second ones only for Newton's method.
pub(super) struct Form {
    pub(super) first: [f64; 12],
    pub(super) second: Option<Box<[[f64; 12]; 12]>>,
}

impl Form {
    /// Computes the first derivatives, and the second ones if `exact`.
    #[inline(always)]
    pub(super) fn new(node: &Node, pair: Pair, exact: bool) -> Self {
        Self {
            first: first(node, pair),
            second: exact.then(|| Box::new(second(node, pair))),
        }
    }

    /// Returns s self + t other.
    #[inline(always)]
    pub(super) fn blend(&self, s: f64, other: &Self, t: f64) -> Self {
        let sum = |a: &[f64; 12], b: &[f64; 12]| std::array::from_fn(|k| s * a[k] + t * b[k]);
        let both = self.second.as_ref().zip(other.second.as_ref());
        let second = both.map(|(a, b)| Box::new(std::array::from_fn(|k| sum(&a[k], &b[k]))));
        Self {
            first: sum(&self.first, &other.first),
            second,
        }
    }
}

/// Tangent with the derivative of the weight in its direction, and its offset in z.
struct Direction {
    tangent: Point3,
    /// Quotient wᵤ/w.
    share: f64,
    /// Product ⟨p, pᵤ⟩.
    along: f64,
    place: usize,
}

impl Direction {
    #[inline(always)]
    fn new(node: &Node, q: f64, which: usize) -> Self {
        let (tangent, place) = (node.tangents[which], 4 + 4 * which);
        Self {
            tangent,
            share: q * node.z[place + 3],
            along: dot(node.point, tangent),
            place,
        }
    }
}

#[inline(always)]
fn first(node: &Node, (a, b): Pair) -> [f64; 12] {
    let q = 1.0 / node.weight();
    let (a, b) = (Direction::new(node, q, a), Direction::new(node, q, b));
    let mut first = [0.0; 12];
    for k in 0..3 {
        first[k] = -q * (a.share * b.tangent[k] + b.share * a.tangent[k]);
        first[a.place + k] += q * b.tangent[k];
        first[b.place + k] += q * a.tangent[k];
    }
    first[3] = q * (a.share * b.along + b.share * a.along - 2.0 * dot(a.tangent, b.tangent));
    first[a.place + 3] -= q * b.along;
    first[b.place + 3] -= q * a.along;
    first
}

fn second(node: &Node, (a, b): Pair) -> [[f64; 12]; 12] {
    let mut second = [[0.0; 12]; 12];
    for k in 0..3 {
        let (of_a, of_b) = (node.tangent(a, k), node.tangent(b, k));
        let (pa, pb) = (node.tangents[a][k], node.tangents[b][k]);
        let (ha, hb) = (node.tangent_second(a, k), node.tangent_second(b, k));
        for i in 0..4 {
            for j in 0..4 {
                second[of_a.places[i]][of_a.places[j]] += pb * ha[i][j];
                second[of_b.places[i]][of_b.places[j]] += pa * hb[i][j];
                second[of_a.places[i]][of_b.places[j]] += of_a.first[i] * of_b.first[j];
                second[of_b.places[j]][of_a.places[i]] += of_a.first[i] * of_b.first[j];
            }
        }
    }
    second
}
