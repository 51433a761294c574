//! Merges tables of several reports into one, row by row: only a row per table is in memory.

use super::csv_rows::RowReader;
use super::rows::Record;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::path::PathBuf;
use svl_core::Result;

/// Rows handed on at once.
const BATCH: usize = 4096;

/// The rows of several tables, each in the order of `place`, in the order of `place`: rows of one
/// place stay together, as they are in their table.
///
/// # Errors
/// Those of reading, of `place`, and of `take`.
pub fn merge_rows<R: Record, P: Ord>(
    tables: &[PathBuf],
    place: impl Fn(&R) -> Result<P>,
    mut take: impl FnMut(Vec<R>) -> Result<()>,
) -> Result<()> {
    let mut readers = Vec::new();
    let mut heads: Vec<Option<R>> = Vec::new();
    let mut first = BinaryHeap::new();
    for (i, path) in tables.iter().enumerate() {
        let mut reader = RowReader::open(path)?;
        let head = reader.next().transpose()?;
        if let Some(row) = &head {
            first.push(Reverse((place(row)?, i)));
        }
        heads.push(head);
        readers.push(reader);
    }
    let mut batch = Vec::with_capacity(BATCH);
    while let Some(Reverse((_, i))) = first.pop() {
        let next = readers[i].next().transpose()?;
        if let Some(row) = &next {
            first.push(Reverse((place(row)?, i)));
        }
        batch.extend(std::mem::replace(&mut heads[i], next));
        if batch.len() == BATCH {
            take(std::mem::replace(&mut batch, Vec::with_capacity(BATCH)))?;
        }
    }
    take(batch)
}
