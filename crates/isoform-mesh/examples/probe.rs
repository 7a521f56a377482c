//! Meshes a HyperFun program and writes bare numbers, for looking at: `probe MODEL.hf SIZE [OUT.tet
//! [ORDER [GRADE]]]`.
use isoform_field::Pieces;
use isoform_field::hyperfun::{Mode, Model};
use isoform_mesh::{Control, Options, mesh};
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let a: Vec<String> = std::env::args().collect();
    let model = Model::parse(&std::fs::read_to_string(&a[1])?, Mode::Default)?;
    let solid = Pieces::of_model(&model, &vec![0.0; model.n_params()])?;
    let number = |k: usize| a.get(k).map(|s| s.parse::<f64>()).transpose();
    let order = number(4)?.unwrap_or(1.0) as u32;
    let options = Options {
        size: number(2)?.unwrap_or(0.1),
        order,
        grade: number(5)?.filter(|g| *g > 0.0),
        ..Options::default()
    };
    let clock = std::time::Instant::now();
    let say = |w: &str, _: f64| eprintln!("{:8.3} {w}", clock.elapsed().as_secs_f64());
    let m = mesh(
        &solid,
        &options,
        &Control {
            progress: Some(&say),
            ..Control::default()
        },
    )?;
    say("done", 1.0);
    for w in &m.warnings {
        println!("{} {:?}", w.kind, w.at);
    }
    let m = m.mesh;
    println!(
        "{} points {} tets {} triangles {} edges {} parts",
        m.points.len(),
        m.tets.len(),
        m.triangles.len(),
        m.edges.len(),
        m.parts.len()
    );
    if let Some(out) = a.get(3) {
        let mut f = std::io::BufWriter::new(std::fs::File::create(out)?);
        writeln!(f, "tet {} {}", m.points.len(), m.tets.len())?;
        for p in &m.points {
            writeln!(f, "{:?} {:?} {:?}", p[0], p[1], p[2])?;
        }
        for (k, t) in m.tets.iter().enumerate() {
            writeln!(f, "{} {} {} {}", t[0], t[1], t[2], t[3])?;
            if let Some(m) = m.tet_mids.get(k) {
                writeln!(f, "{} {} {} {} {} {}", m[0], m[1], m[2], m[3], m[4], m[5])?;
            }
        }
    }
    Ok(())
}
