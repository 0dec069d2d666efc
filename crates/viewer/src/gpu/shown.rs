//! A model with its GPU buffers.

use std::sync::{Arc, Mutex};

use crate::gpu::DrawModel;

/// A model that can be shown, with its GPU buffers.
pub struct ShownModel<T> {
    /// The model.
    pub content: Arc<T>,
    /// GPU buffers; `None` without an adapter.
    pub draw: Option<Drawing>,
}

impl<T> ShownModel<T> {
    /// Returns the address of the content, as an identity while it is alive.
    pub fn key(&self) -> usize {
        Arc::as_ptr(&self.content) as usize
    }
}

impl<T> Clone for ShownModel<T> {
    fn clone(&self) -> Self {
        Self { content: self.content.clone(), draw: self.draw.clone() }
    }
}

/// GPU buffers that the window draws and the worker writes distances into.
pub type Drawing = Arc<Mutex<DrawModel>>;
