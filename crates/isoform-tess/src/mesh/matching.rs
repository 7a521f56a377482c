//! Sheets that nearly touch, along a whole curve or next to a pinch point, closer together than
//! chords are to the surface: triangles of any size cross there, unless both sheets have their
//! vertices beside each other's. Where triangles cross, each sheet is given the vertices of the
//! other.

use super::chart::Chart;
use super::{distance, in_plane, place_in};
use crate::map::Map;
use crate::surface::{Point3, Surface};
use isoform_geom::{cross, dot, sub};

/// A place in a unit triangle, by its quadrant.
pub(crate) type Place = (usize, [f64; 2]);

/// How far from each other the sheets may be, per longest edge of the triangles that cross: what is
/// farther apart is not parallel, and vertices of one sheet say nothing about the other.
const CLOSE: f64 = 0.2;
/// Steps towards the foot of a perpendicular, each of which gains digits, and where in shares of
/// the step before they end.
const STEPS: usize = 8;
const STILL: f64 = 1e-3;

/// Two triangles that cross.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Which.
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
    let charts: [Chart; 4] = std::array::from_fn(|q| Chart::new(map, q, half_width));
    let mut found = Vec::new();
    for &Crossing {
        triangles: [a, b],
        point,
    } in pairs
    {
        for t in [a, b] {
            found.extend(point.and_then(|x| foot(&charts, surface, t as usize, x)));
        }
        for (of, onto) in [(a, b), (b, a)] {
            let corners = surface.triangles[of as usize];
            let beside = &surface.triangles[onto as usize];
            for v in corners.into_iter().filter(|v| !beside.contains(v)) {
                let x = surface.points[v as usize];
                found.extend(foot(&charts, surface, onto as usize, x));
            }
        }
    }
    found.sort_by(|a: &Place, b| {
        a.0.cmp(&b.0)
            .then(a.1[0].total_cmp(&b.1[0]))
            .then(a.1[1].total_cmp(&b.1[1]))
    });
    found.dedup();
    found
}

/// The place of the sheet of a triangle that is nearest to a point, if it is close.
fn foot(charts: &[Chart; 4], surface: &Surface, triangle: usize, x: Point3) -> Option<Place> {
    let [p, q, r] = surface.triangles[triangle].map(|v| surface.points[v as usize]);
    let corners = surface.corners[triangle];
    let normal = cross(sub(q, p), sub(r, p));
    let size = dot(normal, normal);
    let share = |a: Point3, b: Point3| dot(cross(sub(a, x), sub(b, x)), normal) / size;
    let shares = [share(q, r), share(r, p), share(p, q)];
    let long = [(p, q), (q, r), (r, p)].map(|(a, b)| distance(a, b));
    let close = CLOSE * long.into_iter().fold(0.0, f64::max);
    let quadrant = usize::from(surface.charts[triangle]);
    let mut at = [0, 1].map(|i| (0..3).map(|k| shares[k] * corners[k][i]).sum::<f64>());
    let mut last = f64::INFINITY;
    for _ in 0..STEPS {
        let step = charts[quadrant].step(at, x)?;
        let length = step[0].hypot(step[1]);
        at = [at[0] + step[0], at[1] + step[1]];
        if length.is_nan() || length > 2.0 * last {
            return None;
        }
        if length <= STILL * last.min(1.0) * 1e-3 {
            break;
        }
        last = length;
    }
    let [own, there] = [quadrant; 2].map(|q| (q, in_plane(q, at)));
    let place = (0..4)
        .map(|k| (own.0 + k) % 4)
        .find_map(|q| Some((q, place_in(q, there.1)?)))?;
    let is_inside = place.1[0] > 0.0 && place.1[1] > 0.0 && place.1[0] + place.1[1] < 1.0;
    let image = charts[place.0].at(place.1);
    (is_inside && distance(image, x) <= close).then_some(place)
}
