//! Rational surfaces with a last look at their triangles.

use isoform_geom::Mesh;
use isoform_mesh::Control;
use isoform_mesh::check::{self, certify};
use isoform_tess::{Analysis, Map, Mode, Stopped, Surface, TriangulateOptions};
use std::time::Instant;

/// [`isoform_tess::triangulate`]; where sheets are joined, triangles that cross all the same are found exactly and said to be unproven.
///
/// # Errors
/// [`Stopped`].
pub fn rational_surface(map: &Map, options: &TriangulateOptions, stop: &dyn Fn() -> bool) -> Result<(Surface, Analysis), Stopped> {
    let (mut surface, mut analysis) = isoform_tess::triangulate(map, options, stop)?;
    if options.mode == Mode::Glued {
        let clock = Instant::now();
        let mesh = Mesh { points: surface.points.clone(), triangles: surface.triangles.clone(), ..Mesh::default() };
        let certificate = certify(&mesh, None, &check::Options::default(), &Control::default());
        match certificate.intersections.map(|i| i.pairs.count) {
            Some(0) => {}
            Some(n) => surface.unproven.push(format!("{n} pairs of triangles cross")),
            None => surface.unproven.push("whether triangles cross was not looked for".to_owned()),
        }
        analysis.seconds.push(("crossings", clock.elapsed().as_secs_f64()));
    }
    Ok((surface, analysis))
}
