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
    use svl::memory::used_by;

    #[test]
    fn memory_is_counted_at_its_peak_and_after() {
        let mut kept = Vec::new();
        let used = used_by(|| {
            let large = vec![1_u8; 200_000_000];
            kept = large[..50_000_000].to_vec();
        });
        let used = used.unwrap();
        // Other tests allocate and free meanwhile, but not as much.
        assert!((220_000_000..290_000_000).contains(&used.peak), "{used:?}");
        assert!((30_000_000..80_000_000).contains(&used.kept), "{used:?}");
        assert_eq!(kept.len(), 50_000_000);
    }
}
