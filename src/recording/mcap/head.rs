//! What a file that is not MCAP is, by its first bytes.

use std::path::Path;
use svl_core::bounded::stand_in;

/// Description of a file that begins with `start` and is not MCAP, with the remedy.
pub(crate) fn not_mcap(path: &Path, start: &[u8]) -> String {
    if let Some(why) = stand_in(start) {
        return why.to_owned();
    }
    // `#ROSBAG V2.0` is read.
    if start.starts_with(b"#ROSBAG ") {
        let bag = path.display();
        return format!(
            "is a ROS 1 bag of another format than 2.0; `rosbag fix {bag} NEW.bag` of ROS 1 \
             renews it"
        );
    }
    "is not an MCAP file, nor a bag of ROS 2 in SQLite or of ROS 1; svl reads these (.mcap, .db3, \
     .bag)"
        .to_owned()
}
