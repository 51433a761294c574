//! A GenICam camera: arm, capture, stamps.

use super::device::{GenicamDevice, TriggerMode};
use crate::camera::{Camera, Capture, Limits, Settings, Taken};
use crate::clock::GrabClock;
use crate::device_clock::DeviceClock;
use aravis::glib::prelude::Cast;
use aravis::prelude::*;
use aravis::{Buffer, BufferStatus, GvStream, GvStreamSocketBuffer, PixelFormat, Stream};
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use svl_core::Result;
use svl_core::stereo::Gray;

/// Images that may be in transfer at once.
const BUFFERS: usize = 8;
/// Largest image: a larger payload size is rejected.
const MAX_BYTES: u32 = 1 << 28;

/// One GigE Vision or USB3 Vision camera, exposing since it was opened.
pub struct GenicamCamera {
    stream: Stream,
    device: Arc<GenicamDevice>,
    clock: Arc<GrabClock>,
    device_clock: DeviceClock,
    limits: Limits,
    /// Settings ordered, settings in effect, and the time since when.
    settings: Option<(Settings, Settings, u64)>,
    size: [i32; 2],
}

impl GenicamCamera {
    pub(super) fn open(name: &str, mode: TriggerMode, clock: &Arc<GrabClock>) -> Result<Self> {
        let device = GenicamDevice::open(name)?;
        device.prepare(mode)?;
        let limits = device.limits()?;
        let size =
            device.ask(|camera| camera.region().map(|(_, _, width, height)| [width, height]))?;
        let bytes = device.ask(|camera| camera.payload())?;
        if bytes > MAX_BYTES {
            return Err(device.error(format!(
                "has images of {bytes} bytes, at most {MAX_BYTES}; set a smaller region"
            )));
        }
        let stream = device.ask(|camera| camera.create_stream())?;
        if let Some(stream) = stream.downcast_ref::<GvStream>() {
            // The system's default is smaller than an image, and packets would be lost.
            stream.set_socket_buffer(GvStreamSocketBuffer::Auto);
        }
        (0..BUFFERS).for_each(|_| stream.push_buffer(Buffer::new_allocate(bytes as usize)));
        device.ask(|camera| camera.start_acquisition())?;
        let (device, clock, device_clock) =
            (Arc::new(device), clock.clone(), DeviceClock::default());
        Ok(Self {
            stream,
            device,
            clock,
            device_clock,
            limits,
            settings: None,
            size,
        })
    }

    pub(super) fn device(&self) -> Arc<GenicamDevice> {
        self.device.clone()
    }

    /// Width and height of its images.
    pub(super) fn size(&self) -> [i32; 2] {
        self.size
    }

    /// End of the exposure of an intact image.
    fn exposed_ns(&mut self, buffer: &Buffer, settings: Settings) -> u64 {
        // aravis stamps the arrival by the system's clock, which may be stepped; svl's is
        // monotonic. So only the age of the image is used.
        let now_ns = SystemTime::UNIX_EPOCH
            .elapsed()
            .map_or(0, |now| now.as_nanos() as u64);
        let age_ns = now_ns.saturating_sub(buffer.system_timestamp());
        let arrived_ns = self.clock.now_ns().saturating_sub(age_ns);
        match buffer.timestamp() {
            0 => arrived_ns,
            began_ns => self
                .device_clock
                .host_ns(began_ns.saturating_add(shutter_ns(settings)), arrived_ns),
        }
    }

    /// The outcome of a buffer; `None` before the first order.
    fn read(&mut self, buffer: &Buffer) -> Option<Taken> {
        let (ordered, settings, since_ns) = self.settings?;
        let status = buffer.status();
        if status != BufferStatus::Success {
            tracing::info!(
                "{}: image {} is damaged ({status:?})",
                self.device.name,
                buffer.frame_id()
            );
            return Some(Taken::Damaged);
        }
        let exposed_ns = self.exposed_ns(buffer, settings);
        let began_ns = exposed_ns.saturating_sub(shutter_ns(settings));
        // Exposed before the settings took effect.
        if began_ns < since_ns {
            return Some(Taken::Unready);
        }
        let Some(image) = image(buffer) else {
            tracing::info!(
                "{}: image {} does not have 8 bits",
                self.device.name,
                buffer.frame_id()
            );
            return Some(Taken::Damaged);
        };
        let stamp_ns = exposed_ns - shutter_ns(settings) / 2;
        Some(Taken::Image(Capture {
            image,
            stamp_ns,
            trigger_id: None,
            ordered,
            settings,
        }))
    }
}

fn shutter_ns(settings: Settings) -> u64 {
    u64::from(settings.shutter_us) * 1000
}

/// The grey image in an intact buffer.
fn image(buffer: &Buffer) -> Option<Gray> {
    if buffer.image_pixel_format() != PixelFormat::MONO_8 {
        return None;
    }
    let size = |pixels: i32| usize::try_from(pixels).ok().filter(|&pixels| pixels > 0);
    let (width, height) = (size(buffer.image_width())?, size(buffer.image_height())?);
    let stride = width + usize::try_from(buffer.image_padding().0).ok()?;
    let mut pixels = buffer.image_data();
    if stride > width {
        pixels = pixels
            .chunks_exact(stride)
            .flat_map(|row| &row[..width])
            .copied()
            .collect();
    }
    // Buffers are as large as the payload, which may have chunk data after the image.
    pixels.truncate(width.checked_mul(height)?);
    Gray::from_vec(width, height, pixels).ok()
}

impl Camera for GenicamCamera {
    fn name(&self) -> String {
        self.device.name.clone()
    }

    fn limits(&self) -> Limits {
        self.limits.clone()
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        // Otherwise a disconnected camera would look like a slow one.
        self.device.answers()?;
        if self.settings.is_none_or(|(before, ..)| before != settings) {
            let applied = self.device.expose(settings, &self.limits)?;
            self.settings = Some((settings, applied, self.clock.now_ns()));
        }
        // Images of pulses that had timed out: the next image must be of the next pulse.
        while let Some(buffer) = self.stream.try_pop_buffer() {
            self.stream.push_buffer(buffer);
        }
        Ok(())
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        let Some(buffer) = self.stream.timeout_pop_buffer(timeout.as_micros() as u64) else {
            return self.device.answers().map(|()| None);
        };
        let taken = self.read(&buffer);
        self.stream.push_buffer(buffer);
        Ok(taken)
    }
}

impl Drop for GenicamCamera {
    fn drop(&mut self) {
        if self.device.answers().is_ok() {
            // It is released anyway, and stops on its own without further contact.
            let _ = self.device.ask(|camera| camera.stop_acquisition());
        }
    }
}
