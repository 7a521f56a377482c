//! Triangles of several patches as one mesh, joined along the sides that they have in common.
//!
//! Sides with the same control points, in either order, are one curve. Its vertices are those of
//! all patches at it: where one patch lacks a vertex of another, its triangle there is divided. The
//! sides of a domain are straight in the parameters, so that what is proved of a triangle holds for
//! its parts.

use crate::claim::Claim;
use crate::finding::Finding;
use crate::patch::{ControlPoint, Patch};
use crate::surface::{Kind, Point3, Surface};
use isoform_algebra::RBig;
use std::collections::BTreeMap;

/// Places along a side that are nearer to each other are one.
const SAME: f64 = 1e-9;

/// Control points up to a common factor.
fn projective(points: &[&ControlPoint]) -> Vec<ControlPoint> {
    let scale = points
        .iter()
        .flat_map(|p| p.iter())
        .find(|x| !x.is_zero())
        .cloned()
        .unwrap_or(RBig::ONE);
    points
        .iter()
        .map(|p| p.each_ref().map(|x| x / &scale))
        .collect()
}

/// A side of a patch, and whether it runs against the curve that it shares.
#[derive(Clone, Copy, Debug)]
struct Member {
    patch: usize,
    side: usize,
    reversed: bool,
}

/// The sides by the curves that they are; sides that are one point are none.
fn curves(patches: &[Patch]) -> Vec<Vec<Member>> {
    let mut found: BTreeMap<Vec<ControlPoint>, Vec<Member>> = BTreeMap::new();
    for (patch, p) in patches.iter().enumerate() {
        for side in 0..4 {
            let points = p.side(side);
            let forward = projective(&points);
            let backward = projective(&points.into_iter().rev().collect::<Vec<_>>());
            if forward
                .iter()
                .all(|c| projective(&[c]) == projective(&[&forward[0]]))
            {
                continue;
            }
            let reversed = backward < forward;
            found
                .entry(if reversed { backward } else { forward })
                .or_default()
                .push(Member {
                    patch,
                    side,
                    reversed,
                });
        }
    }
    found.into_values().collect()
}

/// The place of parameters along a side, 0 and 1 at its ends in the order of the sides; all patches
/// lie in the first unit triangle.
fn place(side: usize, [u, v]: [f64; 2]) -> f64 {
    let w = 1.0 - u - v;
    match side {
        0 => u / w,
        1 => v / w,
        2 => 1.0 - u / w,
        _ => 1.0 - v / w,
    }
}
fn parameters(side: usize, x: f64) -> [f64; 2] {
    let [s, t] = match side {
        0 => [x, 0.0],
        1 => [1.0, x],
        2 => [1.0 - x, 1.0],
        _ => [0.0, 1.0 - x],
    };
    [s / (s + t + 1.0), t / (s + t + 1.0)]
}

impl Surface {
    /// The vertices on a side of a patch, ascending along the curve.
    fn along(&self, m: Member) -> Vec<(f64, u32)> {
        let mut found: BTreeMap<u32, f64> = BTreeMap::new();
        for ((t, corners), borders) in self.triangles.iter().zip(&self.corners).zip(&self.borders) {
            for k in (0..3).filter(|&k| borders[k] >> m.side & 1 == 1) {
                let x = place(m.side, corners[k]);
                found.insert(t[k], if m.reversed { 1.0 - x } else { x });
            }
        }
        let mut list: Vec<(f64, u32)> = found.into_iter().map(|(v, x)| (x, v)).collect();
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        list
    }

    /// Divides the triangle at a side between two vertices next to each other in further vertices,
    /// given by place and position. False if there is none.
    fn divide(&mut self, m: Member, [a, b]: [u32; 2], new: &[(f64, Point3)]) -> Option<Vec<u32>> {
        let on = |borders: &[u64; 3], k: usize| borders[k] >> m.side & 1 == 1;
        let (t, k, forward) = self
            .triangles
            .iter()
            .zip(&self.borders)
            .enumerate()
            .find_map(|(i, (t, borders))| {
                (0..3).find_map(|k| {
                    let l = (k + 1) % 3;
                    let edge = on(borders, k) && on(borders, l);
                    match () {
                        () if edge && [t[k], t[l]] == [a, b] => Some((i, k, true)),
                        () if edge && [t[k], t[l]] == [b, a] => Some((i, k, false)),
                        () => None,
                    }
                })
            })?;
        let (v, at, bits) = (self.triangles[t], self.corners[t], self.borders[t]);
        let (l, c) = ((k + 1) % 3, (k + 2) % 3);
        let first = self.points.len() as u32;
        let mut way: Vec<(u32, [f64; 2], u64)> = Vec::new();
        for &(x, p) in new {
            let own = if m.reversed { 1.0 - x } else { x };
            way.push((
                self.points.len() as u32,
                parameters(m.side, own),
                1 << m.side,
            ));
            self.points.push(p);
            self.kinds.push(Kind::Border);
            self.faces
                .push(self.faces[a as usize] & self.faces[b as usize]);
            self.double.push(false);
        }
        let made: Vec<u32> = (first..self.points.len() as u32).collect();
        if !forward {
            way.reverse();
        }
        way.insert(0, (v[k], at[k], bits[k]));
        way.push((v[l], at[l], bits[l]));
        for (i, w) in way.windows(2).enumerate() {
            let (triangle, corners, borders) = (
                [w[0].0, w[1].0, v[c]],
                [w[0].1, w[1].1, at[c]],
                [w[0].2, w[1].2, bits[c]],
            );
            if i == 0 {
                (self.triangles[t], self.corners[t], self.borders[t]) =
                    (triangle, corners, borders);
            } else {
                self.triangles.push(triangle);
                self.corners.push(corners);
                self.borders.push(borders);
                self.charts.push(self.charts[t]);
            }
        }
        Some(made)
    }
}

/// One surface of the surfaces of patches over [0, 1]²; `patches` says which each triangle is of.
/// Reports what does not fit.
pub(crate) fn join(patches: &[Patch], mut surfaces: Vec<Surface>, half_width: f64) -> Surface {
    let mut same: Vec<[(usize, u32); 2]> = Vec::new();
    let mut shared = vec![0u64; patches.len()];
    let mut most = 1;
    for members in curves(patches).into_iter().filter(|m| m.len() > 1) {
        most = most.max(members.len());
        members.iter().for_each(|m| shared[m.patch] |= 1 << m.side);
        let lists: Vec<Vec<(f64, u32)>> = members
            .iter()
            .map(|m| surfaces[m.patch].along(*m))
            .collect();
        let mut all: Vec<(f64, usize, u32)> = lists
            .iter()
            .enumerate()
            .flat_map(|(k, list)| list.iter().map(move |&(x, v)| (x, k, v)))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Places, and the vertex of each member there.
        let mut places: Vec<(f64, Vec<Option<u32>>)> = Vec::new();
        for (x, k, v) in all {
            let fits = places
                .last()
                .is_some_and(|p| x - p.0 < SAME && p.1[k].is_none());
            if !fits {
                places.push((x, vec![None; members.len()]));
            }
            if let Some(last) = places.last_mut() {
                last.1[k] = Some(v);
            }
        }
        let position = |surfaces: &[Surface], of: &[Option<u32>]| {
            let (k, v) = of
                .iter()
                .enumerate()
                .find_map(|(k, v)| v.map(|v| (k, v)))
                .expect("a vertex at every place");
            surfaces[members[k].patch].points[v as usize]
        };
        for (k, m) in members.iter().enumerate() {
            let known: Vec<usize> = (0..places.len())
                .filter(|&i| places[i].1[k].is_some())
                .collect();
            for w in known.windows(2).filter(|w| w[1] > w[0] + 1) {
                let new: Vec<(f64, Point3)> = (w[0] + 1..w[1])
                    .map(|i| (places[i].0, position(&surfaces, &places[i].1)))
                    .collect();
                let ends = [w[0], w[1]].map(|i| places[i].1[k].expect("known"));
                if let Some(made) = surfaces[m.patch].divide(*m, ends, &new) {
                    made.into_iter()
                        .zip(w[0] + 1..)
                        .for_each(|(v, i)| places[i].1[k] = Some(v));
                }
            }
        }
        for (_, of) in &places {
            let mut here = of
                .iter()
                .enumerate()
                .filter_map(|(k, v)| v.map(|v| (members[k].patch, v)));
            if let Some(first) = here.next() {
                same.extend(here.map(|other| [first, other]));
            }
        }
    }
    weld(patches, surfaces, &same, &shared, most, half_width)
}

/// Vertices at the corners of a patch by the point of space that they are.
fn corner_vertices(patch: &Patch, s: &Surface, half_width: f64) -> Vec<([RBig; 3], u32)> {
    let mut found = Vec::new();
    for side in 0..4 {
        let [x, y, z, w] = patch.side(side)[0];
        if w.is_zero() {
            continue;
        }
        let exact = [x, y, z].map(|x| x / w);
        let at = exact.each_ref().map(|x| x.to_f64().value());
        let bits = 1u64 << side | 1 << ((side + 3) % 4);
        let near =
            |v: u32| (0..3).all(|k| (s.points[v as usize][k] - at[k]).abs() <= SAME * half_width);
        let on = s
            .triangles
            .iter()
            .zip(&s.borders)
            .flat_map(|(t, b)| (0..3).filter(move |&k| b[k] & bits != 0).map(move |k| t[k]));
        found.extend(on.filter(|&v| near(v)).map(|v| (exact.clone(), v)));
    }
    found
}

/// Gives vertices that are one the same number.
fn weld(
    patches: &[Patch],
    surfaces: Vec<Surface>,
    same: &[[(usize, u32); 2]],
    shared: &[u64],
    most: usize,
    half_width: f64,
) -> Surface {
    let mut offsets = vec![0u32];
    for s in &surfaces {
        offsets.push(offsets[offsets.len() - 1] + s.points.len() as u32);
    }
    let mut up: Vec<u32> = (0..offsets[surfaces.len()]).collect();
    fn root(up: &mut [u32], mut v: u32) -> u32 {
        while up[v as usize] != v {
            up[v as usize] = up[up[v as usize] as usize];
            v = up[v as usize];
        }
        v
    }
    let mut unite = |a: u32, b: u32| {
        let (a, b) = (root(&mut up, a), root(&mut up, b));
        up[a.max(b) as usize] = a.min(b);
    };
    for pair in same {
        let [a, b] = pair.map(|(k, v)| offsets[k] + v);
        unite(a, b);
    }
    let mut corners: BTreeMap<[RBig; 3], u32> = BTreeMap::new();
    for (k, s) in surfaces.iter().enumerate() {
        for (exact, v) in corner_vertices(&patches[k], s, half_width) {
            let first = *corners.entry(exact).or_insert(offsets[k] + v);
            unite(first, offsets[k] + v);
        }
    }
    let mut joined = Surface {
        is_double_curve_known: surfaces.iter().all(|s| s.is_double_curve_known),
        is_outside: surfaces.iter().all(|s| s.is_outside),
        sheets: surfaces.iter().map(|s| s.sheets).max().unwrap_or(0),
        ..Surface::default()
    };
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    let mut unshared: Vec<[u64; 3]> = Vec::new();
    for (k, s) in surfaces.into_iter().enumerate() {
        for (i, t) in s.triangles.iter().enumerate() {
            let v = t.map(|v| {
                *number
                    .entry(root(&mut up, offsets[k] + v))
                    .or_insert_with(|| {
                        joined.points.push(s.points[v as usize]);
                        joined.kinds.push(s.kinds[v as usize]);
                        joined.faces.push(s.faces[v as usize]);
                        joined.double.push(s.double[v as usize]);
                        joined.points.len() as u32 - 1
                    })
            });
            if v[0] == v[1] || v[1] == v[2] || v[2] == v[0] {
                continue;
            }
            joined.triangles.push(v);
            joined.charts.push(s.charts[i]);
            joined.corners.push(s.corners[i]);
            joined.borders.push(s.borders[i]);
            unshared.push(s.borders[i].map(|b| b & !shared[k]));
            joined.patches.push(k as u32);
        }
        joined.double_curve.extend(s.double_curve);
        joined.solitary_arcs.extend(s.solitary_arcs);
        joined.grades.extend(s.grades);
        let named = |f: Finding| f.of_patch(&patches[k].name);
        joined.findings.extend(s.findings.into_iter().map(named));
    }
    if patches.len() > 1 {
        joined.grades.push(Claim::Sides.into());
    }
    check(&mut joined, &unshared, most);
    joined
}

/// Looks whether the mesh ends on the box and on sides of one patch only.
fn check(s: &mut Surface, unshared: &[[u64; 3]], most: usize) {
    let uses = s.edges(unshared);
    let open = s.open_edges(&uses);
    let crowded = uses
        .iter()
        .filter(|(e, (n, _))| *n > most.max(2) && !s.is_double(e))
        .count();
    if open > 0 {
        s.findings.push(Finding::SidesApart(open));
    }
    if crowded > 0 {
        s.findings.push(Finding::SidesCrowded(crowded));
    }
}
