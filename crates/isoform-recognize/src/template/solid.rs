//! Construction of a solid as set operations of half spaces, from cells of space that are known to
//! lie inside or outside.
//!
//! Half spaces that contain the whole solid (or lie within it) are taken first, since they give the
//! shortest expressions (dominating half spaces: V. Shapiro and D. L. Vossler, Separation for
//! boundary to CSG conversion, ACM Trans. Graphics 12, 1993). The rest is covered by products of
//! half spaces that are subtracted or added, each with as few factors as separate the two sides,
//! the one that covers most first.

use std::collections::BTreeSet;

/// Maximum number of half spaces of a solid: the bits of a cell.
pub(super) const MAX_HALVES: usize = 128;

/// A set of half spaces, or the sides of all of them: bit k is half space k.
pub(super) type Bits = u128;

/// The region on given sides of all half spaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SolidCell {
    /// Half spaces that contain it.
    pub(super) bits: Bits,
    /// True if it lies inside the solid.
    pub(super) is_inside: bool,
    /// Weight of the samples on that side.
    pub(super) weight: f64,
}

/// A solid.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SolidFormula {
    /// A half space.
    Half(usize),
    /// The complement.
    Not(Box<Self>),
    /// The intersection; all of space if the list is empty.
    All(Vec<Self>),
    /// The union; the empty set if the list is empty.
    Any(Vec<Self>),
}

impl SolidFormula {
    /// Returns true if a point with these sides is inside.
    pub(super) fn holds(&self, bits: Bits) -> bool {
        match self {
            Self::Half(k) => bits >> k & 1 == 1,
            Self::Not(of) => !of.holds(bits),
            Self::All(of) => of.iter().all(|s| s.holds(bits)),
            Self::Any(of) => of.iter().any(|s| s.holds(bits)),
        }
    }

    /// Returns true or false for a point with these sides on the surface of a half space; `None` if
    /// the half space alone decides.
    fn holds_on(&self, bits: Bits, k: usize) -> Option<bool> {
        // Kleene's logic: one decisive operand is enough.
        let set = |of: &[Self], decisive: bool| {
            let mut is_open = false;
            for s in of {
                match s.holds_on(bits, k) {
                    Some(v) if v == decisive => return Some(decisive),
                    Some(_) => {}
                    None => is_open = true,
                }
            }
            (!is_open).then_some(!decisive)
        };
        match self {
            Self::Half(j) if *j == k => None,
            Self::Half(j) => Some(bits >> j & 1 == 1),
            Self::Not(of) => of.holds_on(bits, k).map(|v| !v),
            Self::All(of) => set(of, false),
            Self::Any(of) => set(of, true),
        }
    }

    /// Returns the half spaces that occur in the expression.
    pub(super) fn halves(&self) -> Bits {
        match self {
            Self::Half(k) => 1 << k,
            Self::Not(of) => of.halves(),
            Self::All(of) | Self::Any(of) => of.iter().fold(0, |all, s| all | s.halves()),
        }
    }

    /// Returns a half space or its complement.
    fn literal(k: usize, is_positive: bool) -> Self {
        if is_positive {
            Self::Half(k)
        } else {
            Self::Not(Box::new(Self::Half(k)))
        }
    }
}

/// The intersection of the half spaces of `mask`, each on the side given by `bits`.
#[derive(Clone, Copy, Debug)]
struct Product {
    mask: Bits,
    bits: Bits,
}

impl Product {
    fn holds(&self, bits: Bits) -> bool {
        (bits ^ self.bits) & self.mask == 0
    }

    fn solid(&self) -> SolidFormula {
        let factor = |k: usize| SolidFormula::literal(k, self.bits >> k & 1 == 1);
        let mut factors: Vec<SolidFormula> = ones(self.mask).map(factor).collect();
        match factors.len() {
            1 => factors.remove(0),
            _ => SolidFormula::All(factors),
        }
    }
}

/// Returns the indices of the bits that are set.
pub(super) fn ones(bits: Bits) -> impl Iterator<Item = usize> {
    (0..MAX_HALVES).filter(move |k| bits >> k & 1 == 1)
}

/// Returns a solid of `count` half spaces with all cells on their sides.
pub(super) fn solid(cells: &[SolidCell], count: usize) -> SolidFormula {
    let solid = flat(rest(cells.to_vec(), count));
    let is_right = |new: &SolidFormula, old: &SolidFormula| {
        let holds = |s: &SolidFormula, c: &SolidCell| s.holds(c.bits) == c.is_inside;
        cells.iter().all(|c| holds(new, c) || !holds(old, c))
    };
    let solid = flat(irredundant(solid, is_right));
    let known = cells.iter().map(|c| c.bits).collect();
    let is_sound = |s: &SolidFormula| ones(s.halves()).all(|k| hazard(s, &known, k).is_none());
    if is_sound(&solid) {
        return solid;
    }
    let seal = |solid, k| sealed(solid, k, cells, &known);
    let solid = flat(ones(solid.halves()).fold(solid, seal));
    let is_as_good = |new: &SolidFormula, old: &SolidFormula| is_right(new, old) && is_sound(new);
    flat(irredundant(solid, is_as_good))
}

/// Returns a cell outside half space `k` that agrees with the adjacent one within it, although the
/// solid's function is 0 between them: a sheet or a crack (a static hazard of logic circuits: E. J.
/// McCluskey, Bell Syst. Tech. J. 35, 1956).
fn hazard(solid: &SolidFormula, known: &BTreeSet<Bits>, k: usize) -> Option<Bits> {
    let within = |bits: Bits| bits | 1 << k;
    let is_fault = |bits: &Bits| {
        *bits != within(*bits)
            && known.contains(&within(*bits))
            && solid.holds_on(*bits, k).is_none()
            && solid.holds(*bits) == solid.holds(within(*bits))
    };
    known.iter().copied().find(is_fault)
}

/// Adds products across half space `k` wherever there is a hazard, in the smallest subexpression
/// that contains it.
fn sealed(
    solid: SolidFormula,
    k: usize,
    cells: &[SolidCell],
    known: &BTreeSet<Bits>,
) -> SolidFormula {
    let has_it = |s: &SolidFormula| s.halves() >> k & 1 == 1;
    let is_all = matches!(solid, SolidFormula::All(_));
    let mut solid = match solid {
        SolidFormula::Not(of) => return SolidFormula::Not(Box::new(sealed(*of, k, cells, known))),
        SolidFormula::All(of) | SolidFormula::Any(of)
            if of.iter().filter(|s| has_it(s)).count() == 1 =>
        {
            let seal = |s| match has_it(&s) {
                true => sealed(s, k, cells, known),
                false => s,
            };
            let of = of.into_iter().map(seal).collect();
            return if is_all {
                SolidFormula::All(of)
            } else {
                SolidFormula::Any(of)
            };
        }
        solid => solid,
    };
    while let Some(bits) = hazard(&solid, known, k) {
        let is_inside = solid.holds(bits);
        let (own, other): (Vec<SolidCell>, Vec<SolidCell>) =
            cells.iter().partition(|c| solid.holds(c.bits) == is_inside);
        let other: Vec<Bits> = other.iter().map(|c| c.bits).collect();
        let product = grown(bits, solid.halves() & !(1 << k), &own, &other).solid();
        solid = match is_inside {
            true => SolidFormula::Any(vec![solid, product]),
            false => SolidFormula::All(vec![solid, SolidFormula::Not(Box::new(product))]),
        };
    }
    solid
}

/// Returns the solid of the remaining cells.
fn rest(mut cells: Vec<SolidCell>, count: usize) -> SolidFormula {
    let all: Bits = if count == MAX_HALVES {
        Bits::MAX
    } else {
        (1 << count) - 1
    };
    let is_inside = cells.iter().any(|c| c.is_inside);
    if !is_inside || cells.iter().all(|c| c.is_inside) {
        let nothing = Vec::new();
        return if is_inside {
            SolidFormula::All(nothing)
        } else {
            SolidFormula::Any(nothing)
        };
    }
    if let Some((k, is_positive)) = dominating(&cells, all, true) {
        cells.retain(|c| (c.bits >> k & 1 == 1) == is_positive);
        return SolidFormula::All(vec![
            SolidFormula::literal(k, is_positive),
            rest(cells, count),
        ]);
    }
    if let Some((k, is_positive)) = dominating(&cells, all, false) {
        cells.retain(|c| (c.bits >> k & 1 == 1) != is_positive);
        return SolidFormula::Any(vec![
            SolidFormula::literal(k, is_positive),
            rest(cells, count),
        ]);
    }
    let taken = best_product(&cells, all, false);
    let added = best_product(&cells, all, true);
    let (product, is_taken) = match (taken, added) {
        (Some((p, share)), Some((q, other))) => {
            if other > share {
                (q, false)
            } else {
                (p, true)
            }
        }
        (Some((p, _)), None) => (p, true),
        (None, Some((q, _))) => (q, false),
        (None, None) => return SolidFormula::Any(Vec::new()),
    };
    cells.retain(|c| !product.holds(c.bits));
    let others = rest(cells, count);
    if is_taken {
        SolidFormula::All(vec![others, SolidFormula::Not(Box::new(product.solid()))])
    } else {
        SolidFormula::Any(vec![others, product.solid()])
    }
}

/// Returns the half space, or complement of one, that contains all cells inside and excludes the
/// most weight outside; or (`of_inside` false) that contains no cell outside and the most weight
/// inside.
fn dominating(cells: &[SolidCell], all: Bits, of_inside: bool) -> Option<(usize, bool)> {
    let (mut always, mut ever) = (all, 0);
    for c in cells.iter().filter(|c| c.is_inside == of_inside) {
        always &= c.bits;
        ever |= c.bits;
    }
    // For the solid: sides of all cells inside. For its parts: sides of no cell outside.
    let positive = if of_inside { always } else { all & !ever };
    let negative = if of_inside { all & !ever } else { always };
    let mut best: Option<(f64, (usize, bool))> = None;
    for (candidates, is_positive) in [(positive, true), (negative, false)] {
        for k in ones(candidates) {
            let decides = |c: &&SolidCell| {
                c.is_inside != of_inside && ((c.bits >> k & 1 == 1) == is_positive) != of_inside
            };
            let weight: f64 = cells.iter().filter(decides).map(|c| c.weight).sum();
            if weight > 0.0 && best.is_none_or(|b| weight > b.0) {
                best = Some((weight, (k, is_positive)));
            }
        }
    }
    best.map(|b| b.1)
}

/// Returns the product that contains the most weight on one side and no cell of the other, with its
/// share of the weight.
fn best_product(cells: &[SolidCell], all: Bits, is_inside: bool) -> Option<(Product, f64)> {
    let mut own: Vec<SolidCell> = cells
        .iter()
        .copied()
        .filter(|c| c.is_inside == is_inside)
        .collect();
    let other: Vec<Bits> = cells
        .iter()
        .filter(|c| c.is_inside != is_inside)
        .map(|c| c.bits)
        .collect();
    own.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.bits.cmp(&b.bits)));
    let total: f64 = own.iter().map(|c| c.weight).sum();
    let mut best: Option<(Product, f64)> = None;
    let mut seeds = 0;
    for cell in &own {
        // A cell that the best product contains would grow to nearly that product.
        if best.is_some_and(|b| b.0.holds(cell.bits)) {
            continue;
        }
        let product = grown(cell.bits, all, &own, &other);
        let weight = weight_of(&product, &own);
        if best.is_none_or(|b| weight > b.1) {
            best = Some((product, weight));
        }
        seeds += 1;
        // More seeds find better products in parts of hundreds of faces, and take longer.
        if seeds == 24 {
            break;
        }
    }
    best.map(|(product, weight)| (product, weight / total))
}

fn weight_of(product: &Product, cells: &[SolidCell]) -> f64 {
    cells
        .iter()
        .filter(|c| product.holds(c.bits))
        .map(|c| c.weight)
        .sum()
}

/// Returns the product of all sides of a cell without those that may be dropped, each time the one
/// whose removal gains the most weight.
fn grown(bits: Bits, all: Bits, own: &[SolidCell], other: &[Bits]) -> Product {
    let mut product = Product { mask: all, bits };
    // Sides that alone exclude a cell of the other side have to stay.
    let mut open = all;
    for o in other {
        let differ = (o ^ bits) & all;
        if differ.count_ones() == 1 {
            open &= !differ;
        }
    }
    while open != 0 {
        let mut best: Option<(f64, usize)> = None;
        for k in ones(open) {
            let without = Product {
                mask: product.mask & !(1 << k),
                bits,
            };
            if other.iter().any(|o| without.holds(*o)) {
                open &= !(1 << k);
                continue;
            }
            let weight = weight_of(&without, own);
            if best.is_none_or(|b| weight > b.0) {
                best = Some((weight, k));
            }
        }
        let Some((_, k)) = best else { break };
        product.mask &= !(1 << k);
        open &= !(1 << k);
    }
    product
}

/// Removes operands without which the solid is as good, the last first: they were found when less
/// was known.
fn irredundant(
    solid: SolidFormula,
    is_as_good: impl Fn(&SolidFormula, &SolidFormula) -> bool,
) -> SolidFormula {
    let mut solid = solid;
    let mut path = Vec::new();
    while let Some(next) = last_before(&solid, &path) {
        path = next;
        let without = removed(&solid, &path);
        if is_as_good(&without, &solid) {
            solid = without;
        }
    }
    solid
}

/// Returns the operands of a node.
fn operands(solid: &SolidFormula) -> &[SolidFormula] {
    match solid {
        SolidFormula::All(of) | SolidFormula::Any(of) => of,
        SolidFormula::Not(of) => std::slice::from_ref(of),
        SolidFormula::Half(_) => &[],
    }
}

/// Collects the paths of all operands of sets, in the order of the text.
fn paths(solid: &SolidFormula, path: &mut Vec<usize>, found: &mut Vec<Vec<usize>>) {
    let is_set = matches!(solid, SolidFormula::All(_) | SolidFormula::Any(_));
    for (k, of) in operands(solid).iter().enumerate() {
        path.push(k);
        if is_set {
            found.push(path.clone());
        }
        paths(of, path, found);
        path.pop();
    }
}

/// Returns the last path before another one, or the last of all if that is empty.
fn last_before(solid: &SolidFormula, path: &[usize]) -> Option<Vec<usize>> {
    let mut found = Vec::new();
    paths(solid, &mut Vec::new(), &mut found);
    let is_before = |p: &Vec<usize>| path.is_empty() || p.as_slice() < path;
    found.into_iter().filter(is_before).max()
}

/// Returns the solid without the operand at a path.
fn removed(solid: &SolidFormula, path: &[usize]) -> SolidFormula {
    let (first, rest) = (path[0], &path[1..]);
    let without = |of: &[SolidFormula]| -> Vec<SolidFormula> {
        let mut new = of.to_vec();
        if rest.is_empty() {
            new.remove(first);
        } else {
            new[first] = removed(&of[first], rest);
        }
        new
    };
    match solid {
        SolidFormula::All(of) => SolidFormula::All(without(of)),
        SolidFormula::Any(of) => SolidFormula::Any(without(of)),
        SolidFormula::Not(of) => SolidFormula::Not(Box::new(removed(of, rest))),
        SolidFormula::Half(k) => SolidFormula::Half(*k),
    }
}

/// Flattens nested sets of one kind, replaces sets of one operand by it, and removes double
/// complements.
fn flat(solid: SolidFormula) -> SolidFormula {
    match solid {
        SolidFormula::Half(_) => solid,
        SolidFormula::Not(of) => match flat(*of) {
            SolidFormula::Not(inner) => *inner,
            SolidFormula::All(of) if of.is_empty() => SolidFormula::Any(of),
            SolidFormula::Any(of) if of.is_empty() => SolidFormula::All(of),
            of => SolidFormula::Not(Box::new(of)),
        },
        SolidFormula::All(of) => joined(of, true),
        SolidFormula::Any(of) => joined(of, false),
    }
}

fn joined(of: Vec<SolidFormula>, is_all: bool) -> SolidFormula {
    let mut operands = Vec::new();
    for operand in of {
        match (flat(operand), is_all) {
            (SolidFormula::All(inner), true) | (SolidFormula::Any(inner), false) => {
                operands.extend(inner)
            }
            // All of space in a union, or the empty set in an intersection.
            (SolidFormula::All(inner), false) if inner.is_empty() => {
                return SolidFormula::All(inner);
            }
            (SolidFormula::Any(inner), true) if inner.is_empty() => {
                return SolidFormula::Any(inner);
            }
            (operand, _) => operands.push(operand),
        }
    }
    let is_literal = |s: &SolidFormula| matches!(s, SolidFormula::Half(_) | SolidFormula::Not(_));
    let is_taken = operands.iter().any(|s| matches!(s, SolidFormula::Not(_)));
    match (operands.len(), is_all) {
        (1, _) => operands.remove(0),
        (_, true) => SolidFormula::All(operands),
        // A union that is subtracted, such as a bore down to its floor, is written as a complement.
        (_, false) if is_taken && operands.iter().all(is_literal) => {
            let opposite = |s: SolidFormula| match s {
                SolidFormula::Not(of) => *of,
                s => SolidFormula::Not(Box::new(s)),
            };
            let taken = operands.into_iter().map(opposite).collect();
            SolidFormula::Not(Box::new(joined(taken, true)))
        }
        (_, false) => SolidFormula::Any(operands),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;

    /// Returns all cells of `n` half spaces, on the sides that a function gives.
    fn cells(n: usize, is_inside: impl Fn(&dyn Fn(usize) -> bool) -> bool) -> Vec<SolidCell> {
        let cell = |bits: Bits| SolidCell {
            bits,
            is_inside: is_inside(&|k| bits >> k & 1 == 1),
            weight: 1.0,
        };
        (0..1 << n).map(cell).collect()
    }

    #[test]
    fn a_plate_with_a_counterbore_is_written_as_one() {
        // Half spaces 0 to 2 hold the plate, 3 is the bore, 4 and 5 cylinder and space above.
        let plate = cells(6, |h| h(0) && h(1) && h(2) && !h(3) && !(h(4) && h(5)));
        let found = solid(&plate, 6);
        let SolidFormula::All(of) = &found else {
            panic!("{found:?}")
        };
        assert_eq!(of.len(), 5, "{found:?}");
        let counterbore = SolidFormula::All(vec![SolidFormula::Half(4), SolidFormula::Half(5)]);
        assert!(
            of.contains(&SolidFormula::Not(Box::new(counterbore))),
            "{found:?}"
        );
    }

    #[test]
    fn every_boolean_function_is_met() {
        let mut random = Random::new(3);
        for _ in 0..isoform_testdata::cases(200, 20) {
            let table = random.bits();
            let all = cells(6, |h| {
                let at = (0..6).fold(0, |at, k| at | usize::from(h(k)) << k);
                table >> at & 1 == 1
            });
            let found = solid(&all, 6);
            for cell in &all {
                assert_eq!(
                    found.holds(cell.bits),
                    cell.is_inside,
                    "{table:x} {found:?}"
                );
            }
        }
    }

    /// If both sides of a half space are on one side of the solid, its surface is neither a face
    /// nor a crack.
    #[test]
    fn no_solid_has_sheets_or_cracks() {
        let mut random = Random::new(4);
        for _ in 0..30 {
            let table = random.bits();
            let all = cells(6, |h| {
                let at = (0..6).fold(0, |at, k| at | usize::from(h(k)) << k);
                table >> at & 1 == 1
            });
            let found = solid(&all, 6);
            for cell in &all {
                assert_eq!(found.holds(cell.bits), cell.is_inside);
                for k in 0..6 {
                    let other = found.holds(cell.bits ^ 1 << k);
                    let on = found.holds_on(cell.bits, k);
                    assert!(other != cell.is_inside || on == Some(other), "{found:?}");
                }
            }
        }
    }

    #[test]
    fn nothing_and_everything_are_solids() {
        assert_eq!(solid(&cells(2, |_| true), 2), SolidFormula::All(vec![]));
        assert_eq!(solid(&cells(2, |_| false), 2), SolidFormula::Any(vec![]));
        assert_eq!(solid(&[], 128), SolidFormula::Any(vec![]));
    }
}
