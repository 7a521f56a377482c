//! Shape of wedges.
//!
//! A wedge is the image of a prism under Σ λᵢ ((1 − ζ) aᵢ + ζ bᵢ), with aᵢ the corners of its base
//! and bᵢ those above them. The Jacobian of this map is Σ λᵢ qᵢ(ζ) with three quadratics qᵢ, whose
//! signs decide whether it is positive everywhere.

use super::{Defects, Options, Place};
use isoform_geom::{Mesh, Point3, cross, dot, norm, sub};

/// Jacobian at a corner of the ideal wedge, whose edges at the corner are unit vectors: √3/2, twice
/// the area of an equilateral triangle.
const IDEAL_CORNER_JACOBIAN: f64 = 0.866_025_403_784_438_6;

/// Shape of wedges.
#[derive(Clone, Debug, PartialEq)]
pub struct WedgeQuality {
    /// Number of wedges.
    pub wedges: usize,
    /// Smallest scaled Jacobian: over the corners of wedges, the determinant of the unit vectors
    /// along their edges there, divided by √3/2; 1 for a right prism over an equilateral triangle.
    pub scaled_jacobian_min: f64,
    /// Wedges whose Jacobian is not positive everywhere; the value is their scaled Jacobian.
    pub inverted: Defects,
}

/// Measures the wedges of a mesh; `None` if it has none.
pub(super) fn examine(mesh: &Mesh, options: &Options<'_>) -> Option<WedgeQuality> {
    if mesh.wedges.is_empty() {
        return None;
    }
    let mut quality = WedgeQuality {
        wedges: mesh.wedges.len(),
        scaled_jacobian_min: f64::INFINITY,
        inverted: Defects::default(),
    };
    for (k, &nodes) in mesh.wedges.iter().enumerate() {
        let p = nodes.map(|v| mesh.points[v as usize]);
        let value = scaled_jacobian(p);
        quality.scaled_jacobian_min = quality.scaled_jacobian_min.min(value);
        if !is_positive(p) {
            quality.inverted.add(options.places, || Place {
                at: middle(p),
                nodes: nodes.to_vec(),
                elements: vec![k as u32],
                value,
            });
        }
    }
    Some(quality)
}

fn middle(p: [Point3; 6]) -> Point3 {
    std::array::from_fn(|i| p.iter().map(|p| p[i]).sum::<f64>() / 6.0)
}

/// Returns true if the Jacobian is positive throughout a wedge.
fn is_positive([a0, a1, a2, b0, b1, b2]: [Point3; 6]) -> bool {
    let (u, v) = ([sub(a1, a0), sub(b1, b0)], [sub(a2, a0), sub(b2, b0)]);
    // Bernstein coefficients of the normal of the section at ζ.
    let mixed = [cross(u[0], v[1]), cross(u[1], v[0])];
    let half = std::array::from_fn(|i| 0.5 * (mixed[0][i] + mixed[1][i]));
    let normals = [cross(u[0], v[0]), half, cross(u[1], v[1])];
    let ways = [sub(b0, a0), sub(b1, a1), sub(b2, a2)];
    ways.iter().all(|way| {
        let [low, middle, high] = normals.map(|n| dot(*way, n));
        low > 0.0 && high > 0.0 && middle > -(low * high).sqrt()
    })
}

/// Returns the smallest scaled Jacobian over the six corners; −∞ if one of them is NaN.
fn scaled_jacobian(p: [Point3; 6]) -> f64 {
    let unit = |from: usize, to: usize| {
        let way = sub(p[to], p[from]);
        let length = norm(way);
        way.map(|x| x / length)
    };
    let at = |i: usize| {
        let (base, next, last) = (i - i % 3, (i + 1) % 3, (i + 2) % 3);
        let (below, above) = (i % 3, i % 3 + 3);
        let normal = cross(unit(i, base + next), unit(i, base + last));
        dot(unit(below, above), normal) / IDEAL_CORNER_JACOBIAN
    };
    let corners = (0..6).map(at);
    corners.fold(f64::INFINITY, |least, value| {
        if value.is_nan() {
            f64::NEG_INFINITY
        } else {
            least.min(value)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A right prism over an equilateral triangle.
    fn prism(height: f64) -> [Point3; 6] {
        let h = 0.75f64.sqrt();
        let base = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, h, 0.0]];
        let top = base.map(|[x, y, _]| [x, y, height]);
        [base[0], base[1], base[2], top[0], top[1], top[2]]
    }

    #[test]
    fn right_prisms_are_best_however_flat() {
        for height in [1.0, 1e-3, 50.0] {
            assert!((scaled_jacobian(prism(height)) - 1.0).abs() < 1e-12);
            assert!(is_positive(prism(height)));
        }
        let turned = prism(-1.0);
        assert!(scaled_jacobian(turned) < 0.0 && !is_positive(turned));
    }

    /// The top turned against the base by an angle: half way up the section is a triangle shrunk
    /// by the cosine of half the angle. Corners alone do not tell it from one that is turned over.
    #[test]
    fn a_twisted_wedge_is_positive_until_its_middle_shrinks_to_a_point() {
        let twisted = |degrees: f64| {
            let c = [0.5, 0.75f64.sqrt() / 3.0];
            let (sin, cos) = degrees.to_radians().sin_cos();
            let mut p = prism(10.0);
            for q in &mut p[3..] {
                let d = [q[0] - c[0], q[1] - c[1]];
                q[0] = c[0] + cos * d[0] - sin * d[1];
                q[1] = c[1] + sin * d[0] + cos * d[1];
            }
            p
        };
        for (degrees, is_right) in [(30.0, true), (100.0, true), (175.0, true), (180.0, false)] {
            let p = twisted(degrees);
            // Sampled in its axis: the area of the section in the middle.
            let middle = 0.5 * (1.0 + f64::to_radians(degrees).cos());
            assert_eq!(middle > 1e-6, is_right);
            assert_eq!(is_positive(p), is_sampled_positive(p), "{degrees}");
        }
    }

    fn is_sampled_positive(p: [Point3; 6]) -> bool {
        (0..=200).all(|k| {
            let z = f64::from(k) / 200.0;
            let at: [Point3; 3] = std::array::from_fn(|i| {
                std::array::from_fn(|x| (1.0 - z) * p[i][x] + z * p[i + 3][x])
            });
            let normal = cross(sub(at[1], at[0]), sub(at[2], at[0]));
            (0..3).all(|i| dot(sub(p[i + 3], p[i]), normal) > 0.0)
        })
    }
}
