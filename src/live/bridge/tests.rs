//! Bridges that follow the protocol, and those that do not.

use super::*;
use std::net::TcpListener;
use std::thread::JoinHandle;
use tungstenite::handshake::server::{Request, Response};

const ADVERTISE: &str = r#"{"op":"advertise","channels":[
    {"id":1,"topic":"/left","encoding":"cdr","schemaName":"sensor_msgs/msg/Image","schema":""},
    {"id":2,"topic":"/right","encoding":"protobuf","schemaName":"foxglove.RawImage","schema":""},
    {"id":3,"topic":"/left","encoding":"cdr","schemaName":"std_msgs/msg/String","schema":""}]}"#;

/// A server on a free port that does `act` with its first connection.
fn server(act: impl FnOnce(TcpStream) + Send + 'static) -> (BridgeAddress, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let thread = std::thread::spawn(move || act(listener.accept().unwrap().0));
    let address = format!("foxglove:ws://127.0.0.1:{port}").parse().unwrap();
    (address, thread)
}

/// The server's end, after the handshake.
#[allow(clippy::result_large_err, reason = "the error's type is tungstenite's")]
fn accept(stream: TcpStream) -> WebSocket<TcpStream> {
    let choose = |request: &Request, mut response: Response| {
        assert_eq!(request.headers()["Sec-WebSocket-Protocol"], PROTOCOLS);
        let chosen = HeaderValue::from_static("foxglove.websocket.v1");
        response
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", chosen);
        Ok(response)
    };
    tungstenite::accept_hdr(stream, choose).unwrap()
}

/// A bridge that sends these bytes after its handshake, and closes the connection if `closes`.
fn sending(bytes: Vec<u8>, closes: bool) -> Bridge {
    let (address, _) = server(move |stream| {
        let mut stream = accept(stream).get_ref().try_clone().unwrap();
        // The client may be gone.
        let _ = stream.write_all(&bytes);
        if !closes {
            let _ = stream.read(&mut [0]);
        }
    });
    Bridge::connect(&address).unwrap()
}

/// A whole frame: operation, length, bytes.
fn frame(operation: u8, bytes: &[u8]) -> Vec<u8> {
    let length = (bytes.len() as u64).to_be_bytes();
    [&[0x80 | operation, 127], &length[..], bytes].concat()
}

/// Receives until an error, which is its last line.
fn error(mut bridge: Bridge) -> String {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        match bridge.receive(LOOK, |_, _| panic!("nothing is subscribed")) {
            Ok(()) => {}
            Err(error) => return error.to_string(),
        }
    }
    panic!("no error")
}

#[test]
fn a_topic_that_returns_is_received_again() {
    let (address, thread) = server(|stream| {
        let mut socket = accept(stream);
        socket.send(Message::text(ADVERTISE)).unwrap();
        for id in [1, 4] {
            let subscribed = loop {
                if let Message::Text(text) = socket.read().unwrap() {
                    break serde_json::from_str::<serde_json::Value>(&text).unwrap();
                }
            };
            let subscription = &subscribed["subscriptions"][0];
            assert_eq!(subscription["channelId"], id);
            let number = subscription["id"].as_u64().unwrap() as u32;
            let head = [&[1][..], &number.to_le_bytes(), &[0; 8]].concat();
            // A time, an unknown subscription, a message cut short, and one of the topic.
            for bytes in [
                &[2; 9][..],
                &[1; 20],
                &head[..12],
                &[&head, &b"cdr"[..]].concat(),
            ] {
                socket.send(Message::binary(bytes.to_vec())).unwrap();
            }
            let back = r#"{"op":"advertise","channels":[{"id":4,"topic":"/left","encoding":"cdr",
                "schemaName":"sensor_msgs/msg/Image"}]}"#;
            for text in [r#"{"op":"unadvertise","channelIds":[1]}"#, back, back] {
                socket.send(Message::text(text)).unwrap();
            }
        }
    });
    let mut bridge = Bridge::connect(&address).unwrap();
    let found = loop {
        let found = bridge.topics().unwrap();
        if !found.is_empty() {
            break found;
        }
    };
    let names: Vec<_> = found
        .iter()
        .map(|found| found.topic.name.as_str())
        .collect();
    assert_eq!((names, found[0].publishers), (vec!["/left"], 2));
    bridge.subscribe(&found).unwrap();
    let mut received = Vec::new();
    let end = Instant::now() + Duration::from_secs(20);
    while received.len() < 2 && Instant::now() < end {
        bridge
            .receive(LOOK, |topic, data| received.push((topic, data)))
            .unwrap();
    }
    assert_eq!(received, [(0, b"cdr".to_vec()), (0, b"cdr".to_vec())]);
    let other = bridge.other_type(0);
    assert_eq!(other.as_deref(), Some("std_msgs/msg/String"));
    drop(bridge);
    thread.join().unwrap();
}

#[test]
fn a_bridge_that_breaks_the_protocol_is_an_error_in_a_line() {
    let beyond = (MAX_BYTES as u64 + 1).to_be_bytes();
    let channels: Vec<_> = (0..=MAX_CHANNELS)
        .map(|id| format!(r#"{{"id":{id},"topic":"/a","encoding":"cdr","schemaName":"b"}}"#))
        .collect();
    let many = format!(
        r#"{{"op":"advertise","channels":[{}]}}"#,
        channels.join(",")
    );
    for (bytes, words) in [
        (vec![], "without closing handshake"),
        // Ends within a frame.
        (
            vec![0x82, 127, 0, 0, 0, 0, 0, 1, 0, 0, 7, 7],
            "without closing",
        ),
        // Sizes that are lies, and one that is too large.
        ([&[0x82, 127], &[0xff; 8][..]].concat(), "too long"),
        ([&[0x82, 127], &beyond[..]].concat(), "too long"),
        (frame(3, b""), "invalid opcode"),
        (frame(1, b"\xff\xfe"), "UTF-8"),
        (frame(8, b""), "closed"),
        (frame(1, many.as_bytes()), "more than 10000 channels"),
    ] {
        let error = error(sending(bytes, true));
        assert!(error.contains("the bridge: "), "{error}");
        assert!(
            error.to_lowercase().contains(&words.to_lowercase()),
            "{words}: {error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn unknown_messages_do_not_end_a_connection() {
    let texts = [
        "no JSON",
        "[]",
        "{}",
        r#"{"op":"status","level":2,"message":"full\n\u0007"}"#,
    ];
    let texts = texts.map(|text| frame(1, text.as_bytes()));
    let rest = [
        frame(2, &[]),
        frame(2, &[9; 99]),
        frame(1, ADVERTISE.as_bytes()),
    ];
    let mut bridge = sending([texts.concat(), rest.concat()].concat(), false);
    let end = Instant::now() + Duration::from_secs(20);
    while bridge.topics().unwrap().is_empty() {
        assert!(Instant::now() < end);
    }
    let one_line = |words: &String| !words.contains(char::is_control);
    assert!(bridge.warnings.iter().all(one_line));
    // Three texts, the status, and the topic in another encoding.
    let other = bridge
        .warnings
        .iter()
        .filter(|words| words.contains("/right: "));
    assert_eq!(
        (bridge.warnings.len(), other.count()),
        (5, 1),
        "{:?}",
        bridge.warnings
    );
}

#[test]
fn a_slow_bridge_is_waited_for_no_longer_than_the_limit() {
    let (address, _) = server(|stream| {
        let mut stream = accept(stream).get_ref().try_clone().unwrap();
        stream
            .write_all(&[0x82, 127, 0, 0, 0, 0, 0, 1, 0, 0])
            .unwrap();
        while stream.write_all(&[0]).is_ok() {
            std::thread::sleep(Duration::from_millis(2));
        }
    });
    let mut bridge = Bridge::connect(&address).unwrap();
    let began = Instant::now();
    bridge.receive(LOOK, |_, _| {}).unwrap();
    assert!(began.elapsed() < Duration::from_secs(2));
}

#[test]
fn other_servers_are_refused() {
    for answer in [
        "",
        "HTTP/1.1 200 OK\r\n\r\n",
        "SSH-2.0-x\r\n",
        "\r\n\r\n\r\n",
    ] {
        let (address, _) = server(move |mut stream| {
            let _ = stream.read(&mut [0; 4096]);
            let _ = stream.write_all(answer.as_bytes());
        });
        let error = Bridge::connect(&address).err().unwrap().to_string();
        assert!(error.contains("no bridge: "), "{error}");
    }
}
