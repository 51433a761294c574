//! Downloads one file over HTTP, resuming an earlier download.

use super::{CHUNK, STOPPED, Watch, unfinished};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;
use svl_core::{Error, Result};
use ureq::http::{Response, StatusCode, header};
use ureq::{Agent, Body};

/// Limit on a file's size in bytes: four times the largest archive of a data set.
const MAX_BYTES: u64 = 8 << 30;

/// Limit on consecutive connections that break before any byte arrived.
const MAX_IDLE_BREAKS: u32 = 3;

/// Downloads `url` to `path`, which must not exist. Until it is complete the file is named
/// `path.part`; an existing one is resumed (RFC 9110, section 14), also after a broken connection.
/// A change of the published file in between is detected by the archive's CRCs and the receipts.
///
/// # Errors
/// [`Error::Download`] with the remedy: no network, no such file, an answer that is not the file,
/// or `watch` returned false; the part received is kept. [`Error::Io`].
pub fn download(url: &str, path: &Path, watch: Watch<'_>) -> Result<()> {
    let part = unfinished(path);
    let agent = agent();
    let mut idle_breaks = 0;
    loop {
        let before = length(&part);
        match attempt(&agent, url, &part, watch)? {
            Attempt::Whole => break,
            Attempt::Broken(reason) => {
                // Progress resets the count: slow connections may break any number of times.
                idle_breaks = if length(&part) > before {
                    0
                } else {
                    idle_breaks + 1
                };
                if idle_breaks == MAX_IDLE_BREAKS {
                    let reason = format!(
                        "broke off after {} bytes ({reason}); run it again to resume",
                        length(&part)
                    );
                    return Err(Error::download(url, reason));
                }
            }
            Attempt::Stale => std::fs::remove_file(&part).map_err(|e| Error::io(&part, e))?,
        }
    }
    std::fs::rename(&part, path).map_err(|e| Error::io(path, e))
}

/// Outcome of one request.
enum Attempt {
    Whole,
    Broken(String),
    /// The partial file is longer than the published one: it belongs to another file.
    Stale,
}

fn agent() -> Agent {
    let config = Agent::config_builder()
        // The status decides the next step: 416 means the partial file is complete or stale.
        .http_status_as_error(false)
        .user_agent(format!("svl/{}", crate::BuildInfo::current().version))
        .timeout_connect(Some(Duration::from_secs(20)))
        .timeout_recv_response(Some(Duration::from_secs(60)))
        .timeout_per_read(Some(Duration::from_secs(60)));
    config.build().new_agent()
}

fn attempt(agent: &Agent, url: &str, part: &Path, watch: Watch<'_>) -> Result<Attempt> {
    let mut done = length(part);
    // With compression, ranges would count bytes other than those of the file.
    let mut request = agent.get(url).header(header::ACCEPT_ENCODING, "identity");
    if done > 0 {
        request = request.header(header::RANGE, format!("bytes={done}-"));
    }
    let mut response = request.call().map_err(|e| unreachable(url, &e))?;
    let total = match response.status() {
        StatusCode::PARTIAL_CONTENT => match range(&response) {
            Some((Some(start), total)) if start == done => total,
            _ => {
                return Err(Error::download(
                    url,
                    "the server sends another part than requested; try a mirror",
                ));
            }
        },
        // The server does not support ranges: start over.
        StatusCode::OK => {
            done = 0;
            response.body().content_length()
        }
        StatusCode::RANGE_NOT_SATISFIABLE if done > 0 => {
            return Ok(if range(&response) == Some((None, Some(done))) {
                Attempt::Whole
            } else {
                Attempt::Stale
            });
        }
        status => return Err(refused(url, status)),
    };
    if total.is_some_and(|total| total > MAX_BYTES) {
        return Err(too_large(url));
    }
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(part)
        .map_err(|e| Error::io(part, e))?;
    // Truncated to the counted bytes, so that a server without ranges starts at 0.
    file.set_len(done).map_err(|e| Error::io(part, e))?;
    let came = receive(
        url,
        response.body_mut(),
        &mut file,
        (done, total),
        part,
        watch,
    )?;
    file.sync_all().map_err(|e| Error::io(part, e))?;
    Ok(came)
}

fn receive(
    url: &str,
    body: &mut Body,
    file: &mut File,
    (mut done, total): (u64, Option<u64>),
    part: &Path,
    watch: Watch<'_>,
) -> Result<Attempt> {
    let mut body = body.as_reader();
    let mut chunk = vec![0; CHUNK];
    loop {
        if !watch(done, total) {
            return Err(Error::download(url, STOPPED));
        }
        match body.read(&mut chunk) {
            Ok(0) if total.is_some_and(|total| done < total) => {
                return Ok(Attempt::Broken("cut short".into()));
            }
            Ok(0) => return Ok(Attempt::Whole),
            Ok(n) => {
                file.write_all(&chunk[..n])
                    .map_err(|e| Error::io(part, e))?;
                done += n as u64;
            }
            Err(error) => return Ok(Attempt::Broken(error.to_string())),
        }
        // A server may send more than it announced.
        if done > total.unwrap_or(MAX_BYTES) {
            return Err(too_large(url));
        }
    }
}

/// First byte and total length in `Content-Range`: `bytes 5-9/10`, `bytes 5-9/*`, or `bytes */10`.
fn range(response: &Response<Body>) -> Option<(Option<u64>, Option<u64>)> {
    let text = response
        .headers()
        .get(header::CONTENT_RANGE)?
        .to_str()
        .ok()?;
    let (span, total) = text.strip_prefix("bytes ")?.split_once('/')?;
    Some((
        span.split_once('-')
            .and_then(|(start, _)| start.parse().ok()),
        total.parse().ok(),
    ))
}

fn length(path: &Path) -> u64 {
    path.metadata().map_or(0, |m| m.len())
}

fn unreachable(url: &str, error: &ureq::Error) -> Error {
    if let ureq::Error::BadUri(_) | ureq::Error::Http(_) = error {
        return Error::download(
            url,
            format!("not an address ({error}); expected http://... or https://..."),
        );
    }
    let cure = "check the network, or get the file elsewhere and name its folder with --from DIR";
    Error::download(url, format!("cannot be reached ({error}); {cure}"))
}

fn refused(url: &str, status: StatusCode) -> Error {
    let what = match status {
        StatusCode::NOT_FOUND | StatusCode::GONE => {
            "no such file there; it may have moved: see the home page"
        }
        StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN => {
            "not given to everyone; get it from the home page"
        }
        status if status.is_server_error() => "the server has a problem; try again later",
        _ => "the server does not send the file; try again later",
    };
    Error::download(
        url,
        format!(
            "{what}, or name a mirror or a folder with --from (HTTP status {})",
            status.as_u16()
        ),
    )
}

fn too_large(url: &str) -> Error {
    Error::download(
        url,
        format!("is larger than it says or than the {MAX_BYTES} bytes svl accepts; try a mirror"),
    )
}
