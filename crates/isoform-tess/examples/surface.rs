//! Triangulates the surface of a map and writes it as OBJ: `surface MAP.json BOX [OUT.obj]`.

use isoform_algebra::RBig;
use isoform_control::Control;
use isoform_io::read_map;
use isoform_tess::{Budget, Map, TriangulateOptions, triangulate};
use std::fmt::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, file, half_width, out @ ..] = &args[..] else {
        return Err("usage: surface MAP.json BOX [OUT.obj]".into());
    };
    let polynomials = read_map(&std::fs::read_to_string(file)?)?.polynomials;
    let map = Map::new(polynomials, Default::default())?;
    let b: f64 = half_width.parse()?;
    let half_width = RBig::try_from(b).map_err(|_| "not a number")?;
    let mut options = TriangulateOptions::around(half_width);
    options.mesh.triangles = 2_000_000;
    options.budget = Budget::default();
    let (surface, analysis) = triangulate(&map, &options, &Control::default())?;
    println!(
        "{} triangles, {:?}, {:?}",
        surface.triangles.len(),
        surface.findings,
        analysis.seconds
    );
    if let [out, ..] = out {
        let mut text = String::new();
        for [x, y, z] in &surface.points {
            writeln!(text, "v {x} {y} {z}")?;
        }
        for t in &surface.triangles {
            writeln!(text, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
        }
        std::fs::write(out, text)?;
    }
    Ok(())
}
