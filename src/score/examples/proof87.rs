use std::path::Path;
use svl_core::stereo::*;
use svl_files as files;
use svl_score::judge::TrueCells;

pub const DATA: &str = "/work/shared/datasets";

pub fn frame(left: Gray, right: Gray, truth: Plane<f32>) -> Frame {
    let (w, h) = left.size();
    let rig = Rig::new(w as f64, (w as f64 / 2.0, h as f64 / 2.0), 0.1, 0.0).unwrap();
    Frame {
        truth: Some(Truth::exact(truth, None)),
        ..Frame::new(
            StereoPair::new(left, right).unwrap(),
            Geometry::Rectified(Some(rig)),
        )
    }
}

/// All single scenes and frames of folders.
pub fn scenes() -> Vec<(String, Frame)> {
    let mut out = Vec::new();
    let text = std::fs::read_to_string(format!("{DATA}/index.tsv")).unwrap();
    for line in text.lines().skip(1) {
        let f: Vec<_> = line.split('\t').collect();
        if f[3].is_empty() {
            continue;
        }
        let dir = Path::new(DATA).join(f[0]);
        let gt = dir.join(f[3]);
        let scale: f32 = f[4].parse().unwrap();
        let truth = if f[3].ends_with(".pfm") {
            files::read_pfm(&gt).unwrap()
        } else {
            files::read_disparity_steps(&gt, scale, f[5] == "none").unwrap()
        };
        let truth = truth.map(|d| if d.is_finite() { d } else { f32::INFINITY });
        let img = |n: &str| files::read_gray(&dir.join(n)).unwrap();
        out.push((f[0].to_owned(), frame(img(f[1]), img(f[2]), truth)));
    }
    for set in [
        "eth3d-s", "board-a", "board-b", "board-c", "board-d", "board-e",
    ] {
        let dir = Path::new(DATA).join(set);
        let mut names: Vec<_> = std::fs::read_dir(dir.join("disp"))
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        for (i, n) in names.iter().enumerate() {
            let truth =
                files::read_disparity_steps(&dir.join("disp").join(n), 256.0, false).unwrap();
            let img = |s: &str| files::read_gray(&dir.join(s).join(n)).unwrap();
            let mut fr = frame(img("left"), img("right"), truth);
            fr.stamp_ns = 1_000_000_000 + i as u64 * 2_000_000_000;
            out.push((format!("{set}/{n}"), fr));
        }
    }
    out
}

fn holes() {
    for (name, frame) in scenes() {
        for (c, r) in [(5, 3), (12, 8)] {
            let shape = GridShape {
                columns: c,
                rows: r,
            };
            for (rn, rule) in [
                ("m", CellRule::default()),
                ("px", CellRule::Disparity { tolerance_px: 2.0 }),
            ] {
                let cells = TrueCells::new(&frame, shape, rule).unwrap();
                for ((place, t), near) in cells.truths().zip(cells.near()) {
                    println!(
                        "{name}\t{c}\t{rn}\t{place:?}\t{:?}\t{:?}\t{:?}\t{:?}",
                        t.area, t.median, t.near, near
                    );
                }
            }
        }
    }
}

fn main() {
    match std::env::args().nth(1).as_deref() {
        Some("holes") => holes(),
        Some("places") => places(),
        Some("arena") => arena(),
        Some("crops") => crops(),
        _ => {}
    }
}

use svl_score::plausibility::PlaceWatch;

/// The depth of a camera t baselines to the right, by forward warping, holes filled on rows from the farther side.
fn aside(truth: &Plane<f32>, t: f32, fill: bool) -> Plane<f32> {
    let (w, h) = truth.size();
    let mut out = Plane::filled(w, h, f32::INFINITY).unwrap();
    for y in 0..h {
        for x in 0..w {
            let d = truth.get(x, y);
            if !d.is_finite() {
                continue;
            }
            let at = (x as f32 - t * d).round();
            if at < 0.0 || at >= w as f32 {
                continue;
            }
            let o = out.get(at as usize, y);
            if !o.is_finite() || o < d {
                out.set(at as usize, y, d);
            }
        }
        if fill {
            for x in 1..w {
                if !out.get(x, y).is_finite() && x + 1 < w {
                    let (a, b) = (out.get(x - 1, y), out.get(x + 1, y));
                    if a.is_finite() && b.is_finite() {
                        out.set(x, y, a.min(b));
                    }
                }
            }
        }
    }
    out
}

fn ask(name: &str, frames: impl Iterator<Item = Frame>, kind: &str) {
    let mut watch = PlaceWatch::default();
    let begin = std::time::Instant::now();
    let mut n = 0;
    let mut spent = 0.0;
    for f in frames {
        n += 1;
        let b = std::time::Instant::now();
        watch.take_in(&f);
        spent += b.elapsed().as_secs_f64();
    }
    let _ = begin;
    let best = [false, true].map(|m| watch.best(m));
    let compared = watch.compared();
    let said = watch.decide().map_or("-".to_owned(), |d| d.to_string());
    let s = |b: &Option<(String, f64)>| {
        b.as_ref()
            .map_or("-\t1".to_owned(), |(m, r)| format!("{m}\t{r:.3}"))
    };
    println!(
        "{kind}\t{name}\t{n}\t{compared}\t{}\t{}\t{:.2}ms\t{said}",
        s(&best[0]),
        s(&best[1]),
        spent * 1e3 / n as f64
    );
}

fn with_truth(f: &Frame, t: Plane<f32>) -> Frame {
    let mut f = f.clone();
    f.truth.as_mut().unwrap().disparity = t;
    f
}

fn noisy(g: &Gray, seed: u64, amount: f32, gain: f32) -> Gray {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (w, h) = g.size();
    let mut out = g.clone();
    for y in 0..h {
        for x in 0..w {
            let n: f32 = (0..4).map(|_| rng.f32() - 0.5).sum::<f32>() * 1.7 * amount;
            out.set(
                x,
                y,
                (f32::from(g.get(x, y)) * gain + n)
                    .round()
                    .clamp(0.0, 255.0) as u8,
            );
        }
    }
    out
}

fn crop<T: Copy>(p: &Plane<T>, x0: usize, y0: usize, w: usize, h: usize) -> Plane<T> {
    Plane::from_fn(w, h, |x, y| p.get(x0 + x, y0 + y)).unwrap()
}

fn places() {
    let all = scenes();
    let mut groups: std::collections::BTreeMap<String, Vec<Frame>> = Default::default();
    for (name, f) in &all {
        let set = name.split('/').next().unwrap().to_owned();
        if set.starts_with("board") || set == "eth3d-s" {
            groups.entry(set.clone()).or_default().push(f.clone());
        }
        if set.starts_with("board") {
            continue;
        }
        ask(name, std::iter::once(f.clone()), "sound");
        let truth = &f.truth.as_ref().unwrap().disparity;
        for (t, k) in [(1.0, "right"), (0.6, "0.6"), (-0.6, "-0.6"), (0.25, "0.25")] {
            ask(
                name,
                std::iter::once(with_truth(f, aside(truth, t, true))),
                k,
            );
        }
    }
    for (set, frames) in &groups {
        for gap_ms in [2000u64, 100, 33] {
            let stamped = || {
                frames.iter().enumerate().map(move |(i, f)| Frame {
                    stamp_ns: 1_000_000_000 + i as u64 * gap_ms * 1_000_000,
                    ..f.clone()
                })
            };
            ask(&format!("{set}@{gap_ms}"), stamped(), "sound");
            if gap_ms == 2000 {
                for (t, k) in [(1.0, "right"), (0.6, "0.6"), (-0.6, "-0.6")] {
                    ask(
                        set,
                        stamped().map(|f| {
                            let d = aside(&f.truth.as_ref().unwrap().disparity, t, true);
                            with_truth(&f, d)
                        }),
                        k,
                    );
                }
            } else {
                let fs: Vec<_> = stamped().collect();
                for late in [1usize, 2] {
                    ask(
                        &format!("{set}@{gap_ms}"),
                        (late..fs.len()).map(|i| {
                            with_truth(
                                &fs[i],
                                fs[i - late].truth.as_ref().unwrap().disparity.clone(),
                            )
                        }),
                        &format!("late{late}"),
                    );
                }
            }
        }
    }
}

fn arena() {
    use svl_sim::arena::{Arena, ArenaConfig};
    for seed in 1..=1u64 {
        let arena = Arena::new(&ArenaConfig::default(), seed).unwrap();
        let n = arena.frames();
        let frames: Vec<_> = (0..n).map(|i| arena.frame(i).unwrap()).collect();
        println!(
            "{n} frames {:?} gap {}",
            frames[0].pair.size(),
            frames[1].stamp_ns - frames[0].stamp_ns
        );
        ask(&format!("arena{seed}"), frames.iter().cloned(), "sound");
        ask(
            &format!("arena{seed} 8 pairs"),
            frames.iter().take(8).cloned(),
            "sound",
        );
        ask(
            &format!("arena{seed} stands"),
            std::iter::repeat(&frames[5])
                .take(40)
                .cloned()
                .enumerate()
                .map(|(i, f)| Frame {
                    stamp_ns: 1_000_000_000 + 100_000_000 * i as u64,
                    ..f
                }),
            "sound",
        );
        for late in [1usize, 2, 3, 4] {
            for sign in [1i64, -1] {
                let k = late as i64 * sign;
                let get = |i: i64| {
                    frames
                        .get(i as usize)
                        .map(|f| f.truth.as_ref().unwrap().disparity.clone())
                };
                ask(
                    &format!("arena{seed}"),
                    (0..n as i64).filter_map(|i| {
                        Some(with_truth(
                            &frames[i as usize],
                            get(i - k).filter(|_| i >= k)?,
                        ))
                    }),
                    &format!("late{k}"),
                );
                if late == 2 && sign == 1 {
                    ask(
                        &format!("arena{seed} 12 pairs"),
                        (20..32i64)
                            .filter_map(|i| Some(with_truth(&frames[i as usize], get(i - k)?))),
                        &format!("late{k}"),
                    );
                }
            }
        }
        for (t, k) in [(1.0, "right"), (0.6, "0.6"), (-0.6, "-0.6")] {
            ask(
                &format!("arena{seed}"),
                frames.iter().map(|f| {
                    let d = aside(&f.truth.as_ref().unwrap().disparity, t, true);
                    with_truth(f, d)
                }),
                k,
            );
        }
    }
}

fn crops() {
    let all = scenes();
    for (name, f) in &all {
        if ![
            "cones",
            "teddy",
            "middlebury2014q/Adirondack",
            "middlebury2014q/Motorcycle",
            "middlebury2014q/Piano",
            "middlebury2006/Art",
            "middlebury2006/Reindeer",
            "eth3d-s/0003.png",
        ]
        .contains(&name.as_str())
        {
            continue;
        }
        let truth = &f.truth.as_ref().unwrap().disparity;
        let (w, h) = f.pair.size();
        let (cw, ch) = (w / 2, h / 2);
        let n = 40i64;
        for (kind, speed) in [
            ("slow", 1i64),
            ("fast", 8),
            ("stopping", 4),
            ("night", 2),
            ("noise", 2),
            ("expo", 2),
            ("smooth", 2),
            ("third", 2),
            ("sparse", 3),
        ] {
            let at = |i: i64| {
                let i = if kind == "stopping" { i.min(20) } else { i };
                // Back and forth.
                let span = (w - cw) as i64;
                let p = (i * speed).rem_euclid(2 * span);
                let x = if p <= span { p } else { 2 * span - p };
                (x as usize).min(w - cw)
            };
            let make = |late: i64| (0..n).map(move |i| (i, i - late)).collect::<Vec<_>>();
            let frame_of = |(i, j): (i64, i64)| {
                let (x, y) = (at(i), (h - ch) / 2);
                let mut l = crop(f.pair.left(), x, y, cw, ch);
                let mut r = crop(f.pair.right(), x, y, cw, ch);
                let j = if kind == "third" {
                    j.div_euclid(3) * 3
                } else {
                    j
                };
                let mut t = crop(truth, at(j.max(-200)), y, cw, ch);
                match kind {
                    "night" => {
                        l = noisy(&l, i as u64, 3.0, 0.12);
                        r = noisy(&r, i as u64 + 999, 3.0, 0.12);
                    }
                    "noise" => {
                        l = noisy(&l, i as u64, 5.0, 1.0);
                        r = noisy(&r, i as u64 + 999, 5.0, 1.0);
                    }
                    "expo" => {
                        r = noisy(&r, i as u64, 1.0, 1.6);
                    }
                    "smooth" => {
                        let s = t.clone();
                        for y in 5..ch - 5 {
                            for x in 5..cw - 5 {
                                let mut a = 0.0;
                                let mut c = 0.0;
                                for dx in 0..11 {
                                    let v = s.get(x + dx - 5, y);
                                    if v.is_finite() {
                                        a += v;
                                        c += 1.0;
                                    }
                                }
                                if c > 0.0 {
                                    t.set(x, y, a / c);
                                }
                            }
                        }
                    }
                    "sparse" => {
                        t = Plane::from_fn(cw, ch, |x, y| {
                            if y % 3 == 0 {
                                t.get(x, y)
                            } else {
                                f32::INFINITY
                            }
                        })
                        .unwrap();
                    }
                    _ => {}
                }
                let mut fr = frame(l, r, t);
                if kind == "sparse" {
                    fr.truth.as_mut().unwrap().kind.density = MapDensity::Sparse;
                }
                fr.stamp_ns = 1_000_000_000 + i as u64 * 33_333_333;
                fr
            };
            ask(
                &format!("{name} {kind}"),
                make(0).into_iter().map(frame_of),
                "sound",
            );
            if ["slow", "fast", "noise", "night", "sparse"].contains(&kind) {
                for late in [1i64, 2, 4, 13] {
                    ask(
                        &format!("{name} {kind}"),
                        make(late).into_iter().map(frame_of),
                        &format!("late{late}"),
                    );
                }
            }
        }
    }
}
