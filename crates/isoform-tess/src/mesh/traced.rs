//! Gluing along a traced double curve: both parameters of each of its points are known, and no
//! arrangement contains their curves.
//!
//! The arcs become polylines in the unit triangles, with vertices on the sides, on the curves of
//! the box's faces, and at crossings of branches: at a triple point of the surface, three arcs with
//! two parameters each share three parameters.

use super::geometry::{distance, middle};
use super::gluing::{CROWDING_FACTOR, Gluing, Track};
use super::names::{ClassId, Node, key, name_of};
use super::opening::Openings;
use super::places::{distance2, place_beside, place_on, side_of, sides_of};
use super::sides::{Sides, add_place};
use super::stretch::Columns;
use super::triangles::COINCIDENCE_DISTANCE;
use crate::finding::{Finding, Phase};
use crate::pairs::{ArcPlace, Arcs, Pairs};
use crate::surface::DoubleArc;
use isoform_control::Stopped;
use isoform_geom::dot;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// A traced double curve, in half widths of the box.
pub(crate) struct TracedCurve {
    pub(crate) pairs: Pairs,
    pub(crate) arcs: Arcs,
}

/// Distance, in the parameters of unit triangles, up to which places of different arcs are one
/// vertex: Newton's method leaves a difference in their last digits.
const SAME_PLACE_DISTANCE: f64 = 1e-9;

/// Fraction of a chord next to its end in which a crossing replaces the end: otherwise two vertices
/// there would nearly coincide.
const END_FRACTION: f64 = 0.1;

/// Half the step of difference quotients along an arc, in chords: slopes need few digits for
/// Newton's method to converge.
const DIFFERENCE_STEP: f64 = 1e-4;
/// Range of the chord's parameter within which an arc is followed towards a crossing; beyond it
/// Newton's method diverges.
const BESIDE_CHORD: RangeInclusive<f64> = -0.5..=1.5;
/// Range of the parameters of two segments that cross, with an allowance for rounding at their
/// ends.
const ON_SEGMENT: RangeInclusive<f64> = -1e-9..=1.0 + 1e-9;

/// A place on an arc, as two vertices.
#[derive(Clone, Copy, Debug)]
struct ArcVertex {
    place: ArcPlace,
    /// Homogeneous coordinates (s : t : w) of both parameters.
    parameters: [[f64; 3]; 2],
    /// Faces of the box on which it lies, as bits.
    faces: u8,
    /// True if arcs cross here.
    is_crossing: bool,
    class: ClassId,
}

/// An arc of the arrangement in a unit triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct ArcId {
    /// Unit triangle.
    q: usize,
    slab: usize,
    /// Place in the slab, from bottom to top.
    place: usize,
}

/// A chord of an arc in a unit triangle.
#[derive(Clone, Copy, Debug)]
struct Chord {
    /// Unit triangle.
    q: usize,
    /// Index of the arc.
    run: usize,
    /// Index of its first vertex on the arc.
    at: usize,
    /// Index of its parameter: 0 or 1.
    which: usize,
    /// Ends in the unit triangle.
    ends: [[f64; 2]; 2],
}

impl Chord {
    /// Returns the smaller coordinate i of its ends.
    #[inline]
    fn low(&self, i: usize) -> f64 {
        self.ends[0][i].min(self.ends[1][i])
    }
    /// Returns the larger coordinate i of its ends.
    #[inline]
    fn high(&self, i: usize) -> f64 {
        self.ends[0][i].max(self.ends[1][i])
    }
    /// Returns true if two chords cross elsewhere than in a common end.
    fn crosses(&self, other: &Self) -> bool {
        let is_shared = |x: &[f64; 2]| {
            other
                .ends
                .iter()
                .any(|y| distance2(*x, *y) < 10.0 * SAME_PLACE_DISTANCE)
        };
        !self.ends.iter().any(is_shared) && crossing(self.ends, other.ends).is_some()
    }
}

/// Returns all chords of arcs that lie in a single unit triangle, for both of their parameters.
fn chords_of(runs: &[Vec<ArcVertex>]) -> Vec<Chord> {
    let mut chords = Vec::new();
    for (run, spots) in runs.iter().enumerate() {
        for (at, w) in spots.windows(2).enumerate() {
            let chord = |which: usize| {
                let (q, ends) = common(w[0].parameters[which], w[1].parameters[which])?;
                Some(Chord {
                    q,
                    run,
                    at,
                    which,
                    ends,
                })
            };
            chords.extend([0, 1].into_iter().filter_map(chord));
        }
    }
    chords
}

/// A piece of an arc between two successive vertices, with one of its parameters.
struct ArcPiece<'a> {
    pairs: &'a Pairs,
    ends: [ArcVertex; 2],
    /// Index of the parameter: 0 or 1.
    which: usize,
    /// Unit triangle in whose coordinates the parameter is given.
    q: usize,
}

impl ArcPiece<'_> {
    /// Returns the vertex of the arc next to a fraction of its chord.
    fn spot(&self, t: f64) -> Option<ArcVertex> {
        let [from, to] = &self.ends;
        ArcVertex::new(self.pairs.part(&from.place, &to.place, t)?)
    }
    /// Returns the parameter of a vertex.
    fn parameter(&self, spot: &ArcVertex) -> [f64; 2] {
        place_beside(self.q, spot.parameters[self.which])
    }
    /// Returns the derivative of the parameter by the fraction of the chord, as a difference
    /// quotient.
    fn slope(&self, t: f64) -> Option<[f64; 2]> {
        let [a, b] = [-DIFFERENCE_STEP, DIFFERENCE_STEP].map(|d| self.spot(t + d));
        let (a, b) = (self.parameter(&a?), self.parameter(&b?));
        Some([0, 1].map(|i| (b[i] - a[i]) / (2.0 * DIFFERENCE_STEP)))
    }
}

/// Returns the first parameter, and the coordinate of it, that changes its sign between two
/// vertices.
fn side_between(a: &ArcVertex, b: &ArcVertex) -> Option<(usize, usize)> {
    let mut sides = (0..2).flat_map(|which| {
        crossed(a.parameters[which], b.parameters[which]).map(move |k| (which, k))
    });
    sides.next()
}

/// Returns the vertex between two others at which coordinate k of a parameter is 0.
fn spot_on_side(
    pairs: &Pairs,
    a: &ArcVertex,
    b: &ArcVertex,
    (which, k): (usize, usize),
) -> Option<ArcVertex> {
    let place = pairs.on_side(&a.place, &b.place, which, k)?;
    let mut spot = ArcVertex::new(place)?;
    spot.parameters[which][k] = 0.0;
    Some(spot)
}

/// Inserts a vertex into a drawn line, or moves an existing one there if it is near. Returns false
/// if the vertex would be before or after the line, or would replace its first or last vertex.
fn put_on_line(line: &mut Vec<[f64; 2]>, at: [f64; 2]) -> bool {
    let k = line.partition_point(|x| x[0] < at[0]);
    if k == 0 || k == line.len() {
        return false;
    }
    // A nearer vertex of the line is moved to the end of the arc.
    let near = |k: &usize| distance2(line[*k], at) < 1e-8;
    match [k - 1, k].into_iter().find(near) {
        Some(0) => return false,
        Some(k) if k + 1 == line.len() => return false,
        Some(k) => line[k] = at,
        None => line.insert(k, at),
    }
    true
}

impl ArcVertex {
    /// Creates the vertex of a place; `None` if its parameters are not real.
    fn new(place: ArcPlace) -> Option<Self> {
        let image = place.image();
        let faces = (0..3)
            .filter(|&i| image[i].abs() == image[3].abs())
            .map(|i| 2 * i + usize::from(image[i] * image[3] > 0.0))
            .fold(0, |bits, face| bits | 1 << face);
        // A parameter on a side of the unit triangles up to rounding is moved onto the side.
        let snapped = |p: [f64; 3]| {
            let size = dot(p, p).sqrt();
            // Such coordinates are 0 up to rounding.
            p.map(|x| if x.abs() < 1e-10 * size { 0.0 } else { x })
        };
        Some(Self {
            place,
            parameters: place.real()?.map(snapped),
            faces,
            is_crossing: false,
            class: ClassId(0),
        })
    }
    /// Returns true if the vertex has to stay: on a face of the box or a side of the unit
    /// triangles, at crossings of arcs, and at pinch points.
    fn is_fixed(&self) -> bool {
        self.faces > 0
            || self.is_crossing
            || self.place.is_pinch()
            || self.parameters.iter().flatten().any(|x| *x == 0.0)
    }
    /// Returns the vertex of one of the parameters, at a place of a unit triangle.
    fn node(&self, which: usize, q: usize, at: [f64; 2]) -> Node {
        Node {
            name: name_of(q, self.parameters[which], at),
            ..Node::inner(at, self.faces)
        }
    }
}

/// Inserts a vertex into an arc at a fraction of a chord, replacing an end that is near, unless the
/// arc has such a vertex already.
fn put(run: &mut Vec<ArcVertex>, at: usize, t: f64, spot: ArcVertex) {
    let is_there = |s: &ArcVertex| s.place.distance(&spot.place) < SAME_PLACE_DISTANCE;
    let around = at.saturating_sub(1)..(at + 3).min(run.len());
    if run[around].iter().any(is_there) {
        return;
    }
    let is_free = |k: usize| k > 0 && k + 1 < run.len() && !run[k].is_fixed();
    if t < END_FRACTION && is_free(at) {
        run[at] = spot;
    } else if t > 1.0 - END_FRACTION && is_free(at + 1) {
        run[at + 1] = spot;
    } else if (0.0..1.0).contains(&t) {
        run.insert(at + 1, spot);
    }
}

/// A parameter of an arc vertex in a unit triangle.
struct UnitArcVertex {
    q: usize,
    at: [f64; 2],
    spot: usize,
    which: usize,
}

/// Returns both parameters of all vertices, in all unit triangles that contain them, from left to
/// right.
fn vertices_of(spots: &[&mut ArcVertex]) -> Vec<UnitArcVertex> {
    let mut vertices: Vec<UnitArcVertex> = Vec::new();
    for (spot, s) in spots.iter().enumerate() {
        for which in 0..2 {
            let vertex = |q: usize| {
                let at = place_on(q, s.parameters[which])?;
                Some(UnitArcVertex { q, at, spot, which })
            };
            vertices.extend((0..4).filter_map(vertex));
        }
    }
    vertices.sort_by(|a, b| a.q.cmp(&b.q).then(a.at[0].total_cmp(&b.at[0])));
    vertices
}

/// Unites vertices with a common parameter, and makes it identical: returns a forest in which each
/// vertex is a root, or has a smaller index as its parent.
fn unite_near(spots: &mut [&mut ArcVertex]) -> Vec<usize> {
    let vertices = vertices_of(spots);
    let mut up: Vec<usize> = (0..spots.len()).collect();
    for (i, a) in vertices.iter().enumerate() {
        let near = vertices[i + 1..]
            .iter()
            .take_while(|b| b.q == a.q && b.at[0] - a.at[0] < SAME_PLACE_DISTANCE);
        for b in near.filter(|b| distance2(a.at, b.at) < SAME_PLACE_DISTANCE) {
            let [x, y] = [a.spot, b.spot].map(|k| root(&up, k));
            up[x.max(y)] = x.min(y);
            spots[b.spot].parameters[b.which] = spots[a.spot].parameters[a.which];
        }
    }
    up
}

/// Returns the root of an element of a forest, given by parents.
fn root(up: &[usize], mut k: usize) -> usize {
    while up[k] != k {
        k = up[k];
    }
    k
}

/// Returns the unit triangle that contains two parameters, and their places in it.
fn common(a: [f64; 3], b: [f64; 3]) -> Option<(usize, [[f64; 2]; 2])> {
    (0..4).find_map(|q| Some((q, [place_on(q, a)?, place_on(q, b)?])))
}

/// Iterates over the coordinates that change their sign from one parameter to the next, up to a
/// common sign.
fn crossed(a: [f64; 3], b: [f64; 3]) -> impl Iterator<Item = usize> {
    let sign = if dot(a, b) < 0.0 { -1.0 } else { 1.0 };
    (0..3).filter(move |&k| a[k] * b[k] * sign < 0.0)
}

/// Solves t d − s e = c for t and s, by Cramer's rule.
fn meeting(d: [f64; 2], e: [f64; 2], c: [f64; 2]) -> [f64; 2] {
    let det = d[0] * e[1] - d[1] * e[0];
    [
        (c[0] * e[1] - c[1] * e[0]) / det,
        (c[0] * d[1] - c[1] * d[0]) / det,
    ]
}

/// Returns the crossing of two segments, as fractions of both; `None` if they do not cross, or are
/// parallel.
fn crossing(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let [d, e] = [a, b].map(|x| [x[1][0] - x[0][0], x[1][1] - x[0][1]]);
    let [t, s] = meeting(d, e, [b[0][0] - a[0][0], b[0][1] - a[0][1]]);
    (ON_SEGMENT.contains(&t) && ON_SEGMENT.contains(&s)).then_some([t, s])
}

impl Openings<'_> {
    /// Returns the vertices of all arcs that can be drawn, and the number of the others.
    fn runs(&self, traced: &TracedCurve) -> Result<(Vec<Vec<ArcVertex>>, usize), Stopped> {
        let mut runs: Vec<Vec<ArcVertex>> = Vec::new();
        let mut failed = 0;
        for part in traced.arcs.real_parts() {
            match self.refined(&traced.pairs, &part) {
                Some(run) => runs.push(run),
                None => failed += 1,
            }
            self.atlas.control.check()?;
        }
        Ok((runs, failed))
    }
    /// Computes the vertices of a traced double curve and their partners, and adds places to the
    /// sides of the unit triangles that it crosses.
    pub(super) fn glue_traced(&self, traced: &TracedCurve, sides: &mut Sides) -> Gluing {
        let mut gluing = Gluing::default();
        let Ok((mut runs, mut failed)) = self.runs(traced) else {
            gluing.is_stopped = true;
            gluing.findings.push(Finding::Stopped(Phase::Partners));
            return gluing;
        };
        failed += self.cross(&traced.pairs, &mut runs);
        self.classify(&mut gluing, &mut runs);
        for run in &runs {
            failed += self.put_run(&mut gluing, run, sides);
            let points = run.iter().map(|s| gluing.image(s.class)).collect();
            gluing.arcs.push(DoubleArc { points, sheets: 2 });
        }
        failed += self.put_ends(&mut gluing, &runs);
        if failed > 0 {
            gluing.findings.push(Finding::DoubleCurveNotDrawn(failed));
        }
        gluing
    }

    /// Subdivides an arc until both chords are near enough to the surface, with vertices on the
    /// sides of the unit triangles.
    fn refined(&self, pairs: &Pairs, part: &[ArcPlace]) -> Option<Vec<ArcVertex>> {
        let mut run = vec![ArcVertex::new(part[0])?];
        for w in part.windows(2) {
            self.halve(
                pairs,
                [ArcVertex::new(w[0])?, ArcVertex::new(w[1])?],
                &mut run,
            )?;
        }
        self.thin(&mut run);
        Some(run)
    }
    /// Adds the vertices after the first of two places, up to the second one, with fine chords
    /// between them; `None` if they are too many.
    fn halve(
        &self,
        pairs: &Pairs,
        [from, to]: [ArcVertex; 2],
        run: &mut Vec<ArcVertex>,
    ) -> Option<()> {
        let mut stack = vec![(from, to, 0)];
        while let Some((a, b, depth)) = stack.pop() {
            // An arc that needs more places or bisections is not drawn.
            if run.len() > (1 << 14) || depth > 30 || self.atlas.control.is_stopped() {
                return None;
            }
            let side = side_between(&a, &b);
            if side.is_none() && self.is_chord_fine(pairs, &a, &b) {
                run.push(b);
                continue;
            }
            let on_side = side.and_then(|side| spot_on_side(pairs, &a, &b, side));
            let spot = match on_side {
                Some(spot) => spot,
                None => ArcVertex::new(pairs.part(&a.place, &b.place, 0.5)?)?,
            };
            stack.push((spot, b, depth + 1));
            stack.push((a, spot, depth + 1));
        }
        Some(())
    }

    /// Removes vertices whose images coincide: at singular points the map may be flat.
    fn thin(&self, run: &mut Vec<ArcVertex>) {
        let image = |s: &ArcVertex| s.place.point().map(|x| x * self.atlas.half_width);
        let is_near = |a: &ArcVertex, b: &ArcVertex| {
            distance(image(a), image(b))
                < CROWDING_FACTOR * COINCIDENCE_DISTANCE * self.atlas.half_width
        };
        let mut k = 1;
        while k + 1 < run.len() {
            let is_upon = is_near(&run[k - 1], &run[k]) || is_near(&run[k], &run[k + 1]);
            if is_upon && !run[k].is_fixed() {
                run.remove(k);
            } else {
                k += 1;
            }
        }
    }

    /// Returns true if straight segments, also in the parameters, may replace an arc between two
    /// places.
    fn is_chord_fine(&self, pairs: &Pairs, a: &ArcVertex, b: &ArcVertex) -> bool {
        let scale = |p: &ArcPlace| p.point().map(|x| x * self.atlas.half_width);
        let Some(m) = pairs.part(&a.place, &b.place, 0.5) else {
            // Next to a singular end no place can be computed in between.
            let ends = [a, b].map(|s| scale(&s.place));
            // Next to a singular end, a short chord may have no place between its ends.
            return distance(ends[0], ends[1]) < 0.1 * self.atlas.tolerance_at(ends[0]);
        };
        let (p, m, r) = (scale(&a.place), scale(&m), scale(&b.place));
        let straight = middle(p, r);
        let tolerance = 0.3 * self.atlas.tolerance_at(m);
        let is_near = |which: usize| {
            common(a.parameters[which], b.parameters[which]).is_some_and(|(q, [x, y])| {
                let chord = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
                distance(self.atlas.charts[q].at(chord), straight) <= tolerance
                    && self.atlas.charts[q].keeps_sign([x, y, x], 0)
            })
        };
        distance(p, r) <= self.atlas.options.longest
            && distance(m, straight) <= tolerance
            && is_near(0)
            && is_near(1)
    }

    /// Inserts a vertex into both arcs at every crossing of chords, and returns the number of
    /// failures.
    fn cross(&self, pairs: &Pairs, runs: &mut [Vec<ArcVertex>]) -> usize {
        let mut failed = 0;
        // A vertex that is inserted moves chords, which may then cross elsewhere.
        for _ in 0..8 {
            let mut found: Vec<(Chord, f64, ArcVertex)> = Vec::new();
            for [a, b] in self.crossings(runs) {
                match self.triple(pairs, runs, &a, &b) {
                    Some([x, y]) => found.extend([(a, x.0, x.1), (b, y.0, y.1)]),
                    None => failed += 1,
                }
            }
            if found.is_empty() || failed > 0 {
                break;
            }
            // An insertion shifts the vertices after it, so the last ones come first.
            found.sort_by(|x, y| {
                let of = |f: &(Chord, f64, ArcVertex)| (f.0.run, f.0.at);
                of(y).cmp(&of(x)).then(y.1.total_cmp(&x.1))
            });
            for (chord, t, spot) in found {
                put(&mut runs[chord.run], chord.at, t, spot);
            }
        }
        failed + self.crossings(runs).len()
    }

    /// Returns the pairs of chords that cross elsewhere than in common vertices.
    fn crossings(&self, runs: &[Vec<ArcVertex>]) -> Vec<[Chord; 2]> {
        let mut chords = chords_of(runs);
        chords.sort_by(|a, b| a.q.cmp(&b.q).then(a.low(0).total_cmp(&b.low(0))));
        let mut found = Vec::new();
        for (k, a) in chords.iter().enumerate() {
            let after = chords[k + 1..]
                .iter()
                .take_while(|b| b.q == a.q && b.low(0) <= a.high(0));
            let beside = after.filter(|b| b.low(1) <= a.high(1) && a.low(1) <= b.high(1));
            found.extend(beside.filter(|b| a.crosses(b)).map(|b| [*a, *b]));
        }
        found
    }

    /// Returns the vertices of two arcs at their common parameter, near the crossing of two of
    /// their chords.
    fn triple(
        &self,
        pairs: &Pairs,
        runs: &[Vec<ArcVertex>],
        a: &Chord,
        b: &Chord,
    ) -> Option<[(f64, ArcVertex); 2]> {
        let mut parts = crossing(a.ends, b.ends)?;
        let arcs = [a, b].map(|chord| ArcPiece {
            pairs,
            ends: [0, 1].map(|i| runs[chord.run][chord.at + i]),
            which: chord.which,
            q: a.q,
        });
        // At most twenty Newton steps.
        for _ in 0..20 {
            let spots = [arcs[0].spot(parts[0])?, arcs[1].spot(parts[1])?];
            let [x, y] = [0, 1].map(|k| arcs[k].parameter(&spots[k]));
            // The arcs meet up to rounding.
            if distance2(x, y) < 1e-13 {
                let [x, mut y] = spots.map(|s| ArcVertex {
                    is_crossing: true,
                    ..s
                });
                y.parameters[b.which] = x.parameters[a.which];
                return Some([(parts[0], x), (parts[1], y)]);
            }
            let (along_a, along_b) = (arcs[0].slope(parts[0])?, arcs[1].slope(parts[1])?);
            let step = meeting(along_a, along_b, [y[0] - x[0], y[1] - x[1]]);
            for k in 0..2 {
                parts[k] += step[k];
                if !BESIDE_CHORD.contains(&parts[k]) {
                    return None;
                }
            }
        }
        None
    }

    /// Gives one class to vertices with a common parameter, and makes that identical.
    fn classify(&self, gluing: &mut Gluing, runs: &mut [Vec<ArcVertex>]) {
        let mut spots: Vec<&mut ArcVertex> = runs.iter_mut().flatten().collect();
        let up = unite_near(&mut spots);
        let mut number: BTreeMap<usize, ClassId> = BTreeMap::new();
        for (k, spot) in spots.iter_mut().enumerate() {
            let image = spot.place.point().map(|x| x * self.atlas.half_width);
            spot.class = *number
                .entry(root(&up, k))
                .or_insert_with(|| gluing.add_class(image, spot.parameters[0]));
        }
    }

    /// Adds the chords of an arc to the unit triangles, and places to their sides; returns the
    /// number of failures.
    fn put_run(&self, gluing: &mut Gluing, run: &[ArcVertex], sides: &mut Sides) -> usize {
        let mut failed = 0;
        for which in 0..2 {
            for spot in run {
                let p = spot.parameters[which];
                for q in 0..4 {
                    let Some(at) = place_on(q, p) else { continue };
                    gluing.name_class(key(name_of(q, p, at), q, at), spot.class);
                    if let Some((side, x)) = side_of(p, at) {
                        add_place(sides, sides_of(q)[side], x);
                    }
                }
            }
            for w in run.windows(2) {
                match common(w[0].parameters[which], w[1].parameters[which]) {
                    Some((q, ends)) => {
                        let node = |k: usize| w[k].node(which, q, ends[k]);
                        gluing.chords.push((q, [node(0), node(1)]));
                    }
                    None => failed += 1,
                }
            }
        }
        failed
    }
    /// Returns the curve of the box's faces, as an arc in a unit triangle, on which a parameter of
    /// an end lies, and its place there; `None` on a side, where it is a point of a wall already.
    fn end_on_arc(&self, end: &ArcVertex, which: usize) -> Option<(ArcId, [f64; 2])> {
        let p = end.parameters[which];
        let on_arc = |q: usize| {
            let at = place_on(q, p)?;
            Some((self.arc_at(q, at, end.faces)?, at))
        };
        let is_on_side = p.contains(&0.0);
        (0..4).filter(|_| !is_on_side).find_map(on_arc)
    }
    /// Inserts vertices into the curves of the box's faces where arcs end on them; returns the
    /// number of failures.
    fn put_ends(&self, gluing: &mut Gluing, runs: &[Vec<ArcVertex>]) -> usize {
        let mut failed = 0;
        let mut on_arcs: BTreeMap<ArcId, Vec<[f64; 2]>> = BTreeMap::new();
        let ends = runs.iter().flatten().filter(|s| s.faces > 0);
        for (spot, which) in ends.flat_map(|s| [(s, 0), (s, 1)]) {
            match self.end_on_arc(spot, which) {
                Some((arc, at)) => on_arcs.entry(arc).or_default().push(at),
                None => failed += 1,
            }
        }
        for (arc, places) in on_arcs {
            let mut line = self.line_of_arc(arc);
            let put = places.into_iter().map(|at| put_on_line(&mut line, at));
            failed += put.filter(|is_put| !is_put).count();
            gluing.set_line(Track::Arc(arc.q, arc.slab, arc.place), line);
        }
        failed
    }

    /// Returns the polyline of an arc of the arrangement, as drawn.
    fn line_of_arc(&self, ArcId { q, slab, place }: ArcId) -> Vec<[f64; 2]> {
        let stretch = self.stretch(q, slab, place);
        let a = &self.atlas.region.triangles[q].arrangement;
        let mut over = Columns::new(a, slab);
        self.polyline(q, &stretch, place, &mut over, &mut true)
    }
    /// Returns the drawn arc on given faces of the box that passes through a place.
    fn arc_at(&self, q: usize, at: [f64; 2], faces: u8) -> Option<ArcId> {
        let a = &self.atlas.region.triangles[q].arrangement;
        let walls = &a.walls[1..a.walls.len() - 1];
        let slab = walls.partition_point(|w| w.u.to_f64() < at[0]);
        let mut over = Columns::new(a, slab);
        let far = |i: usize, over: &mut Columns<'_>| {
            over.at(at[0], i)
                .map_or(f64::INFINITY, |v| (v - at[1]).abs())
        };
        let of_face = |i: &usize| self.atlas.bits(a.slabs[slab].arcs[*i].curve) & faces != 0;
        let drawn = self.curves.drawn(q, slab).into_iter().filter(of_face);
        let (off, i) = drawn
            .map(|i| (far(i, &mut over), i))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        // The arc passes through the place up to this distance along v.
        (off < 1e-7).then_some(ArcId { q, slab, place: i })
    }
}
