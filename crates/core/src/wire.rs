//! Fields of types that serde sends to another process: shared values, and long lists of numbers as bytes.
//!
//! For a process of the same program on the same machine: the bytes are in native order.

/// A shared value (`Arc`), sent as a plain value.
pub mod shared {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes the value.
    ///
    /// # Errors
    /// Errors of the format.
    pub fn serialize<T: Serialize, S: Serializer>(value: &Arc<T>, to: S) -> Result<S::Ok, S::Error> {
        T::serialize(value, to)
    }

    /// Reads a value.
    ///
    /// # Errors
    /// Errors of the format.
    pub fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<Arc<T>, D::Error> {
        T::deserialize(from).map(Arc::new)
    }
}

/// A list of shared values.
pub(crate) mod shared_list {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<T: Serialize, S: Serializer>(
        values: &[Arc<T>],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(values.iter().map(|value| &**value))
    }

    pub(crate) fn deserialize<'de, T, D>(from: D) -> Result<Vec<Arc<T>>, D::Error>
    where
        T: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        Vec::<T>::deserialize(from).map(|all| all.into_iter().map(Arc::new).collect())
    }
}

/// A list of plain values, as bytes.
pub mod plain {
    use std::fmt;
    use std::marker::PhantomData;

    use bytemuck::Pod;
    use serde::de::{Error, Visitor};
    use serde::{Deserializer, Serializer};

    /// Writes the bytes of all values.
    ///
    /// # Errors
    /// Errors of the format.
    pub fn serialize<T: Pod, S: Serializer>(values: &[T], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(bytemuck::cast_slice(values))
    }

    /// Reads values.
    ///
    /// # Errors
    /// Errors of the format, and a number of bytes that does not fit.
    pub fn deserialize<'de, T: Pod, D: Deserializer<'de>>(from: D) -> Result<Vec<T>, D::Error> {
        from.deserialize_bytes(Bytes(PhantomData))
    }

    struct Bytes<T>(PhantomData<T>);

    impl<T: Pod> Visitor<'_> for Bytes<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the bytes of a list")
        }

        fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Vec<T>, E> {
            let size = size_of::<T>();
            if !bytes.len().is_multiple_of(size) {
                return Err(E::invalid_length(bytes.len(), &self));
            }
            let mut values = vec![T::zeroed(); bytes.len() / size];
            bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
            Ok(values)
        }
    }
}

/// A list of plain values that may be missing.
pub(crate) mod optional {
    use bytemuck::Pod;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<T: Pod, S: Serializer>(
        values: &Option<Vec<T>>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        values.as_deref().map(Borrowed).serialize(to)
    }

    pub(crate) fn deserialize<'de, T: Pod, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<Vec<T>>, D::Error> {
        Ok(Option::<Owned<T>>::deserialize(from)?.map(|owned| owned.0))
    }

    struct Borrowed<'a, T>(&'a [T]);

    impl<T: Pod> Serialize for Borrowed<'_, T> {
        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
            super::plain::serialize(self.0, to)
        }
    }

    struct Owned<T>(Vec<T>);

    impl<'de, T: Pod> Deserialize<'de> for Owned<T> {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            super::plain::deserialize(from).map(Self)
        }
    }
}
