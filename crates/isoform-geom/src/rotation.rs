//! Rotation matrices and rotation vectors: the direction of a vector is the axis, its length the
//! angle in radians.

use crate::point::{Point3, dot};

/// Returns the rotation matrix of a rotation vector, row by row (Rodrigues' formula).
pub fn about(vector: Point3) -> [Point3; 3] {
    let angle = dot(vector, vector).sqrt();
    let axis = vector.map(|v| if angle > 0.0 { v / angle } else { 0.0 });
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = axis.map(|v| v * sin);
    let skew = [[cos, -z, y], [z, cos, -x], [-y, x, cos]];
    std::array::from_fn(|i| std::array::from_fn(|j| skew[i][j] + (1.0 - cos) * axis[i] * axis[j]))
}

/// Returns the rotation vector, of length at most π, of a rotation matrix given row by row.
pub fn vector_of(r: &[Point3; 3]) -> Point3 {
    // The quaternion (w, v), up to a factor, from its largest component, which avoids cancellation.
    let trace = r[0][0] + r[1][1] + r[2][2];
    let k = (0..3).fold(0, |m, k| if r[k][k] > r[m][m] { k } else { m });
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let skew: Point3 = std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        r[c][b] - r[b][c]
    });
    let (mut w, mut v) = (1.0 + trace, skew);
    if trace < r[k][k] {
        w = skew[k];
        v[k] = 1.0 + 2.0 * r[k][k] - trace;
        v[i] = r[i][k] + r[k][i];
        v[j] = r[j][k] + r[k][j];
    }
    let length = dot(v, v).sqrt();
    if length == 0.0 {
        return [0.0; 3];
    }
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    let angle = 2.0 * length.atan2(w.abs());
    v.map(|x| sign * x * angle / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_rotation_has_the_vector_that_it_is_about() {
        let axes = [
            [1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.6, 0.0, 0.8],
            [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0],
            [-6.0 / 7.0, 2.0 / 7.0, 3.0 / 7.0],
        ];
        for axis in axes {
            for angle in [0.0, 1e-12, 1e-5, 0.3, PI / 2.0, 2.5, PI - 1e-6, PI] {
                let r = about(axis.map(|x| angle * x));
                for (i, row) in r.iter().enumerate() {
                    for (j, other) in r.iter().enumerate() {
                        let unit = f64::from(u8::from(i == j));
                        assert!((dot(*row, *other) - unit).abs() < 1e-15);
                    }
                    assert!((dot(*row, axis) - axis[i]).abs() < 1e-15, "the axis stays");
                }
                let cos = (r[0][0] + r[1][1] + r[2][2] - 1.0) / 2.0;
                assert!((cos - angle.cos()).abs() < 1e-15);
                let v = vector_of(&r);
                // Rotations by π and −π are equal.
                let sense = if angle == PI {
                    dot(v, axis).signum()
                } else {
                    1.0
                };
                let off = (0..3).map(|k| (v[k] - sense * angle * axis[k]).abs());
                assert!(off.fold(0.0, f64::max) < 1e-14, "{axis:?} {angle} {v:?}");
            }
        }
        // A quarter turn about z takes x to y.
        let r = about([0.0, 0.0, PI / 2.0]);
        assert!((r[1][0] - 1.0).abs() < 1e-15 && (r[0][1] + 1.0).abs() < 1e-15);
    }
}
