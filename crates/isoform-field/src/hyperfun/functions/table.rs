//! Table of the library. A new function is one row here and its formula (or its variant of
//! [`Library`]).

use super::ArgumentShape::{Array, Chain, Each, Elements, Number, Point};
use super::{ArgumentShape, Call, Function, Implementation, Outcome, Sentinel};
use super::{attributes as at, convolution as cv, maps, math, shapes};
use crate::hyperfun::machine::Machine;
use crate::library::{Axis, Library};
use crate::ops::{Binary, Unary};

type ArgumentShapes = &'static [(&'static str, ArgumentShape)];

const fn row<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: Implementation<M>,
    help: &'static str,
) -> Function<M> {
    Function {
        names,
        arguments,
        run,
        writes: None,
        may_overflow: false,
        help,
    }
}
const fn primitive<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    f: Library,
    help: &'static str,
) -> Function<M> {
    row(
        names,
        arguments,
        Implementation::Primitive(f, Sentinel::Never),
        help,
    )
}
/// Creates the row of a primitive for which the reference implementation may return its sentinel.
const fn guarded<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    f: Library,
    bad: Sentinel,
    help: &'static str,
) -> Function<M> {
    row(names, arguments, Implementation::Primitive(f, bad), help)
}
const fn formula<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    help: &'static str,
) -> Function<M> {
    row(names, arguments, Implementation::Formula(run), help)
}
/// Creates the row of a function that modifies argument `i`.
const fn writing<M: Machine>(
    i: usize,
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    help: &'static str,
) -> Function<M> {
    Function {
        names,
        arguments,
        run: Implementation::Formula(run),
        writes: Some(i),
        may_overflow: false,
        help,
    }
}
/// Creates the row of a mathematical function.
const fn plain<M: Machine>(
    names: &'static [&'static str],
    arguments: ArgumentShapes,
    run: for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>,
    help: &'static str,
) -> Function<M> {
    Function {
        names,
        arguments,
        run: Implementation::Formula(run),
        writes: None,
        may_overflow: true,
        help,
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
        plain(&["sqrt"], U, math::sqrt, "square root"),
        plain(&["exp"], U, |c| Ok(c.n(0).exp()), "e to the power u"),
        plain(&["log"], U, math::log, "natural logarithm"),
        plain(&["logd"], U, math::logd, "decimal logarithm"),
        plain(&["sin"], U, |c| Ok(c.n(0).sin()), "sine of radians"),
        plain(&["cos"], U, |c| Ok(c.n(0).cos()), "cosine of radians"),
        plain(&["tan"], U, math::tan, "tangent of radians"),
        plain(&["asin"], U, math::asin, "arc sine"),
        plain(&["acos"], U, math::acos, "arc cosine"),
        plain(&["atan"], U, |c| Ok(c.n(0).atan()), "arc tangent"),
        plain(&["abs"], U, |c| Ok(c.n(0).abs()), "absolute value"),
        plain(
            &["sinh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Sinh)),
            "hyperbolic sine",
        ),
        plain(
            &["cosh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Cosh)),
            "hyperbolic cosine",
        ),
        plain(
            &["tanh"],
            U,
            |c| Ok(c.n(0).unary(Unary::Tanh)),
            "hyperbolic tangent",
        ),
        plain(&["max"], UV, |c| Ok(c.n(0).max(&c.n(1))), "the larger"),
        plain(&["min"], UV, |c| Ok(c.n(0).min(&c.n(1))), "the smaller"),
        plain(
            &["atan2"],
            UV,
            |c| Ok(c.n(0).binary(Binary::Atan2, &c.n(1))),
            "angle of the point (v, u)",
        ),
        plain(
            &["mod"],
            UV,
            math::modulo,
            "remainder of u by v, both rounded to integers first; sign of u",
        ),
        plain(
            &["ceil"],
            U,
            |c| Ok(c.n(0).unary(Unary::Ceil)),
            "smallest integer not below",
        ),
        plain(
            &["floor"],
            U,
            |c| Ok(c.n(0).floor()),
            "largest integer not above",
        ),
        plain(
            &["int"],
            U,
            |c| Ok(c.n(0).trunc()),
            "integer part, towards zero",
        ),
        plain(&["frac"], U, |c| Ok(c.n(0) - c.n(0).trunc()), "u - int(u)"),
        plain(&["sign"], U, math::sign, "-1, 0 or 1"),
        // Primitives
        primitive(&["hfSphere"], ROUND, Library::Sphere, "R^2 - |u|^2"),
        guarded(
            &["hfEllipsoid"],
            ELLIPSOID,
            Library::Ellipsoid,
            SMALL3,
            "1 - (u1/a)^2 - (u2/b)^2 - (u3/c)^2",
        ),
        primitive(
            &["hfTorusX"],
            TORUS,
            Library::Torus(Axis::X),
            "torus about an axis parallel to x",
        ),
        primitive(
            &["hfTorusY"],
            TORUS,
            Library::Torus(Axis::Y),
            "torus about an axis parallel to y",
        ),
        primitive(
            &["hfTorusZ"],
            TORUS,
            Library::Torus(Axis::Z),
            "torus about an axis parallel to z",
        ),
        primitive(
            &["hfCylinderX", "hfCylX"],
            ROUND,
            Library::Cylinder(Axis::X),
            "infinite cylinder along x: R^2 - p^2",
        ),
        primitive(
            &["hfCylinderY", "hfCylY"],
            ROUND,
            Library::Cylinder(Axis::Y),
            "infinite cylinder along y: R^2 - p^2",
        ),
        primitive(
            &["hfCylinderZ", "hfCylZ"],
            ROUND,
            Library::Cylinder(Axis::Z),
            "infinite cylinder along z: R^2 - p^2",
        ),
        guarded(
            &["hfEllCylX"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::X),
            SMALL2,
            "1 - (u2/a)^2 - (u3/b)^2",
        ),
        guarded(
            &["hfEllCylY"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::Y),
            SMALL2,
            "1 - (u1/a)^2 - (u3/b)^2",
        ),
        guarded(
            &["hfEllCylZ"],
            ELLIPTIC,
            Library::EllipticCylinder(Axis::Z),
            SMALL2,
            "1 - (u1/a)^2 - (u2/b)^2",
        ),
        guarded(
            &["hfBlock"],
            BLOCK,
            Library::Block,
            Sentinel::Negative(&[6, 7, 8]),
            "block of the sizes dx, dy, dz from its vertex: R-intersection of the slabs (x-v)(v+d-x)",
        ),
        primitive(
            &["hfConeX"],
            ROUND,
            Library::Cone(Axis::X),
            "double cone along x: h^2 - (p/R)^2",
        ),
        primitive(
            &["hfConeY"],
            ROUND,
            Library::Cone(Axis::Y),
            "double cone along y: h^2 - (p/R)^2",
        ),
        primitive(
            &["hfConeZ"],
            ROUND,
            Library::Cone(Axis::Z),
            "double cone along z: h^2 - (p/R)^2",
        ),
        primitive(
            &["hfEllConeX"],
            ELLIPTIC,
            Library::EllipticCone(Axis::X),
            "u1^2 - (u2/a)^2 - (u3/b)^2",
        ),
        primitive(
            &["hfEllConeY"],
            ELLIPTIC,
            Library::EllipticCone(Axis::Y),
            "u2^2 - (u1/a)^2 - (u3/b)^2",
        ),
        primitive(
            &["hfEllConeZ"],
            ELLIPTIC,
            Library::EllipticCone(Axis::Z),
            "u3^2 - (u1/a)^2 - (u2/b)^2",
        ),
        guarded(
            &["hfSuperell"],
            SUPER,
            Library::Superellipsoid,
            SMALL5,
            "1 - (|u1/a|^(2/s2) + |u2/b|^(2/s2))^(s2/s1) - |u3/c|^(2/s1)",
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
            "sum of b exp(-a r^2), minus T",
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
            "sum of metaballs of height b and radius d, minus T",
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
            "sum of soft objects of radius d, minus T",
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
            "solid noise of nested sines",
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
            "Bezier volume of l by m (along z) by n (along y) control values, within its box",
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
            "convolution of points with the Cauchy kernel, minus T",
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
            "convolution of line segments, minus T",
        ),
        formula(
            &["hfConvCurve"],
            &[("x", Point), ("vect", Chain), ("S", Each(1)), ("T", Number)],
            cv::curve,
            "convolution of a chain of segments, minus T",
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
            "convolution of triangles (times S^3), minus T",
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
            "convolution of the triangles of a mesh (times S^3), minus T",
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
            "convolution of arcs of theta degrees, turned by angle about axis, minus T",
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
            "convolution of segments with the threshold of the radius R",
        ),
        // Maps of space, in place
        writing(
            0,
            &["hfScale3D"],
            THREE,
            maps::scale,
            "scales the shape by x, y, z",
        ),
        writing(
            0,
            &["hfShift3D"],
            THREE,
            maps::shift,
            "shifts the shape by x, y, z",
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
            "stretches the shape about a centre",
        ),
        writing(
            0,
            &["hfRotate3DX"],
            ANGLE,
            |c| maps::rotate(c, Axis::X),
            "turns the shape about x, radians",
        ),
        writing(
            0,
            &["hfRotate3DY"],
            ANGLE,
            |c| maps::rotate(c, Axis::Y),
            "turns the shape about y, radians",
        ),
        writing(
            0,
            &["hfRotate3DZ"],
            ANGLE,
            |c| maps::rotate(c, Axis::Z),
            "turns the shape about z, radians",
        ),
        writing(
            0,
            &["hfTwistX"],
            TWIST,
            |c| maps::twist(c, Axis::X),
            "twists the shape along x from angle1 to angle2",
        ),
        writing(
            0,
            &["hfTwistY"],
            TWIST,
            |c| maps::twist(c, Axis::Y),
            "twists the shape along y from angle1 to angle2",
        ),
        writing(
            0,
            &["hfTwistZ"],
            TWIST,
            |c| maps::twist(c, Axis::Z),
            "twists the shape along z from angle1 to angle2",
        ),
        writing(
            0,
            &["hfTaperX"],
            TAPER,
            |c| maps::taper(c, Axis::X),
            "tapers the shape along x from scale1 to scale2",
        ),
        writing(
            0,
            &["hfTaperY"],
            TAPER,
            |c| maps::taper(c, Axis::Y),
            "tapers the shape along y from scale1 to scale2",
        ),
        writing(
            0,
            &["hfTaperZ"],
            TAPER,
            |c| maps::taper(c, Axis::Z),
            "tapers the shape along z from scale1 to scale2",
        ),
        writing(
            0,
            &["hfSpaceMapCubic"],
            SPACE_MAP,
            maps::space_map_cubic,
            "moves source points to targets, cubic falloff",
        ),
        writing(
            0,
            &["hfSpaceMapExp"],
            SPACE_MAP,
            maps::space_map_exp,
            "moves source points to targets, Gaussian falloff",
        ),
        // Operations on two values
        primitive(
            &["hfBlendUni"],
            BLEND,
            Library::BlendUnion,
            "blending union",
        ),
        primitive(
            &["hfBlendInt"],
            BLEND,
            Library::BlendIntersection,
            "blending intersection",
        ),
        primitive(
            &["hfDBlendUni"],
            DBLEND,
            Library::DistanceBlendUnion,
            "circular blend of distances, union",
        ),
        primitive(
            &["hfDBlendInt"],
            DBLEND,
            Library::DistanceBlendIntersection,
            "circular blend of distances, intersection",
        ),
        primitive(
            &["hfDUni"],
            SARDF,
            Library::SardfUnion,
            "signed approximate distance union",
        ),
        primitive(
            &["hfDInt"],
            SARDF,
            Library::SardfIntersection,
            "signed approximate distance intersection",
        ),
        formula(
            &["hfDSub"],
            SARDF,
            shapes::sardf_difference,
            "signed approximate distance difference",
        ),
        formula(
            &["hfSawtooth"],
            &[("t", Number), ("n", Number), ("a", Number), ("f", Number)],
            shapes::sawtooth,
            "the first n terms of a sawtooth wave",
        ),
        // Signed distances
        primitive(
            &["hfDConeX"],
            ROUND,
            Library::DistanceCone(Axis::X),
            "distance to the double cone along x",
        ),
        primitive(
            &["hfDConeY"],
            ROUND,
            Library::DistanceCone(Axis::Y),
            "distance to the double cone along y",
        ),
        primitive(
            &["hfDConeZ"],
            ROUND,
            Library::DistanceCone(Axis::Z),
            "distance to the double cone along z",
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
            "distance to the infinite cylinder along dir",
        ),
        primitive(
            &["hfDTorusX"],
            TORUS,
            Library::DistanceTorus(Axis::X),
            "distance to the torus about x",
        ),
        primitive(
            &["hfDTorusY"],
            TORUS,
            Library::DistanceTorus(Axis::Y),
            "distance to the torus about y",
        ),
        primitive(
            &["hfDTorusZ"],
            TORUS,
            Library::DistanceTorus(Axis::Z),
            "distance to the torus about z",
        ),
        primitive(
            &["hfDEllipsoid"],
            ELLIPSOID,
            Library::DistanceEllipsoid,
            "distance to the ellipsoid",
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
            "sine wave between lo and hi",
        ),
        formula(
            &["hfA_NoiseG"],
            &[("x", Point), ("freq", Number), ("phase", Number)],
            at::noise_g,
            "hfNoiseG scaled to [0, 1]",
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
            "out = inBlock inside the blocks of a lattice, inGap between them",
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
            "f1 | f2; out = in1, in2 or, inside both, 0 in1, 1 in2, 2 sum, 3 min, 4 max",
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
            "out = (r, g, b) where f >= 0",
        ),
        writing(
            1,
            &["hfA_SetAttributes"],
            &[("f", Number), ("out", Array(1)), ("in", Array(1))],
            at::set_attributes,
            "out = in where f >= 0",
        ),
        writing(
            0,
            &["hfA_Lerp"],
            MIX,
            |c| at::mix(c, false),
            "out from in1 to in2 as t goes from t0 to t1",
        ),
        writing(
            0,
            &["hfA_Cerp"],
            MIX,
            |c| at::mix(c, !c.strict),
            "hfA_Lerp, smooth at both ends",
        ),
        formula(
            &["hfA_Clamp"],
            &[("f", Number), ("a", Number), ("b", Number)],
            at::clamp,
            "the nearest to f in [a, b]",
        ),
        formula(
            &["hfA_Step"],
            &[("f", Number), ("a", Number)],
            |c| Ok(c.n(1).less_eq(&c.n(0))),
            "1 where f >= a, else 0",
        ),
        formula(
            &["hfA_Modulo"],
            &[("a", Number), ("b", Number)],
            at::modulo,
            "a - b int(a/b), plus b where that is negative",
        ),
        formula(
            &["hfA_Floor"],
            &[("a", Number)],
            |c| Ok(c.n(0).trunc()),
            "integer part, towards zero",
        ),
        formula(
            &["hfA_Pulse"],
            &[("f", Number), ("a", Number), ("b", Number)],
            at::pulse,
            "1 where a <= f <= b, else 0",
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
            "0 below fmin, 1 above fmax, a cubic between; the first three arguments do nothing",
        ),
        writing(
            1,
            &["hfA_LookUpTable"],
            LOOK_UP,
            |c| at::look_up(c, false),
            "out = the row of the table whose entry t has passed",
        ),
        writing(
            1,
            &["hfA_SmoothLookUpTable"],
            LOOK_UP,
            |c| at::look_up(c, true),
            "hfA_LookUpTable, linear between the rows",
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
            "out on the Catmull-Rom spline through the rows of knots as t goes from t0 to t1",
        ),
        writing(
            1,
            &["hfA_RGBToHSV"],
            COLOURS,
            at::rgb_to_hsv,
            "hue in degrees, saturation and value",
        ),
        writing(
            1,
            &["hfA_HSVToRGB"],
            COLOURS,
            at::hsv_to_rgb,
            "red, green and blue",
        ),
        formula(
            &["hfA_NoiseP"],
            &[("x", Point)],
            at::noise_p,
            "Perlin's gradient noise, about [-1, 1]",
        ),
        formula(
            &["hfA_Turbulence"],
            &[("x", Point), ("freq", Number)],
            at::turbulence,
            "sum of |noise(x freq)| / freq, halving freq to 1",
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
            "row of the table by the fraction of the distance to 0",
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
            "row of the table by noise of the frequency freq, scaled to [0, 1]",
        ),
    ];
}
