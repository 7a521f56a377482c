//! Output of a template as a HyperFun program.

use super::corner::WallRole;
use super::dimensions::{AXIS_LETTERS, CoordinateTerm, Dimensions, LinearForm, ParameterQuantity};
use super::frame::{AxisRotation, CoordinateSystem, PartFrame};
use super::half::{HalfSpace, HalfSpaceSource};
use super::solid::{SolidFormula, ones};
use crate::chart::PrimitiveKind;
use crate::entity::Recognition;
use isoform_geom::{Aabb, Point3, dot, rotation};
use std::fmt::Write;

/// Input of a program.
pub(super) struct ProgramInput<'a> {
    pub(super) frame: &'a PartFrame,
    pub(super) found: &'a Recognition,
    pub(super) halves: &'a [HalfSpace],
    pub(super) solid: &'a SolidFormula,
    /// Outer side of each entity's surface: 1 if its normal points outwards, −1 otherwise.
    pub(super) outward: &'a [f64],
    /// Middle of the scan in its file's coordinates, and the box in the frame's about it.
    pub(super) middle: Point3,
    pub(super) bounds: Aabb,
    /// Number of decimals of lengths.
    pub(super) digits: usize,
}

/// State of a program that is being written.
struct Writer<'a> {
    part: &'a ProgramInput<'a>,
    dimensions: Dimensions<'a>,
    body: String,
    /// Names of the half spaces' variables.
    names: Vec<String>,
}

impl ProgramInput<'_> {
    /// Returns the program, with a title.
    pub(super) fn program(&self, title: &str) -> String {
        let used = self.used();
        let diagonal = self.bounds.diagonal();
        let mut writer = Writer {
            part: self,
            dimensions: Dimensions::new(self.frame, self.found, &used, self.outward, diagonal),
            body: String::new(),
            names: vec![String::new(); self.halves.len()],
        };
        writer.systems(&used);
        for k in writer.order() {
            writer.half(k);
        }
        writer.solid();
        writer.dimensions.settle_contacts();
        writer.text(title, self.pose(&used, &writer.dimensions.origin))
    }

    /// Returns the annotation of the pose that a fit determines, starting from the pose of the part
    /// in the scan. A body of revolution may turn about its axis, and a ball about its centre.
    fn pose(&self, used: &[bool], origin: &Point3) -> String {
        let frame = self.frame;
        let has_direction = (0..used.len()).any(|i| used[i] && frame.along[i].is_some());
        let motion = match (has_direction, frame.is_first_known) {
            (false, _) => "translate",
            (true, false) => "axis",
            (true, true) => "rigid",
        };
        let columns = frame.rows;
        let place = (0..3).map(|k| {
            let off: f64 = (0..3).map(|j| columns[j][k] * origin[j]).sum();
            self.length(self.middle[k] + off)
        });
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        let turn = rotation::vector_of(&rows).map(|v| format!("{v:?}"));
        let place: Vec<String> = place.collect();
        format!("{motion} at {} turned {}", place.join(" "), turn.join(" "))
    }

    /// Returns a length with the significant decimals.
    fn length(&self, v: f64) -> String {
        let rounded: f64 = format!("{v:.*}", self.digits).parse().unwrap_or(v);
        format!("{rounded:?}")
    }

    /// Returns for each entity whether the solid is written with a half space of it.
    pub(super) fn used(&self) -> Vec<bool> {
        let mut used = vec![false; self.found.entities.len()];
        for k in ones(self.solid.halves()) {
            if let Some(i) = self.halves[k].source.entity() {
                used[i] = true;
            }
        }
        used
    }
}

impl Writer<'_> {
    fn line(&mut self, text: &str) {
        self.body.push_str("  ");
        self.body.push_str(text);
        self.body.push('\n');
    }

    /// Returns the text of a term.
    fn term(&self, term: CoordinateTerm) -> String {
        match term {
            CoordinateTerm::Zero => "0".to_owned(),
            CoordinateTerm::Of(k) => self.dimensions.parameters[k].name.clone(),
        }
    }

    /// Writes the systems of coordinates that are turned relative to the part's own.
    fn systems(&mut self, used: &[bool]) {
        let frame = self.part.frame;
        for (i, system) in frame.systems.iter().enumerate().skip(1) {
            let is_along = |e: usize| used[e] && frame.along[e].is_some_and(|w| w.0 == i);
            if !(0..used.len()).any(is_along) {
                continue;
            }
            let array = array(i);
            let copies: Vec<String> = (1..=3).map(|k| format!("{array}[{k}] = x[{k}];")).collect();
            self.line(&copies.join(" "));
            self.turns(i, system);
        }
    }

    fn turns(&mut self, i: usize, system: &CoordinateSystem) {
        for AxisRotation {
            about,
            angle,
            is_design,
        } in &system.turns
        {
            let by = if *is_design {
                number(*angle)
            } else {
                let name = format!("angle_{i}_{}", AXIS_LETTERS[*about]);
                self.dimensions
                    .add_angle(name.clone(), *angle, "of faces and axes askew");
                name
            };
            let axis = AXIS_LETTERS[*about].to_ascii_uppercase();
            self.line(&format!("ok = hfRotate3D{axis}({}, {by});", array(i)));
        }
    }

    /// Returns the half spaces in the order of the text: planes first, by axis and position.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = ones(self.part.solid.halves()).collect();
        let key = |k: &usize| {
            let half = &self.part.halves[*k];
            let s = &half.surface;
            // Balls follow the tubes that they join.
            let (i, is_corner) = match half.source {
                HalfSpaceSource::Entity(i) => (i, 0),
                HalfSpaceSource::Corner(i) => (i, 1 + usize::from(s.kind == PrimitiveKind::Sphere)),
                _ => return (9, 0, 0, 0.0),
            };
            let (system, axis) = self.part.frame.along[i].unwrap_or((0, 0));
            match s.kind {
                PrimitiveKind::Plane => (0, system, axis, s.place[axis]),
                _ => (
                    1 + is_corner,
                    s.kind as usize,
                    0,
                    -(self.part.found.entities[i].points as f64),
                ),
            }
        };
        order.sort_by(|a, b| {
            let (p, q) = (key(a), key(b));
            (p.0, p.1, p.2)
                .cmp(&(q.0, q.1, q.2))
                .then(p.3.total_cmp(&q.3))
                .then(a.cmp(b))
        });
        order
    }

    /// Writes the statement of a half space, and adds its parameters.
    fn half(&mut self, k: usize) {
        let half = self.part.halves[k].clone();
        let value = match half.source {
            HalfSpaceSource::Entity(i) => self.entity(k, i, &half),
            HalfSpaceSource::Corner(i) => self.corner(k, i, &half),
            HalfSpaceSource::Through(i, axis) => self.through(k, i, axis),
            HalfSpaceSource::Around(i) => self.around(k, i),
            HalfSpaceSource::Side(axis, is_upper) => self.side(k, axis, is_upper),
        };
        let name = self.names[k].clone();
        self.line(&format!("{name} = {value};"));
    }

    fn side(&mut self, k: usize, axis: usize, is_upper: bool) -> String {
        let bounds = &self.part.bounds;
        let place = if is_upper { bounds.hi } else { bounds.lo }[axis];
        let parameter = self.dimensions.unseen(axis, is_upper, place);
        let at = self.term(CoordinateTerm::Of(parameter));
        self.names[k] = format!("{at}_face");
        let x = format!("x[{}]", axis + 1);
        if is_upper {
            format!("{at} - {x}")
        } else {
            format!("{x} - {at}")
        }
    }

    fn through(&mut self, k: usize, i: usize, axis: usize) -> String {
        let base = self.dimensions.name_of(i);
        self.names[k] = format!("{base}_middle_{}", AXIS_LETTERS[axis]);
        let name = format!("{base}_{}", AXIS_LETTERS[axis]);
        let at = self.dimensions.position(i, [0, axis], &name, "");
        let at = self.term(at);
        format!("{at} - x[{}]", axis + 1)
    }

    fn around(&mut self, k: usize, i: usize) -> String {
        let base = self.dimensions.name_of(i);
        self.names[k] = format!("{base}_middle");
        let (center, (system, axis)) = self.center(i, &base);
        let radius = self.circle_radius(i);
        self.line(&center);
        cylinder([system, axis], &radius)
    }

    fn entity(&mut self, k: usize, i: usize, half: &HalfSpace) -> String {
        let s = self.part.frame.surfaces[i];
        if s.kind == PrimitiveKind::Plane {
            return self.plane(k, i, half);
        }
        let base = self.dimensions.name_of(i);
        self.names[k].clone_from(&base);
        let (center, (system, axis)) = self.center(i, &base);
        let letter = AXIS_LETTERS[axis].to_ascii_uppercase();
        let p = array(system);
        match s.kind {
            PrimitiveKind::Cone => self.cone(i, &base, [system, axis]),
            PrimitiveKind::Torus => {
                let major = self.circle_radius(i);
                let minor = self.dimensions.radius(i);
                let minor = self.term(minor);
                self.line(&center);
                format!("hfDTorus{letter}({p}, c, {major}, {minor})")
            }
            kind => {
                let radius = self.dimensions.radius(i);
                let radius = self.term(radius);
                self.line(&center);
                match kind {
                    PrimitiveKind::Sphere => format!("hfSphere({p}, c, {radius})/(2*{radius})"),
                    _ => cylinder([system, axis], &radius),
                }
            }
        }
    }

    /// Returns the text of a corner: between its walls and outside the blend.
    fn corner(&mut self, k: usize, i: usize, half: &HalfSpace) -> String {
        let base = self.dimensions.name_of(i);
        let ball = self.entity(k, i, half);
        let walls: Vec<String> = half.walls.iter().map(|w| self.wall(i, w.role)).collect();
        self.names[k] = format!("{base}_corner");
        format!("({}) \\ ({ball})", walls.join(" & "))
    }

    /// Returns the text of a wall of a corner.
    fn wall(&mut self, i: usize, role: WallRole) -> String {
        match role {
            WallRole::Beyond(of, way, is_up) => {
                let name = format!("{}_{}", self.dimensions.name_of(of), AXIS_LETTERS[way[1]]);
                let at = self.dimensions.position(of, way, &name, "");
                let (x, at) = (format!("{}[{}]", array(way[0]), way[1] + 1), self.term(at));
                match is_up {
                    true => format!("({x} - {at})"),
                    false => format!("({at} - {x})"),
                }
            }
            WallRole::Around(is_outside) => {
                let (system, axis) = self.part.frame.along[i].unwrap_or((0, 2));
                let inside = cylinder([system, axis], &self.circle_radius(i));
                match is_outside {
                    true => format!("(0 - {inside})"),
                    false => inside,
                }
            }
        }
    }

    /// Returns the name of the radius of a torus's circle.
    fn circle_radius(&mut self, i: usize) -> String {
        let radius = self.dimensions.circle_radius(i);
        self.term(CoordinateTerm::Of(radius))
    }

    /// Returns the statements of the centre c of an entity, or of a point of its axis, and its
    /// system and axis.
    fn center(&mut self, i: usize, base: &str) -> (String, (usize, usize)) {
        let s = self.part.frame.surfaces[i];
        let (system, axis) = self.part.frame.along[i].unwrap_or((0, 2));
        let slides = s.kind == PrimitiveKind::Cylinder || s.kind == PrimitiveKind::Cone;
        let mut statements = Vec::new();
        for k in 0..3 {
            let at = if slides && k == axis {
                CoordinateTerm::Zero
            } else {
                let name = format!("{base}_{}", AXIS_LETTERS[k]);
                self.dimensions.position(i, [system, k], &name, "")
            };
            statements.push(format!("c[{}] = {};", k + 1, self.term(at)));
        }
        (statements.join(" "), (system, axis))
    }

    /// Returns the text of a cone by its radius at a height and its half angle.
    fn cone(&mut self, i: usize, base: &str, [system, axis]: [usize; 2]) -> String {
        let s = self.part.frame.surfaces[i];
        let row = self.part.frame.systems[system].rows[axis];
        let apex = dot(row, s.place) - dot(row, self.dimensions.origin);
        let sign = dot(row, s.axis).signum();
        // The middle of its points, about as far from the apex as the solid extends.
        let height = self.height_of(i);
        let radius = height * s.other.tan();
        let at = apex + sign * height;
        let angle = format!("{base}_half_angle");
        self.dimensions
            .add_angle(angle.clone(), s.other, "between axis and side");
        let about = format!("at {} = {}", AXIS_LETTERS[axis], self.part.length(at));
        let radius = self
            .dimensions
            .size(i, radius, &format!("{base}_radius"), &about);
        let radius = self.term(CoordinateTerm::Of(radius));
        let (center, _) = self.center(i, base);
        self.line(&center);
        self.line(&format!("slope = tan({angle});"));
        let (way, letter) = (
            if sign > 0.0 { "-" } else { "+" },
            AXIS_LETTERS[axis].to_ascii_uppercase(),
        );
        let p = array(system);
        self.line(&format!(
            "c[{}] = {} {way} {radius}/slope;",
            axis + 1,
            self.part.length(at)
        ));
        let above = format!("{p}[{0}] - c[{0}]", axis + 1);
        let nappe = if sign > 0.0 {
            above
        } else {
            format!("c[{0}] - {p}[{0}]", axis + 1)
        };
        format!("hfDCone{letter}({p}, c, slope) & ({nappe})")
    }

    /// Returns the mean distance of the points of a cone from its apex, along the axis.
    fn height_of(&self, i: usize) -> f64 {
        let heights = &self.part.found.entities[i].extent;
        ((heights[0] + heights[1]) / 2.0).max(1e-6 * self.part.bounds.diagonal())
    }

    /// Returns the text of a plane, with its position as a parameter.
    fn plane(&mut self, k: usize, i: usize, half: &HalfSpace) -> String {
        let (system, axis) = self.part.frame.along[i].unwrap_or((0, 2));
        let row = self.part.frame.systems[system].rows[axis];
        let is_above = dot(row, half.surface.axis) * half.sign > 0.0;
        let [name, face] = self.plane_names(i, [system, axis], is_above);
        let at = self.dimensions.position(i, [system, axis], &name, "");
        self.names[k] = face;
        let x = format!("{}[{}]", array(system), axis + 1);
        match (at, is_above) {
            (CoordinateTerm::Zero, true) => x,
            (CoordinateTerm::Zero, false) => format!("0 - {x}"),
            (_, true) => format!("{x} - {}", self.term(at)),
            (_, false) => format!("{} - {x}", self.term(at)),
        }
    }

    /// Returns the names of a plane's parameter and variable: the extents of the part for outer
    /// faces, and a thickness for the layer between the lowest face and the next one.
    fn plane_names(&self, i: usize, [system, axis]: [usize; 2], is_above: bool) -> [String; 2] {
        let frame = self.part.frame;
        let row = frame.systems[system].rows[axis];
        let height = |j: usize| dot(row, frame.surfaces[j].place);
        let is_parallel = |j: &usize| {
            frame.along[*j] == Some((system, axis))
                && frame.surfaces[*j].kind == PrimitiveKind::Plane
        };
        let parallel = || (0..frame.surfaces.len()).filter(is_parallel);
        let lower = parallel().filter(|j| height(*j) < height(i)).count();
        let is_lowest = is_above && lower == 0;
        let is_highest = !is_above && parallel().all(|j| height(j) <= height(i));
        let faces_up = |j: usize| dot(row, frame.surfaces[j].axis) * self.part.outward[j] > 0.0;
        let is_wall = system == 0
            && !is_above
            && lower == 1
            && parallel().any(|j| height(j) < height(i) && !faces_up(j));
        let letter = match system {
            0 => AXIS_LETTERS[axis].to_string(),
            _ => format!("{}{system}", AXIS_LETTERS[axis]),
        };
        if system == 0 && is_highest {
            let extent = ["length", "width", "height"][axis];
            return [extent.to_owned(), format!("{letter}_high")];
        }
        if is_lowest {
            return [format!("{letter}_lowest"), format!("{letter}_low")];
        }
        let name = match is_wall {
            true => format!("thickness_{letter}"),
            false => format!("{letter}_{lower}"),
        };
        [name, format!("{letter}_face_{lower}")]
    }

    /// Writes the solid, step by step.
    fn solid(&mut self) {
        let solid = self.part.solid.clone();
        let SolidFormula::All(mut operands) = solid else {
            let text = self.expression(&solid);
            self.line(&format!("my_model = {text};"));
            return;
        };
        let rank = |s: &SolidFormula| match s {
            SolidFormula::Half(_) => 0,
            SolidFormula::All(_) => 1,
            SolidFormula::Any(_) => 2,
            SolidFormula::Not(_) => 3,
        };
        operands.sort_by_key(rank);
        let kept: Vec<SolidFormula> = operands.iter().filter(|s| rank(s) < 3).cloned().collect();
        if kept.is_empty() {
            // No operand is left to subtract the others from.
            let text = self.expression(&SolidFormula::All(operands));
            self.line(&format!("my_model = {text};"));
            return;
        }
        let body = self.expression(&SolidFormula::All(kept));
        self.line(&format!("body = {body};"));
        for operand in operands {
            let SolidFormula::Not(of) = operand else {
                continue;
            };
            let removed = self.expression(&of);
            self.line(&format!("body = body \\ {removed};"));
        }
        self.line("my_model = body;");
    }

    /// Returns the text of set operations in parentheses.
    fn expression(&self, solid: &SolidFormula) -> String {
        match solid {
            SolidFormula::Half(k) => self.names[*k].clone(),
            SolidFormula::Not(of) => format!("(~{})", self.expression(of)),
            SolidFormula::All(of) => self.joined(of, "&"),
            SolidFormula::Any(of) => self.joined(of, "|"),
        }
    }

    fn joined(&self, of: &[SolidFormula], sign: &str) -> String {
        let mut text = String::new();
        let mut ordered: Vec<&SolidFormula> = of.iter().collect();
        ordered.sort_by_key(|s| matches!(s, SolidFormula::Not(_)));
        for operand in ordered {
            let is_taken =
                matches!(operand, SolidFormula::Not(_)) && sign == "&" && !text.is_empty();
            text = match (operand, is_taken) {
                (SolidFormula::Not(of), true) => format!("({text} \\ {})", self.expression(of)),
                _ if text.is_empty() => self.expression(operand),
                _ => format!("({text} {sign} {})", self.expression(operand)),
            };
        }
        text
    }

    /// Returns the text of a linear form of parameters.
    fn sum(&self, of: &LinearForm) -> String {
        let mut text = String::new();
        for (k, factor) in of {
            text += match (text.is_empty(), *factor < 0.0) {
                (true, true) => "0 - ",
                (true, false) => "",
                (false, true) => " - ",
                (false, false) => " + ",
            };
            if factor.abs() != 1.0 {
                let _ = write!(text, "{:?}*", factor.abs());
            }
            text += &self.dimensions.parameters[*k].name;
        }
        if text.is_empty() {
            "0".to_owned()
        } else {
            text
        }
    }

    /// Returns the whole text.
    fn text(&self, title: &str, pose: String) -> String {
        let parameters = &self.dimensions.parameters;
        let mut text = format!("-- @title {title}\n-- @pose {pose}\n");
        for (k, p) in parameters.iter().enumerate() {
            let kind = match p.measure {
                ParameterQuantity::Length => "length",
                ParameterQuantity::Angle => "angle",
            };
            let digits = match p.measure {
                ParameterQuantity::Length => self.part.digits,
                // A millionth of a radian moves nothing visibly.
                ParameterQuantity::Angle => 7,
            };
            let [start, min, max] = [p.start, p.range[0], p.range[1]].map(|v| {
                let rounded = format!("{v:.digits$}");
                rounded.parse::<f64>().unwrap_or(v)
            });
            let about = if p.about.is_empty() {
                String::new()
            } else {
                format!(" : {}", p.about)
            };
            let fixed = if p.is_fixed { " fixed" } else { "" };
            let value = match &p.tie {
                Some(tie) => format!("tie={}", self.sum(tie)),
                None => format!("start={start:?} min={min:?} max={max:?}{fixed}"),
            };
            let _ = writeln!(
                text,
                "-- @param a[{}] {} {kind} {value}{about}",
                k + 1,
                p.name
            );
        }
        let n = parameters.len().max(1);
        let _ = writeln!(text, "my_model(x[3], a[{n}])\n{{");
        let systems = (1..self.part.frame.systems.len()).map(|i| format!(", {}[3]", array(i)));
        let _ = writeln!(text, "  array c[3]{};", systems.collect::<String>());
        for (k, p) in parameters.iter().enumerate() {
            let _ = writeln!(text, "  {} = a[{}];", p.name, k + 1);
        }
        text + &self.body + "}\n"
    }
}

/// Returns the text of the distance inside a cylinder about c along an axis of a system, to first
/// order.
fn cylinder([system, axis]: [usize; 2], radius: &str) -> String {
    let (letter, p) = (AXIS_LETTERS[axis].to_ascii_uppercase(), array(system));
    format!("hfCylinder{letter}({p}, c, {radius})/(2*{radius})")
}

/// Returns the array of a system's coordinates.
fn array(system: usize) -> String {
    match system {
        0 => "x".to_owned(),
        k => format!("q{k}"),
    }
}

/// Returns a number that reads back exactly, in parentheses if it is negative.
fn number(v: f64) -> String {
    if v < 0.0 {
        format!("({v:?})")
    } else {
        format!("{v:?}")
    }
}
