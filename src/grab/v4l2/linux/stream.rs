//! The stream of a video device, in buffers mapped into this process.

use super::abi::{
    self, CONTROL_DISABLED, CONTROL_READ_ONLY, FLAG_ERROR, MEMORY_MMAP, VIDEO_CAPTURE,
};
use super::device::V4l2Device;
use super::stamp::BufferStamp;
use crate::camera_error;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::time::{ClockId, clock_gettime};
use std::ffi::c_void;
use std::time::Duration;
use svl_core::Result;

/// Values of a control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ControlRange {
    pub min: i32,
    pub max: i32,
    pub step: i32,
}

impl ControlRange {
    pub(super) const fn new(min: i32, max: i32, step: i32) -> Self {
        Self { min, max, step }
    }
}

/// A camera whose stream is running. Tests implement it with faults.
pub(super) trait VideoStream: Send {
    /// The range of a control, if the camera has it.
    fn range(&self, control: u32) -> Option<ControlRange>;

    /// Sets a control and returns its value: a driver uses the nearest it has.
    ///
    /// # Errors
    /// The driver's.
    fn set(&mut self, control: u32, value: i32) -> rustix::io::Result<i32>;

    /// Waits for the next filled buffer, and passes it to `read` before the driver fills it again.
    /// `None` if none arrived.
    ///
    /// # Errors
    /// [`Fault`].
    fn next<T>(
        &mut self,
        timeout: Duration,
        read: impl FnOnce(&[u8], BufferStamp) -> T,
    ) -> std::result::Result<Option<T>, Fault>;
}

/// A fault of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// One buffer is damaged; the next may be intact.
    Buffer(&'static str),
    /// The stream has ended.
    Stream(Errno),
}

/// Enough that a late thread loses no image; a driver may demand more.
const BUFFERS: u32 = 4;
const MAX_BUFFERS: u32 = 32;

/// A running stream. Dropping it ends it.
pub(super) struct MappedStream {
    // Unmapped before the device is closed.
    buffers: Vec<Mapping>,
    device: OwnedFd,
}

/// The current time on the clock of the drivers' stamps.
pub(super) fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

impl MappedStream {
    /// # Errors
    /// [`crate::CameraError`] if the driver refuses.
    pub(super) fn start(device: V4l2Device) -> Result<Self> {
        let name = device.name.clone();
        let mut stream = Self {
            buffers: Vec::new(),
            device: device.file,
        };
        stream
            .prepare()
            .map_err(|errno| camera_error(name, super::device::trouble(errno)))?;
        Ok(stream)
    }

    fn prepare(&mut self) -> rustix::io::Result<()> {
        let mut request = abi::RequestBuffers {
            count: BUFFERS,
            kind: VIDEO_CAPTURE,
            memory: MEMORY_MMAP,
            ..Default::default()
        };
        abi::REQBUFS.call(&self.device, &mut request)?;
        // Drivers may grant fewer buffers than requested, even none.
        if request.count == 0 {
            return Err(Errno::NOMEM);
        }
        // A driver may also insist on more.
        for index in 0..request.count.min(MAX_BUFFERS) {
            let mut buffer = buffer(index);
            abi::QUERYBUF.call(&self.device, &mut buffer)?;
            self.buffers.push(Mapping::new(
                &self.device,
                buffer.location.offset,
                buffer.length as usize,
            )?);
            self.give(index)?;
        }
        abi::STREAMON.call(&self.device, &mut (VIDEO_CAPTURE as i32))
    }

    /// Returns a buffer to the driver.
    fn give(&self, index: u32) -> rustix::io::Result<()> {
        abi::QBUF.call(&self.device, &mut buffer(index))
    }
}

fn buffer(index: u32) -> abi::Buffer {
    abi::Buffer {
        index,
        kind: VIDEO_CAPTURE,
        memory: MEMORY_MMAP,
        ..Default::default()
    }
}

impl VideoStream for MappedStream {
    fn range(&self, control: u32) -> Option<ControlRange> {
        let mut query = abi::ControlQuery {
            id: control,
            ..Default::default()
        };
        abi::QUERYCTRL.call(&self.device, &mut query).ok()?;
        let range = ControlRange::new(query.minimum, query.maximum, query.step);
        let can_be_set = query.flags & (CONTROL_DISABLED | CONTROL_READ_ONLY) == 0;
        (can_be_set && range.min <= range.max).then_some(range)
    }

    fn set(&mut self, control: u32, value: i32) -> rustix::io::Result<i32> {
        let mut set = abi::Control { id: control, value };
        abi::S_CTRL.call(&self.device, &mut set)?;
        Ok(set.value)
    }

    fn next<T>(
        &mut self,
        timeout: Duration,
        read: impl FnOnce(&[u8], BufferStamp) -> T,
    ) -> std::result::Result<Option<T>, Fault> {
        let mut waiting = [PollFd::new(&self.device, PollFlags::IN)];
        let timeout = Timespec {
            tv_sec: timeout.as_secs() as i64,
            tv_nsec: timeout.subsec_nanos().into(),
        };
        match poll(&mut waiting, Some(&timeout)) {
            Ok(0) | Err(Errno::INTR) => return Ok(None),
            Ok(_) => {}
            Err(errno) => return Err(Fault::Stream(errno)),
        }
        // An unplugged camera signals an error and stays readable: without this the thread would
        // spin.
        let has_ended = waiting[0]
            .revents()
            .intersects(PollFlags::ERR | PollFlags::HUP | PollFlags::NVAL);
        let mut filled = buffer(0);
        match abi::DQBUF.call(&self.device, &mut filled) {
            Ok(()) => {}
            Err(Errno::AGAIN) if !has_ended => return Ok(None),
            // According to the V4L2 documentation EIO may be a lost frame that the stream survives.
            Err(Errno::IO) if !has_ended => return Err(Fault::Buffer("its driver lost it")),
            Err(Errno::AGAIN) => return Err(Fault::Stream(Errno::IO)),
            Err(errno) => return Err(Fault::Stream(errno)),
        }
        let Some(mapping) = self.buffers.get(filled.index as usize) else {
            return Err(Fault::Stream(Errno::IO));
        };
        let stamp = BufferStamp {
            ns: (filled.seconds as u64)
                .wrapping_mul(1_000_000_000)
                .wrapping_add((filled.microseconds as u64).wrapping_mul(1000)),
            flags: filled.flags,
            arrived_ns: monotonic_ns(),
        };
        // The driver owns the buffer again after QBUF, so it is read before that.
        let given = match mapping.bytes().get(..filled.bytes_used as usize) {
            _ if filled.flags & FLAG_ERROR != 0 => Err(Fault::Buffer("its driver says so")),
            None => Err(Fault::Buffer("more bytes than its buffer has")),
            Some(data) => Ok(Some(read(data, stamp))),
        };
        self.give(filled.index).map_err(Fault::Stream)?;
        given
    }
}

impl Drop for MappedStream {
    fn drop(&mut self) {
        // Fails if the device is gone, which has ended the stream.
        let _ = abi::STREAMOFF.call(&self.device, &mut (VIDEO_CAPTURE as i32));
    }
}

/// A buffer of the driver, mapped into this process.
struct Mapping {
    start: *mut c_void,
    length: usize,
}

// SAFETY: only this struct knows the mapping, which belongs to the process and not to a thread.
unsafe impl Send for Mapping {}

impl Mapping {
    fn new(device: &OwnedFd, offset: u32, length: usize) -> rustix::io::Result<Self> {
        // SAFETY: a new mapping at an address chosen by the kernel overlaps nothing.
        let start = unsafe {
            mmap(
                std::ptr::null_mut(),
                length,
                ProtFlags::READ,
                MapFlags::SHARED,
                device,
                offset.into(),
            )?
        };
        Ok(Self { start, length })
    }

    /// The buffer's bytes. Only valid while the driver has it dequeued.
    fn bytes(&self) -> &[u8] {
        // SAFETY: `length` bytes are mapped there until this is dropped, and a driver writes only
        // to buffers returned to it.
        unsafe { std::slice::from_raw_parts(self.start.cast(), self.length) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: created by `new`, and no slice of it outlives it.
        let _ = unsafe { munmap(self.start, self.length) };
    }
}
