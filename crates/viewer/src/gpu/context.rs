//! The GPU device and its capabilities.

use std::sync::{Arc, Mutex, PoisonError};

use egui_wgpu::wgpu;
use lodsmith_core::mesh::creases::Creases;

use super::layout::Layouts;

/// Error that prevents drawing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No driver was found, neither for a graphics card nor a software renderer.
    #[error(
        "no graphics adapter was found ({reason}). Install a Vulkan driver: on Debian and Ubuntu `apt install \
         mesa-vulkan-drivers libvulkan1`, on Fedora `dnf install mesa-vulkan-drivers`; this one also draws without a \
         graphics card"
    )]
    NoAdapter {
        /// Error message of the driver library.
        reason: String,
    },
    /// The adapter does not provide a device.
    #[error("the graphics adapter {adapter} provides no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Error message of the driver library.
        reason: String,
    },
}

/// Maximum content of one buffer; larger meshes are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferLimits {
    /// Maximum number of triangles in one buffer.
    pub triangles: usize,
    /// Maximum number of wedges in one buffer.
    pub wedges: usize,
}

/// Maximum number of triangles in one buffer even if the adapter allows more: their indices take 60 MB, so
/// that updates stay small.
const MAX_CHUNK_TRIANGLES: usize = 5_000_000;
/// Storage buffers of the vertex stage: instances, palette, and per mesh indices, corners, rows, heat and
/// morphs. With fewer, textures take their place.
const STORAGE_BUFFERS: u32 = 7;
/// Number of items in a row of a texture: all that WebGL guarantees. The same as in `pull_textures.wgsl`.
pub(super) const ROW_ITEMS: u64 = 2048;
/// Largest number of words in the row of a wedge, with every attribute.
const ROW_WORDS: u64 = 16;

/// The device: cheap to clone, usable from any thread.
#[derive(Clone)]
pub struct Context {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) layouts: Arc<Layouts>,
    pub(super) buffer_limits: BufferLimits,
    /// True if vertices pull their values from textures.
    pub(super) pulls_textures: bool,
    /// True if a texture can have both an sRGB and a linear view.
    pub(super) has_views: bool,
    info: Arc<wgpu::AdapterInfo>,
    instance: wgpu::Instance,
    /// Which edges of models without normals are sharp. Shared by all clones.
    creases: Arc<Mutex<Creases>>,
}

impl Context {
    /// Wraps the device of a window.
    ///
    /// A window created with [`Context::setup`] has as many storage buffers as the adapter.
    pub fn of_window(state: &egui_wgpu::RenderState) -> Self {
        let (device, queue) = (state.device.clone(), state.queue.clone());
        Self::with(state.instance.clone(), &state.adapter, device, queue)
    }

    /// Requests a device without a window or display.
    ///
    /// # Errors
    /// Any [`GpuError`].
    pub fn headless() -> Result<Self, GpuError> {
        let instance = instance();
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
            .map_err(|e| GpuError::NoAdapter { reason: e.to_string() })?;
        Self::of_adapter(instance, &adapter)
    }

    pub(super) fn of_adapter(instance: wgpu::Instance, adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let (device, queue) = pollster::block_on(adapter.request_device(&device_descriptor(adapter)))
            .map_err(|e| GpuError::NoDevice { adapter: adapter.get_info().name, reason: e.to_string() })?;
        Ok(Self::with(instance, adapter, device, queue))
    }

    fn with(
        instance: wgpu::Instance,
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Self {
        let limits = device.limits();
        let info = Arc::new(adapter.get_info());
        let pulls_textures = limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS;
        let layouts = Arc::new(Layouts::new(&device, pulls_textures));
        let flags = adapter.get_downlevel_capabilities().flags;
        let has_views = flags.contains(wgpu::DownlevelFlags::VIEW_FORMATS);
        let buffer_limits = buffer_limits(&limits, pulls_textures);
        let creases = Arc::default();
        Self { device, queue, layouts, buffer_limits, pulls_textures, has_views, info, instance, creases }
    }

    /// Lets vertices pull their values from textures even if the adapter has storage buffers.
    pub fn with_vertex_textures(self) -> Self {
        let layouts = Arc::new(Layouts::new(&self.device, true));
        let buffer_limits = buffer_limits(&self.device.limits(), true);
        Self { layouts, buffer_limits, pulls_textures: true, ..self }
    }

    /// Returns the setup for a window: its device gets all limits of the adapter, not only those of a
    /// browser.
    pub fn setup() -> egui_wgpu::WgpuSetup {
        let mut setup = egui_wgpu::WgpuSetupCreateNew::without_display_handle();
        setup.device_descriptor = Arc::new(device_descriptor);
        egui_wgpu::WgpuSetup::CreateNew(setup)
    }

    /// Sets smaller buffers than the adapter requires; meshes are split to fit them.
    pub fn with_buffer_limits(self, split: BufferLimits) -> Self {
        Self { buffer_limits: split, ..self }
    }

    /// Returns which edges of uploaded models without normals are sharp.
    pub fn creases(&self) -> Creases {
        *self.creases.lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// Sets which edges of models uploaded from now on are sharp, for all clones.
    pub fn set_creases(&self, creases: Creases) {
        *self.creases.lock().unwrap_or_else(PoisonError::into_inner) = creases;
    }

    /// Returns true for a software renderer, whose cost depends on every pixel.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }
    /// Returns the name of the adapter and its graphics API, for display.
    pub fn adapter_name(&self) -> String {
        format!("{} ({:?})", self.info.name, self.info.backend)
    }
    /// Returns name and version of the driver, for display; may be empty.
    pub fn driver(&self) -> String {
        format!("{} {}", self.info.driver, self.info.driver_info).trim().to_owned()
    }
    /// Returns the numbers of buffers and textures currently allocated; `None` if the backend does not count
    /// them.
    pub fn resource_counts(&self) -> Option<[usize; 2]> {
        let report = self.instance.generate_report()?;
        let hub = report.hub_report();
        Some([hub.buffers.num_allocated, hub.textures.num_allocated])
    }
    /// Samples per pixel: four on a graphics card, one on a software renderer, which is then four times as
    /// fast.
    pub(super) fn sample_count(&self) -> u32 {
        if self.is_software() { 1 } else { 4 }
    }
}

fn buffer_limits(limits: &wgpu::Limits, pulls_textures: bool) -> BufferLimits {
    if pulls_textures {
        let items = ROW_ITEMS * u64::from(limits.max_texture_dimension_2d);
        let triangles = MAX_CHUNK_TRIANGLES.min((items / 3) as usize);
        return BufferLimits { triangles, wedges: (items / ROW_WORDS) as usize };
    }
    let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    // A wedge takes 16 bytes for position and normal and, with every attribute, its row.
    let triangles = MAX_CHUNK_TRIANGLES.min((bytes / 12) as usize);
    BufferLimits { triangles, wedges: (bytes / (4 * ROW_WORDS)) as usize }
}

/// Graphics APIs to try.
pub(super) fn backends() -> wgpu::Backends {
    wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY | wgpu::Backends::GL)
}

/// Creates a wgpu instance without a window.
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
        // For timing, if available.
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        ..wgpu::DeviceDescriptor::default()
    }
}
