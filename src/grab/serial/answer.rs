//! Answers of the controller: lines with a letter, two numbers and a checksum.

/// A line from the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ControllerAnswer {
    pub(super) letter: u8,
    pub(super) first: u32,
    pub(super) second: u32,
}

impl ControllerAnswer {
    /// `<letter> <number> <number> <crc>`, without the line's end.
    pub(super) fn parse(line: &[u8]) -> Option<Self> {
        let line = std::str::from_utf8(line).ok()?;
        let (said, crc) = line.rsplit_once(' ')?;
        // The checksum first: a garbled line may still contain numbers.
        if crc.len() != 2 || u8::from_str_radix(crc, 16).ok()? != crc8(said.as_bytes()) {
            return None;
        }
        let mut words = said.split(' ');
        let &[letter] = words.next()?.as_bytes() else {
            return None;
        };
        let answer = Self {
            letter,
            first: words.next()?.parse().ok()?,
            second: words.next()?.parse().ok()?,
        };
        words.next().is_none().then_some(answer)
    }
}

/// CRC-8: polynomial 0x07, initially 0, not reflected, not inverted.
pub(super) fn crc8(bytes: &[u8]) -> u8 {
    let shift = |crc: u8, _| {
        if crc & 0x80 == 0 {
            crc << 1
        } else {
            crc << 1 ^ 0x07
        }
    };
    bytes
        .iter()
        .fold(0, |crc, byte| (0..8).fold(crc ^ byte, shift))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_what_the_readme_says() {
        assert_eq!(crc8(b"123456789"), 0xf4);
        assert_eq!(
            ControllerAnswer::parse(b"P 1 49480 3a"),
            Some(ControllerAnswer {
                letter: b'P',
                first: 1,
                second: 49480
            })
        );
        for wrong in [
            "",
            "P",
            "P 1 49480 3b",
            "P 2 49480 3a",
            " 1 49480 3a",
            "P 1 49480 +a",
            "PP 1 49480 3a",
        ] {
            assert_eq!(ControllerAnswer::parse(wrong.as_bytes()), None, "{wrong}");
        }
    }
}
