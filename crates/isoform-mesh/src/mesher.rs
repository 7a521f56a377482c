//! The way from a solid to a mesh.
//!
//! Extent → lattice → features → sizes → cutting → optimisation → assembly → second order. Each
//! phase takes the values of those before it and announces itself to the [`Control`].

use crate::assemble::{Joined, assemble_surface, assemble_volume};
use crate::band::{Band, Core};
use crate::crowd::Crowd;
use crate::cut::Cutter;
use crate::divided::{Divided, Layer, Region};
use crate::error::{MeshError, Warning, WarningKind};
use crate::features::{Extent, FeatureOptions, Features, extent_within, find};
use crate::inside::Inside;
use crate::lattice::{CELL, Lattice};
use crate::layers::mesh_layered;
use crate::missed::{Missed, missed};
use crate::optimise::Optimiser;
use crate::options::{self, Options};
use crate::refine::Refiner;
use crate::regions::{REST, Regions};
use crate::second::{raise_order, turned};
use crate::surface::{LayerCells, MAX_DIVIDED_LAYERS, Surface};
use crate::torn::torn;
use crate::torus::{AXES, Misfit, Torus, Wrapped, apart, misfit};
use isoform_check::{self as check, Capped, Failure, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid};

/// Rounds in which the lattice is halved where it proves too coarse to be cut.
const FINER: usize = 3;
/// Rounds, one behind the other, that leave no fewer findings, after which no other is tried.
const IN_VAIN: usize = 2;
/// Triangles per finding, from which on the mesh is wrong all over: bodies that touch have more
/// findings, a needle that is to be mended some one in ten.
const ALL_OVER: usize = 8;
/// Places of each kind of failure that are meshed finer at once.
const PLACES: usize = 1000;
/// What edges become there, as a share of what they were.
const HALF: f64 = 0.5;
/// Tetrahedra of the lattice per cell, and bytes that each takes if it is not near the surface.
const BYTES: [f64; 2] = [12.0, 60.0];

/// A mesh and how it came about.
#[derive(Clone, Debug)]
pub struct Meshed {
    /// The mesh.
    pub mesh: Mesh,
    /// The box that was meshed.
    pub region: Aabb,
    /// Whether intervals prove that nothing of the solid lies outside of the box.
    pub region_certified: bool,
    /// Names of the caps where the box cuts the solid.
    pub caps: Vec<String>,
    /// The feature curves and corners of the solid.
    pub features: Features,
    /// Those of each region that was asked for, and of the rest.
    pub region_features: Vec<Features>,
    /// What of the solid the mesh may pass by.
    pub missed: Missed,
    /// Places where the solid could not be resolved, with what happened there.
    pub warnings: Vec<Warning>,
}

/// Meshes a solid: tetrahedra with the labelled surface, or the surface alone.
///
/// # Errors
/// If the solid is empty, unbounded or not a number, if an option has no meaning, the memory does
/// not suffice, or on a stop.
pub fn mesh(
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    mesh_regions(solid, &[], options, control)
}

/// Meshes a solid in several regions: each takes what of the solid lies in its own solid and in
/// that of no region before it, and what is left is one more, called `rest`. Tetrahedra of two
/// regions share the nodes of the faces between them. These faces are triangles of the mesh, too,
/// outward of the region that comes first, on the parts of its solid.
///
/// # Errors
/// As [`mesh`], and if two regions have one name or one has that of the rest, but for capitals, if
/// there are more regions than 999, or `options` ask for the surface alone.
pub fn mesh_regions(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    options.check()?;
    check_regions(regions, options)?;
    control.begin("extent")?;
    if let Some(layers) = &options.layers {
        return match regions.is_empty() {
            true => mesh_layered(solid, layers, options, control),
            false => Err(MeshError::NoLayers { what: "in regions" }),
        };
    }
    if let Some(region) = options.region.filter(|_| options.periodic.contains(&true)) {
        return mesh_cell(solid, regions, region, options, control);
    }
    if let Some(region) = options.region {
        let capped = Capped::new(solid, region);
        let extent = extent_within(&capped, region, options.size, control)?;
        let meshed = mesh_within(Model::of(&capped, regions), None, &extent, options, control)?;
        Ok(with_caps(meshed))
    } else {
        let extent = extent_within(solid, options.start, options.size, control)?;
        mesh_within(Model::of(solid, regions), None, &extent, options, control)
    }
}

/// Meshes a unit cell.
fn mesh_cell(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    region: Aabb,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    let torus = Torus::new(region, options.periodic);
    let capped = Capped::new(solid, region);
    let ends = Capped::across(solid, region, options.periodic.map(|repeats| !repeats));
    let whole = Wrapped::new(&ends, torus);
    let wrapped = regions.iter().map(|r| Wrapped::new(r.solid, torus));
    let wrapped: Vec<Wrapped<'_>> = wrapped.collect();
    let divide = regions.iter().zip(&wrapped);
    let divide = divide.map(|(r, solid)| Region {
        name: r.name,
        solid,
    });
    let divide: Vec<Region<'_>> = divide.collect();
    let options = &Options {
        size: options.size.min(torus.largest_size()),
        ..options.clone()
    };
    let extent = extent_within(&capped, region, options.size, control)?;
    let places = torus.places(options.size);
    let all = regions.iter().map(|r| (r.name, r.solid));
    for (name, solid) in std::iter::once(("", &ends as &dyn Solid)).chain(all) {
        if let Some((misfit, axis, at)) = misfit(solid, &torus, &places) {
            let axis = AXES[axis];
            let region = name.to_owned();
            return Err(match misfit {
                Misfit::Differs => MeshError::NotPeriodic { axis, at, region },
                Misfit::InSide => MeshError::InSide { axis, at, region },
            });
        }
    }
    let extent = Extent {
        bounds: region,
        ..extent
    };
    let model = Model {
        solid: &whole,
        regions: &divide,
        wanted: (&capped, regions),
    };
    let mut meshed = mesh_within(model, Some(torus), &extent, options, control)?;
    let solids = std::iter::once(&ends as &dyn Solid).chain(regions.iter().map(|r| r.solid));
    for (axis, at, by) in solids.flat_map(|solid| apart(solid, &torus, &meshed.mesh)) {
        let axis = AXES[axis];
        meshed
            .warnings
            .push(Warning::at(WarningKind::SidesApart { axis, by }, at));
    }
    Ok(with_caps(meshed))
}

/// A mesh with the names of its caps.
pub(crate) fn with_caps(mut meshed: Meshed) -> Meshed {
    let is_cap = |name: &&String| name.starts_with("cap.");
    meshed.caps = meshed.mesh.parts.iter().filter(is_cap).cloned().collect();
    meshed
}

/// Whether a solid can be divided as asked for.
fn check_regions(regions: &[Region<'_>], options: &Options) -> Result<(), MeshError> {
    for (k, region) in regions.iter().enumerate() {
        let before = regions[..k].iter().map(|r| r.name);
        if before
            .chain([REST])
            .any(|name| name.eq_ignore_ascii_case(region.name))
        {
            let name = region.name.to_owned();
            return Err(MeshError::RegionName { name });
        }
    }
    let (wanted, value) = match regions.len() {
        0 => return Ok(()),
        n if n >= MAX_DIVIDED_LAYERS => ("fewer than 1000", n as f64),
        n if options.surface_only => ("none with the surface alone", n as f64),
        _ => return Ok(()),
    };
    let name = "regions";
    Err(MeshError::Option {
        name,
        wanted,
        value,
    })
}

/// Meshes a solid whose extent is known. Where the certificate would hold something against the
/// surface, and where vertices held on seams between pieces that touch keep others off it, it is
/// meshed once more, finer there; and at last without holding any on seams. The mesh with the
/// fewest findings counts.
pub(crate) fn mesh_within(
    model: Model<'_>,
    torus: Option<Torus>,
    extent: &Extent,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    let Model { solid, regions, .. } = model;
    let (whole, whole_regions) = model.wanted;
    let sides = torus.map_or_else(Vec::new, |torus| torus.sides());
    let mut divided = Divided::new(solid, regions);
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
        // A divider may be no number where nothing of the whole is.
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
    let ground = Ground {
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
    let mut course = Course {
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
    // What is stopped on the way leaves the mesh that there is.
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
        if wrong.places.is_empty() || in_vain >= IN_VAIN {
            break;
        }
    }
    if !best.has_seams || best.off().is_empty() {
        return Ok(best.meshed);
    }
    let without = Course {
        seams: false,
        finer: Vec::new(),
    };
    match ground.meshed(&without) {
        Ok(without) if ground.wrong(&without).count < fewest => Ok(without.meshed),
        _ => Ok(best.meshed),
    }
}

/// What is meshed.
pub(crate) struct Model<'a> {
    solid: &'a dyn Solid,
    regions: &'a [Region<'a>],
    /// What the mesh must be of: the solid and the regions, or those of a unit cell in its box.
    wanted: (&'a dyn Solid, &'a [Region<'a>]),
}

impl<'a> Model<'a> {
    pub(crate) fn of(solid: &'a dyn Solid, regions: &'a [Region<'a>]) -> Self {
        Self {
            solid,
            regions,
            wanted: (solid, regions),
        }
    }
}

/// How a solid is meshed.
struct Course {
    /// Whether vertices are held on seams between pieces that touch.
    seams: bool,
    /// Places where edges shall be shorter, and how long.
    finer: Vec<(Point3, f64)>,
}

impl Course {
    /// Adds places where the mesh is wrong, to be meshed with half the edges they have there.
    fn add(&mut self, wrong: &[Point3], size: f64) {
        let before = Crowd::of_places(&self.finer, size);
        let halved = |at: &Point3| (*at, HALF * before.size_at(*at, &mut Vec::new()).min(size));
        self.finer.extend(wrong.iter().map(halved));
    }
}

/// What a course leads to.
struct Outcome {
    meshed: Meshed,
    /// Whether there are seams between pieces that touch.
    has_seams: bool,
}

impl Outcome {
    /// Vertices that could not be brought onto the surface.
    fn off(&self) -> Vec<Point3> {
        let warnings = self.meshed.warnings.iter();
        let off = warnings.filter(|w| w.kind == WarningKind::VertexOff);
        off.filter_map(|w| w.at).collect()
    }
}

/// Places where mid nodes turn tetrahedra over, or are off the surface.
fn bent_wrong(meshed: &Meshed) -> Vec<Point3> {
    let off = meshed
        .warnings
        .iter()
        .filter(|w| w.kind == WarningKind::MiddleOff);
    off.filter_map(|w| w.at)
        .chain(turned(&meshed.mesh))
        .collect()
}

/// What is wrong with a mesh.
struct Wrong {
    /// How much: findings of the certificate, and warnings; then those of mid nodes.
    count: [usize; 2],
    /// Places to be meshed finer: none where the mesh is wrong all over.
    places: Vec<Point3>,
}

/// What all courses of a solid have in common.
struct Ground<'a> {
    /// What is meshed.
    whole: &'a dyn Solid,
    /// The whole, with the pieces of all layers.
    solid: &'a dyn Solid,
    /// The box of a unit cell.
    torus: Option<Torus>,
    extent: &'a Extent,
    lattice: &'a Lattice,
    /// The layers of a solid that is divided into regions; none of one that is not.
    layers: &'a [LayerCells<'a>],
    /// The regions that it is divided into.
    regions: &'a Regions<'a>,
    features: &'a Features,
    options: &'a Options,
    control: &'a Control<'a>,
}

impl Ground<'_> {
    /// What is wrong with the surface, and where the mesh misses a part of the solid. Where it is
    /// wrong all over, as that of bodies that touch or of functions that jump, no size helps, but
    /// may help vertices off the surface if there are seams.
    fn wrong(&self, of: &Outcome) -> Wrong {
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
        if count >= mesh.triangles.len().div_ceil(ALL_OVER) {
            let places = if of.has_seams { of.off() } else { Vec::new() };
            let count = [count, bent.len()];
            return Wrong { count, places };
        }
        let found = failures
            .iter()
            .flat_map(|f| f.place.iter().chain(&f.others));
        places.extend(found.map(|p| p.at));
        // Mid nodes come second: as long as the mesh itself is wrong, they say little.
        let is_bent_here = count == 0 && bent.len() < mesh.triangles.len().div_ceil(ALL_OVER);
        let count = [count, bent.len()];
        if is_bent_here {
            places = bent;
        }
        Wrong { count, places }
    }

    /// What the certificate of the surface would hold against it, and that of each region.
    fn surface_failures(&self, mesh: &Mesh) -> Vec<Failure> {
        let outer = mesh.without_walls();
        let mut failures = self.failures_of(&outer, self.whole, self.features);
        for part in self.regions.of(mesh) {
            failures.extend(self.failures_of(&part.mesh, part.solid, part.features));
        }
        failures
    }

    /// What the certificate of a surface alone would hold against it.
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
            places: PLACES,
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
        // The mesh is certified once more at last, with progress.
        let control = Control {
            progress: None,
            ..*self.control
        };
        certify(&surface, Some(solid), &options, &control).failures()
    }

    /// Meshes the solid in one of the courses.
    fn meshed(&self, course: &Course) -> Result<Outcome, MeshError> {
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
        let joined = Joined {
            core: band.core,
            band_points,
            number: inside.number.clone(),
        };
        let mut mesh = improve(inside, &surface, options, joined, &mut warnings)?;
        warnings.extend(self.regions.name(&mut mesh));
        control.begin("what the mesh misses")?;
        let outer = mesh.without_walls();
        let mut all = missed(self.whole, &outer, region, options.size, control);
        let within = |p| self.torus.map_or(f64::INFINITY, |torus| torus.depth(p));
        let value = |p| within(p).min(surface.value(p).0);
        let mut apart = torn(value, &outer, options.size, control);
        for part in self.regions.of(&mesh) {
            let value = |p| within(p).min(surface.value_of_region(part.region, p));
            all.add(missed(
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
        Ok(Outcome {
            meshed,
            has_seams: surface.has_seams.into_inner(),
        })
    }
}

/// The lattice for the size asked for, if the memory suffices.
fn lattice_over(
    solid: &dyn Solid,
    region: Aabb,
    torus: Option<Torus>,
    options: &Options,
    control: &Control<'_>,
) -> Result<Lattice, MeshError> {
    let cell = CELL * options.size;
    // In a unit cell any tetrahedron may change.
    let each = match torus {
        Some(_) => options::BYTES as f64,
        None => BYTES[1],
    };
    options.check_memory((Lattice::cells(region, cell) * BYTES[0] * each) as u64)?;
    control.begin("lattice")?;
    let lattice = match torus {
        Some(torus) => Lattice::on_torus(solid, &torus, cell, control)?,
        None => Lattice::new(solid, region, cell, control)?,
    };
    control.check()?;
    Ok(lattice)
}

/// The feature curves and corners that matter at the size asked for.
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

/// Smaller tetrahedra where features crowd, where sizes are asked for, and where something hides.
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
        refiner.bisect(|complex, t| CELL * crowd.size_at(complex.middle(t), &mut found));
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

/// The tetrahedra inside of the solid, with faces along its pieces.
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

/// The tetrahedra inside and outside of the solid, cut along its pieces.
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
    for _ in 0..FINER {
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

/// One warning of all tetrahedra that cutting left undecided.
fn undecided(places: &[Point3]) -> Option<Warning> {
    let kind = WarningKind::NotCut(places.len());
    places.first().map(|&at| Warning::at(kind, at))
}

/// Optimises the tetrahedra inside the solid, and makes the mesh of them.
pub(crate) fn improve(
    inside: Inside,
    surface: &Surface<'_>,
    options: &Options,
    joined: Joined,
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
        torus.pair(&mut labelled.mesh);
    }
    Ok(labelled.mesh)
}
