//! What a solid looks like about a point, to first order.
//!
//! The pieces that vanish at the point are planes through it there; those with parallel normals
//! form one sheet. The tree, with the sheets' signs in a direction and the others' signs at the
//! point, says whether that direction leads inside. Around a line in which sheets meet the solid
//! consists of sectors, and the line is a feature where the sign changes at the faces of two
//! different sheets.
//!
//! ```text
//!         outside | inside          Looking along a line in which the sheets 0 and 1 meet. The
//!                 |                 sign changes at one face of each: the line is an edge of the
//!     0 --------- + --------- 0     solid. At the other two faces both sides are alike.
//!                 |
//!         outside | outside
//!                 1
//! ```

use super::newton::{along, branch, normalised, onto_two, unit};
use super::search::Search;
use crate::decide::{Local, decisive};
use crate::points::unique;
use isoform_geom::{Point3, across, cross, dot, norm, sub};
use isoform_num::Interval;
use std::f64::consts::{PI, TAU};

/// Sheets whose normal is at a right angle to a line, to this sine, hold the line.
const IN_LINE: f64 = 1e-6;
/// Where there is a choice of curves, they are looked at this part of the size away from the point.
const PROBE: f64 = 1.0 / 64.0;
/// Distances of the probes, in the nearest, on curves that cross: there the angle between the pieces
/// grows from 0 on, and may be large enough for a feature only farther away.
const FARTHER: [f64; 4] = [1.0, 4.0, 16.0, 48.0];
/// Part of the way to a probe by which a curve may miss its tangent there.
const MISS: f64 = 0.3;
/// Part of the way to the nearest probe within which a branch point is the point itself, and within
/// which two probes are one: they are exact to rounding, and curves that touch are apart there by
/// the way times half of the difference of their curvatures.
const SAME: [f64; 2] = [0.01, 1e-6];
/// Cosine, but for this, above which two half-lines are one.
const ONE_LINE: f64 = 1e-9;

/// Pieces that vanish at a point with the same plane.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    pub(crate) n: Point3,
    /// The pieces, each with the sign of its normal against `n`.
    pub(crate) members: Vec<(u32, f64)>,
}

/// What a piece is at a point.
#[derive(Clone, Copy, Debug)]
enum Role {
    /// It does not vanish; its sign.
    Fixed(f64),
    /// It belongs to a sheet; the sign of its normal against the sheet's.
    Sheet(usize, f64),
}

/// A point of the solid's surface, to first order.
#[derive(Debug)]
pub(crate) struct Touch<'a> {
    local: &'a Local,
    roles: Vec<(u32, Role)>,
    pub(crate) sheets: Vec<Sheet>,
}

/// A point of a feature curve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    /// The pieces of the two sheets.
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    /// On which sides of the other piece the faces of a and b are, two bits each.
    pub(crate) faces: u8,
}

/// A feature curve as it leaves a point.
#[derive(Clone, Debug)]
pub(crate) struct HalfLine {
    pub(crate) direction: Point3,
    pub(crate) pair: [u32; 2],
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    /// A point on it, where the direction alone would not do.
    pub(crate) by: Option<Point3>,
}

/// A face of a sheet beside a line.
struct Face {
    sheet: usize,
    angle: f64,
    /// Whether the sign changes there.
    change: bool,
}

/// A piece that vanishes at a point, with its unit normal.
type Vanishing = (u32, Point3);

impl Search<'_> {
    /// The solid near `p`; none if no feature can pass there.
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
            roles.push((*k, Role::Fixed(if v >= 0.0 { 1.0 } else { -1.0 })));
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

    /// The state of the curve of the pieces `pair` at one of its points, seen in the direction `t`
    /// of travel; none if the curve is no feature there.
    pub(crate) fn state(&self, p: Point3, pair: [u32; 2], t: Point3) -> Option<State> {
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

    /// Whether a piece vanishes at a point.
    pub(crate) fn lies_on(&self, p: Point3, piece: u32) -> bool {
        normalised(self.solid, piece, p).is_some_and(|g| g.d.abs() <= self.tolerance)
    }

    /// The feature curves that leave `q`.
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

    /// The feature curves that leave `q` where sheets consist of several pieces, which may part: by
    /// looking a little way along every curve.
    fn probed_lines(&self, q: Point3, touch: &Touch<'_>) -> Vec<HalfLine> {
        let delta = PROBE * self.options.size;
        let mut lines: Vec<HalfLine> = Vec::new();
        let sheets = touch.sheets.iter().enumerate();
        let members: Vec<(u32, usize)> = sheets
            .flat_map(|(s, sheet)| sheet.members.iter().map(move |m| (m.0, s)))
            .collect();
        for (x, &(i, s)) in members.iter().enumerate() {
            for &(j, r) in &members[x + 1..] {
                let (directions, reaches) = if s == r {
                    (self.directions_at_branch([i, j], q), &FARTHER[..])
                } else {
                    let t = unit(cross(touch.sheets[s].n, touch.sheets[r].n));
                    (vec![t], &FARTHER[..1])
                };
                for t in directions.into_iter().flat_map(|t| [t, t.map(|v| -v)]) {
                    let Some(line) = self.probe(q, t, [i, j], reaches) else {
                        continue;
                    };
                    let is_other = |l: &HalfLine| match (l.by, line.by) {
                        (Some(a), Some(b)) => norm(sub(a, b)) > SAME[1] * delta,
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

    /// The directions in which curves of two pieces with a common normal leave a point; none if
    /// they do not cross there.
    fn directions_at_branch(&self, pair: [u32; 2], q: Point3) -> Vec<Point3> {
        let delta = PROBE * self.options.size;
        branch(self.solid, pair, q, delta)
            .filter(|b| norm(sub(b.0, q)) < SAME[0] * delta)
            .map_or(Vec::new(), |(_, both)| both.to_vec())
    }

    /// The half-line of two pieces in a direction, if the curve is a feature at one of the probes.
    fn probe(&self, q: Point3, t: Point3, pair: [u32; 2], reaches: &[f64]) -> Option<HalfLine> {
        let delta = PROBE * self.options.size;
        reaches.iter().find_map(|r| {
            let ahead = along(q, t, r * delta);
            let (p, _) = onto_two(self.solid, pair, ahead, MISS * r * delta)?;
            let State { a, b, .. } = self.state(p, pair, t)?;
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

/// Drops those vanishing pieces whose signs do not matter, given the signs of the other pieces.
fn keep_decisive(local: &Local, roles: &[(u32, Role)], vanishing: &mut Vec<Vanishing>) {
    let range = |k: u32| {
        if vanishing.iter().any(|v| v.0 == k) {
            return Interval::new(-1.0, 1.0);
        }
        match roles.iter().find(|r| r.0 == k) {
            Some((_, Role::Fixed(s))) => Interval::new(*s, *s),
            _ => Interval::new(-1.0, 1.0),
        }
    };
    let mut which = Vec::with_capacity(vanishing.len());
    decisive(&local.tree, &range, &mut which);
    vanishing.retain(|v| which.contains(&v.0));
}

impl Touch<'_> {
    /// Puts a piece into the sheet whose normal differs from `n` by less than `sine`, else into a
    /// new sheet.
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
            role.1 = Role::Sheet(at, sign);
        }
    }

    /// The sheet of a piece.
    pub(crate) fn sheet_of(&self, piece: u32) -> Option<usize> {
        match self.roles.iter().find(|r| r.0 == piece)?.1 {
            Role::Sheet(s, _) => Some(s),
            Role::Fixed(_) => None,
        }
    }

    /// The pieces that vanish here and matter.
    pub(crate) fn pieces(&self) -> Vec<u32> {
        let members = self.sheets.iter().flat_map(|s| &s.members);
        let mut all: Vec<u32> = members.map(|m| m.0).collect();
        all.sort_unstable();
        all
    }

    /// Whether the solid is inside where the sheets have these signs.
    fn is_inside(&self, sheet_sign: impl Fn(usize) -> f64) -> bool {
        let value = |k: u32| match self.roles.iter().find(|r| r.0 == k) {
            Some((_, Role::Fixed(s))) => *s,
            Some((_, Role::Sheet(at, s))) => s * sheet_sign(*at),
            None => 0.0,
        };
        self.local.tree.value(&value) >= 0.0
    }

    /// The slopes of all sheets along a direction.
    fn slopes(&self, t: Point3) -> Vec<f64> {
        self.sheets.iter().map(|s| dot(s.n, t)).collect()
    }

    /// The faces beside the half-line along `t`, in order around it.
    fn around(&self, t: Point3) -> Vec<Face> {
        let [e1, e2] = across(t);
        let slope = self.slopes(t);
        let mut faces = Vec::with_capacity(4);
        for (sheet, s) in self.sheets.iter().enumerate() {
            if slope[sheet].abs() >= IN_LINE {
                continue;
            }
            let u = cross(t, s.n);
            let angle = dot(u, e2).atan2(dot(u, e1));
            for angle in [angle, angle + PI] {
                faces.push(Face {
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

    /// Whether the sector behind each face is inside.
    fn sectors(&self, faces: &[Face], slope: &[f64], [e1, e2]: [Point3; 2]) -> Vec<bool> {
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
                    if slope[s].abs() < IN_LINE {
                        dot(self.sheets[s].n, w).signum()
                    } else {
                        slope[s].signum()
                    }
                })
            })
            .collect()
    }

    /// The feature in the line `t`, of two sheets, as the pieces `pair` see it.
    fn state_in(&self, t: Point3, [a, b]: [usize; 2], pair: [u32; 2]) -> Option<State> {
        let faces = self.around(t);
        let of_a = self.sides(&faces, t, a, (b, pair[1]))?;
        let of_b = self.sides(&faces, t, b, (a, pair[0]))?;
        let pieces = |s: usize| self.sheets[s].members.iter().map(|m| m.0).collect();
        Some(State {
            a: pieces(a),
            b: pieces(b),
            faces: of_a | of_b << 2,
        })
    }

    /// On which sides of a piece of another sheet the faces of a sheet are at which the sign
    /// changes: bit 0 for behind, bit 1 for in front of it. None if there are no such faces.
    fn sides(
        &self,
        faces: &[Face],
        t: Point3,
        sheet: usize,
        (other, piece): (usize, u32),
    ) -> Option<u8> {
        let [e1, e2] = across(t);
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

    /// The feature half-lines from the point, where every sheet is one piece.
    fn lines(&self) -> Vec<HalfLine> {
        let mut lines: Vec<HalfLine> = Vec::new();
        let n = self.sheets.len();
        for x in 0..n {
            for y in x + 1..n {
                let t = unit(cross(self.sheets[x].n, self.sheets[y].n));
                for t in [t, t.map(|v| -v)] {
                    let is_known = |l: &HalfLine| dot(l.direction, t) > 1.0 - ONE_LINE;
                    if !lines.iter().any(is_known) {
                        lines.extend(self.line(t));
                    }
                }
            }
        }
        lines
    }

    /// The half-line along `t`, if the sign changes at the faces of two sheets.
    fn line(&self, t: Point3) -> Option<HalfLine> {
        let faces = self.around(t);
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
