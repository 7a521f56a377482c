//! Reproducible pseudo-random streams: identical numbers in every run and on every machine.
//!
//! There are three published generators of 64 bits. Use [`Random::new`] in new code; the other two
//! serve algorithms with recorded results that depend on their streams.
//!
//! - SplitMix: G. L. Steele, D. Lea, C. H. Flood, Fast splittable pseudorandom number generators,
//!   OOPSLA 2014.
//! - Xorshift: G. Marsaglia, Xorshift RNGs, J. Stat. Software 8 (14), 2003.
//! - Linear congruential: multiplier and increment of D. E. Knuth's MMIX.

/// Increment of SplitMix: 2⁶⁴ divided by the golden ratio, rounded to an odd number.
const GOLDEN_INCREMENT: u64 = 0x9E37_79B9_7F4A_7C15;
/// Factor of the seeds of SplitMix, which spreads the states of neighbouring seeds: the multiplier
/// of a congruential generator with good spectral properties (G. L. Steele and S. Vigna 2021).
const SEED_MULTIPLIER: u64 = 0xD134_2543_DE82_EF95;
/// State of the xorshift stream with the seed 0. Any number except 0 would serve.
const XORSHIFT_START: u64 = 0x2545_F491_4F6C_DD1D;

/// Stream of pseudo-random numbers that depends on its seed only.
///
/// ```
/// use isoform_num::Random;
///
/// // π from the share of points of the square [−1, 1)² that lie in the unit disc.
/// let mut random = Random::new(1);
/// let inside = (0..100_000)
///     .filter(|_| random.symmetric().hypot(random.symmetric()) < 1.0)
///     .count();
/// assert!((inside as f64 / 25_000.0 - std::f64::consts::PI).abs() < 0.02);
/// assert_eq!(Random::new(7).bits(), Random::new(7).bits());
/// ```
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
    generator: Generator,
}

#[derive(Clone, Copy, Debug)]
enum Generator {
    SplitMix,
    Xorshift,
    Congruential,
}

impl Random {
    /// Returns a SplitMix stream for any seed: the generator to use by default.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            state: seed
                .wrapping_mul(SEED_MULTIPLIER)
                .wrapping_add(GOLDEN_INCREMENT),
            generator: Generator::SplitMix,
        }
    }

    /// Returns a stream of Marsaglia's xorshift with the shifts 13, 7 and 17, for small seeds.
    ///
    /// # Panics
    /// For the one seed that leads to the state 0, which is 0x2545_F491_4F6C_DD1D.
    #[must_use]
    pub fn xorshift(seed: u64) -> Self {
        assert_ne!(seed, XORSHIFT_START, "the state 0 has no successor");
        Self {
            state: XORSHIFT_START ^ seed,
            generator: Generator::Xorshift,
        }
    }

    /// Returns a stream of the linear congruential generator of MMIX. Its low bits have short
    /// periods; [`Random::unit`] omits them.
    #[must_use]
    pub fn congruential(seed: u64) -> Self {
        Self {
            state: seed,
            generator: Generator::Congruential,
        }
    }

    /// Returns the next 64 bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        match self.generator {
            Generator::SplitMix => {
                self.state = self.state.wrapping_add(GOLDEN_INCREMENT);
                let z = self.state;
                let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                z ^ (z >> 31)
            }
            Generator::Xorshift => {
                self.state ^= self.state << 13;
                self.state ^= self.state >> 7;
                self.state ^= self.state << 17;
                self.state
            }
            Generator::Congruential => {
                self.state = self
                    .state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                self.state
            }
        }
    }

    /// Returns the next number of \[0, 1), a multiple of 2⁻⁵³.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns the next number of \[−1, 1), a multiple of 2⁻⁵².
    #[inline]
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(mut random: Random) -> [u64; 3] {
        std::array::from_fn(|_| random.bits())
    }

    /// The first outputs of Vigna's reference implementation for the state 1234567.
    #[test]
    fn split_mix_gives_the_published_numbers() {
        let random = Random {
            state: 1_234_567,
            generator: Generator::SplitMix,
        };
        let published = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
        ];
        assert_eq!(first(random), published);
    }

    /// x_n = aⁿ x₀ + c (aⁿ − 1)/(a − 1), by powers modulo 2¹²⁸.
    #[test]
    fn the_congruential_stream_has_a_closed_form() {
        let (a, c) = (6_364_136_223_846_793_005u128, 1_442_695_040_888_963_407u128);
        let mut random = Random::congruential(17);
        let (mut power, mut sum) = (1u128, 0u128);
        for _ in 0..100 {
            sum = sum.wrapping_add(power);
            power = power.wrapping_mul(a);
            let closed = power.wrapping_mul(17).wrapping_add(sum.wrapping_mul(c)) as u64;
            assert_eq!(random.bits(), closed);
        }
    }

    /// The three steps of xorshift are linear over the field of two elements.
    #[test]
    fn xorshift_is_linear() {
        let step = |seed: u64| Random::xorshift(seed).bits();
        for (a, b) in [(1, 2), (5, 900), (u64::MAX, 77)] {
            assert_eq!(step(a) ^ step(b) ^ step(0), step(a ^ b));
        }
    }

    #[test]
    #[should_panic(expected = "no successor")]
    fn the_state_zero_is_refused() {
        let _ = Random::xorshift(XORSHIFT_START);
    }

    /// Mean 0 and variance 1/3 of the uniform distribution on [−1, 1), within five deviations.
    #[test]
    fn numbers_are_spread_evenly() {
        let count = 100_000;
        for mut random in [
            Random::new(1),
            Random::new(2),
            Random::xorshift(1),
            Random::congruential(1),
        ] {
            let (mut mean, mut square) = (0.0, 0.0);
            for _ in 0..count {
                let x = random.symmetric();
                assert!((-1.0..1.0).contains(&x));
                mean += x / f64::from(count);
                square += x * x / f64::from(count);
            }
            assert!(mean.abs() < 0.01 && (square - 1.0 / 3.0).abs() < 0.005);
        }
    }

    #[test]
    fn seeds_give_streams_of_their_own() {
        assert_ne!(first(Random::new(1)), first(Random::new(2)));
        assert_ne!(first(Random::xorshift(1)), first(Random::xorshift(2)));
    }
}
