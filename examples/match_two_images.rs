//! Match two rectified images: disparities to a file, and what each cell of the grid sees.
//!
//! `cargo run --release --example match_two_images -- left.png right.png disparity.pfm`

use std::path::Path;
use svl::depth::{self, GridSettings};
use svl::files::{read_gray, write_disparity};
use svl::matcher::Algorithm;
use svl::stereo::{RectifiedPair, StereoPair};

pub fn match_images(left: &Path, right: &Path, output: &Path) -> svl::Result<()> {
    let pair = StereoPair::new(read_gray(left)?, read_gray(right)?)?;
    let v3: Algorithm = "v3:max_disparity=64".parse()?;
    // With a rig in place of `None`, cells have distances in metres.
    let matched = v3.match_pair(RectifiedPair::assume(&pair), None)?;
    write_disparity(output, &matched.disparity)?;
    let grid = depth::grid(matched.disparity.disparity(), GridSettings::default(), None);
    for ((column, row), cell) in grid.iter() {
        match &cell.depth {
            Some(depth) => println!("cell {column},{row}: {:.1} px", depth.median_px),
            None => println!("cell {column},{row}: unknown"),
        }
    }
    Ok(())
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = std::env::args().skip(1).collect::<Vec<_>>();
    let [left, right, output] = &arguments[..] else {
        return Err("usage: match_two_images LEFT RIGHT OUT.pfm".into());
    };
    Ok(match_images(
        left.as_ref(),
        right.as_ref(),
        output.as_ref(),
    )?)
}
