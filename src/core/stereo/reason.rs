//! Reasons for invalid pixels and unknown cells.

/// Reason why a pixel has no disparity, or a cell is unknown. The discriminant is its code in files
/// (`WHY.png`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum Reason {
    /// The pixel has a disparity.
    Valid = 0,
    /// No window fits around it, or no disparity of the range keeps the window inside the right
    /// image.
    Border = 1,
    /// Too little texture to distinguish windows.
    Untextured = 2,
    /// Another disparity costs nearly as little.
    Ambiguous = 3,
    /// The right image prefers another match.
    Inconsistent = 4,
    /// The window resembles its own surroundings as much as its match.
    SelfCheck = 5,
    /// No window of the right image has this one as its best match.
    Unmatched = 6,
    /// A filter reports that the cell shows the floor ([`crate::filter`]).
    Floor = 7,
    /// Only of cells: enough pixels are valid, but they do not agree well enough.
    Disagreement = 8,
}

impl Reason {
    /// All reasons, in order of their codes.
    pub const ALL: [Reason; 9] = [
        Reason::Valid,
        Reason::Border,
        Reason::Untextured,
        Reason::Ambiguous,
        Reason::Inconsistent,
        Reason::SelfCheck,
        Reason::Unmatched,
        Reason::Floor,
        Reason::Disagreement,
    ];

    /// The reasons of pixels, in order of their codes.
    pub const PIXELS: [Reason; 8] = {
        let [pixels @ .., Reason::Disagreement] = Self::ALL else {
            panic!("the last is of cells");
        };
        pixels
    };

    /// Name in tables and legends.
    pub fn name(self) -> &'static str {
        match self {
            Reason::Valid => "valid",
            Reason::Border => "border",
            Reason::Untextured => "untextured",
            Reason::Ambiguous => "ambiguous",
            Reason::Inconsistent => "inconsistent",
            Reason::SelfCheck => "self-check",
            Reason::Unmatched => "unmatched",
            Reason::Floor => "floor",
            Reason::Disagreement => "disagreement",
        }
    }
}
