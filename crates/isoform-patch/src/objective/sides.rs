//! Term of the sides held on edges: ∫ B²/|∇B|² along each side of the patch on which a function B
//! must vanish.

use super::{Derivatives, Objective};
use isoform_geom::{Field, Point3, RationalPatch, dot};

/// Quadrature node on a side.
struct SideNode<'b> {
    /// Bernstein basis of the side's control points at the node.
    basis: &'b [f64],
    weight: f64,
    /// Homogeneous point of the patch.
    point: [f64; 4],
}

/// Residual B/|∇B| with its derivatives by p*, with |∇B| taken as constant.
struct Residual {
    value: f64,
    first: [f64; 4],
}

impl Residual {
    /// Computes the residual; `None` if w ≤ 0 or the value is not finite.
    fn new(edge: &dyn Field, z: [f64; 4]) -> Option<Self> {
        let w = z[3];
        let p: Point3 = std::array::from_fn(|k| z[k] / w);
        let j = edge.jet(p);
        let length = dot(j.g, j.g).sqrt();
        let d = j.g.map(|g| g / (length * w));
        let value = j.v / length;
        (w > 0.0 && value.is_finite()).then_some(Self {
            value,
            first: [d[0], d[1], d[2], -dot(d, p)],
        })
    }
}

impl<'f> Objective<'f> {
    /// Integrates over all held sides; `None` if a residual is not finite.
    pub(super) fn side_term(&self, patch: &RationalPatch) -> Option<f64> {
        let mut sum = 0.0;
        for (side, edge) in self.held() {
            for node in self.along(patch, side) {
                let r = Residual::new(edge, node.point)?.value;
                sum += node.weight * r * r;
            }
        }
        Some(sum)
    }

    /// Adds the derivatives of that integral.
    pub(super) fn add_side_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = d.gradient.len() / 4;
        for (side, edge) in self.held() {
            let places = self.side(side);
            for node in self.along(patch, side) {
                let Some(residual) = Residual::new(edge, node.point) else {
                    continue;
                };
                let by: Vec<(usize, f64)> = (0..4)
                    .flat_map(|k| {
                        let first = residual.first[k];
                        let each = places.iter().zip(node.basis);
                        each.map(move |(at, b)| (k * count + at, first * b))
                    })
                    .collect();
                d.add_square(node.weight, residual.value, &by);
            }
        }
    }

    /// Returns the held sides with the functions that vanish there.
    fn held(&self) -> impl Iterator<Item = (usize, &'f dyn Field)> + use<'f> {
        let sides = self.sides.into_iter().enumerate();
        sides.filter_map(|(side, edge)| edge.map(|edge| (side, edge)))
    }

    /// Returns the indices of the control points of a side.
    fn side(&self, side: usize) -> Vec<usize> {
        let (m, n) = self.degree;
        match side {
            0 | 1 => (0..=n).map(|j| side * m * (n + 1) + j).collect(),
            _ => (0..=m).map(|i| i * (n + 1) + (side - 2) * n).collect(),
        }
    }

    /// Returns the nodes along a side.
    fn along<'s>(
        &'s self,
        patch: &RationalPatch,
        side: usize,
    ) -> impl Iterator<Item = SideNode<'s>> + use<'s, 'f> {
        let rule = if side < 2 { &self.rule.v } else { &self.rule.u };
        let places = self.side(side).into_iter();
        let control: Vec<[f64; 4]> = places.map(|k| patch.control()[k]).collect();
        let nodes = rule.b.iter().zip(&rule.weights);
        nodes.map(move |([basis, _], weight)| SideNode {
            basis,
            weight: *weight,
            point: std::array::from_fn(|k| basis.iter().zip(&control).map(|(b, c)| b * c[k]).sum()),
        })
    }
}

impl Derivatives {
    /// Adds weight r² in the Gauss-Newton approximation, for the derivatives of r by some unknowns.
    fn add_square(&mut self, weight: f64, r: f64, by: &[(usize, f64)]) {
        let size = self.gradient.len();
        for &(row, a) in by {
            self.gradient[row] += 2.0 * weight * r * a;
            for &(column, b) in by {
                self.hessian[row * size + column] += 2.0 * weight * a * b;
            }
        }
    }
}
