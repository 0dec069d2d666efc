//! Which adapters there are, and whether each can draw.

use egui_wgpu::wgpu;

use super::Context;

/// A graphics card, or a driver that draws without one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// The interface to its driver, such as Vulkan.
    pub backend: String,
    /// Name and version of the driver; may be empty.
    pub driver: String,
    /// Whether pictures are computed on the processor.
    pub is_software: bool,
    /// Why it cannot draw; `None` if it can.
    pub fault: Option<String>,
}

impl Adapter {
    /// Every adapter that the window may be given. Each was asked for a device.
    pub fn all() -> Vec<Self> {
        let backends = super::context::backends();
        let instance = super::context::instance();
        let adapters = pollster::block_on(instance.enumerate_adapters(backends));
        adapters.iter().map(|adapter| Self::of(&instance, adapter)).collect()
    }

    fn of(instance: &wgpu::Instance, adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        Self {
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            backend: format!("{:?}", info.backend),
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            fault: Context::of_adapter(instance.clone(), adapter).err().map(|e| e.to_string()),
            name: info.name,
        }
    }
}
