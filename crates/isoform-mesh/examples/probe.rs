//! Meshes of solids written by hand, for looking at.
use isoform_geom::*;
use isoform_mesh::{Control, Options, mesh};
use isoform_num::{Interval, Jet1, Jet2, Real};

struct Hand {
    names: Vec<String>,
    tree: Csg,
    which: u8,
}
fn piece<R: Real>(which: u8, i: u32, p: [R; 3]) -> R {
    let k = R::constant;
    let [x, y, z] = p;
    match which {
        0 => k(1.0) - (x.square() + y.square() + z.square()).sqrt(),
        1 => match i {
            0 => x + k(5.0),
            1 => k(5.0) - x,
            2 => y + k(4.0),
            3 => k(1.0) - y,
            4 => z + k(2.0),
            5 => k(2.0) - z,
            6 => ((x + k(2.0)).square() + (y + k(1.5)).square()).sqrt() - k(1.25),
            _ => ((x - k(3.0)).square() + (y - k(0.5)).square()).sqrt() - k(1.5),
        },
        _ => {
            let w = k(std::f64::consts::TAU);
            let g = (w.clone() * x.clone()).sin() * (w.clone() * y.clone()).cos()
                + (w.clone() * y.clone()).sin() * (w.clone() * z.clone()).cos()
                + (w.clone() * z.clone()).sin() * (w.clone() * x.clone()).cos();
            match i {
                0 => k(0.95) + x,
                1 => k(0.95) - x,
                2 => k(0.95) + y,
                3 => k(0.95) - y,
                4 => k(0.95) + z,
                5 => k(0.95) - z,
                6 => k(0.6) - g,
                _ => k(0.6) + g,
            }
        }
    }
}
impl Solid for Hand {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for (k, w) in which.iter().enumerate() {
            for (i, p) in points.iter().enumerate() {
                out[k * points.len() + i] = piece(self.which, *w, *p);
            }
        }
    }
    fn gradient(&self, i: u32, p: Point3) -> (f64, Point3) {
        let j = piece(self.which, i, [0, 1, 2].map(|k| Jet1::<3>::variable(p[k], k)));
        (j.v, j.g)
    }
    fn jet(&self, i: u32, p: Point3) -> Jet2 {
        piece(self.which, i, [0, 1, 2].map(|k| Jet2::variable(p[k], k)))
    }
    fn bounds(&self, which: &[u32], r: Aabb, out: &mut [Interval]) {
        for (o, w) in out.iter_mut().zip(which) {
            *o = piece(self.which, *w, [0, 1, 2].map(|k| Interval::new(r.lo[k], r.hi[k])));
        }
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, o) in points.iter().zip(out) {
            *o = self.tree.value(&|i| piece(self.which, i, *p));
        }
    }
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (which, n, r, size) = match a[1].as_str() {
        "sphere" => (0, 1, Aabb { lo: [-1.0; 3], hi: [1.0; 3] }, 0.08),
        "part" => (1, 8, Aabb { lo: [-5.0, -4.0, -2.0], hi: [5.0, 1.0, 2.0] }, 0.25),
        _ => (2, 8, Aabb { lo: [-0.95; 3], hi: [0.95; 3] }, 0.05),
    };
    let size = a.get(2).map_or(size, |s| s.parse().unwrap());
    let tree = if n == 1 { Csg::Piece(0) } else { Csg::Min((0..n).map(Csg::Piece).collect()) };
    let s = Hand { names: (0..n).map(|i| format!("p{i}")).collect(), tree, which };
    let _ = r;
    let clock = std::time::Instant::now();
    let say = |w: &str| eprintln!("{:8.3} {w}", clock.elapsed().as_secs_f64());
    let control = Control { progress: Some(&say), ..Control::default() };
    let m = mesh(&s, &Options { size, ..Options::default() }, &control).unwrap().mesh;
    say("done");
    println!("{} points {} tets {} triangles {} edges {:?}", m.points.len(), m.tets.len(), m.triangles.len(), m.edges.len(), m.parts);
    if let Some(out) = a.get(3) {
        use std::io::Write;
        let mut f = std::io::BufWriter::new(std::fs::File::create(out).unwrap());
        writeln!(f, "tet {} {}", m.points.len(), m.tets.len()).unwrap();
        for p in &m.points {
            writeln!(f, "{:?} {:?} {:?}", p[0], p[1], p[2]).unwrap();
        }
        for t in &m.tets {
            writeln!(f, "{} {} {} {}", t[0], t[1], t[2], t[3]).unwrap();
        }
    }
}
