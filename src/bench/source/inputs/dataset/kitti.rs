//! KITTI's stereo benchmarks of 2012 and 2015, and the names in plain folders that are not a
//! published data set.

use super::entry::{CalibFile, Dataset, FileNames, Form, PairFiles, Seen, TruthFile};

const LICENCE: &str = "CC BY-NC-SA 3.0";

/// 16-bit PNG.
pub(crate) const KITTI_PNG: Form = Form::Points { scale: 256.0 };

/// Cameras 0 and 1 are grey, 2 and 3 coloured; the truth is that of camera 0. Of each scene only
/// the pair `_10` has truth.
pub(crate) const KITTI2012: Dataset = Dataset {
    name: "kitti2012",
    title: "KITTI stereo 2012, 194 training and 195 test pairs from a car",
    home: "https://www.cvlibs.net/datasets/kitti/eval_stereo_flow.php?benchmark=stereo",
    licence: LICENCE,
    folder: "kitti2012/training",
    scenes: 194,
    files: FileNames {
        pairs: &[
            PairFiles {
                left: "image_0/*_10",
                right: "image_1/*_10",
                calib: calib("calib/*.txt", "P0", "P1"),
            },
            PairFiles {
                left: "colored_0/*_10",
                right: "colored_1/*_10",
                calib: calib("calib/*.txt", "P2", "P3"),
            },
        ],
        truths: &[TruthFile {
            name: "disp_occ/*_10.png",
            form: KITTI_PNG,
            seen: Seen::Alone("disp_noc/*_10.png"),
        }],
        masks: &[],
    },
};

/// Cameras 2 and 3, coloured.
pub(crate) const KITTI2015: Dataset = Dataset {
    name: "kitti2015",
    title: "KITTI stereo 2015, 200 training and 200 test pairs with moving cars",
    home: "https://www.cvlibs.net/datasets/kitti/eval_scene_flow.php?benchmark=stereo",
    licence: LICENCE,
    folder: "kitti2015/training",
    scenes: 200,
    files: FileNames {
        pairs: &[PairFiles {
            left: "image_2/*_10",
            right: "image_3/*_10",
            calib: calib("calib_cam_to_cam/*.txt", "P_rect_02", "P_rect_03"),
        }],
        truths: &[TruthFile {
            name: "disp_occ_0/*_10.png",
            form: KITTI_PNG,
            seen: Seen::Alone("disp_noc_0/*_10.png"),
        }],
        masks: &[],
    },
};

const fn calib(file: &'static str, left: &'static str, right: &'static str) -> CalibFile {
    CalibFile::Projections { file, left, right }
}
