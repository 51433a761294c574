//! After the first pairs of a size a handle allocates nothing, on any of its threads; and without
//! memory it returns an error.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::CString;
use std::sync::atomic::{AtomicUsize, Ordering};
use svl_c::{CImage, Options, Status, svl_close, svl_error, svl_match, svl_open};
use svl_core::matcher::MATCHERS;

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

/// Bytes from which an allocation is large: it grows with the image's pixels, not with its width.
const LARGE: usize = 256 << 10;
/// Large allocations until one is refused.
static LEFT: AtomicUsize = AtomicUsize::new(usize::MAX);

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        if layout.size() >= LARGE && LEFT.fetch_sub(1, Ordering::Relaxed) == 1 {
            LEFT.store(usize::MAX, Ordering::Relaxed);
            return std::ptr::null_mut();
        }
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIZE: (usize, usize) = (160, 120);
const CALIBRATION: &str = include_str!("stereo.yml");

fn error() -> String {
    // SAFETY: the text lives until the next call of this thread.
    let text = unsafe { std::ffi::CStr::from_ptr(svl_error()) };
    text.to_string_lossy().into_owned()
}

fn main() {
    nothing_is_allocated_after_the_first_pairs();
    println!("no allocation after the first pairs");
    lack_of_memory_is_an_error();
    println!("lack of memory is an error");
}

/// Each large allocation of a pair is refused in turn. One that cannot fail would abort.
fn lack_of_memory_is_an_error() {
    let size = (1000, 640);
    let at = |i: usize| (i * 37 + i / size.0 * (i % 13)) as u8;
    let pixels: Vec<u8> = (0..size.0 * size.1).map(at).collect();
    let image = CImage {
        pixels: pixels.as_ptr().cast(),
        width: size.0 as u32,
        height: size.1 as u32,
        stride: size.0,
        format: 0,
    };
    for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
        let algorithm = CString::new(spec.name).unwrap();
        let options = Options {
            algorithm: algorithm.as_ptr(),
            threads: 2,
            ..Options::default()
        };
        let mut handle = std::ptr::null_mut();
        // SAFETY: the strings outlive the call.
        if unsafe { svl_open(&options, &mut handle) } != Status::Ok {
            assert_eq!(spec.name, "exec", "{}", error());
            continue;
        }
        let mut refused = 0;
        loop {
            LEFT.store(refused + 1, Ordering::Relaxed);
            // SAFETY: the image has that size, and the handle is open.
            let status = unsafe { svl_match(handle, &image, &image, 0) };
            LEFT.store(usize::MAX, Ordering::Relaxed);
            if status == Status::Ok {
                break;
            }
            let error = error();
            assert_eq!(status, Status::Memory, "{}: {error}", spec.name);
            assert!(error.starts_with("no memory: at least "), "{error}");
            // SAFETY: as above.
            assert_eq!(unsafe { svl_match(handle, &image, &image, 0) }, Status::Ok);
            // SAFETY: the handle is open and not used again.
            unsafe { svl_close(handle) };
            // SAFETY: the strings outlive the call.
            assert_eq!(unsafe { svl_open(&options, &mut handle) }, Status::Ok);
            refused += 1;
        }
        assert!(refused >= 3, "{}: {refused}", spec.name);
        // SAFETY: the handle is open and not used again.
        unsafe { svl_close(handle) };
    }
}

fn nothing_is_allocated_after_the_first_pairs() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = folder.path().join("stereo.yml");
    std::fs::write(&calibration, CALIBRATION).unwrap();
    let calibration = CString::new(calibration.to_str().unwrap()).unwrap();
    let pixels = |shift: usize| -> Vec<u8> {
        let at = |i: usize| (i % SIZE.0 + shift) * 37 + i / SIZE.0 * ((i % SIZE.0 + shift) % 13);
        // In colour.
        (0..SIZE.0 * SIZE.1)
            .flat_map(|i| [at(i) as u8; 3])
            .collect()
    };
    let (left, right) = (pixels(0), pixels(4));
    for algorithm in [
        c"v3:max_disparity=32",
        c"v5:max_disparity=32",
        c"bm:max_disparity=32",
    ] {
        for calibration in [None, Some(&calibration)] {
            for threads in [1, 2] {
                let options = Options {
                    algorithm: algorithm.as_ptr(),
                    calibration: calibration.map_or(std::ptr::null(), |path| path.as_ptr()),
                    threads,
                    ..Options::default()
                };
                let mut handle = std::ptr::null_mut();
                // SAFETY: the strings outlive the call.
                let status = unsafe { svl_open(&options, &mut handle) };
                assert_eq!(status, Status::Ok, "{}", error());
                let matched = || {
                    let [left, right] = [&left, &right].map(|pixels| CImage {
                        pixels: pixels.as_ptr().cast(),
                        width: SIZE.0 as u32,
                        height: SIZE.1 as u32,
                        stride: 3 * SIZE.0,
                        format: 5,
                    });
                    // SAFETY: the images have that size, and the handle is open.
                    let status = unsafe { svl_match(handle, &left, &right, 0) };
                    assert_eq!(status, Status::Ok);
                };
                // Queues of the threads grow for some pairs.
                (0..50).for_each(|_| matched());
                let before = ALLOCATIONS.load(Ordering::Relaxed);
                (0..200).for_each(|_| matched());
                let allocations = ALLOCATIONS.load(Ordering::Relaxed) - before;
                assert_eq!(
                    allocations,
                    0,
                    "{algorithm:?}, rectified: {}, {threads} threads",
                    calibration.is_none()
                );
                // SAFETY: the handle is open and not used again.
                unsafe { svl_close(handle) };
            }
        }
    }
}
