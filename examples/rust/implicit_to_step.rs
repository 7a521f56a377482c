//! From a function to CAD: a torus is covered with rational patches whose distance from it is
//! proved, and written as STEP. `cargo run --release --example implicit_to_step -- torus.step`

use isoform::geom::Aabb;
use isoform::io::{StepOptions, write_step_path};
use isoform::patch::{Covering, Options};
use isoform::{Control, ImplicitSurface, cover_surface, step_faces};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("torus.step".to_owned());
    // Inside is positive: radii 0.3 and 0.12.
    let torus = "36/100*(x^2 + y^2) - (x^2 + y^2 + z^2 + 9/100 - 144/10000)^2";
    let surface = ImplicitSurface::of_polynomial(torus)?.ok_or("no surface")?;
    let region = Aabb {
        lo: [-0.5; 3],
        hi: [0.5; 3],
    };
    let tolerance = 1e-3;
    let options = Options::new((2, 2), tolerance, region);
    let cover = cover_surface(
        &surface,
        &options,
        &Covering::default(),
        &Control::default(),
    )?;
    let bounds = cover.patches.iter().filter_map(|p| p.distances.bound);
    let worst = bounds.fold(0.0, f64::max);
    println!(
        "{} patches, at most {worst:.1e} from the torus",
        cover.patches.len()
    );

    let faces = step_faces(surface.field.as_ref(), &cover.patches);
    write_step_path(&faces, path.as_ref(), &StepOptions::default())?;

    assert!(worst <= tolerance && cover.covered == cover.samples);
    // Every control point in the middle of a patch is near the torus.
    for patch in &cover.patches {
        let [x, y, z] = patch.grown.patch.point(0.5, 0.5);
        let distance = ((x.hypot(y) - 0.3).hypot(z) - 0.12).abs();
        assert!(distance <= tolerance, "{distance}");
    }
    Ok(())
}
