//! The data sets of Middlebury College.

use super::entry::{Dataset, FileNames, Form, PairFiles, Part, Seen, TruthFile};

const LICENCE: &str = "free to use and publish, with citation";

/// `im0` and `im1`, the names since 2014.
const IM0_IM1: &[PairFiles] = &[PairFiles::beside("im0", "im1")];

macro_rules! eval3 {
    ($name:literal, $usual:literal, $megabytes:literal) => {
        Part {
            name: $name,
            usual: $usual,
            megabytes: $megabytes,
            base: "https://vision.middlebury.edu/stereo/submit3/zip/",
            files: &[
                concat!("MiddEval3-data-", $name, ".zip"),
                concat!("MiddEval3-GT0-", $name, ".zip"),
            ],
            folder: "",
        }
    };
}

/// The third evaluation: 15 training scenes with truth and mask, 15 test scenes without.
pub(super) const MIDDEVAL3: Dataset = Dataset {
    name: "middeval3",
    title: "Middlebury stereo evaluation v3, 15 training and 15 test scenes",
    home: "https://vision.middlebury.edu/stereo/submit3/",
    licence: LICENCE,
    citation: GCPR2014,
    parts: &[
        eval3!("Q", true, 45),
        eval3!("H", false, 165),
        eval3!("F", false, 640),
    ],
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
pub(super) const MIDDLEBURY2021: Dataset = Dataset {
    name: "middlebury2021",
    title: "Middlebury 2021 mobile, 24 pairs of a mobile phone's camera",
    home: "https://vision.middlebury.edu/stereo/data/scenes2021/",
    licence: LICENCE,
    citation: "G. Pan, T. Sun, T. Weed, D. Scharstein, 2021 Mobile stereo datasets with ground \
               truth, Middlebury College",
    parts: &[Part {
        name: "all",
        usual: true,
        megabytes: 404,
        base: "https://vision.middlebury.edu/stereo/data/scenes2021/zip/",
        files: &["all.zip"],
        folder: "",
    }],
    files: FileNames {
        pairs: IM0_IM1,
        truths: DISP0,
        masks: &[],
    },
};

macro_rules! scenes2014 {
    ($($scene:literal)*) => {
        &[
            Part {
                name: "perfect",
                usual: true,
                megabytes: 2100,
                base: "https://vision.middlebury.edu/stereo/data/scenes2014/zip/",
                files: &[$(concat!($scene, "-perfect.zip")),*],
                folder: "",
            },
            Part {
                name: "imperfect",
                usual: false,
                megabytes: 1500,
                base: "https://vision.middlebury.edu/stereo/data/scenes2014/zip/",
                files: &[$(concat!($scene, "-imperfect.zip")),*],
                folder: "",
            },
            $(Part {
                name: $scene,
                usual: false,
                megabytes: 95,
                base: "https://vision.middlebury.edu/stereo/data/scenes2014/zip/",
                files: &[concat!($scene, "-perfect.zip")],
                folder: "",
            }),*
        ]
    };
}

/// Six megapixels, sub-pixel truth, each scene rectified perfectly and imperfectly.
pub(super) const MIDDLEBURY2014: Dataset = Dataset {
    name: "middlebury2014",
    title: "Middlebury 2014, 23 scenes of six megapixels",
    home: "https://vision.middlebury.edu/stereo/data/scenes2014/",
    licence: LICENCE,
    citation: GCPR2014,
    parts: scenes2014!(
        "Adirondack" "Backpack" "Bicycle1" "Cable" "Classroom1" "Couch" "Flowers" "Jadeplant"
        "Mask" "Motorcycle" "Piano" "Pipes" "Playroom" "Playtable" "Recycle" "Shelves" "Shopvac"
        "Sticks" "Storage" "Sword1" "Sword2" "Umbrella" "Vintage"
    ),
    files: FileNames {
        pairs: IM0_IM1,
        truths: DISP0,
        masks: &[],
    },
};

const GCPR2014: &str = "D. Scharstein, H. Hirschmüller, Y. Kitajima, G. Krathwohl, N. Nesic, X. \
                        Wang, P. Westling, High-resolution stereo datasets with subpixel-accurate \
                        ground truth, GCPR 2014";

const DISP0: &[TruthFile] = &[TruthFile {
    name: "disp0.pfm",
    form: Form::Pfm,
    seen: Seen::RightTruth("disp1.pfm"),
}];

macro_rules! views {
    (
        $name:literal, $usual:literal, $megabytes:literal, $year:literal, $size:literal,
        $($scene:literal)*
    ) => {
        Part {
            name: $name,
            usual: $usual,
            megabytes: $megabytes,
            base: concat!(
                "https://vision.middlebury.edu/stereo/data/scenes", $year, "/", $size,
                "/zip-2views/"
            ),
            files: &[$(concat!($scene, "-2views.zip")),*],
            folder: $size,
        }
    };
}

macro_rules! sizes {
    ($year:literal, $third:literal, $half:literal, $full:literal, $($scene:literal)*) => {
        &[
            views!("third", true, $third, $year, "ThirdSize", $($scene)*),
            views!("half", false, $half, $year, "HalfSize", $($scene)*),
            views!("full", false, $full, $year, "FullSize", $($scene)*),
        ]
    };
}

/// Seven views of each scene, of which `view1` and `view5` have truth.
pub(super) const MIDDLEBURY2006: Dataset = Dataset {
    name: "middlebury2006",
    title: "Middlebury 2006, 21 scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2006/",
    licence: LICENCE,
    citation: CVPR2007,
    parts: sizes!(
        "2006", 14, 30, 110,
        "Aloe" "Baby1" "Baby2" "Baby3" "Bowling1" "Bowling2" "Cloth1" "Cloth2" "Cloth3" "Cloth4"
        "Flowerpots" "Lampshade1" "Lampshade2" "Midd1" "Midd2" "Monopoly" "Plastic" "Rocks1"
        "Rocks2" "Wood1" "Wood2"
    ),
    files: VIEWS,
};

/// The six scenes of 2005 whose truth is published.
pub(super) const MIDDLEBURY2005: Dataset = Dataset {
    name: "middlebury2005",
    title: "Middlebury 2005, 6 scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2005/",
    licence: LICENCE,
    citation: CVPR2007,
    parts: sizes!("2005", 4, 9, 33, "Art" "Books" "Dolls" "Laundry" "Moebius" "Reindeer"),
    files: VIEWS,
};

const CVPR2007: &str = "D. Scharstein, C. Pal, Learning conditional random fields for stereo, \
                        CVPR 2007; H. Hirschmüller, D. Scharstein, Evaluation of cost functions \
                        for stereo matching, CVPR 2007";

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

macro_rules! scenes2003 {
    ($name:literal, $usual:literal, $megabytes:literal, $($file:literal)*) => {
        Part {
            name: $name,
            usual: $usual,
            megabytes: $megabytes,
            base: "https://vision.middlebury.edu/stereo/data/scenes2003/newdata/",
            files: &[$($file),*],
            folder: "",
        }
    };
}

/// Structured light.
pub(super) const MIDDLEBURY2003: Dataset = Dataset {
    name: "middlebury2003",
    title: "Middlebury 2003, cones and teddy",
    home: "https://vision.middlebury.edu/stereo/data/scenes2003/",
    licence: LICENCE,
    citation: "D. Scharstein, R. Szeliski, High-accuracy stereo depth maps using structured \
               light, CVPR 2003",
    parts: &[
        scenes2003!("quarter", true, 2, "cones/cones-png-2.zip" "teddy/teddy-png-2.zip"),
        scenes2003!("half", false, 7, "full/conesH-ppm-2.zip" "full/teddyH-ppm-2.zip"),
        scenes2003!("full", false, 30, "full/conesF-ppm-2.zip" "full/teddyF-ppm-2.zip"),
    ],
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

macro_rules! scenes2001 {
    ($($scene:literal)*; $($file:literal)*) => {
        &[
            $(
                concat!($scene, "/im2.ppm"),
                concat!($scene, "/im6.ppm"),
                concat!($scene, "/disp2.pgm"),
                concat!($scene, "/disp6.pgm"),
            )*
            $($file),*
        ]
    };
}

/// Piecewise planar scenes, and the head and lamp of Tsukuba.
pub(super) const MIDDLEBURY2001: Dataset = Dataset {
    name: "middlebury2001",
    title: "Middlebury 2001, tsukuba, map and six planar scenes",
    home: "https://vision.middlebury.edu/stereo/data/scenes2001/",
    licence: LICENCE,
    citation: "D. Scharstein, R. Szeliski, A taxonomy and evaluation of dense two-frame stereo \
               correspondence algorithms, IJCV 47, 2002; tsukuba: Y. Nakamura, T. Matsuura, K. \
               Satoh, Y. Ohta, Occlusion detectable stereo, CVPR 1996",
    parts: &[Part {
        name: "all",
        usual: true,
        megabytes: 10,
        base: "https://vision.middlebury.edu/stereo/data/scenes2001/data/",
        files: scenes2001!(
            "barn1" "barn2" "bull" "poster" "sawtooth" "venus";
            "map/im0.pgm" "map/im1.pgm" "map/disp0.pgm" "map/disp1.pgm"
            "tsukuba/scene1.row3.col3.ppm" "tsukuba/scene1.row3.col4.ppm"
            "tsukuba/truedisp.row3.col3.pgm"
        ),
        folder: "",
    }],
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
pub(super) const SIXTEENTHS: Form = Form::Scaled {
    scale: 16.0,
    zero_unknown: true,
};
