//! Properties of every matcher in the table.

use crate::common;
use crate::oracle::scenes::pool;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use svl_core::filter::{
    CellFilter, Features, FilterKind, FilterModel, ModelFacts, Network, Scaling,
};
use svl_core::kernel::Isa;
use svl_core::matcher::{
    Algorithm, MATCHERS, MatchOutput, Matcher, MatcherSpec, Parameters, Range, find,
};
use svl_core::rectify::Rectifier;
use svl_core::stereo::{
    Gray, GridShape, Intrinsics, LengthUnit, Reason, StereoCalibration, StereoPair,
};

/// Counts the allocations of each thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches one plain cell and
// never allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending may have no counter left; its allocations are not ours.
        let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
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

/// Allocations of this thread so far.
pub(crate) fn allocations() -> usize {
    ALLOCATIONS.get()
}

/// All matchers of images. The results and the memory of exec are those of its program;
/// `tests/lean/exec/` has its contract.
fn matchers() -> impl Iterator<Item = &'static MatcherSpec> {
    MATCHERS.iter().filter(|spec| spec.matches_images())
}

fn build(name: &str) -> Box<dyn Matcher> {
    name.parse::<Algorithm>().unwrap().build().unwrap()
}

/// A pair of noise, the right image moved by 3 pixels.
fn pair(width: usize, height: usize) -> StereoPair {
    let side = |shift: usize| {
        Gray::from_fn(width, height, |x, y| {
            ((x + shift) * 37 + y * 11 + ((x + shift) * (y + 3)) % 29 * 5) as u8
        })
        .unwrap()
    };
    StereoPair::new(side(0), side(3)).unwrap()
}

#[test]
fn sizes_from_one_pixel_up_fill_the_whole_map() {
    for spec in matchers() {
        let mut matcher = build(spec.name);
        let mut output = MatchOutput::new().unwrap();
        for size in [
            (1, 1),
            (1, 7),
            (2, 2),
            (7, 1),
            (8, 8),
            (9, 1),
            (10, 3),
            (33, 5),
            (128, 16),
            (3, 3),
        ] {
            common::compute(&mut *matcher, &pair(size.0, size.1), &mut output).unwrap();
            let map = &output.disparity;
            assert_eq!(map.size(), size, "{}", spec.name);
            for (d, why) in map.disparity().pixels().zip(map.why().pixels()) {
                assert_eq!(
                    d.is_finite(),
                    why == Reason::Valid,
                    "{} {size:?}",
                    spec.name
                );
            }
        }
    }
}

#[test]
fn results_repeat_whatever_was_matched_before() {
    let (small, large) = (pair(40, 8), pair(130, 20));
    for spec in matchers() {
        let mut matcher = build(spec.name);
        let mut result = |pair: &StereoPair| {
            let mut output = MatchOutput::new().unwrap();
            common::compute(&mut *matcher, pair, &mut output).unwrap();
            output.disparity
        };
        let first = result(&large);
        result(&small);
        assert!(first == result(&large), "{}", spec.name);
    }
}

#[test]
fn instruction_sets_and_threads_do_not_matter() {
    let pair = pair(150, 40);
    for spec in matchers() {
        let expected = pool(1)
            .install(|| common::run(spec.name, Isa::BASELINE, &pair))
            .hash();
        for isa in Isa::available() {
            for threads in [1, 2, 3, 8] {
                let got = pool(threads)
                    .install(|| common::run(spec.name, isa, &pair))
                    .hash();
                assert_eq!(got, expected, "{} {isa} {threads} threads", spec.name);
            }
        }
    }
}

#[test]
fn nothing_is_allocated_after_the_first_pair() {
    let pairs = [pair(150, 20), pair(150, 20)];
    for spec in matchers() {
        let count = pool(1).install(|| {
            let mut matcher = build(spec.name);
            let mut output = MatchOutput::new().unwrap();
            common::compute(&mut *matcher, &pairs[0], &mut output).unwrap();
            let before = allocations();
            for pair in &pairs {
                common::compute(&mut *matcher, pair, &mut output).unwrap();
            }
            allocations() - before
        });
        assert_eq!(count, 0, "{}", spec.name);
    }
}

/// A filter whose weights are all 0.
fn filter_model(kind: FilterKind, range_px: Option<f64>) -> Arc<FilterModel> {
    let features = Features {
        window: 64,
        scaling: Scaling::Log,
    };
    let weights = vec![0.0; 7 * features.count()];
    let network = Network::new(features.count(), &weights, vec![0.0; 7], vec![0.0; 7], 1.0);
    Arc::new(FilterModel {
        kind,
        features,
        network: network.unwrap(),
        range_px,
        facts: ModelFacts::new(),
    })
}

/// Nor do the filters allocate; their models are read once by the robot.
#[test]
fn nothing_is_allocated_to_look_at_a_second_image() {
    let model = filter_model(FilterKind::Floor, None);
    let pair = pair(160, 96);
    let mut filter = CellFilter::new(model, Isa::BASELINE);
    let shape = GridShape::default();
    assert_eq!(filter.look(pair.left(), shape).unwrap(), [true; 15]);
    let before = ALLOCATIONS.get();
    filter.look(pair.right(), shape).unwrap();
    assert_eq!(ALLOCATIONS.get() - before, 0);
}

#[test]
fn a_filter_for_a_larger_range_than_is_tried_is_refused() {
    let model = filter_model(FilterKind::TooClose, Some(80.0));
    let build = |text: &str| {
        let algorithm: Algorithm = text.parse().unwrap();
        algorithm.filtered(&[Arc::clone(&model)]).build().map(drop)
    };
    build("v3:max_disparity=80").unwrap();
    build("v3:max_disparity=96").unwrap();
    let error = build("v3:max_disparity=40").unwrap_err();
    let words = error.to_string();
    assert!(
        error.is_usage() && words.contains("its filter is for 80 px"),
        "{words}"
    );
}

/// Nor do the steps before a matcher allocate.
#[test]
fn nothing_is_allocated_to_rectify_a_second_pair() {
    let size = (150, 20);
    let camera = Intrinsics::new(
        size,
        (140.0, 140.0),
        (75.0, 10.0),
        [-0.1, 0.0, 0.0, 0.0, 0.0],
    )
    .unwrap();
    let apart = nalgebra::Isometry3::translation(-0.1, 0.001, 0.0);
    let calibration = StereoCalibration::new(camera, camera, apart, LengthUnit::Metres).unwrap();
    let rectifier = Rectifier::new(&calibration).unwrap();
    let pair = pair(size.0, size.1);
    let allocations = pool(1).install(|| {
        let [mut left, mut right] = [(); 2].map(|()| Gray::filled(1, 1, 0).unwrap());
        rectifier.apply(&pair, &mut left, &mut right).unwrap();
        let before = ALLOCATIONS.get();
        rectifier.apply(&pair, &mut left, &mut right).unwrap();
        ALLOCATIONS.get() - before
    });
    assert_eq!(allocations, 0);
}

#[test]
fn tables_are_sane() {
    for (i, spec) in MATCHERS.iter().enumerate() {
        for (j, name) in spec.names().enumerate() {
            let earlier = MATCHERS[..i]
                .iter()
                .flat_map(MatcherSpec::names)
                .chain(spec.names().take(j));
            assert!(
                earlier.into_iter().all(|other| other != name),
                "two are called {name}"
            );
            assert_eq!(find(name).unwrap().name, spec.name, "{name}");
        }
        assert!(
            !spec.summary.is_empty() && !spec.paper.is_empty(),
            "{}",
            spec.name
        );
        // No program is always installed, and no map always there.
        let built = (spec.build)(&Parameters::defaults(spec), Isa::BASELINE).is_ok();
        assert_eq!(
            built,
            !spec.is_program() && !spec.is_recorded(),
            "{}",
            spec.name
        );
        for (i, parameter) in spec.parameters.iter().enumerate() {
            let name = format!("{} {}", spec.name, parameter.name);
            assert!(
                spec.parameters[..i]
                    .iter()
                    .all(|other| other.name != parameter.name),
                "two are called {name}"
            );
            assert!(!parameter.description.is_empty(), "{name}");
            let default = match parameter.range {
                Range::Int { default, min, max } => (min..=max).contains(&default),
                Range::Real { default, min, max } => (min..=max).contains(&default),
                Range::Flag { .. } | Range::Text { .. } => true,
                Range::File | Range::Topic | Range::Pattern => true,
                Range::Choice { default, options } => options.contains(&default),
            };
            assert!(default, "{name}");
            let text = format!(
                "{}:{}={}",
                spec.name,
                parameter.name,
                parameter.range.default()
            );
            assert_eq!(
                text.parse::<Algorithm>().unwrap().parameters(),
                &Parameters::defaults(spec),
                "{name}"
            );
        }
    }
}

#[test]
fn a_contradiction_is_one_clear_line() {
    let error = |text: &str| match text
        .parse::<Algorithm>()
        .and_then(|algorithm| algorithm.build())
    {
        Ok(_) => panic!("{text} was accepted"),
        Err(error) => error.to_string(),
    };
    let upside_down = error("v3:min_disparity=9,max_disparity=3");
    assert!(
        upside_down.contains("min_disparity=9") && !upside_down.contains('\n'),
        "{upside_down}"
    );
    assert!(error("v3:max_disparity=5000").contains("-1024..=1024"));
    let share = error("v1:uniqueness=0.10");
    assert!(
        share.contains("uniqueness is per cent: write 10 for 0.1"),
        "{share}"
    );
    assert!(error("v1:uniqueness=0.07").contains("write 7 for 0.07"));
    assert!(error("v33").contains("'v3'"));
}
