//! sgm against its oracle on images of every kind, and its quality on real scenes.

use crate::common::cases;
use crate::oracle::scenes::pairs;
use crate::oracle::sgm::Sgm;
use crate::{common, contract};
use proptest::prelude::*;
use svl_core::kernel::Isa;

impl Sgm {
    fn text(&self) -> String {
        let Self {
            min,
            max,
            p1,
            p2,
            edge,
            uniqueness,
            symmetry_tolerance,
            median,
        } = self;
        format!(
            "sgm:min_disparity={min},max_disparity={max},p1={p1},p2={p2},edge={edge},\
             uniqueness={uniqueness},symmetry_tolerance={symmetry_tolerance},median={median},\
             speckle_size=0"
        )
    }
}

fn sizes() -> impl Strategy<Value = (usize, usize)> {
    prop_oneof![
        4 => (1usize..=40, 1usize..=12),
        1 => (60usize..=140, 1usize..=4),
        1 => (1usize..=6, 12usize..=40),
    ]
}

fn matchers() -> impl Strategy<Value = Sgm> {
    let ends = prop_oneof![4 => (-20i32..=20, 0i32..=70), 1 => (-160i32..=160, 0i32..=160)];
    let penalties =
        prop_oneof![3 => (0i32..=20, 0i32..=65), 1 => Just((85, 0)), 1 => Just((0, 85))];
    let edge = prop::sample::select(vec![1, 8, 256]);
    let checks = (
        prop::sample::select(vec![0, 5, 100]),
        -1i32..=2,
        any::<bool>(),
    );
    (ends, penalties, edge, checks).prop_map(|((min, span), (p1, more), edge, checks)| Sgm {
        min,
        max: min + span,
        p1,
        p2: p1 + more,
        edge,
        uniqueness: checks.0,
        symmetry_tolerance: checks.1,
        median: checks.2,
    })
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn equals_the_oracle(pair in pairs(sizes()), sgm in matchers()) {
        contract::equals(&sgm.text(), &sgm.compute(&pair), &pair)?;
    }
}

proptest! {
    #![proptest_config(cases(40))]

    #[test]
    fn threads_do_not_matter(pair in pairs((1usize..=330, 1usize..=60)), sgm in matchers()) {
        contract::threads_do_not_matter(&sgm.text(), &pair)?;
    }
}

#[test]
fn contradictions_are_one_clear_line() {
    let build = |text: &str| {
        text.parse::<svl_core::matcher::Algorithm>()
            .unwrap()
            .build()
    };
    let error = build("sgm:p1=20,p2=10")
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("p2=10") && error.contains("p1=20"),
        "{error}"
    );

    let grey = svl_core::stereo::Gray::filled(16_000, 1_000, 0).unwrap();
    let pair = svl_core::stereo::StereoPair::new(grey.clone(), grey).unwrap();
    let mut matcher = build("sgm:max_disparity=255").unwrap();
    let mut output = svl_core::matcher::MatchOutput::new().unwrap();
    let error = common::compute(&mut *matcher, &pair, &mut output)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("16000x1000") && error.contains("MiB"),
        "{error}"
    );
}

/// Fraction of wrong pixels, off by more than one, among the valid ones that are not occluded;
/// within 1.3 times the published values for semi-global matching on these scenes.
#[test]
fn as_good_as_published() {
    let Some(folder) = common::datasets() else {
        return;
    };
    for (scene, [left, right], truth, scale, published) in [
        (
            "tsukuba",
            ["im0.png", "im1.png"],
            "truedisp.pgm",
            16.0,
            0.0326,
        ),
        ("venus", ["im0.ppm", "im1.ppm"], "disp2.pgm", 8.0, 0.0100),
        ("teddy", ["im0.png", "im1.png"], "disp2.png", 4.0, 0.0602),
        ("cones", ["im0.png", "im1.png"], "disp2.png", 4.0, 0.0306),
    ] {
        let pair = common::pair(&folder.join(scene), left, right);
        let grey = |file: &str| {
            image::open(folder.join(scene).join(file))
                .unwrap()
                .to_luma8()
        };
        let (truth, visible) = (grey(truth), grey("mask_nonocc.png"));
        let map = common::run("sgm", Isa::available().next().unwrap(), &pair);
        let (mut seen, mut valid, mut wrong) = (0, 0, 0);
        for (d, (truth, visible)) in map
            .disparity()
            .pixels()
            .zip(truth.pixels().zip(visible.pixels()))
        {
            if visible.0[0] == 255 && truth.0[0] > 0 {
                seen += 1;
                valid += usize::from(d.is_finite());
                wrong +=
                    usize::from(d.is_finite() && (d - f32::from(truth.0[0]) / scale).abs() > 1.0);
            }
        }
        let (bad, coverage) = (wrong as f32 / valid as f32, valid as f32 / seen as f32);
        println!(
            "{scene}: bad1.0 {:.2} % of {:.1} %",
            100.0 * bad,
            100.0 * coverage
        );
        assert!(
            bad <= 1.3 * published,
            "{scene}: {bad} is more than 1.3 times {published}"
        );
        assert!(coverage > 0.85, "{scene}: {coverage}");
    }
}
