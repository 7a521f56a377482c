//! The equation of a low degree: the kernel of the matrix of all monomials at random points.

use super::MapError;
use super::pullback::{Residues, eval_at, powers};
use crate::modpoly;
use crate::modular::{Crt, Echelon, Fp, primes, residues};
use crate::poly::{Exponents, Poly};
use dashu_int::UBig;
use isoform_control::Control;

/// Forms of a degree that vanish on a map.
pub(super) enum Kernel {
    None,
    One(Poly),
    More,
}

/// Number of rows in excess of the number of columns: the kernel must not shrink by them.
const EXTRA_ROWS: usize = 2;

/// Returns the forms of a degree that vanish on a map. A form that is found is proved; the absence
/// of forms, or their multiplicity, is probable, by random points modulo a prime.
pub(super) fn equation_of_degree(
    map: &[Poly; 4],
    degree: usize,
    control: &Control<'_>,
) -> Result<Kernel, MapError> {
    let mut support = Support::whole(degree);
    let mut crt: Option<Crt> = None;
    let mut last: Option<Poly> = None;
    let mut stream = Residues::new(3);
    for f in primes() {
        let echelon = support.values(&f, map, &mut stream, control)?;
        let Some((column, vector)) = echelon.kernel(&f) else {
            if crt.is_some() {
                // The prime divides a number that has to be invertible.
                continue;
            }
            return Ok(if echelon.rank() == support.monomials.len() {
                Kernel::None
            } else {
                Kernel::More
            });
        };
        let Some(vector) = support.scaled(&f, column, vector) else {
            continue;
        };
        let crt = crt.get_or_insert_with(|| Crt::new(vector.len()));
        crt.push(&f, &vector);
        let Some((numerators, _)) = crt.rational() else {
            continue;
        };
        let terms = support.monomials.iter().copied().zip(numerators);
        let candidate = Poly::from_integers(terms, UBig::ONE).primitive();
        if last.as_ref() == Some(&candidate) && candidate.composes_to_zero(map) {
            return Ok(Kernel::One(candidate));
        }
        last = Some(candidate);
    }
    unreachable!("there are enough primes below 2^62")
}

/// Monomials of x, y, z, w of an equation.
struct Support {
    degree: usize,
    monomials: Vec<Exponents>,
    /// Monomial whose coefficient is 1, once the first kernel has determined the monomials that
    /// occur.
    free: Option<usize>,
}

impl Support {
    /// Returns all monomials of a degree.
    fn whole(degree: usize) -> Self {
        let d = degree as u16;
        let of_x = |i| {
            (0..=d - i).flat_map(move |j| (0..=d - i - j).map(move |k| [i, j, k, d - i - j - k]))
        };
        Self {
            degree,
            monomials: (0..=d).flat_map(of_x).collect(),
            free: None,
        }
    }

    /// Returns the matrix of the monomials at images of random points.
    fn values(
        &self,
        f: &Fp,
        map: &[Poly; 4],
        stream: &mut Residues,
        control: &Control<'_>,
    ) -> Result<Echelon, MapError> {
        let forms: Vec<Vec<(Exponents, u64)>> = map.iter().map(|p| residues(f, p)).collect();
        let mut echelon = Echelon::new(self.monomials.len());
        for _ in 0..self.monomials.len() + EXTRA_ROWS {
            if control.is_stopped() {
                return Err(MapError::Stopped);
            }
            let at = [stream.next(f), stream.next(f), f.one()];
            let tables: [Vec<u64>; 4] =
                std::array::from_fn(|i| powers(f, eval_at(f, &forms[i], &at), self.degree));
            let value =
                |e: &Exponents| (0..4).fold(f.one(), |m, v| f.mul(m, tables[v][usize::from(e[v])]));
            echelon.insert(f, self.monomials.iter().map(value).collect());
        }
        Ok(echelon)
    }

    /// Returns a kernel vector with the coefficient 1 at the free monomial; `None` for a prime
    /// modulo which that vanishes. The first vector determines the monomials that occur; only these
    /// are used afterwards, so that sparse equations are cheap modulo further primes.
    fn scaled(&mut self, f: &Fp, column: usize, vector: Vec<u64>) -> Option<Vec<u64>> {
        match self.free {
            None => {
                let occurring: Vec<usize> = (0..vector.len()).filter(|&i| vector[i] != 0).collect();
                self.free = occurring.iter().position(|&i| i == column);
                self.monomials = occurring.iter().map(|&i| self.monomials[i]).collect();
                Some(occurring.into_iter().map(|i| vector[i]).collect())
            }
            Some(known) => (vector[known] != 0).then(|| {
                let scale = f.inv(vector[known]);
                modpoly::scale(f, &vector, scale)
            }),
        }
    }
}
