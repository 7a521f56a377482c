//! Parameters of a template: positions of its surfaces in its own frame, and their sizes.

use super::frame::PartFrame;
use crate::chart::{Primitive, PrimitiveKind};
use crate::entity::{Blend, Entity, Recognition, RelationKind};
use crate::noise::CHANCE_DEVIATIONS;
use isoform_geom::{UnionFind, cross, dot, norm, sub};

/// Maximum difference of two lengths that are one, as a share of the diagonal: lengths known less
/// well are not tied.
pub(super) const MAX_TIED_DIFFERENCE: f64 = 2e-3;
/// Minimum standard deviation of a length, as a share of the diagonal: what rounding leaves.
const MIN_LENGTH_DEVIATION: f64 = 1e-7;
/// Half the range of a position, as a share of the diagonal, and of a size, as a share of the size.
/// A template whose bounds are wider than some 5 % of its size can converge to a wrong minimum;
/// narrower ones would not contain the next part of the kind.
const HALF_RANGE_SHARES: (f64, f64) = (0.02, 0.1);
/// Minimum of half the range of a parameter, in its standard deviations.
const MIN_RANGE_DEVIATIONS: f64 = 10.0;
/// Half the range of an angle in radians: 2.9°.
const ANGLE_RANGE: f64 = 0.05;

/// The quantity that a parameter measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ParameterQuantity {
    Length,
    Angle,
}

/// A parameter of the template.
#[derive(Clone, Debug)]
pub(super) struct TemplateParameter {
    pub(super) name: String,
    pub(super) measure: ParameterQuantity,
    pub(super) start: f64,
    pub(super) range: [f64; 2],
    pub(super) about: String,
    /// True if the parameter is held because the scan does not determine it.
    pub(super) is_fixed: bool,
    /// Sum of free parameters with factors that determines this one; `None` if it is free.
    pub(super) tie: Option<LinearForm>,
}

/// A linear form: indices of parameters, each with its factor.
pub(super) type LinearForm = Vec<(usize, f64)>;

/// Expression for a coordinate in the program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CoordinateTerm {
    /// The origin of the frame.
    Zero,
    /// The parameter of this index.
    Of(usize),
}

/// A coordinate that several surfaces may share.
struct SharedCoordinate {
    system: usize,
    axis: usize,
    is_plane: bool,
    value: f64,
    sd: f64,
    term: CoordinateTerm,
}

/// A plane that a ball or a tube touches.
pub(super) struct Touch {
    /// Index of the plane's entity.
    pub(super) plane: usize,
    /// 1 if the centre lies above the plane, −1 if below.
    pub(super) side: f64,
    /// |distance of the centre from the plane − radius|.
    off: f64,
    /// Standard deviation of `off`.
    pub(super) sd: f64,
}

/// The parameters defined so far, and the origin of the frame.
pub(super) struct Dimensions<'a> {
    pub(super) frame: &'a PartFrame,
    pub(super) entities: &'a [Entity],
    pub(super) parameters: Vec<TemplateParameter>,
    /// Origin, in the frame's coordinates about the middle of the scan.
    pub(super) origin: [f64; 3],
    shared: Vec<SharedCoordinate>,
    /// Legs of the chamfers so far, with their standard deviations and parameters.
    chamfers: Vec<(f64, f64, usize)>,
    /// Outer side of each entity's surface: 1 if its normal points outwards, −1 otherwise.
    outward: &'a [f64],
    /// Class of each entity among those of equal radius.
    pub(super) radii: Vec<usize>,
    /// Parameter of each of these radii, by the first entity that has it.
    pub(super) radius_of: Vec<Option<usize>>,
    blends: &'a [Blend],
    /// Diagonal of the scan, and noise of its points.
    pub(super) diagonal: f64,
    noise: f64,
}

impl<'a> Dimensions<'a> {
    /// Creates the dimensions without parameters, with the origin at the reference of the used
    /// entities.
    pub(super) fn new(
        frame: &'a PartFrame,
        found: &'a Recognition,
        used: &[bool],
        outward: &'a [f64],
        diagonal: f64,
    ) -> Self {
        let n = found.entities.len();
        let mut new = Self {
            frame,
            entities: &found.entities,
            parameters: Vec::new(),
            origin: [0.0; 3],
            shared: Vec::new(),
            chamfers: Vec::new(),
            outward,
            radii: Vec::new(),
            radius_of: vec![None; n],
            blends: &found.blends,
            diagonal,
            noise: found.noise,
        };
        let mut radii = UnionFind::new(n);
        for r in &found.relations {
            if r.kind == RelationKind::EqualRadius {
                radii.unite(r.entities[0] as u32, r.entities[1] as u32);
            }
        }
        for (k, first) in found.blends.iter().enumerate() {
            for second in &found.blends[k + 1..] {
                if are_alike(found, first, second) {
                    radii.unite(first.entity as u32, second.entity as u32);
                }
            }
        }
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if new.goes_over(i, j) {
                radii.unite(i as u32, j as u32);
            }
        }
        new.radii = (0..n).map(|i| radii.root(i as u32) as usize).collect();
        new.place_origin(used);
        new
    }

    /// Returns true if a sphere or a torus continues smoothly into a cylinder: with equal radii,
    /// about a point of the axis, or about a circle that the axis touches.
    fn goes_over(&self, bent: usize, cylinder: usize) -> bool {
        let [s, c] = [bent, cylinder].map(|i| self.frame.surfaces[i]);
        if c.kind != PrimitiveKind::Cylinder {
            return false;
        }
        let rounding = MIN_LENGTH_DEVIATION * self.diagonal;
        let size_sd = self
            .size_sd(bent)
            .hypot(self.size_sd(cylinder))
            .hypot(rounding);
        let place_sd = self.deviation(bent).hypot(self.deviation(cylinder));
        let is_none = |off: f64, sd: f64| {
            off.abs() <= (CHANCE_DEVIATIONS * sd).min(MAX_TIED_DIFFERENCE * self.diagonal)
        };
        let way = sub(s.place, c.place);
        match s.kind {
            PrimitiveKind::Sphere => {
                is_none(s.size - c.size, size_sd) && is_none(norm(cross(way, c.axis)), place_sd)
            }
            PrimitiveKind::Torus => {
                let across = cross(s.axis, c.axis);
                let sd = place_sd.hypot(size_sd);
                dot(s.axis, c.axis).abs() < MIN_LENGTH_DEVIATION
                    && is_none(s.other - c.size, size_sd)
                    && is_none(dot(way, s.axis), place_sd)
                    && is_none(dot(way, across).abs() - s.size, sd)
            }
            _ => false,
        }
    }

    /// Puts the origin where a designer would: on the main axis if that has more of the surface
    /// than the planes along it, otherwise in the lowest faces.
    fn place_origin(&mut self, used: &[bool]) {
        let surfaces = &self.frame.surfaces;
        let own = |i: usize| self.frame.along[i].filter(|w| w.0 == 0).map(|w| w.1);
        let is_axial = |i: &usize| used[*i] && surfaces[*i].kind > PrimitiveKind::Sphere;
        let along_z = |i: &usize| is_axial(i) && own(*i) == Some(2);
        let points = |i: usize| self.entities[i].points;
        let main = (0..surfaces.len())
            .filter(along_z)
            .max_by_key(|i| (points(*i), usize::MAX - i));
        let coaxial: Vec<usize> = main.map_or_else(Vec::new, |m| {
            let is_coaxial = |i: &usize| {
                let [p, q] = [m, *i].map(|j| surfaces[j].place);
                (p[0] - q[0]).hypot(p[1] - q[1]) <= MAX_TIED_DIFFERENCE * self.diagonal
            };
            let all = (0..surfaces.len()).filter(along_z);
            all.filter(is_coaxial).collect()
        });
        let about_main: usize = coaxial.iter().copied().map(points).sum();
        // The axis that is known best: others differ from it by chance.
        let by_deviation = |i: &usize, j: &usize| self.deviation(*i).total_cmp(&self.deviation(*j));
        let best = coaxial.iter().copied().min_by(by_deviation);
        let is_plane = |i: &usize| used[*i] && surfaces[*i].kind == PrimitiveKind::Plane;
        let planes = |k: usize| {
            (0..surfaces.len())
                .filter(is_plane)
                .filter(move |i| own(*i) == Some(k))
        };
        let beside: usize = planes(0).chain(planes(1)).map(points).sum();
        for k in 0..3 {
            let lowest = planes(k).map(|i| surfaces[i].place[k]).reduce(f64::min);
            let of_axis = best.filter(|_| k < 2).map(|m| self.anchor(m, k));
            let first = if about_main > beside {
                of_axis.or(lowest)
            } else {
                lowest.or(of_axis)
            };
            self.origin[k] = first.or_else(|| self.any_place(k, used)).unwrap_or(0.0);
        }
    }

    /// Returns the coordinate along an axis of the entity that another one is tied to: the plane or
    /// the tube that it touches, otherwise the entity itself.
    fn anchor(&self, entity: usize, k: usize) -> f64 {
        let surfaces = &self.frame.surfaces;
        let touched = self.touched(entity, [0, k]).first().map(|t| t.plane);
        let tied_to = touched.or_else(|| self.tube_of(entity, [0, k]));
        surfaces[tied_to.unwrap_or(entity)].place[k]
    }

    /// Returns the coordinate of the first entity that has a position along an axis.
    fn any_place(&self, k: usize, used: &[bool]) -> Option<f64> {
        let surfaces = &self.frame.surfaces;
        let has_place = |i: &usize| {
            let s = &surfaces[*i];
            let slides = matches!(s.kind, PrimitiveKind::Cylinder) && s.axis[k].abs() == 1.0;
            used[*i] && s.kind != PrimitiveKind::Plane && !slides
        };
        (0..surfaces.len())
            .find(has_place)
            .map(|i| surfaces[i].place[k])
    }

    /// Adds a parameter, and returns its index.
    pub(super) fn add(&mut self, parameter: TemplateParameter) -> usize {
        self.parameters.push(parameter);
        self.parameters.len() - 1
    }

    /// Adds a parameter for an angle.
    pub(super) fn add_angle(&mut self, name: String, start: f64, about: &str) -> usize {
        self.add(TemplateParameter {
            name,
            measure: ParameterQuantity::Angle,
            start,
            range: [start - ANGLE_RANGE, start + ANGLE_RANGE],
            about: about.to_owned(),
            is_fixed: false,
            tie: None,
        })
    }

    /// Returns the coordinate of a surface's reference point in a system, from the origin.
    fn coordinate(&self, system: usize, axis: usize, s: &Primitive) -> f64 {
        let row = self.frame.systems[system].rows[axis];
        dot(row, s.place) - dot(row, self.origin)
    }

    /// Returns the standard deviation of an entity's coordinates, at least that of rounding.
    fn deviation(&self, entity: usize) -> f64 {
        let e = &self.entities[entity];
        let mean = self.noise / (e.points.max(1) as f64).sqrt();
        let [x, y, z] = e.deviations.place;
        let place = x.max(y).max(z);
        let sd = if place > 0.0 && place.is_finite() {
            place
        } else {
            mean
        };
        sd.max(MIN_LENGTH_DEVIATION * self.diagonal)
    }

    /// Returns the coordinate of an entity along an axis of a system: zero, a known parameter, or a
    /// new one of this name.
    pub(super) fn position(
        &mut self,
        entity: usize,
        [system, axis]: [usize; 2],
        name: &str,
        about: &str,
    ) -> CoordinateTerm {
        let surface = self.frame.surfaces[entity];
        let value = self.coordinate(system, axis, &surface);
        let (is_plane, sd) = (surface.kind == PrimitiveKind::Plane, self.deviation(entity));
        let limit = MAX_TIED_DIFFERENCE * self.diagonal;
        let is_one = |v: f64, other: f64| {
            (v - value).abs() <= (CHANCE_DEVIATIONS * sd.hypot(other)).min(limit)
        };
        let fits = |s: &&SharedCoordinate| {
            s.system == system && s.axis == axis && s.is_plane == is_plane && is_one(s.value, s.sd)
        };
        if let Some(shared) = self.shared.iter().find(fits) {
            return shared.term;
        }
        let term = if let Some(tie) = self.contact(entity, [system, axis]) {
            CoordinateTerm::Of(self.add_tied(name, tie, "where it touches"))
        } else if let Some(tie) = self.chamfer(entity, [system, axis]) {
            CoordinateTerm::Of(self.add_tied(name, tie, "of the chamfer"))
        } else if system == 0 && is_one(0.0, sd) {
            CoordinateTerm::Zero
        } else if let Some(tie) = self.mirrored([system, axis], is_plane, value, sd) {
            CoordinateTerm::Of(self.add_tied(name, tie, "opposite"))
        } else {
            CoordinateTerm::Of(self.add_position(value, sd, is_plane, [system, axis], name, about))
        };
        self.shared.push(SharedCoordinate {
            system,
            axis,
            is_plane,
            value: if term == CoordinateTerm::Zero {
                0.0
            } else {
                value
            },
            sd,
            term,
        });
        term
    }

    /// Returns the coordinate of a term as a linear form of free parameters.
    pub(super) fn linear(&self, term: CoordinateTerm) -> LinearForm {
        match term {
            CoordinateTerm::Zero => Vec::new(),
            CoordinateTerm::Of(k) => self.parameters[k].tie.clone().unwrap_or(vec![(k, 1.0)]),
        }
    }

    /// Returns the term of the plane of an entity.
    pub(super) fn plane_term(&self, plane: usize) -> Option<CoordinateTerm> {
        let (system, axis) = self.frame.along[plane]?;
        self.known_term(plane, [system, axis])
    }

    /// Returns the nearest of the known terms to an entity's coordinate along an axis, within the
    /// tolerance.
    pub(super) fn known_term(&self, entity: usize, way: [usize; 2]) -> Option<CoordinateTerm> {
        let surface = &self.frame.surfaces[entity];
        let place = self.coordinate(way[0], way[1], surface);
        let is_plane = surface.kind == PrimitiveKind::Plane;
        let off = |s: &SharedCoordinate| (s.value - place).abs();
        let is_its = |s: &&SharedCoordinate| {
            let is_along = s.is_plane == is_plane && [s.system, s.axis] == way;
            is_along && off(s) <= MAX_TIED_DIFFERENCE * self.diagonal
        };
        let its = self.shared.iter().filter(is_its);
        its.min_by(|a, b| off(a).total_cmp(&off(b))).map(|s| s.term)
    }

    /// Returns the planes across an axis of a system that a ball or a tube touches, the nearest one
    /// first.
    pub(super) fn touched(&self, entity: usize, way: [usize; 2]) -> Vec<Touch> {
        let s = self.frame.surfaces[entity];
        let own = self.frame.along[entity].map(|(system, axis)| [system, axis]);
        let radius = match s.kind {
            PrimitiveKind::Sphere => s.size,
            PrimitiveKind::Cylinder if own.is_some_and(|o| o[0] == way[0] && o[1] != way[1]) => {
                s.size
            }
            PrimitiveKind::Torus if own == Some(way) => s.other,
            _ => return Vec::new(),
        };
        let between = self.blend_of(entity).map_or(&[][..], |b| &b.between);
        let at = self.coordinate(way[0], way[1], &s);
        let limit = MAX_TIED_DIFFERENCE * self.diagonal;
        let touch = |plane: usize| {
            let is_across = self.frame.along[plane] == Some((way[0], way[1]));
            if !is_across || self.frame.surfaces[plane].kind != PrimitiveKind::Plane {
                return None;
            }
            let above = at - self.coordinate(way[0], way[1], &self.frame.surfaces[plane]);
            let sd = self
                .deviation(entity)
                .hypot(self.deviation(plane))
                .hypot(self.size_sd(entity));
            let most = match between.contains(&plane) {
                true => limit,
                false => (CHANCE_DEVIATIONS * sd).min(limit),
            };
            let touch = Touch {
                plane,
                side: above.signum(),
                off: (above.abs() - radius).abs(),
                sd,
            };
            (touch.off <= most).then_some(touch)
        };
        let mut found: Vec<Touch> = (0..self.entities.len()).filter_map(touch).collect();
        found.sort_by(|a, b| a.off.total_cmp(&b.off));
        found
    }

    /// Returns the coordinate of an entity that touches planes across an axis: midway between two,
    /// one radius off one.
    fn contact(&mut self, entity: usize, way: [usize; 2]) -> Option<LinearForm> {
        if let Some([low, high]) = self.sides(entity, way) {
            return Some(sum(&[(0.5, low), (0.5, high)]));
        }
        if let Some(tie) = self.ring_contact(entity, way) {
            return Some(tie);
        }
        let touched = self.touched(entity, way);
        let mut known = touched
            .iter()
            .filter_map(|t| Some((self.plane_term(t.plane)?, t.side)));
        let (plane, sign) = known.next()?;
        let radius = self.radius(entity);
        Some(sum(&[
            (1.0, self.linear(plane)),
            (sign, self.linear(radius)),
        ]))
    }

    /// Returns the coordinate of the centre of a torus that continues into a cylinder: the radius
    /// of its circle off the cylinder's axis.
    fn ring_contact(&mut self, entity: usize, way: [usize; 2]) -> Option<LinearForm> {
        let (surfaces, system) = (&self.frame.surfaces, way[0]);
        let cylinder = self.tube_of(entity, way)?;
        let [at, place] = [entity, cylinder].map(|i| self.coordinate(system, way[1], &surfaces[i]));
        let is_its = |s: &&SharedCoordinate| {
            !s.is_plane
                && [s.system, s.axis] == way
                && (s.value - place).abs() <= MAX_TIED_DIFFERENCE * self.diagonal
        };
        let axis = self.linear(self.shared.iter().find(is_its)?.term);
        let circle = self.circle_radius(entity);
        Some(sum(&[
            (1.0, axis),
            (
                (at - place).signum(),
                self.linear(CoordinateTerm::Of(circle)),
            ),
        ]))
    }

    /// Returns the cylinder that a torus continues into at the end of its circle along an axis.
    fn tube_of(&self, ring: usize, way: [usize; 2]) -> Option<usize> {
        let along = &self.frame.along;
        let (system, own) = along[ring]?;
        let is_ring = self.frame.surfaces[ring].kind == PrimitiveKind::Torus;
        if !is_ring || own == way[1] || system != way[0] {
            return None;
        }
        let third = 3 - own - way[1];
        let is_its = |j: &usize| along[*j] == Some((system, third)) && self.goes_over(ring, *j);
        (0..self.entities.len()).find(is_its)
    }

    /// Returns the parameter of the radius of a torus's circle.
    pub(super) fn circle_radius(&mut self, entity: usize) -> usize {
        let name = format!("{}_circle_radius", self.name_of(entity));
        if let Some(known) = self.parameters.iter().position(|p| p.name == name) {
            return known;
        }
        match self.circle_contact(entity) {
            Some(tie) => self.add_tied(&name, tie, "where the blend touches"),
            None => self.size(entity, self.frame.surfaces[entity].size, &name, ""),
        }
    }

    /// Returns the two planes across an axis between which an entity lies, touching both.
    fn sides(&self, entity: usize, way: [usize; 2]) -> Option<[LinearForm; 2]> {
        let side = |sign: f64| {
            let all = self.touched(entity, way);
            let mut ours = all.iter().filter(|t| t.side == sign);
            ours.find_map(|t| Some(self.linear(self.plane_term(t.plane)?)))
        };
        Some([side(1.0)?, side(-1.0)?])
    }

    /// Returns half the distance of two planes between which an entity lies, or another one of its
    /// radius.
    fn half_width(&self, entity: usize) -> Option<LinearForm> {
        let alike = (0..self.entities.len()).filter(|j| self.radii[*j] == self.radii[entity]);
        let ways = |j: usize| {
            let system = self.frame.along[j].map_or(0, |along| along.0);
            (0..3).find_map(move |axis| self.sides(j, [system, axis]))
        };
        let [low, high] = alike.filter_map(ways).next()?;
        Some(sum(&[(0.5, high), (-0.5, low)]))
    }

    /// Returns the coordinate of a plane that cuts the edge of two planes along axes of the part's
    /// own frame, or the corner of three, by known angles: as a linear form of the planes'
    /// coordinates and the leg of the chamfer, measured along all axes but the first.
    fn chamfer(&mut self, entity: usize, [system, axis]: [usize; 2]) -> Option<LinearForm> {
        let s = self.frame.surfaces[entity];
        let turns = &self.frame.systems[system].turns;
        let is_design = !turns.is_empty() && turns.iter().all(|turn| turn.is_design);
        if s.kind != PrimitiveKind::Plane || !is_design {
            return None;
        }
        let row = self.frame.systems[system].rows[axis];
        let sign = dot(row, s.axis).signum() * self.outward[entity];
        let axes: Vec<usize> = (0..3)
            .filter(|k| row[*k].abs() > MIN_LENGTH_DEVIATION)
            .collect();
        let slope: f64 = axes.iter().skip(1).map(|k| row[*k].abs()).sum();
        if slope == 0.0 {
            return None;
        }
        let at = self.coordinate(system, axis, &s);
        // Planes that face the right way, and whose edge or corner is cut off the least.
        let mut met: Vec<(Vec<usize>, f64)> = vec![(Vec::new(), 0.0)];
        for k in &axes {
            let mut more = Vec::new();
            for (planes, corner) in &met {
                for i in self.faces(*k, sign * row[*k]) {
                    let place = self.coordinate(0, *k, &self.frame.surfaces[i]);
                    more.push(([&planes[..], &[i]].concat(), corner + row[*k] * place));
                }
            }
            met = more;
        }
        let legs = met.into_iter().map(|(planes, corner)| {
            let squares = planes.iter().map(|i| self.deviation(*i).powi(2));
            let sd = squares.sum::<f64>().sqrt().hypot(self.deviation(entity));
            (sign * (corner - at) / slope, sd / slope, planes)
        });
        let (leg, sd, planes) = legs
            .filter(|(leg, sd, _)| *leg > CHANCE_DEVIATIONS * sd)
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut terms = Vec::new();
        for (k, plane) in axes.iter().zip(planes) {
            terms.push((row[*k], self.linear(self.plane_term(plane)?)));
        }
        terms.push((-sign * slope, vec![(self.leg(leg, sd), 1.0)]));
        Some(sum(&terms))
    }

    /// Returns the planes along an axis of the part's own frame that face one way.
    fn faces(&self, axis: usize, way: f64) -> impl Iterator<Item = usize> {
        let is_one = move |i: &usize| {
            let s = &self.frame.surfaces[*i];
            let is_along =
                s.kind == PrimitiveKind::Plane && self.frame.along[*i] == Some((0, axis));
            is_along && s.axis[axis] * self.outward[*i] * way > 0.0
        };
        (0..self.entities.len()).filter(is_one)
    }

    /// Returns the parameter of a chamfer's leg: a known one, or a new one.
    fn leg(&mut self, leg: f64, sd: f64) -> usize {
        let limit = MAX_TIED_DIFFERENCE * self.diagonal;
        let is_one = |(other, its, _): &&(f64, f64, usize)| {
            (other - leg).abs() <= (CHANCE_DEVIATIONS * sd.hypot(*its)).min(limit)
        };
        if let Some(known) = self.chamfers.iter().find(is_one) {
            return known.2;
        }
        let name = self.free("chamfer");
        let parameter = self.add_size(name, leg, sd, "along an edge of the face");
        self.chamfers.push((leg, sd, parameter));
        parameter
    }

    /// Returns the negative of a coordinate that lies as far on the other side of the origin.
    fn mirrored(&self, way: [usize; 2], is_plane: bool, value: f64, sd: f64) -> Option<LinearForm> {
        let limit = MAX_TIED_DIFFERENCE * self.diagonal;
        let is_opposite = |s: &&SharedCoordinate| {
            let off = (s.value + value).abs();
            [s.system, s.axis] == way
                && s.is_plane == is_plane
                && off <= (CHANCE_DEVIATIONS * sd.hypot(s.sd)).min(limit)
        };
        let other = self.shared.iter().find(is_opposite)?.term;
        (other != CoordinateTerm::Zero).then(|| sum(&[(-1.0, self.linear(other))]))
    }

    /// Returns the blend that an entity is; `None` if it is not a blend.
    pub(super) fn blend_of(&self, entity: usize) -> Option<&'a Blend> {
        self.blends.iter().find(|b| b.entity == entity)
    }

    /// Returns the radius of the circle of a torus that touches a coaxial cylinder: the cylinder's
    /// radius plus or minus the tube's.
    fn circle_contact(&mut self, entity: usize) -> Option<LinearForm> {
        let blend = self.blend_of(entity)?;
        let is_cylinder = |j: &&usize| self.frame.surfaces[**j].kind == PrimitiveKind::Cylinder;
        let cylinder = *blend.between.iter().find(is_cylinder)?;
        let own = self.radius_of[self.radii[cylinder]]?;
        let tube = self.radius(entity);
        let is_wider = self.frame.surfaces[entity].size > self.frame.surfaces[cylinder].size;
        let sign = if is_wider { 1.0 } else { -1.0 };
        Some(sum(&[
            (1.0, self.linear(CoordinateTerm::Of(own))),
            (sign, self.linear(tube)),
        ]))
    }

    /// Adds a parameter that is determined by others.
    pub(super) fn add_tied(&mut self, name: &str, tie: LinearForm, about: &str) -> usize {
        let name = self.free(name);
        self.add(TemplateParameter {
            name,
            measure: ParameterQuantity::Length,
            start: 0.0,
            range: [0.0; 2],
            about: about.to_owned(),
            is_fixed: false,
            tie: Some(tie),
        })
    }

    /// Returns the name of an entity in the program: its role, with a number if several entities
    /// have it.
    pub(super) fn name_of(&self, i: usize) -> String {
        let role = self.role(i);
        let alike: Vec<usize> = self.of_role(role).collect();
        match alike.iter().position(|j| *j == i) {
            Some(k) if alike.len() > 1 => format!("{role}_{}", k + 1),
            _ => role.to_owned(),
        }
    }

    fn of_role(&self, role: &str) -> impl Iterator<Item = usize> {
        (0..self.entities.len()).filter(move |j| self.role(*j) == role)
    }

    /// Returns the role of an entity in the terms of designers.
    fn role(&self, i: usize) -> &'static str {
        let is_hollow = self.outward[i] < 0.0;
        match (self.frame.surfaces[i].kind, is_hollow) {
            (_, true) if self.blend_of(i).is_some() => "fillet",
            (_, false) if self.blend_of(i).is_some() => "round",
            (PrimitiveKind::Plane, _) => "face",
            (PrimitiveKind::Sphere, _) => "ball",
            (PrimitiveKind::Cylinder, true) => "hole",
            (PrimitiveKind::Cylinder, false) => "boss",
            (PrimitiveKind::Cone, _) => "cone",
            (PrimitiveKind::Torus, _) => "ring",
        }
    }

    /// Returns the name of the parameter of an entity's radius, and a comment if several entities
    /// have it; the name has no number if all entities of the role have this radius.
    fn radius_name(&self, i: usize) -> (String, String) {
        let role = self.role(i);
        let has_it = |j: &usize| self.radii[*j] == self.radii[i];
        let count = self.of_role(role).filter(has_it).count();
        let is_ring =
            self.frame.surfaces[i].kind == PrimitiveKind::Torus && self.blend_of(i).is_none();
        let tube = if is_ring { "tube_" } else { "" };
        let base = match self.of_role(role).count() == count {
            true => role.to_owned(),
            false => self.name_of(i),
        };
        let plural = if role == "boss" { "es" } else { "s" };
        let about = match count {
            1 => String::new(),
            _ => format!("of {count} {role}{plural}"),
        };
        (format!("{base}_{tube}radius"), about)
    }

    /// Adds a parameter for a position, with a range that keeps parallel faces in their order.
    fn add_position(
        &mut self,
        value: f64,
        sd: f64,
        is_plane: bool,
        [system, axis]: [usize; 2],
        name: &str,
        about: &str,
    ) -> usize {
        let next = (0..self.frame.surfaces.len())
            .filter(|i| {
                let is_parallel = self.frame.along[*i] == Some((system, axis));
                is_plane && is_parallel && self.frame.surfaces[*i].kind == PrimitiveKind::Plane
            })
            .map(|i| (self.coordinate(system, axis, &self.frame.surfaces[i]) - value).abs())
            .filter(|d| *d > MAX_TIED_DIFFERENCE * self.diagonal)
            .fold(f64::INFINITY, f64::min);
        // Parallel faces keep their order.
        let half = (HALF_RANGE_SHARES.0 * self.diagonal)
            .min(0.45 * next)
            .max(MIN_RANGE_DEVIATIONS * sd);
        let name = self.free(name);
        self.add(TemplateParameter {
            name,
            measure: ParameterQuantity::Length,
            start: value,
            range: [value - half, value + half],
            about: about.to_owned(),
            is_fixed: false,
            tie: None,
        })
    }

    /// Returns the radius of an entity: that of entities of equal radius, or a new parameter.
    pub(super) fn radius(&mut self, entity: usize) -> CoordinateTerm {
        let root = self.radii[entity];
        if let Some(parameter) = self.radius_of[root] {
            return CoordinateTerm::Of(parameter);
        }
        let s = self.frame.surfaces[entity];
        let size = if s.kind == PrimitiveKind::Torus {
            s.other
        } else {
            s.size
        };
        let (name, about) = self.radius_name(entity);
        let parameter = match self.half_width(entity) {
            Some(tie) => self.add_tied(&name, tie, &about),
            None => self.size(entity, size, &name, &about),
        };
        self.radius_of[root] = Some(parameter);
        CoordinateTerm::Of(parameter)
    }

    /// Adds a parameter for a size of an entity.
    pub(super) fn size(&mut self, entity: usize, size: f64, name: &str, about: &str) -> usize {
        let name = self.free(name);
        self.add_size(name, size, self.size_sd(entity), about)
    }

    /// Returns the standard deviation of an entity's sizes; 0 if it is unknown.
    fn size_sd(&self, entity: usize) -> f64 {
        let deviations = self.entities[entity].deviations;
        let sd = deviations.size.max(deviations.minor);
        if sd.is_finite() { sd } else { 0.0 }
    }

    fn add_size(&mut self, name: String, size: f64, sd: f64, about: &str) -> usize {
        let half = (HALF_RANGE_SHARES.1 * size).max((MIN_RANGE_DEVIATIONS * sd).min(size / 2.0));
        self.add(TemplateParameter {
            name,
            measure: ParameterQuantity::Length,
            start: size,
            range: [size - half, size + half],
            about: about.to_owned(),
            is_fixed: false,
            tie: None,
        })
    }

    /// Adds a held parameter for a side of the box of the data without a face.
    pub(super) fn unseen(&mut self, axis: usize, is_upper: bool, place: f64) -> usize {
        let (start, side) = (
            place - self.origin[axis],
            if is_upper { "high" } else { "low" },
        );
        let name = self.free(&format!("unseen_{}_{side}", AXIS_LETTERS[axis]));
        self.add(TemplateParameter {
            name,
            measure: ParameterQuantity::Length,
            start,
            range: [
                start - HALF_RANGE_SHARES.0 * self.diagonal,
                start + HALF_RANGE_SHARES.0 * self.diagonal,
            ],
            about: "no face was seen here: the end of the data".to_owned(),
            is_fixed: true,
            tie: None,
        })
    }

    /// Returns an unused name: the given one, or one with a number appended.
    fn free(&self, name: &str) -> String {
        let is_free = |n: &String| self.parameters.iter().all(|p| p.name != *n);
        let numbered = (2..).map(|k| format!("{name}_{k}"));
        std::iter::once(name.to_owned())
            .chain(numbered)
            .find(is_free)
            .expect("there are more numbers than parameters")
    }
}

/// Returns the sum of linear forms, each with a factor.
pub(super) fn sum(of: &[(f64, LinearForm)]) -> LinearForm {
    let mut all: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
    for (factor, form) in of {
        for (k, own) in form {
            *all.entry(*k).or_insert(0.0) += factor * own;
        }
    }
    all.into_iter().filter(|term| term.1 != 0.0).collect()
}

/// Returns true if two blends may have one radius, by the deviations of the radii.
fn are_alike(found: &Recognition, first: &Blend, second: &Blend) -> bool {
    let sd = |b: &Blend| {
        let d = found.entities[b.entity].deviations;
        if d.minor > 0.0 { d.minor } else { d.size }
    };
    let off = (first.radius - second.radius).abs();
    // Radii of blends are known less well than others before they are tied to what they touch.
    off <= (CHANCE_DEVIATIONS * sd(first).hypot(sd(second)))
        .max(MIN_LENGTH_DEVIATION * first.radius)
        && off <= 0.1 * first.radius.min(second.radius)
}

/// Names of the axes.
pub(super) const AXIS_LETTERS: [char; 3] = ['x', 'y', 'z'];
