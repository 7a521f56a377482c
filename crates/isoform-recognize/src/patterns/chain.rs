//! Chains of places at equal steps, and their common fit.

use super::sites::{Sites, way};
use crate::chart::{
    DIFFERENCE_STEP, MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind, turned,
};
use crate::compare::{ModelFit, Observation, Whitener, difference, fit_model};
use isoform_geom::{Point3, dot, norm, sub};

/// The circle of a chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circle {
    /// Axis of the circle, as a cylinder of unspecified radius.
    pub(super) line: Primitive,
    /// Angle from a member to the next, anticlockwise about the axis.
    pub(super) angle: f64,
    /// True if members occupy a full turn.
    pub(super) is_closed: bool,
    /// Entity whose axis is that of the circle.
    pub(super) coaxial: Option<usize>,
}

/// Places of equal surfaces at equal steps, or at equal angles round a circle.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) members: Vec<usize>,
    /// Surface at the first member, from the common fit.
    pub(super) first: Primitive,
    /// Vector from a member to the next; of circles from the first to the second.
    pub(super) step: Point3,
    pub(super) circle: Option<Circle>,
    /// Standard deviations: of a row's spacing; of a circle's radius and angle.
    pub(super) deviations: [f64; 2],
    /// Largest distance of a member from its predicted place.
    pub(super) off: f64,
}

/// Parameters of a chain in addition to those of its first surface.
enum ChainParameters {
    /// Coordinates of a row's step along these vectors.
    Step(Vec<Point3>),
    /// Shifts of a circle's axis along two vectors, its tilt if members have no axis, and its angle
    /// if it is open.
    Circle { is_tilted: bool, is_open: bool },
}

impl ChainParameters {
    fn for_chain(first: &Primitive, circle: Option<&Circle>) -> Self {
        let [e, f] = first.frame();
        match (circle, first.kind) {
            (Some(c), kind) => Self::Circle {
                is_tilted: kind == PrimitiveKind::Sphere,
                is_open: !c.is_closed,
            },
            (None, PrimitiveKind::Plane) => Self::Step(vec![first.axis]),
            (None, PrimitiveKind::Cylinder | PrimitiveKind::Cone) => Self::Step(vec![e, f]),
            (None, _) => {
                let unit = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
                Self::Step((0..3).map(unit).collect())
            }
        }
    }

    fn count(&self) -> usize {
        match self {
            Self::Step(along) => along.len(),
            Self::Circle { is_tilted, is_open } => {
                2 + 2 * usize::from(*is_tilted) + usize::from(*is_open)
            }
        }
    }
}

impl Chain {
    /// Builds a row from its first two places, not fitted yet.
    pub(super) fn row(sites: &Sites<'_>, members: Vec<usize>) -> Self {
        Self {
            first: *sites.surface(members[0]),
            step: sites.way(members[0], members[1]),
            members,
            circle: None,
            deviations: [0.0; 2],
            off: 0.0,
        }
    }

    /// Returns the distance from a member to the next.
    pub(super) fn pitch(&self, sites: &Sites<'_>) -> f64 {
        norm(sites.way(self.members[0], self.members[1]))
    }

    /// Returns true if the row is on the line of another row, or all of the circle on another
    /// circle.
    pub(super) fn is_part_of(&self, other: &Self) -> bool {
        let shared = self.members.iter().filter(|m| other.members.contains(m));
        let most = match self.circle {
            // Two rows that have two members in common are on one line.
            None => 2,
            Some(_) => self.members.len(),
        };
        self.circle.is_some() == other.circle.is_some() && shared.count() >= most
    }

    /// Returns the first surface, the step and the circle for common parameters.
    fn moved(&self, own: &ChainParameters, theta: &[f64]) -> (Primitive, Point3, Option<Circle>) {
        let n = self.first.kind.parameters();
        let mut step = [0.0; MAX_PARAMETERS];
        step[..n].copy_from_slice(&theta[..n]);
        let (first, rest) = (self.first.moved(&step), &theta[n..]);
        match (own, self.circle) {
            (ChainParameters::Circle { is_tilted, is_open }, Some(mut circle)) => {
                let tilt = if *is_tilted {
                    [rest[2], rest[3]]
                } else {
                    [0.0; 2]
                };
                circle.line = circle
                    .line
                    .moved(&[tilt[0], tilt[1], rest[0], rest[1], 0.0, 0.0, 0.0]);
                if !is_tilted {
                    let sign = dot(circle.line.axis, first.axis).signum();
                    circle.line.axis = first.axis.map(|x| sign * x);
                }
                if *is_open {
                    circle.angle += rest[rest.len() - 1];
                }
                (first, self.step, Some(circle))
            }
            (ChainParameters::Step(along), _) => {
                let mut way = self.step;
                for (v, t) in along.iter().zip(rest) {
                    (0..3).for_each(|k| way[k] += t * v[k]);
                }
                (first, way, None)
            }
            _ => (first, self.step, None),
        }
    }

    /// Returns the predicted surface of the member `k`.
    fn expected(&self, own: &ChainParameters, theta: &[f64], k: f64) -> Primitive {
        let (first, step, circle) = self.moved(own, theta);
        moved_on(&first, step, circle.as_ref(), k)
    }

    /// Returns the surface predicted `k` steps after the first.
    pub(super) fn next(&self, k: f64) -> Primitive {
        moved_on(&self.first, self.step, self.circle.as_ref(), k)
    }

    fn observations<'a>(
        &'a self,
        sites: &'a Sites<'_>,
        own: &'a ChainParameters,
    ) -> Vec<Observation<'a>> {
        let mut all = Vec::new();
        for (k, place) in self.members.iter().enumerate() {
            for i in sites.entities(*place) {
                let surface = &sites.known[i].surface;
                all.push(Observation {
                    difference: Box::new(move |theta| {
                        difference(surface, &self.expected(own, theta, k as f64))
                    }),
                    whitener: sites.whitener(i),
                });
            }
        }
        if let Some(i) = self.circle.and_then(|c| c.coaxial) {
            let known = &sites.known[i];
            all.push(Observation {
                difference: Box::new(move |theta| self.axis_off(own, theta, &known.surface)),
                whitener: Whitener::from_covariance(
                    &known.covariance,
                    axis_of(known.surface.kind),
                    None,
                ),
            });
        }
        all
    }

    /// Returns the difference of the circle's axis from an entity's, in the parameters of the
    /// entity.
    fn axis_off(&self, own: &ChainParameters, theta: &[f64], surface: &Primitive) -> ParameterRow {
        let Some(circle) = self.moved(own, theta).2 else {
            return [0.0; MAX_PARAMETERS];
        };
        let mut line = circle.line;
        line.kind = PrimitiveKind::Cylinder;
        let axis = Primitive {
            kind: PrimitiveKind::Cylinder,
            ..*surface
        };
        difference(&axis, &line)
    }

    /// Returns the chain with the parameters that fit best, if it is consistent.
    pub(super) fn fitted(&self, sites: &Sites<'_>) -> Option<Self> {
        let own = ChainParameters::for_chain(&self.first, self.circle.as_ref());
        let n = self.first.kind.parameters();
        let free = match self.first.kind {
            // The position of a cone along its axis is ignored.
            PrimitiveKind::Cone => 4,
            _ => MAX_PARAMETERS,
        };
        let all = self.observations(sites, &own);
        let all = all
            .into_iter()
            .map(|o| without(o, free))
            .collect::<Vec<_>>();
        let m = n - usize::from(free < n) + own.count();
        let full = |theta: &[f64]| with(theta, free);
        let fit = fit_model(m, &all).filter(ModelFit::holds)?;
        let theta = full(&fit.theta);
        let (first, step, circle) = self.moved(&own, &theta);
        let mut chain = Self {
            first,
            step,
            circle,
            ..self.clone()
        };
        chain.off = chain.largest(sites);
        chain.deviations = self.deviations(&own, &fit, free);
        Some(chain)
    }

    /// Returns the largest distance of a member from its predicted place.
    fn largest(&self, sites: &Sites<'_>) -> f64 {
        let off = |(k, place): (usize, &usize)| {
            let of = sites.entities(*place);
            let one = |i: &usize| norm(way(&sites.known[*i].surface, &self.next(k as f64)));
            of.iter().map(one).fold(0.0, f64::max)
        };
        self.members.iter().enumerate().map(off).fold(0.0, f64::max)
    }

    /// Returns the standard deviations of spacing, or of radius and angle, from the covariance of
    /// the fit.
    fn deviations(&self, own: &ChainParameters, fit: &ModelFit, free: usize) -> [f64; 2] {
        let m = fit.theta.len();
        let sizes = |theta: &[f64]| -> [f64; 2] {
            let (first, step, circle) = self.moved(own, &with(theta, free));
            match circle {
                None => [norm(step), 0.0],
                Some(c) => [norm(away(&c.line, first.place)), c.angle],
            }
        };
        let mut rows = vec![[0.0; 2]; m];
        for (k, row) in rows.iter_mut().enumerate() {
            let at = |h: f64| {
                let mut theta = fit.theta.clone();
                theta[k] += h;
                sizes(&theta)
            };
            let h = DIFFERENCE_STEP;
            let (plus, minus) = (at(h), at(-h));
            *row = std::array::from_fn(|i| (plus[i] - minus[i]) / (2.0 * h));
        }
        std::array::from_fn(|s| {
            let pairs = (0..m).flat_map(|i| (0..m).map(move |j| (i, j)));
            let sum: f64 = pairs
                .map(|(i, j)| rows[i][s] * fit.covariance[i * m + j] * rows[j][s])
                .sum();
            sum.max(0.0).sqrt()
        })
    }
}

/// Returns the indices of the parameters that determine an entity's axis.
fn axis_of(kind: PrimitiveKind) -> &'static [usize] {
    if kind == PrimitiveKind::Torus {
        &[0, 1]
    } else {
        &[0, 1, 2, 3]
    }
}

/// Returns θ with a 0 inserted for the parameter that is ignored.
fn with(theta: &[f64], free: usize) -> Vec<f64> {
    let mut all = theta.to_vec();
    if free < MAX_PARAMETERS {
        all.insert(free, 0.0);
    }
    all
}

fn without(of: Observation<'_>, free: usize) -> Observation<'_> {
    let difference = of.difference;
    Observation {
        difference: Box::new(move |theta| difference(&with(theta, free))),
        whitener: of.whitener,
    }
}

/// Returns the vector from the projection of a point onto the axis to the point.
fn away(line: &Primitive, p: Point3) -> Point3 {
    sub(p, line.about(p).place)
}

/// Returns the surface moved on by `k` steps.
fn moved_on(first: &Primitive, step: Point3, circle: Option<&Circle>, k: f64) -> Primitive {
    let mut new = *first;
    match circle {
        None => new.place = std::array::from_fn(|i| first.place[i] + k * step[i]),
        Some(c) => {
            let foot = c.line.about(first.place).place;
            let arm = turned(sub(first.place, foot), c.line.axis, k * c.angle);
            new.place = std::array::from_fn(|i| foot[i] + arm[i]);
            if first.kind != PrimitiveKind::Sphere {
                new.axis = turned(first.axis, c.line.axis, k * c.angle);
            }
        }
    }
    new
}
