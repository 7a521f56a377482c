//! Trial: try FIT.txt TEST.txt key=value...
use isoform_geom::{Field, Point3};
fn read(path: &str) -> (Vec<Point3>, Vec<Point3>) {
    let text = std::fs::read_to_string(path).expect("a file");
    text.lines()
        .map(|l| {
            let v: Vec<f64> = l.split_whitespace().map(|w| w.parse().expect("number")).collect();
            ([v[0], v[1], v[2]], if v.len() > 5 { [v[3], v[4], v[5]] } else { [0.0; 3] })
        })
        .unzip()
}
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let get = |k: &str, d: f64| args.iter().find_map(|a| a.strip_prefix(&format!("{k}="))).map_or(d, |v| v.parse().expect("number"));
    let (p, mut m) = read(&args[0]);
    let (q, _) = read(&args[1]);
    let t = std::time::Instant::now();
    use isoform_spline::{Fineness, Normals};
    let fineness = if get("tol", 0.0) > 0.0 { Fineness::Tolerance(get("tol", 0.0)) } else if get("cells", 0.0) > 0.0 { Fineness::Cells(get("cells", 0.0) as usize) } else { Fineness::Data };
    let options = isoform_spline::Options { fineness, smoothing: get("lambda", 1e-6), degree: get("degree", 3.0) as usize };
    let normals = if get("estimate", 0.0) > 0.0 { Normals::Unknown } else { Normals::Given(&m) };
    let made = isoform_spline::implicitize(&p, normals, &options, &isoform_control::Control::default());
    let made = match made { Ok(m) => m, Err(e) => { println!("{e}"); return } };
    println!("{:?} {:?} {:?} cells {} depth {}", made.sides, made.components, made.distances, made.spline.data_cells(), made.spline.depth());
    let f = made.spline;
    m.clear();
    let s = t.elapsed().as_secs_f64();
    let b = isoform_geom::Aabb::of(&p);
    let rms = |q: &[Point3]| {
        let mut v: Vec<f64> = q.iter().map(|p| {
            // Newton to the foot.
            let mut y = *p;
            for _ in 0..8 {
                let j = f.jet(y);
                let g: f64 = j.g.iter().map(|v| v * v).sum();
                let d: f64 = (0..3).map(|k| j.g[k] * (y[k] - p[k])).sum();
                let lam = (-j.v + d) / g;
                y = std::array::from_fn(|k| p[k] + lam * j.g[k]);
            }
            isoform_geom::norm(isoform_geom::sub(y, *p)).min(0.05 * b.diagonal()) / b.diagonal()
        }).collect();
        v.sort_by(f64::total_cmp);
        ((v.iter().map(|v| v * v).sum::<f64>() / v.len() as f64).sqrt(), v[v.len() * 95 / 100], v[v.len() - 1])
    };
    let (a, c) = (rms(&q), rms(&p[..p.len().min(3000)]));
    println!("{} unknowns {s:.2} s  test rms {:.2e} p95 {:.2e} max {:.1e}  own rms {:.2e}", f.unknowns(), a.0, a.1, a.2, c.0);
}
