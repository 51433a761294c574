//! Writes a few small files for each target to begin with, into `corpus/`. A target itself, because
//! what is compiled for fuzzing has to be linked with libFuzzer; run it with `-runs=0`.
#![no_main]

use image::{DynamicImage, ImageFormat};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use svl::calibrate::files::{self, FORMATS, Hints};
use svl::filter::{Features, FilterKind, FilterModel, ModelFacts, Network, Scaling};
use svl::{recording, stereo};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const CALIB: &str = "cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]
cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]
doffs=124.343
baseline=193.001
width=2964
height=2000
ndisp=280
";
const KITTI: &str = "P_rect_02: 7.2e+02 0 6.0e+02 4.4e+01 0 7.2e+02 1.7e+02 2.1e-01 0 0 1 2.7e-03
P_rect_03: 7.2e+02 0 6.0e+02 -3.3e+02 0 7.2e+02 1.7e+02 2.1e+00 0 0 1 2.7e-03
";
const OPENCV: &str = "%YAML:1.0
image_size: [ 640, 480 ]
length_unit: m
K1: !!opencv-matrix
   data: [ 530., 0., 340., 0., 531., 240., 0., 0., 1. ]
D1: [ -2.8e-01, 2.5e-02, 1.2e-03, 0., 1.6e-01 ]
K2: [ 535., 0., 330., 0., 536., 245., 0., 0., 1. ]
D2: [ -3.0e-01, 1.5e-01, 0., 0. ]
R: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: [ -0.1, 0., 0. ]
R1: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
R2: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
P1: [ 515., 0., 340., 0., 0., 515., 243., 0., 0., 0., 1., 0. ]
P2: [ 515., 0., 343., -51.5, 0., 515., 243., 0., 0., 0., 1., 0. ]
";
const SCENARIOS: [&str; 3] = [
    include_str!("../../scenarios/arena.toml"),
    include_str!("../../scenarios/middlebury.toml"),
    include_str!("../../scenarios/kitti2015.toml"),
];

libfuzzer_sys::fuzz_target!(init: write().expect("a folder to write to"), |_bytes: &[u8]| {});

/// A filter with windows of two pixels.
fn model() -> Result<FilterModel, Box<dyn std::error::Error>> {
    Ok(FilterModel {
        kind: FilterKind::TooClose,
        features: Features {
            window: 2,
            scaling: Scaling::Log,
        },
        network: Network::new(3, &[0.5; 6], vec![1.0; 2], vec![2.0; 2], -1.0)?,
        range_px: Some(80.0),
        facts: ModelFacts::new(),
    })
}

fn write() -> Result<(), Box<dyn std::error::Error>> {
    for (i, text) in SCENARIOS.iter().enumerate() {
        seed("scenario", &format!("{i}"), text.as_bytes())?;
    }
    seed("filter", "model", &model()?.to_bytes())?;
    seed(
        "filter",
        "labels",
        b"sequence,window,label,pair_hash\n1,3x2,other,99aa06d3014798d86001c324468d497f\n",
    )?;
    seed("calibration", "middlebury", CALIB.as_bytes())?;
    seed("calibration", "kitti", KITTI.as_bytes())?;
    calibrations()?;
    let grey = image::GrayImage::from_fn(9, 7, |x, y| image::Luma([(x * 20 + y) as u8]));
    let images = [
        ("grey", DynamicImage::from(grey.clone())),
        ("rgb", DynamicImage::from(grey.clone()).to_rgb8().into()),
        (
            "grey16",
            DynamicImage::from(grey.clone()).to_luma16().into(),
        ),
        ("rgba", DynamicImage::from(grey).to_rgba8().into()),
    ];
    for (name, image) in &images {
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Pnm] {
            let mut bytes = Cursor::new(Vec::new());
            // JPEG has neither 16 bits nor alpha.
            if image.write_to(&mut bytes, format).is_ok() {
                seed("image", &format!("{name}.{format:?}"), bytes.get_ref())?;
            }
        }
    }
    for (order, scale) in [("little", "-1.0"), ("big", "2.5")] {
        let values = [0.0f32, 1.5, f32::INFINITY, f32::NAN, -3.0, 1e9];
        let bytes = values.iter().flat_map(|v| {
            if order == "big" {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            }
        });
        let pfm: Vec<u8> = format!("Pf\n3 2\n{scale}\n").bytes().chain(bytes).collect();
        seed("pfm", order, &pfm)?;
    }
    npz()?;
    ros1()?;
    live()?;
    mcap()
}

/// A bag of two images and a cloud in a chunk, by each compression that has a writer.
fn ros1() -> Result<(), Box<dyn std::error::Error>> {
    let record = |fields: &[&[u8]], data: &[u8]| {
        let header: Vec<u8> = fields
            .iter()
            .flat_map(|field| [&(field.len() as u32).to_le_bytes()[..], field].concat())
            .collect();
        let lengths = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
        [&lengths[0], &header[..], &lengths[1], data].concat()
    };
    let mut chunk = Vec::new();
    for (id, topic, kind) in [
        (0, "/left/image_rect", "Image"),
        (1, "/right/image_rect", "Image"),
        (2, "/left/camera_info", "CameraInfo"),
        (3, "/right/camera_info", "CameraInfo"),
    ] {
        let (topic, kind) = (format!("topic={topic}"), format!("type=sensor_msgs/{kind}"));
        let inner = record(&[topic.as_bytes(), kind.as_bytes()], b"");
        let inner = &inner[4..inner.len() - 4];
        chunk.extend(record(
            &[&[b"conn=", &[id, 0, 0, 0][..]].concat(), b"op=\x07"],
            inner,
        ));
        let mut data = vec![
            9, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'c', b'a', b'm',
        ];
        let words = |data: &mut Vec<u8>, words: &[u32]| {
            words
                .iter()
                .for_each(|word| data.extend(word.to_le_bytes()));
        };
        words(&mut data, &[2, 4, 5]);
        if id < 2 {
            data.extend(b"mono8\0");
            words(&mut data, &[4, 8]);
            data.extend([10, 20, 30, 40, 50, 60, 70, 80]);
        } else {
            data.extend(b"plumb");
            words(&mut data, &[0]);
            let tx = -3.0 * f64::from(id - 2);
            let p = [3.0, 0.0, 2.0, tx, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
            let k = [3.0, 0.0, 2.0, 0.0, 3.0, 1.0, 0.0, 0.0, 1.0];
            let r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            let numbers = k.iter().chain(&r).chain(&p);
            numbers.for_each(|number: &f64| data.extend(number.to_le_bytes()));
            data.extend([0; 25]);
        }
        let time = [&b"time="[..], &[1, 0, 0, 0, 2, 0, 0, 0]].concat();
        chunk.extend(record(
            &[&[b"conn=", &[id, 0, 0, 0][..]].concat(), b"op=\x02", &time],
            &data,
        ));
    }
    let mut lz4 = lz4::EncoderBuilder::new().build(Vec::new())?;
    std::io::Write::write_all(&mut lz4, &chunk)?;
    for (name, packed) in [("none", chunk.clone()), ("lz4", lz4.finish().0)] {
        let compression = format!("compression={name}");
        let size = [b"size=", &(chunk.len() as u32).to_le_bytes()[..]].concat();
        let head = record(&[b"op=\x03", &[b"index_pos=", &[0; 8][..]].concat()], b"  ");
        let body = record(&[compression.as_bytes(), b"op=\x05", &size], &packed);
        seed(
            "ros1",
            name,
            &[b"#ROSBAG V2.0\n", &head[..], &body].concat(),
        )?;
    }
    Ok(())
}

/// One calibration in every format.
fn calibrations() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("a.yml");
    std::fs::write(&path, OPENCV)?;
    seed("calibration_files", "opencv-short", OPENCV.as_bytes())?;
    let calibration = files::read_with(&path, &Hints::default())?.calibration;
    for format in FORMATS.iter().filter(|format| format.is_written()) {
        let one = folder.path().join("b").display().to_string();
        let path = if format.pairs == [["left.yaml", "right.yaml"]] {
            format!("{one}l,{one}r")
        } else {
            one
        };
        files::write_as(path.as_ref(), format, &calibration, Path::to_owned)?;
        let texts = path
            .split(',')
            .map(std::fs::read)
            .collect::<Result<Vec<_>, _>>()?;
        seed("calibration_files", format.name, &texts.join(&0))?;
    }
    let euroc = "T_BS:\n  data: [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\ncamera_model: \
                 pinhole\nresolution: [752, 480]\nintrinsics: [458, 457, 367, \
                 248]\ndistortion_model: radial-tangential\ndistortion_coefficients: [-0.2, 0.07, \
                 0, 0]\n";
    seed(
        "calibration_files",
        "euroc",
        [euroc.replace("0.1", "0"), euroc.to_owned()]
            .join("\0")
            .as_bytes(),
    )?;
    seed(
        "calibration_files",
        "annex-e",
        include_bytes!("../../tests/lean/calibration_files/annex_e.xml"),
    )?;
    seed(
        "calibration_files",
        "kitti-raw",
        include_bytes!("../../tests/lean/calibration_files/kitti_raw.txt"),
    )?;
    Ok(())
}

/// Small recordings: svl's, with everything and compressed, and their messages one by one.
fn mcap() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("a.mcap");
    for (name, format) in [
        ("raw", recording::ImageFormat::Raw),
        ("png", recording::ImageFormat::Png),
    ] {
        let mut writer = recording::Writer::create(&path, &recording::Header::new("seed"), format)?;
        writer.attach(recording::SCENARIO, "application/toml", b"name = 'seed'")?;
        (0..3).try_for_each(|i| frame(i).and_then(|frame| writer.write(&frame)))?;
        writer.finish()?;
        let bytes = std::fs::read(&path)?;
        std::fs::remove_file(&path)?;
        seed("mcap", name, &bytes)?;
        let mut plain = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new()
            .compression(None)
            .calculate_chunk_crcs(false);
        let mut copy = options
            .calculate_data_section_crc(false)
            .create(&mut plain)?;
        let mut messages = Vec::new();
        for message in mcap::MessageStream::new(&bytes)? {
            let message = message?;
            copy.write(&message)?;
            let kind = svl_fuzz::KINDS
                .iter()
                .position(|kind| kind.0 == message.channel.topic);
            let length = (message.data.len() as u16).to_le_bytes();
            if let Some(kind) = kind {
                messages.extend([kind as u8, message.log_time as u8, length[0], length[1]]);
                messages.extend_from_slice(&message.data);
            }
        }
        copy.finish()?;
        drop(copy);
        seed("mcap", &format!("{name}-plain"), plain.get_ref())?;
        seed("messages", name, &messages)?;
    }
    for (kind, (_, schema, encoding)) in svl_fuzz::KINDS.iter().enumerate().take(12) {
        let data = foreign(schema, encoding);
        let length = (data.len() as u16).to_le_bytes();
        seed(
            "messages",
            &format!("kind{kind}"),
            &[&[kind as u8, 7, length[0], length[1]], &data[..]].concat(),
        )?;
    }
    // A pair of ROS images with its calibration.
    let pair = [0, 1, 9].map(|kind: usize| {
        let (_, schema, encoding) = svl_fuzz::KINDS[kind];
        let data = foreign(schema, encoding);
        [
            &[kind as u8, 7],
            &(data.len() as u16).to_le_bytes()[..],
            &data,
        ]
        .concat()
    });
    seed("messages", "ros-pair", &pair.concat())?;
    encodings()
}

/// Encodings of four by two pixels: the bytes of a row, and the number of rows with those of the
/// chroma.
const ENCODINGS: [(&str, u32, u32); 14] = [
    ("mono16", 8, 2),
    ("16UC1", 8, 2),
    ("bgra8", 16, 2),
    ("rgb16", 24, 2),
    ("bgra16", 32, 2),
    ("uyvy", 8, 2),
    ("yuyv", 8, 2),
    ("nv12", 4, 3),
    ("nv21", 4, 3),
    ("nv24", 4, 6),
    ("bayer_rggb8", 4, 2),
    ("bayer_grbg16", 8, 2),
    ("32FC1", 16, 2),
    ("64FC1", 32, 2),
];

/// For each encoding a pair with its calibration and a depth image; and compressed depths.
fn encodings() -> Result<(), Box<dyn std::error::Error>> {
    let message = |topic: &str, schema: &str, data: &[u8]| {
        let kind = svl_fuzz::KINDS
            .iter()
            .position(|kind| (kind.0, kind.1) == (topic, schema));
        let length = (data.len() as u16).to_le_bytes();
        let kind = kind.ok_or("no such topic")? as u8;
        Ok::<_, Box<dyn std::error::Error>>([&[kind, 7, length[0], length[1]], data].concat())
    };
    let (image, info) = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo");
    let calibration = message("/info", info, &foreign(info, "cdr"))?;
    for (encoding, step, rows) in ENCODINGS {
        let data = ros_image(encoding, step, rows);
        let image_message = |topic| message(topic, image, &data);
        let all = [
            calibration.clone(),
            image_message("/l")?,
            image_message("/r")?,
            image_message("/depth")?,
        ];
        seed("messages", encoding, &all.concat())?;
    }
    let codes = stereo::Plane::from_fn(4, 2, |x, y| (x * 900 * y) as u16)?;
    let samples = image::ImageBuffer::from_fn(4, 2, |x, y| image::Luma([(x * 900 * y) as u16]));
    let mut png = Cursor::new(Vec::new());
    DynamicImage::ImageLuma16(samples).write_to(&mut png, ImageFormat::Png)?;
    let behind_header = [&[0; 12], &png.get_ref()[..]].concat();
    let inverse = svl::files::InverseDepth { a: 1e4, b: -900.0 };
    let rvl = svl::files::encode_rvl(&codes, Some(inverse));
    let mono8 = ros_image("mono8", 4, 2);
    for (name, format, data) in [
        ("depth-png", "16UC1; compressedDepth png", &behind_header),
        ("depth-rvl", "16UC1; compressedDepth rvl", &rvl),
        ("depth-inverse", "32FC1; compressedDepth rvl", &rvl),
        ("depth-plain", "16UC1; png compressed ", png.get_ref()),
    ] {
        let mut cdr = header();
        string(&mut cdr, format);
        cdr.resize(cdr.len().next_multiple_of(4), 0);
        cdr.extend((data.len() as u32).to_le_bytes());
        cdr.extend(data);
        let image_message = |topic| message(topic, image, &mono8);
        let depth = message("/depth/ros", "sensor_msgs/msg/CompressedImage", &cdr)?;
        let all = [
            calibration.clone(),
            image_message("/l")?,
            image_message("/r")?,
            depth,
        ];
        seed("messages", name, &all.concat())?;
    }
    Ok(())
}

/// The encapsulation of little-endian CDR, and a header.
fn header() -> Vec<u8> {
    vec![
        0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0, b'c', b'a', b'm', 0,
    ]
}

fn string(cdr: &mut Vec<u8>, text: &str) {
    cdr.extend((text.len() as u32 + 1).to_le_bytes());
    cdr.extend(text.as_bytes());
    cdr.push(0);
}

/// A sensor_msgs/msg/Image of four by two pixels.
fn ros_image(encoding: &str, step: u32, rows: u32) -> Vec<u8> {
    let mut cdr = header();
    [2u32, 4]
        .iter()
        .for_each(|side| cdr.extend(side.to_le_bytes()));
    string(&mut cdr, encoding);
    // Little-endian.
    cdr.push(0);
    cdr.resize(cdr.len().next_multiple_of(4), 0);
    [step, step * rows]
        .iter()
        .for_each(|length| cdr.extend(length.to_le_bytes()));
    cdr.extend((0..step * rows).map(|i| (10 + 7 * i) as u8));
    cdr
}

/// Messages of live topics: pairs of each type of image, with their calibrations.
fn live() -> Result<(), Box<dyn std::error::Error>> {
    let compressed = "sensor_msgs/msg/CompressedImage";
    let info = "sensor_msgs/msg/CameraInfo";
    for (types, image) in [(0, "sensor_msgs/msg/Image"), (3, compressed)] {
        for rectified in [0, 4] {
            let messages = [(2, info), (3, info), (0, image), (1, image)].map(|(topic, schema)| {
                let data = foreign(schema, "cdr");
                let length = (data.len() as u16).to_le_bytes();
                [&[topic, 7, length[0], length[1]], &data[..]].concat()
            });
            let types = types | rectified;
            seed(
                "live",
                &types.to_string(),
                &[&[types, 4], &messages.concat()[..]].concat(),
            )?;
        }
    }
    Ok(())
}

/// One frame with all that svl writes.
fn frame(i: u64) -> svl::Result<stereo::Frame> {
    let image = |seed: usize| stereo::Gray::from_fn(6, 4, |x, y| (x * 40 + y * 9 + seed) as u8);
    Ok(stereo::Frame {
        floor: None,
        sequence: i,
        stamp_ns: 20 + i,
        name: Some("seed".to_owned()),
        pair: stereo::StereoPair::new(image(0)?, image(1)?)?,
        geometry: stereo::Geometry::Rectified(Some(stereo::Rig::new(
            328.0,
            (3.0, 2.0),
            0.044,
            0.0,
        )?)),
        pose: Some(stereo::Pose::translation(1.0, 2.0, 3.0)),
        base: None,
        truth: Some(stereo::Truth::exact(
            stereo::Plane::filled(6, 4, 2.5)?,
            None,
        )),
        color: None,
        exposure: stereo::Exposure::default(),
        maps: Vec::new(),
        recorded: None,
        calibration: None,
    })
}

/// The body of a message of another program: little-endian CDR, JSON, or for protobuf what comes to
/// the fuzzer's mind.
fn foreign(schema: &str, encoding: &str) -> Vec<u8> {
    let mut cdr = header();
    let mut word = |v: u32| cdr.extend(v.to_le_bytes());
    match (schema, encoding) {
        ("sensor_msgs/msg/Image", "cdr") => ros_image("mono8", 4, 2),
        ("sensor_msgs/msg/CompressedImage", "cdr") => {
            word(4);
            cdr.extend(b"png\0");
            let png = svl::files::encode_png(2, 2, &[1, 2, 3, 4]).unwrap_or_default();
            cdr.extend((png.len() as u32).to_le_bytes());
            [cdr, png].concat()
        }
        ("sensor_msgs/msg/CameraInfo", "cdr") => {
            [2, 4, 10].into_iter().for_each(&mut word);
            cdr.extend(b"plumb_bob\0\0\0");
            cdr.extend(1u32.to_le_bytes());
            cdr.resize(cdr.len().next_multiple_of(8) + 4, 0);
            (0..31).for_each(|i| cdr.extend(f64::from(i).to_le_bytes()));
            cdr
        }
        ("foxglove.CameraCalibration", "json") => {
            br#"{"D":[0.1],"R":[1,0,0,0,1,0,0,0,1],"P":[3,0,1,0,0,3,1,0,0,0,1,0]}"#.to_vec()
        }
        (_, "json") => br#"{"timestamp":{"sec":1,"nsec":2},"width":2,"height":1,
                "encoding":"mono8","step":2,"data":"ECA="}"#
            .to_vec(),
        _ => vec![0x2a, 5, b'm', b'o', b'n', b'o', b'8'],
    }
}

/// A stored archive of one array, as NumPy writes it.
fn npz() -> Result<(), Box<dyn std::error::Error>> {
    for (kind, order) in [("<f4", "False"), ("<f8", "False"), (">f4", "True")] {
        let bytes = kind[2..].parse::<usize>()? * 6;
        let mut header =
            format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': (2, 3), }}");
        while (header.len() + 11) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let length = (header.len() as u16).to_le_bytes();
        let array = [
            b"\x93NUMPY\x01\0",
            &length[..],
            header.as_bytes(),
            &vec![0x40; bytes],
        ]
        .concat();
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
            zip.start_file(
                "arr_0.npy",
                SimpleFileOptions::default().compression_method(method),
            )?;
            std::io::Write::write_all(&mut zip, &array)?;
            seed(
                "npz",
                &format!("{}{method}", &kind[1..]),
                zip.finish()?.get_ref(),
            )?;
        }
    }
    Ok(())
}

fn seed(target: &str, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/corpus")).join(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(name), bytes)
}
