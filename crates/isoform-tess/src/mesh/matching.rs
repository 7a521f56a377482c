//! Sheets that nearly touch, along a whole curve or next to a pinch point, are given each other's
//! vertices where their triangles cross.
//!
//! Such sheets are closer together than chords are to the surface: triangles of any size cross
//! there, unless both sheets have their vertices beside each other's. The place on one sheet that
//! is nearest to a vertex x of the other is the foot of a perpendicular: the parameters at which
//! |f(u, v) − x| is least, by the method of Gauss and Newton.

use super::chart::Chart;
use super::closing::UPON;
use super::geometry::{distance, longest};
use super::places::{in_plane, place_in};
use crate::map::Map;
use crate::surface::{Point3, Surface};
use isoform_geom::{cross, dot, sub};

/// Where a further vertex is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// The unit triangle.
    pub(super) quadrant: usize,
    /// The parameters in it.
    pub(super) at: [f64; 2],
    /// The face of the box that the vertex is on, as a bit; 0 for none.
    pub(super) faces: u8,
}

/// The distance of sheets up to which they get each other's vertices, per longest edge of the
/// triangles that cross: sheets farther apart are not parallel, and vertices of one say nothing
/// about the other.
const CLOSE: f64 = 0.2;
/// The most steps of Newton's method towards the foot of a perpendicular, each of which gains
/// digits.
const STEPS: usize = 8;
/// The length in the parameters of the last step: vertices need not be at the foot to rounding.
const STILL: f64 = 1e-9;

/// Two triangles that cross.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Their numbers.
    pub triangles: [u32; 2],
    /// Where both sheets get a further vertex, if they are to.
    pub point: Option<Point3>,
}

/// Where one sheet is next to the corners of triangles of another that cross it: pairs of triangles
/// in, places for further vertices out.
pub(crate) fn matching(
    map: &Map,
    half_width: f64,
    surface: &Surface,
    pairs: &[Crossing],
) -> Vec<Place> {
    let sheets = Sheets {
        charts: std::array::from_fn(|q| Chart::new(map, q, half_width)),
        half_width,
        surface,
    };
    let found = pairs.iter().flat_map(|pair| sheets.feet(pair));
    // Of places that lie upon each other one is enough.
    let mut places: Vec<(Place, Point3)> = Vec::new();
    for (place, image) in found {
        if places.iter().all(|p| sheets.are_apart(p.1, image)) {
            places.push((place, image));
        }
    }
    places.into_iter().map(|p| p.0).collect()
}

/// A surface with the charts that its sheets are met in.
struct Sheets<'a> {
    charts: [Chart; 4],
    half_width: f64,
    surface: &'a Surface,
}

impl Sheets<'_> {
    /// The feet of perpendiculars from the corners of two triangles to each other's sheet, and from
    /// the further vertex that both sheets are to get.
    fn feet(&self, crossing: &Crossing) -> Vec<(Place, Point3)> {
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
    /// The place of the sheet of a triangle that is nearest to a point, if it is close; on the same
    /// face of the box if the point is on one.
    fn foot(&self, triangle: usize, x: Point3, faces: u8) -> Option<(Place, Point3)> {
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
        let place = Place {
            quadrant,
            at,
            faces,
        };
        let is_close = distance(image, x) <= CLOSE * longest(corners);
        (is_close && self.has_room(&place, image)).then_some((place, image))
    }
    /// The parameters of the place nearest to a point, in a quadrant or beyond its sides; none if
    /// steps get longer.
    fn nearest(&self, quadrant: usize, start: [f64; 2], x: Point3, faces: u8) -> Option<[f64; 2]> {
        let mut at = start;
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let step = self.step(quadrant, at, x, faces)?;
            let length = step[0].hypot(step[1]);
            if length.is_nan() || length > 2.0 * last {
                return None;
            }
            at = [at[0] + step[0], at[1] + step[1]];
            if length <= STILL {
                break;
            }
            last = length;
        }
        Some(at)
    }
    /// Whether a vertex may be put at a place: in the unit triangle, in the box, and upon no other
    /// vertex.
    fn has_room(&self, &Place { at, faces, .. }: &Place, image: Point3) -> bool {
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
    /// Whether two points are no vertices upon each other, which would be worse than triangles that
    /// cross.
    fn are_apart(&self, a: Point3, b: Point3) -> bool {
        distance(a, b) > 2.0 * UPON * self.half_width
    }

    /// A step of Gauss and Newton towards the place that is nearest to a point; along the face of
    /// the box that it is on, if it is on one. None for edges of the box.
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

/// The shares of the corners of a triangle in the foot of the perpendicular from a point.
fn shares([p, q, r]: [Point3; 3], x: Point3) -> [f64; 3] {
    let normal = cross(sub(q, p), sub(r, p));
    let share =
        |a: Point3, b: Point3| dot(cross(sub(a, x), sub(b, x)), normal) / dot(normal, normal);
    [share(q, r), share(r, p), share(p, q)]
}

/// The sum of parameters by their shares.
fn weighted(shares: [f64; 3], parameters: [[f64; 2]; 3]) -> [f64; 2] {
    [0, 1].map(|i| (0..3).map(|k| shares[k] * parameters[k][i]).sum())
}
