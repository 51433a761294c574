//! The learned gaps of v5 as docs/v5.md describes them: pixel by pixel, sharing no code with the
//! matcher.

use super::v5::{Steps, V5};

/// Weights in the order of their file, and a map at half and at quarter size.
pub(crate) struct Gaps<'a> {
    pub(crate) weights: &'a [i32],
    pub(crate) v5: &'a V5,
    pub(crate) half: &'a Steps,
    pub(crate) quarter: &'a Steps,
}

/// Votes of a pixel: by bin, for none, and those that agree with its best.
struct Votes {
    bins: Vec<(i64, i64)>,
    none: i64,
    agreed: i64,
}

#[derive(Clone, Copy)]
struct Hypothesis {
    from: (usize, usize),
    bin: i64,
    distance: i64,
    barrier: i64,
    ends: i64,
    quality: [i64; 3],
}

fn log(x: i64) -> i64 {
    let exponent = i64::from(x.ilog2());
    16 * exponent + ((x << 4) >> exponent) - 16
}

fn signed_log(bins: i64) -> i64 {
    bins.signum() * (log(4 + bins.abs()) - 32)
}

/// The winners of a pixel by the sums of a map.
struct Winner<'a>(&'a Steps, usize);

impl Winner<'_> {
    fn sum(&self, (x, y): (usize, usize), d: usize) -> i64 {
        i64::from(self.0.sums[(y * self.0.size.0 + x) * self.1 + d])
    }

    fn least(&self, at: (usize, usize)) -> i64 {
        (0..self.1).map(|d| self.sum(at, d)).min().unwrap()
    }

    fn unique(&self, at: (usize, usize)) -> i64 {
        let best = (0..self.1).min_by_key(|&d| (self.sum(at, d), d)).unwrap();
        let others = (0..self.1).filter(|d| d.abs_diff(best) > 1);
        let second = others.map(|d| self.sum(at, d)).min().unwrap_or(255);
        let least = self.least(at);
        (64 * (second - least) / (least + 8)).min(127)
    }

    fn right(&self, (x, y): (usize, usize)) -> i64 {
        let within = (0..self.1).filter(|d| x + d < self.0.size.0);
        within
            .min_by_key(|&d| (self.sum((x + d, y), d), d))
            .unwrap() as i64
    }
}

impl Gaps<'_> {
    fn index(&self, (x, y): (usize, usize)) -> usize {
        y * self.half.size.0 + x
    }

    fn bin(&self, at: (usize, usize)) -> i64 {
        self.half.disparity[self.index(at)].into()
    }

    fn grey(&self, at: (usize, usize)) -> i64 {
        self.half.half[0][self.index(at)].into()
    }

    /// Pixels of the window that are in the image.
    fn window(&self, (x, y): (usize, usize), reach: usize) -> Vec<(usize, usize)> {
        let (w, h) = self.half.size;
        let rows = y.saturating_sub(reach)..h.min(y + reach + 1);
        let columns = x.saturating_sub(reach)..w.min(x + reach + 1);
        rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
            .collect()
    }

    fn seen_around(&self, at: (usize, usize), reach: usize) -> i64 {
        let around = self.window(at, reach);
        let seen = around.iter().filter(|at| self.half.seen[self.index(**at)]);
        seen.count() as i64
    }

    fn quality(&self, at: (usize, usize)) -> [i64; 3] {
        let unique = Winner(self.half, self.v5.nd()).unique(at);
        [
            self.seen_around(at, 2),
            unique,
            self.half.own[self.index(at)].into(),
        ]
    }

    /// The nearest seen pixel in a direction, and the next of another surface.
    fn nearest(&self, (x, y): (usize, usize), (dx, dy): (i64, i64)) -> [Option<Hypothesis>; 2] {
        let (w, h) = self.half.size;
        let (mut found, mut barrier, mut last): ([Option<Hypothesis>; 2], _, Option<i64>) =
            ([None; 2], 0, None);
        let mut at = (x, y);
        loop {
            let next = (at.0 as i64 + dx, at.1 as i64 + dy);
            if !(0..w as i64).contains(&next.0) || !(0..h as i64).contains(&next.1) {
                return found;
            }
            let next = (next.0 as usize, next.1 as usize);
            barrier = barrier.max((self.grey(next) - self.grey(at)).abs());
            at = next;
            if !self.half.seen[self.index(at)] {
                continue;
            }
            let bin = self.bin(at);
            let hypothesis = Hypothesis {
                from: at,
                bin,
                distance: (at.0.abs_diff(x) + at.1.abs_diff(y)) as i64,
                barrier,
                ends: 0,
                quality: self.quality(at),
            };
            match last {
                None => found[0] = Some(hypothesis),
                Some(last) if (bin - last).abs() > 16 => {
                    found[1] = Some(hypothesis);
                    return found;
                }
                Some(_) => {}
            }
            last = Some(bin);
        }
    }

    fn small(&self, (x, y): (usize, usize)) -> (usize, usize) {
        let (w, h) = self.quarter.size;
        ((x / 2).min(w - 1), (y / 2).min(h - 1))
    }

    fn hypotheses(&self, at: (usize, usize)) -> [Option<Hypothesis>; 12] {
        let mut all = [None; 12];
        let own = Hypothesis {
            from: at,
            bin: self.bin(at),
            distance: 0,
            barrier: 0,
            ends: 0,
            quality: self.quality(at),
        };
        all[0] = Some(own);
        for (i, direction) in [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().enumerate() {
            [all[1 + i], all[5 + i]] = self.nearest(at, direction);
        }
        for axis in 0..2 {
            if let [Some(a), Some(b)] = [all[1 + 2 * axis], all[2 + 2 * axis]] {
                let distance = a.distance + b.distance;
                let sum = a.bin * b.distance + b.bin * a.distance;
                let (p, q) = (a.quality, b.quality);
                all[9 + axis] = Some(Hypothesis {
                    from: a.from,
                    bin: (2 * sum + distance) / (2 * distance),
                    distance: a.distance.max(b.distance),
                    barrier: a.barrier.max(b.barrier),
                    ends: a.bin - b.bin,
                    quality: [p[0].min(q[0]), p[1].min(q[1]), p[2].max(q[2])],
                });
            }
        }
        let place = self.small(at);
        let small = place.1 * self.quarter.size.0 + place.0;
        let bin = 2 * i64::from(self.quarter.disparity[small]);
        let unique = Winner(self.quarter, self.v5.nd().div_ceil(2)).unique(place);
        let seen = 25 * i64::from(self.quarter.first_seen[small]);
        all[11] = Some(Hypothesis {
            bin: bin.min(16 * self.v5.nd() as i64 - 1),
            quality: [seen, unique, self.quarter.own[small].into()],
            ..own
        });
        all
    }

    /// Features of the hypotheses and of the pixel.
    fn features(
        &self,
        at: (usize, usize),
        hypotheses: &[Option<Hypothesis>; 12],
    ) -> ([[i64; 15]; 12], [i64; 17]) {
        let ((x, y), (w, h)) = (at, self.half.size);
        let (nd, small) = (self.v5.nd(), self.small(at));
        let (wide, narrow) = (Winner(self.half, nd), Winner(self.quarter, nd.div_ceil(2)));
        let bins = || hypotheses.iter().flatten().map(|hypothesis| hypothesis.bin);
        let (least, most) = (bins().min().unwrap(), bins().max().unwrap());
        let feature = |hypothesis: &Option<Hypothesis>| {
            let Some(hypothesis) = hypothesis else {
                return [0; 15];
            };
            let d = ((hypothesis.bin as usize + 8) / 16).min(nd - 1);
            let d_small = ((hypothesis.bin as usize + 16) / 32).min(nd.div_ceil(2) - 1);
            let out = x < d;
            let right = if out {
                0
            } else {
                signed_log(16 * wide.right((x - d, y)) - hypothesis.bin)
            };
            let agree = bins()
                .filter(|bin| (bin - hypothesis.bin).abs() <= 12)
                .count() as i64;
            let [seen, unique, own] = hypothesis.quality;
            [
                log(1 + hypothesis.distance),
                signed_log(hypothesis.bin - least),
                signed_log(most - hypothesis.bin),
                signed_log(hypothesis.bin - i64::from(self.half.filled[self.index(at)])),
                log(8 + hypothesis.barrier) - 48,
                log(8 + (self.grey(at) - self.grey(hypothesis.from)).abs()) - 48,
                2 * (wide.sum(at, d) - wide.least(at)),
                64 * i64::from(out),
                right,
                5 * seen / 2,
                2 * unique,
                85 * own / 16,
                85 * agree / 8,
                signed_log(hypothesis.ends),
                2 * (narrow.sum(small, d_small) - narrow.least(small)),
            ]
            .map(|feature| feature.clamp(-127, 127))
        };
        let steps = |dx: usize, dy: usize| -> i64 {
            let step = |(x, y): &(usize, usize)| {
                let before = (x.saturating_sub(dx), y.saturating_sub(dy));
                (self.grey((*x, *y)) - self.grey(before)).abs()
            };
            self.window(at, 2).iter().map(step).sum()
        };
        let ([seen, unique, own], pixel) = (self.quality(at), self.index(at));
        let quarter = hypotheses[11].unwrap();
        let small_pixel = small.1 * self.quarter.size.0 + small.0;
        let small_bin = 2 * i64::from(self.quarter.disparity[small_pixel]);
        let pixel = [
            64 * i64::from(self.half.seen[pixel]),
            64 * i64::from(self.half.consistent[pixel]),
            85 * own / 16,
            2 * unique,
            (128 * x / w) as i64 - 64,
            (128 * y / h) as i64 - 64,
            log(50 + steps(1, 0)) - log(50),
            log(50 + steps(0, 1)) - log(50),
            5 * seen / 2,
            73 * self.seen_around(at, 7) / 256,
            signed_log(most - least),
            85 * bins().count() as i64 / 8,
            wide.least(at),
            self.grey(at) / 8 - 64,
            2 * quarter.quality[1],
            64 * quarter.quality[0] / 25,
            signed_log(small_bin - self.bin(at)),
        ];
        let features = std::array::from_fn(|k| feature(&hypotheses[k]));
        (features, pixel.map(|feature| feature.clamp(-127, 127)))
    }

    fn votes(&self, at: (usize, usize)) -> Votes {
        if self.half.seen[self.index(at)] && self.seen_around(at, 2) >= 13 {
            return Votes {
                bins: vec![(self.bin(at), 64)],
                none: 0,
                agreed: 64,
            };
        }
        let hypotheses = self.hypotheses(at);
        let (features, pixel) = self.features(at, &hypotheses);
        let mut rest = self.weights;
        let mut tensor = |outputs: usize, inputs: usize| -> Vec<&[i32]> {
            let (tensor, others) = rest.split_at(outputs * inputs);
            rest = others;
            tensor.chunks(inputs).collect()
        };
        let dot = |row: &[i32], inputs: &[i64]| -> i64 {
            row.iter().zip(inputs).map(|(w, x)| i64::from(*w) * x).sum()
        };
        let activate = |sum: i64| ((sum + 128) >> 8).clamp(0, 1023);
        let (w, bias) = (tensor(16, 17), tensor(1, 16));
        let z: Vec<i64> = (0..16)
            .map(|i| activate(dot(w[i], &pixel) + i64::from(bias[0][i])))
            .collect();
        let (w, z_weights, bias) = (tensor(24, 15), tensor(24, 16), tensor(12, 24));
        let hidden = |k: usize| -> Vec<i64> {
            let sum = |i: usize| dot(w[i], &features[k]) + dot(z_weights[i], &z);
            (0..24)
                .map(|i| activate(sum(i) + i64::from(bias[k][i])))
                .collect()
        };
        let exist: Vec<usize> = (0..12).filter(|&k| hypotheses[k].is_some()).collect();
        let hidden: Vec<Vec<i64>> = exist.iter().map(|&k| hidden(k)).collect();
        let mean = |i: usize| hidden.iter().map(|activations| activations[i]).sum::<i64>() >> 3;
        let mean: Vec<i64> = (0..24).map(mean).collect();
        let (w, mean_weights, bias) = (tensor(16, 24), tensor(16, 24), tensor(1, 16));
        let choice = |hidden: &Vec<i64>| -> Vec<i64> {
            let sum = |i: usize| dot(w[i], hidden) + dot(mean_weights[i], &mean);
            (0..16)
                .map(|i| activate(sum(i) + i64::from(bias[0][i])))
                .collect()
        };
        let w = tensor(1, 16);
        let score = |hidden: &Vec<i64>| (dot(w[0], &choice(hidden)) + 32) >> 6;
        let mut scores: Vec<i64> = hidden.iter().map(score).collect();
        let (mean_weights, z_weights, bias) = (tensor(1, 24), tensor(1, 16), tensor(1, 1));
        let none = dot(mean_weights[0], &mean) + dot(z_weights[0], &z) + i64::from(bias[0][0]);
        scores.push((none + 32) >> 6);
        let most = *scores.iter().max().unwrap();
        let exp = |score: &i64| match most - score {
            below @ 0..2560 => (65_535.0 * (-below as f64 / 256.0).exp()).round() as i64,
            _ => 0,
        };
        let weights: Vec<i64> = scores.iter().map(exp).collect();
        let sum: i64 = weights.iter().sum();
        let mut votes: Vec<i64> = weights.iter().map(|w| (64 * w + sum / 2) / sum).collect();
        let none = votes.pop().unwrap();
        let bins = exist.iter().map(|&k| hypotheses[k].unwrap().bin);
        let bins: Vec<(i64, i64)> = bins.zip(votes).collect();
        let (best, _) = bins.iter().rev().max_by_key(|(_, votes)| *votes).unwrap();
        let agreed = bins.iter().filter(|(bin, _)| (bin - best).abs() <= 12);
        let agreed = agreed.map(|(_, votes)| votes).sum();
        Votes { bins, none, agreed }
    }

    /// Report, target and nine features of each cell; `None` without votes.
    pub(crate) fn evidence(
        &self,
        tolerance: &[(i32, i32)],
        (columns, rows): (usize, usize),
    ) -> Vec<Option<[i64; 11]>> {
        let ((w, h), n) = (self.half.size, tolerance.len());
        let plain = self.v5.evidence(self.half, tolerance, (columns, rows));
        let cell = |i: usize| {
            let (column, row) = (i % columns, i / columns);
            let xs = column * w / columns..(column + 1) * w / columns;
            let ys = row * h / rows..(row + 1) * h / rows;
            // The places of the lattice, or the last one before.
            let places = |range: std::ops::Range<usize>, step: usize| -> Vec<usize> {
                let all: Vec<_> = range.clone().filter(|i| i % step == 0).collect();
                if all.is_empty() {
                    vec![range.start / step * step]
                } else {
                    all
                }
            };
            let (xs, ys) = (places(xs, 2), places(ys, 4));
            let pixels = ys.iter().flat_map(|y| xs.iter().map(|x| (*x, *y)));
            let votes: Vec<Votes> = pixels.map(|at| self.votes(at)).collect();
            let (mut below, mut none, mut agreed) = (vec![0; n + 1], 0, 0);
            for pixel_votes in &votes {
                for (bin, votes) in &pixel_votes.bins {
                    below[*bin as usize + 1..]
                        .iter_mut()
                        .for_each(|sum| *sum += votes);
                }
                none += pixel_votes.none;
                agreed += pixel_votes.agreed;
            }
            let (rank, any) = (self.v5.rank, below[n]);
            let total = any + none;
            let within = |v: usize| {
                let (lo, hi) = tolerance[v];
                [lo, hi + 1].map(|bin| below[bin.clamp(0, n as i32) as usize])
            };
            let safe = |v: usize| {
                let [l, r] = within(v);
                let far = rank * total - 100 * l - 50 * none;
                far.min((100 - rank) * total - 100 * (any - r) - 50 * none)
            };
            let held = |v: usize| within(v)[1] - within(v)[0];
            let score = |v: usize| 4 * safe(v) + 100 * held(v);
            let target = (0..n).find(|v| 100 * below[v + 1] >= rank * any).unwrap() as i64;
            let best = (0..n).map(score).max().unwrap();
            let good = (0..n).filter(|&v| 10 * (best - score(v)) <= 4 * self.v5.slack * total);
            let report = good.min_by_key(|&v| ((v as i64 - target).abs(), -(v as i64)));
            let report = report.unwrap();
            let (lo, hi) = tolerance[report];
            let span = i64::from(hi - lo + 1);
            let [_, _, _, _, seen, _, cost, texture] = plain[i];
            Some([
                report as i64,
                target,
                (10 * safe(report)).div_euclid(total),
                1000 * held(report) / total,
                seen,
                1000 * (report as i64 - target).abs() / span,
                cost,
                texture,
                span,
                1000 * any / total,
                1000 * agreed / total,
            ])
        };
        (0..columns * rows).map(cell).collect()
    }
}
