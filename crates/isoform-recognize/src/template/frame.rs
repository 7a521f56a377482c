//! Frame of a part: its axes are the directions that most of its surface has; each class of
//! parallel entities has one direction.

use crate::chart::{Primitive, PrimitiveKind, frame, unit};
use crate::entity::{Entity, Recognition, RelationKind};
use crate::noise::CHANCE_DEVIATIONS;
use isoform_geom::{Point3, Quadric, UnionFind, cross, dot, sub};
use std::f64::consts::{PI, SQRT_2};

/// Step of the angles that designers choose, in radians: 15°.
const DESIGN_ANGLE_STEP: f64 = PI / 12.0;
/// Minimum standard deviation of an angle (radians): what rounding leaves.
const MIN_ANGLE_DEVIATION: f64 = 1e-6;
/// Maximum standard deviation of an angle that may be taken for a multiple of
/// [`DESIGN_ANGLE_STEP`], in radians: half a degree.
const MAX_ANGLE_DEVIATION: f64 = 0.009;

/// A system of coordinates, turned relative to the part's own.
#[derive(Clone, Debug)]
pub(super) struct CoordinateSystem {
    /// Rotations about axes of the frame (0 to 2), applied one after another.
    pub(super) turns: Vec<AxisRotation>,
    /// Axes of the system in the frame's coordinates.
    pub(super) rows: [Point3; 3],
}

/// A rotation about an axis; `is_design` is true if its angle is one that designers choose.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisRotation {
    pub(super) about: usize,
    pub(super) angle: f64,
    pub(super) is_design: bool,
}

/// The frame, and the entities in it.
pub(super) struct PartFrame {
    /// Axes of the frame in the scan's coordinates.
    pub(super) rows: [Point3; 3],
    /// Surfaces of the entities in the frame's coordinates about the middle of the scan.
    pub(super) surfaces: Vec<Primitive>,
    /// The part's own system of coordinates, and further ones.
    pub(super) systems: Vec<CoordinateSystem>,
    /// System and axis that each entity is along; `None` for entities without a direction.
    pub(super) along: Vec<Option<(usize, usize)>>,
    /// True if the first axis is that of an entity, or points to one away from the main axis.
    pub(super) is_first_known: bool,
}

impl PartFrame {
    /// Maps a point of the scan to the frame's coordinates about `middle`.
    pub(super) fn apply(&self, p: Point3, middle: Point3) -> Point3 {
        let d = sub(p, middle);
        self.rows.map(|r| dot(r, d))
    }

    /// Returns the frame of the entities recognised in a scan with this middle.
    pub(super) fn from_recognition(found: &Recognition, middle: Point3) -> Self {
        let surfaces: Vec<Primitive> = found
            .entities
            .iter()
            .map(|e| Primitive::from_quadric(&e.surface, middle))
            .collect();
        let classes = Classes::new(found, &surfaces);
        let (rows, is_first_known) = classes.axes(&surfaces);
        let turned = |v: Point3| rows.map(|r| dot(r, v));
        let mut new = Self {
            rows,
            surfaces: Vec::new(),
            systems: vec![CoordinateSystem {
                turns: Vec::new(),
                rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            }],
            along: Vec::new(),
            is_first_known,
        };
        let ways: Vec<(usize, usize)> = (0..classes.directions.len())
            .map(|c| new.system_for(&classes, c, turned(classes.directions[c])))
            .collect();
        for (s, class) in surfaces.iter().zip(&classes.of_entity) {
            let way = class.map(|c| ways[c]);
            let mut axis = turned(s.axis);
            if let Some((system, k)) = way {
                let exact = new.systems[system].rows[k];
                axis = exact.map(|x| x * dot(exact, axis).signum());
            }
            new.along.push(way);
            new.surfaces.push(Primitive {
                place: turned(s.place),
                axis,
                ..*s
            });
        }
        new
    }

    /// Returns the system, existing or new, and its axis along which a class lies.
    fn system_for(&mut self, classes: &Classes, class: usize, direction: Point3) -> (usize, usize) {
        let sd = classes.deviations[class].max(MIN_ANGLE_DEVIATION);
        let is_along = |s: &CoordinateSystem, k: usize| {
            let off = dot(cross(s.rows[k], direction), cross(s.rows[k], direction)).sqrt();
            off <= CHANCE_DEVIATIONS * sd && off < MAX_ANGLE_DEVIATION
        };
        for (i, system) in self.systems.iter().enumerate() {
            if let Some(k) = (0..3).find(|k| is_along(system, *k)) {
                return (i, k);
            }
        }
        let is_across =
            |k: &usize| direction[*k].abs() <= (CHANCE_DEVIATIONS * sd).min(MAX_ANGLE_DEVIATION);
        let turn = |about: usize, angle: f64| {
            let round = (angle / DESIGN_ANGLE_STEP).round() * DESIGN_ANGLE_STEP;
            // The angles of a cube's space diagonal with its edges: cut-off corners have them.
            let diagonal = SQRT_2.atan();
            let diagonals = [diagonal, PI - diagonal].map(|a| a.copysign(angle));
            let nearer = |a: f64, b: f64| {
                if (angle - b).abs() < (angle - a).abs() {
                    b
                } else {
                    a
                }
            };
            let design = diagonals.into_iter().fold(round, nearer);
            let is_design =
                (angle - design).abs() <= CHANCE_DEVIATIONS * sd && sd < MAX_ANGLE_DEVIATION;
            AxisRotation {
                about,
                angle: if is_design { design } else { angle },
                is_design,
            }
        };
        let [x, y, z] = direction;
        let (turns, axis) = match [2, 1, 0].into_iter().find(is_across) {
            Some(2) => (vec![turn(2, y.atan2(x))], 0),
            Some(1) => (vec![turn(1, x.atan2(z))], 2),
            Some(_) => (vec![turn(0, (-y).atan2(z))], 2),
            None => {
                let across = x.hypot(y);
                (vec![turn(2, y.atan2(x)), turn(1, across.atan2(z))], 2)
            }
        };
        let rows = turned_axes(&turns);
        self.systems.push(CoordinateSystem { turns, rows });
        (self.systems.len() - 1, axis)
    }
}

/// Returns the axes of the frame after rotations, of which the first is applied last.
pub(super) fn turned_axes(turns: &[AxisRotation]) -> [Point3; 3] {
    let mut rows: [Point3; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for turn in turns.iter().rev() {
        let (sin, cos) = turn.angle.sin_cos();
        let (i, j) = ((turn.about + 1) % 3, (turn.about + 2) % 3);
        for row in &mut rows {
            let (u, v) = (row[i], row[j]);
            (row[i], row[j]) = (cos * u - sin * v, sin * u + cos * v);
        }
    }
    rows
}

/// Classes of entities of one direction.
struct Classes {
    of_entity: Vec<Option<usize>>,
    directions: Vec<Point3>,
    /// Standard deviation of each direction, in radians.
    deviations: Vec<f64>,
    /// Weight of each class: its share of the part.
    weights: Vec<f64>,
    /// Pairs of perpendicular classes.
    across: Vec<(usize, usize)>,
}

impl Classes {
    fn new(found: &Recognition, surfaces: &[Primitive]) -> Self {
        let n = surfaces.len();
        let mut sets = UnionFind::new(n);
        for r in &found.relations {
            let is_one = matches!(
                r.kind,
                RelationKind::Parallel | RelationKind::Coplanar | RelationKind::Coaxial
            );
            if is_one {
                sets.unite(r.entities[0] as u32, r.entities[1] as u32);
            }
        }
        let mut new = Self {
            of_entity: vec![None; n],
            directions: Vec::new(),
            deviations: Vec::new(),
            weights: Vec::new(),
            across: Vec::new(),
        };
        let mut class_of_root = vec![None; n];
        for (i, s) in surfaces.iter().enumerate() {
            if s.kind == PrimitiveKind::Sphere {
                continue;
            }
            let root = sets.root(i as u32) as usize;
            let class = *class_of_root[root].get_or_insert_with(|| {
                new.directions.push(s.axis);
                new.deviations.push(0.0);
                new.weights.push(0.0);
                new.directions.len() - 1
            });
            new.of_entity[i] = Some(class);
        }
        new.average(&found.entities, surfaces);
        for r in found
            .relations
            .iter()
            .filter(|r| r.kind == RelationKind::Perpendicular)
        {
            if let [Some(a), Some(b)] = r.entities.map(|i| new.of_entity[i]) {
                new.across.extend([(a, b), (b, a)]);
            }
        }
        new
    }

    /// Averages directions weighted by their deviations, and sums the weights of the classes.
    fn average(&mut self, entities: &[Entity], surfaces: &[Primitive]) {
        let mut sums = vec![([0.0; 3], 0.0); self.directions.len()];
        for ((e, s), class) in entities.iter().zip(surfaces).zip(&self.of_entity) {
            let Some(c) = *class else { continue };
            let d = e.deviations.direction;
            let sd = dot(d, d).sqrt().clamp(1e-9, 1.0);
            let sign = dot(s.axis, self.directions[c]).signum();
            let weight = 1.0 / (sd * sd);
            for k in 0..3 {
                sums[c].0[k] += weight * sign * s.axis[k];
            }
            sums[c].1 += weight;
            // A part is drawn along its bores.
            let each = if s.kind == PrimitiveKind::Plane {
                1.0
            } else {
                2.0
            };
            self.weights[c] += each * e.points as f64;
        }
        for (c, (sum, weight)) in sums.into_iter().enumerate() {
            self.directions[c] = unit(sum);
            self.deviations[c] = weight.sqrt().recip();
        }
    }

    fn are_across(&self, a: usize, b: usize) -> bool {
        self.across.contains(&(a, b))
            || dot(self.directions[a], self.directions[b]).abs() < MIN_ANGLE_DEVIATION
    }

    /// Returns the class of largest weight among some.
    fn heaviest(&self, of: impl Fn(usize) -> bool) -> Option<usize> {
        let all = (0..self.directions.len()).filter(|c| of(*c));
        all.max_by(|a, b| self.weights[*a].total_cmp(&self.weights[*b]).then(b.cmp(a)))
    }

    /// Returns the axes of the frame, and true if the first is known. The third is along the class
    /// of largest weight, the first along the heaviest class perpendicular to it, otherwise from
    /// the main axis to another one.
    fn axes(&self, surfaces: &[Primitive]) -> ([Point3; 3], bool) {
        let Some(main) = self.heaviest(|_| true) else {
            let plain = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            return (plain, false);
        };
        let z = upwards(self.directions[main]);
        let across = |v: Point3| -> Point3 {
            let h = dot(v, z);
            unit(std::array::from_fn(|k| v[k] - h * z[k]))
        };
        let first = self.heaviest(|c| c != main && self.are_across(main, c));
        let first = first.map(|c| across(upwards(self.directions[c])));
        let x = first.or_else(|| self.off_axis(main, surfaces).map(across));
        let known = x.is_some();
        let x = x.unwrap_or_else(|| frame(z)[0]);
        ([x, cross(z, x), z], known)
    }

    /// Returns the vector from the axis of the entity with the most points along a class to the
    /// first entity clearly away from it.
    fn off_axis(&self, main: usize, surfaces: &[Primitive]) -> Option<Point3> {
        let z = self.directions[main];
        let is_along = |i: &usize| {
            let s = &surfaces[*i];
            s.kind == PrimitiveKind::Sphere
                || s.kind > PrimitiveKind::Sphere && self.of_entity[*i] == Some(main)
        };
        let mut beside = (0..surfaces.len())
            .filter(is_along)
            .map(|i| surfaces[i].place);
        let middle = beside.next()?;
        let size = surfaces.iter().map(|s| s.size).fold(0.0, f64::max);
        let way = |p: Point3| {
            let d = sub(p, middle);
            let h = dot(d, z);
            let v: Point3 = std::array::from_fn(|k| d[k] - h * z[k]);
            // Axes closer to the main axis coincide with it.
            (dot(v, v).sqrt() > 0.02 * size).then_some(v)
        };
        beside.find_map(way)
    }
}

/// Returns the axis along which a vector has its largest component.
pub(super) fn longest(d: Point3) -> usize {
    (0..3).fold(0, |m, k| if d[k].abs() > d[m].abs() { k } else { m })
}

/// Returns the direction or its opposite, such that its largest component is positive.
fn upwards(d: Point3) -> Point3 {
    let k = longest(d);
    if d[k] < 0.0 { d.map(|x| -x) } else { d }
}

impl Primitive {
    /// Returns a recognised surface relative to a point.
    pub(crate) fn from_quadric(quadric: &Quadric, about: Point3) -> Self {
        let of = |kind, place, axis, size, other| Self {
            kind,
            place: sub(place, about),
            axis,
            size,
            other,
        };
        let any = [0.0, 0.0, 1.0];
        match *quadric {
            Quadric::Plane { normal, offset } => {
                let h = offset - dot(normal, about);
                let place = std::array::from_fn(|k| about[k] + h * normal[k]);
                of(PrimitiveKind::Plane, place, normal, 0.0, 0.0)
            }
            Quadric::Sphere { center, radius } => {
                of(PrimitiveKind::Sphere, center, any, radius, 0.0)
            }
            Quadric::Cylinder {
                point,
                axis,
                radius,
            } => of(PrimitiveKind::Cylinder, point, axis, radius, 0.0),
            Quadric::Cone {
                apex,
                axis,
                half_angle,
            } => of(PrimitiveKind::Cone, apex, axis, 0.0, half_angle),
            Quadric::Torus {
                center,
                axis,
                major,
                minor,
            } => of(PrimitiveKind::Torus, center, axis, major, minor),
            Quadric::Other { .. } => unreachable!("entities are of the five kinds"),
        }
    }
}
