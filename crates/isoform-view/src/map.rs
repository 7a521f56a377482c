//! Rational maps in a page: the triangles in space and in the parameter plane, and the map itself,
//! so that points between the corners are exact.

use crate::blob::Blobs;
use crate::points::positions;
use isoform::algebra::Poly;
use isoform::tess::{Analysis, Map, Surface};
use serde_json::{Value, json};

/// Returns the layer of a map.
pub(crate) fn layer(
    name: &str,
    map: &Map,
    surface: &Surface,
    analysis: &Analysis,
    half_width: f64,
    blobs: &mut Blobs,
) -> Value {
    let corners = surface
        .corners
        .as_flattened()
        .as_flattened()
        .iter()
        .copied();
    let base: Vec<[f64; 3]> = analysis
        .base_points
        .iter()
        .flatten()
        .map(|b| b.to_f64())
        .collect();
    let arcs =
        |points: &[[f64; 3]]| Value::from(points.iter().map(|p| json!(p)).collect::<Vec<_>>());
    json!({
        "kind": "map",
        "name": name,
        "count": surface.triangles.len(),
        "positions": positions(&surface.points, [0.0; 3], blobs),
        "triangles": blobs.u32(surface.triangles.as_flattened()),
        "charts": blobs.u8(&surface.charts),
        "corners": blobs.f32(corners),
        "frame": surface.frame,
        "degree": map.degree(),
        "forms": map.affine().each_ref().map(terms),
        "halfWidth": half_width,
        "basePoints": base,
        "double": surface.double_curve.iter().map(|arc| arcs(&arc.points)).collect::<Vec<_>>(),
        "solitary": surface.solitary_arcs.iter().map(|arc| arcs(arc)).collect::<Vec<_>>(),
        "isCertified": surface.is_certified(),
    })
}

/// Returns the terms of a polynomial in s and t: both exponents and the coefficient.
fn terms(polynomial: &Poly) -> Vec<Value> {
    let terms = polynomial.to_f64().into_iter();
    terms.map(|(e, c)| json!([e[0], e[1], c])).collect()
}
