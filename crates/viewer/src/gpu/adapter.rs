//! List of the graphics adapters, with a check of each.

use egui_wgpu::wgpu;

use super::Context;

/// A graphics card, or a software renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Graphics API, such as Vulkan.
    pub backend: String,
    /// Name and version of the driver; may be empty.
    pub driver: String,
    /// True for a software renderer.
    pub is_software: bool,
    /// Reason why it cannot be used; `None` if it can.
    pub fault: Option<String>,
}

impl Adapter {
    /// Returns all adapters that the window may use. Requests a device from each to check it.
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
