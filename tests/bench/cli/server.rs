//! A local file server that behaves, or misbehaves, as a test requests.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

#[derive(Default)]
pub struct Manners {
    /// True if `Range` is honoured.
    pub ranges: bool,
    /// Breaks each connection off after that many bytes of the file.
    pub breaks_after: Option<usize>,
    /// Omits the length of the file.
    pub silent_length: bool,
    /// Sends a little at a time.
    pub drips: bool,
}

pub struct Server {
    pub url: String,
    asked: Arc<Mutex<Vec<String>>>,
}

impl Server {
    /// Serves until the test ends.
    pub fn new(files: &[(&str, Vec<u8>)], manners: Manners) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let files: HashMap<_, _> = files
            .iter()
            .map(|(name, bytes)| (format!("/{name}"), bytes.clone()))
            .collect();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let log = asked.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                // A client that hangs up does not concern the test.
                let _ = stream.and_then(|stream| answer(stream, &files, &manners, &log));
            }
        });
        Self { url, asked }
    }

    /// The requests: the path, and the range if there was one.
    pub fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }
}

fn answer(
    mut stream: TcpStream,
    files: &HashMap<String, Vec<u8>>,
    manners: &Manners,
    log: &Mutex<Vec<String>>,
) -> std::io::Result<()> {
    let lines: Vec<String> = BufReader::new(stream.try_clone()?)
        .lines()
        .map_while(Result::ok)
        .take_while(|line| !line.is_empty())
        .collect();
    let path = lines[0].split(' ').nth(1).unwrap();
    let range = lines.iter().find_map(|line| {
        line.to_lowercase()
            .strip_prefix("range: bytes=")
            .map(str::to_owned)
    });
    log.lock().unwrap().push(match &range {
        Some(range) => format!("{path} {range}"),
        None => path.to_owned(),
    });
    let Some(file) = files.get(path) else {
        return write!(
            stream,
            "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
        );
    };
    let start = range
        .filter(|_| manners.ranges)
        .map(|r| r.trim_end_matches('-').parse::<usize>().unwrap());
    let total = file.len();
    match start {
        Some(start) if start >= total => {
            let head =
                format!("HTTP/1.1 416 Range Not Satisfiable\r\nContent-Range: bytes */{total}\r\n");
            return write!(
                stream,
                "{head}Content-Length: 0\r\nConnection: close\r\n\r\n"
            );
        }
        Some(start) => {
            write!(
                stream,
                "HTTP/1.1 206 Partial Content\r\nContent-Range: bytes {start}-{}/{total}\r\n",
                total - 1
            )?;
        }
        None => write!(stream, "HTTP/1.1 200 OK\r\n")?,
    }
    let body = &file[start.unwrap_or(0)..];
    if !manners.silent_length {
        write!(stream, "Content-Length: {}\r\n", body.len())?;
    }
    write!(stream, "Connection: close\r\n\r\n")?;
    let body = &body[..manners.breaks_after.unwrap_or(body.len()).min(body.len())];
    for drop in body.chunks(if manners.drips { 500 } else { usize::MAX }) {
        stream.write_all(drop)?;
        if manners.drips {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }
    Ok(())
}
