//! ETH3D's low-resolution two-view benchmark.

use super::entry::{Dataset, FileNames, Form, PairFiles, Part, Seen, TruthFile};

/// The archives have the scenes at their top, so each is unpacked into a folder of its own name, as
/// its users do.
pub(super) const ETH3D: Dataset = Dataset {
    name: "eth3d",
    title: "ETH3D two-view, 27 training pairs, laser-scanned",
    home: "https://www.eth3d.net/datasets#low-res-two-view",
    licence: "CC BY-NC-SA 4.0",
    citation: "T. Schöps, J. L. Schönberger, S. Galliani, T. Sattler, K. Schindler, M. Pollefeys, \
               A. Geiger, A multi-view stereo benchmark with high-resolution images and \
               multi-camera videos, CVPR 2017",
    parts: &[
        part(
            "images",
            true,
            &["two_view_training.7z"],
            "two_view_training",
        ),
        part(
            "truth",
            true,
            &["two_view_training_gt.7z"],
            "two_view_training_gt",
        ),
        part("test", false, &["two_view_test.7z"], "two_view_test"),
    ],
    files: FileNames {
        pairs: &[PairFiles::beside("im0", "im1")],
        truths: &[TruthFile {
            name: "../../two_view_training_gt/{}/disp0GT.pfm",
            form: Form::Pfm,
            seen: Seen::Unknown,
        }],
        masks: &["../../two_view_training_gt/{}/mask0nocc.png"],
    },
};

const fn part(
    name: &'static str,
    usual: bool,
    files: &'static [&'static str],
    folder: &'static str,
) -> Part {
    Part {
        name,
        usual,
        megabytes: 14,
        base: "https://www.eth3d.net/data/",
        files,
        folder,
    }
}
