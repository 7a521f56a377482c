//! Steps of a lattice on a face, and its points inside.

use crate::edges::FacetOptions;
use crate::trim::TrimmedFace;
use isoform_geom::cad::SurfaceJet;
use isoform_geom::{Point3, dot, norm};

/// Maximum number of points of the lattice of a face.
const MAX_LATTICE_POINTS: f64 = 100_000.0;
/// Maximum turn of the normal along a step, in radians: 30°.
const MAX_STEP_TURN: f64 = 0.52;
/// Maximum ratio of the two steps in space: longer triangles are thin.
const MAX_STEP_RATIO: f64 = 8.0;
/// Number of samples of a face in each direction, at which its curvature is taken.
const CURVATURE_SAMPLES: usize = 9;

/// Returns the steps of u and v of a lattice whose triangles are near the surface; infinite on a
/// plane.
pub(crate) fn steps(face: &TrimmedFace, bounds: [[f64; 2]; 2], options: &FacetOptions) -> [f64; 2] {
    let mut steps = [f64::INFINITY; 2];
    let surface = &face.face.chart.surface;
    let mut lengths = [0.0f64; 2];
    let at = |k: usize, i: usize| {
        let [lo, hi] = bounds[k];
        lo + (hi - lo) * (i as f64 + 0.5) / CURVATURE_SAMPLES as f64
    };
    for i in 0..CURVATURE_SAMPLES {
        for j in 0..CURVATURE_SAMPLES {
            let jet = surface.at([at(0, i), at(1, j)]);
            let local = local_steps(&jet, options);
            let length = [norm(jet.u), norm(jet.v)];
            for k in 0..2 {
                steps[k] = steps[k].min(local[k]);
                lengths[k] = lengths[k].max(length[k]);
            }
        }
    }
    // Chords along diagonals are off by the sum of both.
    if steps.iter().all(|s| s.is_finite()) {
        steps = steps.map(|s| s / std::f64::consts::SQRT_2);
    }
    for k in 0..2 {
        let other = steps[1 - k] * lengths[1 - k] * MAX_STEP_RATIO;
        if lengths[k] > 0.0 {
            steps[k] = steps[k].min(other / lengths[k]);
            steps[k] = steps[k].min(options.longest / lengths[k]);
        }
    }
    steps
}

/// Returns the steps at a point: a chord of length L is k L²/8 from a curve with the curvature k.
fn local_steps(jet: &SurfaceJet, options: &FacetOptions) -> [f64; 2] {
    let n = jet.normal();
    let length = norm(n);
    if length.is_nan() || length <= 1e-9 * norm(jet.u) * norm(jet.v) {
        return [f64::INFINITY; 2];
    }
    let n: Point3 = n.map(|v| v / length);
    let limit = |first: Point3, second: Point3| {
        let bend = dot(second, n).abs();
        let near = (8.0 * options.chord / bend).sqrt();
        near.min(MAX_STEP_TURN * norm(first) / bend)
    };
    let mut steps = [limit(jet.u, jet.uu), limit(jet.v, jet.vv)];
    // A twist moves the middle of a cell by a quarter of it.
    let twist = 4.0 * options.chord / dot(jet.uv, n).abs();
    if twist < f64::INFINITY {
        let [u, v] = [norm(jet.u), norm(jet.v)];
        let even = [(twist * v / u).sqrt(), (twist * u / v).sqrt()];
        if steps[0] * steps[1] > twist {
            steps = [
                steps[0].min(even[0].max(0.0)),
                steps[1].min(even[1].max(0.0)),
            ];
        }
    }
    steps
}

/// Returns the points of a lattice of equilateral triangles of side 1, in its coordinates, that lie
/// between closed polygons with these sides and away from them.
pub(crate) fn inside(sides: &[[[f64; 2]; 2]]) -> Vec<[f64; 2]> {
    let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for at in sides.iter().flatten() {
        for k in 0..2 {
            lo[k] = lo[k].min(at[k]);
            hi[k] = hi[k].max(at[k]);
        }
    }
    let [width, height] = [hi[0] - lo[0], hi[1] - lo[1]];
    let least = (width * height / MAX_LATTICE_POINTS)
        .sqrt()
        .max(width.max(height) / MAX_LATTICE_POINTS);
    let step = least.max(1.0);
    if !(step.is_finite() && width.is_finite()) {
        return Vec::new();
    }
    let rise = 0.75f64.sqrt() * step;
    let rows = (height / rise) as usize;
    let mut places = Vec::new();
    for row in 1..=rows {
        let y = lo[1] + rise * row as f64;
        let shift = if row % 2 == 0 { 0.0 } else { 0.5 * step };
        add_row(sides, y, lo[0] + shift, step, &mut places);
    }
    places
}

/// Adds the points of a row that are inside and away from the sides.
fn add_row(sides: &[[[f64; 2]; 2]], y: f64, from: f64, step: f64, places: &mut Vec<[f64; 2]>) {
    // Points nearer to the border than 45 % of the step would make thin triangles.
    let near = 0.45 * step;
    let mut crossings = Vec::new();
    let mut beside: Vec<[[f64; 2]; 2]> = Vec::new();
    for side in sides {
        let [a, b] = *side;
        if (a[1] > y) != (b[1] > y) {
            crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
        }
        if a[1].min(b[1]) <= y + near && a[1].max(b[1]) >= y - near {
            beside.push(*side);
        }
    }
    crossings.sort_unstable_by(f64::total_cmp);
    beside.sort_unstable_by(|a, b| a[0][0].min(a[1][0]).total_cmp(&b[0][0].min(b[1][0])));
    for within in crossings.as_chunks::<2>().0 {
        let mut k = ((within[0] - from) / step).ceil();
        while from + k * step < within[1] {
            let at = [from + k * step, y];
            let is_near = |side: &[[f64; 2]; 2]| crate::loops::distance_to_chord(at, *side) < near;
            if !beside.iter().any(is_near) {
                places.push(at);
            }
            k += 1.0;
        }
    }
}
