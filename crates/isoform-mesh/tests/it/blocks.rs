//! Meshes in blocks: together they are one mesh, of the quality of the whole, whatever the cuts.

use crate::common::{PART, solid};
use isoform_check::{self as check, Certificate, certify};
use isoform_geom::{Mesh, Point3, Solid};
use isoform_mesh::blocks::{
    BLOCK_ROUNDS, DEFAULT_HALO_CELLS, INNER, Interfaces, MergedTetrahedra, Plan, Tetrahedra, close,
    holds, make, mend,
};
use isoform_mesh::{Control, MeshError, Options, mesh};

const GYROID: &str = "m(x[3], a[1]) {
    w = 6.283185307179586;
    g = sin(w*x[1])*cos(w*x[2]) + sin(w*x[2])*cos(w*x[3]) + sin(w*x[3])*cos(w*x[1]);
    m = min(0.95 - max(max(abs(x[1]), abs(x[2])), abs(x[3])), (0.6 - abs(g)) / (1.5*w));
}";

/// A model in blocks, in memory.
struct Blocks<'s> {
    solid: &'s dyn Solid,
    options: Options,
    plan: Plan,
    still: Vec<Tetrahedra>,
    live: Vec<Tetrahedra>,
    between: Interfaces,
}

impl<'s> Blocks<'s> {
    fn made(solid: &'s dyn Solid, counts: [usize; 3], size: f64, halo: usize) -> Self {
        let options = Options {
            size,
            ..Options::default()
        };
        let plan = Plan::new(solid, counts, &options, &Control::default()).expect("a plan");
        let mut this = Self {
            solid,
            options,
            plan,
            still: Vec::new(),
            live: Vec::new(),
            between: Interfaces::default(),
        };
        for k in 0..this.plan.blocks() {
            let (plan, options) = (&this.plan, &this.options);
            let made = make(solid, plan, options, k, halo, &Control::default()).expect("a block");
            assert_eq!(made.warnings, []);
            this.between.add(&made.faces);
            this.still.push(made.still);
            this.live.push(made.live);
        }
        this
    }

    /// Runs all rounds between blocks.
    fn mended(mut self) -> Self {
        for round in 1..BLOCK_ROUNDS {
            let room = |k| self.plan.room(round, k);
            let rooms = (0..self.plan.blocks()).map(|k| {
                let mut given = MergedTetrahedra::default();
                for live in &self.live {
                    given.add(live, |c| holds(&room(k), c));
                }
                let (plan, options) = (&self.plan, &self.options);
                let given = given.tetrahedra();
                mend(
                    self.solid,
                    plan,
                    options,
                    round,
                    &given,
                    &Control::default(),
                )
            });
            self.live = rooms.collect::<Result<_, _>>().expect("better blocks");
        }
        self
    }

    /// Merges all tetrahedra.
    fn all(&self) -> Tetrahedra {
        let mut all = MergedTetrahedra::default();
        for part in self.still.iter().chain(&self.live) {
            all.add(part, |_| true);
        }
        all.tetrahedra()
    }

    /// Returns the labelled meshes of all blocks, after comparing their faces.
    fn closed(&self) -> Vec<Mesh> {
        let (all, mut between) = (self.all(), Interfaces::default());
        let meshes = (0..self.plan.blocks()).map(|k| {
            let (plan, options) = (&self.plan, &self.options);
            let closed = close(self.solid, plan, options, k, &all, &Control::default());
            let closed = closed.expect("a mesh");
            assert_eq!(closed.warnings, []);
            between.add(&closed.faces);
            closed.mesh
        });
        let meshes = meshes.collect();
        assert_eq!(between.apart(), [] as [Point3; 0]);
        meshes
    }
}

/// Returns all blocks as one mesh, with its certificate.
fn certificate(solid: &dyn Solid, all: &Tetrahedra) -> Certificate {
    let mut mesh = Mesh {
        points: all.points.clone(),
        tets: all.tets.clone(),
        parts: solid.names().to_vec(),
        ..Mesh::default()
    };
    for (tet, labels) in all.tets.iter().zip(&all.labels) {
        for i in (0..4).filter(|&i| labels[i] != INNER) {
            let face = isoform_geom::TET_FACES[i].map(|k| tet[k]);
            mesh.triangles.push(face);
            mesh.triangle_parts.push(labels[i]);
        }
    }
    certify(
        &mesh,
        Some(solid),
        &check::Options::default(),
        &Control::default(),
    )
}

/// The certificate holds, and the worst angles are those of the whole mesh, nearly.
fn is_as_good_as_whole(text: &str, counts: [usize; 3], size: f64) {
    let solid = solid(text);
    let blocks = Blocks::made(&solid, counts, size, DEFAULT_HALO_CELLS);
    assert_eq!(blocks.between.apart(), [] as [Point3; 0]);
    assert!(blocks.between.pairs() > 0);
    let blocks = blocks.mended();
    let found = certificate(&solid, &blocks.all());
    let failures: Vec<String> = found.failures().iter().map(ToString::to_string).collect();
    assert!(found.is_ok(), "{failures:?}");
    let whole = mesh(&solid, &blocks.options, &Control::default()).expect("a mesh");
    let whole = certify(
        &whole.mesh,
        Some(&solid),
        &check::Options::default(),
        &Control::default(),
    );
    let figures = |c: &Certificate| {
        let (s, t) = (
            c.surface.as_ref().expect("one"),
            c.tets.as_ref().expect("some"),
        );
        (
            s.volume,
            s.euler,
            t.dihedral_min,
            c.volume.as_ref().map_or(0, |v| v.tets),
        )
    };
    let (mine, one) = (figures(&found), figures(&whole));
    println!("{counts:?}: {mine:?}, in one {one:?}");
    assert!((mine.0 / one.0 - 1.0).abs() < 1e-3);
    assert_eq!(mine.1, one.1);
    assert!(mine.2 > 0.8 * one.2, "{} and {} degrees", mine.2, one.2);
    let closed = blocks.closed();
    let count: usize = closed.iter().map(|m| m.tets.len()).sum();
    assert_eq!(count, mine.3);
    let (edges, corners) = closed
        .iter()
        .fold((0, 0), |n, m| (n.0 + m.edges.len(), n.1 + m.corners.len()));
    println!("{edges} edges, {corners} corners");
}

#[test]
fn a_part_in_blocks() {
    let counts = [[3, 2, 2], [2, 2, 1], [2, 1, 1]];
    for counts in counts.into_iter().take(isoform_testdata::cases(3, 1)) {
        is_as_good_as_whole(PART, counts, 0.3);
    }
}

#[test]
fn blocks_of_few_cells() {
    is_as_good_as_whole(PART, [2, 2, 1], 0.8);
}

#[test]
fn a_gyroid_in_blocks() {
    let size = if isoform_testdata::is_full() {
        0.08
    } else {
        0.12
    };
    is_as_good_as_whole(GYROID, [2, 2, 2], size);
}

/// Without a halo cells at the sides do not see their neighbours, and faces of blocks differ.
#[test]
fn too_small_a_halo_is_seen() {
    let solid = solid(PART);
    let blocks = Blocks::made(&solid, [2, 1, 1], 0.3, 0);
    let apart = blocks.between.apart();
    assert!(!apart.is_empty());
    let side = blocks.plan.room(0, 0).hi[0];
    assert!(apart.iter().all(|p| (p[0] - side).abs() < 1.0));
}

/// A node that differs in one bit on one side of an interface is detected.
#[test]
fn one_bit_is_seen() {
    let solid = solid(PART);
    let blocks = Blocks::made(&solid, [2, 1, 1], 0.4, DEFAULT_HALO_CELLS);
    let mut between = Interfaces::default();
    let mut faces = Vec::new();
    for k in 0..2 {
        let mut all = MergedTetrahedra::default();
        all.add(&blocks.still[k], |_| true);
        all.add(&blocks.live[k], |_| true);
        let mut all = all.tetrahedra();
        if k == 1 {
            let face = faces.first().map(|f: &isoform_mesh::blocks::OpenFace| f.at);
            let at = face.expect("an interface");
            let near = |p: &Point3| isoform_geom::distance_squared(*p, at);
            let p = all
                .points
                .iter_mut()
                .min_by(|p, q| near(p).total_cmp(&near(q)));
            let p = p.expect("nodes");
            p[2] = p[2].next_up();
        }
        faces = isoform_mesh::blocks::open_faces(&all);
        between.add(&faces);
    }
    assert!(!between.apart().is_empty());
}

#[test]
fn what_cannot_be_in_blocks() {
    let solid = solid(PART);
    let plan = |counts, options: &Options| {
        Plan::new(&solid, counts, options, &Control::default()).map(|p| p.counts)
    };
    let usual = Options {
        size: 0.8,
        ..Options::default()
    };
    assert_eq!(plan([2, 2, 1], &usual), Ok([2, 2, 1]));
    for counts in [[0, 1, 1], [1, 1, 6]] {
        let error = plan(counts, &usual).expect_err("too few or too many");
        assert!(matches!(error, MeshError::Blocks { .. }), "{error}");
    }
    let second = Options {
        order: 2,
        ..usual.clone()
    };
    assert!(matches!(
        plan([1; 3], &second),
        Err(MeshError::Option { name: "order", .. })
    ));
}
