//! ETH3D's low-resolution two-view benchmark.

use super::entry::{Dataset, FileNames, Form, PairFiles, Seen, TruthFile};

/// The archives have the scenes at their top, so each is unpacked into a folder of its own name, as
/// its users do.
pub(crate) const ETH3D: Dataset = Dataset {
    name: "eth3d",
    title: "ETH3D two-view, 27 training pairs, laser-scanned",
    home: "https://www.eth3d.net/datasets#low-res-two-view",
    licence: "CC BY-NC-SA 4.0",
    folder: "eth3d/two_view_training",
    scenes: 27,
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
