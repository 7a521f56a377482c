//! What a solid looks like about a point, to first order.
//!
//! The pieces that vanish at the point are planes through it there; those with parallel normals
//! form one sheet. The tree, with the sheets' signs in a direction and the others' signs at the
//! point, says whether that direction leads inside. Around a line in which sheets meet the solid
//! consists of sectors, and the line is a feature where the sign changes at the faces of two
//! different sheets.

use super::Search;
use super::newton::{along, branch, normalised, onto_two, unit};
use crate::decide::{Local, decisive};
use isoform_geom::{Point3, across, cross, dot, norm, sub};
use isoform_num::Interval;
use std::f64::consts::{PI, TAU};

/// Sheets whose normal is at a right angle to a line, to this sine, hold the line.
const IN_LINE: f64 = 1e-6;
/// Where there is a choice of curves, they are looked at this part of the size away from the point.
const PROBE: f64 = 1.0 / 64.0;

/// Pieces that vanish at a point with the same plane.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    pub(crate) n: Point3,
    /// The pieces, each with the sign of its normal against `n`.
    pub(crate) members: Vec<(u32, f64)>,
}

#[derive(Clone, Copy, Debug)]
enum Role {
    Fixed(f64),
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

impl Search<'_> {
    /// The solid about `p`; none where no feature can be.
    pub(crate) fn touch(&self, p: Point3) -> Option<Touch<'_>> {
        let local = self.octree.at(p)?;
        let mut vanishing = Vec::with_capacity(4);
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
        let mut sheets: Vec<Sheet> = Vec::with_capacity(3);
        for (k, n) in vanishing.into_iter().filter(|v| which.contains(&v.0)) {
            let (at, sign) = match sheets.iter().position(|s| norm(cross(s.n, n)) < self.sine) {
                Some(at) => (
                    at,
                    if dot(sheets[at].n, n) < 0.0 {
                        -1.0
                    } else {
                        1.0
                    },
                ),
                None => {
                    sheets.push(Sheet {
                        n,
                        members: Vec::with_capacity(1),
                    });
                    (sheets.len() - 1, 1.0)
                }
            };
            sheets[at].members.push((k, sign));
            if let Some(role) = roles.iter_mut().find(|r| r.0 == k) {
                role.1 = Role::Sheet(at, sign);
            }
        }
        Some(Touch {
            local,
            roles,
            sheets,
        })
    }

    /// What the curve of the pieces `pair` is at a point of it, seen in the direction `t` of
    /// travel; none if it is no feature.
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
        let faces = touch.around(line);
        touch.state_of(&faces, line, a, b, pair)
    }

    /// Distances to first order by which `p` misses the pieces of a corner or a curve.
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

    /// The same where sheets consist of several pieces, which may part: by looking a little way
    /// along every curve.
    fn probed_lines(&self, q: Point3, touch: &Touch<'_>) -> Vec<HalfLine> {
        let delta = PROBE * self.options.size;
        let mut lines: Vec<HalfLine> = Vec::new();
        let members: Vec<(u32, usize)> = touch
            .sheets
            .iter()
            .enumerate()
            .flat_map(|(s, sheet)| sheet.members.iter().map(move |m| (m.0, s)))
            .collect();
        for (x, (i, s)) in members.iter().enumerate() {
            for (j, r) in &members[x + 1..] {
                // Of curves that cross the angle grows from 0 on.
                let (directions, reaches): (Vec<Point3>, &[f64]) = if s != r {
                    let t = unit(cross(touch.sheets[*s].n, touch.sheets[*r].n));
                    (vec![t], &[1.0])
                } else if let Some((_, both)) = branch(self.solid, [*i, *j], q, delta)
                    .filter(|b| norm(sub(b.0, q)) < 0.01 * delta)
                {
                    (both.to_vec(), &[1.0, 4.0, 16.0, 48.0])
                } else {
                    continue;
                };
                for t in directions.into_iter().flat_map(|t| [t, t.map(|v| -v)]) {
                    let hit = reaches.iter().find_map(|r| {
                        let (p, _) = onto_two(
                            self.solid,
                            [*i, *j],
                            along(q, t, r * delta),
                            0.3 * r * delta,
                        )?;
                        Some((p, self.state(p, [*i, *j], t)?))
                    });
                    let Some((p, state)) = hit else { continue };
                    if lines
                        .iter()
                        .all(|l| l.by.is_none_or(|by| norm(sub(by, p)) > 1e-3 * delta))
                    {
                        lines.push(HalfLine {
                            direction: t,
                            pair: [*i, *j],
                            a: state.a,
                            b: state.b,
                            by: Some(p),
                        });
                    }
                }
            }
        }
        lines
    }
}

impl Touch<'_> {
    pub(crate) fn sheet_of(&self, piece: u32) -> Option<usize> {
        self.roles.iter().find(|r| r.0 == piece).and_then(|r| {
            if let Role::Sheet(s, _) = r.1 {
                Some(s)
            } else {
                None
            }
        })
    }

    /// The pieces that vanish here and matter.
    pub(crate) fn pieces(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self
            .sheets
            .iter()
            .flat_map(|s| s.members.iter().map(|m| m.0))
            .collect();
        all.sort_unstable();
        all
    }

    fn is_inside(&self, sheet_sign: impl Fn(usize) -> f64) -> bool {
        let value = |k: u32| match self.roles.iter().find(|r| r.0 == k) {
            Some((_, Role::Fixed(s))) => *s,
            Some((_, Role::Sheet(at, s))) => s * sheet_sign(*at),
            None => 0.0,
        };
        self.local.tree.value(&value) >= 0.0
    }

    /// The faces beside the half-line along `t`, in order around it.
    fn around(&self, t: Point3) -> Vec<Face> {
        let [e1, e2] = across(t);
        let slope: Vec<f64> = self.sheets.iter().map(|s| dot(s.n, t)).collect();
        let mut faces = Vec::with_capacity(4);
        for (sheet, s) in self
            .sheets
            .iter()
            .enumerate()
            .filter(|(at, _)| slope[*at].abs() < IN_LINE)
        {
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
        let n = faces.len();
        let inside: Vec<bool> = (0..n)
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
            .collect();
        for m in 0..n {
            let before = inside[(m + n - 1) % n];
            faces[m].change = inside[m] != before;
        }
        faces
    }

    /// The feature in the line `t`, of the sheets `a` and `b`, as the pieces `pair` see it.
    fn state_of(
        &self,
        faces: &[Face],
        t: Point3,
        a: usize,
        b: usize,
        pair: [u32; 2],
    ) -> Option<State> {
        let mut bits = 0u8;
        let [e1, e2] = across(t);
        for (shift, sheet, other, piece) in [(0, a, b, pair[1]), (2, b, a, pair[0])] {
            let orientation = self.sheets[other]
                .members
                .iter()
                .find(|m| m.0 == piece)
                .map_or(1.0, |m| m.1);
            let mut any = false;
            for face in faces.iter().filter(|f| f.sheet == sheet && f.change) {
                any = true;
                let w: Point3 =
                    std::array::from_fn(|i| face.angle.cos() * e1[i] + face.angle.sin() * e2[i]);
                let side = u8::from(orientation * dot(self.sheets[other].n, w) > 0.0);
                bits |= 1 << (shift + side);
            }
            if !any {
                return None;
            }
        }
        let pieces = |s: usize| self.sheets[s].members.iter().map(|m| m.0).collect();
        Some(State {
            a: pieces(a),
            b: pieces(b),
            faces: bits,
        })
    }

    /// The feature half-lines from the point, where every sheet is one piece.
    fn lines(&self) -> Vec<HalfLine> {
        let mut lines: Vec<HalfLine> = Vec::new();
        let n = self.sheets.len();
        for x in 0..n {
            for y in x + 1..n {
                let t = unit(cross(self.sheets[x].n, self.sheets[y].n));
                for t in [t, t.map(|v| -v)] {
                    if lines.iter().any(|l| dot(l.direction, t) > 1.0 - 1e-9) {
                        continue;
                    }
                    let faces = self.around(t);
                    let mut changed: Vec<usize> =
                        faces.iter().filter(|f| f.change).map(|f| f.sheet).collect();
                    changed.sort_unstable();
                    changed.dedup();
                    if let [a, b, ..] = changed[..] {
                        let (i, j) = (self.sheets[a].members[0].0, self.sheets[b].members[0].0);
                        lines.push(HalfLine {
                            direction: t,
                            pair: [i, j],
                            a: vec![i],
                            b: vec![j],
                            by: None,
                        });
                    }
                }
            }
        }
        lines
    }
}
