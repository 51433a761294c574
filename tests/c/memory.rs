//! After the first pairs of a size a handle allocates nothing, on any of its threads.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::CString;
use std::sync::atomic::{AtomicUsize, Ordering};
use svl_c::{Options, Status, svl_close, svl_error, svl_match, svl_open};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
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
const CALIBRATION: &str = "\
%YAML:1.0
length_unit: m
image_width: 160
image_height: 120
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [164., 0., 80., 0., 164., 60., 0., 0., 1.]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [-0.1, 0.01, 0., 0., 0.]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [164., 0., 80., 0., 164., 60., 0., 0., 1.]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [-0.1, 0.01, 0., 0., 0.]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [-0.044, 0., 0.]
";

fn error() -> String {
    // SAFETY: the text lives until the next call of this thread.
    let text = unsafe { std::ffi::CStr::from_ptr(svl_error()) };
    text.to_string_lossy().into_owned()
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = folder.path().join("stereo.yml");
    std::fs::write(&calibration, CALIBRATION).unwrap();
    let calibration = CString::new(calibration.to_str().unwrap()).unwrap();
    let pixels = |shift: usize| -> Vec<u8> {
        let at = |i: usize| (i % SIZE.0 + shift) * 37 + i / SIZE.0 * ((i % SIZE.0 + shift) % 13);
        (0..SIZE.0 * SIZE.1).map(|i| at(i) as u8).collect()
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
                    let (width, height) = (SIZE.0 as u32, SIZE.1 as u32);
                    // SAFETY: the images have that size, and the handle is open.
                    let status = unsafe {
                        svl_match(handle, left.as_ptr(), right.as_ptr(), width, height, 0, 0)
                    };
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
    println!("no allocation after the first pairs");
}
