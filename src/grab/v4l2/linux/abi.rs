//! Structures and ioctl requests of V4L2 (linux/videodev2.h), as far as svl needs them.

use rustix::fd::{AsFd, OwnedFd};
use rustix::io::{Errno, Result};
use rustix::ioctl::{Ioctl, IoctlOutput, Opcode, ioctl, opcode};
use std::ffi::{c_int, c_long, c_void};
use std::marker::PhantomData;

/// A request with the structure that it reads and writes.
pub(super) struct Request<T> {
    opcode: Opcode,
    structure: PhantomData<fn(T)>,
}

pub(super) const QUERYCAP: Request<Capability> = Request::new(opcode::read::<Capability>(b'V', 0));
pub(super) const ENUM_FMT: Request<FormatDescription> = Request::read_write(2);
pub(super) const S_FMT: Request<AbiFormat> = Request::read_write(5);
pub(super) const REQBUFS: Request<RequestBuffers> = Request::read_write(8);
pub(super) const QUERYBUF: Request<Buffer> = Request::read_write(9);
pub(super) const QBUF: Request<Buffer> = Request::read_write(15);
pub(super) const DQBUF: Request<Buffer> = Request::read_write(17);
pub(super) const STREAMON: Request<c_int> = Request::new(opcode::write::<c_int>(b'V', 18));
pub(super) const STREAMOFF: Request<c_int> = Request::new(opcode::write::<c_int>(b'V', 19));
pub(super) const S_PARM: Request<StreamParameters> = Request::read_write(22);
pub(super) const S_CTRL: Request<Control> = Request::read_write(28);
pub(super) const QUERYCTRL: Request<ControlQuery> = Request::read_write(36);
pub(super) const ENUM_FRAMESIZES: Request<FrameSize> = Request::read_write(74);
pub(super) const ENUM_FRAMEINTERVALS: Request<FrameInterval> = Request::read_write(75);

pub(super) const VIDEO_CAPTURE: u32 = 1;
pub(super) const MEMORY_MMAP: u32 = 1;

pub(super) const CAP_VIDEO_CAPTURE: u32 = 0x1;
pub(super) const CAP_VIDEO_CAPTURE_MPLANE: u32 = 0x1000;
pub(super) const CAP_STREAMING: u32 = 0x0400_0000;
pub(super) const CAP_DEVICE_CAPS: u32 = 0x8000_0000;
pub(super) const CAP_TIME_PER_FRAME: u32 = 0x1000;

pub(super) const FIELD_ANY: u32 = 0;
pub(super) const FIELD_NONE: u32 = 1;

pub(super) const FLAG_ERROR: u32 = 0x40;
pub(super) const FLAG_TIMESTAMP_MASK: u32 = 0xE000;
pub(super) const FLAG_TIMESTAMP_MONOTONIC: u32 = 0x2000;
pub(super) const FLAG_STAMPED_AT_MASK: u32 = 0x7_0000;
pub(super) const FLAG_STAMPED_AT_BEGIN: u32 = 0x1_0000;

pub(super) const CONTROL_DISABLED: u32 = 0x1;
pub(super) const CONTROL_READ_ONLY: u32 = 0x4;

pub(super) const AUTOGAIN: u32 = 0x0098_0912;
pub(super) const GAIN: u32 = 0x0098_0913;
pub(super) const EXPOSURE_AUTO: u32 = 0x009A_0901;
pub(super) const EXPOSURE_MANUAL: i32 = 1;
pub(super) const EXPOSURE_ABSOLUTE: u32 = 0x009A_0902;
pub(super) const EXPOSURE_AUTO_PRIORITY: u32 = 0x009A_0903;
pub(super) const ANALOGUE_GAIN: u32 = 0x009E_0903;

/// Discrete sizes or intervals; the other kinds are ranges.
pub(super) const DISCRETE: u32 = 1;

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct Capability {
    pub driver: [u8; 16],
    pub card: [u8; 32],
    pub bus_info: [u8; 32],
    pub version: u32,
    pub capabilities: u32,
    pub device_capabilities: u32,
    pub reserved: [u32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct FormatDescription {
    pub index: u32,
    pub kind: u32,
    pub flags: u32,
    pub description: [u8; 32],
    pub pixel_format: u32,
    pub bus_code: u32,
    pub reserved: [u32; 3],
}

/// v4l2_format. Its union contains pointers for other kinds of streams, so it is aligned like them.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct AbiFormat {
    pub kind: u32,
    // Takes no space; aligns the union as its pointers would.
    pub align: [usize; 0],
    pub width: u32,
    pub height: u32,
    pub pixel_format: u32,
    pub field: u32,
    pub bytes_per_line: u32,
    pub size_image: u32,
    pub color: [u32; 6],
    // Two arrays, as arrays beyond 32 elements have no `Default`.
    pub rest: [[u32; 19]; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct RequestBuffers {
    pub count: u32,
    pub kind: u32,
    pub memory: u32,
    pub capabilities: u32,
    pub flags: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct Buffer {
    pub index: u32,
    pub kind: u32,
    pub bytes_used: u32,
    pub flags: u32,
    pub field: u32,
    pub seconds: c_long,
    pub microseconds: c_long,
    pub timecode: [u32; 4],
    pub sequence: u32,
    pub memory: u32,
    pub location: BufferOffset,
    pub length: u32,
    pub reserved: [u32; 2],
}

/// Offset of a mapped buffer, in a union with pointers.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct BufferOffset {
    pub offset: u32,
    pub align: [usize; 0],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct StreamParameters {
    pub kind: u32,
    pub capability: u32,
    pub mode: u32,
    /// Seconds per frame, as a fraction.
    pub interval: [u32; 2],
    pub rest: [[u32; 23]; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct Control {
    pub id: u32,
    pub value: i32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct ControlQuery {
    pub id: u32,
    pub kind: u32,
    pub name: [u8; 32],
    pub minimum: i32,
    pub maximum: i32,
    pub step: i32,
    pub default: i32,
    pub flags: u32,
    pub reserved: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct FrameSize {
    pub index: u32,
    pub pixel_format: u32,
    pub kind: u32,
    /// Width and height, or least, greatest and step of the width, then of the height.
    pub sizes: [u32; 6],
    pub reserved: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
pub(super) struct FrameInterval {
    pub index: u32,
    pub pixel_format: u32,
    pub width: u32,
    pub height: u32,
    pub kind: u32,
    /// Seconds as a fraction: of the interval, or least, greatest and step.
    pub intervals: [u32; 6],
    pub reserved: [u32; 2],
}

impl<T> Request<T> {
    const fn new(opcode: Opcode) -> Self {
        Self {
            opcode,
            structure: PhantomData,
        }
    }

    const fn read_write(number: u8) -> Self {
        Self::new(opcode::read_write::<T>(b'V', number))
    }

    /// Calls the driver, and again after a signal.
    pub(super) fn call(&self, device: &OwnedFd, structure: &mut T) -> Result<()> {
        loop {
            let call = Call {
                opcode: self.opcode,
                structure: &mut *structure,
            };
            // SAFETY: the table above pairs each request with its structure, whose size is part of
            // the request's number.
            match unsafe { ioctl(device.as_fd(), call) } {
                Err(Errno::INTR) => {}
                done => return done,
            }
        }
    }
}

struct Call<'a, T> {
    opcode: Opcode,
    structure: &'a mut T,
}

// SAFETY: `as_ptr` is valid for reads and writes of T as long as the call lives, and nothing is
// read back through it.
unsafe impl<T> Ioctl for Call<'_, T> {
    type Output = ();
    const IS_MUTATING: bool = true;

    fn opcode(&self) -> Opcode {
        self.opcode
    }

    fn as_ptr(&mut self) -> *mut c_void {
        std::ptr::from_mut(self.structure).cast()
    }

    unsafe fn output_from_ptr(_: IoctlOutput, _: *mut c_void) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    /// Sizes and offsets that gcc has for linux/videodev2.h on x86-64 and on AArch64. The number of
    /// a request contains the size of its structure.
    #[test]
    #[cfg(target_pointer_width = "64")]
    fn structures_are_the_kernels() {
        let requests = [
            (QUERYCAP.opcode, 0x8068_5600),
            (ENUM_FMT.opcode, 0xC040_5602),
            (S_FMT.opcode, 0xC0D0_5605),
            (REQBUFS.opcode, 0xC014_5608),
            (QUERYBUF.opcode, 0xC058_5609),
            (QBUF.opcode, 0xC058_560F),
            (DQBUF.opcode, 0xC058_5611),
            (STREAMON.opcode, 0x4004_5612),
            (STREAMOFF.opcode, 0x4004_5613),
            (S_PARM.opcode, 0xC0CC_5616),
            (S_CTRL.opcode, 0xC008_561C),
            (QUERYCTRL.opcode, 0xC044_5624),
            (ENUM_FRAMESIZES.opcode, 0xC02C_564A),
            (ENUM_FRAMEINTERVALS.opcode, 0xC034_564B),
        ];
        for (ours, kernels) in requests {
            assert_eq!(ours, kernels, "{ours:x} is not {kernels:x}");
        }
        let offsets = [
            (offset_of!(Capability, device_capabilities), 88),
            (offset_of!(FormatDescription, pixel_format), 44),
            (offset_of!(AbiFormat, width), 8),
            (offset_of!(AbiFormat, size_image), 28),
            (offset_of!(Buffer, seconds), 24),
            (offset_of!(Buffer, sequence), 56),
            (offset_of!(Buffer, location), 64),
            (offset_of!(Buffer, length), 72),
            (offset_of!(StreamParameters, interval), 12),
            (offset_of!(ControlQuery, minimum), 40),
            (offset_of!(ControlQuery, flags), 56),
            (offset_of!(FrameSize, sizes), 12),
            (offset_of!(FrameInterval, intervals), 20),
        ];
        for (index, (ours, kernels)) in offsets.into_iter().enumerate() {
            assert_eq!(ours, kernels, "entry {index}");
        }
    }
}
