//! The C interface: header, errors, examples in C and C++.

mod filters;

use std::ffi::{CStr, CString};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::ptr::{null, null_mut};
use std::sync::Arc;
use svl_c::{
    CCell, CImage, Handle, Options, Status, svl_cells, svl_close, svl_disparities, svl_error,
    svl_instruction_set, svl_match, svl_open, svl_reason_name, svl_reset, svl_version,
};
use svl_core::depth::{self, GridSettings};
use svl_core::filter::FilterKind;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::{Gray, Reason, RectifiedPair, Rig, StereoPair};

const SIZE: (usize, usize) = (320, 240);

fn texture(x: usize, y: usize) -> u8 {
    let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
    (mixed.wrapping_mul(0xC2B2_AE35) >> 24) as u8
}

/// A textured wall on the left, a plain one on the right.
fn pair() -> StereoPair {
    let side = |shift: usize| {
        let at = |x, y| if x < 200 { texture(x + shift, y) } else { 90 };
        Gray::from_fn(SIZE.0, SIZE.1, at).unwrap()
    };
    StereoPair::new(side(0), side(20)).unwrap()
}

fn open(options: &Options) -> (Status, *mut Handle) {
    let mut handle = null_mut();
    // SAFETY: the strings of the options outlive the call.
    let status = unsafe { svl_open(options, &mut handle) };
    (status, handle)
}

fn match_pair(handle: *mut Handle, pair: &StereoPair, stride: usize) -> Status {
    match_at(handle, pair, stride, 0)
}

fn match_at(handle: *mut Handle, pair: &StereoPair, stride: usize, stamp_ns: u64) -> Status {
    let (width, height) = pair.size();
    let [left, right] = [pair.left(), pair.right()].map(|image| {
        let mut pixels = vec![0; stride * height];
        for (y, row) in image.rows().enumerate() {
            pixels[y * stride..][..width].copy_from_slice(row);
        }
        pixels
    });
    let [left, right] = [&left, &right].map(|pixels| image(pixels, pair.size(), stride, 0));
    // SAFETY: the images have that size.
    unsafe { svl_match(handle, &left, &right, stamp_ns) }
}

fn image<T>(pixels: &[T], (width, height): (usize, usize), stride: usize, format: u32) -> CImage {
    CImage {
        pixels: pixels.as_ptr().cast(),
        width: width as u32,
        height: height as u32,
        stride,
        format,
    }
}

fn last_error() -> String {
    // SAFETY: the text lives until the next call of this thread.
    unsafe { CStr::from_ptr(svl_error()) }
        .to_str()
        .unwrap()
        .to_owned()
}

fn cells<'a>(handle: *mut Handle) -> Result<&'a [CCell], Status> {
    let (mut cells, mut columns, mut rows) = (null(), 0, 0);
    // SAFETY: the handle is open.
    match unsafe { svl_cells(handle, &mut cells, &mut columns, &mut rows) } {
        // SAFETY: the cells are valid until the next call.
        Status::Ok => Ok(unsafe { std::slice::from_raw_parts(cells, (columns * rows) as usize) }),
        failed => Err(failed),
    }
}

#[test]
fn earlier_pairs_count_until_a_reset() {
    let (status, handle) = open(&Options::default());
    assert_eq!(status, Status::Ok);
    let probabilities = |stamp_ns: u64| {
        assert_eq!(match_at(handle, &pair(), SIZE.0, stamp_ns), Status::Ok);
        let cells = cells(handle).unwrap().iter();
        cells
            .map(|cell| cell.probability.to_bits())
            .collect::<Vec<_>>()
    };
    const S: u64 = 1_000_000_000;
    let alone = probabilities(S);
    let followed = probabilities(S + S / 2);
    assert_ne!(alone, followed);
    assert_eq!(probabilities(S), alone, "a clock that jumps back");
    assert_eq!(probabilities(3 * S), alone, "later by more than a second");
    assert_eq!(probabilities(0), alone, "without a stamp after one with");
    assert_eq!(probabilities(0), followed, "in the order of the calls");
    // SAFETY: the handle is open.
    assert_eq!(unsafe { svl_reset(handle) }, Status::Ok);
    assert_eq!(probabilities(0), alone);
    // SAFETY: a null pointer is an error; the handle is closed once.
    unsafe {
        assert_eq!(svl_reset(null_mut()), Status::Invalid);
        svl_close(handle);
    }
}

#[test]
fn results_are_those_of_the_rust_library() {
    let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0).unwrap();
    for algorithm in ["v3:max_disparity=64", "v5:max_disparity=64"] {
        let text = CString::new(algorithm).unwrap();
        let options = Options {
            algorithm: text.as_ptr(),
            focal_px: 328.0,
            baseline_m: 0.044,
            cx_px: 160.0,
            cy_px: 120.0,
            ..Options::default()
        };
        let (status, handle) = open(&options);
        assert_eq!(status, Status::Ok, "{}", last_error());
        assert_eq!(cells(handle).unwrap_err(), Status::NoResult);
        assert_eq!(match_pair(handle, &pair(), SIZE.0 + 13), Status::Ok);
        let (mut output, context) = (
            MatchOutput::new().unwrap(),
            MatchContext {
                rig: Some(rig),
                ..MatchContext::default()
            },
        );
        let pair = pair();
        let mut matcher = algorithm.parse::<Algorithm>().unwrap().build().unwrap();
        matcher
            .compute(RectifiedPair::assume(&pair), &context, &mut output)
            .unwrap();
        let map = output.disparity.disparity();
        let medians = || depth::grid(map, GridSettings::default(), Some(&rig));
        let grid = output.grid.clone().unwrap_or_else(medians);
        let found = cells(handle).unwrap();
        assert_eq!(found.len(), 15);
        for ((_, expected), cell) in grid.iter().zip(found) {
            let depth = expected.depth.as_ref();
            assert_eq!(cell.state, u8::from(depth.is_some()));
            let distance = depth.map(|depth| depth.distance_m.map_or(f32::INFINITY, |m| m as f32));
            assert_eq!(cell.distance_m.is_nan(), distance.is_none());
            assert!(distance.is_none_or(|m| m == cell.distance_m));
            let probability = expected.probability.map(|p| p as f32);
            assert!(probability.is_none_or(|p| p == cell.probability));
            assert_eq!(cell.reason == Reason::Valid as u8, depth.is_some());
        }
        // The plain wall has no texture.
        assert_eq!(found[4].state, 0);
        if algorithm.starts_with("v3") {
            assert_eq!(found[4].reason, Reason::Untextured as u8);
        }
        let (mut disparities, mut reasons, mut width, mut height) = (null(), null(), 0, 0);
        // SAFETY: the handle is open; the planes have that size.
        let (disparities, reasons) = unsafe {
            let status = svl_disparities(
                handle,
                &mut disparities,
                &mut reasons,
                &mut width,
                &mut height,
            );
            assert_eq!(status, Status::Ok);
            let pixels = (width * height) as usize;
            (
                std::slice::from_raw_parts(disparities, pixels),
                std::slice::from_raw_parts(reasons, pixels),
            )
        };
        assert_eq!((width as usize, height as usize), SIZE);
        assert!(map.pixels().eq(disparities.iter().copied()));
        let codes = output.disparity.why().pixels().map(|why| why as u8);
        assert!(codes.eq(reasons.iter().copied()));
        // SAFETY: the handle is open and not used again.
        unsafe { svl_close(handle) };
    }
}

#[test]
fn filters_do_what_they_do_in_the_bench() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0).unwrap();
    for (algorithm, (model, path)) in [c"v3:max_disparity=64", c"v5:max_disparity=64"]
        .into_iter()
        .flat_map(|algorithm| filters::files(folder.path()).map(|filter| (algorithm, filter)))
    {
        let files = [path.as_ptr()];
        let options = Options {
            algorithm: algorithm.as_ptr(),
            filters: files.as_ptr(),
            filter_count: 1,
            focal_px: 328.0,
            baseline_m: 0.044,
            cx_px: 160.0,
            cy_px: 120.0,
            ..Options::default()
        };
        let (status, handle) = open(&options);
        assert_eq!(status, Status::Ok, "{}", last_error());
        assert_eq!(match_pair(handle, &pair(), SIZE.0), Status::Ok);
        let kind = model.kind;
        let expected: Algorithm = algorithm.to_str().unwrap().parse().unwrap();
        let mut matcher = expected.filtered(&[Arc::new(model)]).build().unwrap();
        let (pair, mut output) = (pair(), MatchOutput::new().unwrap());
        let context = MatchContext {
            rig: Some(rig),
            ..MatchContext::default()
        };
        matcher
            .compute(RectifiedPair::assume(&pair), &context, &mut output)
            .unwrap();
        let found = cells(handle).unwrap();
        for ((_, expected), cell) in output.grid.unwrap().iter().zip(found) {
            let state = match (expected.depth, expected.too_close) {
                (None, _) => 0,
                (Some(_), false) => 1,
                (Some(_), true) => 2,
            };
            assert_eq!(cell.state, state, "{algorithm:?} {kind}");
            let distance = expected.depth.and_then(|depth| depth.distance_m);
            assert!(distance.is_none_or(|m| m as f32 == cell.distance_m));
        }
        // The textured wall was known before.
        match kind {
            FilterKind::Floor => assert_eq!((found[0].state, found[0].reason), (0, 7)),
            FilterKind::TooClose => assert_eq!(found[0].state, 2),
        }
        // SAFETY: the handle is open and not used again.
        unsafe { svl_close(handle) };
    }
}

#[test]
fn version_and_instruction_set_are_named() {
    // SAFETY: the texts are static.
    let [version, isa] = [svl_version(), svl_instruction_set()]
        .map(|text| unsafe { CStr::from_ptr(text) }.to_str().unwrap());
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
    assert_eq!(isa, svl_core::kernel::isa().unwrap().name());
}

#[test]
fn reasons_have_the_names_of_the_rust_library() {
    for reason in Reason::ALL {
        // SAFETY: the text is static.
        let name = unsafe { CStr::from_ptr(svl_reason_name(reason as u8)) };
        assert_eq!(name.to_str().unwrap(), reason.name());
    }
}

#[test]
fn bad_input_is_a_code_and_a_line() {
    let cases: [(&str, Options, Status, &str); 9] = [
        (
            "v3",
            Options {
                threads: u32::MAX,
                ..Options::default()
            },
            Status::Invalid,
            "threads",
        ),
        (
            "v3",
            Options {
                filter_count: 1,
                ..Options::default()
            },
            Status::Invalid,
            "null pointer",
        ),
        ("v9", Options::default(), Status::Invalid, "v9"),
        ("exec", Options::default(), Status::Invalid, "exec"),
        ("truth", Options::default(), Status::Invalid, "truth"),
        (
            "v3",
            Options {
                calibration: c"no such file.yml".as_ptr(),
                ..Options::default()
            },
            Status::File,
            "no such file.yml",
        ),
        (
            "v3",
            Options {
                columns: 65,
                rows: 1,
                ..Options::default()
            },
            Status::Invalid,
            "65",
        ),
        (
            "v3",
            Options {
                baseline_m: 0.06,
                ..Options::default()
            },
            Status::Invalid,
            "without focal_px",
        ),
        (
            "v3",
            Options {
                focal_px: f64::NAN,
                ..Options::default()
            },
            Status::Invalid,
            "rig",
        ),
    ];
    for (algorithm, options, status, word) in cases {
        let text = CString::new(algorithm).unwrap();
        let options = Options {
            algorithm: text.as_ptr(),
            ..options
        };
        let (got, handle) = open(&options);
        assert_eq!(got, status, "{algorithm}");
        assert!(handle.is_null());
        let error = last_error();
        assert!(
            error.contains(word) && error.lines().count() == 1,
            "{error}"
        );
    }
    let (status, handle) = open(&Options::default());
    assert_eq!(status, Status::Ok);
    let pixels = [0u8; 8];
    let sized = |size, stride, format| image(&pixels, size, stride, format);
    let null_pixels = CImage {
        pixels: null(),
        ..sized((8, 1), 0, 0)
    };
    for (wrong, word) in [
        (null_pixels, "left image has a null pointer"),
        (sized((0, 0), 0, 0), "0x0"),
        (sized((99_999, 1), 0, 0), "99999x1"),
        (sized((8, 1), 4, 0), "stride 4"),
        (sized((8, 1), 0, 9), "format 9"),
        (
            sized((usize::MAX, usize::MAX), usize::MAX, 0),
            "impossible size",
        ),
        (sized((8, 1), 0, 0), "left image is 8x1, right image is 4x1"),
    ] {
        // SAFETY: nothing is read of a null pointer or a size that is refused.
        let status = unsafe { svl_match(handle, &wrong, &sized((4, 1), 0, 0), 0) };
        assert_eq!(status, Status::Invalid, "{word}");
        assert!(last_error().contains(word), "{}", last_error());
    }
    // SAFETY: a null pointer is an error.
    unsafe {
        let right = sized((8, 1), 0, 0);
        assert_eq!(svl_match(handle, null(), &right, 0), Status::Invalid);
        assert_eq!(svl_match(null_mut(), &right, &right, 0), Status::Invalid);
        assert_eq!(svl_open(null(), null_mut()), Status::Invalid);
    }
    // Nor does a failed pair leave the result of an earlier one.
    assert_eq!(match_pair(handle, &pair(), SIZE.0), Status::Ok);
    // SAFETY: as above.
    unsafe {
        let right = sized((8, 1), 0, 0);
        assert_eq!(svl_match(handle, &null_pixels, &right, 0), Status::Invalid);
        assert_eq!(cells(handle).unwrap_err(), Status::NoResult);
        svl_close(handle);
        svl_close(null_mut());
    }
}

#[test]
fn columns_and_rows_have_defaults_of_their_own() {
    for (columns, rows, count) in [(0, 0, 15), (8, 0, 24), (0, 1, 5)] {
        let (status, handle) = open(&Options {
            columns,
            rows,
            ..Options::default()
        });
        assert_eq!(status, Status::Ok, "{}", last_error());
        assert_eq!(match_pair(handle, &pair(), SIZE.0), Status::Ok);
        assert_eq!(cells(handle).unwrap().len(), count);
        // SAFETY: the handle is open and not used again.
        unsafe { svl_close(handle) };
    }
}

#[test]
fn options_of_another_header_are_known_by_their_size() {
    let (status, handle) = open(&Options {
        size: std::mem::offset_of!(Options, columns),
        // Behind that size: not read.
        columns: 65,
        ..Options::default()
    });
    assert_eq!(status, Status::Ok, "{}", last_error());
    // SAFETY: the handle is open and not used again.
    unsafe { svl_close(handle) };
    for (size, word) in [
        (0, "SVL_OPTIONS"),
        (12, "within a field"),
        (4096, "newer svl"),
    ] {
        let wrong = Options {
            size,
            ..Options::default()
        };
        assert_eq!(open(&wrong).0, Status::Invalid);
        assert!(last_error().contains(word), "{}", last_error());
    }
}

#[test]
fn every_format_of_an_image_gives_the_cells_of_its_grey() {
    let (status, handle) = open(&Options::default());
    assert_eq!(status, Status::Ok);
    let pair = pair();
    assert_eq!(match_pair(handle, &pair, SIZE.0), Status::Ok);
    let expected = format!("{:?}", cells(handle).unwrap());
    let grey = [pair.left(), pair.right()].map(|image| image.pixels().collect::<Vec<_>>());
    // A colour of equal channels has their value as its grey.
    let color = |n: usize| grey.each_ref().map(|image| repeated(image, n));
    let deep = |bits: u32| {
        grey.each_ref().map(|image| {
            let values = image.iter().map(|v| u16::from(*v) << (bits - 8));
            values.flat_map(u16::to_ne_bytes).collect::<Vec<_>>()
        })
    };
    for (format, bytes) in [
        (1, deep(10)),
        (2, deep(12)),
        (3, deep(14)),
        (4, deep(16)),
        (5, color(3)),
        (6, color(3)),
        (7, color(4)),
        (8, color(4)),
    ] {
        let [left, right] = bytes.each_ref().map(|bytes| image(bytes, SIZE, 0, format));
        // SAFETY: the handle is open, and the images have that size.
        unsafe {
            assert_eq!(svl_reset(handle), Status::Ok);
            assert_eq!(svl_match(handle, &left, &right, 0), Status::Ok, "{format}");
        }
        assert_eq!(
            format!("{:?}", cells(handle).unwrap()),
            expected,
            "{format}"
        );
    }
    // SAFETY: the handle is open and not used again.
    unsafe { svl_close(handle) };
}

fn repeated(pixels: &[u8], n: usize) -> Vec<u8> {
    pixels
        .iter()
        .flat_map(|v| std::iter::repeat_n(*v, n))
        .collect()
}

#[test]
fn a_calibration_from_memory_is_that_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stereo.yml");
    let text = include_str!("stereo.yml");
    std::fs::write(&file, text).unwrap();
    let (path, text) = (
        CString::new(file.to_str().unwrap()).unwrap(),
        CString::new(text).unwrap(),
    );
    let texts = [text.as_ptr()];
    let size = (160, 120);
    let pixels = repeated(&(0..=255).collect::<Vec<u8>>(), 75);
    let found = [
        Options {
            calibration: path.as_ptr(),
            ..Options::default()
        },
        Options {
            calibration_texts: texts.as_ptr(),
            calibration_text_count: 1,
            ..Options::default()
        },
    ]
    .map(|options| {
        let (status, handle) = open(&options);
        assert_eq!(status, Status::Ok, "{}", last_error());
        let image = image(&pixels, size, 0, 0);
        // SAFETY: the handle is open and not used again; the images have that size.
        unsafe {
            assert_eq!(svl_match(handle, &image, &image, 0), Status::Ok);
            let found = format!("{:?}", cells(handle).unwrap());
            svl_close(handle);
            found
        }
    });
    assert_eq!(found[0], found[1]);
    let refused = [
        (
            vec![c"f: 3"],
            Status::File,
            "calibration: is not a calibration",
        ),
        (vec![&*text; 3], Status::Invalid, "3 of them"),
    ];
    for (texts, status, word) in refused {
        let texts: Vec<_> = texts.iter().map(|text| text.as_ptr()).collect();
        let options = Options {
            calibration_texts: texts.as_ptr(),
            calibration_text_count: texts.len(),
            ..Options::default()
        };
        assert_eq!(open(&options).0, status, "{word}");
        assert!(last_error().contains(word), "{}", last_error());
    }
}

/// Installs the C library as the documents say, in the profile of this test.
fn install(prefix: &Path) {
    let here = std::env::current_exe().unwrap();
    let folder = here.ancestors().nth(2).unwrap();
    let profile = folder.file_name().unwrap().to_str().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/install.sh");
    let installed = Command::new(script)
        .arg(prefix)
        .args(["--profile", profile, "--target-dir"])
        .arg(folder.parent().unwrap())
        .status();
    assert!(installed.unwrap().success());
}

/// The text that a command prints; none, with a note, where it is not installed.
fn output(command: &mut Command) -> Option<String> {
    let Ok(output) = command.output() else {
        println!("skipped: no {}", command.get_program().display());
        return None;
    };
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {errors}");
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Compiles an example; false without that compiler or pkg-config.
fn compiled(compiler: &str, standard: &str, source: &str, prefix: &Path, linked: &str) -> bool {
    let mut found = Command::new("pkg-config");
    found
        .env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig"))
        .args(["--cflags", "--libs", "svl"])
        .args((linked == "static").then_some("--static"));
    let Some(flags) = output(&mut found) else {
        return false;
    };
    // Without it the linker prefers the shared library.
    let archive = prefix.join("lib/libsvl.a").display().to_string();
    let library = |flag| match flag {
        "-lsvl" if linked == "static" => archive.clone(),
        flag => flag.to_owned(),
    };
    let mut command = Command::new(compiler);
    command
        .args([standard, "-pedantic", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(prefix.join(source).with_extension(linked))
        .arg(examples().join(source))
        .args(flags.split_whitespace().map(library));
    output(&mut command).is_some()
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

/// The output of the robot of docs/library.md, in every language.
const STOPS: [&str; 6] = [
    "nearest 1.43 m: go on",
    "nearest 1.30 m: go on",
    "nearest 1.10 m: go on",
    "nearest 0.89 m: go on",
    "nearest 0.68 m: go on",
    "nearest 0.50 m: stop",
];

#[test]
fn the_examples_run() {
    let temporary = tempfile::tempdir().unwrap();
    let prefix = temporary.path();
    install(prefix);
    if compiled("cc", "-std=c99", "stop.c", prefix, "static") {
        stops(&mut Command::new(prefix.join("stop.static")));
    }
    if compiled("cc", "-std=c99", "stop.c", prefix, "shared") {
        stops(Command::new(prefix.join("stop.shared")).env("LD_LIBRARY_PATH", prefix.join("lib")));
    }
    if compiled("c++", "-std=c++11", "stop.cpp", prefix, "shared") {
        stops(Command::new(prefix.join("stop.shared")).env("LD_LIBRARY_PATH", prefix.join("lib")));
    }
}

fn stops(program: &mut Command) {
    assert_eq!(output(program).unwrap().lines().collect::<Vec<_>>(), STOPS);
}

#[test]
fn cmake_finds_the_installed_library() {
    let temporary = tempfile::tempdir().unwrap();
    install(&temporary.path().join("first"));
    // The folder can be moved.
    let prefix = temporary.path().join("moved");
    std::fs::rename(temporary.path().join("first"), &prefix).unwrap();
    let project = |version: &str| {
        let source = examples().join("stop.cpp").display().to_string();
        format!(
            "cmake_minimum_required(VERSION 3.16)\nproject(robot CXX)\n\
             find_package(svl {version} REQUIRED)\n\
             add_executable(shared {source})\ntarget_link_libraries(shared svl::svl)\n\
             add_executable(static {source})\ntarget_link_libraries(static svl::static)\n"
        )
    };
    let file = temporary.path().join("CMakeLists.txt");
    let build = temporary.path().join("build");
    let configure = || {
        let mut command = Command::new("cmake");
        command
            .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display()))
            .arg("-S")
            .arg(temporary.path())
            .arg("-B")
            .arg(&build);
        command
    };
    let version = env!("CARGO_PKG_VERSION");
    std::fs::write(&file, project(version.rsplit_once('.').unwrap().0)).unwrap();
    if output(&mut configure()).is_none() {
        return;
    }
    output(Command::new("cmake").arg("--build").arg(&build)).unwrap();
    for program in ["shared", "static"] {
        stops(&mut Command::new(build.join(program)));
    }
    std::fs::write(&file, project("99")).unwrap();
    let refused = configure().output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("svl-config.cmake, version: 0"));
}
