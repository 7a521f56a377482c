//! The pipeline from a solid to a mesh.
//!
//! Extent → lattice → features → sizes → cutting → optimisation → assembly → second order. Each
//! phase takes the values of the phases before it and reports itself to the [`Control`].

use crate::assemble::{CoreConnection, assemble_surface, assemble_volume};
use crate::band::{Band, Core};
use crate::crowd::Crowd;
use crate::cut::Cutter;
use crate::divided::{DividedSolid, Layer, Region};
use crate::error::{MeshError, Warning, WarningKind};
use crate::features::{Extent, FeatureOptions, Features, find};
use crate::inside::Inside;
use crate::lattice::{CELL_EDGE, Lattice};
use crate::optimise::Optimiser;
use crate::options::{self, Options};
use crate::refine::Refiner;
use crate::regions::Regions;
use crate::second::{raise_order, turned};
use crate::surface::{LayerCells, Surface};
use crate::torn::torn;
use crate::torus::Torus;
use crate::unit_cell::{pair_sides, sides_of};
use crate::unmeshed::{UnmeshedSurface, find_unmeshed};
use isoform_check::{self as check, Failure, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid};

/// Number of consecutive rounds without fewer defects after which no further mesh is tried.
const MAX_STALLED_ROUNDS: usize = 2;
/// Number of triangles per defect at or below which the mesh counts as wrong everywhere, and is not
/// refined locally: touching bodies have more defects, a needle that can be mended about one in ten
/// triangles.
const GLOBAL_FAILURE_RATIO: usize = 8;
/// Number of tetrahedra per cell of the lattice, and of bytes per tetrahedron that is not near the
/// surface.
const CELL_TETS_AND_BYTES: [f64; 2] = [12.0, 60.0];

/// A mesh with the box, features and warnings of its construction.
#[derive(Clone, Debug)]
pub struct Meshed {
    /// The mesh.
    pub mesh: Mesh,
    /// Box that was meshed.
    pub region: Aabb,
    /// True if intervals prove that the solid has no points outside of the box.
    pub region_certified: bool,
    /// Names of the caps where the box cuts the solid.
    pub caps: Vec<String>,
    /// Feature curves and corners of the solid.
    pub features: Features,
    /// Features of each requested region, and of the rest.
    pub region_features: Vec<Features>,
    /// Parts of the solid that the mesh may have missed.
    pub missed: UnmeshedSurface,
    /// Places where the solid could not be resolved, with the reason.
    pub warnings: Vec<Warning>,
}

/// Sets the names of the caps of a mesh.
pub(crate) fn with_caps(mut meshed: Meshed) -> Meshed {
    let is_cap = |name: &&String| name.starts_with("cap.");
    meshed.caps = meshed.mesh.parts.iter().filter(is_cap).cloned().collect();
    meshed
}

/// Meshes a solid whose extent is known. Where the certificate finds defects of the surface, and
/// where vertices held on seams between pieces that touch keep others off it, the solid is meshed
/// again, finer there; finally without holding vertices on seams. Returns the mesh with the fewest
/// defects.
pub(crate) fn mesh_within(
    model: Model<'_>,
    torus: Option<Torus>,
    extent: &Extent,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    let Model { solid, regions, .. } = model;
    let (whole, whole_regions) = model.target;
    let sides = torus.map_or_else(Vec::new, sides_of);
    let mut divided = DividedSolid::new(solid, regions);
    for side in &sides {
        divided.add(side, "side");
    }
    let layers: Vec<Layer<'_>> = divided.layers();
    let solids: Vec<&dyn Solid> = match layers.as_slice() {
        [_] => vec![solid],
        _ => layers.iter().map(|layer| layer as &dyn Solid).collect(),
    };
    let mut lattices: Vec<Lattice> = Vec::new();
    for solid in &solids {
        let lattice = lattice_over(*solid, extent.bounds, torus, options, control)?;
        let of = |lattice| Surface::new(*solid, lattice, extent.bounds, control);
        // A divider may be NaN outside of the whole.
        let whole = lattices
            .first()
            .map(|whole| Surface::new(solids[0], whole, extent.bounds, control));
        let is_asked = |p| whole.as_ref().is_none_or(|whole| whole.value(p).0 > 0.0);
        if let Some(at) = of(&lattice).not_a_number(is_asked) {
            return Err(MeshError::NotANumber { at });
        }
        lattices.push(lattice);
    }
    control.check()?;
    control.begin("features")?;
    let features = features_of(whole, extent.bounds, options, control);
    let find = |solid: &dyn Solid| features_of(solid, extent.bounds, options, control);
    let parts = Regions::new(whole, whole_regions, find);
    let ground = MeshJob {
        whole,
        solid: solids[0],
        torus,
        extent,
        lattice: &lattices[0],
        layers: &divided.with_cells(&lattices),
        regions: &parts,
        features: &features,
        options,
        control,
    };
    let mut course = AttemptSettings {
        seams: true,
        finer: Vec::new(),
    };
    let mut best = ground.meshed(&course)?;
    if options.rounds == 0 {
        return Ok(best.meshed);
    }
    let mut wrong = ground.wrong(&best);
    if wrong.places.is_empty() {
        return Ok(best.meshed);
    }
    // A stop on the way leaves the best mesh so far.
    let mut fewest = wrong.count;
    let mut in_vain = 0;
    for _ in 0..options.rounds {
        course.add(&wrong.places, options.size);
        let Ok(next) = ground.meshed(&course) else {
            return Ok(best.meshed);
        };
        wrong = ground.wrong(&next);
        in_vain += 1;
        if wrong.count < fewest {
            (best, fewest, in_vain) = (next, wrong.count, 0);
        }
        if wrong.count == [0, 0] {
            return Ok(best.meshed);
        }
        if wrong.places.is_empty() || in_vain >= MAX_STALLED_ROUNDS {
            break;
        }
    }
    if !best.has_seams || best.off().is_empty() {
        return Ok(best.meshed);
    }
    let without = AttemptSettings {
        seams: false,
        finer: Vec::new(),
    };
    match ground.meshed(&without) {
        Ok(without) if ground.wrong(&without).count < fewest => Ok(without.meshed),
        _ => Ok(best.meshed),
    }
}

/// Solid and regions to be meshed.
pub(crate) struct Model<'a> {
    pub(crate) solid: &'a dyn Solid,
    pub(crate) regions: &'a [Region<'a>],
    /// Solid and regions that the mesh must represent: those given, or those of a unit cell in its
    /// box.
    pub(crate) target: (&'a dyn Solid, &'a [Region<'a>]),
}

impl<'a> Model<'a> {
    pub(crate) fn new(solid: &'a dyn Solid, regions: &'a [Region<'a>]) -> Self {
        Self {
            solid,
            regions,
            target: (solid, regions),
        }
    }
}

/// Settings of one attempt to mesh a solid.
struct AttemptSettings {
    /// True if vertices are held on seams between pieces that touch.
    seams: bool,
    /// Places for shorter edges, with the length.
    finer: Vec<(Point3, f64)>,
}

impl AttemptSettings {
    /// Adds places with defects, to be meshed with edges half as long as before.
    fn add(&mut self, wrong: &[Point3], size: f64) {
        let before = Crowd::of_places(&self.finer, size);
        let halved = |at: &Point3| (*at, 0.5 * before.size_at(*at, &mut Vec::new()).min(size));
        self.finer.extend(wrong.iter().map(halved));
    }
}

/// Result of an attempt.
struct Attempt {
    meshed: Meshed,
    /// True if there are seams between pieces that touch.
    has_seams: bool,
}

impl Attempt {
    /// Returns the vertices that could not be moved onto the surface.
    fn off(&self) -> Vec<Point3> {
        let warnings = self.meshed.warnings.iter();
        let off = warnings.filter(|w| w.kind == WarningKind::VertexOff);
        off.filter_map(|w| w.at).collect()
    }
}

/// Returns the places where mid nodes invert tetrahedra, or are off the surface.
fn bent_wrong(meshed: &Meshed) -> Vec<Point3> {
    let off = meshed
        .warnings
        .iter()
        .filter(|w| w.kind == WarningKind::MiddleOff);
    off.filter_map(|w| w.at)
        .chain(turned(&meshed.mesh))
        .collect()
}

/// Defects of a mesh.
struct Defects {
    /// Number of defects found by the certificate and warnings; then number of those of mid nodes.
    count: [usize; 2],
    /// Places to be meshed finer; empty if the mesh is wrong everywhere.
    places: Vec<Point3>,
}

/// Input that all attempts for a solid share.
struct MeshJob<'a> {
    /// Solid that the mesh must represent.
    whole: &'a dyn Solid,
    /// The solid with the pieces of all layers.
    solid: &'a dyn Solid,
    /// Box of a unit cell.
    torus: Option<Torus>,
    extent: &'a Extent,
    lattice: &'a Lattice,
    /// Layers of a solid that is divided into regions; empty otherwise.
    layers: &'a [LayerCells<'a>],
    /// Regions into which the solid is divided.
    regions: &'a Regions<'a>,
    features: &'a Features,
    options: &'a Options,
    control: &'a Control<'a>,
}

impl MeshJob<'_> {
    /// Returns the defects of the surface, and the places where the mesh misses a part of the
    /// solid. If the defects are everywhere, as with touching bodies or functions that jump, no
    /// size helps, except for vertices off the surface if there are seams.
    fn wrong(&self, of: &Attempt) -> Defects {
        let Meshed {
            mesh,
            missed,
            warnings,
            ..
        } = &of.meshed;
        let failures = self.surface_failures(mesh);
        let here = |w: &&Warning| {
            use WarningKind::{NotCut, StrayFace, Torn, VertexOff};
            matches!(w.kind, NotCut(_) | StrayFace | Torn | VertexOff)
        };
        let told = warnings.iter().filter(here).filter_map(|w| w.at);
        let mut places: Vec<Point3> = told.chain(missed.places()).collect();
        let bent = bent_wrong(&of.meshed);
        let count = places.len() + failures.iter().map(|f| f.count).sum::<usize>();
        if count >= mesh.triangles.len().div_ceil(GLOBAL_FAILURE_RATIO) {
            let places = if of.has_seams { of.off() } else { Vec::new() };
            let count = [count, bent.len()];
            return Defects { count, places };
        }
        let found = failures
            .iter()
            .flat_map(|f| f.place.iter().chain(&f.others));
        places.extend(found.map(|p| p.at));
        // Mid nodes come second: while the mesh itself has defects, they mean little.
        let is_bent_here =
            count == 0 && bent.len() < mesh.triangles.len().div_ceil(GLOBAL_FAILURE_RATIO);
        let count = [count, bent.len()];
        if is_bent_here {
            places = bent;
        }
        Defects { count, places }
    }

    /// Returns the failures in the certificate of the surface, and of each region.
    fn surface_failures(&self, mesh: &Mesh) -> Vec<Failure> {
        let outer = mesh.without_walls();
        let mut failures = self.failures_of(&outer, self.whole, self.features);
        for part in self.regions.parts_of(mesh) {
            failures.extend(self.failures_of(&part.mesh, part.solid, part.features));
        }
        failures
    }

    /// Returns the failures in the certificate of a surface alone.
    fn failures_of(&self, mesh: &Mesh, solid: &dyn Solid, features: &Features) -> Vec<Failure> {
        let surface = Mesh {
            points: mesh.points.clone(),
            triangles: mesh.triangles.clone(),
            triangle_parts: mesh.triangle_parts.clone(),
            parts: mesh.parts.clone(),
            edges: mesh.edges.clone(),
            edge_curves: mesh.edge_curves.clone(),
            curves: mesh.curves.clone(),
            corners: mesh.corners.clone(),
            opposite: mesh.opposite.clone(),
            ..Mesh::default()
        };
        let curves = features.curves.iter().map(|c| c.points.clone());
        let corners = features.corners.iter();
        let corners = corners.filter(|c| c.needs_node());
        let options = check::Options {
            places: 1000,
            size: Some(self.options.size),
            region: self.options.region,
            // Regions are certified without their sides.
            periodic: self
                .options
                .periodic
                .map(|p| p && !mesh.opposite.is_empty()),
            curves: &curves.collect::<Vec<_>>(),
            corners: &corners.map(|c| c.point).collect::<Vec<_>>(),
            ..check::Options::default()
        };
        // The final mesh is certified again, with progress.
        let control = Control {
            progress: None,
            ..*self.control
        };
        certify(&surface, Some(solid), &options, &control).failures()
    }

    /// Meshes the solid with the settings of one attempt.
    fn meshed(&self, course: &AttemptSettings) -> Result<Attempt, MeshError> {
        let Self {
            solid,
            lattice,
            layers,
            options,
            control,
            ..
        } = *self;
        let region = self.extent.bounds;
        let mut apexes = self.features.apexes();
        apexes.extend(self.regions.apexes());
        if self.regions.features.is_empty() && self.torus.is_none() {
            apexes.extend(self.features.contacts());
        }
        let dividers = self.regions.features.len().max(1) - 1;
        let in_focus = |focus: usize| Surface {
            seams: course.seams,
            layers,
            dividers,
            torus: self.torus,
            focus,
            apexes: apexes.clone(),
            ..Surface::new(solid, lattice, region, control)
        };
        let surface = in_focus(0);
        let dividers: Vec<Surface<'_>> = (1..=dividers).map(in_focus).collect();
        let is_graded = options.grade.is_some() || options.sizes.is_some();
        let all = is_graded || !layers.is_empty();
        let band = match self.torus {
            Some(torus) => Band::on_torus(lattice, torus, control),
            None => Band::new(lattice, !options.surface_only, all, control),
        };
        let band_points = band.complex.points.len();
        let mut refiner = Refiner {
            complex: band.complex,
            frozen: band.frozen,
            limit: options.most_tetrahedra(),
            control,
        };
        let features: Vec<&Features> = match self.regions.features.as_slice() {
            [] => vec![self.features],
            parts => parts.iter().collect(),
        };
        let crowd = Crowd::new(&features, &course.finer, options.size);
        let mut warnings = refine(&mut refiner, &surface, &dividers, &crowd, options)?;
        let inside = cut(
            refiner,
            &surface,
            &dividers,
            &band.core,
            options,
            &mut warnings,
        )?;
        let joined = CoreConnection {
            core: band.core,
            band_points,
            number: inside.number.clone(),
        };
        let mut mesh = improve(inside, &surface, options, joined, &mut warnings)?;
        warnings.extend(self.regions.name(&mut mesh));
        control.begin("what the mesh misses")?;
        let outer = mesh.without_walls();
        let mut all = find_unmeshed(self.whole, &outer, region, options.size, control);
        let within = |p| self.torus.map_or(f64::INFINITY, |torus| torus.depth(p));
        let value = |p| within(p).min(surface.value(p).0);
        let mut apart = torn(value, &outer, options.size, control);
        for part in self.regions.parts_of(&mesh) {
            let value = |p| within(p).min(surface.value_of_region(part.region, p));
            all.add(find_unmeshed(
                part.solid,
                &part.mesh,
                region,
                options.size,
                control,
            ));
            apart.extend(torn(value, &part.mesh, options.size, control));
        }
        warnings.extend(all.warning());
        warnings.extend(Warning::each(WarningKind::Torn, apart));
        let meshed = Meshed {
            missed: all,
            mesh,
            region,
            region_certified: self.extent.certified,
            caps: Vec::new(),
            features: self.features.clone(),
            region_features: self.regions.features.clone(),
            warnings,
        };
        Ok(Attempt {
            meshed,
            has_seams: surface.has_seams.into_inner(),
        })
    }
}

/// Creates the lattice for the requested size, if the memory suffices.
fn lattice_over(
    solid: &dyn Solid,
    region: Aabb,
    torus: Option<Torus>,
    options: &Options,
    control: &Control<'_>,
) -> Result<Lattice, MeshError> {
    let cell = CELL_EDGE * options.size;
    // In a unit cell any tetrahedron may change.
    let each = match torus {
        Some(_) => options::BYTES_PER_TETRAHEDRON as f64,
        None => CELL_TETS_AND_BYTES[1],
    };
    options.check_memory((Lattice::cells(region, cell) * CELL_TETS_AND_BYTES[0] * each) as u64)?;
    control.begin("lattice")?;
    let lattice = match torus {
        Some(torus) => Lattice::on_torus(solid, &torus, cell, control)?,
        None => Lattice::new(solid, region, cell, control)?,
    };
    control.check()?;
    Ok(lattice)
}

/// Finds the feature curves and corners that matter at the requested size.
pub(crate) fn features_of(
    solid: &dyn Solid,
    region: Aabb,
    options: &Options,
    control: &Control<'_>,
) -> Features {
    let options = FeatureOptions {
        size: options.size,
        ..FeatureOptions::default()
    };
    find(solid, region, &options, control)
}

/// Refines tetrahedra where features are crowded, where sizes are requested, and where details are
/// hidden.
pub(crate) fn refine(
    refiner: &mut Refiner<'_>,
    surface: &Surface<'_>,
    dividers: &[Surface<'_>],
    crowd: &Crowd,
    options: &Options,
) -> Result<Vec<Warning>, MeshError> {
    let control = surface.control;
    let mut warnings = Vec::new();
    if !crowd.is_empty() {
        let mut found = Vec::new();
        refiner.bisect(|complex, t| CELL_EDGE * crowd.size_at(complex.middle(t), &mut found));
    }
    control.begin("sizes")?;
    if refiner.follow(surface, options) {
        warnings.push(Warning::of_all(WarningKind::SizesCutShort));
    }
    control.begin("surface")?;
    for surface in std::iter::once(surface).chain(dividers) {
        let hidden = refiner.resolve(surface);
        warnings.extend(Warning::each(WarningKind::TooFine, hidden));
        control.check()?;
    }
    Ok(warnings)
}

/// Cuts out the tetrahedra inside of the solid, with faces along its pieces.
fn cut(
    refiner: Refiner<'_>,
    surface: &Surface<'_>,
    dividers: &[Surface<'_>],
    core: &Core,
    options: &Options,
    warnings: &mut Vec<Warning>,
) -> Result<Inside, MeshError> {
    let mut cutter = cut_along(refiner, surface, dividers, warnings)?;
    let inside = cutter.inside();
    let inside = cutter.finish(&inside, &inside);
    if inside.complex.tets.is_empty() && core.tets.is_empty() {
        return Err(MeshError::TooCoarse { size: options.size });
    }
    let stray = inside.stray.iter().copied();
    warnings.extend(Warning::each(WarningKind::StrayFace, stray));
    Ok(inside)
}

/// Cuts tetrahedra inside and outside of the solid along its pieces.
pub(crate) fn cut_along<'s>(
    mut refiner: Refiner<'_>,
    surface: &'s Surface<'s>,
    dividers: &'s [Surface<'s>],
    warnings: &mut Vec<Warning>,
) -> Result<Cutter<'s>, MeshError> {
    let control = surface.control;
    let mut cutter = cutter_of(&refiner, surface);
    if let Some(at) = cutter.not_a_number() {
        return Err(MeshError::NotANumber { at });
    }
    control.check()?;
    cutter.run(dividers);
    // The lattice is halved where it proves too coarse to be cut.
    for _ in 0..3 {
        if cutter.undecided.is_empty() || control.is_stopped() {
            break;
        }
        // Too coarse there: halved, and cut again.
        refiner.bisect_near(&cutter.undecided);
        cutter = cutter_of(&refiner, surface);
        cutter.run(dividers);
    }
    control.check()?;
    warnings.extend(undecided(&cutter.undecided));
    Ok(cutter)
}

fn cutter_of<'s>(refiner: &Refiner<'_>, surface: &'s Surface<'s>) -> Cutter<'s> {
    Cutter::new(
        surface,
        refiner.complex.clone(),
        refiner.frozen.clone(),
        surface.control,
    )
}

/// Returns one warning for all tetrahedra that cutting left undecided.
fn undecided(places: &[Point3]) -> Option<Warning> {
    let kind = WarningKind::NotCut(places.len());
    places.first().map(|&at| Warning::at(kind, at))
}

/// Optimises the tetrahedra inside the solid, and assembles the mesh.
pub(crate) fn improve(
    inside: Inside,
    surface: &Surface<'_>,
    options: &Options,
    joined: CoreConnection,
    warnings: &mut Vec<Warning>,
) -> Result<Mesh, MeshError> {
    let control = surface.control;
    control.begin("optimisation")?;
    let mut optimiser = Optimiser::new(surface, inside, options.size, control);
    warnings.extend(optimiser.improve(options));
    control.begin("assembly")?;
    let opened = surface.torus.map(|torus| optimiser.complex.opened(&torus));
    let complex = opened.as_ref().unwrap_or(&optimiser.complex);
    let mut labelled = if options.surface_only {
        assemble_surface(surface, &complex.faces(), &complex.points)
    } else {
        assemble_volume(surface, complex, joined)?
    };
    warnings.extend(raise_order(&mut labelled, surface, options)?);
    if let Some(torus) = &surface.torus {
        pair_sides(torus, &mut labelled.mesh);
    }
    Ok(labelled.mesh)
}
