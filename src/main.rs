//! The `svl` program: parse, run, exit code.

mod cli;

use std::process::ExitCode;
use svl::memory::CountingAllocator;

/// Allocator that counts, with which runs measure the memory of their algorithms.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    svl::BUILD.hand_down();
    cli::Cli::main()
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;
    use svl::memory::used_by;

    #[test]
    fn memory_is_counted_at_its_peak_and_after() {
        // Far more than what the tests beside it allocate and free; none of it is touched.
        let mut kept = Vec::<u8>::new();
        let used = used_by(|| {
            let large = black_box(Vec::<u8>::with_capacity(2_000_000_000));
            kept = black_box(Vec::with_capacity(500_000_000));
            drop(large);
        });
        let used = used.unwrap();
        assert!(
            (2_300_000_000..2_700_000_000).contains(&used.peak),
            "{used:?}"
        );
        assert!((300_000_000..700_000_000).contains(&used.kept), "{used:?}");
        assert!(kept.is_empty());
    }
}
