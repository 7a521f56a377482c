//! From a rational map to triangles: Whitney's umbrella with its pinch point and its line of double
//! points, joined there, and what is proved of it.
//! `cargo run --release --example map_to_mesh -- umbrella.ply`

use isoform::geom::Mesh;
use isoform::io::{MeshWriteOptions, write_mesh_path};
use isoform::tess::{Map, MapOptions, TriangulateOptions};
use isoform::{Control, triangulate_map};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("umbrella.ply".to_owned());
    // X/W = st, Y/W = s, Z/W = t²: x² = y² z.
    let map = Map::parse(["s*t", "s", "t^2", "1"], MapOptions::default())?;
    let options = TriangulateOptions::around(1.into());
    let (surface, _) = triangulate_map(&map, &options, &Control::default())?;
    for (claim, verdict) in surface.certificate().decided() {
        println!("{:14} {verdict:?}", claim.to_string());
    }
    println!("certified: {}", surface.is_certified());

    let mesh = Mesh::from_triangles(surface.points.clone(), surface.triangles.clone());
    write_mesh_path(&mesh, path.as_ref(), None, &MeshWriteOptions::default())?;

    assert!(surface.is_certified());
    // The double points are the half line x = y = 0, z > 0 in the box.
    let on_line = |p: &[f64; 3]| p[0] == 0.0 && p[1] == 0.0 && p[2] >= 0.0;
    assert!(
        surface
            .double_curve
            .iter()
            .all(|arc| arc.points.iter().all(on_line))
    );
    for &[x, y, z] in &surface.points {
        assert!((x * x - y * y * z).abs() < 1e-9);
    }
    Ok(())
}
