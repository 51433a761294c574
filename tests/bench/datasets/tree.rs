//! Data sets of tiny images, laid out like their unpacked archives.

use image::{ImageBuffer, Luma, Rgb};
use std::path::{Path, PathBuf};
use svl::files::write_pfm;
use svl::source::dataset::Scene;
use svl::stereo::{Frame, Plane, Visibility};
use tempfile::TempDir;

/// Width of every scene.
pub const WIDTH: usize = 24;

/// Disparity of every known pixel.
pub const DISPARITY: f32 = 4.0;

/// Column whose disparity differs in the right truth: its pixels are occluded in it.
const HIDDEN: usize = 5;

pub struct Tree {
    folder: TempDir,
    /// Height of the images written from now on.
    pub height: usize,
}

impl Tree {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            height: 6,
        }
    }

    pub fn root(&self) -> &Path {
        self.folder.path()
    }

    fn path(&self, name: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    pub fn text(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn remove(&self, name: &str) {
        std::fs::remove_file(self.path(name)).unwrap();
    }

    /// A pair of colour images, or grey ones if the extension is `.pgm`.
    pub fn pair(&self, left: &str, right: &str) {
        for name in [left, right] {
            let (width, height) = (WIDTH as u32, self.height as u32);
            let path = self.path(name);
            if name.ends_with(".pgm") {
                ImageBuffer::from_pixel(width, height, Luma([90u8]))
                    .save(path)
                    .unwrap();
            } else {
                ImageBuffer::from_pixel(width, height, Rgb([90u8, 80, 70]))
                    .save(path)
                    .unwrap();
            }
        }
    }

    /// Left and right truth as 8-bit grey, values `scale` times the disparity; 0 in the upper left
    /// corner.
    pub fn scaled(&self, left: &str, right: &str, scale: f32) {
        for (name, other) in [(left, DISPARITY), (right, DISPARITY + 8.0)] {
            let value = |x: usize, y: usize| match (x, y) {
                (0, 0) => 0,
                (HIDDEN, _) => (other * scale) as u8,
                _ => (DISPARITY * scale) as u8,
            };
            let image = ImageBuffer::from_fn(WIDTH as u32, self.height as u32, |x, y| {
                Luma([value(x as usize, y as usize)])
            });
            image.save(self.path(name)).unwrap();
        }
    }

    /// Left and right truth as PFM, `+∞` in the upper left corner.
    pub fn pfm(&self, left: &str, right: &str) {
        for (name, other) in [(left, DISPARITY), (right, DISPARITY + 8.0)] {
            let plane = Plane::from_fn(WIDTH, self.height, |x, y| match (x, y) {
                (0, 0) => f32::INFINITY,
                (HIDDEN, _) => other,
                _ => DISPARITY,
            });
            write_pfm(&self.path(name), &plane.unwrap()).unwrap();
        }
    }

    /// KITTI's 16-bit truth: all pixels except the corner, and those that both cameras see.
    pub fn kitti(&self, all: &str, seen: &str) {
        for (name, hidden) in [(all, false), (seen, true)] {
            let code = (DISPARITY * 256.0) as u16;
            let image = ImageBuffer::from_fn(WIDTH as u32, self.height as u32, |x, y| {
                let gone = (x, y) == (0, 0) || hidden && occluded(x as usize);
                Luma([if gone { 0u16 } else { code }])
            });
            image.save(self.path(name)).unwrap();
        }
    }

    /// A mask in which both cameras see every pixel except the first column.
    pub fn mask(&self, name: &str) {
        let code = |x: u32| Luma([if x == 0 { 128u8 } else { 255 }]);
        ImageBuffer::from_fn(WIDTH as u32, self.height as u32, |x, _| code(x))
            .save(self.path(name))
            .unwrap();
    }

    /// The frames of the scenes that a scenario would name like this.
    pub fn frames(&self, names: &[&str]) -> svl::Result<Vec<Frame>> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let scenes = Scene::find_all(self.root(), &names)?;
        scenes
            .iter()
            .enumerate()
            .map(|(i, scene)| scene.read(i as u64))
            .collect()
    }

    /// The only frame.
    #[track_caller]
    pub fn frame(&self, name: &str) -> Frame {
        let mut frames = self.frames(&[name]).unwrap();
        assert_eq!(frames.len(), 1);
        frames.remove(0)
    }
}

/// True if the pixels of a column have no match in the right image.
fn occluded(x: usize) -> bool {
    x < DISPARITY as usize || x == HIDDEN + DISPARITY as usize
}

/// The truth is that written by [`Tree`], and the mask of visible pixels follows from both truths.
#[track_caller]
pub fn expect_truth(frame: &Frame, corner_unknown: bool) {
    let truth = frame.truth.as_ref().unwrap();
    let corner = if corner_unknown { f32::INFINITY } else { 0.0 };
    assert_eq!(
        (truth.disparity.get(0, 0), truth.disparity.get(20, 1)),
        (corner, DISPARITY)
    );
    let seen = |x| {
        if occluded(x) {
            Visibility::Occluded
        } else {
            Visibility::Visible
        }
    };
    let expected: Vec<_> = (0..WIDTH).map(seen).collect();
    assert_eq!(truth.visibility.as_ref().unwrap().row(1), expected);
}
