//! Search for solitary curves: in slices of the box, in its faces, and at pinch points.

use super::curves_of;
use super::pinch::{pinches, reduced_minors};
use super::section::general_plane;
use super::solution::SolutionState;
use super::source::{Image, Source, is_same_point, real_image};
use super::trace::{BranchEnd, TracedBranch, trace};
use crate::base::{BasePoint, BinaryForm, Seam, base_points};
use crate::complex::{
    C, MAX_REAL_SINE, Plane, V, along, distance, inner, length, norm, normalised, real_line,
    real_plane, rounded,
};
use crate::finding::Finding;
use crate::map::Map;
use crate::singular::Singular;
use isoform_algebra::Poly;
use isoform_control::{Control, Stopped};

/// Minimum and maximum number of slices of the box in each of three directions.
const SLICES: [usize; 2] = [7, 17];
/// Quaternion of the rotation to the normals of the slices, in general position.
const DIRECTIONS: [f64; 4] = [5.0, 1.0, -2.0, 3.0];
/// Maximum imaginary part of the coordinates (norm 1) of a real point of space: paths end with nine
/// digits, some of which are lost in images.
const MAX_IMAGINARY_PART: f64 = 1e-7;
/// Distances from a pinch point at which an arc is searched for: large enough for the equations to
/// be regular, small enough to exclude other pinch points.
const FROM_PINCH: [f64; 3] = [1e-3, 1e-4, 1e-5];

/// A real point of a section with a non-real parameter.
struct Hit {
    source: usize,
    state: SolutionState,
    /// True if a real parameter reaches the point, too.
    is_covered: bool,
    /// Non-real parameters of the point, with their sources.
    others: Vec<(usize, V)>,
}

/// A parameter of a point, with its source.
pub(super) struct Partner {
    pub(super) source: usize,
    pub(super) p: V,
    pub(super) is_real: bool,
}

/// Real points of the box in a plane.
#[derive(Default)]
struct RealPoints {
    /// Points with a real parameter.
    covered: Vec<Image>,
    /// Other points, with their sources and parameters.
    candidates: Vec<(usize, V, Image)>,
}

/// Sources of a map, and the solitary curves found so far.
pub(super) struct SolitarySearch {
    sources: Vec<Source>,
    tolerance: f64,
    pub(super) arcs: Vec<Vec<[f64; 3]>>,
    pub(super) problems: Vec<Finding>,
}

/// Returns true if a parameter is real.
fn is_real(p: &V) -> bool {
    length(&real_line(p)) < MAX_REAL_SINE
}

/// Returns an orthogonal matrix in general position, so that lines of symmetric surfaces are not
/// parallel to the slices.
fn directions() -> [[f64; 3]; 3] {
    let [w, x, y, z] = DIRECTIONS;
    let n = w * w + x * x + y * y + z * z;
    [
        [
            w * w + x * x - y * y - z * z,
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            w * w - x * x + y * y - z * z,
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            w * w - x * x - y * y + z * z,
        ],
    ]
    .map(|row| row.map(|v| v / n))
}

/// Returns planes that cut the box into slices, one list for each direction, and each face of the
/// box as a list of one.
fn pencils(slices: usize) -> Vec<Vec<Plane>> {
    let diagonal = 3f64.sqrt();
    // The shift keeps all planes off the centre of the box, about which surfaces are symmetric.
    let offset = |i: usize| diagonal * ((2 * i + 1) as f64 / slices as f64 - 1.0 + 0.013);
    let parallel = |normal| (0..slices).map(|i| real_plane(normal, offset(i))).collect();
    let mut pencils: Vec<Vec<Plane>> = directions().into_iter().map(parallel).collect();
    for i in 0..3 {
        let mut normal = [0.0; 3];
        normal[i] = 1.0;
        pencils.extend([-1.0, 1.0].map(|side| vec![real_plane(normal, side)]));
    }
    pencils
}

impl SolitarySearch {
    /// Creates a search with a tolerance in half widths of the box.
    pub(super) fn new(tolerance: f64) -> Self {
        Self {
            sources: Vec::new(),
            tolerance,
            arcs: Vec::new(),
            problems: Vec::new(),
        }
    }
    /// Collects the sources, and computes their sections by a general plane.
    pub(super) fn prepare(
        &mut self,
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let forms = rounded(map.forms().each_ref());
        let curves = curves_of(map, singular);
        self.sources.extend(
            curves.map(|curve| {
                Source::of_curve(&curve.curve, forms.clone(), map.degree(), half_width)
            }),
        );
        for BasePoint { seam, .. } in base_points(map, control)? {
            self.add_seams(&seam, half_width);
        }
        let general = general_plane();
        for source in &mut self.sources {
            if !source.find_section(&general, control)? {
                self.problems.push(Finding::SectionLost);
            }
        }
        Ok(())
    }
    fn add_seams(&mut self, seam: &Seam, half_width: f64) {
        if seam.curve[0].degree() > 0 {
            let forms = seam.curve.each_ref().map(BinaryForm::to_f64);
            self.sources.extend(Source::of_seam(forms, half_width));
        }
        for near in &seam.near {
            self.add_seams(&near.seam, half_width);
        }
    }

    /// Finds all arcs.
    pub(super) fn run(
        &mut self,
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        self.prepare(map, singular, half_width, control)?;
        let hits = self.hits(control)?;
        let mut traced: Vec<TracedBranch> = Vec::new();
        for hit in &hits {
            control.check()?;
            // Several pairs may lead to one curve.
            let mut others = hit.others.iter();
            if !others.any(|(source, p)| is_known(&traced, *source, p)) {
                traced.push(self.both_ways(hit.source, &hit.state));
            }
        }
        self.trace_from_pinches(map, &mut traced, control)?;
        for arc in &traced {
            self.keep_uncovered(arc, &hits, control)?;
        }
        Ok(())
    }

    /// Adds the arcs that begin at real parameters at which the rank of the Jacobian drops, unless
    /// the degree of their equations is too high.
    fn trace_from_pinches(
        &mut self,
        map: &Map,
        traced: &mut Vec<TracedBranch>,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let minors = reduced_minors(map, control)?;
        // Forms of degree 6 have 24 conjugates, which take a fraction of a second.
        if minors.iter().map(Poly::total_degree).max().unwrap_or(0) > 6 {
            return Ok(());
        }
        for pinch in pinches(map, &minors, control)? {
            let p = normalised(&pinch.map(|x| C::new(x.to_f64(), 0.0)));
            for source in 0..self.sources.len() {
                control.check()?;
                let arc = self.arc_at_pinch(source, &p, traced);
                traced.extend(arc);
            }
        }
        Ok(())
    }

    /// Finds the non-real parameters of real points in the box, in all planes.
    fn hits(&self, control: &Control<'_>) -> Result<Vec<Hit>, Stopped> {
        let points: usize = self.sources.iter().map(|source| source.section.len()).sum();
        // About 500 points are tracked from plane to plane in each direction.
        let slices = (500 / points.max(1)).clamp(SLICES[0], SLICES[1]);
        let mut hits = Vec::new();
        for pencil in pencils(slices) {
            let mut before: Vec<Option<Vec<V>>> = self.sources.iter().map(|_| None).collect();
            for (i, plane) in pencil.iter().enumerate() {
                control.check()?;
                let mut found = RealPoints::default();
                for (k, source) in self.sources.iter().enumerate() {
                    let from = before[k].as_deref().map(|points| (&pencil[i - 1], points));
                    let points = source.section_by(plane, from);
                    found.add(k, source, &points);
                    // A chain continues only from complete sections.
                    before[k] = source.is_complete(&points).then_some(points);
                }
                let candidates = found.candidates.iter();
                hits.extend(candidates.filter_map(|(k, p, _)| self.hit(*k, p, &found)));
            }
        }
        Ok(hits)
    }
    /// Returns the hit at a candidate.
    fn hit(&self, source: usize, p: &V, found: &RealPoints) -> Option<Hit> {
        let state = self.sources[source].settle(p)?;
        // Newton's method has converged to another solution.
        if distance(&state.p, p) > 1e-6 {
            return None;
        }
        let is_here = |image: &Image| is_same_point(image, &state.image);
        let others = found.candidates.iter().filter(|other| is_here(&other.2));
        Some(Hit {
            source,
            state,
            is_covered: found.covered.iter().any(is_here),
            others: others.map(|other| (other.0, other.1)).collect(),
        })
    }

    /// Traces a curve, and records a finding if it is lost.
    fn trace(&mut self, source: usize, start: &SolutionState) -> (Vec<SolutionState>, BranchEnd) {
        let (nodes, end) = trace(&self.sources[source], start, self.tolerance);
        if end == BranchEnd::Lost {
            let at = nodes[nodes.len() - 1].point();
            self.problems.push(Finding::SolitaryLost { at });
        }
        (nodes, end)
    }
    fn both_ways(&mut self, source: usize, start: &SolutionState) -> TracedBranch {
        let (ahead, end) = self.trace(source, start);
        if end == BranchEnd::Closed {
            return TracedBranch {
                source,
                nodes: ahead,
            };
        }
        let (mut nodes, _) = self.trace(source, &start.reversed());
        nodes.reverse();
        nodes.extend(&ahead[1..]);
        TracedBranch { source, nodes }
    }

    /// Returns a solution on the arc at a pinch point, and its distance along the tangent.
    fn start_from_pinch(
        &self,
        source: usize,
        p: &V,
        first: &SolutionState,
    ) -> Option<(SolutionState, f64)> {
        FROM_PINCH.into_iter().find_map(|far| {
            let predicted = normalised(&along(p, &first.tangent, far));
            let state = self.sources[source].settle(&predicted)?;
            // Farther from its prediction, the solution lies on another arc.
            let is_near = distance(&state.p, &predicted) < 0.2 * far;
            (is_near && state.is_inside()).then_some((state, far))
        })
    }
    /// Traces the solitary arc at a real parameter at which the rank of the Jacobian drops; `None`
    /// if it is known already.
    fn arc_at_pinch(
        &mut self,
        source: usize,
        p: &V,
        traced: &[TracedBranch],
    ) -> Option<TracedBranch> {
        let first = at_pinch(&self.sources[source], p)?;
        let (mut start, far) = self.start_from_pinch(source, p, &first)?;
        let mut of_source = traced.iter().filter(|t| t.source == source);
        if of_source.any(|t| t.ends_at(p, far) || t.place(&start.p).is_some()) {
            return None;
        }
        let mut partners = self.fibre(&start.image).into_iter();
        if partners.any(|other| is_known(traced, other.source, &other.p)) {
            return None;
        }
        if inner(&first.tangent, &start.tangent).re < 0.0 {
            start = start.reversed();
        }
        let (nodes, _) = self.trace(source, &start);
        Some(TracedBranch {
            source,
            nodes: [first].into_iter().chain(nodes).collect(),
        })
    }

    /// Returns all parameters of a point on double curves.
    pub(super) fn fibre(&self, image: &Image) -> Vec<Partner> {
        let normal = directions()[0];
        let offset = (0..3).map(|i| normal[i] * image[i]).sum::<f64>() / image[3];
        let plane = real_plane(normal, offset);
        let mut found = Vec::new();
        for (k, source) in self.sources.iter().enumerate() {
            for p in source.section_by(&plane, None) {
                let is_here = real_image(&source.eval(&p).g).is_some_and(|(other, imaginary)| {
                    imaginary < MAX_IMAGINARY_PART && is_same_point(&other, image)
                });
                if is_here {
                    found.push(Partner {
                        source: k,
                        p,
                        is_real: is_real(&p),
                    });
                }
            }
        }
        found
    }
    /// Returns true if a real parameter reaches the point, too.
    fn is_covered(&self, image: &Image) -> bool {
        self.fibre(image).iter().any(|found| found.is_real)
    }

    /// Adds the parts of a curve that no real parameters reach.
    fn keep_uncovered(
        &mut self,
        arc: &TracedBranch,
        hits: &[Hit],
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let known = self.known_on(arc, hits);
        let mut part: Vec<[f64; 3]> = Vec::new();
        let mut from = 0;
        for pair in known.windows(2).filter(|pair| pair[0].1 != pair[1].1) {
            let between = (pair[0].0, pair[1].0 + 1);
            let change = self.change(arc, between, pair[0].1, control)?;
            if pair[0].1 {
                part = vec![change.last.point()];
            } else {
                part.extend(
                    arc.nodes[from..=change.before]
                        .iter()
                        .map(SolutionState::point),
                );
                part.push(change.first.point());
                self.arcs.push(std::mem::take(&mut part));
            }
            from = change.before + 1;
        }
        if !known[known.len() - 1].1 {
            part.extend(arc.nodes[from..].iter().map(SolutionState::point));
            self.arcs.push(part);
        }
        Ok(())
    }
    /// Returns nodes of a curve, ascending and at least one, with true if the node is covered.
    fn known_on(&self, arc: &TracedBranch, hits: &[Hit]) -> Vec<(usize, bool)> {
        let of_source = hits.iter().filter(|hit| hit.source == arc.source);
        let mut known: Vec<(usize, bool)> = of_source
            .filter_map(|hit| Some((arc.place(&hit.state.p)?, hit.is_covered)))
            .collect();
        if known.is_empty() {
            let middle = arc.nodes.len() / 2;
            known.push((middle, self.is_covered(&arc.nodes[middle].image)));
        }
        known.sort_unstable();
        known
    }
    /// Finds the point at which a curve starts or ceases to be covered, by bisection between nodes
    /// and then between two solutions. Real parameters appear and vanish there in pairs.
    fn change(
        &self,
        arc: &TracedBranch,
        (mut lo, mut hi): (usize, usize),
        was_covered: bool,
        control: &Control<'_>,
    ) -> Result<Change, Stopped> {
        let is_before = |state: &SolutionState| self.is_covered(&state.image) == was_covered;
        while hi - lo > 1 {
            control.check()?;
            let middle = usize::midpoint(lo, hi);
            if is_before(&arc.nodes[middle]) {
                lo = middle;
            } else {
                hi = middle;
            }
        }
        let (mut first, mut last) = (arc.nodes[lo], arc.nodes[hi]);
        // Thirty bisections determine the parameter to rounding.
        for _ in 0..30 {
            control.check()?;
            let Some(middle) = self.sources[arc.source].settle_between(&first, &last) else {
                break;
            };
            if is_before(&middle) {
                first = middle;
            } else {
                last = middle;
            }
        }
        Ok(Change {
            before: lo,
            first,
            last,
        })
    }
}

/// Point at which a curve starts or ceases to be covered.
struct Change {
    /// Index of the node before it.
    before: usize,
    /// Last solution before it.
    first: SolutionState,
    last: SolutionState,
}

/// Returns true if a parameter of a source lies on a traced curve.
fn is_known(traced: &[TracedBranch], source: usize, p: &V) -> bool {
    let mut of_source = traced.iter().filter(|t| t.source == source);
    of_source.any(|t| t.place(p).is_some())
}

/// Returns a pinch point as a solution, if the curve of a source is smooth there. Along f = 0 the
/// map is even at p, so imaginary steps lead to real points.
fn at_pinch(source: &Source, p: &V) -> Option<SolutionState> {
    let v = source.eval(p);
    let gradient = norm(&v.df);
    // The curve is singular at the pinch point, or does not pass through it.
    if gradient < 1e-12 || v.f.norm() > 1e-6 * gradient {
        return None;
    }
    let along_curve = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| p[i] * v.df[j] - p[j] * v.df[i]);
    let (image, _) = real_image(&v.g)?;
    Some(SolutionState {
        p: *p,
        tangent: normalised(&along_curve).map(|c| c * C::new(0.0, 1.0)),
        image,
    })
}

impl RealPoints {
    /// Adds the points of a section that are real and in the box.
    fn add(&mut self, number: usize, source: &Source, section: &[V]) {
        for p in section {
            let Some((image, imaginary)) = real_image(&source.eval(p).g) else {
                continue;
            };
            // Points up to 1e-9 half widths outside of the box are kept, for rounding.
            let is_outside = (0..3).any(|i| image[i].abs() > (1.0 + 1e-9) * image[3].abs());
            if imaginary > MAX_IMAGINARY_PART || is_outside {
                continue;
            }
            if is_real(p) {
                self.covered.push(image);
            } else {
                self.candidates.push((number, *p, image));
            }
        }
    }
}
