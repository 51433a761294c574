//! Rerun's file. The SDK's own sink waits forever for the end of a file that cannot grow.

use parking_lot::Mutex;
use rerun::external::re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use rerun::log::LogMsg;
use rerun::sink::{FileSinkError, LogSink, SinkFlushError};
use rerun::{RecordingStream, RecordingStreamBuilder, RecordingStreamResult};
use std::fs::File;
use std::path::Path;
use std::time::Duration;

/// Writes messages to a file, up to the first failure.
struct FileWriter(Mutex<Result<Encoder<File>, EncodeError>>);

/// Opens a stream into the file `path`.
pub(crate) fn open(
    builder: RecordingStreamBuilder,
    path: &Path,
) -> RecordingStreamResult<RecordingStream> {
    let file = File::create(path).map_err(|source| FileSinkError::CreateFile {
        source,
        path: path.to_owned(),
    })?;
    let version = rerun::build_info().version;
    let encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, file)
        .map_err(FileSinkError::from)?;
    let stream = builder.buffered()?;
    stream.set_sink(Box::new(FileWriter(Mutex::new(Ok(encoder)))));
    Ok(stream)
}

impl LogSink for FileWriter {
    fn send(&self, message: LogMsg) {
        let mut encoder = self.0.lock();
        if let Ok(open) = &mut *encoder
            && let Err(error) = open.append(&message)
        {
            *encoder = Err(error);
        }
    }

    fn flush_blocking(&self, _: Duration) -> Result<(), SinkFlushError> {
        let encoder = self.0.lock();
        let failed = encoder.as_ref().err();
        failed.map_or(Ok(()), |error| {
            Err(SinkFlushError::failed(error.to_string()))
        })
    }

    fn defers_finalization_to_shutdown(&self) -> bool {
        true
    }
}
