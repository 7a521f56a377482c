//! A union of many primitives that do not touch, the same for every program.
//!
//! One primitive lies in each unit cube of a cubic lattice, beside the middle. Numbers are
//! multiples of 2⁻¹⁰, which single precision holds exactly.

use isoform::num::Random;
use std::fmt::Write;

/// What is in each cube.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A ball: r − |p − c|.
    Ball,
    /// A block with a ball cut out of its middle that opens all faces.
    Block,
}

impl Kind {
    /// The kind of this name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "balls" => Some(Self::Ball),
            "blocks" => Some(Self::Block),
            _ => None,
        }
    }
}

/// A primitive.
pub struct Primitive {
    pub center: [f64; 3],
    pub radius: f64,
    /// Half edges of a block.
    pub half: [f64; 3],
}

/// The union of the first `n` primitives of a lattice.
pub struct Union {
    pub kind: Kind,
    pub primitives: Vec<Primitive>,
    /// Cubes along each edge of the box \[0, side\]³ that holds all primitives.
    pub side: usize,
}

/// The nearest multiple of 2⁻¹⁰.
fn short(v: f64) -> f64 {
    (v * 1024.0).round() / 1024.0
}

impl Union {
    /// A union of `n` primitives.
    pub fn new(kind: Kind, n: usize) -> Self {
        let side = (1..).find(|s: &usize| s.pow(3) >= n).expect("a cube");
        let mut random = Random::new(23);
        let primitives = (0..n).map(|i| {
            let cube = [i % side, i / side % side, i / (side * side)];
            let center = cube.map(|k| short(k as f64 + 0.4 + 0.2 * random.unit()));
            let half = [(); 3].map(|()| short(0.24 + 0.04 * random.unit()));
            let radius = short(0.29 + 0.01 * random.unit());
            Primitive {
                center,
                radius,
                half,
            }
        });
        Self {
            kind,
            primitives: primitives.collect(),
            side,
        }
    }

    /// The union as a HyperFun program, one statement for each primitive.
    pub fn program(&self) -> String {
        let mut text = "my_model(x[3], a[1]) {\n".to_owned();
        for (i, one) in self.primitives.iter().enumerate() {
            let Primitive {
                center: [x, y, z],
                radius: r,
                half: [u, v, w],
            } = one;
            let away = format!("sqrt((x[1] - {x})^2 + (x[2] - {y})^2 + (x[3] - {z})^2)");
            let value = match self.kind {
                Kind::Ball => format!("{r} - {away}"),
                Kind::Block => format!(
                    "min(min({u} - abs(x[1] - {x}), min({v} - abs(x[2] - {y}), \
                     {w} - abs(x[3] - {z}))), {away} - {r})"
                ),
            };
            let all = if i == 0 {
                value
            } else {
                format!("max(t, {value})")
            };
            writeln!(text, "  t = {all};").expect("text grows");
        }
        text + "  my_model = t;\n}\n"
    }

    /// `n` random points of the box.
    pub fn random_points(&self, n: usize) -> Vec<[f64; 3]> {
        let mut random = Random::new(5);
        let coordinate = |_| short(random.unit() * self.side as f64);
        let all: Vec<f64> = (0..3 * n).map(coordinate).collect();
        all.as_chunks().0.to_vec()
    }

    /// The points of a dense grid, `per_edge` along each edge, of the cube of one primitive, and
    /// the cube's lower corner.
    pub fn cell(&self, primitive: usize, per_edge: usize) -> ([f64; 3], Vec<[f64; 3]>) {
        let low = self.primitives[primitive].center.map(f64::floor);
        let at = |i: usize, k: usize| low[i] + short((k as f64 + 0.5) / per_edge as f64);
        let point = |k: usize| {
            [
                at(0, k % per_edge),
                at(1, k / per_edge % per_edge),
                at(2, k / per_edge.pow(2)),
            ]
        };
        (low, (0..per_edge.pow(3)).map(point).collect())
    }
}
