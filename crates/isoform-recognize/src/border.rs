//! Borders of flat faces.

use isoform_geom::plane::{Point2, distance_squared, simplified};
use isoform_geom::{Point3, cross, norm, sub};
use spade::{DelaunayTriangulation, Triangulation};
use std::collections::BTreeMap;

/// Returns the border of a region of the plane that points fill: closed polygons with the region on
/// their left.
///
/// A triangle of the Delaunay triangulation belongs to the region unless its circumcircle, which is
/// empty, is too large for chance. Of random points at density λ, x = λ π r² has the distribution
/// Gamma(2, 1), whose median is 1.678, so that the median radius tells the density: of n triangles
/// none is expected where n (1 + x) e⁻ˣ < 1 (Miles, On the homogeneous planar Poisson point
/// process, Math. Biosci. 6, 1970). Polygons are simplified by up to the median radius, since the
/// points say no more about the border.
pub(crate) fn of_points(points: &[Point2]) -> Vec<Vec<Point2>> {
    let places = points.iter().map(|p| {
        // Spade refuses smaller numbers other than 0.
        let [x, y] = p.map(|v| if v.abs() < 1e-40 { 0.0 } else { v });
        spade::Point2::new(x, y)
    });
    let made = DelaunayTriangulation::<spade::Point2<f64>>::bulk_load(places.collect());
    let Ok(made) = made else {
        return Vec::new();
    };
    let place = |i: u32| {
        let p = made.vertex(spade::handles::FixedVertexHandle::from_index(i as usize));
        [p.position().x, p.position().y]
    };
    let triangles = made.inner_faces().map(|face| {
        let corners = face.vertices().map(|v| v.fix().index() as u32);
        (corners, face.circumcenter())
    });
    let triangles: Vec<([u32; 3], f64)> = triangles
        .map(|(corners, center)| {
            let squared = distance_squared(place(corners[0]), [center.x, center.y]);
            (corners, squared)
        })
        .collect();
    let mut squares: Vec<f64> = triangles.iter().map(|t| t.1).collect();
    squares.sort_unstable_by(f64::total_cmp);
    let Some(median) = squares.get(squares.len() / 2).copied() else {
        return Vec::new();
    };
    let n = squares.len() as f64;
    let chance = |x: f64| n * (1.0 + x) * (-x).exp();
    let (mut lo, mut hi) = (1.678, 100.0);
    while hi - lo > 1e-3 {
        let x = 0.5 * (lo + hi);
        if chance(x) < 1.0 { hi = x } else { lo = x }
    }
    let limit = median * hi / 1.678;
    let inside = triangles.iter().filter(|t| t.1 <= limit);
    let found = loops(inside.flat_map(|t| sides(t.0)));
    let polygons = found.into_iter().map(|ring| {
        let mut ring: Vec<Point2> = ring.into_iter().map(place).collect();
        ring.extend(ring.first().copied());
        let mut ring = simplified(&ring, median.sqrt());
        ring.pop();
        ring
    });
    polygons.filter(|ring| ring.len() > 2).collect()
}

/// Returns polygons, the one of the largest area first.
pub(crate) fn largest_first(mut rings: Vec<Vec<Point3>>) -> Vec<Vec<Point3>> {
    let area = |ring: &Vec<Point3>| {
        let next = ring.iter().cycle().skip(1);
        let parts = ring
            .iter()
            .zip(next)
            .map(|(p, q)| cross(sub(*p, ring[0]), sub(*q, ring[0])));
        let sum = parts.fold([0.0; 3], |sum, v| std::array::from_fn(|k| sum[k] + v[k]));
        norm(sum)
    };
    rings.sort_by(|a, b| area(b).total_cmp(&area(a)));
    rings
}

/// Returns the directed sides of a triangle.
pub(crate) fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Returns the closed loops of directed sides of triangles that no other triangle has the other way
/// round.
pub(crate) fn loops(sides: impl Iterator<Item = [u32; 2]>) -> Vec<Vec<u32>> {
    let mut balance: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for [a, b] in sides {
        *balance.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ([a, b], sum) in balance.into_iter().filter(|(_, sum)| *sum != 0) {
        let (from, to) = if sum > 0 { (a, b) } else { (b, a) };
        next.entry(from).or_default().push(to);
    }
    let mut found = Vec::new();
    while let Some((first, _)) = next.first_key_value() {
        let (first, mut ring, mut at) = (*first, Vec::new(), *first);
        while let Some(ends) = next.get_mut(&at) {
            let to = ends.pop();
            if ends.is_empty() {
                next.remove(&at);
            }
            ring.push(at);
            let Some(to) = to else { break };
            at = to;
            if at == first {
                break;
            }
        }
        found.push(ring);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns twice the signed area of a polygon.
    fn doubled_area(ring: &[Point2]) -> f64 {
        let next = ring.iter().cycle().skip(1);
        ring.iter()
            .zip(next)
            .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
            .sum()
    }

    /// A plate of 3 by 2 with a round hole of radius 0.5: random points and a lattice.
    #[test]
    fn plates_with_a_hole_have_two_borders() {
        let mut random = fastrand::Rng::with_seed(1);
        for n in [400, 4000, 40_000] {
            let spacing = (6.0 / f64::from(n)).sqrt();
            let scattered = (0..n)
                .map(|_| [3.0 * random.f64(), 2.0 * random.f64()])
                .collect();
            let (columns, rows) = ((3.0 / spacing) as u32, (2.0 / spacing) as u32);
            let at = |k: u32, m: u32| f64::from(k) / f64::from(m);
            let lattice = (0..=columns)
                .flat_map(|i| (0..=rows).map(move |j| [3.0 * at(i, columns), 2.0 * at(j, rows)]));
            let sets: [Vec<Point2>; 2] = [scattered, lattice.collect()];
            for mut points in sets {
                points.retain(|p| distance_squared(*p, [1.0, 1.0]) > 0.25);
                let found = of_points(&points);
                let areas: Vec<f64> = found.iter().map(|r| 0.5 * doubled_area(r)).collect();
                let is_near = |v: f64, wanted: f64| (v - wanted).abs() < 8.0 * spacing;
                let hole = -0.25 * std::f64::consts::PI;
                let large: Vec<&f64> = areas.iter().filter(|a| a.abs() > 0.1).collect();
                assert!(
                    matches!(large[..], [a, b] if is_near(a.max(*b), 6.0) && is_near(a.min(*b), hole)),
                    "{n}: {areas:?}"
                );
                assert!(areas.len() == 2 || n > 400, "{n}: {areas:?}");
            }
        }
    }
}
