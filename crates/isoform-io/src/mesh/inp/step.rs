//! Example of a step, in comment lines at the end of the file: material, sections, a support, a
//! pressure, a static step and its results, with the names of the mesh.
//!
//! Each line is one of the deck behind the mark of a comment, so that it runs in CalculiX once the
//! mark is removed. Explanations have the mark twice and stay comments.

use super::super::boundary::{ElementSide, wall_faces};
use super::super::group::{face, volume_count};
use super::super::options::MeshWriteOptions;
use super::super::out::Out;
use super::{AllGroups, GroupNames};
use isoform_geom::{Mesh, Point3, UnionFind, cross, distance_squared, dot, sub};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io;

/// Line before the example. What follows it is the deck, behind two characters.
const HEAD: &str =
    "STEP: to run it in CalculiX, remove the first two characters of each line below";
/// Young's modulus of steel, in pascal.
const YOUNG_PA: f64 = 210e9;
/// Poisson's ratio of steel.
const POISSON: &str = "0.3";
/// Pressure of the example, in pascal.
const PRESSURE_PA: f64 = 1e6;
/// Newtons in a pound-force: 0.45359237 kg at 9.80665 m/s².
const NEWTONS_PER_POUND: f64 = 4.448_221_615_260_5;

/// Support and load of the example.
struct Example {
    /// Parts whose nodes are held.
    fixed: Vec<usize>,
    /// Part under pressure.
    pressed: usize,
    /// Held nodes with the first and last held direction, from 1: of the pieces that no held part
    /// bounds.
    held: Vec<(u32, [usize; 2])>,
}

/// Writes the example; nothing for a mesh without volumes, or without a part on them.
pub(super) fn write(
    mesh: &Mesh,
    groups: &AllGroups,
    names: &GroupNames,
    sides: &[Option<ElementSide>],
    options: &MeshWriteOptions,
    out: &mut Out<'_>,
) -> io::Result<()> {
    if volume_count(mesh) == 0 {
        return Ok(());
    }
    let Some(example) = Example::of_mesh(mesh, groups, sides) else {
        return Ok(());
    };
    out.str("**\n** ").str(HEAD).line()?;
    let units = Units::new(options);
    write_materials(names, &units, out)?;
    example.write_supports(names, out)?;
    let pressed = &names.parts[example.pressed];
    let pressure = units.stress(PRESSURE_PA);
    let lines = [
        "*STEP".to_owned(),
        "*STATIC".to_owned(),
        format!("** Pressure, in {}, positive into the solid", units.name()),
        "*DSLOAD".to_owned(),
        format!("{pressed}, P, {pressure}"),
        "** Results: displacements and stresses in .frd, forces on the support in .dat".to_owned(),
        "*NODE FILE".to_owned(),
        "U".to_owned(),
        "*EL FILE".to_owned(),
        "S, E".to_owned(),
    ];
    lines.iter().try_for_each(|line| put(out, line))?;
    for &part in &example.fixed {
        put(
            out,
            &format!("*NODE PRINT, NSET={}, TOTALS=YES", names.parts[part]),
        )?;
        put(out, "RF")?;
    }
    put(out, "*END STEP")
}

/// Writes a line of the deck behind the mark of a comment.
fn put(out: &mut Out<'_>, line: &str) -> io::Result<()> {
    out.str("**").str(line).line()
}

/// Writes a material and a section for each region.
fn write_materials(names: &GroupNames, units: &Units, out: &mut Out<'_>) -> io::Result<()> {
    put(
        out,
        &format!(
            "** Steel: Young's modulus in {}, Poisson's ratio",
            units.name()
        ),
    )?;
    if units.length.is_none() {
        put(
            out,
            "** (the lengths of the mesh are taken for mm, as nothing is stated)",
        )?;
    }
    for (i, region) in names.regions.iter().enumerate() {
        let material = match names.regions.len() {
            1 => "STEEL".to_owned(),
            _ => format!("STEEL_{}", i + 1),
        };
        put(out, &format!("*MATERIAL, NAME={material}"))?;
        put(out, "*ELASTIC")?;
        put(out, &format!("{}, {POISSON}", units.stress(YOUNG_PA)))?;
        let section = format!("*SOLID SECTION, ELSET={region}, MATERIAL={material}");
        put(out, &section)?;
    }
    Ok(())
}

/// Units of the example's numbers.
struct Units<'u> {
    /// Unit of length and the metres in it; `None` if it is unknown.
    length: Option<(&'u str, f64)>,
}

impl<'u> Units<'u> {
    /// Returns the units that go with the unit of length of a file.
    fn new(options: &'u MeshWriteOptions) -> Self {
        Self {
            length: options.units.as_deref().zip(options.metres()),
        }
    }
    /// Returns the unit of stress: a force by the square of the unit of length.
    fn name(&self) -> String {
        let length = self.length.map_or("mm", |l| l.0);
        format!(
            "{}/{length}^2",
            if self.is_imperial() { "lbf" } else { "N" }
        )
    }
    fn is_imperial(&self) -> bool {
        matches!(self.length, Some(("in" | "ft", _)))
    }
    /// Converts a stress in pascal, rounded to four digits.
    fn stress(&self, pascal: f64) -> f64 {
        let metres = self.length.map_or(1e-3, |l| l.1);
        let newtons = pascal * metres * metres;
        let force = match self.is_imperial() {
            true => newtons / NEWTONS_PER_POUND,
            false => newtons,
        };
        format!("{force:.3e}").parse().expect("a number as printed")
    }
}

impl Example {
    /// Chooses the first part that bounds the solid as the support, with further ones if the solid
    /// has several pieces, and the next part as the loaded one, see [`unheld`]. Without a part for
    /// each, single nodes of each piece are held. `None` without a part on the volumes.
    fn of_mesh(mesh: &Mesh, groups: &AllGroups, sides: &[Option<ElementSide>]) -> Option<Self> {
        let parts = usable_parts(mesh, groups, sides);
        let mut pieces = pieces(mesh);
        let mut open: BTreeSet<u32> = mesh.tets.iter().map(|t| pieces.root(t[0])).collect();
        open.extend(mesh.wedges.iter().map(|w| pieces.root(w[0])));
        let all = open.clone();
        let mut fixed = Vec::new();
        for &part in &parts {
            let faces = groups.parts.elements(part).iter();
            let at: Vec<u32> = faces
                .map(|&f| pieces.root(face(mesh, f as usize).0[0]))
                .collect();
            let before = open.len();
            at.iter().for_each(|piece| {
                open.remove(piece);
            });
            if open.len() < before {
                fixed.push(part);
            }
        }
        let mut pressed = unheld(mesh, groups, &parts, &fixed);
        if pressed.is_none() {
            pressed = parts.first().copied();
            fixed.clear();
            open = all;
        }
        Some(Self {
            pressed: pressed?,
            fixed,
            held: hold_all(mesh, &mut pieces, &open),
        })
    }

    /// Writes the support.
    fn write_supports(&self, names: &GroupNames, out: &mut Out<'_>) -> io::Result<()> {
        put(
            out,
            match self.held.is_empty() {
                true => "** Support: all displacements are zero",
                false => "** Support: held against motion as a whole alone",
            },
        )?;
        put(out, "*BOUNDARY")?;
        for &part in &self.fixed {
            put(out, &format!("{}, 1, 3", names.parts[part]))?;
        }
        for (node, [first, last]) in &self.held {
            put(out, &format!("{}, {first}, {last}", node + 1))?;
        }
        Ok(())
    }
}

/// Returns the first part that shares no node with the held parts, else the first that is not
/// held; `None` if all are. Where the load acts on held nodes the support takes it at once, and the
/// sum of its forces is less than the load.
fn unheld(mesh: &Mesh, groups: &AllGroups, parts: &[usize], fixed: &[usize]) -> Option<usize> {
    let corners = |&part: &usize| {
        let faces = groups.parts.elements(part).iter();
        faces.flat_map(|&f| face(mesh, f as usize).0.into_iter().take(3))
    };
    let held: HashSet<u32> = fixed.iter().flat_map(corners).collect();
    let mut free = parts.iter().filter(|part| !fixed.contains(part));
    let apart = free
        .clone()
        .find(|part| !corners(part).any(|v| held.contains(&v)));
    apart.or_else(|| free.next()).copied()
}

/// Returns the parts with faces on volumes; those without walls between regions, if there are any.
fn usable_parts(mesh: &Mesh, groups: &AllGroups, sides: &[Option<ElementSide>]) -> Vec<usize> {
    let walls = match mesh.regions.len() {
        0 | 1 => Vec::new(),
        _ => wall_faces(mesh),
    };
    let filled = groups.parts.filled();
    let on_volumes: Vec<(usize, &[u32])> = filled
        .filter(|(_, faces)| faces.iter().all(|&f| sides[f as usize].is_some()))
        .collect();
    let is_wall = |f: &u32| walls.get(*f as usize) == Some(&true);
    let outer = on_volumes
        .iter()
        .filter(|(_, faces)| !faces.iter().any(is_wall));
    let outer: Vec<usize> = outer.map(|(part, _)| *part).collect();
    match outer.is_empty() {
        true => on_volumes.into_iter().map(|(part, _)| part).collect(),
        false => outer,
    }
}

/// Returns the nodes by connected piece of the solid.
fn pieces(mesh: &Mesh) -> UnionFind {
    let mut pieces = UnionFind::new(mesh.points.len());
    let mut join = |nodes: &[u32]| {
        for &node in &nodes[1..] {
            pieces.unite(nodes[0], node);
        }
    };
    mesh.tets.iter().for_each(|nodes| join(nodes));
    mesh.wedges.iter().for_each(|nodes| join(nodes));
    pieces
}

/// Returns the nodes and directions that hold some pieces, in the order of the pieces.
fn hold_all(mesh: &Mesh, pieces: &mut UnionFind, open: &BTreeSet<u32>) -> Vec<(u32, [usize; 2])> {
    if open.is_empty() {
        return Vec::new();
    }
    let mut nodes: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for node in 0..mesh.points.len() as u32 {
        let piece = pieces.root(node);
        if open.contains(&piece) {
            nodes.entry(piece).or_default().push(node);
        }
    }
    nodes
        .iter()
        .flat_map(|(&piece, nodes)| hold(mesh, piece, nodes))
        .collect()
}

/// Returns nodes and directions that hold a piece against motion as a whole, and no more: three
/// directions at a node, two at the node farthest from it, across the way there, and one at the
/// node farthest from both, across their plane. In each case the direction of the largest component
/// keeps the equations well conditioned.
fn hold(mesh: &Mesh, piece: u32, nodes: &[u32]) -> Vec<(u32, [usize; 2])> {
    let at = |node: u32| mesh.points[node as usize];
    let farthest = |distance: &dyn Fn(Point3) -> f64| {
        let nodes = nodes.iter().copied();
        nodes.reduce(|a, b| {
            if distance(at(b)) > distance(at(a)) {
                b
            } else {
                a
            }
        })
    };
    let origin = at(piece);
    let second = farthest(&|p| distance_squared(p, origin)).unwrap_or(piece);
    let way = sub(at(second), origin);
    let square = |v: Point3| dot(v, v);
    let third = farthest(&|p| square(cross(way, sub(p, origin)))).unwrap_or(piece);
    let normal = cross(way, sub(at(third), origin));
    let across = largest(way);
    let sides = (1..=3).filter(|&k| k != across).map(|k| (second, [k, k]));
    let mut held = vec![(piece, [1, 3])];
    held.extend(sides);
    let k = largest(normal);
    held.push((third, [k, k]));
    held
}

/// Returns the direction of the largest component, from 1.
fn largest(v: Point3) -> usize {
    (1..3).fold(
        0,
        |best, k| if v[k].abs() > v[best].abs() { k } else { best },
    ) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the rank of rows of six numbers, by elimination with pivots.
    fn rank(mut rows: Vec<[f64; 6]>) -> usize {
        let mut rank = 0;
        for column in 0..6 {
            let size = |row: &[f64; 6]| row[column].abs();
            let pivots =
                (rank..rows.len()).max_by(|&i, &j| size(&rows[i]).total_cmp(&size(&rows[j])));
            let Some(pivot) = pivots.filter(|&i| size(&rows[i]) > 1e-9) else {
                continue;
            };
            rows.swap(rank, pivot);
            let first = rows[rank];
            for row in &mut rows[rank + 1..] {
                let share = row[column] / first[column];
                (0..6).for_each(|k| row[k] -= share * first[k]);
            }
            rank += 1;
        }
        rank
    }

    /// A motion as a whole is u + ω × x: six unknowns, which six held displacements make zero.
    #[test]
    fn held_nodes_stop_every_motion_as_a_whole() {
        let mut seed = 3_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        for stretch in [[1.0; 3], [9.0, 1.0, 1.0], [1.0, 1.0, 9.0], [1.0, 9.0, 0.1]] {
            let points: Vec<Point3> = (0..20).map(|_| stretch.map(|s| s * next())).collect();
            let mesh = Mesh {
                points,
                ..Mesh::default()
            };
            let nodes: Vec<u32> = (0..20).collect();
            let held = hold(&mesh, 0, &nodes);
            let mut rows = Vec::new();
            for (node, [first, last]) in held {
                let [x, y, z] = mesh.points[node as usize];
                let turned = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]];
                for k in first - 1..last {
                    let mut row = [0.0; 6];
                    row[k] = 1.0;
                    row[3..].copy_from_slice(&turned[k]);
                    rows.push(row);
                }
            }
            assert_eq!((rows.len(), rank(rows)), (6, 6));
        }
    }

    #[test]
    fn numbers_go_with_the_lengths() {
        let said = |unit: Option<&str>| {
            let options = MeshWriteOptions {
                units: unit.map(str::to_owned),
                ..MeshWriteOptions::default()
            };
            let units = Units::new(&options);
            (units.stress(YOUNG_PA), units.name())
        };
        assert_eq!(said(Some("mm")), (210_000.0, "N/mm^2".to_owned()));
        assert_eq!(said(None), said(Some("mm")));
        assert_eq!(said(Some("m")), (2.1e11, "N/m^2".to_owned()));
        // 210 GPa are 30.46 million pounds per square inch.
        assert_eq!(said(Some("in")), (3.046e7, "lbf/in^2".to_owned()));
        assert_eq!(said(Some("furlong")).0, 210_000.0);
    }
}
