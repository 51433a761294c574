//! Instructions that the compiler does not find on its own: multiply-add of pairs of 16-bit numbers
//! (`vpmaddwd`), and of four bytes (`udot`). All else is loops, compiled per instruction set.
//!
//! With the first the sums of squared differences slide in four operations instead of six, and with
//! one load less; the matching of v1 to v3 takes two thirds of the time.

#[cfg(not(target_arch = "aarch64"))]
use super::lanes::Interleave;
#[cfg(not(target_arch = "aarch64"))]
use std::mem::transmute;

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

/// Two numbers of each row, in the order in which the CPU multiplies them: in pairs or in planes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct RowPairs(
    #[cfg(not(target_arch = "aarch64"))] Group<[i16; 2]>,
    #[cfg(target_arch = "aarch64")] [[i16; Group::ROWS]; 2],
);

impl RowPairs {
    /// Zeros.
    pub const NONE: Self = Self(
        #[cfg(not(target_arch = "aarch64"))]
        Group::splat([0; 2]),
        #[cfg(target_arch = "aarch64")]
        [[0; Group::ROWS]; 2],
    );

    #[inline(always)]
    pub fn new(numbers: [[i16; Group::ROWS]; 2]) -> Self {
        #[cfg(target_arch = "aarch64")]
        return Self(numbers);
        #[cfg(not(target_arch = "aarch64"))]
        {
            let [a, b] = numbers.each_ref().map(|numbers| numbers.as_chunks().0);
            let pairs = [i16::interleave(a[0], b[0]), i16::interleave(a[1], b[1])];
            // SAFETY: both are the same numbers in the same order.
            Self(unsafe { transmute::<[[[i16; 8]; 2]; 2], Group<[i16; 2]>>(pairs) })
        }
    }
}

/// Sums of products on one instruction set. The methods here are those that every CPU of the target
/// can run.
pub trait Pairs {
    /// True if choosing between two vectors by a third takes one operation.
    const SELECTS: bool = cfg!(not(target_arch = "x86_64"));

    /// `sum + squares[0] + squares[1]` and the products of both pairs, of each row. Each of the
    /// squares is a difference, the last one that of the squares of the numbers of `pairs[1]`.
    #[inline(always)]
    fn sum(&self, sum: Group<u32>, squares: [Group<u32>; 2], pairs: [RowPairs; 2]) -> Group<u32> {
        #[cfg(target_arch = "aarch64")]
        return arm::sum(sum, squares[0], pairs);
        #[cfg(not(target_arch = "aarch64"))]
        {
            let mut sum = sum;
            for l in 0..Group::ROWS {
                sum.0[l] = sum.0[l].wrapping_add(squares[0].0[l].wrapping_add(squares[1].0[l]));
            }
            self.add_products(sum, [pairs[0].0, pairs[1].0])
        }
    }

    /// `sum + pairs[0][0]·pairs[1][0] + pairs[0][1]·pairs[1][1]` of each row.
    #[inline(always)]
    fn add_products(&self, mut sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
        for l in 0..Group::ROWS {
            let product = |k: usize| i32::from(pairs[0].0[l][k]) * i32::from(pairs[1].0[l][k]);
            sum.0[l] = sum.0[l].wrapping_add_signed(product(0) + product(1));
        }
        sum
    }

    /// The numbers of both planes as pairs.
    #[inline(always)]
    fn pair_up(&self, planes: &[[i16; Group::ROWS]; 2]) -> RowPairs {
        RowPairs::new(*planes)
    }

    /// `sum` and the numbers of each row by their weights.
    #[inline(always)]
    fn add_weighted(&self, sum: Group<u32>, numbers: RowPairs, weights: [i16; 2]) -> Group<u32> {
        #[cfg(target_arch = "aarch64")]
        {
            let mut sum = sum;
            for (numbers, weight) in numbers.0.iter().zip(weights) {
                for l in 0..Group::ROWS {
                    let product = i32::from(numbers[l]) * i32::from(weight);
                    sum.0[l] = sum.0[l].wrapping_add_signed(product);
                }
            }
            sum
        }
        #[cfg(not(target_arch = "aarch64"))]
        self.add_products(sum, [numbers.0, Group::splat(weights)])
    }

    /// `sum − 2 · Σ rows·words` of each row, the sum over nine bytes: words have four bytes each,
    /// and the last one has one.
    #[inline(always)]
    fn subtract_twice(
        &self,
        sum: Group<u32>,
        rows: [Group<u32>; 3],
        words: [u32; 3],
    ) -> Group<u32> {
        #[cfg(target_arch = "aarch64")]
        return arm::subtract_twice(sum, rows, words);
        #[cfg(not(target_arch = "aarch64"))]
        {
            let mut sum = sum;
            for (row, word) in rows.into_iter().zip(words).take(2) {
                let bytes = word.to_le_bytes().map(|byte| -2 * i16::from(byte));
                // The bytes at even places, and those at odd ones.
                let [mut even, mut odd] = [in_pairs(row); 2];
                for l in 0..Group::ROWS {
                    even.0[l] = even.0[l].map(|word| word & 0xff);
                    odd.0[l] = odd.0[l].map(|word| (word as u16 >> 8) as i16);
                }
                sum = self.add_products(sum, [even, Group::splat([bytes[0], bytes[2]])]);
                sum = self.add_products(sum, [odd, Group::splat([bytes[1], bytes[3]])]);
            }
            let last = Group::splat([-2 * words[2] as i16, 0]);
            self.add_products(sum, [in_pairs(rows[2]), last])
        }
    }

    /// `(float − 2²³) · weight` of each row, rounded once. `floats` are the bits of floats between
    /// 2²³ and 2²⁴; `weight` is a whole number below 2¹⁶, `bias` −2²³ times the weight.
    #[inline(always)]
    fn costs(&self, floats: Group<u32>, weight: f32, bias: f32) -> Group<f32> {
        // One operation, where the instruction set has it.
        let is_fused = Self::SELECTS && cfg!(target_arch = "x86_64");
        let cost = |bits| match is_fused {
            true => f32::from_bits(bits).mul_add(weight, bias),
            false => (f32::from_bits(bits) - BIAS) * weight,
        };
        let mut costs = Group::splat(0.0);
        for l in 0..Group::ROWS {
            costs.0[l] = cost(floats.0[l]);
        }
        costs
    }

    /// The lesser of each row. They are bits of floats, of which none is negative or not a number.
    #[inline(always)]
    fn least(&self, mut a: Group<i32>, b: Group<i32>) -> Group<i32> {
        for l in 0..Group::ROWS {
            a.0[l] = a.0[l].min(b.0[l]);
        }
        a
    }
}

/// 2²³.
pub(super) const BIAS: f32 = 8_388_608.0;

/// The words as pairs of 16-bit numbers.
#[cfg(not(target_arch = "aarch64"))]
#[inline(always)]
fn in_pairs(words: Group<u32>) -> Group<[i16; 2]> {
    // SAFETY: both are numbers of any value.
    unsafe { transmute::<Group<u32>, Group<[i16; 2]>>(words) }
}

/// What every CPU of the target has.
pub struct Portable;

#[cfg(not(target_arch = "x86_64"))]
impl Pairs for Portable {}

#[cfg(target_arch = "aarch64")]
pub use arm::DotProd;

#[cfg(target_arch = "aarch64")]
mod arm {
    use super::{Group, Pairs, RowPairs};
    use std::arch::aarch64::*;
    use std::mem::transmute;

    /// A token: this CPU multiplies and adds groups of four bytes.
    pub struct DotProd(());

    impl DotProd {
        /// # Safety
        /// The CPU must have `dotprod`.
        #[inline(always)]
        pub unsafe fn new() -> Self {
            Self(())
        }
    }

    impl Pairs for DotProd {
        #[inline(always)]
        fn subtract_twice(
            &self,
            sum: Group<u32>,
            rows: [Group<u32>; 3],
            words: [u32; 3],
        ) -> Group<u32> {
            subtract_twice_by(sum, rows, words, |[a, b, c], words| {
                // SAFETY: the token proves that the CPU has the instruction.
                unsafe {
                    let dots = dot(vdupq_n_u32(0), a, words[0]);
                    dot(dot(dots, b, words[1]), c, words[2])
                }
            })
        }
    }

    /// [`Pairs::sum`] with NEON. The squares of the second pair `[c, d]` are added with its
    /// products: `c² − d² + a·c + b·d = c·(a + c) + d·(b − d)`.
    #[inline(always)]
    pub(super) fn sum(
        sum: Group<u32>,
        squares: Group<u32>,
        [first, second]: [RowPairs; 2],
    ) -> Group<u32> {
        // SAFETY: arrays of numbers are vectors of their size; and every CPU of this architecture
        // has NEON.
        unsafe {
            let [mut sum, squares] =
                transmute::<[Group<u32>; 2], [[int32x4_t; 4]; 2]>([sum, squares]);
            let [[a, b], [c, d]] = transmute::<
                [[[i16; Group::ROWS]; 2]; 2],
                [[[int16x8_t; 2]; 2]; 2],
            >([first.0, second.0]);
            for i in 0..2 {
                let (with_c, with_d) = (vaddq_s16(a[i], c[i]), vsubq_s16(b[i], d[i]));
                let low = vaddq_s32(sum[2 * i], squares[2 * i]);
                let high = vaddq_s32(sum[2 * i + 1], squares[2 * i + 1]);
                let low = vmlal_s16(low, vget_low_s16(c[i]), vget_low_s16(with_c));
                let high = vmlal_high_s16(high, c[i], with_c);
                sum[2 * i] = vmlal_s16(low, vget_low_s16(d[i]), vget_low_s16(with_d));
                sum[2 * i + 1] = vmlal_high_s16(high, d[i], with_d);
            }
            transmute::<[int32x4_t; 4], Group<u32>>(sum)
        }
    }

    /// [`Pairs::subtract_twice`] with NEON, which every AArch64 has.
    #[inline(always)]
    pub(super) fn subtract_twice(
        sum: Group<u32>,
        rows: [Group<u32>; 3],
        words: [u32; 3],
    ) -> Group<u32> {
        subtract_twice_by(sum, rows, words, |[a, b, c], words| {
            // SAFETY: see above.
            unsafe {
                let [a, b] = [a, b].map(|row| vreinterpretq_u8_u32(row));
                let [with_a, with_b] = [words[0], words[1]].map(|word| vreinterpretq_u8_u32(word));
                let low = vpaddlq_u16(vmull_u8(vget_low_u8(a), vget_low_u8(with_a)));
                let high = vpaddlq_u16(vmull_high_u8(a, with_a));
                let low = vpadalq_u16(low, vmull_u8(vget_low_u8(b), vget_low_u8(with_b)));
                let high = vpadalq_u16(high, vmull_high_u8(b, with_b));
                vmlaq_u32(vpaddq_u32(low, high), c, words[2])
            }
        })
    }

    /// `dots` sums the products of four rows.
    #[inline(always)]
    fn subtract_twice_by(
        sum: Group<u32>,
        rows: [Group<u32>; 3],
        words: [u32; 3],
        dots: impl Fn([uint32x4_t; 3], [uint32x4_t; 3]) -> uint32x4_t,
    ) -> Group<u32> {
        // SAFETY: arrays of numbers are vectors of their size; and every CPU of this architecture
        // has NEON.
        unsafe {
            let sum = transmute::<Group<u32>, [uint32x4_t; 4]>(sum);
            let rows = transmute::<[Group<u32>; 3], [[uint32x4_t; 4]; 3]>(rows);
            let words = words.map(|word| vdupq_n_u32(word));
            let quarter = |i: usize| {
                let dots = dots([rows[0][i], rows[1][i], rows[2][i]], words);
                vsubq_u32(sum[i], vshlq_n_u32::<1>(dots))
            };
            transmute::<[uint32x4_t; 4], Group<u32>>(std::array::from_fn(quarter))
        }
    }

    /// Adds to each number the products of four bytes. `vdotq_u32` is stable since Rust 1.98.
    #[inline]
    #[target_feature(enable = "neon,dotprod")]
    fn dot(mut sum: uint32x4_t, a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
        // SAFETY: it changes `sum` alone.
        unsafe {
            std::arch::asm!(
                "udot {sum:v}.4s, {a:v}.16b, {b:v}.16b",
                sum = inout(vreg) sum,
                a = in(vreg) a,
                b = in(vreg) b,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        sum
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Group, Pairs, Portable, RowPairs};
    use std::arch::x86_64::*;
    use std::mem::transmute;

    /// A token: this CPU has AVX2.
    pub struct Avx2(());
    /// A token: this CPU has AVX-512 with its bytes and words.
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

    /// [`Pairs::add_products`] by vectors of an instruction set.
    macro_rules! products {
        ($count:literal x $vector:ident, $add:ident, $multiply:ident) => {
            #[inline(always)]
            fn add_products(&self, sum: Group<u32>, pairs: [Group<[i16; 2]>; 2]) -> Group<u32> {
                // SAFETY: the token proves that the CPU has the instructions, and every x86-64 has
                // SSE2; arrays of numbers are vectors of their size.
                unsafe {
                    let mut sum = transmute::<Group<u32>, [$vector; $count]>(sum);
                    let [a, b] = transmute::<[Group<[i16; 2]>; 2], [[$vector; $count]; 2]>(pairs);
                    for i in 0..$count {
                        sum[i] = $add(sum[i], $multiply(a[i], b[i]));
                    }
                    transmute::<[$vector; $count], Group<u32>>(sum)
                }
            }
        };
    }

    impl Pairs for Portable {
        products!(4 x __m128i, _mm_add_epi32, _mm_madd_epi16);

        /// SSE2 compares no whole numbers of 32 bits.
        #[inline(always)]
        fn least(&self, a: Group<i32>, b: Group<i32>) -> Group<i32> {
            // SAFETY: see above.
            unsafe {
                let [mut a, b] = transmute::<[Group<i32>; 2], [[__m128; 4]; 2]>([a, b]);
                (0..4).for_each(|i| a[i] = _mm_min_ps(a[i], b[i]));
                transmute::<[__m128; 4], Group<i32>>(a)
            }
        }
    }

    impl Pairs for Avx2 {
        const SELECTS: bool = true;
        products!(2 x __m256i, _mm256_add_epi32, _mm256_madd_epi16);
    }

    impl Pairs for Avx512 {
        const SELECTS: bool = true;
        products!(1 x __m512i, _mm512_add_epi32, _mm512_madd_epi16);

        /// By one instruction, which makes v3 a tenth faster.
        #[inline(always)]
        fn pair_up(&self, planes: &[[i16; Group::ROWS]; 2]) -> RowPairs {
            let mut order = Group::splat([0, Group::ROWS as i16]);
            for l in 0..Group::ROWS {
                order.0[l] = order.0[l].map(|first| first + l as i16);
            }
            // SAFETY: see above.
            unsafe {
                let order = transmute::<Group<[i16; 2]>, __m512i>(order);
                let planes = transmute::<[[i16; Group::ROWS]; 2], __m512i>(*planes);
                let pairs = _mm512_permutexvar_epi16(order, planes);
                RowPairs(transmute::<__m512i, Group<[i16; 2]>>(pairs))
            }
        }
    }
}
