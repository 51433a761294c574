//! Faults in the bytes of files.

use image::ImageError;
use svl_core::Error;
use svl_core::stereo::MAX_SIDE;
use zip::result::ZipError;
use zune_jpeg::errors::DecodeErrors;

/// Fault in a file of numbers.
#[derive(Debug, thiserror::Error)]
pub enum MapFault {
    #[error("{0}")]
    Malformed(&'static str),
    /// A property as the file has it, and as a map has it.
    #[error("{0}, expected {1}")]
    Unsupported(String, &'static str),
    #[error("the header has no '{0}'")]
    NoEntry(&'static str),
    #[error("the header is {0} bytes long, more than the {1} it may be")]
    Header(usize, usize),
    #[error("{0} in 1..={MAX_SIDE}")]
    Sides(&'static str),
    #[error("the scale is {0}, its sign should give the byte order")]
    Scale(f32),
    /// Width, height, the bytes that they need, and what is wrong with these.
    #[error("{0}x{1} needs {2} bytes{3}")]
    Bytes(usize, usize, usize, String),
    #[error("it is of {0}x{1}, at most {2} pixels expected")]
    Large(usize, usize, usize),
    /// Zeros and others of a run, and the pixels left for it.
    #[error("a run is of {0} and {1} pixels, {2} are left")]
    Run(usize, usize, usize),
    #[error("it has more than its {0}x{1} pixels")]
    Surplus(usize, usize),
    #[error(transparent)]
    Archive(#[from] ZipError),
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Other(#[from] Error),
}

/// Fault in the bytes of an image.
#[derive(Debug, thiserror::Error)]
pub enum ImageFault {
    #[error(
        "a HEIC, which svl does not read; `heif-convert IN OUT.png` converts it (Debian: \
         libheif-examples)"
    )]
    Heic,
    #[error("no JPEG, {0} bytes")]
    NoJpeg(usize),
    #[error("a JPEG that is cut off: it has no end marker, {0} bytes")]
    Cut(usize),
    #[error("a JPEG with more restarts than blocks")]
    Restarts,
    /// Width, height, and what is wrong with these.
    #[error("a JPEG of {0}x{1} pixels{2}")]
    Pixels(usize, usize, String),
    #[error("a JPEG whose data are broken or end early: {}", .0.to_string().trim_matches('"'))]
    Jpeg(#[from] DecodeErrors),
    /// Bytes of a buffer, and those that its image needs.
    #[error("{0} of {1} bytes")]
    Short(usize, usize),
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Other(#[from] Error),
}
