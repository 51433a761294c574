//! Matches one made-up pair N times on one thread, to count instructions
//! (`tests/aarch64/instructions.sh`).
//!
//! `cargo run --release --example match_repeatedly -- ALGORITHM N [WIDTH HEIGHT]`

use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::{Gray, RectifiedPair, StereoPair, hash_words};

/// A textured floor in front of a textured wall, with some noise.
fn pair(width: usize, height: usize) -> svl_core::Result<StereoPair> {
    let mixed = |x: usize, y: usize, salt: u32| {
        let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
        (mixed ^ salt).wrapping_mul(0xC2B2_AE35) >> 24
    };
    let texture = |x: usize, y: usize| 40 + mixed(x / 2, y / 2, 0) / 2 + mixed(x, y, 0) / 8;
    let disparity = |y: usize| 8 + (y.saturating_sub(height / 2)) * 80 / height;
    let left = Gray::from_fn(width, height, |x, y| texture(x, y) as u8)?;
    let right = Gray::from_fn(width, height, |x, y| {
        (texture(x + disparity(y), y) + mixed(x, y, 7) % 5) as u8
    })?;
    StereoPair::new(left, right)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<_> = std::env::args().collect();
    let [_, algorithm, repeats, size @ ..] = &arguments[..] else {
        return Err("expected: ALGORITHM N [WIDTH HEIGHT]".into());
    };
    let size: Vec<usize> = size.iter().map(|n| n.parse()).collect::<Result<_, _>>()?;
    let (width, height) = match size[..] {
        [] => (320, 240),
        [width, height] => (width, height),
        _ => return Err("expected: ALGORITHM N [WIDTH HEIGHT]".into()),
    };
    let pair = pair(width, height)?;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| {
        let mut matcher = algorithm.parse::<Algorithm>()?.build()?;
        let mut output = MatchOutput::new()?;
        for _ in 0..repeats.parse()? {
            output.begin();
            let context = MatchContext::default();
            matcher.compute(RectifiedPair::assume(&pair), &context, &mut output)?;
        }
        println!("{}", hash_words(output.disparity.hash()));
        Ok::<_, Box<dyn std::error::Error + Send + Sync>>(())
    })
    .map_err(|e| e as Box<dyn std::error::Error>)
}
