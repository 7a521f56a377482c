//! Rational surfaces with a last look at their triangles.

use isoform_geom::{Aabb, Mesh};
use isoform_mesh::Control;
use isoform_mesh::check::{self, Intersections, certify};
use isoform_tess::{Analysis, Map, Mode, Point3, Prepared, Stopped, Surface, TriangulateOptions};
use std::time::Instant;

/// How often the surface is made again, finer where triangles cross.
const ROUNDS: usize = 6;
/// More pairs of triangles that cross than this are no accident of sheets that are close together.
const MOST: usize = 2000;

/// [`isoform_tess::triangulate`]; where sheets are joined, triangles that cross all the same are found exactly. The surface is made again with a
/// finer tolerance around them; those that are left are said to be unproven.
///
/// # Errors
/// [`Stopped`].
pub fn rational_surface(map: &Map, options: &TriangulateOptions, stop: &dyn Fn() -> bool) -> Result<(Surface, Analysis), Stopped> {
    let mut prepared = Prepared::new(map, options, stop)?;
    let mut surface = prepared.surface(stop);
    if options.mode == Mode::Glued {
        let mut seconds = 0.0;
        let mut look = |surface: &Surface| {
            let clock = Instant::now();
            let found = crossings(surface);
            seconds += clock.elapsed().as_secs_f64();
            found
        };
        let mut found = look(&surface);
        for _ in 0..ROUNDS {
            let Some(i) = found.as_ref().filter(|i| (1..=MOST).contains(&i.pairs.count)) else { break };
            // What is open for other reasons is not mended by this.
            if !surface.unproven.is_empty() || surface.triangles.len() > options.mesh.triangles / 2 || stop() {
                break;
            }
            prepared.refine(&boxes(&surface, i));
            surface = prepared.surface(stop);
            found = look(&surface);
        }
        match found.map(|i| i.pairs.count) {
            Some(0) => {}
            Some(n) => surface.unproven.push(format!("{n} pairs of triangles cross")),
            None => surface.unproven.push("whether triangles cross was not looked for".to_owned()),
        }
        prepared.analysis.seconds.push(("crossings", seconds));
    }
    Ok((surface, prepared.analysis))
}

fn crossings(surface: &Surface) -> Option<Intersections> {
    let mesh = Mesh { points: surface.points.clone(), triangles: surface.triangles.clone(), ..Mesh::default() };
    let options = check::Options { places: MOST, ..check::Options::default() };
    certify(&mesh, None, &options, &Control::default()).intersections
}

/// Around the triangles that cross.
fn boxes(surface: &Surface, found: &Intersections) -> Vec<[Point3; 2]> {
    let triangles = found.pairs.places.iter().flat_map(|p| &p.elements);
    let around = |t: &u32| Aabb::of(&surface.triangles[*t as usize].map(|v| surface.points[v as usize]));
    triangles.map(around).map(|b| [b.lo, b.hi]).collect()
}
