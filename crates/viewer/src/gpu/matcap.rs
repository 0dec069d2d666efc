//! Matcap images.

use std::sync::atomic::{AtomicU64, Ordering};

use egui_wgpu::wgpu;
use lodsmith_core::Image;

use super::context::Context;
use super::texture::texture;

/// A matcap: a picture of a lit sphere, sampled by the normal.
pub struct Matcap {
    id: u64,
    pub(super) view: wgpu::TextureView,
}

static NEXT_MATCAP: AtomicU64 = AtomicU64::new(1);

impl Matcap {
    pub(super) fn new(context: &Context, image: &Image) -> Self {
        let view = texture(context, image, true);
        Self { id: NEXT_MATCAP.fetch_add(1, Ordering::Relaxed), view }
    }

    pub(super) fn id(&self) -> u64 {
        self.id
    }
}
