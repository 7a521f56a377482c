//! Solids shared by the tests: programs, and formulas written for every number type, joined by a
//! tree.

use isoform_field::Pieces;
use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::{Interval, Jet1, Jet2, Real};

/// The unit ball.
pub(crate) const SPHERE: &str = "m(x[3], a[1]) { m = 1 - sqrt(x[1]^2 + x[2]^2 + x[3]^2); }";
/// The block of [`part`] minus its two cylinders.
pub(crate) const PART: &str = "m(x[3], a[1]) {
    array c[3], d[3], e[3];
    c = [-5, -4, -2]; d = [-2, -1.5, 0]; e = [3, 0.5, 0];
    m = (hfBlock(x, c, 10, 5, 4) \\ hfCylinderZ(x, d, 1.25)) \\ hfCylinderZ(x, e, 1.5);
}";

/// The solid of a program, all parameters 0.
pub(crate) fn solid(text: &str) -> Pieces {
    let model = Model::parse(text, Mode::Default).expect("a program");
    Pieces::of_model(&model, &vec![0.0; model.n_params()]).expect("an expression")
}

/// A formula for a piece, for every number type.
pub(crate) trait Formula: Send + Sync {
    fn real(&self, p: Point3) -> f64;
    fn gradient(&self, p: [Jet1<3>; 3]) -> Jet1<3>;
    fn jet(&self, p: [Jet2; 3]) -> Jet2;
    fn interval(&self, p: [Interval; 3]) -> Interval;
}

macro_rules! formulas {
    ($($(#[$doc:meta])* $name:ident { $($field:ident : $type:ty),* } |$s:ident, $x:ident, $y:ident, $z:ident| $body:expr;)*) => { $(
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub(crate) struct $name { $(pub(crate) $field: $type),* }
        impl $name {
            fn eval<R: Real>(&self, [$x, $y, $z]: [R; 3]) -> R { let $s = self; $body }
        }
        impl Formula for $name {
            fn real(&self, p: Point3) -> f64 { self.eval(p) }
            fn gradient(&self, p: [Jet1<3>; 3]) -> Jet1<3> { self.eval(p) }
            fn jet(&self, p: [Jet2; 3]) -> Jet2 { self.eval(p) }
            fn interval(&self, p: [Interval; 3]) -> Interval { self.eval(p) }
        }
    )* };
}

fn c<R: Real>(v: f64) -> R {
    R::constant(v)
}

formulas! {
    /// n · p + d.
    Plane { n: Point3, d: f64 } |s, x, y, z| {
        let term = |n: f64, v: R| if n == 1.0 { v } else if n == -1.0 { -v } else { v * c(n) };
        let mut sum: R = c(s.d);
        for (n, v) in s.n.into_iter().zip([x, y, z]) {
            if n != 0.0 { sum = sum + term(n, v); }
        }
        sum
    };
    /// ±(r − distance from the axis), the axis along a coordinate.
    Cylinder { axis: usize, center: Point3, r: f64, side: f64 } |s, x, y, z| {
        let p = [x, y, z];
        let (i, j) = ((s.axis + 1) % 3, (s.axis + 2) % 3);
        let u = p[i].clone() - c(s.center[i]);
        let v = p[j].clone() - c(s.center[j]);
        (c::<R>(s.r) - (u.square() + v.square()).sqrt()) * c(s.side)
    };
    /// ±(r − distance from the centre).
    Sphere { center: Point3, r: f64, side: f64 } |s, x, y, z| {
        let d = (x - c(s.center[0])).square() + (y - c(s.center[1])).square() + (z - c(s.center[2])).square();
        (c::<R>(s.r) - d.sqrt()) * c(s.side)
    };
    /// k z − √(x² + y²).
    Cone { k: f64 } |s, x, y, z| z * c(s.k) - (x.square() + y.square()).sqrt();
    /// t + side · gyroid of period 1.
    Gyroid { t: f64, side: f64 } |s, x, y, z| {
        let w: R = c(std::f64::consts::TAU);
        let (x, y, z) = (x * w.clone(), y * w.clone(), z * w);
        let g = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
        c::<R>(s.t) + g * c(s.side)
    };
    /// 1 − (x/a)² − (y/b)² − (z/c)².
    Ellipsoid { a: Point3 } |s, x, y, z| {
        c::<R>(1.0) - (x / c(s.a[0])).square() - (y / c(s.a[1])).square() - (z / c(s.a[2])).square()
    };
    /// The polynomial union blend, of width k, of a plane and a cylinder along z or a plane.
    Blend { n: Point3, d: f64, other: Other, k: f64 } |s, x, y, z| {
        let plane = Plane { n: s.n, d: s.d }.eval([x.clone(), y.clone(), z.clone()]);
        let other = match &s.other {
            Other::Plane(o) => o.eval([x, y, z]),
            Other::Cylinder(o) => o.eval([x, y, z]),
        };
        let k = || c::<R>(s.k);
        let h = (k() - (plane.clone() - other.clone()).abs()).max(&c(0.0)) / k();
        plane.max(&other) + h.square() * c(0.25 * s.k)
    };
}

/// Surface with which a plane is blended.
#[derive(Clone, Debug)]
pub(crate) enum Other {
    Plane(Plane),
    Cylinder(Cylinder),
}

/// Formulas joined by a tree.
pub(crate) struct Made {
    pub(crate) formulas: Vec<Box<dyn Formula>>,
    pub(crate) names: Vec<String>,
    pub(crate) tree: Csg,
}

impl Solid for Made {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for (k, i) in which.iter().enumerate() {
            for (p, v) in points.iter().zip(&mut out[k * points.len()..]) {
                *v = self.formulas[*i as usize].real(*p);
            }
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let j = self.formulas[piece as usize]
            .gradient(std::array::from_fn(|i| Jet1::variable(p[i], i)));
        (j.v, j.g)
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        self.formulas[piece as usize].jet(std::array::from_fn(|i| Jet2::variable(p[i], i)))
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        for (i, r) in which.iter().zip(out) {
            *r = self.formulas[*i as usize].interval(std::array::from_fn(|k| {
                Interval::new(region.lo[k], region.hi[k])
            }));
        }
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, v) in points.iter().zip(out) {
            *v = self.tree.value(&|i| self.formulas[i as usize].real(*p));
        }
    }
}

/// A tree under construction.
pub(crate) enum Node {
    Piece(Box<dyn Formula>),
    Min(Vec<Self>),
    Max(Vec<Self>),
}

pub(crate) fn piece(f: impl Formula + 'static) -> Node {
    Node::Piece(Box::new(f))
}

pub(crate) fn made(node: Node) -> Made {
    fn number(node: Node, formulas: &mut Vec<Box<dyn Formula>>) -> Csg {
        match node {
            Node::Piece(f) => {
                formulas.push(f);
                Csg::Piece(formulas.len() as u32 - 1)
            }
            Node::Min(c) => Csg::Min(c.into_iter().map(|c| number(c, formulas)).collect()),
            Node::Max(c) => Csg::Max(c.into_iter().map(|c| number(c, formulas)).collect()),
        }
    }
    let mut formulas = Vec::new();
    let tree = number(node, &mut formulas);
    let names = (0..formulas.len()).map(|i| format!("piece{i}")).collect();
    Made {
        formulas,
        names,
        tree,
    }
}

pub(crate) fn plane(n: Point3, d: f64) -> Plane {
    Plane { n, d }
}

pub(crate) fn planes_of_block(lo: Point3, hi: Point3) -> Vec<Plane> {
    let unit = |i: usize, s: f64| std::array::from_fn(|k| if k == i { s } else { 0.0 });
    (0..3)
        .flat_map(|i| [plane(unit(i, 1.0), -lo[i]), plane(unit(i, -1.0), hi[i])])
        .collect()
}

pub(crate) fn block(lo: Point3, hi: Point3) -> Node {
    Node::Min(planes_of_block(lo, hi).into_iter().map(piece).collect())
}

pub(crate) fn cylinder(axis: usize, center: Point3, r: f64, side: f64) -> Node {
    piece(Cylinder {
        axis,
        center,
        r,
        side,
    })
}

pub(crate) fn part() -> Made {
    made(Node::Min(vec![
        block([-5.0, -4.0, -2.0], [5.0, 1.0, 2.0]),
        cylinder(2, [-2.0, -1.5, 0.0], 1.25, -1.0),
        cylinder(2, [3.0, 0.5, 0.0], 1.5, -1.0),
    ]))
}

pub(crate) fn gyroid() -> Made {
    made(Node::Min(vec![
        block([-0.95; 3], [0.95; 3]),
        piece(Gyroid { t: 0.6, side: -1.0 }),
        piece(Gyroid { t: 0.6, side: 1.0 }),
    ]))
}

/// Plate and boss joined by a blend, minus a hole.
pub(crate) fn blend() -> Made {
    let boss = [
        Other::Cylinder(Cylinder {
            axis: 2,
            center: [0.0; 3],
            r: 1.0,
            side: 1.0,
        }),
        Other::Plane(plane([0.0, 0.0, -1.0], 2.5)),
        Other::Plane(plane([0.0, 0.0, 1.0], 0.0)),
    ];
    let mut all = Vec::new();
    for p in planes_of_block([-3.0, -2.0, -0.5], [3.0, 2.0, 0.5]) {
        for other in &boss {
            all.push(piece(Blend {
                n: p.n,
                d: p.d,
                other: other.clone(),
                k: 0.4,
            }));
        }
    }
    made(Node::Min(vec![
        Node::Min(all),
        cylinder(2, [0.0; 3], 0.5, -1.0),
    ]))
}
