//! The device, and what it can do.

use std::sync::Arc;

use egui_wgpu::wgpu;

use super::layout::Layouts;

/// Why nothing can be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no driver for any graphics card, nor one that computes pictures.
    #[error(
        "no graphics adapter was found ({reason}). Install a Vulkan driver: on Debian and Ubuntu `apt install \
         mesa-vulkan-drivers libvulkan1`, on Fedora `dnf install mesa-vulkan-drivers`; this one also draws without a \
         graphics card"
    )]
    NoAdapter {
        /// What the driver library says.
        reason: String,
    },
    /// The adapter does not give a device.
    #[error("the graphics adapter {adapter} gives no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// What the driver library says.
        reason: String,
    },
    /// The adapter lacks what every pass needs.
    #[error(
        "the graphics adapter {adapter} has {got} storage buffers in the vertex stage, and {wanted} are needed. Update \
         its driver, or install one that draws without a graphics card (`mesa-vulkan-drivers`)"
    )]
    TooFewBuffers {
        /// Name of the adapter.
        adapter: String,
        /// How many it has.
        got: u32,
        /// How many are needed.
        wanted: u32,
    },
}

/// What may stand in one buffer: larger meshes are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// Most triangles in one buffer.
    pub triangles: usize,
    /// Most wedges in one buffer.
    pub wedges: usize,
}

/// Triangles in one buffer where the adapter allows more: their indices take 60 MB, so an update stays small.
const CHUNK_TRIANGLES: usize = 5_000_000;
/// Storage buffers that the vertex stage reads: instances, palette, and of a mesh indices, places, values, heat, morphs.
pub(super) const STORAGE_BUFFERS: u32 = 7;

/// The device: cheap to clone, usable from any thread.
#[derive(Clone)]
pub struct Context {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) layouts: Arc<Layouts>,
    pub(super) split: Split,
    /// Whether a texture can be seen both as sRGB and as light.
    pub(super) has_views: bool,
    info: Arc<wgpu::AdapterInfo>,
    instance: wgpu::Instance,
}

impl Context {
    /// The device of a window.
    ///
    /// # Errors
    /// [`GpuError::TooFewBuffers`]. A window that was made with [`Context::setup`] has as many as the adapter.
    pub fn of_window(state: &egui_wgpu::RenderState) -> Result<Self, GpuError> {
        let (device, queue) = (state.device.clone(), state.queue.clone());
        Self::with(state.instance.clone(), &state.adapter, device, queue)
    }

    /// A device without any window or display.
    ///
    /// # Errors
    /// Each [`GpuError`].
    pub fn headless() -> Result<Self, GpuError> {
        let instance = instance();
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
            .map_err(|e| GpuError::NoAdapter { reason: e.to_string() })?;
        Self::of_adapter(instance, &adapter)
    }

    pub(super) fn of_adapter(instance: wgpu::Instance, adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let (device, queue) = pollster::block_on(adapter.request_device(&device_descriptor(adapter)))
            .map_err(|e| GpuError::NoDevice { adapter: adapter.get_info().name, reason: e.to_string() })?;
        Self::with(instance, adapter, device, queue)
    }

    fn with(
        instance: wgpu::Instance,
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Result<Self, GpuError> {
        let limits = device.limits();
        let info = adapter.get_info();
        let got = limits.max_storage_buffers_per_shader_stage;
        if got < STORAGE_BUFFERS {
            return Err(GpuError::TooFewBuffers { adapter: info.name, got, wanted: STORAGE_BUFFERS });
        }
        let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        // A wedge takes at most 16 bytes of places and, with every attribute, some 64 of values.
        let split =
            Split { triangles: CHUNK_TRIANGLES.min((bytes / 12) as usize), wedges: (bytes / 64) as usize };
        let layouts = Arc::new(Layouts::new(&device));
        let flags = adapter.get_downlevel_capabilities().flags;
        let has_views = flags.contains(wgpu::DownlevelFlags::VIEW_FORMATS);
        Ok(Self { device, queue, layouts, split, has_views, info: Arc::new(info), instance })
    }

    /// How a window is to ask for its device: with all that the adapter allows, not only what a browser does.
    pub fn setup() -> egui_wgpu::WgpuSetup {
        let mut setup = egui_wgpu::WgpuSetupCreateNew::without_display_handle();
        setup.device_descriptor = Arc::new(device_descriptor);
        egui_wgpu::WgpuSetup::CreateNew(setup)
    }

    /// The same, with meshes split into smaller buffers than the adapter asks for.
    pub fn with_split(self, split: Split) -> Self {
        Self { split, ..self }
    }

    /// Whether pictures are computed on the processor: then every pixel counts.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }
    /// Name of the adapter and its driver interface, for people.
    pub fn adapter_name(&self) -> String {
        format!("{} ({:?})", self.info.name, self.info.backend)
    }
    /// Name and version of the driver, for people; may be empty.
    pub fn driver(&self) -> String {
        format!("{} {}", self.info.driver, self.info.driver_info).trim().to_owned()
    }
    /// How many buffers and textures the device holds now; `None` where it does not count.
    pub fn resource_counts(&self) -> Option<[usize; 2]> {
        let report = self.instance.generate_report()?;
        let hub = report.hub_report();
        Some([hub.buffers.num_allocated, hub.textures.num_allocated])
    }
    /// Samples for each pixel: four on a graphics card; one where a processor does the work, four times as fast.
    pub(super) fn sample_count(&self) -> u32 {
        if self.is_software() { 1 } else { 4 }
    }
}

/// The interfaces to drivers that are tried.
pub(super) fn backends() -> wgpu::Backends {
    wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY | wgpu::Backends::GL)
}

/// The driver library, without any window.
pub(super) fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: backends(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor {
        label: Some("lodsmith"),
        required_limits: adapter.limits(),
        // To measure with, where there is a clock.
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        ..wgpu::DeviceDescriptor::default()
    }
}
