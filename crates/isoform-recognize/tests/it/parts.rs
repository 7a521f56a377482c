//! Points on plates: a polygon or a disk with round holes, of some thickness.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, cross};
use isoform_num::Random;
use isoform_recognize::{Options, Recognition, recognize};
use std::f64::consts::TAU;

/// A plate in the plane of x and y.
#[derive(Clone)]
pub(crate) struct Plate {
    /// Corners, anticlockwise; empty for a disk.
    pub(crate) outline: Vec<[f64; 2]>,
    /// Radius of a disk.
    pub(crate) radius: f64,
    /// Centre and radius of holes.
    pub(crate) holes: Vec<[f64; 3]>,
    pub(crate) thickness: f64,
}

impl Plate {
    pub(crate) fn rectangle(a: f64, b: f64) -> Self {
        Self::of(vec![[0.0, 0.0], [a, 0.0], [a, b], [0.0, b]])
    }

    pub(crate) fn of(outline: Vec<[f64; 2]>) -> Self {
        Self {
            outline,
            radius: 0.0,
            holes: Vec::new(),
            thickness: 0.25,
        }
    }

    pub(crate) fn disk(radius: f64) -> Self {
        Self {
            radius,
            ..Self::of(Vec::new())
        }
    }

    pub(crate) fn with(mut self, holes: impl IntoIterator<Item = [f64; 3]>) -> Self {
        self.holes.extend(holes);
        self
    }

    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let in_hole = |h: &[f64; 3]| (x - h[0]).hypot(y - h[1]) < h[2];
        if self.holes.iter().any(in_hole) {
            return false;
        }
        if self.outline.is_empty() {
            return x.hypot(y) < self.radius;
        }
        let n = self.outline.len();
        let passes = |k: &usize| {
            let ([a, b], [c, d]) = (self.outline[*k], self.outline[(k + 1) % n]);
            (b > y) != (d > y) && x < a + (y - b) / (d - b) * (c - a)
        };
        (0..n).filter(passes).count() % 2 == 1
    }

    /// Returns random points with their normals, `density` of them per unit of area.
    fn points(&self, density: f64, random: &mut Random) -> Vec<[Point3; 2]> {
        let mut all = Vec::new();
        let reach = self.outline.iter().flatten();
        let reach = reach.fold(self.radius, |m, x| m.max(x.abs()));
        for z in [0.0, self.thickness] {
            let normal = [0.0, 0.0, if z > 0.0 { 1.0 } else { -1.0 }];
            for _ in 0..(4.0 * reach * reach * density) as usize {
                let p = [(); 2].map(|()| reach * random.symmetric());
                if self.holds(p) {
                    all.push([[p[0], p[1], z], normal]);
                }
            }
        }
        let rim = (self.radius > 0.0).then_some([0.0, 0.0, self.radius]);
        let walls = self.holes.iter().map(|h| (*h, -1.0));
        for ([x, y, r], side) in walls.chain(rim.map(|r| (r, 1.0))) {
            for _ in 0..(TAU * r * self.thickness * density) as usize {
                let (sin, cos) = (TAU * random.unit()).sin_cos();
                let p = [x + r * cos, y + r * sin, self.thickness * random.unit()];
                all.push([p, [side * cos, side * sin, 0.0]]);
            }
        }
        let n = self.outline.len();
        for k in 0..n {
            let ([a, b], [c, d]) = (self.outline[k], self.outline[(k + 1) % n]);
            let length = (c - a).hypot(d - b);
            for _ in 0..(length * self.thickness * density) as usize {
                let t = random.unit();
                let p = [
                    a + t * (c - a),
                    b + t * (d - b),
                    self.thickness * random.unit(),
                ];
                all.push([p, [(d - b) / length, (a - c) / length, 0.0]]);
            }
        }
        all
    }

    /// Returns the recognition of points with noise, as a share of the diagonal, in a pose of the
    /// seed.
    pub(crate) fn recognised(&self, noise: f64, seed: u64) -> Recognition {
        recognised(&self.scan(noise, seed))
    }

    /// Returns the points in a pose of the seed.
    pub(crate) fn scan(&self, noise: f64, seed: u64) -> Vec<Point3> {
        let mut random = Random::new(seed);
        let all = self.points(900.0, &mut random);
        let bounds = isoform_geom::Aabb::from_points(all.iter().map(|p| &p[0]));
        let sigma = noise * bounds.diagonal();
        let pose = Pose::at_random(&mut random);
        let noisy = |[p, n]: &[Point3; 2]| {
            let normal = (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
            pose.apply(std::array::from_fn(|k| p[k] + sigma * normal * n[k]))
        };
        all.iter().map(noisy).collect()
    }
}

pub(crate) fn recognised(points: &[Point3]) -> Recognition {
    let scan = PointCloud::from_points(points.to_vec());
    recognize(&scan, &Options::default(), &Control::default()).expect("a scan")
}

pub(crate) struct Pose {
    axis: Point3,
    angle: f64,
    shift: Point3,
}

impl Pose {
    pub(crate) fn at_random(random: &mut Random) -> Self {
        let axis: Point3 = [(); 3].map(|()| random.symmetric());
        let length = isoform_geom::norm(axis);
        Self {
            axis: axis.map(|x| x / length),
            angle: TAU * random.unit(),
            shift: [(); 3].map(|()| 5.0 * random.symmetric()),
        }
    }

    pub(crate) fn apply(&self, p: Point3) -> Point3 {
        let (sin, cos) = self.angle.sin_cos();
        let (along, across) = (isoform_geom::dot(p, self.axis), cross(self.axis, p));
        std::array::from_fn(|k| {
            cos * p[k] + sin * across[k] + (1.0 - cos) * along * self.axis[k] + self.shift[k]
        })
    }
}

/// Returns `n` places on a circle.
pub(crate) fn circle(n: usize, radius: f64, start: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..n).map(move |k| {
        let (sin, cos) = (start + TAU * k as f64 / n as f64).sin_cos();
        [radius * cos, radius * sin]
    })
}
