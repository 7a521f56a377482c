//! Random points on a mesh, uniform by area.

use crate::ReadReport;
use isoform_geom::{Point3, PointCloud, cross, norm, sub};

/// Draws uniform points on the triangles: a triangle by its share of the area, then p = (1−√r)a +
/// √r(1−s)b + √r·s·c with r and s uniform between 0 and 1 (Turk 1990). A point gets the normal of
/// its triangle and an interpolated colour; columns are omitted.
pub(crate) fn surface_samples(
    mesh: &PointCloud,
    n: usize,
    seed: u64,
    report: &mut ReadReport,
) -> PointCloud {
    let areas = AreaSums::from_mesh(mesh);
    let mut out = PointCloud {
        origin: mesh.origin,
        ..PointCloud::default()
    };
    if areas.total <= 0.0 || !areas.total.is_finite() {
        report.warn("the triangles have no area, so that no points could be sampled on them");
        return out;
    }
    if !mesh.columns.is_empty() {
        report.warn("the columns of the vertices are left out, because points were sampled on the triangles");
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..n {
        let t = &mesh.triangles[areas.triangle_at(rng.f64() * areas.total)];
        let (r, s) = (rng.f64().sqrt(), rng.f64());
        let weights = [1.0 - r, r * (1.0 - s), r * s];
        out.points.push(mix(weights, corners(mesh, t)));
        let v = area_vector(mesh, t);
        out.normals.push(v.map(|x| x / norm(v)));
        if !mesh.colors.is_empty() {
            let colors = t.map(|c| mesh.colors[c as usize].map(f64::from));
            out.colors
                .push(mix(weights, colors).map(|x| x.round() as u8));
        }
    }
    out
}

/// Cumulative areas of the triangles. All are twice the area, which cancels in the shares.
struct AreaSums {
    /// Sum up to and including each triangle.
    sums: Vec<f64>,
    /// Sum over all triangles.
    total: f64,
}

impl AreaSums {
    /// Computes the sums of a mesh; a triangle whose area is not finite counts as 0.
    fn from_mesh(mesh: &PointCloud) -> Self {
        let mut total = 0.0;
        let sums = mesh
            .triangles
            .iter()
            .map(|t| {
                let area = norm(area_vector(mesh, t));
                total += if area.is_finite() { area } else { 0.0 };
                total
            })
            .collect();
        Self { sums, total }
    }

    /// Returns the triangle at a position in the cumulative area. Rounding can give `total` itself,
    /// which belongs to the last triangle of positive area.
    #[inline]
    fn triangle_at(&self, at: f64) -> usize {
        if at < self.total {
            self.sums.partition_point(|&s| s <= at)
        } else {
            self.sums.partition_point(|&s| s < self.total)
        }
    }
}

/// Returns the corners a, b and c of a triangle.
#[inline]
fn corners(mesh: &PointCloud, t: &[u32; 3]) -> [Point3; 3] {
    t.map(|c| mesh.points[c as usize])
}

/// Returns (b − a) × (c − a), a normal of a triangle whose length is twice the area.
#[inline]
fn area_vector(mesh: &PointCloud, t: &[u32; 3]) -> Point3 {
    let [a, b, c] = corners(mesh, t);
    cross(sub(b, a), sub(c, a))
}

/// Returns the mean of the corners with weights that sum to 1.
fn mix(weights: [f64; 3], corners: [Point3; 3]) -> Point3 {
    std::array::from_fn(|k| {
        weights[0] * corners[0][k] + weights[1] * corners[1][k] + weights[2] * corners[2][k]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_triangles() {
        // Two triangles of areas 1 : 3 in different planes. For one triangle: mean = centroid;
        // E|p|² = (|a|²+|b|²+|c|²+ab+bc+ca)/6.
        let points = vec![
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 5.0],
            [3.0, 0.0, 5.0],
            [0.0, 2.0, 5.0],
        ];
        let mesh = PointCloud {
            points,
            triangles: vec![[0, 1, 2], [1, 1, 1], [3, 4, 5]],
            ..PointCloud::default()
        };
        let mut report = ReadReport::new("test", "t".into());
        let n = 200_000;
        let cloud = surface_samples(&mesh, n, 7, &mut report);
        assert_eq!((cloud.points.len(), cloud.normals.len()), (n, n));
        let mean: Point3 =
            std::array::from_fn(|k| cloud.points.iter().map(|p| p[k]).sum::<f64>() / n as f64);
        let want: Point3 = [
            0.25 * 2.0 / 3.0 + 0.75,
            0.25 / 3.0 + 0.75 * 2.0 / 3.0,
            0.75 * 5.0,
        ];
        for k in 0..3 {
            assert!((mean[k] - want[k]).abs() < 0.02, "{mean:?} {want:?}");
        }
        let second = cloud
            .points
            .iter()
            .filter(|p| p[2] == 0.0)
            .map(|p| p[0] * p[0] + p[1] * p[1]);
        let low = second.clone().count() as f64;
        assert!((low / n as f64 - 0.25).abs() < 0.005, "share by area");
        assert!(
            (second.sum::<f64>() / low - 5.0 / 6.0).abs() < 0.02,
            "second moment"
        );
        assert!(cloud.normals.iter().all(|&m| m == [0.0, 0.0, 1.0]));
        assert_eq!(cloud, surface_samples(&mesh, n, 7, &mut report));
    }

    #[test]
    fn nothing_to_sample() {
        let mesh = PointCloud {
            points: vec![[1.0; 3]],
            triangles: vec![[0, 0, 0]],
            ..PointCloud::default()
        };
        let mut report = ReadReport::new("test", "t".into());
        assert!(surface_samples(&mesh, 10, 1, &mut report).points.is_empty());
        assert_eq!(report.warnings.len(), 1);
    }
}
