//! Hot loops: one readable implementation compiled per instruction set and chosen at run time.
//!
//! Every function here takes the [`Isa`] it shall run on. Its body is plain Rust over fixed-size lanes, marked
//! `#[inline(always)]` and pulled into one function per instruction set, where the compiler turns the lanes into
//! vectors. All arithmetic is on integers, so every variant gives the same bytes; `tests/v3.rs` holds them to it.

mod dog;
mod isa;
mod smooth;
mod ssd;

pub use dog::DogTaps;
pub use isa::{Isa, isa};
pub use ssd::{Search, Winner};

use crate::stereo::Gray;

/// Makes, per kernel, a safe function that runs its body compiled for the given instruction set.
macro_rules! kernels {
    ($($(#[$doc:meta])* pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $body:path;)*) => {$(
        $(#[$doc])*
        pub fn $name(isa: Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
                fn avx512($($arg: $ty),*) {
                    $body($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) {
                    $body($($arg),*)
                }
                if isa == Isa::AVX512 {
                    // SAFETY: an `Isa` other than portable comes from `Isa::available` alone, which asked this CPU.
                    return unsafe { avx512($($arg),*) };
                }
                if isa == Isa::AVX2 {
                    // SAFETY: as above.
                    return unsafe { avx2($($arg),*) };
                }
            }
            debug_assert_eq!(isa, Isa::PORTABLE);
            $body($($arg),*)
        }
    )*};
}

kernels! {
    /// Row `y` of `image` convolved along its columns, edges replicated: `(Σ w·I + 32768) >> 16`.
    ///
    /// `weights[k]` belongs to the rows `y - k` and `y + k`; with both sides counted they sum to 65536.
    pub fn smooth_row(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) = smooth::row;

    /// Marks the pixels of `row` where the fine difference of Gaussians answers at least as strongly as the coarse one.
    pub fn textured_row(row: &[u8], taps: &DogTaps, out: &mut [bool]) = dog::row;

    /// For each of the `windows` (centres, at least 4 pixels inside) of `probe`, the offset of `search` at which
    /// `SSD · weights` is least, ties to the higher offset. `out` gets one winner per window.
    ///
    /// Each window must have an admissible offset, and `Search::MAX_SSD * weight` must fit 32 bits.
    pub fn winners(
        search: &mut Search, probe: &[u8], other: &[u8], weights: &[u32], windows: &[u32], out: &mut Vec<Winner>,
    ) = ssd::winners;

    /// For each of the `windows` of `probe` the least SSD over the offsets of `search`, [`Search::NONE`] where none is
    /// admissible.
    pub fn least_ssd(
        search: &mut Search, probe: &[u8], other: &[u8], windows: &[u32], out: &mut Vec<u32>,
    ) = ssd::least;
}
