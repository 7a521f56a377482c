//! Strips between the rectangles around base points and the seams: each replaces the triangle at
//! the base point between two rays.
//!
//! ```text
//!       rectangle   way
//!    a ----------o-------- b      a, b: where the two rays leave the rectangle
//!    |                     |
//!    o  vertices on rays   |      o: vertices that triangles beyond, double curves or bent rays
//!    |                     o         have put there
//!    p ---------- c ------ r      p, r: their points of the seam
//!          seam                   c: a corner, where the strip goes from one seam to another
//! ```

use super::names::{Name, Ray, key};
use super::opening::SeamId;
use super::strips::{PathVertex, around, between};
use super::surface_builder::{NewTriangle, SurfaceBuilder};
use crate::fan::{Direction, Fan};
use crate::region::FOLD_BIT;
use crate::surface::{Point3, VertexKind};

/// Part of a unit triangle between two rays of a base point, from the rectangle to the seam.
pub(super) struct Strip {
    pub(super) fan: usize,
    pub(super) apex: [f64; 2],
    pub(super) rays: [Ray; 2],
    /// Corners on the rectangle; `way` has the vertices that other triangles have inserted on the
    /// edge between them.
    pub(super) ends: [PathVertex; 2],
    pub(super) way: Vec<PathVertex>,
}

/// The two long sides of a strip, from the rectangle to the seam.
struct Paths {
    first: Vec<PathVertex>,
    second: Vec<PathVertex>,
    /// Ends of the paths on the seam, not counting a corner between them.
    seams: [u32; 2],
}

/// Triangulates a strip.
pub(super) fn fill(q: usize, strip: &Strip, joined: &mut SurfaceBuilder<'_>) -> Vec<NewTriangle> {
    let paths = paths(q, strip, joined);
    let (glued, apex) = (joined.glued, strip.apex);
    let fan = &glued.openings.fans[strip.fan];
    let triangles = triangles(strip, fan, &paths, joined);
    // The part between two rays need not lie in the straight triangle: then all corners of the
    // strip get the parameters of the base point.
    let [a, b] = strip.ends.map(|end| end.1);
    let chart = &glued.atlas.charts[q];
    let is_straight = !fan.is_tree() || chart.keeps_sign([apex, a, b], fan.multiplicity);
    let folded = folded(strip, &paths, joined);
    let is_folded = |v: PathVertex| folded.iter().any(|&f| joined.are_one(f, v.0));
    let border = |v: PathVertex| if is_folded(v) { FOLD_BIT } else { 0 };
    let made = |t: [PathVertex; 3]| NewTriangle {
        vertices: t.map(|v| v.0),
        corners: t.map(|v| if is_straight { v.1 } else { apex }),
        borders: t.map(border),
    };
    triangles.into_iter().map(made).collect()
}

fn paths(q: usize, strip: &Strip, joined: &mut SurfaceBuilder<'_>) -> Paths {
    let [mut first, second] = [0, 1].map(|i| path(q, strip, i, joined));
    let seams = [&first, &second].map(|path| path[path.len() - 1].0);
    // The strip leads from one seam to another one.
    let fan = &joined.glued.openings.fans[strip.fan];
    let sector = fan.sector_between(strip.rays[0], strip.rays[1]);
    if let Some(corner) = sector.and_then(|s| s.corner.as_ref()) {
        first.push(seam_end(strip, corner, strip.apex, joined));
    }
    Paths {
        first,
        second,
        seams,
    }
}

/// Returns the vertices on a ray, in a direction of the fan, between the rectangle and the seam, if
/// base points are infinitely near.
fn on_ray(
    q: usize,
    strip: &Strip,
    i: usize,
    d: &Direction,
    joined: &mut SurfaceBuilder<'_>,
) -> Vec<PathVertex> {
    let openings = joined.glued.openings;
    let (ray, (vertex, at)) = (strip.rays[i], strip.ends[i]);
    let mut sites = openings.sites_in(q).map(|s| s.1);
    let Some(site) = sites.find(|s| s.fan == strip.fan) else {
        return Vec::new();
    };
    let faces = joined.surface.faces[vertex as usize];
    let kind = if faces > 0 {
        VertexKind::Box
    } else {
        VertexKind::Ordinary
    };
    let points = openings.ray(q, site, d, ray.1).points_to_seam(at);
    let names = (0..).map(|k| Name::Ray(strip.fan, ray, k));
    let named = names.zip(points);
    named
        .map(|(name, x)| (joined.shared([name; 2], x, faces, kind), strip.apex))
        .collect()
}

/// Returns the vertices of a ray from the rectangle to the seam, including those on a double curve.
fn path(q: usize, strip: &Strip, i: usize, joined: &mut SurfaceBuilder<'_>) -> Vec<PathVertex> {
    let glued = joined.glued;
    let (ray, (vertex, at)) = (strip.rays[i], strip.ends[i]);
    let mut path = vec![strip.ends[i]];
    for (k, &(class, at)) in glued.gluing.spoke(strip.fan, ray, at).iter().enumerate() {
        let place = Name::Ray(strip.fan, ray, k);
        path.push((joined.class_vertex(place, class), at));
    }
    let mut directions = glued.openings.fans[strip.fan].directions.iter();
    let d = directions
        .find(|d| d.key() == ray.0)
        .expect("a direction of the fan");
    if path.len() == 1 && joined.surface.kinds[vertex as usize] != VertexKind::Contracted {
        path.extend(on_ray(q, strip, i, d, joined));
    }
    path.push(seam_end(strip, d, at, joined));
    path
}

/// Returns the vertex of the seam in a direction.
fn seam_end(
    strip: &Strip,
    d: &Direction,
    at: [f64; 2],
    joined: &mut SurfaceBuilder<'_>,
) -> PathVertex {
    let glued = joined.glued;
    let (place, point, faces) = glued.openings.seam_vertex(strip.fan, d);
    let name = glued.gluing.name(&key(place, 0, at)).unwrap_or(place);
    let kind = match (name, faces) {
        (Name::Image(_), _) => VertexKind::Contracted,
        (_, 1..) => VertexKind::Box,
        (Name::Double(k), _) if glued.gluing.is_double(k) => VertexKind::Double,
        _ => VertexKind::Seam,
    };
    let point = match name {
        Name::Image(k) => glued.curves.image(k),
        Name::Double(k) => glued.gluing.image(k),
        _ => point,
    };
    (joined.shared([place, name], point, faces, kind), strip.apex)
}

/// Returns the vertices of a strip in which the surface ends: on seams and rays along which it is
/// folded.
fn folded(strip: &Strip, paths: &Paths, joined: &SurfaceBuilder<'_>) -> Vec<u32> {
    let openings = joined.glued.openings;
    let mut folded: Vec<u32> = Vec::new();
    for (k, path) in [&paths.first, &paths.second].into_iter().enumerate() {
        let ray = strip.rays[k];
        if openings.is_fold_ray(strip.fan, ray) {
            folded.extend(path.iter().map(|v| v.0));
        }
        if openings.folded.contains(&SeamId {
            fan: strip.fan,
            node: ray.0.0,
        }) {
            // From its end of the seam to the other one, or to the next seam.
            folded.push(paths.seams[k]);
            folded.extend(paths.first.last().map(|v| v.0));
        }
    }
    folded
}

/// Returns the triangles between the vertices of the rectangle, with edges only to the first
/// vertices behind it: they bound the triangles outside, and must not gain edges to shared
/// vertices. The result is empty if the rectangle has no vertex between the rays.
fn beside_rectangle(
    strip: &Strip,
    [first, second]: [&[PathVertex]; 2],
    points: &[Point3],
) -> Vec<[PathVertex; 3]> {
    if strip.way.is_empty() {
        return Vec::new();
    }
    let way = [&first[..1], strip.way.as_slice(), &second[..1]].concat();
    around(points, first[1], &way, second[1])
}

fn triangles(
    strip: &Strip,
    fan: &Fan,
    Paths { first, second, .. }: &Paths,
    joined: &SurfaceBuilder<'_>,
) -> Vec<[PathVertex; 3]> {
    let points = &joined.surface.points;
    let mut made = beside_rectangle(strip, [first, second], points);
    let start = usize::from(!made.is_empty());
    let (first_left, second_left) = (&first[start..], &second[start..]);
    if fan.is_tree() {
        made.extend(between(points, first_left, second_left));
    } else {
        let mut folds = fan.directions.iter().filter(|d| d.key() == strip.rays[0].0);
        let first_is_double =
            joined.surface.double[first[0].0 as usize] || folds.any(|d| fan.is_fold(d));
        made.extend(side_by_side(first_left, second_left, first_is_double));
    }
    made
}

/// Returns triangles between two paths, alternating steps on both as far as possible. For a double
/// curve, the edges lead from the seam's end of the curve to the rectangle: the other diagonals
/// would occur twice if the curve is folded.
fn side_by_side(
    first: &[PathVertex],
    second: &[PathVertex],
    first_is_double: bool,
) -> Vec<[PathVertex; 3]> {
    let mut made = Vec::new();
    let (mut i, mut j) = (0, 0);
    while i + 1 < first.len() || j + 1 < second.len() {
        let on_second = i + 1 == first.len() || (j + 1 < second.len() && !first_is_double);
        let next = match on_second {
            true => second[j + 1],
            false => first[i + 1],
        };
        made.push([first[i], second[j], next]);
        if on_second { j += 1 } else { i += 1 }
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two paths of m and n vertices have m + n − 2 triangles between them, which use each edge of
    /// the paths once; the diagonals start on the double path.
    #[test]
    fn paths_are_joined_side_by_side() {
        let path = |from: u32, n: u32| (from..from + n).map(|v| (v, [0.0; 2])).collect::<Vec<_>>();
        let (first, second) = (path(0, 3), path(10, 2));
        let vertices = |double| -> Vec<[u32; 3]> {
            let made = side_by_side(&first, &second, double);
            made.iter().map(|t| t.map(|v| v.0)).collect()
        };
        assert_eq!(vertices(false), [[0, 10, 11], [0, 11, 1], [1, 11, 2]]);
        assert_eq!(vertices(true), [[0, 10, 1], [1, 10, 2], [2, 10, 11]]);
    }
}
