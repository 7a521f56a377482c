use super::tree::{CadSolid, SolidTranslator, Vector};
use super::*;
use isoform_field::NodeId;
use isoform_field::hyperfun::Mode;
use isoform_geom::{Point3, cross, dot, norm, sub};
use isoform_num::Random;

/// Programs with all kinds of solids, operations, signs and rotated coordinates.
const PROGRAMS: [&str; 5] = [
    "m(x[3], a[2]) { array c[3], k[3]; c = [0.2, 0, -0.1]; k = [-1, -1, -1];
       m = (hfBlock(x, k, 2, a[1], 1.5) | hfTorusX(x, c, 1, 0.3)) \\ hfCylinderY(x, c, a[2]); }",
    "m(x[3], a[2]) { array c[3], q[3]; q[1] = x[1]; q[2] = x[2]; q[3] = x[3];
       ok = hfRotate3DZ(q, 0.4); ok = hfRotate3DX(q, a[2]); c = [0.1, 0.2, 0.3];
       wall = (q[1] + 1) & (1 - q[1]);
       m = (wall & hfSphere(q, c, 1.2)) | (hfDConeZ(q, c, 0.5) & (0.3 - q[3]) & (q[3] + a[1])); }",
    "m(x[3], a[2]) { array c[3]; c = [0, 0, 0];
       outside = ~hfSphere(x, c, a[1]); corner = (~x[1]) | outside | (x[2] - 0.5);
       m = ~(corner & (outside | (x[3] + x[1]/2 - a[2]))); }",
    "m(x[3], a[2]) { array c[3]; c = [0, 0, 0];
       body = (x[1] + 1) & (1 - x[1]) & (x[2] + 1) & (a[1] - x[2]) & (x[3] + 1) & (1 - x[3]);
       body = body & (0.8 - x[1]) & (-2)*(x[3] - 0.9);
       body = body \\ (hfCylinderZ(x, c, 0.4)/(2*a[2]));
       m = body \\ (hfConeX(x, c, 0.3)*a[2]); }",
    "m(x[3], a[2]) { m = max(min(x[1], 1 - x[1]), min(min(x[2], a[1] - x[2]), x[3] - a[2])); }",
];

/// Returns the solids of a program's statements, with values of their numbers.
struct Known<'a> {
    translator: &'a SolidTranslator<'a>,
    values: [f64; 2],
}

impl Known<'_> {
    fn number(&self, id: NodeId) -> f64 {
        self.translator.graph.eval(id, &[], &self.values)
    }

    fn vector(&self, v: &Vector) -> Point3 {
        v.map(|id| self.number(id))
    }

    /// Returns true if a point is in a solid, by its geometry.
    fn holds(&self, solid: &CadSolid, p: Point3) -> bool {
        // Distances from the axis, and along it.
        let about = |at: &Vector, way: &Vector| {
            let (from, way) = (sub(p, self.vector(at)), self.vector(way));
            (norm(cross(from, way)), dot(from, way))
        };
        match solid {
            CadSolid::Half(n, d) => dot(self.vector(n), p) + self.number(*d) >= 0.0,
            CadSolid::Block(low, high) => {
                let (low, high) = (self.vector(low), self.vector(high));
                (0..3).all(|k| low[k] <= p[k] && p[k] <= high[k])
            }
            CadSolid::Rod(at, way, radius) => about(at, way).0 <= self.number(*radius),
            CadSolid::Ball(at, radius) => norm(sub(p, self.vector(at))) <= self.number(*radius),
            CadSolid::Ring(at, way, circle, tube) => {
                let (off, along) = about(at, way);
                (off - self.number(*circle)).hypot(along) <= self.number(*tube)
            }
            CadSolid::Cones(at, way, slope) => {
                let (off, along) = about(at, way);
                off <= self.number(*slope) * along.abs()
            }
            CadSolid::Union(all) => all.iter().any(|s| self.holds(s, p)),
            CadSolid::Common(all) => all.iter().all(|s| self.holds(s, p)),
            CadSolid::Cut(first, others) => {
                self.holds(first, p) && !others.iter().any(|s| self.holds(s, p))
            }
            CadSolid::Named(k) => self.holds(&self.translator.statements[*k].1, p),
        }
    }
}

/// Solids contain the points at which the program is positive, for other values of the parameters,
/// too.
#[test]
fn solids_are_those_of_the_program() {
    let mut random = Random::new(3);
    for program in PROGRAMS {
        let model = Model::parse(program, Mode::Default).expect("a program");
        let mut graph = Graph::new();
        let root = model.compile(&mut graph).expect("an expression");
        let mut translator = SolidTranslator::new(graph.clone(), &[1.1, 0.4]);
        let region = translator.region(root).expect("a solid");
        for values in [[1.1, 0.4], [0.9, 0.25]] {
            let known = Known {
                translator: &translator,
                values,
            };
            let mut within = 0;
            for _ in 0..4000 {
                let p: Point3 = std::array::from_fn(|_| 4.0 * random.unit() - 2.0);
                let is_in = graph.eval(root, &p, &values) >= 0.0;
                let found = known.holds(&region.solid, p) != region.is_outside;
                assert_eq!(found, is_in, "{program}: {p:?}");
                within += usize::from(is_in);
            }
            assert!((100..3900).contains(&within), "{program}: {within}");
        }
    }
}

#[test]
fn what_cad_has_no_operation_for_is_named() {
    let bent = "m(x[3], a[1]) { wave = x[3] - sin(x[1]); m = wave & (1 - x[3]); }";
    let outside = "m(x[3], a[1]) { array c[3]; c = [0, 0, 0]; m = ~hfSphere(x, c, 1); }";
    let options = CadOptions::default();
    for (text, wanted) in [(bent, "wave is made of no"), (outside, "all space but")] {
        let model = Model::parse(text, Mode::Default).expect("a program");
        let error = cad_program(&model, &[0.0], &options, CadDialect::Build123d);
        let error = error.expect_err("no program").to_string();
        assert!(error.contains(wanted), "{error}");
    }
}

/// Names that are keywords of a language, or not valid in it, are replaced.
#[test]
fn names_are_free_and_ties_stand_behind_what_they_follow() {
    let text = "-- @param a[1] lambda length tie=2*far\n-- @param a[2] far length typical=3 : a: b\n\
        m(x[3], a[3]) { array c[3]; c = [0, 0, 0]; part = hfSphere(x, c, a[1]);\n\
        part = part & (a[2] - x[3]); m = part & (a[3] - x[1]); }";
    let model = Model::parse(text, Mode::Default).expect("a program");
    let options = CadOptions {
        title: "a\nb".to_owned(),
        diagonal: 1.0,
        intervals: vec![None, Some((2.5, 3.5)), None],
        ..CadOptions::default()
    };
    let program = cad_program(&model, &[6.0, 3.0, 1.0], &options, CadDialect::CadQuery);
    let program = program.expect("a program");
    let place = |line: &str| {
        program
            .find(line)
            .unwrap_or_else(|| panic!("{line}: {program}"))
    };
    assert!(place("\nfar_2 = 3.0  # 2.5 to 3.5; a: b\n") < place("\nlambda_2 = 2.0*far_2\n"));
    assert!(place("\na_3 = 1\n") < place("part_2 = ball((0, 0, 0), lambda_2)"));
    assert!(program.starts_with("# ab\nimport sys"));
}
