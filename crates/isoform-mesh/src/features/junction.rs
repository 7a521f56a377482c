//! First-order structure of a solid about a point.
//!
//! The pieces that vanish at the point are replaced by their tangent planes; those with parallel
//! normals form one sheet. The tree, with the sheets' signs in a direction and the other pieces'
//! signs at the point, decides if that direction leads inside. Around a line in which sheets meet
//! the solid consists of sectors, and the line is a feature where the sign changes at the faces of
//! two different sheets.
//!
//! ```text
//!         outside | inside          Looking along a line in which the sheets 0 and 1 meet. The
//!                 |                 sign changes at one face of each: the line is an edge of the
//!     0 --------- + --------- 0     solid. At the other two faces both sides are alike.
//!                 |
//!         outside | outside
//!                 1
//! ```

use super::context::FeatureContext;
use super::newton::{add_scaled, branch, normalised, onto_two, unit};
use crate::decide::{Local, decisive};
use crate::points::unique;
use isoform_geom::{Point3, cross, dot, norm, orthonormal_complement, sub};
use isoform_num::Interval;
use std::f64::consts::{PI, TAU};

/// Maximum |n · t| for a sheet that contains a line; n is its unit normal, t the unit direction.
const MAX_IN_SHEET_SLOPE: f64 = 1e-6;
/// Distance from a point at which the curves that leave it are probed, in sizes.
const CURVE_PROBE_DISTANCE: f64 = 1.0 / 64.0;
/// Distances of the probes on curves that cross, in multiples of the first: the angle between the
/// pieces grows from 0 there, and may be large enough for a feature only farther away.
const CROSSING_PROBE_MULTIPLES: [f64; 4] = [1.0, 4.0, 16.0, 48.0];
/// Distances, in the nearest probe's distance, within which a branch point is the point itself, and
/// within which two probes are one. Probes are exact to rounding; at a probe, curves that touch are
/// apart by its distance times half of the difference of their curvatures.
const COINCIDENT_PROBE_DISTANCES: [f64; 2] = [0.01, 1e-6];

/// Pieces that vanish at a point and have a common tangent plane there.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    pub(crate) n: Point3,
    /// Pieces, each with the sign of its normal relative to `n`.
    pub(crate) members: Vec<(u32, f64)>,
}

/// Role of a piece at a point.
#[derive(Clone, Copy, Debug)]
enum PieceRole {
    /// The piece does not vanish; holds its sign.
    Fixed(f64),
    /// The piece belongs to a sheet; holds its index, and the sign of the piece's normal relative
    /// to the sheet's.
    Sheet(usize, f64),
}

/// A point of the solid's surface, to first order.
#[derive(Debug)]
pub(crate) struct Touch<'a> {
    local: &'a Local,
    roles: Vec<(u32, PieceRole)>,
    pub(crate) sheets: Vec<Sheet>,
}

/// Pieces and faces by which a curve is a feature at one of its points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CurveState {
    /// Pieces of the two sheets.
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    /// Sides of the other piece on which the faces of a and b lie, two bits each.
    pub(crate) faces: u8,
}

/// Start of a feature curve at a point that it leaves.
#[derive(Clone, Debug)]
pub(crate) struct HalfLine {
    pub(crate) direction: Point3,
    pub(crate) pair: [u32; 2],
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    /// A point of the curve, if the direction alone does not determine it.
    pub(crate) by: Option<Point3>,
}

/// A face of a sheet next to a line.
struct SheetFace {
    sheet: usize,
    angle: f64,
    /// True if the sign changes there.
    change: bool,
}

/// A piece that vanishes at a point, with its unit normal.
type Vanishing = (u32, Point3);

impl FeatureContext<'_> {
    /// Returns the solid near `p` to first order; `None` if no feature can pass there.
    pub(crate) fn touch(&self, p: Point3) -> Option<Touch<'_>> {
        let local = self.octree.at(p)?;
        let mut vanishing: Vec<Vanishing> = Vec::with_capacity(4);
        let mut roles = Vec::with_capacity(local.pieces.len());
        for k in &local.pieces[..] {
            let (v, g) = self.solid.gradient(*k, p);
            let length = norm(g);
            if v.abs() <= self.tolerance * length {
                vanishing.push((*k, g.map(|c| c / length)));
            }
            roles.push((*k, PieceRole::Fixed(if v >= 0.0 { 1.0 } else { -1.0 })));
        }
        if vanishing.len() < 2 {
            return None;
        }
        keep_decisive(local, &roles, &mut vanishing);
        let mut touch = Touch {
            local,
            roles,
            sheets: Vec::with_capacity(3),
        };
        for (k, n) in vanishing {
            touch.add(k, n, self.sine);
        }
        Some(touch)
    }

    /// Returns the state of the curve of the pieces `pair` at one of its points, seen in the
    /// direction `t` of travel; `None` if the curve is not a feature there.
    pub(crate) fn state(&self, p: Point3, pair: [u32; 2], t: Point3) -> Option<CurveState> {
        let touch = self.touch(p)?;
        let (a, b) = (touch.sheet_of(pair[0])?, touch.sheet_of(pair[1])?);
        if a == b {
            return None;
        }
        let mut line = unit(cross(touch.sheets[a].n, touch.sheets[b].n));
        if dot(line, t) < 0.0 {
            line = line.map(|v| -v);
        }
        touch.state_in(line, [a, b], pair)
    }

    /// Returns true if a piece vanishes at a point.
    pub(crate) fn lies_on(&self, p: Point3, piece: u32) -> bool {
        normalised(self.solid, piece, p).is_some_and(|g| g.d.abs() <= self.tolerance)
    }

    /// Returns the feature curves that leave `q`.
    pub(crate) fn half_lines(&self, q: Point3) -> Vec<HalfLine> {
        let Some(touch) = self.touch(q) else {
            return Vec::new();
        };
        if touch.sheets.iter().all(|s| s.members.len() == 1) {
            touch.lines()
        } else {
            self.probed_lines(q, &touch)
        }
    }

    /// Returns the feature curves that leave `q` where sheets consist of several pieces, which may
    /// diverge: probes every curve at a small distance.
    fn probed_lines(&self, q: Point3, touch: &Touch<'_>) -> Vec<HalfLine> {
        let delta = CURVE_PROBE_DISTANCE * self.options.size;
        let mut lines: Vec<HalfLine> = Vec::new();
        let sheets = touch.sheets.iter().enumerate();
        let members: Vec<(u32, usize)> = sheets
            .flat_map(|(s, sheet)| sheet.members.iter().map(move |m| (m.0, s)))
            .collect();
        for (x, &(i, s)) in members.iter().enumerate() {
            for &(j, r) in &members[x + 1..] {
                let (directions, reaches) = if s == r {
                    (
                        self.directions_at_branch([i, j], q),
                        &CROSSING_PROBE_MULTIPLES[..],
                    )
                } else {
                    let t = unit(cross(touch.sheets[s].n, touch.sheets[r].n));
                    (vec![t], &CROSSING_PROBE_MULTIPLES[..1])
                };
                for t in directions.into_iter().flat_map(|t| [t, t.map(|v| -v)]) {
                    let Some(line) = self.probe(q, t, [i, j], reaches) else {
                        continue;
                    };
                    let is_other = |l: &HalfLine| match (l.by, line.by) {
                        (Some(a), Some(b)) => {
                            norm(sub(a, b)) > COINCIDENT_PROBE_DISTANCES[1] * delta
                        }
                        _ => true,
                    };
                    if lines.iter().all(is_other) {
                        lines.push(line);
                    }
                }
            }
        }
        lines
    }

    /// Returns the directions in which curves of two pieces with a common normal leave a point;
    /// empty if they do not cross there.
    fn directions_at_branch(&self, pair: [u32; 2], q: Point3) -> Vec<Point3> {
        let delta = CURVE_PROBE_DISTANCE * self.options.size;
        branch(self.solid, pair, q, delta)
            .filter(|b| norm(sub(b.0, q)) < COINCIDENT_PROBE_DISTANCES[0] * delta)
            .map_or(Vec::new(), |(_, both)| both.to_vec())
    }

    /// Returns the half-line of two pieces in a direction, if the curve is a feature at a probe.
    fn probe(&self, q: Point3, t: Point3, pair: [u32; 2], reaches: &[f64]) -> Option<HalfLine> {
        let delta = CURVE_PROBE_DISTANCE * self.options.size;
        reaches.iter().find_map(|r| {
            let ahead = add_scaled(q, t, r * delta);
            // The curve may miss its tangent by this part of the way.
            let (p, _) = onto_two(self.solid, pair, ahead, 0.3 * r * delta)?;
            let CurveState { a, b, .. } = self.state(p, pair, t)?;
            Some(HalfLine {
                direction: t,
                pair,
                a,
                b,
                by: Some(p),
            })
        })
    }
}

/// Drops the vanishing pieces whose signs do not matter, given the signs of the other pieces.
fn keep_decisive(local: &Local, roles: &[(u32, PieceRole)], vanishing: &mut Vec<Vanishing>) {
    let range = |k: u32| {
        if vanishing.iter().any(|v| v.0 == k) {
            return Interval::new(-1.0, 1.0);
        }
        match roles.iter().find(|r| r.0 == k) {
            Some((_, PieceRole::Fixed(s))) => Interval::new(*s, *s),
            _ => Interval::new(-1.0, 1.0),
        }
    };
    let mut which = Vec::with_capacity(vanishing.len());
    decisive(&local.tree, &range, &mut which);
    vanishing.retain(|v| which.contains(&v.0));
}

impl Touch<'_> {
    /// Adds a piece to the sheet whose normal differs from `n` by less than `sine`, or to a new
    /// sheet.
    fn add(&mut self, piece: u32, n: Point3, sine: f64) {
        let known = self.sheets.iter().position(|s| norm(cross(s.n, n)) < sine);
        let at = known.unwrap_or(self.sheets.len());
        if known.is_none() {
            self.sheets.push(Sheet {
                n,
                members: Vec::with_capacity(1),
            });
        }
        let is_opposite = known.is_some() && dot(self.sheets[at].n, n) < 0.0;
        let sign = if is_opposite { -1.0 } else { 1.0 };
        self.sheets[at].members.push((piece, sign));
        if let Some(role) = self.roles.iter_mut().find(|r| r.0 == piece) {
            role.1 = PieceRole::Sheet(at, sign);
        }
    }

    /// Returns the sheet of a piece; `None` if the piece does not vanish.
    pub(crate) fn sheet_of(&self, piece: u32) -> Option<usize> {
        match self.roles.iter().find(|r| r.0 == piece)?.1 {
            PieceRole::Sheet(s, _) => Some(s),
            PieceRole::Fixed(_) => None,
        }
    }

    /// Returns the vanishing pieces that matter, ascending.
    pub(crate) fn pieces(&self) -> Vec<u32> {
        let members = self.sheets.iter().flat_map(|s| &s.members);
        let mut all: Vec<u32> = members.map(|m| m.0).collect();
        all.sort_unstable();
        all
    }

    /// Returns true if the solid is inside where the sheets have these signs.
    fn is_inside(&self, sheet_sign: impl Fn(usize) -> f64) -> bool {
        let value = |k: u32| match self.roles.iter().find(|r| r.0 == k) {
            Some((_, PieceRole::Fixed(s))) => *s,
            Some((_, PieceRole::Sheet(at, s))) => s * sheet_sign(*at),
            None => 0.0,
        };
        self.local.tree.value(&value) >= 0.0
    }

    /// Returns the slopes of all sheets along a direction.
    fn slopes(&self, t: Point3) -> Vec<f64> {
        self.sheets.iter().map(|s| dot(s.n, t)).collect()
    }

    /// Returns the faces next to the half-line along `t`, in order around it.
    fn faces_around(&self, t: Point3) -> Vec<SheetFace> {
        let [e1, e2] = orthonormal_complement(t);
        let slope = self.slopes(t);
        let mut faces = Vec::with_capacity(4);
        for (sheet, s) in self.sheets.iter().enumerate() {
            if slope[sheet].abs() >= MAX_IN_SHEET_SLOPE {
                continue;
            }
            let u = cross(t, s.n);
            let angle = dot(u, e2).atan2(dot(u, e1));
            for angle in [angle, angle + PI] {
                faces.push(SheetFace {
                    sheet,
                    angle: angle.rem_euclid(TAU),
                    change: false,
                });
            }
        }
        faces.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        let inside = self.sectors(&faces, &slope, [e1, e2]);
        let n = faces.len();
        for m in 0..n {
            faces[m].change = inside[m] != inside[(m + n - 1) % n];
        }
        faces
    }

    /// Returns for each face, if the sector behind it is inside.
    fn sectors(&self, faces: &[SheetFace], slope: &[f64], [e1, e2]: [Point3; 2]) -> Vec<bool> {
        let n = faces.len();
        (0..n)
            .map(|m| {
                let next = if m + 1 < n {
                    faces[m + 1].angle
                } else {
                    faces[0].angle + TAU
                };
                let (sine, cosine) = (0.5 * (faces[m].angle + next)).sin_cos();
                let w: Point3 = std::array::from_fn(|i| cosine * e1[i] + sine * e2[i]);
                self.is_inside(|s| {
                    if slope[s].abs() < MAX_IN_SHEET_SLOPE {
                        dot(self.sheets[s].n, w).signum()
                    } else {
                        slope[s].signum()
                    }
                })
            })
            .collect()
    }

    /// Returns the state of the feature along the line `t` of two sheets, relative to the pieces
    /// `pair`.
    fn state_in(&self, t: Point3, [a, b]: [usize; 2], pair: [u32; 2]) -> Option<CurveState> {
        let faces = self.faces_around(t);
        let of_a = self.sides(&faces, t, a, (b, pair[1]))?;
        let of_b = self.sides(&faces, t, b, (a, pair[0]))?;
        let pieces = |s: usize| self.sheets[s].members.iter().map(|m| m.0).collect();
        Some(CurveState {
            a: pieces(a),
            b: pieces(b),
            faces: of_a | of_b << 2,
        })
    }

    /// Returns the sides of a piece of another sheet on which those faces of a sheet lie at which
    /// the sign changes: bit 0 for behind, bit 1 for in front of it. `None` without such faces.
    fn sides(
        &self,
        faces: &[SheetFace],
        t: Point3,
        sheet: usize,
        (other, piece): (usize, u32),
    ) -> Option<u8> {
        let [e1, e2] = orthonormal_complement(t);
        let other = &self.sheets[other];
        let member = other.members.iter().find(|m| m.0 == piece);
        let orientation = member.map_or(1.0, |m| m.1);
        let mut bits = 0u8;
        for face in faces.iter().filter(|f| f.sheet == sheet && f.change) {
            let w: Point3 =
                std::array::from_fn(|i| face.angle.cos() * e1[i] + face.angle.sin() * e2[i]);
            bits |= 1 << u8::from(orientation * dot(other.n, w) > 0.0);
        }
        (bits != 0).then_some(bits)
    }

    /// Returns the feature half-lines from the point, where every sheet is one piece.
    fn lines(&self) -> Vec<HalfLine> {
        let mut lines: Vec<HalfLine> = Vec::new();
        let n = self.sheets.len();
        for x in 0..n {
            for y in x + 1..n {
                let t = unit(cross(self.sheets[x].n, self.sheets[y].n));
                for t in [t, t.map(|v| -v)] {
                    // Half-lines in one direction are one.
                    let is_known = |l: &HalfLine| dot(l.direction, t) > 1.0 - 1e-9;
                    if !lines.iter().any(is_known) {
                        lines.extend(self.line(t));
                    }
                }
            }
        }
        lines
    }

    /// Returns the half-line along `t`, if the sign changes at the faces of two sheets.
    fn line(&self, t: Point3) -> Option<HalfLine> {
        let faces = self.faces_around(t);
        let changed = faces.iter().filter(|f| f.change).map(|f| f.sheet as u32);
        let [a, b, ..] = unique(changed.collect())[..] else {
            return None;
        };
        let piece = |s: u32| self.sheets[s as usize].members[0].0;
        let (i, j) = (piece(a), piece(b));
        Some(HalfLine {
            direction: t,
            pair: [i, j],
            a: vec![i],
            b: vec![j],
            by: None,
        })
    }
}
