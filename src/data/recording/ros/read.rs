//! Decodes ROS 2 messages from CDR.

use re_cdr::{CdrReader, Error, LittleEndian, Result};

/// Limit on distortion coefficients: `rational_polynomial` in ROS has up to 14.
const MAX_DISTORTION: usize = 14;

/// An uncompressed image in a message: sensor_msgs/msg/Image, or foxglove.RawImage.
pub(in crate::recording) struct RawPixels<'a> {
    pub(in crate::recording) width: u32,
    pub(in crate::recording) height: u32,
    /// Stride: bytes from one row to the next.
    pub(in crate::recording) step: u32,
    /// A name of sensor_msgs/image_encodings.hpp.
    pub(in crate::recording) encoding: &'a str,
    pub(in crate::recording) big_endian: bool,
    pub(in crate::recording) data: &'a [u8],
}

/// sensor_msgs/msg/CompressedImage.
pub(in crate::recording) struct RosCompressedImage<'a> {
    pub(in crate::recording) stamp: RosTime,
    pub(in crate::recording) format: &'a str,
    pub(in crate::recording) data: &'a [u8],
}

/// sensor_msgs/msg/CameraInfo. Size, K and P are those of the whole sensor.
pub(in crate::recording) struct CameraInfo {
    pub(in crate::recording) width: u32,
    pub(in crate::recording) height: u32,
    pub(in crate::recording) model: String,
    pub(in crate::recording) distortion: Vec<f64>,
    pub(in crate::recording) k: [f64; 9],
    pub(in crate::recording) r: [f64; 9],
    pub(in crate::recording) p: [f64; 12],
    /// Columns and rows of the sensor per pixel of the image; 0 means 1.
    pub(in crate::recording) binning: [u32; 2],
    pub(in crate::recording) roi: RegionOfInterest,
}

/// sensor_msgs/msg/RegionOfInterest: the part of the sensor in the image, before binning; a side of
/// 0 means all.
pub(in crate::recording) struct RegionOfInterest {
    pub(in crate::recording) x: u32,
    pub(in crate::recording) y: u32,
    pub(in crate::recording) height: u32,
    pub(in crate::recording) width: u32,
}

/// builtin_interfaces/msg/Time.
#[derive(Clone, Copy)]
pub(in crate::recording) struct RosTime {
    pub(in crate::recording) sec: i32,
    pub(in crate::recording) nanosec: u32,
}

/// Decodes the body of a message with `read`.
///
/// # Errors
/// The reason why it cannot be read.
pub(in crate::recording) fn read<'a, T>(
    data: &'a [u8],
    read: impl FnOnce(&mut CdrReader<'a, LittleEndian>) -> Result<T>,
) -> std::result::Result<T, String> {
    // The header's last two bytes are options, which XCDR 1 leaves unspecified.
    let body = match data {
        // Encapsulation 0x0001: little-endian CDR, the native order of x86 and ARM.
        [0, 1, _, _, body @ ..] => body,
        _ => return Err("it is not little-endian CDR".to_owned()),
    };
    read(&mut CdrReader::new(body)).map_err(|e| format!("its CDR cannot be read: {e}"))
}

/// The stamp and the pixels of a sensor_msgs/msg/Image.
pub(in crate::recording) fn image<'a>(
    cdr: &mut CdrReader<'a, LittleEndian>,
) -> Result<(RosTime, RawPixels<'a>)> {
    let stamp = header(cdr)?.stamp;
    let image = RawPixels {
        height: cdr.read_u32()?,
        width: cdr.read_u32()?,
        encoding: cdr.read_str()?,
        big_endian: cdr.read_u8()? != 0,
        step: cdr.read_u32()?,
        data: cdr.read_byte_sequence()?,
    };
    Ok((stamp, image))
}

pub(in crate::recording) fn compressed_image<'a>(
    cdr: &mut CdrReader<'a, LittleEndian>,
) -> Result<RosCompressedImage<'a>> {
    Ok(RosCompressedImage {
        stamp: header(cdr)?.stamp,
        format: cdr.read_str()?,
        data: cdr.read_byte_sequence()?,
    })
}

pub(in crate::recording) fn camera_info(
    cdr: &mut CdrReader<'_, LittleEndian>,
) -> Result<CameraInfo> {
    let (_stamp, height, width, model) = (
        header(cdr)?,
        cdr.read_u32()?,
        cdr.read_u32()?,
        cdr.read_str()?.to_owned(),
    );
    let coefficients = cdr.read_sequence_length()?;
    let coefficients = limited(coefficients, MAX_DISTORTION, "distortion coefficients")?;
    let distortion = (0..coefficients)
        .map(|_| cdr.read_f64())
        .collect::<Result<_>>()?;
    Ok(CameraInfo {
        width,
        height,
        model,
        distortion,
        k: floats(cdr)?,
        r: floats(cdr)?,
        p: floats(cdr)?,
        binning: [cdr.read_u32()?, cdr.read_u32()?],
        roi: RegionOfInterest {
            x: cdr.read_u32()?,
            y: cdr.read_u32()?,
            height: cdr.read_u32()?,
            width: cdr.read_u32()?,
        },
    })
}

/// std_msgs/msg/Header, the first field of most messages.
pub(in crate::recording) struct RosHeader<'a> {
    pub(in crate::recording) stamp: RosTime,
    pub(in crate::recording) frame_id: &'a str,
}

pub(in crate::recording) fn header<'a>(
    cdr: &mut CdrReader<'a, LittleEndian>,
) -> Result<RosHeader<'a>> {
    let stamp = RosTime {
        sec: cdr.read_i32()?,
        nanosec: cdr.read_u32()?,
    };
    let frame_id = cdr.read_str()?;
    Ok(RosHeader { stamp, frame_id })
}

/// sensor_msgs/msg/PointCloud2.
pub(in crate::recording) struct RosCloud<'a> {
    pub(in crate::recording) width: u32,
    pub(in crate::recording) height: u32,
    /// Name, offset in bytes and type of each field of a point.
    pub(in crate::recording) fields: Vec<(&'a str, u32, u8)>,
    pub(in crate::recording) big_endian: bool,
    /// Bytes of a point and of a row.
    pub(in crate::recording) point_step: u32,
    pub(in crate::recording) row_step: u32,
    pub(in crate::recording) data: &'a [u8],
}

/// sensor_msgs/msg/LaserScan: angles in radians, ranges in metres.
pub(in crate::recording) struct RosScan {
    pub(in crate::recording) angle_min: f64,
    pub(in crate::recording) angle_increment: f64,
    pub(in crate::recording) range_min: f64,
    pub(in crate::recording) range_max: f64,
    pub(in crate::recording) ranges: Vec<f64>,
}

/// Limit on fields of a point: lidars have ten.
const MAX_FIELDS: usize = 1000;

pub(in crate::recording) fn point_cloud<'a>(
    cdr: &mut CdrReader<'a, LittleEndian>,
) -> Result<RosCloud<'a>> {
    header(cdr)?;
    let (height, width) = (cdr.read_u32()?, cdr.read_u32()?);
    let count = limited(cdr.read_sequence_length()?, MAX_FIELDS, "fields of a point")?;
    let mut fields = Vec::with_capacity(count);
    for _ in 0..count {
        fields.push((cdr.read_str()?, cdr.read_u32()?, cdr.read_u8()?));
        let _count = cdr.read_u32()?;
    }
    Ok(RosCloud {
        width,
        height,
        fields,
        big_endian: cdr.read_u8()? != 0,
        point_step: cdr.read_u32()?,
        row_step: cdr.read_u32()?,
        data: cdr.read_byte_sequence()?,
    })
}

pub(in crate::recording) fn laser_scan(cdr: &mut CdrReader<'_, LittleEndian>) -> Result<RosScan> {
    header(cdr)?;
    let (angle_min, _angle_max) = (cdr.read_f32()?, cdr.read_f32()?);
    let angle_increment = cdr.read_f32()?;
    let (_time_increment, _scan_time) = (cdr.read_f32()?, cdr.read_f32()?);
    let (range_min, range_max) = (cdr.read_f32()?, cdr.read_f32()?);
    // At most as many as there are bytes for.
    let count = cdr.read_sequence_length()?;
    let count = limited(count, cdr.remaining() / size_of::<f32>(), "ranges")?;
    let ranges = (0..count).map(|_| cdr.read_f32().map(f64::from));
    Ok(RosScan {
        angle_min: angle_min.into(),
        angle_increment: angle_increment.into(),
        range_min: range_min.into(),
        range_max: range_max.into(),
        ranges: ranges.collect::<Result<_>>()?,
    })
}

/// A transform: parent and child frame, translation in metres, rotation as x, y, z, w.
pub(in crate::recording) type RosTransform = (String, String, [f64; 3], [f64; 4]);

/// Limit on transforms in a message.
const MAX_TRANSFORMS: usize = 10_000;

/// tf2_msgs/msg/TFMessage.
pub(in crate::recording) fn transforms(
    cdr: &mut CdrReader<'_, LittleEndian>,
) -> Result<Vec<RosTransform>> {
    let count = limited(cdr.read_sequence_length()?, MAX_TRANSFORMS, "transforms")?;
    let transform = |_| {
        let parent = header(cdr)?.frame_id.to_owned();
        let child = cdr.read_str()?.to_owned();
        Ok((parent, child, floats(cdr)?, floats(cdr)?))
    };
    (0..count).map(transform).collect()
}

/// Checks a count before memory is allocated for it.
fn limited(count: usize, limit: usize, what: &str) -> Result<usize> {
    if count > limit {
        return Err(Error::Custom(format!(
            "{count} {what}, at most {limit} expected"
        )));
    }
    Ok(count)
}

fn floats<const N: usize>(cdr: &mut CdrReader<'_, LittleEndian>) -> Result<[f64; N]> {
    let mut floats = [0.0; N];
    for float in &mut floats {
        *float = cdr.read_f64()?;
    }
    Ok(floats)
}
