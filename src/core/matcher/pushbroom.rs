//! Pushbroom stereo: block matching at one disparity, remembered along the robot's way.
//!
//! Barry and Tedrake, "Pushbroom Stereo for High-Speed Navigation in Cluttered Environments", ICRA
//! 2015. A robot that moves forward sweeps the plane of one disparity through the scene. Blocks
//! that match there are points of obstacles, and the robot's poses move them to where they are in
//! later pairs.
//!
//! The sum of absolute differences of two blocks is divided by the sum of their Laplacians, so that
//! plain blocks do not match. A block that also matches near the disparity of infinity repeats
//! along the row, like an edge of the horizon, and is dropped.
//!
//! Departures from the paper: points are kept in world coordinates for a number of pairs, not in a
//! state estimator's octree; near the edge of the image only the positions of the second search
//! that are inside count; blocks have 11 × 11 pixels by default, not 5 × 5, which was better in the
//! arena; the Laplacian is the absolute one of four neighbours; the second search does not ask
//! whether the right block is plain; cells of the depth grid are decided here, known from a few
//! blocks on.

use super::{
    MatchContext, MatchOutput, Matcher, MatcherSpec, PairMemory, Parameter, Parameters, Range,
};
use crate::depth::GridSettings;
use crate::error::Result;
use crate::stereo::{ExtraPlanes, Gray, Pose, Reason, RectifiedPair, Rig};
use crate::timing::Stage;
use nalgebra::Point3;
use std::collections::VecDeque;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "pushbroom",
    aliases: &[],
    summary: "block matching at one disparity, remembered by the poses of the pairs: a few \
              obstacle points, at a fraction of the time",
    about: "It needs poses to remember: the arena, drives and recordings with odometry have them. \
            Cells without obstacle points are unknown. A run that begins later, or takes every \
            N-th pair, remembers less.",
    paper: "Barry and Tedrake, Pushbroom Stereo for High-Speed Navigation in Cluttered \
            Environments, ICRA 2015",
    parameters: &[
        Parameter {
            name: "disparity",
            unit: "px",
            range: Range::int(22, 1..=511),
            description: "the one disparity that is compared",
        },
        Parameter {
            name: "block_size",
            unit: "px",
            range: Range::int(11, 3..=31),
            description: "side of the square blocks, which do not overlap",
        },
        Parameter {
            name: "interest",
            unit: "",
            range: Range::int(12, 0..=255),
            description: "least mean of a block's Laplacians, in each image",
        },
        Parameter {
            name: "threshold",
            unit: "%",
            range: Range::int(20, 1..=1000),
            description: "a match has a sum of absolute differences below this percentage of the \
                          sum of both blocks' Laplacians",
        },
        Parameter {
            name: "invariance",
            unit: "%",
            range: Range::int(50, 0..=1000),
            description: "threshold of the second search near infinity, which drops a match; 0 = \
                          not searched",
        },
        Parameter {
            name: "hits",
            unit: "blocks",
            range: Range::int(2, 1..=1000),
            description: "least area of matches in a known cell",
        },
        Parameter {
            name: "memory",
            unit: "pairs",
            range: Range::int(60, 0..=1000),
            description: "matches are remembered for this long, if the pairs have poses",
        },
    ],
    cells: None,
    build: |parameters, _| Ok(Box::new(Pushbroom::new(parameters))),
};

/// Offsets of the second search, pixels along the row and rows.
const NEAR_INFINITY: std::ops::RangeInclusive<i32> = -3..=3;
const ROWS: std::ops::RangeInclusive<i32> = -8..=8;
const ROW_STEP: usize = 2;

struct Pushbroom {
    disparity: i32,
    block: usize,
    interest: u32,
    threshold: u32,
    invariance: u32,
    hits: usize,
    keep: u64,
    memory: SeenPoints,
    scratch: Scratch,
}

/// Planes of the size of the pairs.
#[derive(Default)]
struct Scratch {
    laplacians: [Vec<u8>; 2],
    disparities: Vec<f32>,
    why: Vec<Reason>,
    /// Upper left corners of the blocks that match.
    matches: Vec<(usize, usize)>,
}

/// Points of obstacles in the world, in the order of the pairs in which they were seen.
#[derive(Default)]
struct SeenPoints {
    points: VecDeque<(u64, Point3<f64>)>,
    last: u64,
}

impl SeenPoints {
    /// Prepares for a pair: points that are too old are dropped, those of the same pair, which is
    /// matched once more, and all if the pair comes before the last one.
    fn begin(&mut self, sequence: u64, keep: u64) {
        if sequence < self.last {
            self.points.clear();
        }
        self.last = sequence;
        while let Some((of, _)) = self.points.front()
            && sequence - of > keep
        {
            self.points.pop_front();
        }
        while self.points.back().is_some_and(|(of, _)| *of == sequence) {
            self.points.pop_back();
        }
    }
}

/// A pair, to compare blocks of.
struct BlockPair<'a> {
    side: usize,
    images: [&'a Gray; 2],
    laplacians: [&'a [u8]; 2],
}

impl BlockPair<'_> {
    /// Sum of the Laplacians of a block of the left (0) or the right (1) image.
    fn interest(&self, image: usize, (x, y): (usize, usize)) -> u32 {
        let (width, plane) = (self.images[image].width(), self.laplacians[image]);
        let rows = (y..y + self.side).map(|y| &plane[y * width + x..][..self.side]);
        rows.map(|row| row.iter().map(|&v| u32::from(v)).sum::<u32>())
            .sum()
    }

    /// True if a block of the left image, of that interest, matches one of the right image, below a
    /// percentage.
    fn match_below(
        &self,
        percent: u32,
        (left, interest): ((usize, usize), u32),
        right: (usize, usize),
    ) -> bool {
        let rows = (0..self.side).map(|row| {
            let left = &self.images[0].row(left.1 + row)[left.0..][..self.side];
            let right = &self.images[1].row(right.1 + row)[right.0..][..self.side];
            let differences = left.iter().zip(right).map(|(a, b)| a.abs_diff(*b));
            differences.map(u32::from).sum::<u32>()
        });
        let sad = rows.sum::<u32>();
        100 * sad < percent * (interest + self.interest(1, right))
    }
}

impl Pushbroom {
    fn new(parameters: &Parameters) -> Self {
        Self {
            disparity: parameters.int("disparity"),
            block: parameters.int("block_size") as usize,
            interest: parameters.int("interest") as u32,
            threshold: parameters.int("threshold") as u32,
            invariance: parameters.int("invariance") as u32,
            hits: parameters.int("hits") as usize,
            keep: parameters.int("memory") as u64,
            memory: SeenPoints::default(),
            scratch: Scratch::default(),
        }
    }

    /// Finds the blocks of the left image that match. Each pixel gets a reason, or the disparity.
    fn search(&mut self, pair: &RectifiedPair<'_>, rig: Option<&Rig>) {
        let ((width, height), side) = (pair.size(), self.block);
        let Scratch {
            laplacians,
            disparities,
            why,
            matches,
        } = &mut self.scratch;
        matches.clear();
        disparities.clear();
        disparities.resize(width * height, f32::INFINITY);
        why.clear();
        why.resize(width * height, Reason::Border);
        let [left, right] = &*laplacians;
        let blocks = BlockPair {
            side,
            images: [pair.left(), pair.right()],
            laplacians: [left, right],
        };
        let infinity = -rig.map_or(0.0, Rig::doffs_px).round() as i32;
        let least = self.interest * (side * side) as u32;
        let shift = self.disparity as usize;
        for y in (0..height).step_by(side).take_while(|y| y + side <= height) {
            for x in (0..width).step_by(side).take_while(|x| x + side <= width) {
                if x < shift {
                    continue;
                }
                let (corner, matching) = ((x, y), (x - shift, y));
                let interest = blocks.interest(0, corner);
                let block = (corner, interest);
                let reason = if interest < least || blocks.interest(1, matching) < least {
                    Reason::Untextured
                } else if !blocks.match_below(self.threshold, block, matching) {
                    Reason::Unmatched
                } else if self.invariance > 0
                    && repeats(&blocks, self.invariance, block, infinity, (width, height))
                {
                    Reason::Ambiguous
                } else {
                    matches.push(corner);
                    Reason::Valid
                };
                for y in y..y + side {
                    let pixels = y * width + x..y * width + x + side;
                    why[pixels.clone()].fill(reason);
                    if reason == Reason::Valid {
                        disparities[pixels].fill(self.disparity as f32);
                    }
                }
            }
        }
    }

    /// Adds the remembered points to the map: squares that grow as they come nearer, the nearest in
    /// front.
    fn recall(&mut self, (width, height): (usize, usize), rig: &Rig, pose: &Pose) {
        let Scratch {
            disparities, why, ..
        } = &mut self.scratch;
        let (cx, cy) = rig.center_px();
        for (_, point) in &self.memory.points {
            let point = pose.inverse_transform_point(point);
            let disparity = rig.disparity_px(point.z);
            if point.z <= 0.0 || disparity <= 0.0 || disparity >= width as f64 {
                continue;
            }
            let half = 0.5 * self.block as f64 * disparity / f64::from(self.disparity);
            let range = |slope: f64, center: f64, size: usize| {
                let middle = rig.focal_px() * slope + center;
                let end = |at: f64| (at + 0.5).clamp(0.0, size as f64) as usize;
                end(middle - half)..end(middle + half)
            };
            let columns = range(point.x / point.z, cx, width);
            let disparity = disparity as f32;
            for y in range(point.y / point.z, cy, height) {
                for i in y * width + columns.start..y * width + columns.end {
                    if why[i] != Reason::Valid || disparities[i] < disparity {
                        (disparities[i], why[i]) = (disparity, Reason::Valid);
                    }
                }
            }
        }
    }

    /// Remembers the blocks that match.
    fn remember(&mut self, sequence: u64, rig: &Rig, pose: &Pose) {
        let Some(depth_m) = rig.depth_m(f64::from(self.disparity)) else {
            return;
        };
        let middle = 0.5 * (self.block - 1) as f64;
        for &(x, y) in &self.scratch.matches {
            let point = rig.point_m((x as f64 + middle, y as f64 + middle), depth_m);
            let point = pose.transform_point(&point.into());
            self.memory.points.push_back((sequence, point));
        }
    }
}

/// True if a block of the left image also matches near infinity, in rows above and below, too.
fn repeats(
    blocks: &BlockPair<'_>,
    percent: u32,
    block: ((usize, usize), u32),
    infinity: i32,
    (width, height): (usize, usize),
) -> bool {
    let inside = |at: usize, offset: i32, size: usize| {
        let at = at.checked_add_signed(offset as isize)?;
        (at + blocks.side <= size).then_some(at)
    };
    let (x, y) = block.0;
    let mut rows = ROWS.step_by(ROW_STEP).filter_map(|o| inside(y, o, height));
    rows.any(|v| {
        let mut columns = NEAR_INFINITY.filter_map(|o| inside(x, o - infinity, width));
        columns.any(|u| blocks.match_below(percent, block, (u, v)))
    })
}

impl Matcher for Pushbroom {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        for (image, plane) in [pair.left(), pair.right()]
            .into_iter()
            .zip(&mut self.scratch.laplacians)
        {
            laplacians(image, plane);
        }
        output.clock.lap(Stage::Texture);

        self.search(&pair, context.rig.as_ref());
        self.memory.begin(context.sequence, self.keep);
        if let (Some(rig), Some(pose)) = (&context.rig, &context.pose)
            && self.keep > 0
        {
            self.recall((width, height), rig, pose);
            self.remember(context.sequence, rig, pose);
        }
        let planes = self.scratch.disparities.chunks(width);
        for (mut row, (disparities, why)) in output
            .disparity
            .rows_mut()
            .zip(planes.zip(self.scratch.why.chunks(width)))
        {
            row.write(disparities, why);
        }
        output.clock.lap(Stage::Matching);

        let GridSettings { columns, rows, .. } = context.grid;
        let area = (self.hits * self.block * self.block) as f64;
        let settings = GridSettings {
            min_valid: area * (columns * rows) as f64 / (width * height) as f64,
            ..context.grid
        };
        output.decide(settings, context.rig.as_ref());
        output.clock.lap(Stage::Checks);
        Ok(())
    }

    fn memory(&self) -> PairMemory {
        match self.keep {
            0 => PairMemory::None,
            keep => PairMemory::Pairs(keep),
        }
    }

    fn reset(&mut self) {
        self.memory = SeenPoints::default();
    }

    fn needs_poses(&self) -> bool {
        self.keep > 0
    }
}

/// Absolute values of the Laplacian of four neighbours, at most 255; 0 along the edge.
fn laplacians(image: &Gray, plane: &mut Vec<u8>) {
    let (width, height) = image.size();
    plane.clear();
    plane.resize(width * height, 0);
    if width < 3 {
        return;
    }
    for y in 1..height.saturating_sub(1) {
        let [above, row, below] = [y - 1, y, y + 1].map(|y| image.row(y));
        let out = &mut plane[y * width + 1..][..width - 2];
        let neighbours = above[1..].iter().zip(&below[1..]);
        let along = row.iter().zip(&row[1..]).zip(&row[2..]);
        for ((out, (&up, &down)), ((&before, &center), &after)) in
            out.iter_mut().zip(neighbours).zip(along)
        {
            let [up, down, before, center, after] =
                [up, down, before, center, after].map(i16::from);
            let value = (4 * center - up - down - before - after).unsigned_abs();
            *out = value.min(255) as u8;
        }
    }
}
