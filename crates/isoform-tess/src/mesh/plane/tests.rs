//! The triangulation by itself, on a surface in closed form: the paraboloid z = u² + v².

use super::*;
use crate::mesh::geometry::distance;
use crate::mesh::matching::InsertionPlace;
use crate::mesh::names::ImageId;
use isoform_control::Control;
use isoform_geom::{cross, dot, sub};
use std::collections::BTreeSet;

struct Paraboloid {
    tolerance: f64,
    longest: f64,
    /// Place of a pole: no triangle that contains it is proved to be sound.
    pole: Option<[f64; 2]>,
}

impl Paraboloid {
    fn new(tolerance: f64, longest: f64) -> Self {
        Self {
            tolerance,
            longest,
            pole: None,
        }
    }
}

fn value([u, v]: [f64; 2]) -> Point3 {
    [u, v, u * u + v * v]
}

impl Measure for Paraboloid {
    fn image(&self, node: &Node) -> Point3 {
        value(node.at)
    }
    fn shared(&self, _: &Node) -> Option<Shared> {
        None
    }
    fn at(&self, at: [f64; 2]) -> Point3 {
        value(at)
    }
    fn beside_chord(&self, _: [[f64; 2]; 2], _: ImageId) -> Option<[f64; 2]> {
        None
    }
    fn turns(&self, _: [[f64; 2]; 3]) -> bool {
        false
    }
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        let [x, y] = self.tangents(at);
        let off = sub(to, value(at));
        let (e, f, g) = (dot(x, x), dot(x, y), dot(y, y));
        let (p, q) = (dot(x, off), dot(y, off));
        let det = e * g - f * f;
        Some([(g * p - f * q) / det, (e * q - f * p) / det])
    }
    fn tangents(&self, [u, v]: [f64; 2]) -> [Point3; 2] {
        [[1.0, 0.0, 2.0 * u], [0.0, 1.0, 2.0 * v]]
    }
    fn is_sound(&self, [a, b, c]: [[f64; 2]; 3]) -> bool {
        let is_left = |a: [f64; 2], b: [f64; 2], p: [f64; 2]| {
            (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) >= 0.0
        };
        let holds = |p| is_left(a, b, p) && is_left(b, c, p) && is_left(c, a, p);
        !self.pole.is_some_and(holds)
    }
    fn tolerance(&self, _: Point3) -> f64 {
        self.tolerance
    }
    fn longest(&self) -> f64 {
        self.longest
    }
}

/// Returns the square [0, 1]² as n × n squares, each divided in two; the edges of its border may be
/// split.
fn square(n: u32, measure: &Paraboloid) -> Plane {
    let step = 1.0 / f64::from(n);
    let at = |k: u32| [k % (n + 1), k / (n + 1)].map(|i| f64::from(i) * step);
    let nodes = (0..(n + 1) * (n + 1)).map(|k| Node::inner(at(k), 0));
    let cell = |k: u32| {
        let a = k % n + (n + 1) * (k / n);
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    let triangles = (0..n * n).flat_map(cell).collect();
    let (last, up) = (n * (n + 1), n + 1);
    let rim = |k: u32| {
        let (i, j) = (k * up, k * up + n);
        [
            [k, k + 1],
            [last + k, last + k + 1],
            [i, i + up],
            [j, j + up],
        ]
    };
    let rim: Vec<[u32; 2]> = (0..n).flat_map(rim).collect();
    Plane::new(nodes.collect(), triangles, &|_, _| false, &rim, measure)
}

/// Returns the square [0, 1]² as a fan of thin triangles about its centre, with n edges on each
/// side: the form in which a region is drawn, with a border that is fine enough, and nothing
/// inside.
fn fan(n: u32, measure: &Paraboloid) -> Plane {
    let place = |k: u32| {
        let x = f64::from(k % n) / f64::from(n);
        [[x, 0.0], [1.0, x], [1.0 - x, 1.0], [0.0, 1.0 - x]][(k / n) as usize]
    };
    let places = (0..4 * n).map(place).chain([[0.5, 0.5]]);
    let nodes = places.map(|at| Node::inner(at, 0)).collect();
    let triangles = (0..4 * n).map(|k| [4 * n, k, (k + 1) % (4 * n)]).collect();
    Plane::new(nodes, triangles, &|_, _| false, &[], measure)
}

/// Returns twice the area of all triangles in the parameters.
fn area(plane: &Plane) -> f64 {
    let twice = |t: u32| {
        let [a, b, c] = plane.corners(t);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    (0..plane.triangles.len() as u32).map(twice).sum()
}
/// Returns the Euler characteristic V − E + F.
fn euler(plane: &Plane) -> i64 {
    let ends = |t: u32| [0, 1, 2].map(|i| plane.ends(t, i));
    let all = (0..plane.triangles.len() as u32).flat_map(ends);
    let edges: BTreeSet<[u32; 2]> = all.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    let vertices: BTreeSet<u32> = plane.triangles.iter().flatten().copied().collect();
    vertices.len() as i64 - edges.len() as i64 + plane.triangles.len() as i64
}
/// Asserts that a triangulation is a disc that covers the square once.
fn is_square(plane: &Plane) {
    assert_eq!(plane.fault(), None);
    assert_eq!(euler(plane), 1);
    assert!((area(plane) - 2.0).abs() < 1e-12, "{}", area(plane));
}

/// An edge from (u, v) to (u + p, v + q) is (p² + q²) / 4 above the surface in the middle, along z,
/// wherever it is; the distance is at most √(1 + 4 · 2) = 3 times shorter.
#[test]
fn edges_inside_come_near_the_surface() {
    for (tolerance, n) in [(1e-2, 8), (1e-3, 32)] {
        let measure = Paraboloid::new(tolerance, 10.0);
        let mut plane = fan(n, &measure);
        is_square(&plane);
        plane.begin(100_000, &measure, &Control::default());
        let ended = plane.refine(100_000, &measure, &Control::default());
        assert_eq!(ended, RefinementDefects::default());
        is_square(&plane);
        for t in 0..plane.triangles.len() as u32 {
            for i in (0..3).filter(|&i| !plane.fixed[t as usize][i]) {
                let above = plane.length(t, i).powi(2) / 4.0;
                assert!(above < 3.0 * tolerance, "{above}");
            }
        }
    }
}

/// Edges inside do not exceed the maximum length.
#[test]
fn edges_inside_are_no_longer_than_allowed() {
    let measure = Paraboloid::new(1.0, 0.3);
    let mut plane = fan(8, &measure);
    plane.begin(100_000, &measure, &Control::default());
    let ended = plane.refine(100_000, &measure, &Control::default());
    assert_eq!(ended, RefinementDefects::default());
    is_square(&plane);
    for t in 0..plane.triangles.len() as u32 {
        for i in (0..3).filter(|&i| !plane.fixed[t as usize][i]) {
            let [p, q] = plane.ends(t, i).map(|v| plane.images[v as usize]);
            assert!(distance(p, q) <= 0.3, "{}", distance(p, q));
        }
    }
}

/// Triangles with a pole are split in vain: the result says so, and the limit on triangles is kept.
#[test]
fn a_pole_is_never_missed() {
    let mut measure = Paraboloid::new(1.0, 10.0);
    measure.pole = Some([0.37, 0.41]);
    let mut plane = square(2, &measure);
    plane.begin(200, &measure, &Control::default());
    let ended = plane.refine(200, &measure, &Control::default());
    assert!(ended.unsound > 0 && plane.triangles.len() <= 200);
    is_square(&plane);
}

/// Every operation by itself leaves a triangulation of the square.
#[test]
fn operations_keep_the_square() {
    let measure = Paraboloid::new(0.1, 10.0);
    let mut plane = square(4, &measure);
    is_square(&plane);
    let free = |plane: &Plane, t: u32| (0..3).find(|&i| !plane.fixed[t as usize][i]);
    for t in [3, 11, 20] {
        let i = free(&plane, t).expect("an inner edge");
        assert!(plane.split_edge(t, i, &measure));
        is_square(&plane);
        assert!(plane.split_triangle(t, &measure));
        is_square(&plane);
    }
    let before = plane.triangles.len();
    plane.legalise_all(&measure);
    is_square(&plane);
    assert_eq!(plane.triangles.len(), before);
    plane.smooth(&measure);
    is_square(&plane);
    let gone = plane.coarsen(&measure);
    is_square(&plane);
    assert_eq!(plane.triangles.len(), before - 2 * gone);
}

/// Splits on the rim are recorded as the path between the ends of the edge.
#[test]
fn the_rim_may_be_split() {
    let measure = Paraboloid::new(0.1, 10.0);
    let mut plane = square(1, &measure);
    let first = (0..3).find(|&i| plane.ends(0, i) == [0, 1]);
    assert!(plane.split_rim(0, first.expect("an edge"), &measure));
    is_square(&plane);
    assert_eq!(plane.way([0, 1]), [4]);
    let again = (0..3)
        .flat_map(|t| (0..3).map(move |i| (t, i)))
        .find(|&(t, i)| plane.ends(t, i) == [0, 4])
        .expect("half of it");
    assert!(plane.split_rim(again.0, again.1, &measure));
    is_square(&plane);
    assert_eq!([plane.way([0, 1]), plane.way([1, 0])], [[5, 4], [4, 5]]);
    assert_eq!(plane.nodes[5].at, [0.25, 0.0]);
}

/// Places become vertices, unless one is near them; the triangles around them are Delaunay
/// triangles in space.
#[test]
fn places_become_vertices() {
    let measure = Paraboloid::new(0.5, 10.0);
    let mut plane = square(2, &measure);
    let place = |at: [f64; 2]| InsertionPlace {
        quadrant: 0,
        at,
        faces: 0,
    };
    let places = [[0.3, 0.2], [0.7, 0.6], [0.5 + 1e-6, 0.5 - 2e-6], [2.0, 2.0]].map(place);
    let ended = plane.insert(&places, 1000, &measure, &Control::default());
    assert_eq!(ended, RefinementDefects::default());
    is_square(&plane);
    let is_there = |p: &InsertionPlace| plane.nodes.iter().any(|n| n.at == p.at);
    assert_eq!(places.each_ref().map(is_there), [true, true, false, false]);
    let t = plane
        .triangles
        .iter()
        .find(|t| {
            t.iter()
                .any(|&v| plane.nodes[v as usize].at == places[0].at)
        })
        .expect("a triangle there");
    let [p, q, r] = t.map(|v| plane.images[v as usize]);
    let normal = cross(sub(q, p), sub(r, p));
    assert!(normal[2] > 0.0);
}

/// Defects of a triangulation are found.
#[test]
fn faults_are_found() {
    let measure = Paraboloid::new(0.1, 10.0);
    let spoilt = |spoil: &dyn Fn(&mut Plane)| {
        let mut plane = square(2, &measure);
        spoil(&mut plane);
        plane.fault().is_some()
    };
    assert!(!spoilt(&|_| {}));
    assert!(spoilt(&|p| p.adjacent[0].swap(0, 1)));
    assert!(spoilt(&|p| p.triangles[3].swap(0, 1)));
    assert!(spoilt(&|p| p.fixed[0] = p.fixed[0].map(|f| !f)));
    assert!(spoilt(&|p| p.nodes[4].at = [3.0, 3.0]));
    assert!(spoilt(&|p| p.sound.truncate(1)));
}

/// A paraboloid that reports one image for the border of a square.
struct OneImage(Paraboloid);

impl Measure for OneImage {
    fn image(&self, node: &Node) -> Point3 {
        self.0.image(node)
    }
    fn shared(&self, node: &Node) -> Option<Shared> {
        let [u, v] = node.at;
        let is_border = [u, v].iter().any(|x| *x == 0.0 || *x == 1.0);
        is_border.then_some(Shared::Contracted(ImageId(0)))
    }
    fn at(&self, at: [f64; 2]) -> Point3 {
        self.0.at(at)
    }
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: ImageId) -> Option<[f64; 2]> {
        self.0.beside_chord(chord, image)
    }
    fn turns(&self, at: [[f64; 2]; 3]) -> bool {
        self.0.turns(at)
    }
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        self.0.step(at, to)
    }
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2] {
        self.0.tangents(at)
    }
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool {
        self.0.is_sound(at)
    }
    fn tolerance(&self, near: Point3) -> f64 {
        self.0.tolerance(near)
    }
    fn longest(&self) -> f64 {
        self.0.longest()
    }
}

/// For a vertex with 1600 neighbours that have one image, the test for adjacency takes time
/// proportional to the fourth power of their number. Without time the search ends at once and says
/// so.
#[test]
fn a_search_for_edges_that_fall_together_can_be_stopped() {
    let flag = std::sync::atomic::AtomicBool::new(true);
    let stopped = Control {
        cancelled: Some(&flag),
        ..Control::default()
    };
    let measure = OneImage(Paraboloid::new(10.0, 10.0));
    let fan_of = |n: u32| {
        let plane = fan(n, &measure.0);
        Plane {
            shared: plane.nodes.iter().map(|n| measure.shared(n)).collect(),
            ..plane
        }
    };
    let clock = std::time::Instant::now();
    let ended = fan_of(400).tell_apart(100_000, &measure, &stopped);
    assert!(ended.is_stopped);
    assert!(clock.elapsed().as_secs_f64() < 0.2, "{:?}", clock.elapsed());
    // The chain of neighbours joins all of them.
    let ended = fan_of(8).tell_apart(100_000, &measure, &Control::default());
    assert_eq!(ended, RefinementDefects::default());
}
