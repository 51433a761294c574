//! Choice of the instruction set that the kernels run on.

use crate::error::{Error, Result};
use crate::words::joined;
use std::sync::OnceLock;

/// An instruction set of this CPU.
///
/// A value cannot be made for an instruction set that the CPU lacks, so kernels may rely on it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Isa(IsaKind);

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum IsaKind {
    Avx512,
    Avx2,
    DotProd,
    Baseline,
}

impl Isa {
    /// The instruction set that every CPU of the target has: `neon` on AArch64, else `portable`,
    /// which is SSE2 on x86-64.
    pub const BASELINE: Isa = Isa(IsaKind::Baseline);
    #[cfg(target_arch = "x86_64")]
    pub(super) const AVX2: Isa = Isa(IsaKind::Avx2);
    #[cfg(target_arch = "x86_64")]
    pub(super) const AVX512: Isa = Isa(IsaKind::Avx512);
    #[cfg(target_arch = "aarch64")]
    pub(super) const DOTPROD: Isa = Isa(IsaKind::DotProd);

    /// The instruction sets of this CPU, fastest first.
    pub fn available() -> impl Iterator<Item = Isa> {
        use IsaKind::{Avx2, Avx512, Baseline, DotProd};
        [Avx512, Avx2, DotProd, Baseline]
            .into_iter()
            .filter(|kind| kind.supported())
            .map(Isa)
    }

    /// `avx512`, `avx2`, `dotprod`, `neon` or `portable`.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// The instruction set called `name`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if no instruction set has that name, or this CPU lacks it.
    pub fn named(name: &str) -> Result<Isa> {
        Self::available()
            .find(|isa| isa.name() == name)
            .ok_or_else(|| {
                let available = joined(Self::available().map(Self::name));
                Error::Invalid(format!(
                    "instruction set '{name}' is not one that this CPU has: {available}"
                ))
            })
    }
}

impl std::fmt::Display for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl IsaKind {
    fn name(self) -> &'static str {
        match self {
            IsaKind::Avx512 => "avx512",
            IsaKind::Avx2 => "avx2",
            IsaKind::DotProd => "dotprod",
            IsaKind::Baseline if cfg!(target_arch = "aarch64") => "neon",
            IsaKind::Baseline => "portable",
        }
    }

    #[cfg(target_arch = "x86_64")]
    fn supported(self) -> bool {
        let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        match self {
            IsaKind::Baseline => true,
            IsaKind::DotProd => false,
            IsaKind::Avx2 => avx2,
            IsaKind::Avx512 => {
                avx2 && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512cd")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
        }
    }

    #[cfg(target_arch = "aarch64")]
    fn supported(self) -> bool {
        match self {
            IsaKind::Baseline => true,
            IsaKind::DotProd => std::arch::is_aarch64_feature_detected!("dotprod"),
            IsaKind::Avx2 | IsaKind::Avx512 => false,
        }
    }

    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    fn supported(self) -> bool {
        self == IsaKind::Baseline
    }
}

/// The instruction set in use: the fastest this CPU has, or the one that the environment variable
/// `SVL_ISA` names (`portable`, `avx2`, `avx512`; `neon`, `dotprod` on AArch64). Chosen once per
/// process.
///
/// # Errors
/// [`Error::Invalid`] if `SVL_ISA` names one that this CPU lacks: a measurement on another would
/// mislead.
pub fn isa() -> Result<Isa> {
    static CHOSEN: OnceLock<Result<Isa>> = OnceLock::new();
    let chosen = CHOSEN.get_or_init(|| match std::env::var("SVL_ISA") {
        Ok(name) => Isa::named(&name),
        Err(_) => Ok(Isa::available().next().unwrap_or(Isa::BASELINE)),
    });
    let chosen = chosen.as_ref().copied();
    chosen.map_err(|e| Error::Invalid(format!("SVL_ISA: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_machine_has_the_baseline_and_no_machine_an_invented_one() {
        let baseline = if cfg!(target_arch = "aarch64") {
            "neon"
        } else {
            "portable"
        };
        assert_eq!(Isa::named(baseline).unwrap(), Isa::BASELINE);
        assert_eq!(Isa::available().last(), Some(Isa::BASELINE));
        let error = Isa::named("mmx").unwrap_err().to_string();
        assert!(
            error.contains("'mmx'") && error.contains(baseline),
            "{error}"
        );
    }
}
