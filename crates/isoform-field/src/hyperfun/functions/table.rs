//! Table of the library. A new function is one row here and its formula (or its variant of
//! [`Library`]).

use super::ArgumentShape::{Array, Chain, Each, Elements, File, Number, Point};
use super::{ArgumentShape, Call, Function, Implementation, Outcome, Sentinel};
use super::{attributes as at, convolution as cv, files, maps, math, shapes};
use crate::hyperfun::machine::Machine;
use crate::library::{Axis, Library};
use crate::ops::{Binary, Unary};

type ArgumentShapes = &'static [(&'static str, ArgumentShape)];

/// Description of a function, and the statements of a program that uses it.
type Documentation = (&'static str, &'static str);

/// Sections of the table: title, and name of the first function.
pub(super) const SECTIONS: [(&str, &str); 8] = [
    ("Mathematics", "sqrt"),
    ("Primitives", "hfSphere"),
    ("Convolution surfaces", "hfConvPoint"),
    ("Maps of space", "hfScale3D"),
    ("Operations on two values", "hfBlendUni"),
    ("Signed distances", "hfDConeX"),
    ("Attributes", "hfA_Wave"),
    ("Files", "mesh"),
];

const fn row<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: Implementation<M>,
    (help, example): Documentation,
) -> Function<M> {
    Function {
        names,
        arguments,
        run,
        writes: None,
        may_overflow: false,
        help,
        example,
    }
}
const fn primitive<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    f: Library,
    doc: Documentation,
) -> Function<M> {
    row(
        names,
        arguments,
        Implementation::Primitive(f, Sentinel::Never),
        doc,
    )
}
/// Creates the row of a primitive for which the reference implementation may return its sentinel.
const fn guarded<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    f: Library,
    bad: Sentinel,
    doc: Documentation,
) -> Function<M> {
    row(names, arguments, Implementation::Primitive(f, bad), doc)
}
const fn formula<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    doc: Documentation,
) -> Function<M> {
    row(names, arguments, Implementation::Formula(run), doc)
}
/// Creates the row of a function that modifies argument `i`.
const fn writing<M: Machine>(
    i: usize,
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    (help, example): Documentation,
) -> Function<M> {
    Function {
        names,
        arguments,
        run: Implementation::Formula(run),
        writes: Some(i),
        may_overflow: false,
        help,
        example,
    }
}
/// Creates the row of a mathematical function.
const fn plain<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    (help, example): Documentation,
) -> Function<M> {
    Function {
        names,
        arguments,
        run: Implementation::Formula(run),
        writes: None,
        may_overflow: true,
        help,
        example,
    }
}

const U: ArgumentShapes = &[("u", Number)];
const UV: ArgumentShapes = &[("u", Number), ("v", Number)];
const ROUND: ArgumentShapes = &[("x", Point), ("center", Array(3)), ("R", Number)];
const TORUS: ArgumentShapes = &[
    ("x", Point),
    ("center", Array(3)),
    ("R", Number),
    ("r", Number),
];
const ELLIPTIC: ArgumentShapes = &[
    ("x", Point),
    ("center", Array(3)),
    ("a", Number),
    ("b", Number),
];
const ELLIPSOID: ArgumentShapes = &[
    ("x", Point),
    ("center", Array(3)),
    ("a", Number),
    ("b", Number),
    ("c", Number),
];
const SUPER: ArgumentShapes = &[
    ("x", Point),
    ("center", Array(3)),
    ("a", Number),
    ("b", Number),
    ("c", Number),
    ("s1", Number),
    ("s2", Number),
];
const BLOCK: ArgumentShapes = &[
    ("x", Point),
    ("vertex", Array(3)),
    ("dx", Number),
    ("dy", Number),
    ("dz", Number),
];
const BLEND: ArgumentShapes = &[
    ("f1", Number),
    ("f2", Number),
    ("a0", Number),
    ("a1", Number),
    ("a2", Number),
];
const DBLEND: ArgumentShapes = &[("f1", Number), ("f2", Number), ("r", Number)];
const SARDF: ArgumentShapes = &[
    ("f1", Number),
    ("f2", Number),
    ("R", Number),
    ("alpha", Number),
];
const ANGLE: ArgumentShapes = &[("p", Point), ("angle", Number)];
const THREE: ArgumentShapes = &[("p", Point), ("x", Number), ("y", Number), ("z", Number)];
const TWIST: ArgumentShapes = &[
    ("p", Point),
    ("z1", Number),
    ("z2", Number),
    ("angle1", Number),
    ("angle2", Number),
];
const TAPER: ArgumentShapes = &[
    ("p", Point),
    ("z1", Number),
    ("z2", Number),
    ("scale1", Number),
    ("scale2", Number),
];
const SPACE_MAP: ArgumentShapes = &[
    ("p", Point),
    ("source", Elements(3)),
    ("target", Each(3)),
    ("b", Each(3)),
];
const MIX: ArgumentShapes = &[
    ("out", Array(1)),
    ("in1", Array(1)),
    ("in2", Array(1)),
    ("t", Number),
    ("t0", Number),
    ("t1", Number),
];
const LOOK_UP: ArgumentShapes = &[
    ("t", Number),
    ("out", Array(1)),
    ("table", Array(1)),
    ("entries", Array(1)),
];
const COLOURS: ArgumentShapes = &[("in", Array(3)), ("out", Array(3))];

const SMALL2: Sentinel = Sentinel::Small(&[6, 7]);
const SMALL3: Sentinel = Sentinel::Small(&[6, 7, 8]);
const SMALL5: Sentinel = Sentinel::Small(&[6, 7, 8, 9, 10]);

impl<M: Machine> Function<M> {
    /// Rows of all functions, in the order of the documentation.
    pub(crate) const TABLE: &'static [Self] = &[
        // Mathematics
        plain(
            &["sqrt"],
            U,
            math::sqrt,
            (
                "Square root of u ≥ 0.",
                "my_model = 1 - sqrt(x[1]^2 + x[2]^2 + x[3]^2);",
            ),
        ),
        plain(
            &["exp"],
            U,
            |c| Ok(c.n(0).exp()),
            (
                "e to the power u.",
                "my_model = exp(-(x[1]^2 + x[2]^2 + x[3]^2)) - 0.4;",
            ),
        ),
        plain(
            &["log"],
            U,
            math::log,
            (
                "Natural logarithm of u > 0.",
                "my_model = -log(0.1 + x[1]^2 + x[2]^2 + x[3]^2);",
            ),
        ),
        plain(
            &["logd"],
            U,
            math::logd,
            (
                "Decimal logarithm of u > 0.",
                "my_model = -logd(0.1 + x[1]^2 + x[2]^2 + x[3]^2);",
            ),
        ),
        plain(
            &["sin"],
            U,
            |c| Ok(c.n(0).sin()),
            (
                "Sine of u, in radians.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*sin(9*x[1]);",
            ),
        ),
        plain(
            &["cos"],
            U,
            |c| Ok(c.n(0).cos()),
            (
                "Cosine of u, in radians.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*cos(9*x[3]);",
            ),
        ),
        plain(
            &["tan"],
            U,
            math::tan,
            (
                "Tangent of u, in radians.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.3*tan(x[1]/2);",
            ),
        ),
        plain(
            &["asin"],
            U,
            math::asin,
            (
                "Arc sine of u in [-1, 1], in radians, from -π/2 to π/2.",
                "my_model = 0.1 - asin(sqrt(x[1]^2 + x[2]^2 + x[3]^2)/10);",
            ),
        ),
        plain(
            &["acos"],
            U,
            math::acos,
            (
                "Arc cosine of u in [-1, 1], in radians, from 0 to π.",
                "my_model = acos(sqrt(x[1]^2 + x[2]^2 + x[3]^2)/10) - 1.47;",
            ),
        ),
        plain(
            &["atan"],
            U,
            |c| Ok(c.n(0).atan()),
            (
                "Arc tangent of u, in radians, from -π/2 to π/2.",
                "my_model = 1 - atan(x[1]^2 + x[2]^2 + x[3]^2);",
            ),
        ),
        plain(
            &["abs"],
            U,
            |c| Ok(c.n(0).abs()),
            (
                "Absolute value of u.",
                "my_model = 1 - abs(x[1]) - abs(x[2]) - abs(x[3]);",
            ),
        ),
        plain(
            &["sinh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Sinh)),
            (
                "Hyperbolic sine of u.",
                "my_model = 1 - sinh(x[1])^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        plain(
            &["cosh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Cosh)),
            (
                "Hyperbolic cosine of u.",
                "my_model = 2 - cosh(x[1]) - x[2]^2 - x[3]^2;",
            ),
        ),
        plain(
            &["tanh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Tanh)),
            (
                "Hyperbolic tangent of u.",
                "my_model = 0.7 - tanh(x[1]^2 + x[2]^2 + x[3]^2);",
            ),
        ),
        plain(
            &["max"],
            UV,
            |c| Ok(c.n(0).max(&c.n(1))),
            (
                "Larger of u and v: the sharp union of two solids.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = max(hfSphere(x, c, 1), 0.5 - x[1]^2 - x[2]^2 - (x[3] - 1)^2);",
            ),
        ),
        plain(
            &["min"],
            UV,
            |c| Ok(c.n(0).min(&c.n(1))),
            (
                "Smaller of u and v: the sharp intersection of two solids.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = min(hfSphere(x, c, 1), 0.6 - x[3]);",
            ),
        ),
        plain(
            &["atan2"],
            UV,
            |c| Ok(c.n(0).binary(Binary::Atan2, &c.n(1))),
            (
                "Angle of the point (v, u), in radians, from -π to π: atan2(y, x) is the angle of (x, y).",
                "my_model = (1 - x[1]^2 - x[2]^2 - x[3]^2) & (1.2 - abs(atan2(x[2], x[1])));",
            ),
        ),
        plain(
            &["mod"],
            UV,
            math::modulo,
            (
                "Remainder of u divided by v after rounding both to integers, with the sign of u.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*mod(4*x[3], 2);",
            ),
        ),
        plain(
            &["ceil"],
            U,
            |c| Ok(c.n(0).unary(Unary::Ceil)),
            (
                "Smallest integer not below u.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*ceil(2*x[3]);",
            ),
        ),
        plain(
            &["floor"],
            U,
            |c| Ok(c.n(0).floor()),
            (
                "Largest integer not above u.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*floor(2*x[3]);",
            ),
        ),
        plain(
            &["int"],
            U,
            |c| Ok(c.n(0).trunc()),
            (
                "Integer part of u, rounded towards 0.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*int(2*x[3]);",
            ),
        ),
        plain(
            &["frac"],
            U,
            |c| Ok(c.n(0) - c.n(0).trunc()),
            (
                "Fraction of u: u - int(u).",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*frac(2*x[3]);",
            ),
        ),
        plain(
            &["sign"],
            U,
            math::sign,
            (
                "Sign of u: -1, 0 or 1.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*sign(x[3]);",
            ),
        ),
        // Primitives
        primitive(
            &["hfSphere"],
            ROUND,
            Library::Sphere,
            (
                "Ball of radius R: R^2 - |x - center|^2.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        guarded(
            &["hfEllipsoid"],
            ELLIPSOID,
            Library::Ellipsoid,
            SMALL3,
            (
                "Ellipsoid with the half axes a, b, c along x, y, z: 1 - (u1/a)^2 - (u2/b)^2 - (u3/c)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllipsoid(x, c, 1, 0.7, 0.5);",
            ),
        ),
        primitive(
            &["hfTorusX"],
            TORUS,
            Library::Torus(Axis::X),
            (
                "Torus around an axis parallel to x: R is the radius of its circle, r that of its tube.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfTorusX(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfTorusY"],
            TORUS,
            Library::Torus(Axis::Y),
            (
                "Torus around an axis parallel to y: R is the radius of its circle, r that of its tube.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfTorusY(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfTorusZ"],
            TORUS,
            Library::Torus(Axis::Z),
            (
                "Torus around an axis parallel to z: R is the radius of its circle, r that of its tube.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfTorusZ(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfCylinderX", "hfCylX"],
            ROUND,
            Library::Cylinder(Axis::X),
            (
                "Infinite cylinder of radius R along x: R^2 - p^2, p the distance from its axis.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfCylinderX(x, c, 0.5) & (1 - x[1]^2);",
            ),
        ),
        primitive(
            &["hfCylinderY", "hfCylY"],
            ROUND,
            Library::Cylinder(Axis::Y),
            (
                "Infinite cylinder of radius R along y: R^2 - p^2, p the distance from its axis.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfCylinderY(x, c, 0.5) & (1 - x[2]^2);",
            ),
        ),
        primitive(
            &["hfCylinderZ", "hfCylZ"],
            ROUND,
            Library::Cylinder(Axis::Z),
            (
                "Infinite cylinder of radius R along z: R^2 - p^2, p the distance from its axis.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfCylinderZ(x, c, 0.5) & (1 - x[3]^2);",
            ),
        ),
        guarded(
            &["hfEllCylX"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::X),
            SMALL2,
            (
                "Infinite elliptic cylinder along x with the half axes a and b: 1 - (u2/a)^2 - (u3/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllCylX(x, c, 0.8, 0.4) & (1 - x[1]^2);",
            ),
        ),
        guarded(
            &["hfEllCylY"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::Y),
            SMALL2,
            (
                "Infinite elliptic cylinder along y with the half axes a and b: 1 - (u1/a)^2 - (u3/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllCylY(x, c, 0.8, 0.4) & (1 - x[2]^2);",
            ),
        ),
        guarded(
            &["hfEllCylZ"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::Z),
            SMALL2,
            (
                "Infinite elliptic cylinder along z with the half axes a and b: 1 - (u1/a)^2 - (u2/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllCylZ(x, c, 0.8, 0.4) & (1 - x[3]^2);",
            ),
        ),
        guarded(
            &["hfBlock"],
            BLOCK,
            Library::Block,
            Sentinel::Negative(&[6, 7, 8]),
            (
                "Block with edges parallel to the axes, of the sizes dx, dy, dz, from its corner `vertex` on: intersection of the slabs (x - v)(v + d - x).",
                "array v[3];\nv = [-1, -0.6, -0.4];\nmy_model = hfBlock(x, v, 2, 1.2, 0.8);",
            ),
        ),
        primitive(
            &["hfConeX"],
            ROUND,
            Library::Cone(Axis::X),
            (
                "Infinite double cone along x: h^2 - (p/R)^2, h the height from center, p the distance from the axis; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfConeX(x, c, 0.7) & (1 - x[1]^2);",
            ),
        ),
        primitive(
            &["hfConeY"],
            ROUND,
            Library::Cone(Axis::Y),
            (
                "Infinite double cone along y: h^2 - (p/R)^2, h the height from center, p the distance from the axis; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfConeY(x, c, 0.7) & (1 - x[2]^2);",
            ),
        ),
        primitive(
            &["hfConeZ"],
            ROUND,
            Library::Cone(Axis::Z),
            (
                "Infinite double cone along z: h^2 - (p/R)^2, h the height from center, p the distance from the axis; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfConeZ(x, c, 0.7) & (1 - x[3]^2);",
            ),
        ),
        primitive(
            &["hfEllConeX"],
            ELLIPTIC,
            Library::EllipticCone(Axis::X),
            (
                "Infinite elliptic double cone along x: u1^2 - (u2/a)^2 - (u3/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllConeX(x, c, 0.9, 0.5) & (1 - x[1]^2);",
            ),
        ),
        primitive(
            &["hfEllConeY"],
            ELLIPTIC,
            Library::EllipticCone(Axis::Y),
            (
                "Infinite elliptic double cone along y: u2^2 - (u1/a)^2 - (u3/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllConeY(x, c, 0.9, 0.5) & (1 - x[2]^2);",
            ),
        ),
        primitive(
            &["hfEllConeZ"],
            ELLIPTIC,
            Library::EllipticCone(Axis::Z),
            (
                "Infinite elliptic double cone along z: u3^2 - (u1/a)^2 - (u2/b)^2, u = x - center.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfEllConeZ(x, c, 0.9, 0.5) & (1 - x[3]^2);",
            ),
        ),
        guarded(
            &["hfSuperell"],
            SUPER,
            Library::Superellipsoid,
            SMALL5,
            (
                "Superellipsoid with the half axes a, b, c: 1 - (|u1/a|^(2/s2) + |u2/b|^(2/s2))^(s2/s1) - |u3/c|^(2/s1), u = x - center; 1 is round, smaller is boxier.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfSuperell(x, c, 1, 0.8, 0.6, 0.4, 0.4);",
            ),
        ),
        formula(
            &["hfBlobby"],
            &[
                ("x", Point),
                ("x0", Elements(1)),
                ("y0", Each(1)),
                ("z0", Each(1)),
                ("a", Each(1)),
                ("b", Each(1)),
                ("T", Number),
            ],
            shapes::blobby,
            (
                "Blobby model: sum of b exp(-a r^2) over the points (x0, y0, z0), minus the threshold T; r is the distance from a point.",
                "array px[2], py[2], pz[2], p[2], q[2];\npx = [-0.5, 0.5];\npy = [0, 0];\npz = [0, 0];\np = [4, 4];\nq = [1, 1];\nmy_model = hfBlobby(x, px, py, pz, p, q, 0.5);",
            ),
        ),
        formula(
            &["hfMetaball"],
            &[
                ("x", Point),
                ("x0", Elements(1)),
                ("y0", Each(1)),
                ("z0", Each(1)),
                ("b", Each(1)),
                ("d", Each(1)),
                ("T", Number),
            ],
            shapes::metaball,
            (
                "Metaballs: sum of balls of the height b and the radius d around the points (x0, y0, z0), minus the threshold T.",
                "array px[2], py[2], pz[2], p[2], q[2];\npx = [-0.5, 0.5];\npy = [0, 0];\npz = [0, 0];\np = [1, 1];\nq = [1.2, 1.2];\nmy_model = hfMetaball(x, px, py, pz, p, q, 0.3);",
            ),
        ),
        formula(
            &["hfSoft"],
            &[
                ("x", Point),
                ("x0", Elements(1)),
                ("y0", Each(1)),
                ("z0", Each(1)),
                ("d", Each(1)),
                ("T", Number),
            ],
            shapes::soft,
            (
                "Soft objects: sum of fields of the radius d around the points (x0, y0, z0), minus the threshold T.",
                "array px[2], py[2], pz[2], p[2];\npx = [-0.5, 0.5];\npy = [0, 0];\npz = [0, 0];\np = [1.2, 1.2];\nmy_model = hfSoft(x, px, py, pz, p, 0.3);",
            ),
        ),
        formula(
            &["hfNoiseG"],
            &[
                ("x", Point),
                ("amplitude", Number),
                ("frequency", Number),
                ("phase", Number),
            ],
            shapes::noise_g,
            (
                "Solid noise: a product of nested sines with an amplitude, a frequency (in radians per unit of length) and a phase; add it to a shape.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + hfNoiseG(x, 0.6, 5, 1);",
            ),
        ),
        formula(
            &["hfBezierVolume"],
            &[
                ("x", Point),
                ("l", Number),
                ("m", Number),
                ("n", Number),
                ("bbox", Array(6)),
                ("w", Array(1)),
            ],
            shapes::bezier_volume,
            (
                "Bezier volume of l by m by n control values w (m along z, n along y) in the box `bbox` (x, y, z of the lower corner, then of the upper one).",
                "array b[6], w[27];\nb = [-1, -1, -1, 1, 1, 1];\nw = [-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 30, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1];\nmy_model = hfBezierVolume(x, 3, 3, 3, b, w);",
            ),
        ),
        // Convolution surfaces
        formula(
            &["hfConvPoint"],
            &[
                ("x", Point),
                ("vect", Elements(3)),
                ("S", Each(1)),
                ("T", Number),
            ],
            cv::point,
            (
                "Convolution surface of points (x, y, z each in `vect`) with the Cauchy kernel of the inverse width S each, minus the threshold T.",
                "array v[6], s1[2];\nv = [-0.5, 0, 0, 0.5, 0, 0];\ns1 = [1.5, 1.5];\nmy_model = hfConvPoint(x, v, s1, 0.3);",
            ),
        ),
        formula(
            &["hfConvLine"],
            &[
                ("x", Point),
                ("begin", Elements(3)),
                ("end", Each(3)),
                ("S", Each(1)),
                ("T", Number),
            ],
            cv::line,
            (
                "Convolution surface of line segments from `begin` to `end`, with the inverse kernel width S each, minus the threshold T.",
                "array p[6], q[6], s1[2];\np = [-1, 0, 0, 0, -1, 0];\nq = [1, 0, 0, 0, 1, 0];\ns1 = [2, 2];\nmy_model = hfConvLine(x, p, q, s1, 0.5);",
            ),
        ),
        formula(
            &["hfConvCurve"],
            &[("x", Point), ("vect", Chain), ("S", Each(1)), ("T", Number)],
            cv::curve,
            (
                "Convolution surface of a chain of segments through the points of `vect`, with the inverse kernel width S each, minus the threshold T.",
                "array v[9], s1[2];\nv = [-1, 0, 0, 0, 0.8, 0, 1, 0, 0];\ns1 = [2, 2];\nmy_model = hfConvCurve(x, v, s1, 0.5);",
            ),
        ),
        formula(
            &["hfConvTriangle"],
            &[
                ("x", Point),
                ("vect", Elements(9)),
                ("S", Each(1)),
                ("T", Number),
            ],
            cv::triangle,
            (
                "Convolution surface of triangles (nine coordinates each in `vect`), with the inverse kernel width S each, times S^3, minus the threshold T.",
                "array v[9], s1[1];\nv = [-1, -0.8, 0, 1, -0.8, 0, 0, 1, 0];\ns1 = [2];\nmy_model = hfConvTriangle(x, v, s1, 2);",
            ),
        ),
        formula(
            &["hfConvMesh"],
            &[
                ("x", Point),
                ("vect", Array(3)),
                ("tri", Elements(3)),
                ("S", Each(1)),
                ("T", Number),
            ],
            cv::mesh,
            (
                "Convolution surface of a mesh: `tri` holds three numbers of vertices, from 1, for each triangle, `vect` their coordinates; inverse kernel width S each, times S^3, minus the threshold T.",
                "array v[12], t[6], s1[2];\nv = [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0];\nt = [1, 2, 3, 1, 3, 4];\ns1 = [2, 2];\nmy_model = hfConvMesh(x, v, t, s1, 2);",
            ),
        ),
        formula(
            &["hfConvArc"],
            &[
                ("x", Point),
                ("center", Elements(3)),
                ("radius", Each(1)),
                ("theta", Each(1)),
                ("axis", Each(3)),
                ("angle", Each(1)),
                ("S", Each(1)),
                ("T", Number),
            ],
            cv::arc,
            (
                "Convolution surface of arcs of `radius` around `center`, from the x axis over theta degrees in the xy plane, then rotated by `angle` degrees about `axis`; inverse kernel width S each, minus the threshold T.",
                "array c[3], r[1], t[1], e[3], g[1], s1[1];\nc = [0, 0, 0];\nr = [0.9];\nt = [270];\ne = [0, 0, 1];\ng = [0];\ns1 = [2];\nmy_model = hfConvArc(x, c, r, t, e, g, s1, 0.7);",
            ),
        ),
        formula(
            &["hfConvLineR"],
            &[
                ("x", Point),
                ("begin", Elements(3)),
                ("end", Each(3)),
                ("R", Number),
            ],
            cv::line_r,
            (
                "Convolution surface of line segments from `begin` to `end`, whose threshold gives a single segment about the radius R.",
                "array p[6], q[6];\np = [-1, 0, 0, 0, -1, 0];\nq = [1, 0, 0, 0, 1, 0];\nmy_model = hfConvLineR(x, p, q, 0.3);",
            ),
        ),
        // Maps of space, in place
        writing(
            0,
            &["hfScale3D"],
            THREE,
            maps::scale,
            (
                "Scales the shape by the factors x, y, z about the origin: changes p in place and returns 1.",
                "array c[3];\nc = [0, 0, 0];\nscaled = hfScale3D(x, 1, 0.7, 0.5);\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        writing(
            0,
            &["hfShift3D"],
            THREE,
            maps::shift,
            (
                "Moves the shape by x, y, z: changes p in place and returns 1.",
                "array c[3];\nc = [0, 0, 0];\nmoved = hfShift3D(x, 0.5, 0, 0);\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        writing(
            0,
            &["hfStretch3D"],
            &[
                ("p", Point),
                ("center", Array(3)),
                ("sx", Number),
                ("sy", Number),
                ("sz", Number),
            ],
            maps::stretch,
            (
                "Stretches the shape by the factors sx, sy, sz about `center`: changes p in place and returns 1.",
                "array c[3];\nc = [0, 0, 0];\nstretched = hfStretch3D(x, c, 1.3, 0.7, 0.7);\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        writing(
            0,
            &["hfRotate3DX"],
            ANGLE,
            |c| maps::rotate(c, Axis::X),
            (
                "Rotates the shape about the x axis by an angle in radians: changes p in place and returns 1.",
                "array v[3];\nv = [-0.9, -0.5, -0.3];\nturned = hfRotate3DX(x, 0.5);\nmy_model = hfBlock(x, v, 1.8, 1, 0.6);",
            ),
        ),
        writing(
            0,
            &["hfRotate3DY"],
            ANGLE,
            |c| maps::rotate(c, Axis::Y),
            (
                "Rotates the shape about the y axis by an angle in radians: changes p in place and returns 1.",
                "array v[3];\nv = [-0.9, -0.5, -0.3];\nturned = hfRotate3DY(x, 0.5);\nmy_model = hfBlock(x, v, 1.8, 1, 0.6);",
            ),
        ),
        writing(
            0,
            &["hfRotate3DZ"],
            ANGLE,
            |c| maps::rotate(c, Axis::Z),
            (
                "Rotates the shape about the z axis by an angle in radians: changes p in place and returns 1.",
                "array v[3];\nv = [-0.9, -0.5, -0.3];\nturned = hfRotate3DZ(x, 0.5);\nmy_model = hfBlock(x, v, 1.8, 1, 0.6);",
            ),
        ),
        writing(
            0,
            &["hfTwistX"],
            TWIST,
            |c| maps::twist(c, Axis::X),
            (
                "Twists the shape along x: by angle1 at x = z1, by angle2 at x = z2, in radians. The twist continues beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-1, -0.4, -0.4];\ntwisted = hfTwistX(x, -1, 1, 0, 1.5);\nmy_model = hfBlock(x, v, 2, 0.8, 0.8);",
            ),
        ),
        writing(
            0,
            &["hfTwistY"],
            TWIST,
            |c| maps::twist(c, Axis::Y),
            (
                "Twists the shape along y: by angle1 at y = z1, by angle2 at y = z2, in radians. The twist continues beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-0.4, -1, -0.4];\ntwisted = hfTwistY(x, -1, 1, 0, 1.5);\nmy_model = hfBlock(x, v, 0.8, 2, 0.8);",
            ),
        ),
        writing(
            0,
            &["hfTwistZ"],
            TWIST,
            |c| maps::twist(c, Axis::Z),
            (
                "Twists the shape along z: by angle1 at z = z1, by angle2 at z = z2, in radians. The twist continues beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-0.4, -0.4, -1];\ntwisted = hfTwistZ(x, -1, 1, 0, 1.5);\nmy_model = hfBlock(x, v, 0.8, 0.8, 2);",
            ),
        ),
        writing(
            0,
            &["hfTaperX"],
            TAPER,
            |c| maps::taper(c, Axis::X),
            (
                "Tapers the shape along x: scales by scale1 at x = z1, by scale2 at x = z2. The scale is constant beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-1, -0.4, -0.4];\ntapered = hfTaperX(x, -1, 1, 1.5, 0.5);\nmy_model = hfBlock(x, v, 2, 0.8, 0.8);",
            ),
        ),
        writing(
            0,
            &["hfTaperY"],
            TAPER,
            |c| maps::taper(c, Axis::Y),
            (
                "Tapers the shape along y: scales by scale1 at y = z1, by scale2 at y = z2. The scale is constant beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-0.4, -1, -0.4];\ntapered = hfTaperY(x, -1, 1, 1.5, 0.5);\nmy_model = hfBlock(x, v, 0.8, 2, 0.8);",
            ),
        ),
        writing(
            0,
            &["hfTaperZ"],
            TAPER,
            |c| maps::taper(c, Axis::Z),
            (
                "Tapers the shape along z: scales by scale1 at z = z1, by scale2 at z = z2. The scale is constant beyond both. Changes p in place and returns 1.",
                "array v[3];\nv = [-0.4, -0.4, -1];\ntapered = hfTaperZ(x, -1, 1, 1.5, 0.5);\nmy_model = hfBlock(x, v, 0.8, 0.8, 2);",
            ),
        ),
        writing(
            0,
            &["hfSpaceMapCubic"],
            SPACE_MAP,
            maps::space_map_cubic,
            (
                "Deforms the shape so that the points `source` move to `target`; the effect falls to 0 at the distances b (1 + |target - source|) from the target, along x, y, z. Changes p in place and returns 1.",
                "array c[3], s1[3], t[3], b[3];\nc = [0, 0, 0];\ns1 = [0, 0, 0.8];\nt = [0, 0, 1.3];\nb = [1, 1, 1];\nmoved = hfSpaceMapCubic(x, s1, t, b);\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        writing(
            0,
            &["hfSpaceMapExp"],
            SPACE_MAP,
            maps::space_map_exp,
            (
                "Deforms the shape so that the points `source` move to `target`, with a Gaussian falloff of the widths b (1 + |target - source|), along x, y, z. Changes p in place and returns 1.",
                "array c[3], s1[3], t[3], b[3];\nc = [0, 0, 0];\ns1 = [0, 0, 0.8];\nt = [0, 0, 1.3];\nb = [1, 1, 1];\nmoved = hfSpaceMapExp(x, s1, t, b);\nmy_model = hfSphere(x, c, 1);",
            ),
        ),
        // Operations on two values
        primitive(
            &["hfBlendUni"],
            BLEND,
            Library::BlendUnion,
            (
                "Union of f1 and f2 with added material where both surfaces meet: f1 | f2 plus a0/(1 + (f1/a1)^2 + (f2/a2)^2).",
                "array c[3], d[3];\nc = [-0.5, 0, 0];\nd = [0.5, 0, 0];\nmy_model = hfBlendUni(hfSphere(x, c, 0.7), hfSphere(x, d, 0.7), 0.2, 0.3, 0.3);",
            ),
        ),
        primitive(
            &["hfBlendInt"],
            BLEND,
            Library::BlendIntersection,
            (
                "Intersection of f1 and f2 with removed (a0 < 0) material where both surfaces meet: f1 & f2 plus a0/(1 + (f1/a1)^2 + (f2/a2)^2).",
                "array c[3], d[3];\nc = [-0.5, 0, 0];\nd = [0.5, 0, 0];\nmy_model = hfBlendInt(hfSphere(x, c, 1), hfSphere(x, d, 1), -0.2, 0.3, 0.3);",
            ),
        ),
        primitive(
            &["hfDBlendUni"],
            DBLEND,
            Library::DistanceBlendUnion,
            (
                "Union of two solids given by distances f1 and f2, with a fillet of the radius r.",
                "array c[3], e[3], d[3];\nc = [0, 0, 0];\ne = [1, 0, 0];\nd = [0, 0, 1];\nmy_model = hfDBlendUni(hfDCylinder(x, c, e, 0.4), hfDCylinder(x, c, d, 0.4), 0.3) & (1.7 - x[1]^2) & (1.7 - x[3]^2);",
            ),
        ),
        primitive(
            &["hfDBlendInt"],
            DBLEND,
            Library::DistanceBlendIntersection,
            (
                "Intersection of two solids given by distances f1 and f2, with a round of the radius r.",
                "array c[3], e[3], d[3];\nc = [0, 0, 0];\ne = [1, 0, 0];\nd = [0, 0, 1];\nmy_model = hfDBlendInt(hfDCylinder(x, c, e, 0.8), hfDCylinder(x, c, d, 0.8), 0.3);",
            ),
        ),
        primitive(
            &["hfDUni"],
            SARDF,
            Library::SardfUnion,
            (
                "Union of two solids given by distances f1 and f2, by a signed approximate distance function; R and alpha set the size and the shape of its smooth zone.",
                "array c[3], d[3], e[3];\nc = [-0.5, 0, 0];\ne = [0, 0, 1];\nd = [0.5, 0, 0];\nmy_model = hfDUni(hfDTorusZ(x, c, 0.6, 0.25), hfDTorusZ(x, d, 0.6, 0.25), 0.5, 0.5);",
            ),
        ),
        primitive(
            &["hfDInt"],
            SARDF,
            Library::SardfIntersection,
            (
                "Intersection of two solids given by distances f1 and f2, by a signed approximate distance function; R and alpha as in hfDUni.",
                "array c[3], e[3], d[3];\nc = [0, 0, 0];\ne = [1, 0, 0];\nd = [0, 0, 1];\nmy_model = hfDInt(hfDCylinder(x, c, e, 0.8), hfDCylinder(x, c, d, 0.8), 0.5, 0.5);",
            ),
        ),
        formula(
            &["hfDSub"],
            SARDF,
            shapes::sardf_difference,
            (
                "Difference of two solids given by distances f1 and f2 (f1 without f2), by a signed approximate distance function; R and alpha as in hfDUni.",
                "array c[3], e[3];\nc = [0, 0, 0];\ne = [0, 0, 1];\nmy_model = hfDSub(hfDEllipsoid(x, c, 1, 0.9, 0.7), hfDCylinder(x, c, e, 0.4), 0.5, 0.5);",
            ),
        ),
        formula(
            &["hfSawtooth"],
            &[("t", Number), ("n", Number), ("a", Number), ("f", Number)],
            shapes::sawtooth,
            (
                "First n terms of the Fourier series of a sawtooth wave of t, with the amplitude a and the frequency f.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*hfSawtooth(x[3], 5, 1, 2);",
            ),
        ),
        // Signed distances
        primitive(
            &["hfDConeX"],
            ROUND,
            Library::DistanceCone(Axis::X),
            (
                "Signed distance to the infinite double cone along x; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDConeX(x, c, 0.7) & (1 - x[1]^2);",
            ),
        ),
        primitive(
            &["hfDConeY"],
            ROUND,
            Library::DistanceCone(Axis::Y),
            (
                "Signed distance to the infinite double cone along y; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDConeY(x, c, 0.7) & (1 - x[2]^2);",
            ),
        ),
        primitive(
            &["hfDConeZ"],
            ROUND,
            Library::DistanceCone(Axis::Z),
            (
                "Signed distance to the infinite double cone along z; R is the tangent of half its angle.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDConeZ(x, c, 0.7) & (1 - x[3]^2);",
            ),
        ),
        primitive(
            &["hfDCylinder"],
            &[
                ("x", Point),
                ("center", Array(3)),
                ("dir", Array(3)),
                ("R", Number),
            ],
            Library::DistanceCylinder,
            (
                "Signed distance to the infinite cylinder of radius R through `center` along `dir`.",
                "array c[3], e[3];\nc = [0, 0, 0];\ne = [1, 1, 0];\nmy_model = hfDCylinder(x, c, e, 0.4) & (1 - x[1]^2);",
            ),
        ),
        primitive(
            &["hfDTorusX"],
            TORUS,
            Library::DistanceTorus(Axis::X),
            (
                "Signed distance to the torus around an axis parallel to x.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDTorusX(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfDTorusY"],
            TORUS,
            Library::DistanceTorus(Axis::Y),
            (
                "Signed distance to the torus around an axis parallel to y.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDTorusY(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfDTorusZ"],
            TORUS,
            Library::DistanceTorus(Axis::Z),
            (
                "Signed distance to the torus around an axis parallel to z.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDTorusZ(x, c, 0.8, 0.3);",
            ),
        ),
        primitive(
            &["hfDEllipsoid"],
            ELLIPSOID,
            Library::DistanceEllipsoid,
            (
                "Signed distance to the ellipsoid with the half axes a, b, c along x, y, z.",
                "array c[3];\nc = [0, 0, 0];\nmy_model = hfDEllipsoid(x, c, 1, 0.7, 0.5);",
            ),
        ),
        // Attributes
        formula(
            &["hfA_Wave"],
            &[
                ("t", Number),
                ("lo", Number),
                ("hi", Number),
                ("freq", Number),
            ],
            at::wave,
            (
                "Sine wave of t between lo and hi, of the angular frequency freq.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + hfA_Wave(x[3], 0, 0.2, 2);",
            ),
        ),
        formula(
            &["hfA_NoiseG"],
            &[("x", Point), ("freq", Number), ("phase", Number)],
            at::noise_g,
            (
                "Noise of hfNoiseG with the amplitude 1, scaled to [0, 1].",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.3*hfA_NoiseG(x, 5, 1);",
            ),
        ),
        writing(
            3,
            &["hfA_CheckerBoard"],
            &[
                ("x", Point),
                ("block", Array(3)),
                ("gap", Array(3)),
                ("out", Array(1)),
                ("inBlock", Array(1)),
                ("inGap", Array(1)),
            ],
            at::checker_board,
            (
                "Attributes `out`: inBlock inside the blocks of a lattice of the sizes `block` with gaps `gap`, inGap between them. Returns 1.",
                "array b[3], g[3], red[3], grey[3];\nb = [0.5, 0.5, 0.5];\ng = [0.1, 0.1, 0.1];\nred = [1, 0, 0];\ngrey = [0.5, 0.5, 0.5];\npainted = hfA_CheckerBoard(x, b, g, s, red, grey);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            2,
            &["hfA_Union"],
            &[
                ("f1", Number),
                ("f2", Number),
                ("out", Array(1)),
                ("in1", Array(1)),
                ("in2", Array(1)),
                ("op", Number),
            ],
            at::union,
            (
                "Union f1 | f2 with attributes `out`: in1 inside the first solid, in2 inside the second; inside both by op: 0 in1, 1 in2, 2 sum, 3 min, 4 max.",
                "array red[3], blue[3];\nred = [1, 0, 0];\nblue = [0, 0, 1];\nmy_model = hfA_Union(1 - x[1]^2 - x[2]^2 - x[3]^2, 0.5 - x[1]^2 - x[2]^2 - (x[3] - 1)^2, s, red, blue, 0);",
            ),
        ),
        writing(
            1,
            &["hfA_SetColor"],
            &[
                ("f", Number),
                ("out", Array(3)),
                ("r", Number),
                ("g", Number),
                ("b", Number),
            ],
            at::set_color,
            (
                "Attributes `out` = (r, g, b) where f ≥ 0. Returns 1.",
                "ball = 1 - x[1]^2 - x[2]^2 - x[3]^2;\npainted = hfA_SetColor(ball, s, 1, 0.5, 0);\nmy_model = ball;",
            ),
        ),
        writing(
            1,
            &["hfA_SetAttributes"],
            &[("f", Number), ("out", Array(1)), ("in", Array(1))],
            at::set_attributes,
            (
                "Attributes `out` = `in` where f ≥ 0. Returns 1.",
                "array red[3];\nred = [1, 0, 0];\nball = 1 - x[1]^2 - x[2]^2 - x[3]^2;\npainted = hfA_SetAttributes(ball, s, red);\nmy_model = ball;",
            ),
        ),
        writing(
            0,
            &["hfA_Lerp"],
            MIX,
            |c| at::mix(c, false),
            (
                "Attributes `out` from in1 to in2, linear as t goes from t0 to t1. Returns the share of in2.",
                "array red[3], blue[3];\nred = [1, 0, 0];\nblue = [0, 0, 1];\npainted = hfA_Lerp(s, red, blue, x[3], -1, 1);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            0,
            &["hfA_Cerp"],
            MIX,
            |c| at::mix(c, !c.strict),
            (
                "Attributes `out` from in1 to in2 as t goes from t0 to t1, by a cubic that is flat at both ends. Returns the share of in2.",
                "array red[3], blue[3];\nred = [1, 0, 0];\nblue = [0, 0, 1];\npainted = hfA_Cerp(s, red, blue, x[3], -1, 1);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        formula(
            &["hfA_Clamp"],
            &[("f", Number), ("a", Number), ("b", Number)],
            at::clamp,
            (
                "Number in [a, b] nearest to f.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*hfA_Clamp(3*x[3], -1, 1);",
            ),
        ),
        formula(
            &["hfA_Step"],
            &[("f", Number), ("a", Number)],
            |c| Ok(c.n(1).less_eq(&c.n(0))),
            (
                "1 where f ≥ a, else 0.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*hfA_Step(x[3], 0);",
            ),
        ),
        formula(
            &["hfA_Modulo"],
            &[("a", Number), ("b", Number)],
            at::modulo,
            (
                "Remainder a - b int(a/b), plus b if it is negative.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*hfA_Modulo(x[3], 0.5);",
            ),
        ),
        formula(
            &["hfA_Floor"],
            &[("a", Number)],
            |c| Ok(c.n(0).trunc()),
            (
                "Integer part of a, rounded towards 0.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.1*hfA_Floor(2*x[3]);",
            ),
        ),
        formula(
            &["hfA_Pulse"],
            &[("f", Number), ("a", Number), ("b", Number)],
            at::pulse,
            (
                "1 where a ≤ f ≤ b, else 0.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*hfA_Pulse(x[3], -0.2, 0.2);",
            ),
        ),
        formula(
            &["hfA_SmoothStep"],
            &[
                ("s", Number),
                ("smin", Number),
                ("smax", Number),
                ("f", Number),
                ("fmin", Number),
                ("fmax", Number),
            ],
            at::smooth_step,
            (
                "0 below fmin, 1 above fmax, a cubic between; the first three arguments have no effect.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.3*hfA_SmoothStep(0, 0, 0, x[3], -0.5, 0.5);",
            ),
        ),
        writing(
            1,
            &["hfA_LookUpTable"],
            LOOK_UP,
            |c| at::look_up(c, false),
            (
                "Attributes `out`: the row of the table with the last entry not above t. Returns 1.",
                "array table[6], entries[2];\ntable = [1, 0, 0, 0, 0, 1];\nentries = [-1, 0];\npainted = hfA_LookUpTable(x[3], s, table, entries);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            1,
            &["hfA_SmoothLookUpTable"],
            LOOK_UP,
            |c| at::look_up(c, true),
            (
                "Attributes `out`: rows of the table, linear in t between the entries. Returns 1.",
                "array table[6], entries[2];\ntable = [1, 0, 0, 0, 0, 1];\nentries = [-1, 0];\npainted = hfA_SmoothLookUpTable(x[3], s, table, entries);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            0,
            &["hfA_Spline"],
            &[
                ("out", Array(1)),
                ("knots", Array(4)),
                ("t", Number),
                ("t0", Number),
                ("t1", Number),
            ],
            at::spline,
            (
                "Attributes `out` on the Catmull-Rom spline through the rows of `knots` as t goes from t0 to t1. Returns 1.",
                "array k[12];\nk = [1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1];\npainted = hfA_Spline(s, k, x[3], -1, 1);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            1,
            &["hfA_RGBToHSV"],
            COLOURS,
            at::rgb_to_hsv,
            (
                "Attributes `out` = hue in degrees, saturation and value of the colour `in` (red, green, blue). Returns 1.",
                "array c[3];\nc = [1, 0.5, 0];\nconverted = hfA_RGBToHSV(c, s);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            1,
            &["hfA_HSVToRGB"],
            COLOURS,
            at::hsv_to_rgb,
            (
                "Attributes `out` = red, green and blue of the colour `in` (hue in degrees, saturation, value). Returns 1.",
                "array c[3];\nc = [30, 1, 1];\nconverted = hfA_HSVToRGB(c, s);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        formula(
            &["hfA_NoiseP"],
            &[("x", Point)],
            at::noise_p,
            (
                "Gradient noise, from about -1 to 1.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.3*hfA_NoiseP(x);",
            ),
        ),
        formula(
            &["hfA_Turbulence"],
            &[("x", Point), ("freq", Number)],
            at::turbulence,
            (
                "Sum of |noise(x freq)| / freq, while freq is halved down to 1.",
                "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2 + 0.2*hfA_Turbulence(x, 8);",
            ),
        ),
        writing(
            1,
            &["hfA_Circles"],
            &[
                ("x", Point),
                ("out", Array(1)),
                ("table", Array(1)),
                ("entries", Array(1)),
            ],
            at::circles,
            (
                "Attributes `out`: the row of the table chosen by the fraction of the distance from the origin. Returns 1.",
                "array table[6], entries[2];\ntable = [1, 0, 0, 0, 0, 1];\nentries = [0, 0.5];\npainted = hfA_Circles(x, s, table, entries);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        writing(
            1,
            &["hfA_Crackles"],
            &[
                ("x", Point),
                ("out", Array(1)),
                ("freq", Number),
                ("table", Array(1)),
                ("entries", Array(1)),
            ],
            at::crackles,
            (
                "Attributes `out`: the row of the table chosen by noise of the frequency freq, scaled to [0, 1]. Returns 1.",
                "array table[6], entries[2];\ntable = [1, 0, 0, 0, 0, 1];\nentries = [0, 0.5];\npainted = hfA_Crackles(x, s, 4, table, entries);\nmy_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
            ),
        ),
        // Files
        formula(
            &["mesh"],
            &[("x", Point), ("file", File), ("accuracy", Number)],
            files::value,
            (
                "Signed distance from the closed triangles of a file, positive inside: a spline with continuous gradient. Without x at the point of evaluation. accuracy: largest error near the surface, in units of length; a thousandth of the file's diagonal if left out. Elsewhere a twentieth of the distance is added to it.",
                "my_model = mesh(\"part.stl\") - 0.1;",
            ),
        ),
        formula(
            &["surface"],
            &[("x", Point), ("file", File)],
            files::value,
            (
                "Function of a file of `isoform implicitize`. Without x at the point of evaluation.",
                "my_model = surface(\"scan.json\") - 0.1;",
            ),
        ),
    ];
}
