//! A referee: fidget's manifold dual contouring. `fidget_mesher SOLID DEPTH THREADS jit|vm
//! [OUT.raw]`.
//!
//! The solids are those of the programs *.hf; fidget's inside is where f < 0. Its octree fills a
//! cube around the solid with a margin of
//! 5 %, and of a 1000th to one side: no face of a solid lies on the faces of cells.

use fidget::context::Tree;
use fidget::eval::{Function, MathFunction};
use fidget::jit::JitFunction;
use fidget::mesh::{Mesh, Octree, Settings};
use fidget::render::{RenderHints, ThreadPool};
use fidget::shape::Shape;
use fidget::vm::VmFunction;
use peers::Raw;

fn c(v: f64) -> Tree {
    Tree::constant(v as f32)
}

/// Outside of a slab, for every axis; the box is where none is positive.
fn block(lo: [f64; 3], hi: [f64; 3]) -> Tree {
    let (x, y, z) = Tree::axes();
    let sides = [x, y, z]
        .into_iter()
        .zip(lo.into_iter().zip(hi))
        .map(|(x, (lo, hi))| (c(lo) - x.clone()).max(x - c(hi)));
    sides.reduce(|a, b| a.max(b)).expect("three axes")
}

fn cylinder_z(cx: f64, cy: f64, r: f64) -> Tree {
    ((Tree::x() - c(cx)).square() + (Tree::y() - c(cy)).square()).sqrt() - c(r)
}

/// The solid, the middle of its box and half of the box's largest side.
fn solid(name: &str) -> Option<(Tree, [f64; 3], f64)> {
    let (x, y, z) = Tree::axes();
    Some(match name {
        "part" => {
            let cut = cylinder_z(-2.0, -1.5, 1.25).min(cylinder_z(3.0, 0.5, 1.5));
            (
                block([-5.0, -4.0, -2.0], [5.0, 1.0, 2.0]).max(c(0.0) - cut),
                [0.0, -1.5, 0.0],
                5.0,
            )
        }
        "sphere" => (
            (x.square() + y.square() + z.square()).sqrt() - c(1.0),
            [0.0; 3],
            1.0,
        ),
        "blend" => {
            let plate = block([-3.0, -2.0, -0.5], [3.0, 2.0, 0.5]);
            let boss = cylinder_z(0.0, 0.0, 1.0).max((z.clone() - c(2.5)).max(c(0.0) - z));
            let h = (c(0.4) - (plate.clone() - boss.clone()).abs()).max(c(0.0)) / c(0.4);
            let joined = plate.min(boss) - h.square() * c(0.1);
            (
                joined.max(c(0.0) - cylinder_z(0.0, 0.0, 0.5)),
                [0.0, 0.0, 1.0],
                3.0,
            )
        }
        "gyroid" => {
            let w = c(std::f64::consts::TAU);
            let [x, y, z] = [x, y, z].map(|x| x * w.clone());
            let sheet = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
            let walls = (sheet.abs() - c(0.6)) / c(1.5 * std::f64::consts::TAU);
            (block([-0.95; 3], [0.95; 3]).max(walls), [0.0; 3], 0.95)
        }
        _ => return None,
    })
}

/// The mesh, with one of fidget's two evaluators.
fn mesh<F: MathFunction + Function + RenderHints + Clone>(
    tree: Tree,
    settings: &Settings,
) -> Result<Mesh, Box<dyn std::error::Error>> {
    let shape = Shape::<F>::from(tree).try_into()?;
    Ok(Octree::build(&shape, settings)
        .ok_or("stopped")?
        .walk_dual())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [name, depth, threads, with, out @ ..] = args.as_slice() else {
        return Err("fidget_mesher SOLID DEPTH THREADS jit|vm [OUT.raw]".into());
    };
    let (tree, middle, half) = solid(name).ok_or("the solids are part, sphere, blend, gyroid")?;
    let threads: usize = threads.parse()?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;
    let mut settings = Settings {
        depth: depth.parse()?,
        threads: (threads > 1).then_some(&ThreadPool::Global),
        ..Settings::default()
    };
    for i in 0..3 {
        settings.world_to_model[(i, i)] = (1.05 * half) as f32;
        settings.world_to_model[(i, 3)] = (middle[i] + 0.001 * half) as f32;
    }
    let mesh = if with == "jit" {
        mesh::<JitFunction>(tree, &settings)?
    } else {
        mesh::<VmFunction>(tree, &settings)?
    };
    if let Some(path) = out.first() {
        let points = mesh
            .vertices
            .iter()
            .map(|p| [p.x, p.y, p.z].map(f64::from))
            .collect();
        let triangles = mesh
            .triangles
            .iter()
            .map(|t| [t.x, t.y, t.z].map(|v| v as u32))
            .collect();
        Raw {
            points,
            triangles,
            tets: Vec::new(),
        }
        .write(path)?;
    }
    Ok(())
}
