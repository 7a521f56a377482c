//! The mesher of `isoform mesh` without the certificate: `isoform_mesher MODEL.hf SIZE THREADS
//! volume|surface [OUT.raw [CURVES]]`.
//!
//! It writes the mesh, and the feature curves as polylines for meshers that must be told of them.

use isoform::field::hyperfun::{Mode, Model};
use isoform::mesh::{Control, Options, mesh};
use peers::Raw;
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [model, size, threads, what, out @ ..] = args.as_slice() else {
        return Err(
            "isoform_mesher MODEL.hf SIZE THREADS volume|surface [OUT.raw [CURVES]]".into(),
        );
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.parse()?)
        .build_global()?;
    let model = Model::parse(&std::fs::read_to_string(model)?, Mode::Default)?;
    let (solid, _) = isoform::solid_of(&model, &vec![0.0; model.n_params()])?;
    let options = Options {
        size: size.parse()?,
        surface_only: what == "surface",
        ..Options::default()
    };
    let meshed = mesh(solid.as_ref(), &options, &Control::default())?;
    if let Some(path) = out.first() {
        Raw {
            points: meshed.mesh.points,
            triangles: meshed.mesh.triangles,
            tets: meshed.mesh.tets,
        }
        .write(path)?;
    }
    if let Some(path) = out.get(1) {
        let mut to = std::io::BufWriter::new(std::fs::File::create(path)?);
        for curve in &meshed.features.curves {
            writeln!(to, "{}", curve.points.len())?;
            for [x, y, z] in &curve.points {
                writeln!(to, "{x} {y} {z}")?;
            }
        }
    }
    Ok(())
}
