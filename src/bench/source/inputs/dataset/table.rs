//! Scenes of stereo data sets, as users have them on disk.
//!
//! [`DATASETS`] describes each data set completely: its page, its terms, and the names of its
//! files. A new data set is a new entry there.

use super::entry::{Dataset, FileNames, PairFiles, Seen, TruthFile};
use super::{eth3d, kitti, middlebury};

/// The data sets svl knows. Where a folder could be of several, the first is taken.
pub const DATASETS: &[Dataset] = &[
    middlebury::MIDDEVAL3,
    middlebury::MIDDLEBURY2021,
    middlebury::MIDDLEBURY2014,
    middlebury::MIDDLEBURY2006,
    middlebury::MIDDLEBURY2005,
    middlebury::MIDDLEBURY2003,
    middlebury::MIDDLEBURY2001,
    kitti::KITTI2015,
    kitti::KITTI2012,
    eth3d::ETH3D,
];

/// Names that no archive has but many users' folders.
const OTHERS: FileNames = FileNames {
    pairs: &[
        PairFiles::beside("left", "right"),
        PairFiles::beside("imL", "imR"),
    ],
    truths: &[
        TruthFile {
            name: "truedisp.pgm",
            form: middlebury::SIXTEENTHS,
            seen: Seen::Unknown,
        },
        TruthFile {
            name: "disp_occ.png",
            form: kitti::KITTI_PNG,
            seen: Seen::Alone("disp_noc.png"),
        },
    ],
    masks: &["mask_nonocc.png"],
};

/// All names svl knows, in the order in which they are looked for.
pub(super) fn files() -> impl Iterator<Item = &'static FileNames> {
    DATASETS.iter().map(|d| &d.files).chain([&OTHERS])
}
