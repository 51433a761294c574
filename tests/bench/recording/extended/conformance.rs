//! The MCAP conformance suite (foxglove/mcap, `tests/conformance/data`): 416 files with each
//! combination of chunks, indexes, summary and unknown fields.

use super::file::{EXTENSIBLE, ExtendedFile};
use crate::common::repository;
use crate::recording::frames::{recover, summarize};
use crate::recording::says::Says;
use mcap::records::op;
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

const FILES: usize = 416;
/// The unknown fields of the suite, in files with `pad` in their name.
const FIELDS: &[u8] = &[1, 0xFF, 0xFF];

/// Kinds of records, with opcode, and types and names of the fields in order, as in the suite's
/// JSON: `1`, `2`, `4` and `8` bytes, `s` a string, `b` and `l` bytes with a short or a long
/// length, `r` the rest, `m` and `c` maps of strings or numbers.
const LAYOUTS: [&str; 12] = [
    "Header 1 s profile s library",
    "Schema 3 2 id s name s encoding b data",
    "Channel 4 2 id 2 schema_id s topic s message_encoding m metadata",
    "Message 5 2 channel_id 4 sequence 8 log_time 8 publish_time r data",
    "Attachment 9 8 log_time 8 create_time s name s media_type l data",
    "Metadata 12 s name m metadata",
    "Statistics 11 8 message_count 2 schema_count 4 channel_count 4 attachment_count \
     4 metadata_count 4 chunk_count 8 message_start_time 8 message_end_time \
     c channel_message_counts",
    "MetadataIndex 13 8 offset 8 length s name",
    "AttachmentIndex 10 8 offset 8 length 8 log_time 8 create_time 8 data_size s name s media_type",
    "ChunkIndex 8 8 message_start_time 8 message_end_time 8 chunk_start_offset 8 chunk_length \
     c message_index_offsets 8 message_index_length s compression 8 compressed_size \
     8 uncompressed_size",
    "SummaryOffset 14 1 group_opcode 8 group_start 8 group_length",
    "Footer 2 8 summary_start 8 summary_offset_start",
];

/// A record of the suite's JSON.
struct Expected {
    kind: String,
    fields: Map<String, Value>,
}

impl Expected {
    fn all(json: &Path) -> Vec<Self> {
        let text = std::fs::read_to_string(json).unwrap();
        let value: Value = serde_json::from_str(&text).unwrap();
        let field = |field: &Value| (field[0].as_str().unwrap().to_owned(), field[1].clone());
        let fields = |fields: &Value| fields.as_array().unwrap().iter().map(field).collect();
        let record = |record: &Value| Self {
            kind: record["type"].as_str().unwrap().to_owned(),
            fields: fields(&record["fields"]),
        };
        let records = value["records"].as_array().unwrap();
        records.iter().map(record).collect()
    }

    fn number(&self, field: &str) -> u64 {
        self.fields[field].as_str().unwrap().parse().unwrap()
    }

    fn text(&self, field: &str) -> &str {
        self.fields[field].as_str().unwrap()
    }

    fn data(&self) -> Vec<u8> {
        let bytes = self.fields["data"].as_array().unwrap().iter();
        let byte = |byte: &Value| byte.as_str().unwrap().parse::<u8>().unwrap();
        bytes.map(byte).collect()
    }

    /// Opcode and body.
    fn encoded(&self) -> (u8, Vec<u8>) {
        let words = |layout: &'static str| layout.split(' ').collect::<Vec<_>>();
        let mut layouts = LAYOUTS.into_iter().map(words);
        let layout = layouts.find(|layout| layout[0] == self.kind).unwrap();
        let mut body = Vec::new();
        let string = |body: &mut Vec<u8>, text: &str| {
            body.extend((text.len() as u32).to_le_bytes());
            body.extend(text.as_bytes());
        };
        for field in layout[2..].chunks(2) {
            let (form, name) = (field[0], field[1]);
            match form {
                "1" | "2" | "4" | "8" => {
                    let bytes: usize = form.parse().unwrap();
                    body.extend(&self.number(name).to_le_bytes()[..bytes]);
                }
                "s" => string(&mut body, self.text(name)),
                "r" => body.extend(self.data()),
                "b" => {
                    body.extend((self.data().len() as u32).to_le_bytes());
                    body.extend(self.data());
                }
                "l" => {
                    body.extend((self.data().len() as u64).to_le_bytes());
                    body.extend(self.data());
                    body.extend(crc32fast::hash(&body).to_le_bytes());
                }
                _ => {
                    let mut entries = Vec::new();
                    for (key, value) in self.fields[name].as_object().unwrap() {
                        let value = value.as_str().unwrap();
                        if form == "m" {
                            string(&mut entries, key);
                            string(&mut entries, value);
                        } else {
                            entries.extend(key.parse::<u16>().unwrap().to_le_bytes());
                            entries.extend(value.parse::<u64>().unwrap().to_le_bytes());
                        }
                    }
                    body.extend((entries.len() as u32).to_le_bytes());
                    body.extend(entries);
                }
            }
        }
        (layout[1].parse().unwrap(), body)
    }
}

/// Writes the file of this name, whose records those are.
fn written(name: &str, records: &[Expected]) -> Vec<u8> {
    let has = |feature| name.split('-').any(|part| part == feature);
    // The suite extends all kinds but chunks, and none inside of chunks.
    let is_extended = |kind: &u8| has("pad") && *kind != op::CHUNK;
    let kinds: Vec<_> = EXTENSIBLE.into_iter().filter(is_extended).collect();
    let mut file = ExtendedFile::new(&kinds, FIELDS);
    let mut chunk = ExtendedFile::new(&[], FIELDS);
    chunk.bytes.clear();
    let (mut times, mut index) = (Vec::new(), BTreeMap::<u16, Vec<u8>>::new());
    let mut summary = 0;
    for record in records {
        match record.kind.as_str() {
            "Schema" | "Channel" | "Message" if has("ch") && summary == 0 => {
                if record.kind == "Message" {
                    let place = (record.number("log_time"), chunk.bytes.len() as u64);
                    let id = record.number("channel_id") as u16;
                    times.push(place.0);
                    let entries = index.entry(id).or_default();
                    entries.extend([place.0, place.1].map(u64::to_le_bytes).concat());
                }
                let (opcode, body) = record.encoded();
                chunk.record(opcode, &body);
            }
            "DataEnd" => {
                if has("ch") {
                    let size = chunk.bytes.len() as u64;
                    let times = [times.iter().min(), times.iter().max()];
                    let mut body = times.map(|time| time.unwrap().to_le_bytes()).concat();
                    body.extend(size.to_le_bytes());
                    body.extend(crc32fast::hash(&chunk.bytes).to_le_bytes());
                    body.extend([0; 4]);
                    body.extend(size.to_le_bytes());
                    body.extend(&chunk.bytes);
                    file.record(op::CHUNK, &body);
                }
                for (id, entries) in index.iter().filter(|_| has("mx")) {
                    let mut body = id.to_le_bytes().to_vec();
                    body.extend((entries.len() as u32).to_le_bytes());
                    body.extend(entries);
                    file.record(op::MESSAGE_INDEX, &body);
                }
                file.end_data();
                summary = file.bytes.len();
            }
            "Footer" => {
                let starts = ["summary_start", "summary_offset_start"];
                return file.finish(summary, starts.map(|start| record.number(start)));
            }
            _ => {
                let (opcode, body) = record.encoded();
                file.record(opcode, &body);
            }
        }
    }
    unreachable!("a file ends with a footer")
}

/// The file at `path`, or the one of which Git LFS has only the hash, written again.
fn bytes(path: &Path, records: &[Expected]) -> Vec<u8> {
    let bytes = std::fs::read(path).unwrap();
    let pointer = String::from_utf8_lossy(&bytes);
    let Some((_, rest)) = pointer.split_once("oid sha256:") else {
        return bytes;
    };
    let name = path.file_stem().unwrap().to_str().unwrap();
    let written = written(name, records);
    let hash = format!("{:x}", Sha256::digest(&written));
    assert!(rest.starts_with(&hash), "{name} is another file");
    written
}

/// Reads a file of the suite in every way.
fn check(path: &Path, folder: &Path) {
    let name = path.file_stem().unwrap().to_str().unwrap();
    let records = Expected::all(&path.with_extension("json"));
    let (file, saved) = (folder.join("file.mcap"), folder.join("saved.mcap"));
    std::fs::write(&file, bytes(path, &records)).unwrap();
    let count = |kind: &str| records.iter().filter(|record| record.kind == kind).count() as u64;
    let summary = summarize(&file).unwrap();
    assert!(summary.is_intact(), "{name}: {:?}", summary.damage);
    let seen: u64 = summary.topics.iter().map(|topic| topic.messages).sum();
    assert_eq!(seen, count("Message"), "{name}");
    let attachments = summary.attachments.len() as u64;
    assert_eq!(attachments, count("Attachment"), "{name}");
    let _ = std::fs::remove_file(&saved);
    let recovery = recover(&file, &saved);
    if name.starts_with("NoData") {
        recovery.unwrap_err().says("nothing that can be recovered");
        return;
    }
    let recovery = recovery.unwrap();
    assert!(recovery.losses.is_empty() && !recovery.partial, "{name}");
    assert_eq!(recovery.attachments, count("Attachment"), "{name}");
    assert_eq!(recovery.metadata, count("Metadata"), "{name}");
    let bytes = std::fs::read(&saved).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
        let message = message.unwrap();
        let (topic, data) = (message.channel.topic.clone(), message.data.into_owned());
        (topic, message.sequence, message.log_time, data)
    });
    let expected = records.iter().filter(|record| record.kind == "Message");
    let expected = expected.map(|record| {
        let (sequence, time) = (record.number("sequence") as u32, record.number("log_time"));
        ("example".to_owned(), sequence, time, record.data())
    });
    assert!(messages.eq(expected), "{name}");
}

#[test]
fn every_file_of_the_conformance_suite_is_read() {
    let suite = repository().join("../shared/mcap-conformance");
    let Ok(folders) = std::fs::read_dir(&suite) else {
        crate::common::skip("no conformance suite of MCAP");
        return;
    };
    let scratch = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    let folders = folders.map(|entry| entry.unwrap().path());
    for folder in folders.filter(|path| path.is_dir()) {
        let inside = std::fs::read_dir(folder).unwrap();
        files.extend(inside.map(|entry| entry.unwrap().path()));
    }
    files.retain(|path| path.extension().is_some_and(|ending| ending == "mcap"));
    for path in &files {
        check(path, scratch.path());
    }
    assert_eq!(files.len(), FILES);
}
