//! Export the pairs of a recording (svl's own, a ROS bag, Foxglove's, RealSense's) as PNG files.
//!
//! `cargo run --release -p svl-recording --example export_pairs -- run.mcap folder`

use std::error::Error;
use std::path::Path;
use svl_files::write_png;
use svl_recording::Reader;

/// Returns the number of pairs.
fn export(recording: &Path, folder: &Path) -> Result<u64, Box<dyn Error>> {
    let mut reader = Reader::open(recording)?;
    let mut pairs = 0;
    while let Some(frame) = reader.next_pair()? {
        let (width, height) = frame.pair.size();
        for (side, image) in [("left", frame.pair.left()), ("right", frame.pair.right())] {
            let file = folder.join(format!("{:06}-{side}.png", frame.sequence));
            let pixels: Vec<u8> = image.pixels().collect();
            write_png(&file, width, height, &pixels)?;
        }
        pairs += 1;
    }
    for remark in reader.facts().remarks {
        eprintln!("{remark}");
    }
    Ok(pairs)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args_os().skip(1);
    let (Some(recording), Some(folder)) = (args.next(), args.next()) else {
        return Err("usage: export_pairs RECORDING FOLDER".into());
    };
    let pairs = export(recording.as_ref(), folder.as_ref())?;
    println!("{pairs} pairs");
    Ok(())
}
