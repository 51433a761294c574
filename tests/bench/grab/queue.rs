//! The queue to the writer: in = out + dropped, for every policy.

use super::stage::{Stage, Triggered, adds_up, slow};
use svl::grab::{Pushed, Queue, Rule, WhenFull, camera_error};

#[test]
fn a_full_queue_drops_what_comes() {
    let queue = Queue::new(3, WhenFull::Drop);
    assert_eq!([0, 1, 2].map(|i| queue.push(i)), [Pushed::Taken; 3]);
    assert_eq!([3, 4].map(|i| queue.push(i)), [Pushed::Dropped; 2]);
    assert_eq!(queue.pop().unwrap(), Some(0));
    assert_eq!(queue.push(5), Pushed::Taken);
    queue.close(Ok(()));
    let rest: Vec<_> = std::iter::from_fn(|| queue.pop().unwrap()).collect();
    assert_eq!(rest, [1, 2, 5]);
}

#[test]
fn a_full_queue_waits_for_the_reader() {
    let queue = Queue::new(2, WhenFull::Wait);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            (0..100).for_each(|i| assert!(matches!(queue.push(i), Pushed::Taken | Pushed::Late)));
            queue.close(Ok(()));
        });
        assert!((0..100).all(|i| queue.pop().unwrap() == Some(i)));
        assert_eq!(queue.pop().unwrap(), None);
    });
}

#[test]
fn a_writer_that_waits_learns_that_the_reader_has_stopped() {
    let queue = Queue::new(1, WhenFull::Wait);
    assert_eq!(queue.push(0), Pushed::Taken);
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| queue.push(1));
        assert_eq!(queue.abandon(), 1);
        assert_eq!(writer.join().unwrap(), Pushed::Abandoned);
    });
}

#[test]
fn the_newest_replaces_the_one_that_waits() {
    let queue = Queue::new(1, WhenFull::Replace);
    assert_eq!(
        [0, 1, 2].map(|i| queue.push(i)),
        [Pushed::Taken, Pushed::Replaced, Pushed::Replaced]
    );
    assert_eq!(queue.pop().unwrap(), Some(2));
    assert_eq!(queue.push(3), Pushed::Taken);
}

#[test]
fn the_error_comes_after_the_last_item() {
    let queue = Queue::new(2, WhenFull::Drop);
    queue.push(7);
    queue.close(Err(camera_error("left camera", "gone")));
    assert_eq!(queue.pop().unwrap(), Some(7));
    assert_eq!(queue.pop().unwrap_err().to_string(), "left camera: gone");
    assert_eq!(queue.pop().unwrap(), None);
}

#[test]
fn every_pair_is_read_or_counted() {
    for when_full in [WhenFull::Drop, WhenFull::Wait, WhenFull::Replace] {
        let stage = Stage {
            queue: 2,
            when_full,
            ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
        };
        let mut grabber = stage.start(Triggered::WhenArmed, Rule::Trigger);
        // The clock runs as fast as it can meanwhile, so a queue of two fills at once.
        let frames: Vec<_> = (0..50)
            .map(|_| grabber.next_pair().unwrap().unwrap())
            .collect();
        let tally = adds_up(grabber.stop());
        assert_eq!(tally.pairs, 50 + tally.dropped + tally.unread, "{tally}");
        assert!((0..=1).contains(&(tally.pulses - tally.pairs)), "{tally}");
        let numbers = frames.iter().map(|frame| frame.sequence);
        match when_full {
            // Gaps in the numbers are the drops.
            WhenFull::Drop | WhenFull::Replace => assert!(numbers.is_sorted_by(|a, b| a < b)),
            WhenFull::Wait => {
                assert_eq!(tally.dropped, 0);
                assert!(numbers.eq(0..50));
            }
        }
    }
}
