//! Measures of one tetrahedron or triangle: angles, volumes, shape.
//!
//! With the area vectors nᵢ (outward, twice the area) of the faces opposite to the corners, the
//! dihedral angle θ between the faces i and j has cos θ = −nᵢ·nⱼ/(|nᵢ
//! nⱼ|) and sin θ = 6V|e|/(|nᵢ
//! nⱼ|), where e is their common edge. Flat and inverted tetrahedra need no special case: their
//! sines are ≤ 0. Squares of lengths must be within the range of doubles.

use isoform_geom::{Point3, cross, dot, norm, sub};

/// Pairs of faces, numbered by their opposite corners, at the six dihedral angles; their common
/// edge joins the other two corners.
pub const DIHEDRALS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// Weight of an obtuse angle's sine in the biased minimum sine (Klingner and Shewchuk, 2008,
/// "Aggressive Tetrahedral Mesh Improvement"): large angles harm the interpolation, small ones only
/// the condition number.
pub const OBTUSE_WEIGHT: f64 = 0.7;

/// Returns six times the signed volume: (b − a) · ((c − a) × (d − a)), rounded.
pub fn six_volume([a, b, c, d]: [Point3; 4]) -> f64 {
    dot(sub(b, a), cross(sub(c, a), sub(d, a)))
}

/// Returns the area vectors of the faces opposite to the corners, of twice the area and outward for
/// a positive tetrahedron.
pub fn face_normals([a, b, c, d]: [Point3; 4]) -> [Point3; 4] {
    [
        cross(sub(c, b), sub(d, b)),
        cross(sub(d, a), sub(c, a)),
        cross(sub(b, a), sub(d, a)),
        cross(sub(c, a), sub(b, a)),
    ]
}

/// Returns the lengths of the edges of the [`DIHEDRALS`].
pub fn dihedral_edges([a, b, c, d]: [Point3; 4]) -> [f64; 6] {
    [
        norm(sub(d, c)),
        norm(sub(d, b)),
        norm(sub(c, b)),
        norm(sub(d, a)),
        norm(sub(c, a)),
        norm(sub(b, a)),
    ]
}

/// Returns the cosines of the six [`DIHEDRALS`]: within [−1, 1] up to rounding, 0 where a face has
/// no area.
pub fn dihedral_cosines(p: [Point3; 4]) -> [f64; 6] {
    cosines(&Shape::new(p))
}

/// Returns the sines of the six [`DIHEDRALS`], with the sign of the volume.
pub fn dihedral_sines(p: [Point3; 4]) -> [f64; 6] {
    sines(&Shape::new(p))
}

/// Quantities from which all measures of a tetrahedron are computed.
///
/// ```
/// use isoform_check::quality::{Shape, degrees, dihedral_cosines};
///
/// // The regular tetrahedron in a cube of edge 2.
/// let p = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
/// let shape = Shape::new(p);
/// assert!((shape.six_volume - 16.0).abs() < 1e-12 && (shape.radius_ratio() - 1.0).abs() < 1e-12);
/// let angle = degrees(dihedral_cosines(p)[0]);
/// assert!((angle - (1.0f64 / 3.0).acos().to_degrees()).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Area vectors of the faces, see [`face_normals`].
    pub normals: [Point3; 4],
    /// Lengths of the area vectors, at least the smallest positive double.
    pub areas: [f64; 4],
    /// Edge lengths, see [`dihedral_edges`].
    pub edges: [f64; 6],
    /// Six times the signed volume.
    pub six_volume: f64,
    /// Twelve times the volume times the radius of the circumscribed sphere.
    circum: f64,
}

impl Shape {
    /// Computes the shape of the tetrahedron with these corners.
    pub fn new(p: [Point3; 4]) -> Self {
        let normals = face_normals(p);
        let (u, v, w) = (sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0]));
        let (uu, vv, ww) = (dot(u, u), dot(v, v), dot(w, w));
        // −n₁ = v × w, −n₂ = w × u, −n₃ = u × v
        let centre: Point3 = std::array::from_fn(|i| {
            -(uu * normals[1][i] + vv * normals[2][i] + ww * normals[3][i])
        });
        Self {
            normals,
            areas: normals.map(|n| norm(n).max(f64::MIN_POSITIVE)),
            edges: dihedral_edges(p),
            six_volume: -dot(u, normals[1]),
            circum: norm(centre),
        }
    }

    /// Returns three times the radius of the inscribed sphere over that of the circumscribed one: 1
    /// for a regular tetrahedron, ≤ 0 for a flat or an inverted one.
    pub fn radius_ratio(&self) -> f64 {
        // r = V₆/Σ|n|, R = |circum|/(2 V₆)
        let sum: f64 = self.areas.iter().sum();
        6.0 * self.six_volume * self.six_volume.abs() / (sum * self.circum).max(f64::MIN_POSITIVE)
    }

    /// Returns the aspect ratio, the longest edge over 2√6 times the radius of the inscribed
    /// sphere: 1 for a regular tetrahedron, large for a flat one.
    pub fn aspect(&self) -> f64 {
        let longest = self.edges.iter().fold(0.0, |a: f64, &b| a.max(b));
        let sum: f64 = self.areas.iter().sum();
        longest * sum / (2.0 * 6f64.sqrt() * self.six_volume.abs().max(f64::MIN_POSITIVE))
    }

    /// Returns the scaled Jacobian: √2 times the determinant of the edges at a corner, over the
    /// largest product of the lengths of the three edges at a corner; 1 for a regular tetrahedron,
    /// ≤ 0 for a flat or an inverted one. As in Verdict (Stimpson et al., 2007, "The Verdict
    /// Geometric Quality Library", SAND2007-1751).
    pub fn scaled_jacobian(&self) -> f64 {
        let [cd, bd, bc, ad, ac, ab] = self.edges;
        let products = [ab * ac * ad, ab * bc * bd, ac * bc * cd, ad * bd * cd];
        let largest = products.into_iter().fold(self.six_volume.abs(), f64::max);
        2f64.sqrt() * self.six_volume / largest.max(f64::MIN_POSITIVE)
    }

    /// Returns the smallest sine of the dihedral angles, obtuse ones times [`OBTUSE_WEIGHT`]; √8/3
    /// = 0.943 for a regular tetrahedron.
    pub fn biased_minimum_sine(&self) -> f64 {
        let (c, s) = (cosines(self), sines(self));
        (0..6).fold(f64::INFINITY, |worst, k| {
            worst.min(s[k] * if c[k] < 0.0 { OBTUSE_WEIGHT } else { 1.0 })
        })
    }

    /// Returns the mean length of the edges.
    pub fn mean_edge(&self) -> f64 {
        self.edges.iter().sum::<f64>() / 6.0
    }
}

/// Returns the cosines of the dihedral angles.
pub fn cosines(shape: &Shape) -> [f64; 6] {
    DIHEDRALS.map(|[i, j]| {
        -dot(shape.normals[i], shape.normals[j])
            / (shape.areas[i] * shape.areas[j]).max(f64::MIN_POSITIVE)
    })
}

/// Returns the sines of the dihedral angles, with the sign of the volume.
pub fn sines(shape: &Shape) -> [f64; 6] {
    std::array::from_fn(|k| {
        let [i, j] = DIHEDRALS[k];
        shape.six_volume * shape.edges[k] / (shape.areas[i] * shape.areas[j]).max(f64::MIN_POSITIVE)
    })
}

/// Returns the cosines of the angles of a triangle at its corners; 0 at an edge of no length.
pub fn triangle_cosines([a, b, c]: [Point3; 3]) -> [f64; 3] {
    let e = [sub(c, b), sub(a, c), sub(b, a)];
    let length = e.map(|e| norm(e).max(f64::MIN_POSITIVE));
    [[1, 2], [2, 0], [0, 1]]
        .map(|[j, k]| -dot(e[j], e[k]) / (length[j] * length[k]).max(f64::MIN_POSITIVE))
}

/// Converts the cosine of an angle to degrees; a cosine beyond ±1 by rounding counts as ±1.
pub fn degrees(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_angles(p: [Point3; 4]) -> [f64; 6] {
        let (c, s) = (dihedral_cosines(p), dihedral_sines(p));
        std::array::from_fn(|k| {
            assert!(
                (c[k] * c[k] + s[k] * s[k] - 1.0).abs() < 1e-14,
                "{c:?} {s:?}"
            );
            degrees(c[k])
        })
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12 * b.abs().max(1.0)
    }

    #[test]
    fn regular_tetrahedron() {
        let p = [
            [1.0, 1.0, 1.0],
            [-1.0, 1.0, -1.0],
            [1.0, -1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ];
        assert!(
            all_angles(p)
                .iter()
                .all(|&d| near(d, (1.0f64 / 3.0).acos().to_degrees()))
        );
        let s = Shape::new(p);
        assert!(near(s.six_volume, 16.0) && near(s.radius_ratio(), 1.0) && near(s.aspect(), 1.0));
        assert!(near(s.scaled_jacobian(), 1.0));
        assert!(
            near(s.biased_minimum_sine(), 8f64.sqrt() / 3.0) && near(s.mean_edge(), 8f64.sqrt())
        );
    }

    /// Two 90° and four 60° angles.
    #[test]
    fn tetrahedron_of_the_body_centred_lattice() {
        let mut d = all_angles([
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [1.0, 1.0, 1.0],
            [1.0, -1.0, 1.0],
        ]);
        d.sort_by(f64::total_cmp);
        assert!(
            d.iter()
                .zip([60.0, 60.0, 60.0, 60.0, 90.0, 90.0])
                .all(|(&a, b)| near(a, b)),
            "{d:?}"
        );
    }

    /// Three right angles at the corner and three of acos(1/√3); r = (3 − √3)/6, R = √3/2.
    #[test]
    fn corner_of_a_cube() {
        let p = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let mut d = all_angles(p);
        d.sort_by(f64::total_cmp);
        let acute = (1.0 / 3f64.sqrt()).acos().to_degrees();
        assert!(
            d.iter()
                .zip([acute, acute, acute, 90.0, 90.0, 90.0])
                .all(|(&a, b)| near(a, b)),
            "{d:?}"
        );
        assert!(near(
            Shape::new(p).radius_ratio(),
            3.0 * (3.0 - 3f64.sqrt()) / 6.0 / (3f64.sqrt() / 2.0)
        ));
        // At the other corners the edges are 1, √2 and √2 long.
        assert!(near(Shape::new(p).scaled_jacobian(), 0.5f64.sqrt()));
    }

    #[test]
    fn flat_inverted_and_collapsed_ones() {
        let flat = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
        ];
        let s = Shape::new(flat);
        assert!(
            s.six_volume == 0.0
                && s.radius_ratio() == 0.0
                && s.biased_minimum_sine() == 0.0
                && s.aspect() > 1e300
        );
        let inverted = [
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let s = Shape::new(inverted);
        assert!(s.six_volume == -1.0 && s.radius_ratio() < 0.0 && s.biased_minimum_sine() < 0.0);
        assert!(near(s.scaled_jacobian(), -(0.5f64.sqrt())));
        let s = Shape::new([[0.5; 3]; 4]);
        assert!(
            s.radius_ratio() == 0.0
                && s.scaled_jacobian() == 0.0
                && cosines(&s) == [0.0; 6]
                && s.biased_minimum_sine() == 0.0
        );
    }

    #[test]
    fn angles_of_triangles() {
        let d = triangle_cosines([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3f64.sqrt(), 0.0]])
            .map(degrees);
        assert!(
            near(d[0], 90.0) && near(d[1], 60.0) && near(d[2], 30.0),
            "{d:?}"
        );
        assert_eq!(triangle_cosines([[0.0; 3]; 3]), [0.0; 3]);
    }
}
