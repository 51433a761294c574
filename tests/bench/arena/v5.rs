//! The oracle of v5 against known answers of its specification.

#[allow(dead_code, reason = "each test program uses its part of this module")]
#[path = "../../lean/oracle/v5.rs"]
mod oracle;

use oracle::V5;
use svl::arena::{Arena, ArenaConfig};

/// CRC-32 of every step for pairs of the arena, as given in the specification (section 3.11).
#[test]
fn the_oracle_gives_the_specification_s_answers() {
    fn crc<T: Copy, const N: usize>(values: &[T], bytes: impl Fn(T) -> [u8; N]) -> u32 {
        crc32fast::hash(&values.iter().flat_map(|&v| bytes(v)).collect::<Vec<_>>())
    }
    let known: [(u64, [u32; 9]); 3] = [
        (
            0,
            [
                0x48edd7ee, 0x7f2b6ff6, 0x34ea7937, 0xcacb594a, 0xb0a90212, 0xee305a78, 0xa73d7738,
                0x7edcf5c1, 0,
            ],
        ),
        (
            100,
            [
                0x48ad2f71, 0x4978a26c, 0xc8cd3032, 0xaa4a6b86, 0x00cf2b6d, 0x62356878, 0xcda01b10,
                0x2bc55a22, 0,
            ],
        ),
        (
            200,
            [
                0x89063527, 0xcb5bff3f, 0xad3a29f3, 0x132f7bd9, 0x5d967f30, 0x545933a6, 0x5f9fe900,
                0xf0e90a55, 0,
            ],
        ),
    ];
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    let v5 = V5::default();
    let rig = arena.rig();
    let tolerance = v5.tolerance_m(rig.focal_px() * rig.baseline_m(), rig.doffs_px());
    let (lo, hi): (Vec<_>, Vec<_>) = tolerance.iter().copied().unzip();
    assert_eq!(crc(&lo, i32::to_le_bytes), 0x2723c6e2);
    assert_eq!(crc(&hi, i32::to_le_bytes), 0xb86efdb5);
    for (number, known) in known {
        let steps = v5.steps(&arena.frame(number).unwrap().pair);
        let flags: Vec<u8> = steps.seen.iter().map(|&seen| seen.into()).collect();
        let evidence = v5.evidence(&steps, &tolerance, (5, 3)).concat();
        let got = [
            crc(&steps.half[0], u16::to_le_bytes),
            crc(&steps.census[0], u32::to_le_bytes),
            crc(&steps.costs, u8::to_le_bytes),
            crc(&steps.sums, u8::to_le_bytes),
            crc(&steps.disparity, i16::to_le_bytes),
            crc(&flags, u8::to_le_bytes),
            crc(&steps.filled, i16::to_le_bytes),
            crc(&evidence, i64::to_le_bytes),
        ];
        let words = |crcs: &[u32]| crcs.iter().map(|c| format!("{c:08x}")).collect::<Vec<_>>();
        assert_eq!(words(&got), words(&known[..8]), "pair {number}");
    }
}
