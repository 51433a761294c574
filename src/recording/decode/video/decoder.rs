//! Decodes the videos of a topic by the program `ffmpeg`, in a child.
//!
//! A thread reads the recording again and writes the pictures that can be decoded to the child,
//! which waits when it is ahead. Each picture has a number, its time, on the way there (IVF) and
//! back (Matroska), so that a missing one never shifts those after it. As pictures without B-frames
//! come back in their order, the first that did not come back is damaged, and all that follow it,
//! to the next keyframe.

use super::matroska::RawPictures;
use super::message::{self, Codec};
use super::order::PictureOrder;
use crate::bags::opened::Recording;
use crate::message::MessageError::{SizeChange, Video, VideoSize};
use crate::message::MessageResult;
use crate::stream::channel::FileEvent;
use std::fs::File;
use std::io::{BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use svl_core::stereo::{Gray, MAX_SIDE};
use svl_core::{Error, Result};
use svl_files::{DecodedImage, ffmpeg};

/// Limit on the bytes of a picture: RGB.
const MAX_BYTES: u64 = 3 * (MAX_SIDE * MAX_SIDE) as u64;

/// The options of ffmpeg before the decoder's name. An error is no picture, rather than a concealed
/// one.
const INPUT: &str = "-nostdin -loglevel error -threads 1 -err_detect explode -ec 0 \
    -flags low_delay -probesize 32 -analyzeduration 0 -c:v";
/// The options after the decoder's name: each picture with its time, which differs from all others.
/// Pictures of another size are for another child ([`PictureOrder`]).
const OUTPUT: &str = "-f ivf -i pipe:0 -map 0:v:0 -copyts -enc_time_base 1:1000";
/// The last ones. Matroska has no name for RGB: the muxer accepts it as another.
const PIXELS: &str = "-vf format=gray|rgb24 -c:v rawvideo -tag:v I420 -f matroska pipe:1";

/// Checks that ffmpeg can be started.
///
/// # Errors
/// [`Error::Program`] where it is missing.
pub(crate) fn check() -> Result<()> {
    let mut version = Command::new("ffmpeg");
    version.arg("-version").stdin(Stdio::null());
    let (child, _) = ffmpeg::start("ffmpeg", &mut version)?;
    let done = child.wait_with_output();
    done.map(drop).map_err(|e| Error::Program {
        command: "ffmpeg".to_owned(),
        reason: e.to_string(),
        stderr: String::new(),
    })
}

/// A child that decodes pictures of one size. Dropping it ends it.
struct Session {
    child: Child,
    said: File,
    pictures: RawPictures<BufReader<ChildStdout>>,
}

impl Drop for Session {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A picture that came back: the number of its message, and its pixels, or the reason why they are
/// not used.
type Numbered = (u64, MessageResult<DecodedImage>);

/// Decodes the messages of a topic in their order.
pub(crate) struct VideoDecoder {
    /// The topic, for warnings.
    name: String,
    sessions: Option<Receiver<Result<Session>>>,
    feeder: Option<JoinHandle<()>>,
    stop: Arc<AtomicBool>,
    current: Option<Session>,
    /// Width and height of the first picture.
    size: Option<(usize, usize)>,
    /// The number of the last picture if the next one may refer to it.
    last: Option<u64>,
    ahead: Option<Numbered>,
    warned: bool,
}

impl VideoDecoder {
    pub(crate) fn new(recording: &Recording, topic: &str) -> Self {
        // The next child starts when the last one's pictures are used up.
        let (sender, sessions) = sync_channel(0);
        let stop = Arc::new(AtomicBool::new(false));
        let (recording, name, stopped) = (recording.clone(), topic.to_owned(), stop.clone());
        let feeder = thread::spawn(move || feed(&recording, &name, &sender, &stopped));
        Self {
            name: topic.to_owned(),
            sessions: Some(sessions),
            feeder: Some(feeder),
            stop,
            current: None,
            size: None,
            last: None,
            ahead: None,
            warned: false,
        }
    }

    /// The picture of the message with that number, counted from 0. Numbers have to rise.
    ///
    /// # Errors
    /// The reason why it cannot be decoded.
    pub(crate) fn picture(&mut self, number: u64) -> MessageResult<DecodedImage> {
        loop {
            let next = match self.ahead.take() {
                None => self.advance()?,
                ahead => ahead,
            };
            match next {
                Some((found, _)) if found < number => {}
                Some((found, picture)) if found == number => return picture,
                later => {
                    self.ahead = later;
                    return Err(Video("ffmpeg cannot decode it"));
                }
            }
        }
    }

    /// The next picture that comes back; `None` after the last.
    fn advance(&mut self) -> MessageResult<Option<Numbered>> {
        loop {
            let session = match &mut self.current {
                Some(session) => session,
                None => match self.sessions.as_ref().and_then(|next| next.recv().ok()) {
                    Some(session) => self.current.insert(session?),
                    None => return Ok(None),
                },
            };
            match session.pictures.next(MAX_BYTES) {
                Ok(Some((time, bytes))) => {
                    let time = u64::try_from(time).unwrap_or(0);
                    return Ok(Some((time / 2, self.accept(time, bytes))));
                }
                Ok(None) => {}
                // It may still write, and would wait for a reader.
                Err(_) => drop(session.child.kill()),
            }
            self.end_session();
        }
    }

    /// The picture of a time: twice its number, and one more for a keyframe.
    fn accept(&mut self, time: u64, bytes: Vec<u8>) -> MessageResult<DecodedImage> {
        let (number, is_key) = (time / 2, time % 2 == 1);
        let follows = is_key || self.last.is_some_and(|last| last + 1 == number);
        self.last = None;
        if !follows {
            return Err(Video("ffmpeg cannot decode a message before it"));
        }
        let (width, height) = self.current.as_ref().map_or((0, 0), |s| s.pictures.size);
        let (width, height) = (width as usize, height as usize);
        let pixels = width.saturating_mul(height);
        let picture = if bytes.len() == pixels {
            Gray::from_vec(width, height, bytes).map(DecodedImage::Gray)
        } else if bytes.len() == pixels.saturating_mul(3) {
            DecodedImage::from_rgb(width, height, &bytes)
        } else {
            return Err(SizeChange(width, height));
        }?;
        self.last = Some(number);
        let first = *self.size.get_or_insert((width, height));
        if (width, height) != first {
            return Err(VideoSize((width, height), first));
        }
        Ok(picture)
    }

    /// Ends the current child, and warns once of its complaint if it failed.
    fn end_session(&mut self) {
        self.last = None;
        let Some(mut session) = self.current.take() else {
            return;
        };
        let has_failed = session.child.wait().is_ok_and(|status| !status.success());
        if has_failed && !std::mem::replace(&mut self.warned, true) {
            let line = ffmpeg::last_line(&mut session.said).unwrap_or_default();
            tracing::warn!("{}: ffmpeg: {line}", self.name);
        }
    }
}

impl Drop for VideoDecoder {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // The thread then can neither send a child nor write to one.
        (self.sessions, self.current) = (None, None);
        if let Some(feeder) = self.feeder.take() {
            let _ = feeder.join();
        }
    }
}

/// Writes the topic's pictures to children, and hands these over.
fn feed(recording: &Recording, topic: &str, to: &SyncSender<Result<Session>>, stop: &AtomicBool) {
    let mut order = PictureOrder::default();
    let mut input: Option<ChildStdin> = None;
    let mut number = 0;
    for file in recording.files() {
        let Ok(mut messages) = file.messages() else {
            continue;
        };
        // Damage is reported with the pairs.
        while let Ok(Some(event)) = messages.next() {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            let FileEvent::Message(channel, _, data) = event else {
                continue;
            };
            if channel.topic != topic {
                continue;
            }
            let packet = message::packet(channel, &data);
            let coded = order.take_in(&packet);
            number += 1;
            let (Ok(packet), Ok(coded)) = (packet, coded) else {
                continue;
            };
            if coded.is_new || input.is_none() && coded.is_key {
                // It ends once its input does.
                drop(input.take());
                let session = start(coded.codec).map(|(session, stdin)| {
                    input = Some(stdin);
                    session
                });
                if to.send(session).is_err() {
                    return;
                }
            }
            let time = 2 * (number - 1) + u64::from(coded.is_key);
            let written = input.as_mut().map(|input| write(input, time, &packet.data));
            if !matches!(written, Some(Ok(()))) {
                // The child has ended: the next keyframe gets another.
                input = None;
            }
        }
    }
}

/// Starts a child, with IVF's header written.
fn start(codec: Codec) -> Result<(Session, ChildStdin)> {
    let mut command = Command::new("ffmpeg");
    command.args(INPUT.split(' ')).arg(codec.name());
    command.args(OUTPUT.split(' '));
    command.args(ffmpeg::SCALER).args(PIXELS.split(' '));
    let (mut child, said) = ffmpeg::start("ffmpeg", command.stdin(Stdio::piped()))?;
    let (Some(mut stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
        return Err(Error::Invalid("ffmpeg has no pipes".to_owned()));
    };
    // Version, length of the header, a codec, a size that ffmpeg ignores, 1000 units a second.
    let header: [&[u8]; 5] = [
        b"DKIF\0\0\x20\0H264",
        &[16, 0, 16, 0],
        &1000_u32.to_le_bytes(),
        &1_u32.to_le_bytes(),
        &[0; 8],
    ];
    // A child that ended is noticed with the first picture.
    let _ = stdin.write_all(&header.concat());
    let pictures = RawPictures::new(BufReader::new(stdout));
    let session = Session {
        child,
        said,
        pictures,
    };
    Ok((session, stdin))
}

/// Writes a picture with IVF's header.
fn write(input: &mut ChildStdin, time: u64, picture: &[u8]) -> std::io::Result<()> {
    let size = u32::try_from(picture.len()).map_err(|_| std::io::ErrorKind::InvalidInput)?;
    input.write_all(&size.to_le_bytes())?;
    input.write_all(&time.to_le_bytes())?;
    input.write_all(picture)
}
