//! From a scan to a mesh for finite elements: the cup that the library carries is fitted, meshed,
//! and written for Gmsh. `cargo run --release --example scan_to_mesh -- cup.msh`

use isoform::field::hyperfun::{Mode, Model};
use isoform::io::{MeshWriteOptions, write_mesh_path};
use isoform::{
    Control, FitOptions, MeshModelOptions, example_scan, fit_scan, mesh_model, template,
};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("cup.msh".to_owned());
    let (mut scan, _) = example_scan();
    // Every fourth point is enough for a look.
    scan.points = scan.points.iter().step_by(4).copied().collect();

    let cup = template("cup").ok_or("no such template")?.model();
    let fitted = fit_scan(&scan, &cup, &FitOptions::default(), &Control::default())?;
    for (parameter, value) in fitted.fit.parameters.iter().zip(fitted.values()) {
        let half = parameter.ci95.map_or(f64::NAN, |(lo, hi)| 0.5 * (hi - lo));
        println!("{:14} {value:9.5} ± {half:.5}", parameter.name);
    }

    // The fitted program is HyperFun in the scan's coordinates, with no parameter left.
    let model = Model::parse(&fitted.program(), Mode::Default)?;
    // The walls are 2 mm thick; by default edges would be 3 mm long, too coarse for the rim.
    let options = MeshModelOptions {
        size: Some(0.002),
        ..MeshModelOptions::default()
    };
    let made = mesh_model(&model, &[], &options, &Control::default())?;
    let mesh = &made.meshed.mesh;
    println!(
        "{} tetrahedra, certified: {}",
        mesh.tets.len(),
        made.certificate.is_ok()
    );
    write_mesh_path(mesh, path.as_ref(), None, &MeshWriteOptions::default())?;

    // The cup is 69 mm high, and its walls hold some 30 cubic centimetres.
    let height = fitted.template.index("height")?;
    assert!((fitted.values()[height] - 0.0687).abs() < 0.001);
    assert!(made.certificate.is_ok());
    Ok(())
}
