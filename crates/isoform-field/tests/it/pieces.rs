//! Models as solids: their pieces and names, and the agreement of the pieces with the model.

use isoform_field::hyperfun::{Mode, Model};
use isoform_field::{Pieces, RunField, SolidError};
use isoform_geom::{Aabb, Csg, Field, OnePiece, Point3, Solid, norm, sub};
use isoform_num::Interval;

const PART: &str = "my_model(x[3], a[1])
{
  array corner[3], c1[3], c2[3];
  corner = [-5, -4, -2];
  c1 = [-2, -1.5, 0];
  c2 = [3, 0.5, 0];
  box = hfBlock(x, corner, 10, 5, 4);
  my_model = (box \\ hfCylinderZ(x, c1, 1.25)) \\ hfCylinderZ(x, c2, 1.5);
}";

const BLEND: &str = "my_model(x[3], a[1])
{
  k = 0.4;
  r = sqrt(x[1]*x[1] + x[2]*x[2]);
  plate = min(min(3 - abs(x[1]), 2 - abs(x[2])), 0.5 - abs(x[3]));
  boss = min(1 - r, min(2.5 - x[3], x[3]));
  h = max(k - abs(plate - boss), 0) / k;
  joined = max(plate, boss) + h*h*k/4;
  my_model = min(joined, r - 0.5);
}";

const GYROID: &str = "my_model(x[3], a[1])
{
  w = 6.283185307179586;
  g = sin(w*x[1])*cos(w*x[2]) + sin(w*x[2])*cos(w*x[3]) + sin(w*x[3])*cos(w*x[1]);
  cube = 0.95 - max(max(abs(x[1]), abs(x[2])), abs(x[3]));
  my_model = min(cube, (0.6 - abs(g)) / (1.5*w));
}";

/// R-functions, rotated and shifted leaves, slabs, and one half of a double cone.
const TREE: &str = "my_model(x[3], a[1])
{
  array o[3], q1[3], q2[3], q4[3], v4[3];
  o = [0, 0, 0];
  q1[1] = x[1]; q1[2] = x[2]; q1[3] = x[3];
  m = hfShift3D(q1, 0.964, 0.891, (-0.096));
  f1 = (hfConeZ(q1, o, 0.788)) & ((q1[3] - 0.658) & (1.818 - q1[3]));
  q2[1] = (-0.985821888966373)*(x[1] - 1.842) + (-0.16779512279792932)*(x[3] - 1.371);
  q2[2] = 1.0*(x[2] - 1.258);
  q2[3] = 0.16779512279792932*(x[1] - 1.842) + (-0.985821888966373)*(x[3] - 1.371);
  f2 = (hfCylinderZ(q2, o, 0.604)) & (1.1675 - abs(q2[3]));
  f3 = (f1 | f2);
  q4[1] = 1.0*(x[1] - 2.839); q4[2] = 1.0*(x[2] - 1.344); q4[3] = 1.0*(x[3] - 0.953);
  v4 = [-0.865, -0.7875, -0.58];
  f4 = hfBlock(q4, v4, 1.73, 1.575, 1.16);
  f5 = min(f3, 0 - f4);
  f6 = 0.559*hfEllipsoid(q4, o, 0.4, 1.2, 0.5);
  my_model = max(f5, f6);
}";

/// Blends of blends, of shapes with many sides.
const BLENDS: &str = "my_model(x[3], a[1])
{
  array o[3], q1[3], q2[3], q3[3];
  o = [0, 0, 0];
  q1[1] = x[1] + 0.2; q1[2] = x[2]; q1[3] = x[3];
  m = hfRotate3DZ(q1, 0.4);
  block = min(min(1.7 - abs(q1[1]), 1.2 - abs(q1[2])), 0.6 - abs(q1[3]));
  q2[1] = x[1] - 1; q2[2] = x[2]; q2[3] = x[3] - 0.5;
  pin = min(0.5 - sqrt(q2[1]*q2[1] + q2[2]*q2[2]), 1.4 - abs(q2[3]));
  f1 = hfDBlendUni(block, pin, 0.3);
  q3[1] = x[1] + 0.7; q3[2] = x[2] - 0.3; q3[3] = x[3] - 0.4;
  ring = hfDTorusZ(q3, o, 0.9, 0.3);
  f2 = hfDBlendInt(f1, 0.8 - ring, 0.25);
  my_model = max(f2, min(0.3*hfEllipsoid(x, o, 0.6, 0.9, 2.2), 1.8 - x[3]));
}";

/// Other notations of functions without kinks: a weight between 0 and 1, a selection, the root of a
/// square, exponentials.
const SMOOTHS: &str = "my_model(x[3], a[1])
{
  a1 = min(1 - abs(x[1]), min(1 - abs(x[2]), 1 - abs(x[3])));
  b1 = min(0.5 - sqrt(x[1]^2 + x[2]^2), 1.7 - abs(x[3]));
  t = max(0, min(1, 0.5 + 0.5*(b1 - a1)/0.3));
  mixed = a1*(1 - t) + b1*t + 0.3*t*(1 - t);
  c1 = min(0.4 - sqrt(x[2]^2 + x[3]^2), 1.6 - abs(x[1]));
  rooted = 0.5*(mixed + c1 + sqrt((mixed - c1)^2 + 0.04));
  d1 = min(0.3 - sqrt(x[1]^2 + x[3]^2), 1.5 - abs(x[2]));
  my_model = log(exp(8*rooted) + exp(8*d1))/8 - 0.01;
}";

fn pieces(text: &str) -> Pieces {
    let model = Model::parse(text, Mode::Default).expect("a program");
    Pieces::of_model(&model, &vec![0.0; model.n_params()]).expect("an expression")
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn point(&mut self, reach: f64) -> Point3 {
        std::array::from_fn(|_| reach * (2.0 * self.next() - 1.0))
    }
}

fn between(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
}

fn own(solid: &Pieces, p: Point3) -> f64 {
    let mut out = [0.0];
    solid.sign_values(&[p], &mut out);
    out[0]
}

/// Returns the largest jump of a piece's gradient between p and q, located by bisection towards the
/// larger change.
fn jump(solid: &Pieces, piece: u32, mut p: Point3, mut q: Point3) -> (f64, Point3) {
    let gradient = |p| solid.gradient(piece, p).1;
    for _ in 0..26 {
        let m = between(p, q);
        let g = gradient(m);
        if norm(sub(g, gradient(p))) > norm(sub(g, gradient(q))) {
            q = m;
        } else {
            p = m;
        }
    }
    (norm(sub(gradient(p), gradient(q))), p)
}

/// Checks that the tree has the model's sign, and that on the surface the deciding piece vanishes,
/// with a gradient that is continuous and not 0.
fn check(text: &str, reach: f64) -> Pieces {
    let solid = pieces(text);
    let which: Vec<u32> = (0..solid.names().len() as u32).collect();
    let mut random = Random(88_172_645_463_325_252);
    let points: Vec<Point3> = (0..10_000).map(|_| random.point(reach)).collect();
    let n = points.len();
    let (mut f, mut g) = (vec![0.0; n], vec![0.0; n * which.len()]);
    solid.sign_values(&points, &mut f);
    solid.values(&which, &points, &mut g);
    let mut on_surface = 0;
    for i in 0..n {
        let tree = solid.tree().value(&|k| g[k as usize * n + i]);
        assert!(
            (tree >= 0.0) == (f[i] >= 0.0),
            "{:?}: {} of the model, {tree} of the tree",
            points[i],
            f[i]
        );
        if i == 0 || (f[i] >= 0.0) == (f[i - 1] >= 0.0) {
            continue;
        }
        on_surface += 1;
        let (mut p, mut q) = (points[i - 1], points[i]);
        for _ in 0..60 {
            let m = between(p, q);
            *(if (own(&solid, m) >= 0.0) == (f[i - 1] >= 0.0) {
                &mut p
            } else {
                &mut q
            }) = m;
        }
        let (value, piece) = solid.tree().value_and_piece(&|k| solid.gradient(k, p).0);
        let slope = norm(solid.gradient(piece, p).1);
        let name = &solid.names()[piece as usize];
        assert!(slope > 1e-3, "{name} is flat at {p:?}");
        assert!(
            value.abs() < 1e-12 * slope.max(1.0),
            "{name} is {value} at {p:?}"
        );
        for _ in 0..4 {
            let step = random.point(0.05);
            let (jump, at) = jump(&solid, piece, p, std::array::from_fn(|k| p[k] + step[k]));
            let (value, _) = solid.gradient(piece, at);
            assert!(
                jump < 1e-4 * slope.max(1.0) || value.abs() > 0.02 * slope,
                "{name} jumps by {jump} at {at:?}"
            );
        }
    }
    assert!(on_surface > 20, "{on_surface} points of the surface");
    check_evaluators(&solid, reach);
    solid
}

/// Checks that pointwise evaluation, blocks, jets and ranges agree.
fn check_evaluators(solid: &Pieces, reach: f64) {
    let mut random = Random(3);
    let points: Vec<Point3> = (0..70).map(|_| random.point(reach)).collect();
    let which: Vec<u32> = (0..solid.names().len() as u32).rev().collect();
    let mut all = vec![0.0; which.len() * points.len()];
    solid.values(&which, &points, &mut all);
    for (row, &piece) in which.iter().enumerate() {
        for (i, &p) in points.iter().enumerate() {
            let value = all[row * points.len() + i];
            let mut one = [0.0];
            solid.values(&[piece], &[p], &mut one);
            let (v, g) = solid.gradient(piece, p);
            let jet = solid.jet(piece, p);
            assert!(
                (value - one[0]).abs() <= 1e-12 * (1.0 + value.abs()),
                "{} at {p:?}: {value}, {}",
                solid.names()[piece as usize],
                one[0]
            );
            assert!(
                (value - v).abs() <= 1e-12 * (1.0 + v.abs()) && (v, g) == (jet.v, jet.g),
                "{} at {p:?}",
                solid.names()[piece as usize]
            );
            let region = Aabb {
                lo: p,
                hi: p.map(|x| x + 0.3),
            };
            let mut range = [Interval::ALL];
            solid.bounds(&[piece], region, &mut range);
            for _ in 0..8 {
                let q = std::array::from_fn(|k| p[k] + 0.3 * random.next());
                let (v, _) = solid.gradient(piece, q);
                assert!(
                    range[0].contains(v),
                    "{} at {q:?}: {v} not in {:?}",
                    solid.names()[piece as usize],
                    range[0]
                );
            }
        }
    }
}

#[test]
fn the_part_has_six_faces_and_two_holes() {
    let solid = check(PART, 6.0);
    assert_eq!(
        solid.names(),
        [
            "box.x_min",
            "box.x_max",
            "box.y_min",
            "box.y_max",
            "box.z_min",
            "box.z_max",
            "c1",
            "c2"
        ]
    );
    assert_eq!(*solid.tree(), Csg::Min((0..8).map(Csg::Piece).collect()));
    // The closed forms: distances.
    assert_eq!(solid.gradient(1, [4.0, 0.0, 0.0]), (1.0, [-1.0, 0.0, 0.0]));
    let (d, g) = solid.gradient(6, [-0.5, -1.5, 7.0]);
    assert!(
        (d - 0.25).abs() < 1e-15 && g == [1.0, 0.0, 0.0],
        "{d} {g:?}"
    );
}

#[test]
fn the_gyroid_has_six_faces_and_two_walls() {
    let solid = check(GYROID, 1.1);
    let names = [
        "cube.x_max",
        "cube.x_min",
        "cube.y_max",
        "cube.y_min",
        "cube.z_max",
        "cube.z_min",
        "g+",
        "g-",
    ];
    assert_eq!(solid.names(), names);
    assert_eq!(*solid.tree(), Csg::Min((0..8).map(Csg::Piece).collect()));
}

#[test]
fn a_smooth_maximum_is_a_piece_for_each_pair_of_sides() {
    let solid = check(BLEND, 4.0);
    // Six sides of the plate by three of the boss, and the hole.
    assert_eq!(solid.names().len(), 19);
    assert_eq!(solid.names()[0], "plate.x_max+boss");
    assert_eq!(solid.names()[13], "plate.z_max+boss.z_max");
    assert_eq!(solid.names()[18], "r");
    assert_eq!(*solid.tree(), Csg::Min((0..19).map(Csg::Piece).collect()));
    // Inside the blend, plate = 0 and boss = 0 give k/4.
    let side = 12;
    assert_eq!(solid.names()[side], "plate.z_max+boss");
    let (v, g) = solid.gradient(side as u32, [1.0, 0.0, 0.5]);
    assert!(
        (v - 0.1).abs() < 1e-15 && (g[0] + 0.5).abs() < 1e-15 && (g[2] + 0.5).abs() < 1e-15,
        "{v} {g:?}"
    );
}

#[test]
fn ranges_of_blends_are_tight() {
    // A blend increases in both arguments: its range extends between its values at the ends of
    // theirs.
    let text = "my_model(x[3], a[1]) { my_model = hfDBlendUni(1 - x[1], 1 - x[2], 0.5); }";
    let solid = pieces(text);
    let mut range = [Interval::ALL];
    solid.bounds(
        &[0],
        Aabb {
            lo: [0.0; 3],
            hi: [2.0; 3],
        },
        &mut range,
    );
    let (least, most) = (solid.gradient(0, [2.0; 3]).0, solid.gradient(0, [0.0; 3]).0);
    assert!(
        (range[0].lo() - least).abs() < 1e-12 && (range[0].hi() - most).abs() < 1e-12,
        "{:?}",
        range[0]
    );
}

#[test]
fn trees_of_r_functions_and_turned_leaves() {
    let solid = check(TREE, 4.0);
    assert_eq!(solid.names().len(), 4 + 3 + 6 + 1, "{:?}", solid.names());
}

#[test]
fn blends_of_blends() {
    let solid = check(BLENDS, 3.0);
    // Six sides by three, with the outside of the ring; the ellipsoid and the plane.
    assert_eq!(solid.names().len(), 20, "{:?}", solid.names());
    assert_eq!(solid.names()[18..], ["o", "z_max"]);
}

#[test]
fn smooth_formulas_of_many_kinds() {
    let solid = check(SMOOTHS, 2.0);
    // 6 sides by 3 by 3 by 3.
    assert_eq!(solid.names().len(), 162);
}

#[test]
fn formulas_without_kinks_of_their_own_stay_one_piece() {
    // A rounded box by its distance: the kinks of |x| and max cancel.
    let rounded = "my_model(x[3], a[1]) { u = max(abs(x[1]) - 1, 0); v = max(abs(x[2]) - 1, 0); w = max(abs(x[3]) - 1, 0);
        my_model = 0.4 - sqrt(u*u + v*v + w*w); }";
    assert_eq!(check(rounded, 2.0).names().len(), 1);
    // A superellipsoid: the two sides of its |u| join smoothly, and a cut there would be a seam.
    let round = "my_model(x[3], a[1]) { array o[3]; o = [0, 0, 0]; my_model = hfSuperell(x, o, 1, 1.5, 2, 0.7, 0.6) & (0.5 - x[3]); }";
    assert_eq!(check(round, 2.5).names(), ["o", "z_max"]);
    // A selection with a smooth transition: a cylinder with a dome.
    let dome = "my_model(x[3], a[1]) { r2 = x[1]^2 + x[2]^2; if x[3] > 0 then f = 1 - r2 - x[3]^2; else f = 1 - r2; endif;
        my_model = min(f, x[3] + 1); }";
    assert_eq!(check(dome, 2.0).names(), ["f", "z_min"]);
    // A selection with a kink, which is a minimum.
    let choice = "my_model(x[3], a[1]) { if x[1] < x[2] then f = x[1]; else f = x[2]; endif; my_model = f; }";
    assert_eq!(check(choice, 2.0).names(), ["x_min", "y_min"]);
}

#[test]
fn factors_and_monotone_functions_pass() {
    let text = "my_model(x[3], a[1]) { u = max(abs(x[1]), abs(x[2])); my_model = min((1 - u^3)/(2 + x[3]^2), 1 - exp(abs(x[3])) + 2); }";
    let solid = check(text, 3.0);
    assert_eq!(
        solid.names(),
        ["u.x_max", "u.x_min", "u.y_max", "u.y_min", "z_max", "z_min"]
    );
    // A wall about a cube: outer and inner sides.
    let wall = "my_model(x[3], a[1]) { b = min(1 - abs(x[1]), min(1 - abs(x[2]), 1 - abs(x[3]))); my_model = 0.1 - abs(b); }";
    let solid = check(wall, 1.5);
    assert_eq!(
        (
            solid.names().len(),
            solid.names()[0].as_str(),
            solid.names()[6].as_str()
        ),
        (12, "b.x_max+", "b.x_max-")
    );
    // The minimum of an expression with itself is one piece.
    let twice = "my_model(x[3], a[1]) { u = 1 - x[1]; my_model = min(u, max(u, x[2])) | min(u, 0 - x[3]); }";
    assert_eq!(check(twice, 3.0).names().len(), 3);
}

#[test]
fn parameters_are_fixed() {
    let model = Model::parse(
        "my_model(x[3], a[2]) { my_model = a[1]*min(1 - abs(x[1]), a[2] - abs(x[2])); }",
        Mode::Default,
    )
    .expect("a program");
    let solid = |a: &[f64]| Pieces::of_model(&model, a);
    assert!(matches!(solid(&[2.0, 1.0]).expect("a solid").tree(), Csg::Min(all) if all.len() == 4));
    // A negative factor inverts the solid.
    assert!(
        matches!(solid(&[-2.0, 1.0]).expect("a solid").tree(), Csg::Max(all) if all.len() == 4)
    );
    assert_eq!(
        solid(&[1.0, 2.0, 3.0]).err(),
        Some(SolidError::Parameters {
            expected: 2,
            found: 3
        })
    );
}

#[test]
fn missing_values_are_as_annotated() {
    let text = "-- @param a[2] radius start=3
        -- @param a[3] height tie=0*radius
        my_model(x[3], a[3]) { my_model = a[2] + a[3] - a[1] - abs(x[1]); }";
    let model = Model::parse(text, Mode::Default).expect("a program");
    let pieces = Pieces::of_model(&model, &[1.0]).expect("an expression");
    let run = RunField::new(&model, &[1.0]).expect("a function of space");
    let mut values = [0.0];
    pieces.sign_values(&[[0.5, 0.0, 0.0]], &mut values);
    assert_eq!((values[0], run.value([0.5, 0.0, 0.0])), (1.5, 1.5));
}

#[test]
fn what_is_no_solid_says_so() {
    let solid = |text: &str| {
        let model = Model::parse(text, Mode::Default).expect("a program");
        Pieces::of_model(&model, &vec![0.0; model.n_params()]).map(|s| s.names().len())
    };
    assert_eq!(
        solid("my_model(x[2], a[1]) { my_model = x[1]; }"),
        Err(SolidError::Dimension { found: 2 })
    );
    assert_eq!(
        solid("my_model(x[3], a[1]) { my_model = max(1, x[1]); }"),
        Err(SolidError::NoSurface { inside: true })
    );
    assert_eq!(
        solid("my_model(x[3], a[1]) { my_model = 0 - 1; }"),
        Err(SolidError::NoSurface { inside: false })
    );
    let running =
        "my_model(x[3], a[1]) { i = 0; while i < x[1] loop i = i + 1; endloop; my_model = 2 - i; }";
    assert!(matches!(solid(running), Err(SolidError::NoExpression(_))));
    let model = Model::parse(running, Mode::Default).expect("a program");
    let one = OnePiece::new(
        RunField::new(&model, &[0.0]).expect("three coordinates"),
        model.name(),
    );
    assert_eq!(one.gradient(0, [1.5, 0.0, 0.0]).0, 0.0);
    assert_eq!(one.gradient(0, [2.5, 0.0, 0.0]).0, -1.0);
}

#[test]
fn large_and_deep_models_end() {
    let solid = |text: &str| {
        let model = Model::parse(text, Mode::Default).expect("a program");
        Pieces::of_model(&model, &[0.0])
    };
    // A long union is one level.
    let long = "my_model(x[3], a[1]) { f = 1 - x[1]; i = 0; while i < 3000 loop i = i + 1; f = max(f, x[1]*i - i*i); endloop; my_model = f; }";
    assert_eq!(solid(long).expect("a solid").names().len(), 3001);
    // Unions of cuts of unions …
    let deep = "my_model(x[3], a[1]) { f = 1 - x[1]; i = 0; while i < 5000 loop i = i + 1; f = min(max(f, x[2] - i), x[3] - i); endloop; my_model = f; }";
    assert_eq!(solid(deep).err(), Some(SolidError::TooLarge));
    let chain = "my_model(x[3], a[1]) { f = abs(x[1]); i = 0; while i < 5000 loop i = i + 1; f = abs(f - i); endloop; my_model = f - 1; }";
    assert!(solid(chain).is_ok() || solid(chain).err() == Some(SolidError::TooLarge));
    // Twice the leaves at each step.
    let wide = "my_model(x[3], a[1]) { f = abs(x[1]); i = 0; while i < 30 loop i = i + 1; f = max(min(f, x[2] + i), 1 - f*i); endloop; my_model = f; }";
    assert!(solid(wide).is_ok() || solid(wide).err() == Some(SolidError::TooLarge));
}

fn solid_of(text: &str) -> Pieces {
    let model = Model::parse(text, Mode::Default).expect("a program");
    Pieces::of_model(&model, &[0.0]).expect("a solid")
}

/// Checks a generated program: 20,000 balls with one name are pieces with distinct names, and the
/// cost per ball is that of a small program.
#[test]
fn twenty_thousand_balls() {
    let mut text = String::from("balls(x[3], a[1]) { array c[3]; c = [0, 0, 0];");
    text += "t = hfSphere(x, c, 0.4);";
    for k in 1..20_000 {
        text += &format!("c = [{k}, 0, 0]; t = t | hfSphere(x, c, 0.4);");
    }
    text += "balls = t; }";
    let solid = solid_of(&text);
    assert_eq!(solid.names().len(), 20_000);
    assert_eq!(solid.names()[1], "c");
    assert_eq!(solid.names()[19_999], "c#19999");
    assert_eq!(solid.cost(19_999), solid.cost(2));
}

/// Checks that computed values lie within the bounds of values, including rounding; if a value is
/// NaN the bounds are infinite, although exact values have a finite range there.
#[test]
fn bounds_of_values_hold_what_is_computed() {
    let text = "m(x[3], a[1]) {
      d = sqrt(x[1]^2 + x[2]^2) - 0.3;
      r = sqrt(x[1] + 1) - 1;
      m = min(d, min(r, 0.1*x[3]/(2 + x[1]^3)));
    }";
    let solid = solid_of(text);
    let n = solid.names().len() as u32;
    let which: Vec<u32> = (0..n).collect();
    let boxed = |lo: f64, hi: f64| Aabb {
        lo: [lo; 3],
        hi: [hi; 3],
    };
    let mut out = vec![Interval::ALL; n as usize];
    let mut known = 0;
    for (lo, hi) in [
        (-0.7, 0.4),
        (0.1, 0.1),
        (-0.9, 2.0),
        (-2.0, 2.0),
        (-0.1, 0.1),
    ] {
        solid.value_bounds(&which, boxed(lo, hi), &mut out);
        let steps = 5;
        let at = |k: usize| lo + (hi - lo) * k as f64 / (steps - 1) as f64;
        let points: Vec<[f64; 3]> = (0..steps * steps * steps)
            .map(|k| [at(k % steps), at(k / steps % steps), at(k / steps / steps)])
            .collect();
        let mut values = vec![0.0; which.len() * points.len()];
        solid.values(&which, &points, &mut values);
        for (range, values) in out.iter().zip(values.chunks(points.len())) {
            known += usize::from(*range != Interval::ALL);
            let holds = |v: &f64| *range == Interval::ALL || range.contains(*v);
            assert!(values.iter().all(holds), "{range:?} in [{lo}, {hi}]");
        }
    }
    // All three pieces in four of the boxes; in the large one the root is undefined at −2, and the
    // divisor of the quotient has a zero.
    assert_eq!(known, 13);
}
