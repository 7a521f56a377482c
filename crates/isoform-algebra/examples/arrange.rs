//! How long the arrangement of a map's box curves takes: `arrange MAP.json [HALF-WIDTH]`.
use isoform_algebra::{Arrangement, Poly, RBig, coprime_base, in_triangle};
use isoform_control::Control;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let a: Vec<String> = std::env::args().collect();
    let map: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&a[1])?)?;
    let b = a.get(2).map_or_else(
        || map["box"].as_f64().unwrap_or(1.0),
        |b| b.parse().unwrap_or(1.0),
    );
    let b = RBig::try_from(b).map_err(|_| "no number")?;
    let parse = |k: &&str| Poly::parse(map[*k].as_str().unwrap_or("0"), &["s", "t"]);
    let parsed: Vec<Poly> = ["X", "Y", "Z", "W"]
        .iter()
        .map(parse)
        .collect::<Result<_, _>>()?;
    let n = parsed.iter().map(Poly::total_degree).max().unwrap_or(0);
    let forms: Vec<Poly> = parsed.iter().map(|p| p.homogenise(2, n)).collect();
    let faces: Vec<Poly> = forms[..3]
        .iter()
        .flat_map(|x| [b.clone(), -b.clone()].map(|side| x - &forms[3].scale(&side)))
        .collect();
    let (base, _) = coprime_base(&faces);
    let clock = std::time::Instant::now();
    for quadrant in 0..4 {
        let curves: Vec<Poly> = base.iter().map(|f| in_triangle(f, quadrant)).collect();
        let arrangement = Arrangement::new(&curves, &Control::default())?;
        let arcs: usize = arrangement.slabs.iter().map(|s| s.arcs.len()).sum();
        print!("{} walls {arcs} arcs; ", arrangement.walls.len());
    }
    println!(
        "{} curves of degree {n}: {:.3} s",
        base.len(),
        clock.elapsed().as_secs_f64()
    );
    Ok(())
}
