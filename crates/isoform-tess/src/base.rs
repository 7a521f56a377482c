//! Base points, the common zeros of X, Y, Z and W, with the curves to which they are blown up.
//!
//! At a base point of multiplicity q, the least order of the four forms, let (X_q : Y_q : Z_q :
//! W_q)(a : b) be their terms of degree q in local coordinates. Approached in the direction (a : b)
//! the map tends to this point: the seam curve (C. L. Bajaj, A. Royappa, *Triangulation and display
//! of rational parametric surfaces*, 1994, Theorem 1, there with the slope m = b/a). In a direction
//! in which all four vanish a limit does not exist. The base point is then blown up by (u, v) =
//! (u′, u′v′), or by (u′v′, v′) in the direction (0 : 1), and the forms are divided by the q-th
//! power of the exceptional line. On that line lies a base point infinitely near to the first one,
//! with a seam curve of its own. The squares of the multiplicities of all of them, complex ones
//! included, add up to n² − (degree of the map)·(degree of the surface), so the process terminates.

use crate::coefficients::{self, Coefficients};
use crate::field::{Algebraic, Element, NumberField};
use crate::map::Map;
use crate::univariate;
use crate::zeros::{Chart, Zero, common_zeros};
use isoform_algebra::{Poly, RBig, RealRoot, decide};
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A form in a direction (a : b), given by the coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ.
#[derive(Clone, Debug)]
pub struct BinaryForm {
    /// The d + 1 coefficients, all in one number field at one root.
    pub coefficients: Vec<Algebraic>,
}

impl BinaryForm {
    /// Returns the degree d.
    pub fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }
    /// Returns true if all coefficients are zero; exact.
    pub fn is_zero(&self) -> bool {
        self.coefficients.iter().all(Algebraic::is_zero)
    }
    /// Returns the value at a rational direction; exact.
    pub fn eval(&self, a: &RBig, b: &RBig) -> Algebraic {
        let first = &self.coefficients[0];
        let (mut value, mut power) = (Element::zero(), RBig::ONE);
        for c in &self.coefficients {
            value = value.scaled(a).add(&c.element().scaled(&power));
            power *= b;
        }
        Algebraic::new(first.field(), first.root(), value)
    }
    /// Adds a multiple of another form over this field, of equal degree.
    pub(crate) fn plus(&self, other: &Self, factor: &RBig) -> Self {
        let sum = |(x, y): (&Algebraic, &Algebraic)| {
            let element = x.element().add(&y.element().scaled(factor));
            Algebraic::new(x.field(), x.root(), element)
        };
        Self {
            coefficients: (self.coefficients.iter().zip(&other.coefficients))
                .map(sum)
                .collect(),
        }
    }
    /// Returns the coefficients, rounded to nearest.
    pub fn to_f64(&self) -> Vec<f64> {
        self.coefficients.iter().map(Algebraic::to_f64).collect()
    }
}

/// The exceptional line of a base point: one blow-up.
#[derive(Clone, Debug)]
pub struct Seam {
    /// Multiplicity q: the least order of the four forms.
    pub multiplicity: usize,
    /// Terms of degree q of X, Y, Z and W in local coordinates (u, v), at (a : b).
    pub leading: [BinaryForm; 4],
    /// Greatest common divisor of the leading forms; of degree 0 if they have no common zero, real
    /// or complex.
    pub common: BinaryForm,
    /// Seam curve: the leading forms divided by `common`, of degree 0 if it is a single point. (a :
    /// b) and (−a : −b) give one point.
    pub curve: [BinaryForm; 4],
    /// Real directions in which all leading forms vanish, each with the base point infinitely near
    /// in it.
    pub near: Vec<Near>,
    /// The forms X, Y, Z and W in the local coordinates (u, v), divided by the exceptional lines as
    /// often as these divide all four: terms (i, j) of u^i v^j. Empty if no other base points are
    /// infinitely near.
    pub forms: [Vec<([usize; 2], Algebraic)>; 4],
}

/// A base point that is infinitely near to another one.
#[derive(Clone, Debug)]
pub struct Near {
    /// Direction (a : b): (1 : v) with the local coordinates (u, v) = (u′, u′(v + v′)), or (0 : 1)
    /// with (u′v′, v′).
    pub direction: [Algebraic; 2],
    /// Generator of the field of the point to which this one is infinitely near, expressed in the
    /// field of the direction.
    pub(crate) theta: Element,
    /// Blow-up at this point: its forms are divided by u′^q or v′^q, in the local coordinates (u′,
    /// v′).
    pub seam: Seam,
}

impl Seam {
    /// Returns the number of successive blow-ups needed after the first: 0 if no real direction is
    /// common.
    pub fn blowups(&self) -> usize {
        self.near
            .iter()
            .map(|near| 1 + near.seam.blowups())
            .max()
            .unwrap_or(0)
    }
}

/// A real base point of a map.
#[derive(Clone, Debug)]
pub struct BasePoint {
    /// Affine chart; the local coordinates (u, v) are its coordinates less those of the point.
    pub chart: Chart,
    /// Homogeneous coordinates (s : t : w); the one that belongs to the chart is 1.
    pub point: [Algebraic; 3],
    /// The first blow-up.
    pub seam: Seam,
}

impl BasePoint {
    /// Returns the multiplicity q: the least order of the four forms.
    pub fn multiplicity(&self) -> usize {
        self.seam.multiplicity
    }
    /// Returns the coordinates (s, t, w), rounded to nearest.
    pub fn to_f64(&self) -> [f64; 3] {
        self.point.each_ref().map(Algebraic::to_f64)
    }
}

/// The base points of a map, as classes of points that are conjugate over Q.
pub(crate) struct Classes(Vec<(Zero, Class)>);

impl Classes {
    /// Finds all classes, or only those with real points.
    pub(crate) fn new(map: &Map, real: bool, control: &Control<'_>) -> Result<Self, Stopped> {
        let zeros = common_zeros(map.forms(), real, control)?;
        let classes = zeros
            .into_iter()
            .map(|zero| class_at(map, &zero, real, control).map(|class| (zero, class)));
        Ok(Self(classes.collect::<Result<_, _>>()?))
    }
    /// Returns the real points, ordered by chart, then by field and root.
    pub(crate) fn real(&self) -> Vec<BasePoint> {
        let mut points = Vec::new();
        for (zero, class) in &self.0 {
            for (root, point) in zero.real().into_iter().enumerate() {
                points.push(BasePoint {
                    chart: zero.chart,
                    point,
                    seam: class.at(root),
                });
            }
        }
        points
    }
    /// Iterates over the classes.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Class> {
        self.0.iter().map(|(_, class)| class)
    }
    /// Returns the sum of the squared multiplicities of all points of the classes, infinitely near
    /// ones included.
    pub(crate) fn multiplicity(&self) -> usize {
        self.sum_of_powers(2)
    }
    /// Returns the sum of a power of these multiplicities.
    pub(crate) fn sum_of_powers(&self, power: u32) -> usize {
        let classes = self.0.iter();
        classes.map(|(_, class)| class.sum_of_powers(power)).sum()
    }
}

/// Returns the real base points, each once, ordered by chart and then by field and root. The charts
/// are w = 1, t = 1 on w = 0, and s = 1 on t = w = 0.
///
/// ```
/// use isoform_tess::{Control, Map, base_points};
///
/// // All four vanish in s = t = 0 only, to the first order.
/// let map = Map::parse(["s", "t", "s^2 - t^2", "s^2 + t^2"], Default::default())?;
/// let found = base_points(&map, &Control::default())?;
/// assert_eq!((found.len(), found[0].to_f64(), found[0].multiplicity()), (1, [0.0, 0.0, 1.0], 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Stopped`].
pub fn base_points(map: &Map, control: &Control<'_>) -> Result<Vec<BasePoint>, Stopped> {
    Ok(Classes::new(map, true, control)?.real())
}

/// Returns the sum of the squared multiplicities of all base points, complex and infinitely near
/// ones included. The degree of the map times the degree of the surface is n² less this number. The
/// sum is proved, and independent of the counting modulo primes of `map_degrees`.
///
/// # Errors
/// [`Stopped`].
pub fn base_multiplicity(map: &Map, control: &Control<'_>) -> Result<usize, Stopped> {
    Ok(Classes::new(map, false, control)?.multiplicity())
}

/// Polynomial over a number field, as a map from (i, j) to the coefficient of u^i v^j.
pub(crate) type Local = BTreeMap<[usize; 2], Element>;

/// A blow-up for a whole class of conjugate points.
pub(crate) struct Class {
    field: Arc<NumberField>,
    multiplicity: usize,
    leading: [Coefficients; 4],
    common: Coefficients,
    curve: [Coefficients; 4],
    near: Vec<NearClass>,
    /// All terms of the four forms; empty unless they were requested.
    forms: [Local; 4],
}

struct NearClass {
    /// Generator of the field of the point to which this one is infinitely near.
    theta: Element,
    direction: [Element; 2],
    class: Class,
}

fn class_at(map: &Map, zero: &Zero, real: bool, control: &Control<'_>) -> Result<Class, Stopped> {
    // By Bézout, as two general planes meet the surface in at least one point that is not a base
    // point.
    let room = (map.degree().pow(2) - 1) / zero.field.degree();
    let mut local: Vec<Local> = Vec::new();
    for form in map.forms() {
        control.check()?;
        local.push(expand(form, zero, room));
    }
    let mut class = blow_up(
        &zero.field,
        local.try_into().expect("four forms"),
        room,
        real,
        control,
    )?;
    if !class.near.is_empty() {
        class.lift(
            map.forms()
                .each_ref()
                .map(|form| expand(form, zero, map.degree())),
            control,
        )?;
    }
    Ok(class)
}

/// Expands a form in the local coordinates of a point, up to degree `room`, by Horner's rule in
/// each coordinate.
pub(crate) fn expand(form: &Poly, zero: &Zero, room: usize) -> Local {
    let ([u, v], one) = zero.chart.variables();
    let k = &zero.field;
    let mut columns: Vec<Vec<Element>> = Vec::new();
    for row in form.dehomogenise(one).coefficients_in(u).iter().rev() {
        let mut inner: Vec<Element> = Vec::new();
        for c in row.coefficients_in(v).iter().rev() {
            let c = c.as_constant().expect("two variables");
            inner = times_linear(k, &inner, &zero.at[1]);
            inner.truncate(room + 1);
            add_to(&mut inner, 0, &Element::rational(&c));
        }
        columns = horner_step(k, &columns, &zero.at[0], &inner);
        truncate(&mut columns, room);
    }
    let columns = columns.into_iter().enumerate();
    columns
        .flat_map(|(i, column)| column_terms(i, column))
        .collect()
}

/// Drops terms above a total degree; each column holds one power of u.
fn truncate(columns: &mut Vec<Vec<Element>>, degree: usize) {
    columns.truncate(degree + 1);
    for (i, column) in columns.iter_mut().enumerate() {
        column.truncate(degree + 1 - i);
    }
}

/// Iterates over the non-zero terms u^i v^j, j = 0, 1, ….
fn column_terms(
    i: usize,
    coefficients: Vec<Element>,
) -> impl Iterator<Item = ([usize; 2], Element)> {
    let terms = coefficients.into_iter().enumerate();
    let terms = terms.filter(|(_, c)| !c.is_zero());
    terms.map(move |(j, c)| ([i, j], c))
}

/// Returns p·(u + a) + q, with p given by columns of powers of u, and q in v alone.
fn horner_step(
    k: &NumberField,
    p: &[Vec<Element>],
    a: &Element,
    q: &[Element],
) -> Vec<Vec<Element>> {
    let mut next: Vec<Vec<Element>> = vec![Vec::new(); p.len() + 1];
    for (i, column) in p.iter().enumerate() {
        for (j, c) in column.iter().enumerate() {
            add_to(&mut next[i + 1], j, c);
            add_to(&mut next[i], j, &k.mul(c, a));
        }
    }
    for (j, c) in q.iter().enumerate() {
        add_to(&mut next[0], j, c);
    }
    next
}

/// Returns p·(x + a).
fn times_linear(k: &NumberField, p: &[Element], a: &Element) -> Vec<Element> {
    let mut result = vec![Element::zero(); if p.is_empty() { 0 } else { p.len() + 1 }];
    for (j, c) in p.iter().enumerate() {
        result[j + 1] = result[j + 1].add(c);
        result[j] = result[j].add(&k.mul(c, a));
    }
    result
}

fn add_to(p: &mut Vec<Element>, at: usize, c: &Element) {
    if p.len() <= at {
        p.resize(at + 1, Element::zero());
    }
    p[at] = p[at].add(c);
}

/// Blows up a base point, given by the four forms in its local coordinates, and all base points
/// infinitely near to it.
///
/// The squares of the multiplicities of all of these add up to at most `room`; counted with all
/// conjugates, to `room` times the degree of the field. A term of degree d has a degree of at least
/// d − q after the next blow-up, so terms whose degree exceeds the sum of multiplicities never
/// reach a leading form and are dropped.
fn blow_up(
    k: &Arc<NumberField>,
    mut local: [Local; 4],
    room: usize,
    real: bool,
    control: &Control<'_>,
) -> Result<Class, Stopped> {
    control.check()?;
    for f in &mut local {
        f.retain(|[i, j], _| i + j <= room);
    }
    let orders = local.iter().filter_map(order);
    let q = orders.min().expect("forms that are not all zero");
    assert!(q > 0, "a base point");
    let room = room
        .checked_sub(q * q)
        .expect("multiplicities within the degree of the map");
    let Leading {
        forms: leading,
        mut common,
        vertical,
        curve,
    } = Leading::new(k, &local, q, control)?;
    let mut near = Vec::new();
    let distinct = univariate::squarefree_part(k, &common, control)?;
    for extension in univariate::roots(k, &distinct, real, control)? {
        let target = &extension.field;
        let there = BlowUp {
            from: k,
            to: target,
            theta: &extension.theta,
            direction: Some(&extension.root),
        };
        let moved = local.each_ref().map(|f| there.moved(f, q));
        let room = room * k.degree() / target.degree();
        let class = blow_up(target, moved, room, real, control)?;
        near.push(NearClass {
            theta: extension.theta,
            direction: [Element::rational(&RBig::ONE), extension.root],
            class,
        });
    }
    if vertical > 0 {
        let moved = local.each_ref().map(|f| across(f, q));
        let direction = [Element::zero(), Element::rational(&RBig::ONE)];
        near.push(NearClass {
            theta: k.generator(),
            direction,
            class: blow_up(k, moved, room, real, control)?,
        });
    }
    common.resize(common.len() + vertical, Element::zero());
    Ok(Class {
        field: Arc::clone(k),
        multiplicity: q,
        leading,
        common,
        curve,
        near,
        forms: Default::default(),
    })
}

/// Terms of least degree of four forms, by the coefficients of a^q, a^(q−1)b, …: of the powers of
/// b/a, lowest first.
struct Leading {
    forms: [Coefficients; 4],
    /// Greatest common divisor of the forms, up to powers of a.
    common: Coefficients,
    /// Exponent of the power of a that divides all of the forms.
    vertical: usize,
    /// Quotients of the forms by both.
    curve: [Coefficients; 4],
}

impl Leading {
    fn new(
        k: &Arc<NumberField>,
        local: &[Local; 4],
        q: usize,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let coefficient = |f: &Local, j: usize| f.get(&[q - j, j]).cloned().unwrap_or_default();
        let forms = local
            .each_ref()
            .map(|f| (0..=q).map(|j| coefficient(f, j)).collect::<Coefficients>());
        // A power of a shows as zeros at the upper end, which trimming removes.
        let vertical = (0..=q)
            .take_while(|&i| forms.iter().all(|f| f[q - i].is_zero()))
            .count();
        let common = common_divisor(k, &forms, control)?;
        let curve = forms.each_ref().map(|f| {
            let (mut quotient, rest) = coefficients::divide(k, f, &common);
            assert!(rest.is_empty(), "a common divisor divides");
            quotient.resize(q + 2 - common.len() - vertical, Element::zero());
            quotient
        });
        Ok(Self {
            forms,
            common,
            vertical,
            curve,
        })
    }
}

/// Blow-up from a base point to one infinitely near to it.
pub(crate) struct BlowUp<'a> {
    /// Field of the first point.
    pub(crate) from: &'a Arc<NumberField>,
    pub(crate) to: &'a Arc<NumberField>,
    /// Generator of the field `from`, expressed in the field `to`.
    pub(crate) theta: &'a Element,
    /// The number v₀ of the direction (1 : v₀); `None` for (0 : 1).
    pub(crate) direction: Option<&'a Element>,
}

impl BlowUp<'_> {
    /// Substitutes the local coordinates of the near point into a polynomial, and divides by the
    /// q-th power of the exceptional line.
    pub(crate) fn moved(&self, f: &Local, q: usize) -> Local {
        let inside = |c: &Element| match Arc::ptr_eq(self.to, self.from) {
            true => c.clone(),
            false => self.from.embed(c, self.to, self.theta),
        };
        match self.direction {
            Some(v0) => along_direction(self.to, f, v0, q, inside),
            None => across(f, q),
        }
    }
}

/// Returns the least degree of the terms; `None` for the zero polynomial.
pub(crate) fn order(f: &Local) -> Option<usize> {
    f.keys().map(|[i, j]| i + j).min()
}

/// Returns the greatest common divisor of binary forms given by their coefficients.
fn common_divisor(
    k: &NumberField,
    forms: &[Coefficients; 4],
    control: &Control<'_>,
) -> Result<Coefficients, Stopped> {
    let mut common: Coefficients = Vec::new();
    for f in forms {
        let mut f = f.clone();
        coefficients::trim(&mut f);
        common = univariate::gcd(k, &common, &f, control)?;
    }
    Ok(common)
}

/// Substitutes (u, v) = (u′, u′(v₀ + v′)): u^i v^j becomes u′^(i+j−q)(v₀ + v′)^j.
fn along_direction(
    k: &NumberField,
    f: &Local,
    v0: &Element,
    q: usize,
    inside: impl Fn(&Element) -> Element,
) -> Local {
    let mut rows: BTreeMap<usize, BTreeMap<usize, Element>> = BTreeMap::new();
    for ([i, j], c) in f {
        rows.entry(i + j - q).or_default().insert(*j, inside(c));
    }
    let mut result = Local::new();
    for (i, row) in rows {
        result.extend(column_terms(i, shifted(k, &row, v0)));
    }
    result
}

/// Returns the coefficients of Σ cⱼ (v₀ + v)^j in v, by Horner's rule.
fn shifted(k: &NumberField, terms: &BTreeMap<usize, Element>, v0: &Element) -> Vec<Element> {
    let top = *terms.keys().next_back().expect("a row with terms");
    let mut sum: Vec<Element> = Vec::new();
    for j in (0..=top).rev() {
        sum = times_linear(k, &sum, v0);
        if let Some(c) = terms.get(&j) {
            add_to(&mut sum, 0, c);
        }
    }
    sum
}

/// Substitutes (u, v) = (u′v′, v′): u^i v^j becomes u′^i v′^(i+j−q).
fn across(f: &Local, q: usize) -> Local {
    f.iter()
        .map(|([i, j], c)| ([*i, i + j - q], c.clone()))
        .collect()
}

impl Class {
    /// Returns the number field over which the points are defined.
    pub(crate) fn field(&self) -> &NumberField {
        &self.field
    }
    /// Returns the seam curve, by the coefficients of aᵈ, aᵈ⁻¹b, ….
    pub(crate) fn curve(&self) -> &[Coefficients; 4] {
        &self.curve
    }
    /// Iterates over the classes of base points infinitely near to this one.
    pub(crate) fn near(&self) -> impl Iterator<Item = &Self> {
        self.near.iter().map(|near| &near.class)
    }

    /// Stores the full forms in this class and in all classes infinitely near to it.
    fn lift(&mut self, forms: [Local; 4], control: &Control<'_>) -> Result<(), Stopped> {
        control.check()?;
        for near in &mut self.near {
            let there = BlowUp {
                from: &self.field,
                to: &Arc::clone(&near.class.field),
                theta: &near.theta,
                direction: (!near.direction[0].is_zero()).then_some(&near.direction[1]),
            };
            let moved = forms.each_ref().map(|f| there.moved(f, self.multiplicity));
            near.class.lift(moved, control)?;
        }
        self.forms = forms;
        Ok(())
    }

    /// Returns the sum of a power of the multiplicities of all points of the class and of those
    /// infinitely near to them.
    fn sum_of_powers(&self, power: u32) -> usize {
        let near = self.near.iter().map(|n| n.class.sum_of_powers(power));
        self.field.degree() * self.multiplicity.pow(power) + near.sum::<usize>()
    }

    /// Returns the blow-up of the real point at a root, given by its index.
    fn at(&self, root: usize) -> Seam {
        let number = |e: &Element| Algebraic::new(&self.field, root, e.clone());
        let form = |f: &Coefficients| BinaryForm {
            coefficients: f.iter().map(number).collect(),
        };
        let near = self.near.iter();
        let near = near
            .flat_map(|class| class.over(&self.field, root))
            .collect();
        Seam {
            multiplicity: self.multiplicity,
            leading: self.leading.each_ref().map(form),
            common: form(&self.common),
            curve: self.curve.each_ref().map(form),
            near,
            forms: self
                .forms
                .each_ref()
                .map(|f| f.iter().map(|(e, c)| (*e, number(c))).collect()),
        }
    }
}

impl NearClass {
    /// Returns the blow-ups of the points of this class that are infinitely near to a real point of
    /// the class below, given by its root.
    fn over(&self, below: &Arc<NumberField>, root: usize) -> Vec<Near> {
        let field = &self.class.field;
        let above = (0..field.real_roots().len()).filter(|&k| self.lies_over(below, k) == root);
        let near = above.map(|k| Near {
            direction: self
                .direction
                .each_ref()
                .map(|e| Algebraic::new(field, k, e.clone())),
            theta: self.theta.clone(),
            seam: self.class.at(k),
        });
        near.collect()
    }
    /// Returns the root of the field below over which a root of the field above lies.
    fn lies_over(&self, below: &Arc<NumberField>, above: usize) -> usize {
        /// Number of bits by which θ is refined from one attempt to the next.
        const THETA_REFINEMENT_BITS: usize = 32;
        if Arc::ptr_eq(below, &self.class.field) {
            return above;
        }
        let theta = Algebraic::new(&self.class.field, above, self.theta.clone());
        decide(
            THETA_REFINEMENT_BITS,
            |bits| bits + THETA_REFINEMENT_BITS,
            |bits| {
                let (lo, hi) = theta.interval(bits);
                // θ is one of the roots: the only one that meets the interval.
                let is_apart =
                    |r: &RealRoot| r.cmp_rational(&lo).is_lt() || r.cmp_rational(&hi).is_gt();
                let roots = below.real_roots().iter().enumerate();
                let mut candidates = roots.filter(|(_, r)| !is_apart(r));
                let (root, _) = candidates.next()?;
                candidates.next().is_none().then_some(root)
            },
        )
    }
}
