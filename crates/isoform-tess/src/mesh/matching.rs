//! Matching of sheets that nearly touch, along a whole curve or next to a pinch point: where their
//! triangles cross, each sheet gets the vertices of the other one.
//!
//! Such sheets are closer together than chords are to the surface: triangles of any size cross
//! there, unless both sheets have vertices at corresponding places. The place on one sheet nearest
//! to a vertex x of the other is the foot of a perpendicular: the parameters that minimise |f(u, v)
//! − x|, found by the Gauss–Newton method.

use super::chart::Chart;
use super::geometry::{distance, longest};
use super::places::{in_plane, place_in};
use super::triangles::COINCIDENCE_DISTANCE;
use crate::map::Map;
use crate::surface::{Point3, Surface};
use isoform_geom::{cross, dot, sub};

/// Place at which a further vertex is inserted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InsertionPlace {
    /// Unit triangle.
    pub(super) quadrant: usize,
    /// Parameters in the unit triangle.
    pub(super) at: [f64; 2],
    /// Face of the box on which the vertex lies, as a bit; 0 if it is on no face.
    pub(super) faces: u8,
}

/// Two triangles that cross.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Indices of the triangles.
    pub triangles: [u32; 2],
    /// Point at which both sheets get a further vertex, if any.
    pub point: Option<Point3>,
}

/// Returns the places at which one sheet is next to the corners of triangles of another one that
/// cross it, given the pairs of triangles.
pub(crate) fn matching(
    map: &Map,
    half_width: f64,
    surface: &Surface,
    pairs: &[Crossing],
) -> Vec<InsertionPlace> {
    let sheets = SheetMatcher {
        charts: std::array::from_fn(|q| Chart::new(map, q, half_width)),
        half_width,
        surface,
    };
    let found = pairs.iter().flat_map(|pair| sheets.feet(pair));
    // Of coincident places one suffices.
    let mut places: Vec<(InsertionPlace, Point3)> = Vec::new();
    for (place, image) in found {
        if places.iter().all(|p| sheets.are_apart(p.1, image)) {
            places.push((place, image));
        }
    }
    places.into_iter().map(|p| p.0).collect()
}

/// A surface, with the charts in which its sheets are evaluated.
struct SheetMatcher<'a> {
    charts: [Chart; 4],
    half_width: f64,
    surface: &'a Surface,
}

impl SheetMatcher<'_> {
    /// Returns the feet of perpendiculars from the corners of two triangles to each other's sheet,
    /// and from the further vertex that both sheets get.
    fn feet(&self, crossing: &Crossing) -> Vec<(InsertionPlace, Point3)> {
        let surface = self.surface;
        let [a, b] = crossing.triangles;
        let mut found = Vec::new();
        for t in [a, b] {
            found.extend(crossing.point.and_then(|x| self.foot(t as usize, x, 0)));
        }
        for (of, onto) in [(a, b), (b, a)] {
            let beside = &surface.triangles[onto as usize];
            for v in surface.triangles[of as usize] {
                let (x, faces) = (surface.points[v as usize], surface.faces[v as usize]);
                if !beside.contains(&v) {
                    found.extend(self.foot(onto as usize, x, faces));
                }
            }
        }
        found
    }
    /// Returns the place on the sheet of a triangle nearest to a point, if it is close. If the
    /// point is on a face of the box, the place is on that face, too.
    fn foot(&self, triangle: usize, x: Point3, faces: u8) -> Option<(InsertionPlace, Point3)> {
        let surface = self.surface;
        let corners = surface.triangles[triangle].map(|v| surface.points[v as usize]);
        let quadrant = usize::from(surface.charts[triangle]);
        let start = weighted(shares(corners, x), surface.corners[triangle]);
        let at = self.nearest(quadrant, start, x, faces)?;
        let there = in_plane(quadrant, at);
        let (quadrant, at) = (0..4)
            .map(|k| (quadrant + k) % 4)
            .find_map(|q| Some((q, place_in(q, there)?)))?;
        let image = self.charts[quadrant].at(at);
        let place = InsertionPlace {
            quadrant,
            at,
            faces,
        };
        // Sheets farther apart, per longest edge, are not parallel, and vertices of one do not
        // matter to the other.
        let is_close = distance(image, x) <= 0.2 * longest(corners);
        (is_close && self.has_room(&place, image)).then_some((place, image))
    }
    /// Returns the parameters of the place nearest to a point, in a quadrant or beyond its sides;
    /// `None` if the steps get longer.
    fn nearest(&self, quadrant: usize, start: [f64; 2], x: Point3, faces: u8) -> Option<[f64; 2]> {
        let mut at = start;
        let mut last = f64::INFINITY;
        // Newton steps towards the foot of the perpendicular, each of which gains digits.
        for _ in 0..8 {
            let step = self.step(quadrant, at, x, faces)?;
            let length = step[0].hypot(step[1]);
            if length.is_nan() || length > 2.0 * last {
                return None;
            }
            at = [at[0] + step[0], at[1] + step[1]];
            // Vertices need not be at the foot to rounding.
            if length <= 1e-9 {
                break;
            }
            last = length;
        }
        Some(at)
    }
    /// Returns true if a vertex may be inserted at a place: in the unit triangle, in the box, and
    /// distinct from all other vertices.
    fn has_room(&self, &InsertionPlace { at, faces, .. }: &InsertionPlace, image: Point3) -> bool {
        let is_inside = at[0] > 0.0 && at[1] > 0.0 && at[0] + at[1] < 1.0;
        let is_in_box = faces > 0 || image.iter().all(|x| x.abs() < self.half_width);
        is_inside
            && is_in_box
            && self
                .surface
                .points
                .iter()
                .all(|&p| self.are_apart(image, p))
    }
    /// Returns true if two points would not be coincident vertices, which are worse than crossing
    /// triangles.
    fn are_apart(&self, a: Point3, b: Point3) -> bool {
        distance(a, b) > 2.0 * COINCIDENCE_DISTANCE * self.half_width
    }

    /// Returns a Gauss–Newton step towards the place nearest to a point. A point on a face of the
    /// box is approached along the face; `None` for points on edges of the box.
    fn step(&self, quadrant: usize, at: [f64; 2], x: Point3, faces: u8) -> Option<[f64; 2]> {
        let chart = &self.charts[quadrant];
        if faces == 0 {
            return chart.step(at, x);
        }
        let axis = (faces.count_ones() == 1).then(|| faces.trailing_zeros() as usize / 2)?;
        let [p, by_u, by_v] = chart.tangents(at);
        let image =
            |d: [f64; 2]| -> Point3 { std::array::from_fn(|k| d[0] * by_u[k] + d[1] * by_v[k]) };
        // Onto the face, and along it.
        let [g, h] = [by_u[axis], by_v[axis]];
        let off = sub(x, p);
        let onto = [g, h].map(|g_i| g_i * off[axis] / (g * g + h * h));
        let along = [-h, g];
        let way = image(along);
        let share = dot(way, sub(off, image(onto))) / dot(way, way);
        Some([0, 1].map(|i| onto[i] + share * along[i]))
    }
}

/// Returns the barycentric coordinates of the foot of the perpendicular from a point on a triangle.
fn shares([p, q, r]: [Point3; 3], x: Point3) -> [f64; 3] {
    let normal = cross(sub(q, p), sub(r, p));
    let share =
        |a: Point3, b: Point3| dot(cross(sub(a, x), sub(b, x)), normal) / dot(normal, normal);
    [share(q, r), share(r, p), share(p, q)]
}

/// Returns the combination of parameters with barycentric coordinates.
fn weighted(shares: [f64; 3], parameters: [[f64; 2]; 3]) -> [f64; 2] {
    [0, 1].map(|i| (0..3).map(|k| shares[k] * parameters[k][i]).sum())
}
