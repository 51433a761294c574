//! How long a pair of 640x480 takes to rectify, by instruction set and threads.
//!
//! ```text
//! cargo bench --bench rectify
//! ```

use criterion::Criterion;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use svl::kernel::Isa;
use svl::rectify::Rectifier;
use svl::stereo::{Gray, Intrinsics, LengthUnit, StereoCalibration, StereoPair};

fn main() {
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads can be had");
        pool.install(|| {
            let mut criterion = Criterion::default().configure_from_args();
            Isa::available().for_each(|isa| bench(&mut criterion, isa, threads));
            criterion.final_summary();
        });
    }
}

fn bench(criterion: &mut Criterion, isa: Isa, threads: usize) {
    let rectifier = Rectifier::new(&calibration())
        .expect("cameras side by side")
        .on(isa);
    let (pair, (width, height)) = (pair(), rectifier.size());
    let [mut left, mut right] =
        [(); 2].map(|()| Gray::filled(width, height, 0).expect("the size of a pair"));
    criterion.bench_function(
        &format!("rectify 640x480/{isa}/{threads} threads"),
        |bencher| {
            bencher.iter(|| {
                rectifier
                    .apply(&pair, &mut left, &mut right)
                    .expect("of the calibration's size")
            });
        },
    );
}

/// A lens and a turn as cameras have them.
fn calibration() -> StereoCalibration {
    let camera = |f, cx| {
        Intrinsics::new(
            (640, 480),
            (f, f),
            (cx, 240.0),
            [-0.28, 0.07, 2e-4, 2e-5, 0.0],
        )
        .expect("a camera")
    };
    let turn = UnitQuaternion::from_euler_angles(0.014, -0.002, 0.002);
    let motion = Isometry3::from_parts(Translation3::new(-0.11, 0.0004, -0.0008), turn);
    StereoCalibration::new(
        camera(458.0, 320.0),
        camera(457.0, 325.0),
        motion,
        LengthUnit::Metres,
    )
    .expect("side by side")
}

fn pair() -> StereoPair {
    let texture =
        |x: usize, y: usize| ((x * 7919 + y * 104_729).wrapping_mul(0x9E37_79B9) >> 24) as u8;
    let image = || Gray::from_fn(640, 480, texture).expect("an image");
    StereoPair::new(image(), image()).expect("of one size")
}
