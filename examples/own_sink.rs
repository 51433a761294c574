//! A sink of your own behind two algorithms on the arena: `cargo run --release --example own_sink`.

use std::collections::BTreeMap;
use svl::arena::{Arena, ArenaConfig};
use svl::manifest::Manifest;
use svl::pass::{Matchers, Monitor, Pace, run};
use svl::score::{Judge, Judged, Verdict};
use svl::sink::{PassStart, Sink, finish};
use svl::source::ArenaSource;

#[derive(Default)]
struct WrongCells(BTreeMap<String, usize>);

impl Sink for WrongCells {
    fn take(&mut self, judged: &Judged) -> svl::Result<()> {
        for estimate in &judged.estimates {
            let cells = estimate.cells.iter().flatten();
            let wrong = cells.filter(|cell| cell.verdict == Verdict::Wrong).count();
            let label = &estimate.estimate.algorithm;
            *self.0.entry(label.clone()).or_default() += wrong;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> svl::Result<()> {
        println!("wrong cells: {:?}", self.0);
        Ok(())
    }
}

struct EightFrames;

impl Monitor for EightFrames {
    fn go_on(&mut self, done: u64) -> bool {
        done < 8
    }
}

pub fn main() -> svl::Result<()> {
    // Manifests then say which svl it is.
    svl::BUILD.hand_down();
    let algorithms = ["v3".parse()?, "bm".parse()?];
    let mut source = ArenaSource::new(Arena::new(&ArenaConfig::default(), 1)?, 1);
    let (manifest, judge) = (Manifest::new("arena", &algorithms)?, Judge::default());
    let start = PassStart::new(&manifest, Some(1), &judge);
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(WrongCells::default())];
    let (matchers, pace) = (&mut Matchers::new(&algorithms)?, Pace::Asap);
    let (_, ran) = run(
        &mut source,
        matchers,
        &start,
        pace,
        &mut sinks,
        &mut EightFrames,
    );
    ran.and(finish(sinks))
}
