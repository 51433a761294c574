//! ROS 2 bags in SQLite (`.db3`): rosbag2's tables `topics` and `messages`.

use crate::stream::channel::{Channel, EventReader, FileEvent};
use rusqlite::{Connection, ErrorCode, OpenFlags, OptionalExtension, params};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::{Error, Result, inputs};
use tempfile::TempPath;

/// First bytes of such a file.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";

/// One SQLite file of a bag.
pub(crate) struct SqliteFile {
    path: PathBuf,
    len: u64,
    /// Path of the unpacked file.
    unpacked: Option<Arc<TempPath>>,
}

impl SqliteFile {
    pub(crate) fn new(path: &Path, len: u64, unpacked: Option<TempPath>) -> Self {
        Self {
            path: path.to_owned(),
            len,
            unpacked: unpacked.map(Arc::new),
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// The channels in the order of their topics.
    ///
    /// # Errors
    /// The errors of [`SqliteFile::messages`].
    pub(crate) fn channels(&self) -> Result<Vec<Channel>> {
        let mut channels: Vec<_> = self.messages()?.channels.into_values().collect();
        channels.sort_unstable_by(|a, b| a.topic.cmp(&b.topic));
        Ok(channels)
    }

    /// The messages from `places` places on, all over the file.
    ///
    /// # Errors
    /// The errors of [`SqliteFile::messages`].
    pub(crate) fn places(&self, places: usize) -> Result<Vec<SqliteMessages>> {
        let read = |place: usize| {
            let messages = self.messages()?;
            let last = messages.connection.query_row(LAST, [], |row| row.get(0));
            let last: i64 = last.unwrap_or(0);
            Ok(SqliteMessages {
                last: last / (places as i64 + 1) * place as i64,
                ..messages
            })
        };
        (1..=places).map(read).collect()
    }

    /// # Errors
    /// [`Error::Format`] for a file that is not a bag, or whose topics are corrupt.
    pub(crate) fn messages(&self) -> Result<SqliteMessages> {
        let file = self.unpacked.as_ref().map_or(&*self.path, |file| &***file);
        // SQLite opens it, with what another process writes beside it.
        for end in ["", "-wal", "-journal"] {
            let mut name = self.path.clone().into_os_string();
            name.push(end);
            inputs::register(Path::new(&name));
        }
        let wrong = |e: rusqlite::Error| {
            Error::format(&self.path, format!("is not a rosbag2 bag in SQLite: {e}"))
        };
        let connection = open(file).map_err(wrong)?;
        // SQLite rejects a truncated file as a whole, except in this mode for repairs.
        let lenient = connection.execute_batch("PRAGMA writable_schema = ON");
        let channels = lenient
            .and_then(|()| channels(&connection))
            .map_err(wrong)?;
        Ok(SqliteMessages {
            path: self.path.clone(),
            connection,
            channels,
            last: i64::MIN,
            data: Vec::new(),
            ended: false,
        })
    }
}

/// Opens a file to read, without a file beside it that was not there before: SQLite would leave its
/// shared memory (`-shm`) beside one with a write-ahead log, and refuse it in a folder that cannot
/// be written.
fn open(file: &Path) -> rusqlite::Result<Connection> {
    let beside = |end: &str| {
        let mut name = file.as_os_str().to_owned();
        name.push(end);
        Path::new(&name).exists()
    };
    let mut start = [0; 20];
    let read = File::open(file).and_then(|mut file| file.read_exact(&mut start));
    // A process that writes shares its memory. <https://sqlite.org/fileformat.html>, 1.3.2
    let has_log = read.is_ok() && start[18..] == [2, 2] && !beside("-shm");
    let (how, lock) = match (has_log, beside("-wal")) {
        (true, false) => ("?immutable=1", ""),
        (true, true) if cfg!(unix) => ("?vfs=unix-none", "PRAGMA locking_mode = EXCLUSIVE"),
        _ => ("", ""),
    };
    let mut name = "file:".to_owned();
    for byte in file.as_os_str().as_encoded_bytes() {
        name += &if byte.is_ascii_alphanumeric() {
            char::from(*byte).to_string()
        } else {
            format!("%{byte:02x}")
        };
    }
    // Without a mutex: a connection has one owner.
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_NO_MUTEX
        | OpenFlags::SQLITE_OPEN_URI;
    let connection = Connection::open_with_flags(name + how, flags)?;
    connection.execute_batch(lock)?;
    Ok(connection)
}

fn channels(connection: &Connection) -> rusqlite::Result<HashMap<i64, Channel>> {
    let mut topics =
        connection.prepare("SELECT id, name, type, serialization_format FROM topics")?;
    let channels = topics.query_map([], |row| {
        let channel = Channel::new(row.get(1)?, row.get(2)?, row.get(3)?);
        Ok((row.get(0)?, channel))
    })?;
    channels.collect()
}

/// The messages of a file in recorded order.
pub(crate) struct SqliteMessages {
    path: PathBuf,
    connection: Connection,
    channels: HashMap<i64, Channel>,
    /// Id of the last message.
    last: i64,
    data: Vec<u8>,
    ended: bool,
}

/// One message at a time: the bag may be larger than memory. SQLite itself limits one to 10⁹ bytes.
const NEXT: &str = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 ORDER BY id \
                    LIMIT 1";

/// The number of the last message.
const LAST: &str = "SELECT coalesce(max(id), 0) FROM messages";

impl EventReader for SqliteMessages {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        while !self.ended {
            let data = &mut self.data;
            let read = |row: &rusqlite::Row<'_>| {
                data.clear();
                data.extend_from_slice(row.get_ref(3)?.as_blob()?);
                Ok((row.get(0)?, row.get(1)?, row.get(2)?))
            };
            let next = self.connection.prepare(NEXT);
            let next =
                next.and_then(|mut next| next.query_row(params![self.last], read).optional());
            let (id, topic, stamp): (i64, i64, i64) = match next {
                Ok(Some(message)) => message,
                Ok(None) => {
                    self.ended = true;
                    break;
                }
                Err(error) => {
                    self.ended = true;
                    let code = error.sqlite_error_code();
                    let reason = match code {
                        Some(ErrorCode::DatabaseCorrupt) => "its SQLite pages are damaged".into(),
                        _ => error.to_string(),
                    };
                    let after = format!("after message {}: {reason}", self.last.max(0));
                    return Err(Error::damaged(&self.path, after));
                }
            };
            self.last = id;
            // A message without a topic cannot be an image.
            if let Some(channel) = self.channels.get(&topic) {
                return Ok(Some(FileEvent::Message(
                    channel,
                    u64::try_from(stamp).unwrap_or(0),
                    Cow::Borrowed(&self.data),
                )));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_ahead_log_is_read_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let names = |folder: &Path| {
            let names = std::fs::read_dir(folder).unwrap().flatten();
            let mut names: Vec<_> = names.map(|entry| entry.file_name()).collect();
            names.sort_unstable();
            names
        };
        let tables = "PRAGMA journal_mode = WAL;
                      CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format);
                      CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data);
                      INSERT INTO topics VALUES(7, '/a', 'std_msgs/msg/String', 'cdr');
                      INSERT INTO messages VALUES(1, 7, 10, x'00');
                      PRAGMA wal_checkpoint(TRUNCATE);
                      INSERT INTO messages VALUES(2, 7, 20, x'00');";
        let written = folder.path().join("written.db3");
        let connection = Connection::open(&written).unwrap();
        connection.execute_batch(tables).unwrap();
        // The files of a recorder that was killed, and of one that has closed its file.
        for (ends, expected) in [(&["", "-wal"][..], 2), (&[""], 1)] {
            let copy = folder.path().join(format!("a %3f?#{expected}"));
            std::fs::create_dir(&copy).unwrap();
            for end in ends {
                let from = folder.path().join(format!("written.db3{end}"));
                std::fs::copy(from, copy.join(format!("bag.db3{end}"))).unwrap();
            }
            let before = names(&copy);
            let file = SqliteFile::new(&copy.join("bag.db3"), 1, None);
            let (mut messages, mut count) = (file.messages().unwrap(), 0);
            while messages.next().unwrap().is_some() {
                count += 1;
            }
            drop(messages);
            assert_eq!((count, names(&copy)), (expected, before));
        }
    }

    #[test]
    fn messages_come_in_their_order_up_to_the_damage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bag_0.db3");
        let connection = Connection::open(&path).unwrap();
        let schema =
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT \
                      NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
                      CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
                      timestamp INTEGER NOT NULL, data BLOB NOT NULL);
                      INSERT INTO topics VALUES(7, '/a', 'std_msgs/msg/String', 'cdr', '');";
        connection.execute_batch(schema).unwrap();
        for (id, topic) in [(3, 7), (1, 7), (2, 99)] {
            let insert = "INSERT INTO messages VALUES(?1, ?2, ?3, ?4)";
            let data = vec![id as u8; 5000];
            connection
                .execute(insert, params![id, topic, 10 * id, data])
                .unwrap();
        }
        drop(connection);
        let read = || {
            let file = SqliteFile::new(&path, 1, None);
            assert_eq!(file.channels().unwrap()[0].topic, "/a");
            let (mut messages, mut found) = (file.messages().unwrap(), Vec::new());
            loop {
                match messages.next() {
                    Ok(Some(FileEvent::Message(_, log_time, data))) => {
                        found.push((log_time, data[0], data.len()))
                    }
                    Ok(_) => return (found, None),
                    Err(error) => return (found, Some(error.to_string())),
                }
            }
        };
        assert_eq!(read(), (vec![(10, 1, 5000), (30, 3, 5000)], None));
        // Overwrites the last message.
        let mut bytes = std::fs::read(&path).unwrap();
        let length = bytes.len();
        bytes.truncate(length - 4096);
        std::fs::write(&path, bytes).unwrap();
        let (found, error) = read();
        assert!(found.len() < 2 && error.unwrap().contains("bag_0.db3: after message"));
        std::fs::write(&path, [MAGIC, b"no database"].concat()).unwrap();
        let error = SqliteFile::new(&path, 1, None).messages().err().unwrap();
        assert!(error.to_string().contains("not a rosbag2 bag"), "{error}");
    }
}
