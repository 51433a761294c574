//! Multiply-add of pairs of 16-bit numbers (`vpmaddwd`), an instruction that the compiler does not
//! find on its own.
//!
//! With it the sums of squared differences slide in four operations instead of six, and with one
//! load less; the matching of v1 to v3 takes two thirds of the time.

/// A number for each of sixteen rows; 32-bit numbers fill a vector of AVX-512.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Group<T>(pub [T; Group::<()>::ROWS]);

impl Group<()> {
    pub const ROWS: usize = 16;
}

impl<T: Copy> Group<T> {
    pub const fn splat(value: T) -> Self {
        Self([value; Group::ROWS])
    }
}

impl<T> AsRef<[T]> for Group<T> {
    fn as_ref(&self) -> &[T] {
        &self.0
    }
}

/// Multiplication of pairs on one instruction set.
pub trait Pairs {
    /// `sum + a + b + pairs[0][0]·pairs[1][0] + pairs[0][1]·pairs[1][1]` of each row.
    fn sum(
        &self,
        sum: Group<u32>,
        squares: [Group<u32>; 2],
        pairs: [Group<[i16; 2]>; 2],
    ) -> Group<u32>;

    /// `sum + pairs[0][0]·pairs[1][0] + pairs[0][1]·pairs[1][1]` of each row.
    fn add_products(&self, sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32>;

    /// `(float − 2²³) · weight` of each row, rounded once. `floats` are the bits of floats between
    /// 2²³ and 2²⁴; `weight` is a whole number below 2¹⁶, `bias` −2²³ times the weight.
    fn costs(&self, floats: Group<u32>, weight: f32, bias: f32) -> Group<f32>;
}

/// 2²³.
pub(super) const BIAS: f32 = 8_388_608.0;

pub struct Portable;

impl Pairs for Portable {
    #[inline(always)]
    fn sum(
        &self,
        mut sum: Group<u32>,
        squares: [Group<u32>; 2],
        pairs: [Group<[i16; 2]>; 2],
    ) -> Group<u32> {
        for l in 0..Group::ROWS {
            sum.0[l] = sum.0[l].wrapping_add(squares[0].0[l].wrapping_add(squares[1].0[l]));
        }
        self.add_products(sum, pairs)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn add_products(&self, sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
        x86::add_products_sse2(sum, pairs)
    }

    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    fn add_products(&self, mut sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
        for l in 0..Group::ROWS {
            let product = |k: usize| i32::from(pairs[0].0[l][k]) * i32::from(pairs[1].0[l][k]);
            sum.0[l] = sum.0[l].wrapping_add_signed(product(0) + product(1));
        }
        sum
    }

    #[inline(always)]
    fn costs(&self, floats: Group<u32>, weight: f32, _: f32) -> Group<f32> {
        let mut costs = Group::splat(0.0);
        for l in 0..Group::ROWS {
            costs.0[l] = (f32::from_bits(floats.0[l]) - BIAS) * weight;
        }
        costs
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Group, Pairs};
    use std::arch::x86_64::*;
    use std::mem::transmute;

    /// A token: this CPU has AVX2.
    pub struct Avx2(());
    /// A token: this CPU has AVX-512.
    pub struct Avx512(());

    impl Avx2 {
        /// # Safety
        /// The CPU must have AVX2.
        #[inline(always)]
        pub unsafe fn new() -> Self {
            Self(())
        }
    }

    impl Avx512 {
        /// # Safety
        /// The CPU must have AVX-512 with its bytes and words.
        #[inline(always)]
        pub unsafe fn new() -> Self {
            Self(())
        }
    }

    // SAFETY of all below: the token proves that the CPU has the instructions; arrays of numbers
    // are vectors of their size.

    /// [`Pairs::costs`]: one operation multiplies and adds.
    #[inline(always)]
    fn fused_costs(floats: Group<u32>, weight: f32, bias: f32) -> Group<f32> {
        let mut costs = Group::splat(0.0);
        for l in 0..Group::ROWS {
            costs.0[l] = f32::from_bits(floats.0[l]).mul_add(weight, bias);
        }
        costs
    }

    /// [`Pairs::add_products`] with SSE2, which every x86-64 has.
    #[inline(always)]
    pub(super) fn add_products_sse2(sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
        // SAFETY: see above.
        unsafe {
            let sum = transmute::<Group<u32>, [__m128i; 4]>(sum);
            let [a, b] = transmute::<[Group<[i16; 2]>; 2], [[__m128i; 4]; 2]>(pairs);
            let quarter = |i: usize| _mm_add_epi32(sum[i], _mm_madd_epi16(a[i], b[i]));
            transmute::<[__m128i; 4], Group<u32>>(std::array::from_fn(quarter))
        }
    }

    impl Pairs for Avx2 {
        #[inline(always)]
        fn sum(
            &self,
            sum: Group<u32>,
            [a, b]: [Group<u32>; 2],
            pairs: [Group<[i16; 2]>; 2],
        ) -> Group<u32> {
            // SAFETY: see above.
            let sum = unsafe {
                let [sum, a, b] = transmute::<[Group<u32>; 3], [[__m256i; 2]; 3]>([sum, a, b]);
                let half = |i: usize| _mm256_add_epi32(sum[i], _mm256_add_epi32(a[i], b[i]));
                transmute::<[__m256i; 2], Group<u32>>([half(0), half(1)])
            };
            self.add_products(sum, pairs)
        }

        #[inline(always)]
        fn add_products(&self, sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
            // SAFETY: see above.
            unsafe {
                let sum = transmute::<Group<u32>, [__m256i; 2]>(sum);
                let [a, b] = transmute::<[Group<[i16; 2]>; 2], [[__m256i; 2]; 2]>(pairs);
                let half = |i: usize| _mm256_add_epi32(sum[i], _mm256_madd_epi16(a[i], b[i]));
                transmute::<[__m256i; 2], Group<u32>>([half(0), half(1)])
            }
        }

        #[inline(always)]
        fn costs(&self, floats: Group<u32>, weight: f32, bias: f32) -> Group<f32> {
            fused_costs(floats, weight, bias)
        }
    }

    impl Pairs for Avx512 {
        #[inline(always)]
        fn sum(
            &self,
            sum: Group<u32>,
            [a, b]: [Group<u32>; 2],
            pairs: [Group<[i16; 2]>; 2],
        ) -> Group<u32> {
            // SAFETY: see above.
            let sum = unsafe {
                let [sum, a, b] = transmute::<[Group<u32>; 3], [__m512i; 3]>([sum, a, b]);
                transmute::<__m512i, Group<u32>>(_mm512_add_epi32(sum, _mm512_add_epi32(a, b)))
            };
            self.add_products(sum, pairs)
        }

        #[inline(always)]
        fn add_products(&self, sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
            // SAFETY: see above.
            unsafe {
                let sum = transmute::<Group<u32>, __m512i>(sum);
                let [a, b] = transmute::<[Group<[i16; 2]>; 2], [__m512i; 2]>(pairs);
                transmute::<__m512i, Group<u32>>(_mm512_add_epi32(sum, _mm512_madd_epi16(a, b)))
            }
        }

        #[inline(always)]
        fn costs(&self, floats: Group<u32>, weight: f32, bias: f32) -> Group<f32> {
            fused_costs(floats, weight, bias)
        }
    }
}
