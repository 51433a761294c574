//! The data sets of Middlebury College.

use super::entry::{Dataset, FileNames, Form, PairFiles, Seen, TruthFile};

const LICENCE: &str = "free to use and publish, with citation";

/// `im0` and `im1`, the names since 2014.
const IM0_IM1: &[PairFiles] = &[PairFiles::beside("im0", "im1")];

/// The third evaluation: 15 training scenes with truth and mask, 15 test scenes without.
pub(crate) const MIDDEVAL3: Dataset = Dataset {
    name: "middeval3",
    title: "Middlebury stereo evaluation v3, 15 training and 15 test scenes",
    home: "https://vision.middlebury.edu/stereo/submit3/",
    licence: LICENCE,
    folder: "middeval3/MiddEval3/trainingQ",
    scenes: 15,
    files: FileNames {
        pairs: IM0_IM1,
        truths: &[TruthFile {
            name: "disp0GT.pfm",
            form: Form::Pfm,
            seen: Seen::RightTruth("disp1GT.pfm"),
        }],
        masks: &["mask0nocc.png"],
    },
};

/// Robot-mounted mobile camera, 24 pairs.
pub(crate) const MIDDLEBURY2021: Dataset = Dataset {
    name: "middlebury2021",
    title: "Middlebury 2021 mobile, 24 pairs of a mobile phone's camera",
    home: "https://vision.middlebury.edu/stereo/data/scenes2021/",
    licence: LICENCE,
    folder: "middlebury2021/data",
    scenes: 24,
    files: FileNames {
        pairs: IM0_IM1,
        truths: DISP0,
        masks: &[],
    },
};

/// Six megapixels, sub-pixel truth, each scene rectified perfectly and imperfectly.
pub(crate) const MIDDLEBURY2014: Dataset = Dataset {
    name: "middlebury2014",
    title: "Middlebury 2014, 23 scenes of six megapixels",
    home: "https://vision.middlebury.edu/stereo/data/scenes2014/",
    licence: LICENCE,
    folder: "middlebury2014",
    scenes: 23,
    files: FileNames {
        pairs: IM0_IM1,
        truths: DISP0,
        masks: &[],
    },
};

const DISP0: &[TruthFile] = &[TruthFile {
    name: "disp0.pfm",
    form: Form::Pfm,
    seen: Seen::RightTruth("disp1.pfm"),
}];

/// Seven views of each scene, of which `view1` and `view5` have truth.
pub(crate) const MIDDLEBURY2006: Dataset = Dataset {
    name: "middlebury2006",
    title: "Middlebury 2006, 21 scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2006/",
    licence: LICENCE,
    folder: "middlebury2006/ThirdSize",
    scenes: 21,
    files: VIEWS,
};

/// The six scenes of 2005 whose truth is published.
pub(crate) const MIDDLEBURY2005: Dataset = Dataset {
    name: "middlebury2005",
    title: "Middlebury 2005, 6 scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2005/",
    licence: LICENCE,
    folder: "middlebury2005/ThirdSize",
    scenes: 6,
    files: VIEWS,
};

/// The archives of seven views hold the exposures two folders below the truth:
/// `Art/Illum2/Exp1/view1.png`.
const VIEWS: FileNames = FileNames {
    pairs: &[PairFiles::beside("view1", "view5")],
    truths: &[
        TruthFile {
            name: "disp1.png",
            form: THIRDS,
            seen: Seen::RightTruth("disp5.png"),
        },
        TruthFile {
            name: "../../disp1.png",
            form: THIRDS,
            seen: Seen::RightTruth("../../disp5.png"),
        },
    ],
    masks: &[],
};

/// Full, half and third size; the files of all hold full-size disparities.
const THIRDS: Form = Form::ScaledBySize(&[(1110, 1.0), (555, 2.0), (370, 3.0)]);

/// Structured light.
pub(crate) const MIDDLEBURY2003: Dataset = Dataset {
    name: "middlebury2003",
    title: "Middlebury 2003, cones and teddy",
    home: "https://vision.middlebury.edu/stereo/data/scenes2003/",
    licence: LICENCE,
    folder: "middlebury2003",
    scenes: 2,
    files: FileNames {
        pairs: &[PairFiles::beside("im2", "im6")],
        truths: &[
            TruthFile {
                name: "disp2.png",
                form: QUARTERS,
                seen: Seen::RightTruth("disp6.png"),
            },
            TruthFile {
                name: "disp2.pgm",
                form: QUARTERS,
                seen: Seen::RightTruth("disp6.pgm"),
            },
        ],
        masks: &[],
    },
};

const QUARTERS: Form = Form::ScaledBySize(&[(1500, 1.0), (750, 2.0), (375, 4.0)]);

/// Piecewise planar scenes, and the head and lamp of Tsukuba.
pub(crate) const MIDDLEBURY2001: Dataset = Dataset {
    name: "middlebury2001",
    title: "Middlebury 2001, tsukuba, map and six planar scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2001/",
    licence: LICENCE,
    folder: "middlebury2001",
    scenes: 8,
    files: FileNames {
        pairs: &[
            PairFiles::beside("im2", "im6"),
            PairFiles::beside("scene1.row3.col3", "scene1.row3.col4"),
        ],
        truths: &[
            TruthFile {
                name: "disp2.pgm",
                form: EIGHTHS,
                seen: Seen::RightTruth("disp6.pgm"),
            },
            TruthFile {
                name: "disp0.pgm",
                form: EIGHTHS,
                seen: Seen::RightTruth("disp1.pgm"),
            },
            TruthFile {
                name: "truedisp.row3.col3.pgm",
                form: SIXTEENTHS,
                seen: Seen::Unknown,
            },
        ],
        masks: &[],
    },
};

const EIGHTHS: Form = Form::Scaled {
    scale: 8.0,
    zero_unknown: false,
};

/// An 18-pixel border of tsukuba has no truth.
pub(crate) const SIXTEENTHS: Form = Form::Scaled {
    scale: 16.0,
    zero_unknown: true,
};
