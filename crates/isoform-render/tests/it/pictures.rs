//! Pictures compared with closed forms: silhouettes, caps, hits, colours and lines.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Aabb, Column, Mesh, Point3, PointCloud, RationalPatch};
use isoform::{Control, FormulaSurface, solid_of};
use isoform_render::{
    Camera, ColorBy, Drawing, Layer, Pane, Patch, Picture, Scale, Scene, Section, ShownModel,
    Style, View, draw_svg, render,
};

const WHITE: [u8; 3] = [255; 3];
const CAP: [u8; 3] = [224, 164, 88];

/// Returns a model from the body of a program in which `c` is the origin.
fn model(body: &str, bounds: Aabb, by: Option<ColorBy>) -> Layer {
    let text = format!("m(x[3], a[1]) {{ array c[3]; c = [0, 0, 0]; {body} }}");
    let program = Model::parse(&text, Mode::Default).expect("a program");
    let (solid, _) = solid_of(&program, &[1.0]).expect("a solid");
    let shown = ShownModel {
        solid,
        bounds,
        is_cut: false,
        is_surface: false,
        names: &[],
    };
    Layer::model("m", shown, by, &Control::default()).expect("no end")
}

fn cube(half: f64, at: Point3) -> Aabb {
    Aabb {
        lo: at.map(|v| v - half),
        hi: at.map(|v| v + half),
    }
}

fn scene(layer: Layer, section: Option<Section>) -> Scene {
    Scene {
        layers: vec![layer],
        section,
    }
}

/// Renders a picture without lines.
fn plain(scene: &Scene, camera: &Camera, size: [u32; 2]) -> Picture {
    let style = Style {
        lines: false,
        ..Style::default()
    };
    render(scene, camera, size, &style, &Control::default()).expect("no end")
}

fn looking(position: Point3, target: Point3, orthographic: bool) -> Camera {
    Camera::looking(position, target, 30.0, orthographic).expect("a camera")
}

/// Returns the area of the picture that is not background; pixels at borders count by their share.
fn covered(picture: &Picture, inner: [u8; 3]) -> f64 {
    let share = |p: &[u8; 3]| (255.0 - f64::from(p[2])) / (255.0 - f64::from(inner[2]));
    picture.pixels.iter().map(|p| share(p).min(1.0)).sum()
}

#[test]
fn the_silhouette_of_a_ball_has_its_radius_at_every_scale_and_place() {
    for (scale, far) in [
        (1.0, 0.0),
        (1e-6, 0.0),
        (1e6, 0.0),
        (1.0, 1e6),
        (1e-3, 50.0),
    ] {
        let at = [far, -2.0 * far, 0.5 * far];
        let body = format!(
            "c = [{:?}, {:?}, {:?}]; m = hfSphere(x, c, {scale:?});",
            at[0], at[1], at[2]
        );
        let ball = scene(model(&body, cube(1.1 * scale, at), None), None);
        let place = |p: Point3| -> Point3 { std::array::from_fn(|k| at[k] + scale * p[k]) };
        let camera = looking(place([3.0, -2.5, 1.5]), at, false);
        let picture = plain(&ball, &camera, [320, 240]);
        let away = (9.0_f64 + 6.25 + 2.25).sqrt();
        let slope = 15.0_f64.to_radians().tan();
        let want = (1.0 / away).asin().tan() / slope * 120.0;
        let count = picture.pixels.iter().filter(|p| **p != WHITE).count();
        // Number of pixels that the ball touches: half a pixel more than its radius.
        let found = (count as f64 / std::f64::consts::PI).sqrt();
        assert!((found - want).abs() < 0.8, "{scale} {far}: {found} {want}");
    }
}

#[test]
fn the_cap_of_a_ball_has_its_area_and_one_colour() {
    let section = Section::new([0.0, 0.0, 2.0], 1.0);
    let ball = scene(
        model("m = hfSphere(x, c, 1);", cube(1.1, [0.0; 3]), None),
        section,
    );
    let mut camera = looking([0.0, 0.0, 5.0], [0.0; 3], true);
    camera.height = 2.4;
    let picture = plain(&ball, &camera, [480, 480]);
    let caps = picture.pixels.iter().filter(|p| **p == CAP).count();
    // The radius at z = 1/2 is √3/2, with 200 pixels per unit.
    let want = std::f64::consts::PI * 0.75 * 200.0 * 200.0;
    assert!((caps as f64 / want - 1.0).abs() < 0.01, "{caps} {want}");
}

/// Returns the first intersection with a torus (2, 1), by small steps and bisection.
fn torus(o: Point3, d: Point3) -> Option<Point3> {
    let at = |t: f64| -> Point3 { std::array::from_fn(|k| o[k] + t * d[k]) };
    let f = |p: Point3| 1.0 - (p[0].hypot(p[1]) - 2.0).hypot(p[2]);
    let (mut a, mut b) = (0..20_000)
        .map(|k| (1e-3 * f64::from(k), 1e-3 * f64::from(k + 1)))
        .find(|(_, b)| f(at(*b)) >= 0.0)?;
    for _ in 0..50 {
        let m = 0.5 * (a + b);
        if f(at(m)) >= 0.0 { b = m } else { a = m }
    }
    Some(at(b))
}

#[test]
fn without_caps_one_sees_the_inside_of_a_cut_ball() {
    let ball = model("m = hfSphere(x, c, 1);", cube(1.1, [0.0; 3]), None);
    let section = Section::new([0.0, 0.0, 1.0], 0.25);
    let scene = scene(ball, section);
    let camera = looking([0.0, 0.0, 9.0], [0.0; 3], true);
    let style = Style {
        caps: false,
        ..Style::default()
    };
    let picture = render(&scene, &camera, [80, 80], &style, &Control::default()).expect("no end");
    let capped = plain(&scene, &camera, [80, 80]);
    assert_eq!(capped.pixel(40, 40), CAP);
    let open = picture.pixel(40, 40);
    assert!(
        open != CAP && open[2] > open[0],
        "a model is blue: {open:?}"
    );
    assert_eq!(picture.pixel(1, 1), WHITE);
}

#[test]
fn a_patch_is_seen_on_the_surface_that_it_stands_for() {
    // A flat patch a little below the upper face of a block, and one farther below.
    let patch = |z: f64, distance: Option<f64>| {
        let corner = |x: f64, y: f64| [x, y, z, 1.0];
        let [a, b, c, d] = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)];
        let control = [a, b, c, d].map(|(x, y)| corner(x, y)).to_vec();
        let patch = RationalPatch::new((1, 1), control).expect("a patch");
        let name = "p".to_owned();
        Layer::patches(
            "p",
            &[Patch {
                patch,
                name,
                distance,
            }],
            Some(ColorBy::None),
        )
    };
    let middle = |patch: Layer| {
        let body = "m = min(min(1 - abs(x[1]), 1 - abs(x[2])), 1 - abs(x[3]));";
        let block = model(body, cube(1.1, [0.0; 3]), None);
        let alone = model(body, cube(1.1, [0.0; 3]), None);
        let camera = looking([0.0, 0.0, 9.0], [0.0; 3], true);
        let of = |layers| {
            let scene = Scene {
                layers,
                section: None,
            };
            plain(&scene, &camera, [40, 40]).pixel(20, 20)
        };
        of(vec![block, patch]) != of(vec![alone])
    };
    assert!(middle(patch(1.0 - 1e-3, Some(1e-3))), "within its distance");
    assert!(!middle(patch(1.0 - 2e-3, Some(1e-3))), "beyond it");
    assert!(middle(patch(1.0 - 1e-3, None)), "of unknown distance");
    assert!(!middle(patch(0.5, None)), "inside of the block");
}

#[test]
fn a_torus_of_degree_four_is_lit_where_it_is() {
    let text = "(x^2 + y^2 + z^2 + 3)^2 - 16*(x^2 + y^2)";
    let bounds = cube(3.2, [0.0; 3]);
    let formula = FormulaSurface::parse(text).expect("a formula");
    let model = formula.stated_model(&[]).expect("a program");
    let (solid, _) = solid_of(&model, &[]).expect("a solid");
    let shown = ShownModel {
        solid,
        bounds,
        is_cut: true,
        is_surface: false,
        names: &[],
    };
    let layer = Layer::model("torus", shown, None, &Control::default()).expect("no end");
    let camera = looking([6.0, -7.0, 5.0], [0.0; 3], false);
    let picture = plain(&scene(layer, None), &camera, [80, 60]);
    let [right, up, ahead] = camera.axes();
    let slope = 15.0_f64.to_radians().tan();
    let mut wrong = 0;
    for (i, pixel) in picture.pixels.iter().enumerate() {
        let (x, y) = ((i % 80) as f64 + 0.5, (i / 80) as f64 + 0.5);
        let (u, v) = ((x - 40.0) / 30.0 * slope, (30.0 - y) / 30.0 * slope);
        let d: Point3 = std::array::from_fn(|k| ahead[k] + u * right[k] + v * up[k]);
        let d = d.map(|c| c / (1.0 + u * u + v * v).sqrt());
        wrong += usize::from(torus(camera.position, d).is_some() != (*pixel != WHITE));
    }
    // Pixels at the outline show both.
    assert!(wrong < 250, "{wrong}");
}

#[test]
fn colours_of_deviations_have_their_signs() {
    // Points of a ball that is larger above and smaller below.
    let point = |i: usize| -> Point3 {
        let (t, z) = (2.4 * i as f64, (i as f64 + 0.5) / 2000.0 - 1.0);
        let r = (1.0 - z * z).sqrt();
        [r * t.cos(), r * t.sin(), z].map(|v| v * (1.0 + 0.02 * z))
    };
    let points: Vec<Point3> = (0..4000).map(point).collect();
    let deviation = |p: &Point3| p.iter().map(|v| v * v).sum::<f64>().sqrt() - 1.0;
    let cloud = PointCloud {
        columns: vec![Column {
            name: "deviation".to_owned(),
            values: points.iter().map(deviation).collect(),
        }],
        ..PointCloud::from_points(points)
    };
    let layer = Layer::points("cloud", &cloud, None, Some(ColorBy::Deviation));
    let picture = plain(
        &scene(layer, None),
        &looking([5.0, 0.0, 0.0], [0.0; 3], false),
        [200, 200],
    );
    let scale = Scale::of_deviations(&cloud.columns[0].values, None);
    assert_eq!((scale.upper, scale.count), (0.02, 4000));
    let tint = |rows: std::ops::Range<u32>| {
        let all = rows.flat_map(|y| (0..200).map(move |x| (x, y)));
        let drawn = all
            .map(|(x, y)| picture.pixel(x, y))
            .filter(|p| *p != WHITE);
        let each: Vec<f64> = drawn.map(|p| f64::from(p[0]) - f64::from(p[2])).collect();
        each.iter().sum::<f64>() / each.len() as f64
    };
    assert!(
        tint(20..70) > 50.0 && tint(130..180) < -50.0,
        "{} {}",
        tint(20..70),
        tint(130..180)
    );
}

/// Cube from −1 to 1 as a mesh of twelve triangles.
fn block() -> Mesh {
    let points = (0..8).map(|i| [0, 1, 2].map(|k| f64::from(2 * (i >> k & 1) - 1)));
    let quads: [[u32; 4]; 6] = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    Mesh::from_triangles(points.collect(), triangles.collect())
}

fn drawn(scene: &Scene, hidden: bool) -> String {
    let pane = Pane {
        name: String::new(),
        at: [0, 0],
        size: [400, 300],
        camera: looking([6.0, -8.0, 5.0], [0.0; 3], true),
    };
    let drawing = Drawing {
        hidden,
        ..Drawing::default()
    };
    draw_svg(scene, &[pane], [400, 300], &drawing, &Control::default()).expect("no end")
}

/// Returns the lengths of the straight stretches of lines of a class, except for very short ones.
fn stretches(svg: &str, class: &str) -> Vec<f64> {
    let mark = format!("<path class=\"{class}\" d=\"");
    let mut lengths = Vec::new();
    for part in svg.split(&mark).skip(1) {
        let (d, _) = part.split_once('"').expect("the end of a path");
        let closes = d.ends_with('Z');
        let number = |t: &str| t.parse::<f64>().expect("a number");
        let place = |t: &str| {
            let (x, y) = t.split_once(' ').expect("two numbers");
            [number(x), number(y)]
        };
        let mut points: Vec<[f64; 2]> = d
            .trim_end_matches('Z')
            .split(['M', 'L'])
            .filter(|t| !t.is_empty())
            .map(place)
            .collect();
        points.extend(closes.then(|| points[0]));
        for pair in points.windows(2) {
            lengths.push((pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]));
        }
    }
    lengths.retain(|l| *l > 3.0);
    lengths
}

#[test]
fn a_cube_shows_nine_of_its_edges() {
    let solid = "m = min(min(1 - abs(x[1]), 1 - abs(x[2])), 1 - abs(x[3]));";
    let of_model = scene(model(solid, cube(1.2, [0.0; 3]), None), None);
    let of_mesh = scene(Layer::mesh("block", &block(), None, None), None);
    for scene in [of_model, of_mesh] {
        let svg = drawn(&scene, false);
        let (outline, edge) = (stretches(&svg, "outline"), stretches(&svg, "edge"));
        assert_eq!((outline.len(), edge.len()), (6, 3), "{svg}");
        assert!(stretches(&svg, "hidden").is_empty());
        // The three hidden edges meet at the far corner.
        assert_eq!(stretches(&drawn(&scene, true), "hidden").len(), 3);
    }
}

#[test]
fn the_cut_of_a_mesh_is_filled_and_its_hole_is_not() {
    // A cube within a cube, turned inside out, is a cavity.
    let (mut mesh, inner) = (block(), block());
    let first = mesh.points.len() as u32;
    mesh.points
        .extend(inner.points.iter().map(|p| p.map(|v| 0.5 * v)));
    let turned = inner
        .triangles
        .iter()
        .map(|t| [t[0] + first, t[2] + first, t[1] + first]);
    mesh.triangles.extend(turned);
    let section = Section::new([0.0, 0.0, 1.0], 0.1);
    let layer = Layer::mesh("hollow", &mesh, None, section.as_ref());
    let mut camera = looking([0.0, 0.0, 5.0], [0.0; 3], true);
    camera.height = 2.5;
    let picture = plain(&scene(layer, section), &camera, [250, 250]);
    let caps = picture.pixels.iter().filter(|p| **p == CAP).count();
    assert!((caps as f64 - 30_000.0).abs() < 500.0, "{caps}");
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let solid = "m = min(hfSphere(x, c, 1), x[1]^2 + x[2]^2 - 0.1);";
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let scene = scene(model(solid, cube(1.1, [0.0; 3]), Some(ColorBy::Part)), None);
            let camera = Camera::fitted(&scene.bounds(), View::Iso, 1.5, 35.0, false);
            let style = Style::default();
            let picture = render(&scene, &camera, [150, 100], &style, &Control::default());
            (picture.expect("no end"), drawn(&scene, true))
        })
    };
    assert!(made(1) == made(3));
}

#[test]
fn half_covered_pixels_are_mixed() {
    // The edge of a plane along a column of pixels covers half of it.
    let square = Mesh::from_triangles(
        vec![
            [-9.0, -9.0, 0.0],
            [0.0, -9.0, 0.0],
            [0.0, 9.0, 0.0],
            [-9.0, 9.0, 0.0],
        ],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    // The triangles of a solid have no edges in the picture.
    let layer = Layer::solid("square", &square, None, None);
    let mut camera = looking([0.0, 0.0, 5.0], [0.0; 3], true);
    camera.height = 5.0;
    // With five pixels per unit, the middle column is half covered.
    let picture = plain(&scene(layer, None), &camera, [5, 5]);
    let (inner, mixed) = (picture.pixel(0, 2), picture.pixel(2, 2));
    assert_eq!(picture.pixel(3, 2), WHITE);
    let middle = (f64::from(inner[0]) + 255.0) / 2.0;
    assert!(
        (f64::from(mixed[0]) - middle).abs() < 2.0,
        "{inner:?} {mixed:?}"
    );
    assert!((covered(&picture, inner) - 12.5).abs() < 0.2);
}
